//! What all formats share: choosing the reader, and errors about the file itself.

use std::path::{Path, PathBuf};

use trixel_io::read::{MeshFormat, ReadError, ReadOptions, read_mesh, read_mesh_bytes};

const OFF: &str = "OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";

/// A file of its own, removed at the end.
struct File(PathBuf);

impl File {
    fn new(name: &str, bytes: &[u8]) -> Self {
        let path = std::env::temp_dir().join(format!("trixel-framework-{}-{name}", std::process::id()));
        std::fs::write(&path, bytes).unwrap();
        Self(path)
    }

    fn read(&self) -> Result<usize, ReadError> {
        read_mesh(&self.0, &ReadOptions::default()).map(|loaded| loaded.mesh.triangles.len())
    }
}

impl Drop for File {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

#[test]
fn the_extension_picks_the_reader_in_any_case() {
    assert_eq!(File::new("a.OfF", OFF.as_bytes()).read().unwrap(), 1);
    assert_eq!(MeshFormat::from_path(Path::new("x/part.STL")), Some(MeshFormat::Stl));
    assert_eq!(MeshFormat::from_path(Path::new("x/part.3MF")), Some(MeshFormat::ThreeMf));
    assert_eq!(MeshFormat::from_path(Path::new("x/part.stl.bak")), None);
    assert_eq!(MeshFormat::from_path(Path::new("stl")), None);
}

#[test]
fn without_a_known_extension_the_first_bytes_do() {
    assert_eq!(File::new("no-extension", OFF.as_bytes()).read().unwrap(), 1);
    assert_eq!(File::new("b.backup", &super::stl::binary("x")).read().unwrap(), 2);
    assert_eq!(File::new("c.bin", &super::ply::binary(true)).read().unwrap(), 4);
}

#[test]
fn an_unknown_format_lists_the_known_ones() {
    let message = File::new("song.mp3", b"ID3").read().unwrap_err().to_string();
    assert!(message.contains("song.mp3: unknown mesh format; trixel reads .obj, .stl"), "{message}");
}

#[test]
fn missing_files_folders_and_empty_files_are_named() {
    let missing = read_mesh(Path::new("/no/such/mesh.obj"), &ReadOptions::default()).unwrap_err();
    assert!(matches!(missing, ReadError::Io { .. }));
    assert!(missing.to_string().starts_with("cannot read /no/such/mesh.obj: "), "{missing}");
    let folder = read_mesh(&std::env::temp_dir(), &ReadOptions::default()).unwrap_err();
    assert!(matches!(folder, ReadError::Io { .. }), "{folder}");
    for name in ["empty.obj", "empty.glb", "empty"] {
        let message = File::new(name, b"").read().unwrap_err().to_string();
        assert!(message.ends_with(&format!("{name}: start: the file is empty (0 bytes)")), "{message}");
    }
}

#[test]
fn errors_carry_the_path() {
    let file = File::new("broken.off", b"OFF 3 1 0\n");
    assert!(file.read().unwrap_err().to_string().starts_with(&file.0.display().to_string()));
    let file = File::new("points.off", b"OFF 0 0 0\n");
    assert!(matches!(file.read(), Err(ReadError::Empty { path }) if path == file.0));
}

#[test]
fn bytes_of_every_format_are_read_without_a_file() {
    for format in MeshFormat::ALL {
        let error = read_mesh_bytes(format, b"", &ReadOptions::default()).unwrap_err().to_string();
        assert_eq!(error, format!("<bytes>.{}: start: the file is empty (0 bytes)", format.extension()));
        assert!(read_mesh_bytes(format, b"\xff\xfe nonsense", &ReadOptions::default()).is_err());
    }
}
