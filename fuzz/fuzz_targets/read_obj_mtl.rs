#![no_main]

mod reader;

use std::path::PathBuf;
use std::sync::LazyLock;

use trixel_io::read::{ReadOptions, read_mesh};

/// Each process has its own folder.
static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = std::env::temp_dir().join(format!("trixel-fuzz-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder for temporary files");
    folder
});

// The `.obj` file, a zero byte, the `.mtl` file that it may name as `a.mtl`.
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let (obj, mtl) = bytes.split_at(bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len()));
    let path = FOLDER.join("a.obj");
    std::fs::write(&path, obj).expect("the folder can be written");
    std::fs::write(FOLDER.join("a.mtl"), mtl.get(1..).unwrap_or_default()).expect("the folder can be written");
    if let Ok(loaded) = read_mesh(&path, &ReadOptions::default()) {
        reader::check(loaded.mesh);
    }
});
