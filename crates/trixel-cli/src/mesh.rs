//! Meshes by name: files and built-in scenes.

use std::path::Path;

use anyhow::{Result, anyhow};
use trixel::{Mesh, UpAxis, scene};
use trixel_io::read::{MeshFormat, ReadOptions, read_mesh};

use crate::progress::Reporter;

/// Reads a mesh file or builds a scene.
pub(crate) fn load(input: &str, attributes: bool, reporter: &Reporter) -> Result<Mesh> {
    if let Some(spec) = input.strip_prefix("scene:") {
        return scene::build(spec).map_err(|error| anyhow!("{input}: {error}"));
    }
    let loaded = read_mesh(Path::new(input), &ReadOptions { attributes })?;
    loaded.warnings.iter().for_each(|warning| reporter.warn(format!("{input}: {warning}")));
    Ok(loaded.mesh)
}

/// The axis that points up: what the file says, or what its format is mostly used with.
pub(crate) fn up(input: &str, mesh: &Mesh) -> UpAxis {
    mesh.up.unwrap_or(match MeshFormat::from_path(Path::new(input)) {
        Some(MeshFormat::Stl | MeshFormat::ThreeMf) => UpAxis::Z,
        _ => UpAxis::Y,
    })
}

/// One line a scene, for `--help`.
pub(crate) fn scene_list() -> String {
    let lines = scene::SCENES.iter().map(|scene| format!("  {:14}{}", scene.name, scene.description));
    lines.collect::<Vec<_>>().join("\n")
}
