//! What the benchmarks under `benches/` run on: built-in scenes, and real meshes where they are present.

use std::path::{Path, PathBuf};

use trixel::Mesh;
use trixel_io::read::{ReadOptions, read_mesh};

/// Built-in scenes that stand for the kinds of mesh there are.
pub const SCENES: [&str; 6] = [
    "scene:torus:512",
    "scene:sphere:256",
    "scene:triangle",
    "scene:room:64",
    "scene:room-rotated:64",
    "scene:city:24",
];

/// Real meshes, relative to the folder of meshes, which may be absent.
pub const MODELS: [&str; 3] =
    ["bunny/bunny_69666_watertight.off", "stanford-dragon/dragon_vrip.ply", "sponza/Sponza.gltf"];

/// The folder of real meshes: `TRIXEL_MODELS`, or `shared/models` beside the workspace.
#[must_use]
pub fn models_folder() -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/models");
    let folder = std::env::var_os("TRIXEL_MODELS").map_or_else(beside, PathBuf::from);
    folder.is_dir().then_some(folder)
}

/// The names of all meshes that are there.
#[must_use]
pub fn inputs() -> Vec<&'static str> {
    let present = |name: &&&str| models_folder().is_some_and(|folder| folder.join(name).is_file());
    SCENES.iter().chain(MODELS.iter().filter(present)).copied().collect()
}

/// Those of [`inputs`] in which the first word of the command line is that is no option, or all.
#[must_use]
pub fn asked_for() -> Vec<&'static str> {
    let word = std::env::args().skip(1).find(|argument| !argument.starts_with('-')).unwrap_or_default();
    inputs().into_iter().filter(|name| name.contains(&word)).collect()
}

/// A mesh by a name from [`inputs`]; `None` if it cannot be read.
#[must_use]
pub fn load(name: &str) -> Option<Mesh> {
    match name.strip_prefix("scene:") {
        Some(spec) => trixel::scene::build(spec).ok(),
        None => read_mesh(&models_folder()?.join(name), &ReadOptions { attributes: false }).ok().map(|l| l.mesh),
    }
}
