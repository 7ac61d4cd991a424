//! What people get told when they hand over the wrong file: the message names the file, what is wrong and what to do.

#![expect(clippy::unwrap_used, reason = "a failure here is a failed test")]

use std::fs;
use std::path::Path;

use trixel::{Grid, Volume};
use trixel_io::read::{ReadOptions, read_mesh};
use trixel_io::volume_read::{read_grid, read_volume};
use trixel_io::write::{NpzWriter, WriteOptions, write_volume};

fn mesh(path: &Path) -> String {
    read_mesh(path, &ReadOptions::default()).unwrap_err().to_string()
}

fn volume(path: &Path) -> String {
    let message = read_volume(path, Some(1 << 20)).unwrap_err().to_string();
    if let Err(error) = read_grid(path) {
        assert_eq!(error.to_string(), message, "both readers say the same");
    }
    message
}

fn write(path: &Path, grid: Grid) -> String {
    write_volume(path, &Volume::new(grid).unwrap(), &WriteOptions::default()).unwrap_err().to_string()
}

/// Compares messages with what they should be, with `DIR` for the folder.
#[track_caller]
fn assert_says(folder: &Path, message: &str, expected: &str) {
    let message = message.replace(&folder.display().to_string(), "DIR");
    assert!(message.contains(expected), "{message}\nshould say\n{expected}");
}

#[test]
fn meshes() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::create_dir(folder.join("folder.obj")).unwrap();
    let missing = mesh(&folder.join("missing.obj"));
    assert_says(folder, &missing, "cannot read DIR/missing.obj: ");
    assert_says(folder, &mesh(folder), "cannot read DIR: this is a folder; name a file in it");
    assert_says(folder, &mesh(&folder.join("folder.obj")), "cannot read DIR/folder.obj: this is a folder");
    let off = b"OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let obj = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let points = b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n";
    let draco = br#"{"asset": {"version": "2.0"}, "extensionsRequired": ["KHR_draco_mesh_compression"]}"#;
    let buffer = br#"{"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}], "buffers":
        [{"uri": "gone.bin", "byteLength": 36}], "bufferViews": [{"buffer": 0, "byteLength": 36}], "accessors":
        [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}], "meshes":
        [{"primitives": [{"attributes": {"POSITION": 0}}]}]}"#;
    for (name, bytes, expected) in [
        ("picture.png", &b"\x89PNG\r\n\x1a\n"[..], "unknown mesh format; trixel reads .obj, .stl"),
        ("part.step", b"ISO-10303-21;", "export the mesh as one of them"),
        ("volume.npz", b"PK\x03\x04", "this is a volume, and a mesh is wanted here"),
        ("empty.stl", b"", "the file is empty (0 bytes)"),
        ("off.obj", off, "the file is not .obj but .off by its content; rename it"),
        ("zip.glb", b"PK\x03\x04", "the file is not .glb but .3mf by its content"),
        ("glb.obj", b"glTF\x02\0\0\0\x0c\0\0\0", "the file is not .obj but .glb by its content"),
        ("obj.stl", obj, "truncated or not STL"),
        ("obj.ply", obj, "line 1: a PLY file starts with the line `ply`"),
        ("points.ply", points, "no triangle in this file; points and curves alone have no surface"),
        ("pointer.stl", b"version https://git-lfs.github.com/spec/v1\nsize 12345\n", "fetch it with `git lfs pull`"),
        ("page.gltf", b"<!DOCTYPE html>", "the file is damaged or no glTF"),
        ("cut.glb", b"glTF\x02\0\0\0\xff\0\0\0\0\0\0\0", "says 255 bytes, but the file has 16: it is cut off"),
        ("draco.gltf", draco, "requires the extension KHR_draco_mesh_compression, which is not supported; export"),
        ("buffer.gltf", buffer, "buffer 0: cannot read 'gone.bin'"),
        ("text.3mf", b"hello", "the file is cut off or no 3MF"),
        ("picture.dae", b"<svg/>", "there is no <COLLADA> element"),
        ("cut.dae", b"<COLLADA><asset>", "the XML ends too soon; the file is cut off"),
    ] {
        let path = folder.join(name);
        fs::write(&path, bytes).unwrap();
        let message = mesh(&path);
        assert_says(folder, &message, expected);
        assert_says(folder, &message, &format!("DIR/{name}: "));
    }
    // An archive, but not of this kind.
    let mut archive = NpzWriter::new(fs::File::create(folder.join("other.3mf")).unwrap());
    archive.array("a", "|b1", &[1], 1, &|_, out| out.push(1), &mut |_| {}).unwrap();
    archive.finish().unwrap();
    assert_says(folder, &mesh(&folder.join("other.3mf")), "3D/3dmodel.model: is not in the package");
    fs::rename(folder.join("other.3mf"), folder.join("other.npz")).unwrap();
    assert_says(folder, &volume(&folder.join("other.npz")), "neither an array named occupancy nor one named indices");
}

#[test]
fn volumes() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::create_dir(folder.join("folder.npz")).unwrap();
    assert_says(folder, &volume(&folder.join("missing.npz")), "cannot read DIR/missing.npz: ");
    assert_says(folder, &volume(&folder.join("folder.npz")), "cannot read DIR/folder.npz: this is a folder");
    for (name, bytes, expected) in [
        ("scene.vox", &b"VOX "[..], "it reads .npz, .npy, .binvox, .vti, .nrrd and .raw"),
        ("mesh.stl", b"solid", "not a volume format that trixel reads"),
        ("text.npz", b"hello", "the file was cut short or is not a NumPy archive"),
        ("text.npy", b"hello there, this is text", "this is not a NumPy array"),
        ("text.nrrd", b"hello", "so it is not an NRRD file"),
        ("text.binvox", b"hello\n", "the first line is not #binvox"),
        ("mesh.vti", b"<VTKFile type=\"PolyData\"/>", "this is not a VTK file of type ImageData"),
        ("cut.vti", b"<VTKFile type=\"ImageData\">", "the XML ends too soon; the file is cut off"),
        ("lonely.raw", b"\0", "a .raw file needs it, as it holds dims, origin and voxel_size"),
        ("empty.npy", b"", "the file is empty (0 bytes)"),
        ("empty.npz", b"", "the file is empty (0 bytes)"),
        ("empty.vti", b"", "the file is empty (0 bytes)"),
        ("empty.raw", b"", "the file is empty (0 bytes)"),
    ] {
        let path = folder.join(name);
        fs::write(&path, bytes).unwrap();
        let message = volume(&path);
        assert_says(folder, &message, expected);
        assert_says(folder, &message, &format!("DIR/{name}: "));
    }
    let path = folder.join("big.npy");
    let large = Volume::new(Grid::new([0.0; 3], [1.0; 3], [256; 3]).unwrap()).unwrap();
    write_volume(&path, &large, &WriteOptions::default()).unwrap().commit().unwrap();
    let message = read_volume(&path, Some(1 << 20)).unwrap_err().to_string();
    assert_says(folder, &message, "needs 2.0 MiB, but only 1.0 MiB are available");
}

#[test]
fn outputs() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::create_dir(folder.join("folder.npz")).unwrap();
    let unit = || Grid::new([0.0; 3], [1.0; 3], [1; 3]).unwrap();
    let flat = Grid::new([0.0; 3], [1.0, 1.0, 2.0], [1; 3]).unwrap();
    let long = Grid::new([0.0; 3], [1.0; 3], [2001, 1, 1]).unwrap();
    let far = Grid::new([1e9, 0.0, 0.0], [1e-3; 3], [3; 3]).unwrap();
    for (name, grid, expected) in [
        ("a.xyz", unit(), "unknown volume format; trixel writes .npz, .npy"),
        ("a", unit(), "unknown volume format"),
        ("gone/a.npz", unit(), "there is no folder DIR/gone; create it first"),
        ("folder.npz", unit(), "a folder has this name; choose another"),
        ("a.binvox", flat, "cubic voxels only, and these measure 1 x 1 x 2"),
        ("a.vox", long, "ends at 2000 along each axis"),
        ("a.stl", far, "write .obj or .ply, which hold double precision"),
    ] {
        assert_says(folder, &write(&folder.join(name), grid), expected);
        assert_eq!(fs::read_dir(folder).unwrap().count(), 1, "{name} left something behind");
    }
}

#[cfg(unix)]
#[test]
fn a_folder_that_may_not_be_written() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o500)).unwrap();
    let path = folder.path().join("a.npz");
    let grid = Grid::new([0.0; 3], [1.0; 3], [1; 3]).unwrap();
    // The system's administrator may write anywhere.
    if fs::write(folder.path().join("probe"), "").is_err() {
        assert_says(folder.path(), &write(&path, grid), "cannot write DIR/a.npz: Permission denied");
    }
}

/// A device that never ends is refused after a bounded read instead of filling the memory.
#[cfg(target_os = "linux")]
#[test]
fn an_endless_device_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("zero.stl");
    std::os::unix::fs::symlink("/dev/zero", &path).unwrap();
    let error = trixel_io::read::read_mesh(&path, &trixel_io::read::ReadOptions::default()).unwrap_err().to_string();
    assert!(error.contains("not a regular file") && error.contains("save it"), "{error}");
}
