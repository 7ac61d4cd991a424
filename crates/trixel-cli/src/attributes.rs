//! What `--attributes`, `--combine` and `--priority` ask for.

use std::path::PathBuf;

use anyhow::{Result, bail};
use trixel::attributes::{AttributeKind, AttributeRequest};
use trixel::{Material, Mesh};
use trixel_io::{AttributeSupport, VolumeFormat};

use crate::args::AttributeArgs;

/// The request, if there is one.
pub(crate) fn request(args: &AttributeArgs, mesh: &Mesh) -> Result<Option<AttributeRequest>> {
    if args.attributes.is_empty() {
        return Ok(None);
    }
    let kinds: Vec<_> = args.attributes.iter().map(|&kind| kind.into()).collect();
    Ok(Some(AttributeRequest::new(&kinds, args.combine.into()).with_priorities(priorities(&args.priority, mesh)?)))
}

/// A warning when attributes are asked for that no output holds, which are then found out for nothing.
pub(crate) fn unheld(args: &AttributeArgs, outputs: &[PathBuf]) -> Option<String> {
    let support = |path: &PathBuf| match VolumeFormat::from_path(path) {
        Some(format) => format.attributes(),
        // Pictures show colours.
        None => AttributeSupport::Colors,
    };
    let held = |kind: AttributeKind| {
        outputs.iter().map(support).any(|support| match support {
            AttributeSupport::All => true,
            AttributeSupport::Colors => kind == AttributeKind::Color,
            AttributeSupport::Nothing => false,
        })
    };
    let kinds = args.attributes.iter().map(|&kind| AttributeKind::from(kind));
    let names: Vec<_> = kinds.filter(|kind| !held(*kind)).map(AttributeKind::name).collect();
    let what = names.join(", ");
    (!names.is_empty() && !outputs.is_empty()).then(|| {
        format!("no output holds {what}: .npz and .vti take every attribute, .vox, .ply, .obj, .glb and .png colours")
    })
}

/// The priority of each material: the first that is named has the highest.
fn priorities(names: &[String], mesh: &Mesh) -> Result<Vec<u32>> {
    // The material itself, or all of one input's.
    let is_named = |material: &Material, name: &str| {
        material.name.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
    };
    for name in names {
        if !mesh.materials.iter().any(|material| is_named(material, name)) {
            const SHOWN: usize = 12;
            let mut known: Vec<_> = mesh.materials.iter().take(SHOWN).map(|material| material.name.as_str()).collect();
            if mesh.materials.len() > SHOWN {
                known.push("...");
            }
            bail!("--priority: the mesh has no material {name:?}; it has: {}", known.join(", "));
        }
    }
    let priority = |material: &Material| {
        let place = names.iter().position(|name| is_named(material, name));
        place.map_or(0, |place| u32::try_from(names.len() - place).unwrap_or(u32::MAX))
    };
    Ok(mesh.materials.iter().map(priority).collect())
}
