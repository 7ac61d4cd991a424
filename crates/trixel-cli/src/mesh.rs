//! Meshes by name: files and built-in scenes.

use std::path::Path;

use anyhow::{Result, anyhow};
use trixel::scene::{self, Scene};
use trixel::{Material, Mesh, UpAxis};
use trixel_io::read::{MeshFormat, ReadOptions, read_mesh};

use crate::progress::Reporter;

/// Reads a mesh file or builds a scene.
pub(crate) fn load(input: &str, attributes: bool, reporter: &Reporter) -> Result<Mesh> {
    if let Some(spec) = input.strip_prefix("scene:") {
        return Ok(scene::build(spec)?);
    }
    let loaded = read_mesh(Path::new(input), &ReadOptions { attributes })?;
    loaded.warnings.iter().for_each(|warning| reporter.warn(format!("{input}: {warning}")));
    Ok(loaded.mesh)
}

/// Reads several meshes into one, with materials that tell them apart; a single one as it is.
pub(crate) fn load_all(inputs: &[String], attributes: bool, reporter: &Reporter) -> Result<Mesh> {
    if let [input] = inputs {
        return load(input, attributes, reporter);
    }
    let mut all = Mesh::default();
    let mut first_up = None;
    for input in inputs {
        let mut mesh = load(input, attributes, reporter)?;
        let up = up(input, &mesh);
        let (first, expected) = first_up.get_or_insert((input, up));
        if up != *expected {
            reporter.warn(format!(
                "{input} is {up:?} up and {first} is {expected:?} up; they are put together as their coordinates say"
            ));
        }
        label(&mut mesh, &stem(input));
        all.append(mesh).map_err(|error| anyhow!("{input}: {error}"))?;
    }
    all.up = first_up.map(|(_, up)| up);
    Ok(all)
}

/// The name of an input among several.
pub(crate) fn stem(input: &str) -> String {
    match input.strip_prefix("scene:") {
        Some(scene) => scene.split(':').next().unwrap_or(scene).to_owned(),
        None => {
            Path::new(input).file_stem().map_or_else(|| input.to_owned(), |stem| stem.to_string_lossy().into_owned())
        }
    }
}

/// Gives every triangle a material, and every material the name of its mesh.
fn label(mesh: &mut Mesh, stem: &str) {
    for material in &mut mesh.materials {
        material.name = if material.name.is_empty() { stem.to_owned() } else { format!("{stem}/{}", material.name) };
    }
    mesh.triangle_materials.resize(mesh.triangles.len(), Mesh::NO_MATERIAL);
    if mesh.triangle_materials.contains(&Mesh::NO_MATERIAL) {
        let own = u32::try_from(mesh.materials.len()).unwrap_or(Mesh::NO_MATERIAL);
        mesh.materials.push(Material { name: stem.to_owned(), ..Material::default() });
        mesh.triangle_materials.iter_mut().filter(|of| **of == Mesh::NO_MATERIAL).for_each(|of| *of = own);
    }
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
