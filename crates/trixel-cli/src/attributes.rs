//! What `--attributes`, `--combine` and `--priority` ask for.

use anyhow::{Result, bail};
use trixel::Mesh;
use trixel::attributes::AttributeRequest;

use crate::args::AttributeArgs;

/// The request, if there is one.
pub(crate) fn request(args: &AttributeArgs, mesh: &Mesh) -> Result<Option<AttributeRequest>> {
    if args.attributes.is_empty() {
        return Ok(None);
    }
    let kinds: Vec<_> = args.attributes.iter().map(|&kind| kind.into()).collect();
    Ok(Some(AttributeRequest::new(&kinds, args.combine.into()).with_priorities(priorities(&args.priority, mesh)?)))
}

/// The priority of each material: the first that is named has the highest.
fn priorities(names: &[String], mesh: &Mesh) -> Result<Vec<u32>> {
    for name in names {
        if !mesh.materials.iter().any(|material| material.name == *name) {
            const SHOWN: usize = 12;
            let mut known: Vec<_> = mesh.materials.iter().take(SHOWN).map(|material| material.name.as_str()).collect();
            if mesh.materials.len() > SHOWN {
                known.push("...");
            }
            bail!("--priority: the mesh has no material {name:?}; it has: {}", known.join(", "));
        }
    }
    let priority = |name: &str| {
        let place = names.iter().position(|named| named == name);
        place.map_or(0, |place| u32::try_from(names.len() - place).unwrap_or(u32::MAX))
    };
    Ok(mesh.materials.iter().map(|material| priority(&material.name)).collect())
}
