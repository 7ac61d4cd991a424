//! Where the real meshes are, which may not be published.

use std::path::{Path, PathBuf};

/// The folder of real meshes: `TRIXEL_MODELS`, or `shared/models` beside the workspace. `None`, after saying so, where
/// there is none.
pub(crate) fn models_folder() -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/models");
    let folder = std::env::var_os("TRIXEL_MODELS").map_or_else(beside, PathBuf::from);
    if folder.is_dir() {
        return Some(folder);
    }
    println!("skipped: there is no folder {}; set TRIXEL_MODELS to the folder of the real meshes", folder.display());
    None
}
