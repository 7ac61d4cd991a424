//! Meshes by name: files and built-in scenes.

use std::path::Path;

use anyhow::{Result, anyhow};
use trixel::scene::{self, Scene};
use trixel::{Mesh, UpAxis};
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

/// The scenes, two lines each, for `--help`.
pub(crate) fn scene_list() -> String {
    let line = |scene: &Scene| {
        let Scene { name, description, parameter, default, .. } = scene;
        format!("  {name:14}{description}\n  {:14}N: {parameter}; {default} by default", "")
    };
    scene::SCENES.iter().map(line).collect::<Vec<_>>().join("\n")
}
