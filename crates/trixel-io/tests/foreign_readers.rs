//! What the writers write, readers that others wrote read; and the other way round.
//!
//! The scripts in `tests/foreign` at the workspace root do the foreign half. They need Python with the modules of
//! `requirements.txt` and Node with those of `package.json` there; a missing one fails the test and says how to get it.
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout, reason = "a test")]

mod common;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use common::{ANISOTROPIC, CUBIC, ORIGIN, samples};
use trixel::attributes::{AttributeKind, AttributeRequest, Combine, Described, compute};
use trixel::lattice::LatticeMesh;
use trixel::{Attribute, Grid, Job, Material, Mesh, Mode, Rank, UpAxis, Volume, set_bits};
use trixel_io::VolumeFormat;
use trixel_io::volume_read::{read_grid, read_volume};
use trixel_io::write::{WriteOptions, write_volume};

const SETUP: &str = "set it up at the workspace root with `python3 -m venv .venv && .venv/bin/pip install -r \
                     tests/foreign/requirements.txt && (cd tests/foreign && npm ci)`, or set TRIXEL_PYTHON";

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).unwrap().to_owned()
}

/// Runs a script of `tests/foreign` on a folder.
fn run(script: &str, folder: &Path) {
    let python = std::env::var_os("TRIXEL_PYTHON").map_or_else(|| workspace().join(".venv/bin/python"), PathBuf::from);
    let output = Command::new(&python)
        .arg(workspace().join("tests/foreign").join(script))
        .arg(folder)
        // Modules are imported from the script's folder; leave no compiled copies there.
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .output()
        .unwrap_or_else(|error| panic!("cannot run {}: {error}; {SETUP}", python.display()));
    let (stdout, stderr) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    let hint = if stderr.contains("ModuleNotFoundError") || stderr.contains("missing") { SETUP } else { "" };
    assert!(output.status.success(), "{script} failed\n{stdout}\n{stderr}\n{hint}");
    println!("{stdout}");
}

/// Area of the exposed faces and volume of the set voxels, voxel by voxel.
fn area_and_volume(volume: &Volume) -> (f64, f64) {
    let [hx, hy, hz] = volume.grid().voxel_size();
    let (mut area, mut enclosed) = (0.0, 0.0);
    for voxel in volume.iter() {
        enclosed += hx * hy * hz;
        for (axis, face) in [hy * hz, hx * hz, hx * hy].into_iter().enumerate() {
            for step in [1, u32::MAX] {
                let mut beside = voxel;
                beside[axis] = voxel[axis].wrapping_add(step);
                area += if volume.get(beside) { 0.0 } else { face };
            }
        }
    }
    (area, enclosed)
}

fn write_expected(folder: &Path, volume: &Volume, up: &str) {
    let grid = volume.grid();
    let [nx, ny, nz] = grid.dims();
    let mut bytes = Vec::new();
    for x in 0..nx {
        for y in 0..ny {
            bytes.extend((0..nz).map(|z| u8::from(volume.get([x, y, z]))));
        }
    }
    fs::write(folder.join("expected.bin"), bytes).unwrap();
    let (area, enclosed) = area_and_volume(volume);
    let expected = serde_json::json!({
        "dims": grid.dims(), "origin": grid.origin(), "voxel_size": grid.voxel_size(),
        "up": up, "area": area, "volume": enclosed,
    });
    fs::write(folder.join("expected.json"), expected.to_string()).unwrap();
}

#[test]
fn others_read_what_is_written() {
    let root = tempfile::tempdir().unwrap();
    let mut cases = Vec::new();
    for (kind, voxel_size) in [("cubic", CUBIC), ("anisotropic", ANISOTROPIC)] {
        cases.extend(samples(voxel_size).into_iter().map(|(name, volume)| (format!("{name}-{kind}"), volume)));
    }
    for ((name, volume), (up, axis)) in
        cases.iter().zip([("z", UpAxis::Z), ("y", UpAxis::Y), ("x", UpAxis::X)].into_iter().cycle())
    {
        let folder = root.path().join(name);
        fs::create_dir(&folder).unwrap();
        write_expected(&folder, volume, up);
        let options = WriteOptions { up: axis, ..WriteOptions::default() };
        for format in VolumeFormat::ALL {
            if format == VolumeFormat::Binvox && !volume.grid().is_cubic() {
                continue;
            }
            let path = folder.join(format!("volume.{}", format.extension()));
            write_volume(&path, volume, &options).unwrap().commit().unwrap();
        }
        let sparse = WriteOptions { sparse: true, ..options };
        write_volume(&folder.join("sparse.npz"), volume, &sparse).unwrap().commit().unwrap();
        #[cfg(feature = "zarr")]
        trixel_io::out_of_core::write_voxels(&folder.join("volume.zarr"), volume, None).unwrap();
        write_volume(&folder.join("points.ply"), volume, &sparse).unwrap().commit().unwrap();
    }
    run("check_volumes.py", root.path());
}

/// A tilted quad of two materials, with texture coordinates and colours at its corners.
fn two_tone() -> Mesh {
    let mut mesh =
        Mesh::new(vec![[0.2, 0.3, 0.4], [8.1, 0.9, 1.3], [7.7, 6.2, 4.4], [0.6, 5.8, 3.1]], vec![[0, 1, 2], [0, 2, 3]]);
    let color = |r: f32, b: f32| [r, 0.3, b, 1.0];
    mesh.colors = Some(Attribute::per_vertex(vec![color(0.0, 1.0), color(1.0, 0.0), color(0.5, 0.5), color(0.2, 0.9)]));
    mesh.uvs = vec![Attribute::per_vertex(vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])];
    let named = |name: &str| Material { name: name.to_owned(), ..Material::default() };
    mesh.materials = vec![named("glass"), named("Holz, \u{e4}lter")];
    mesh.triangle_materials = vec![0, 1];
    mesh
}

#[test]
fn others_read_the_attributes_that_are_written() {
    let root = tempfile::tempdir().unwrap();
    let mesh = two_tone();
    let grid = Grid::new([0.0; 3], [0.5, 0.5, 0.5], [18, 14, 11]).unwrap();
    let job = Job::new(grid, Mode::Conservative);
    let volume = trixel::voxelize(&mesh, &job).unwrap();
    let lattice = LatticeMesh::snap(&mesh, &grid).unwrap();
    let request = AttributeRequest::new(&AttributeKind::ALL, Combine::Mean);
    let attributes = compute(&mesh, &lattice, &job, &volume, &request).unwrap();
    let rank = Rank::new(&volume);
    let described = Described::new(&rank, &attributes).unwrap();

    let write = |name: &str, bytes: Vec<u8>| fs::write(root.path().join(name), bytes).unwrap();
    let mut layouts = serde_json::Map::new();
    for (kind, values) in attributes.columns() {
        let mut rows = Vec::new();
        (0..values.len()).for_each(|row| values.append_row(row, &mut rows));
        write(&format!("{}.bin", kind.name()), rows);
        let (dtype, channels) = values.layout();
        layouts.insert(kind.name().to_owned(), serde_json::json!([dtype, channels]));
    }
    let [nx, ny, _] = grid.dims();
    let columns = (0..nx).flat_map(|x| (0..ny).map(move |y| [x, y]));
    let voxels = columns.flat_map(|[x, y]| set_bits(volume.column(x, y)).map(move |z| [x, y, z]));
    write("indices.bin", voxels.flat_map(|voxel| voxel.map(u32::to_le_bytes).concat()).collect());
    let names: Vec<_> = mesh.materials.iter().map(|material| &material.name).collect();
    let expected = serde_json::json!({ "dims": grid.dims(), "attributes": layouts, "material_names": names });
    write("expected.json", expected.to_string().into_bytes());

    for (name, sparse) in [
        ("volume.npz", false),
        ("sparse.npz", true),
        ("volume.vti", false),
        ("points.ply", true),
        ("volume.ply", false),
        ("volume.glb", false),
    ] {
        let options = WriteOptions { up: UpAxis::Z, sparse, described: Some(described), progress: None };
        write_volume(&root.path().join(name), &volume, &options).unwrap().commit().unwrap();
    }
    run("check_attributes.py", root.path());
}

#[test]
fn what_others_write_is_read() {
    let folder = tempfile::tempdir().unwrap();
    run("write_volumes.py", folder.path());
    let dims = [7, 70, 131];
    let expected = fs::read(folder.path().join("expected.bin")).unwrap();
    let placed = Grid::new(ORIGIN, ANISOTROPIC, dims).unwrap();
    let mut read_files = 0;
    for entry in fs::read_dir(folder.path()).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if name == "expected.bin" {
            continue;
        }
        if let Some(rest) = name.strip_prefix("refused_") {
            let what = rest.split('.').next().unwrap();
            let message = read_volume(&path, None).unwrap_err().to_string().to_lowercase();
            assert!(message.contains(what), "{name}: {message}");
            continue;
        }
        let read = read_volume(&path, None).unwrap_or_else(|error| panic!("{error}"));
        let grid = *read.volume.grid();
        assert_eq!(read_grid(&path).unwrap().grid, grid, "{name}");
        match VolumeFormat::from_path(&path).unwrap() {
            VolumeFormat::Npy => assert_eq!(grid, Grid::new([0.0; 3], [1.0; 3], dims).unwrap()),
            VolumeFormat::Binvox => assert_eq!(grid.dims(), [131; 3]),
            _ => assert_eq!(grid, placed, "{name}"),
        }
        for (i, &set) in (0u32..).zip(&expected) {
            let voxel = [i / (dims[1] * dims[2]), i / dims[2] % dims[1], i % dims[2]];
            assert_eq!(read.volume.get(voxel), set == 1, "{name}: {voxel:?}");
        }
        assert_eq!(read.volume.count(), expected.iter().map(|&set| u64::from(set)).sum::<u64>(), "{name}");
        read_files += 1;
    }
    assert!(read_files > 60, "only {read_files} files were written");
}
