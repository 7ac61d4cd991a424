//! What the writers write, the readers read back to the bit; damaged files are refused; nothing half-written stays.
#![allow(clippy::unwrap_used, reason = "a test")]

mod common;

use std::fs;
use std::path::Path;

use common::{ANISOTROPIC, CUBIC, noise, samples, volume};
use proptest::prelude::*;
use trixel::lattice::LatticeMesh;
use trixel::{CpuBackend, Grid, Job, Mode, UpAxis, Volume};
use trixel_io::VolumeFormat;
use trixel_io::volume_read::{VolumeReadError, read_grid, read_volume};
use trixel_io::write::{WriteError, WriteOptions, check_target, write_bricks, write_volume};

fn write(path: &Path, volume: &Volume, options: &WriteOptions<'_>) {
    check_target(path, volume.grid()).unwrap();
    write_volume(path, volume, options).unwrap().commit().unwrap();
}

const SPARSE: WriteOptions<'static> = WriteOptions { up: UpAxis::Z, sparse: true, described: None, progress: None };

#[test]
fn formats_with_a_grid_round_trip_exactly() {
    let folder = tempfile::tempdir().unwrap();
    for (name, volume) in samples(ANISOTROPIC) {
        for extension in ["npz", "vti", "nrrd", "raw"] {
            let path = folder.path().join(format!("{name}.{extension}"));
            write(&path, &volume, &WriteOptions::default());
            let read = read_volume(&path, None).unwrap();
            assert!(read.volume == volume, "{name}.{extension}");
            assert!(read.warnings.is_empty(), "{name}.{extension}: {:?}", read.warnings);
            assert_eq!(read_grid(&path).unwrap().grid, *volume.grid(), "{name}.{extension}");
        }
        let path = folder.path().join(format!("{name}-sparse.npz"));
        write(&path, &volume, &SPARSE);
        assert!(read_volume(&path, None).unwrap().volume == volume, "{name} sparse");
        assert_eq!(read_grid(&path).unwrap().grid, *volume.grid(), "{name} sparse");
    }
    assert!(
        fs::read_dir(folder.path()).unwrap().all(|entry| !entry
            .unwrap()
            .file_name()
            .as_encoded_bytes()
            .ends_with(b".tmp"))
    );
}

#[test]
fn npy_round_trips_all_but_the_grid_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    for (name, volume) in samples(ANISOTROPIC) {
        let path = folder.path().join(format!("{name}.NPY"));
        write(&path, &volume, &WriteOptions::default());
        let read = read_volume(&path, None).unwrap();
        assert_eq!(read.volume.words(), volume.words(), "{name}");
        assert_eq!(*read.volume.grid(), Grid::new([0.0; 3], [1.0; 3], volume.grid().dims()).unwrap());
        assert_eq!(read.warnings.len(), 1);
    }
}

#[test]
fn binvox_round_trips_into_a_cube() {
    let folder = tempfile::tempdir().unwrap();
    for (name, volume) in samples(CUBIC) {
        let path = folder.path().join(format!("{name}.binvox"));
        write(&path, &volume, &WriteOptions::default());
        let read = read_volume(&path, None).unwrap().volume;
        let side = volume.grid().dims().into_iter().max().unwrap();
        assert_eq!(*read.grid(), Grid::new(volume.grid().origin(), CUBIC, [side; 3]).unwrap(), "{name}");
        assert!(read.iter().eq(volume.iter()), "{name}");
    }
}

#[test]
fn nrrd_keeps_an_origin_that_half_a_voxel_would_round() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.nrrd");
    let grid = Grid::new([0.1, -1e-17, 1e9 / 3.0], [0.1, 0.3, 1e-3 / 3.0], [2, 3, 4]).unwrap();
    let mut volume = Volume::new(grid).unwrap();
    volume.set([1, 2, 3]);
    write(&path, &volume, &WriteOptions::default());
    assert!(read_volume(&path, None).unwrap().volume == volume);
    // A space origin that someone else edited is believed over the exact one that it no longer agrees with.
    let text = fs::read(&path).unwrap();
    let at = text.windows(13).position(|window| window == b"space origin:").unwrap();
    let end = at + text[at..].iter().position(|&byte| byte == b'\n').unwrap();
    let edited = [&text[..at], b"space origin: (5,6,7)", &text[end..]].concat();
    fs::write(&path, edited).unwrap();
    let origin = read_grid(&path).unwrap().grid.origin();
    assert_eq!(origin[..2], [5.0 - 0.05, 6.0 - 0.15]);
}

#[test]
fn bytes_do_not_depend_on_threads_or_time() {
    let (_, volume) = samples(CUBIC).swap_remove(1);
    let write_all = |threads| {
        let folder = tempfile::tempdir().unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        VolumeFormat::ALL.map(|format| {
            let path = folder.path().join(format!("a.{}", format.extension()));
            pool.install(|| write(&path, &volume, &WriteOptions::default()));
            fs::read(&path).unwrap()
        })
    };
    assert_eq!(write_all(1), write_all(3));
}

#[test]
fn targets_are_checked_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let grid = |size, dims| Grid::new([0.0; 3], size, dims).unwrap();
    let check = |name: &str, grid: &Grid| check_target(&folder.path().join(name), grid).map_err(|e| e.to_string());
    let small = grid([1.0; 3], [4; 3]);
    for format in VolumeFormat::ALL {
        check(&format!("a.{}", format.extension().to_uppercase()), &small).unwrap();
    }
    assert!(check("a.xyz", &small).unwrap_err().contains(".npz, .npy, .binvox"));
    assert!(check("a", &small).is_err());
    assert!(check("missing/a.npz", &small).unwrap_err().contains("missing"));
    fs::create_dir(folder.path().join("folder.npz")).unwrap();
    assert!(matches!(check_target(&folder.path().join("folder.npz"), &small), Err(WriteError::IsFolder { .. })));
    let message = check("a.binvox", &grid([1.0, 1.0, 2.0], [4; 3])).unwrap_err();
    assert!(message.contains("1 x 1 x 2"), "{message}");
    check("a.vox", &grid([1.0; 3], [2000, 1, 2000])).unwrap();
    assert!(check("a.vox", &grid([1.0; 3], [1, 2001, 1])).unwrap_err().contains("2000"));
    let far = Grid::new([1e9, 0.0, 0.0], [1.0; 3], [4; 3]).unwrap();
    assert!(check("a.stl", &far).unwrap_err().contains("single precision"));
    check("a.glb", &far).unwrap();
    assert!(check("a.glb", &grid([1e-300; 3], [4; 3])).is_err());
    // Checking leaves nothing behind but the folder made here.
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn a_failed_or_dropped_write_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let full = volume([4, 4, 4], ANISOTROPIC, |_| true);
    assert!(write_volume(&folder.path().join("a.binvox"), &full, &WriteOptions::default()).is_err());
    let staged = write_volume(&folder.path().join("a.raw"), &full, &WriteOptions::default()).unwrap();
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
    drop(staged);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

/// Runs itself under a limit on the size of files, as if the disk were full.
#[cfg(unix)]
#[test]
fn a_full_disk_leaves_nothing() {
    const FOLDER: &str = "TRIXEL_TEST_FULL_DISK";
    if let Some(folder) = std::env::var_os(FOLDER) {
        let noisy = volume([64, 65, 66], CUBIC, noise);
        for format in VolumeFormat::ALL {
            let path = Path::new(&folder).join(format!("a.{}", format.extension()));
            let result = write_volume(&path, &noisy, &WriteOptions::default());
            assert!(matches!(result, Err(WriteError::Io { .. })), "{format:?}: {result:?}");
        }
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let output = std::process::Command::new("sh")
        // Ignoring the signal turns the limit into an error of the write.
        .args(["-c", "trap '' XFSZ; ulimit -f 8; exec \"$0\" --exact a_full_disk_leaves_nothing"])
        .arg(std::env::current_exe().unwrap())
        .env(FOLDER, folder.path())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
    assert!(String::from_utf8_lossy(&output.stdout).contains("1 passed"), "the inner test did not run");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn progress_ends_at_one_and_never_falls() {
    let folder = tempfile::tempdir().unwrap();
    let (_, volume) = samples(CUBIC).swap_remove(1);
    for format in VolumeFormat::ALL {
        let seen = std::cell::RefCell::new(Vec::new());
        let progress = |fraction: f32| seen.borrow_mut().push(fraction);
        let options = WriteOptions { progress: Some(&progress), ..WriteOptions::default() };
        write(&folder.path().join(format!("a.{}", format.extension())), &volume, &options);
        let seen = seen.into_inner();
        assert!(seen.is_sorted() && seen.last() == Some(&1.0), "{format:?}: {seen:?}");
    }
}

/// The files that hostile tests start from.
fn readable_files(folder: &Path) -> Vec<std::path::PathBuf> {
    let noisy = volume([7, 70, 131], CUBIC, noise);
    let mut paths = Vec::new();
    for format in VolumeFormat::ALL.into_iter().filter(|format| format.is_readable()) {
        let path = folder.join(format!("a.{}", format.extension()));
        write(&path, &noisy, &WriteOptions::default());
        paths.push(path);
    }
    let sparse = folder.join("sparse.npz");
    write(&sparse, &volume([7, 70, 131], CUBIC, |v| v[0] == v[1]), &SPARSE);
    paths.push(sparse);
    paths
}

#[test]
fn truncated_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for path in readable_files(folder.path()) {
        let bytes = fs::read(&path).unwrap();
        for kept in (0..400).chain((400..bytes.len()).step_by(bytes.len() / 50)).filter(|&n| n < bytes.len()) {
            fs::write(&path, &bytes[..kept]).unwrap();
            // All of the voxels may be there where only what follows them is missing.
            if let Ok(read) = read_volume(&path, None) {
                assert!(path.extension().unwrap() == "vti" && kept > bytes.len() - 60, "{} at {kept}", path.display());
                assert!(read.volume.count() > 0);
            }
        }
    }
}

#[test]
fn data_after_the_end_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for path in readable_files(folder.path()) {
        if ["npy", "raw", "binvox"].iter().any(|extension| path.extension().unwrap() == *extension) {
            let bytes = fs::read(&path).unwrap();
            fs::write(&path, [&bytes[..], &[1, 1]].concat()).unwrap();
            assert!(matches!(read_volume(&path, None), Err(VolumeReadError::Damaged { .. })), "{}", path.display());
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]
    #[test]
    fn damaged_files_never_panic(
        file in 0usize..7,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), any::<bool>()), 1..8),
    ) {
        static FILES: std::sync::LazyLock<Vec<(String, Vec<u8>)>> = std::sync::LazyLock::new(|| {
            let folder = tempfile::tempdir().unwrap();
            readable_files(folder.path())
                .into_iter()
                .map(|path| (path.file_name().unwrap().to_string_lossy().into_owned(), fs::read(path).unwrap()))
                .collect()
        });
        let folder = tempfile::tempdir().unwrap();
        let (name, bytes) = &FILES[file];
        let mut bytes = bytes.clone();
        for (index, value, near_start) in changes {
            // Headers are short: aim at them half of the time.
            let range = if near_start { bytes.len().min(300) } else { bytes.len() };
            bytes[index.index(range)] = value;
        }
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        // A limit, since a sparse grid may become huge and still be right.
        let _ = read_volume(&path, Some(1 << 28));
        let _ = read_grid(&path);
    }
}

#[test]
fn lying_headers_take_no_memory() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |name: &str, bytes: &[u8], part: &str| {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        let message = read_volume(&path, None).unwrap_err().to_string();
        assert!(message.contains(part), "{message}");
    };
    let mut npy = b"\x93NUMPY\x01\x00".to_vec();
    let dictionary = b"{'descr': '|b1', 'fortran_order': False, 'shape': (32768, 32768, 32768), }\n";
    npy.extend([u8::try_from(dictionary.len()).unwrap(), 0]);
    npy.extend(dictionary);
    refused("a.npy", &npy, "cut short");
    refused("b.npy", &String::from_utf8_lossy(dictionary).into_owned().into_bytes(), "NumPy");
    refused("a.binvox", b"#binvox 1\ndim 32768 32768 32768\ndata\n\x01\xff", "cut short");
    refused("b.binvox", b"#binvox 1\ndim 32769 32769 32769\ndata\n\x01\xff", "32768");
    refused("c.binvox", b"#binvox 1\ndim 2 3 4\ndata\n\x01\xff", "cubes");
    refused("d.binvox", b"#binvox 1\ndim 2 2 2\nscale 0\ndata\n\x01\x08", "voxel size");
    refused("e.binvox", b"#binvox 3\ndim 2 2 2\ndata\n\x01\x08", "version 3");
    let nrrd = |fields: &str| format!("NRRD0004\ntype: uint8\ndimension: 3\n{fields}\n\n").into_bytes();
    refused("a.nrrd", &nrrd("sizes: 9999 9999 9999\nspacings: 1 1 1\nencoding: gzip"), "cut short");
    refused("b.nrrd", &nrrd("sizes: 2 2 2\nspacings: 1 1 1\nencoding: bzip2"), "bzip2");
    refused("c.nrrd", &nrrd("sizes: 2 2 2\nspacings: 1 1 nan\nencoding: raw"), "voxel size");
    refused("d.nrrd", &nrrd("sizes: 2 2 2\nspace directions: (0,1,0) (1,0,0) (0,0,1)"), "turns");
    refused("e.nrrd", &nrrd("data file: other.raw"), "another file");
    let vti = |spacing: &str, array: &str| {
        format!(
            "<VTKFile type=\"ImageData\" header_type=\"UInt64\"><ImageData WholeExtent=\"0 2 0 2 0 2\" {spacing}>\
             <Piece><CellData>{array}</CellData></Piece></ImageData></VTKFile>"
        )
        .into_bytes()
    };
    refused("a.vti", &vti("", "<DataArray type=\"UInt8\" format=\"ascii\">1 1 1 1 1 1 1</DataArray>"), "cut short");
    refused("b.vti", &vti("", "<DataArray type=\"UInt8\" format=\"ascii\">1 1 1 1 x 1 1 1</DataArray>"), "`x`");
    refused("c.vti", &vti("Spacing=\"1 1 -1\"", ""), "voxel size");
    refused("d.vti", &vti("", "<DataArray type=\"String\" format=\"ascii\"/>"), "String");
    refused("e.vti", &vti("Direction=\"0 1 0 1 0 0 0 0 1\"", ""), "Direction");
    fs::write(folder.path().join("a.json"), "{\"dims\": [3, 3, 3], \"origin\": [0, 0, 0], \"voxel_size\": [1, 1, 1]}")
        .unwrap();
    refused("a.raw", &[1; 26], "27 voxels");
    refused("b.raw", &[1; 26], "b.json");
    refused("a.npz", b"PK\x05\x06", "archive");
    refused("a.obj", b"", "not a volume format");
}

#[test]
fn a_huge_sparse_grid_is_refused_within_the_limit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npz");
    let mut npz = trixel_io::write::NpzWriter::new(fs::File::create(&path).unwrap());
    let mut array = |name: &str, dtype: &str, shape: &[u64], bytes: Vec<u8>| {
        npz.array(name, dtype, shape, 1, &|_, out| out.extend(&bytes), &mut |_| {}).unwrap();
    };
    array("indices", "<i4", &[1, 3], [1i32, 2, 3].iter().flat_map(|i| i.to_le_bytes()).collect());
    array("dims", "<i4", &[3], [32_768i32; 3].iter().flat_map(|i| i.to_le_bytes()).collect());
    array("origin", "<f8", &[3], [0.0f64; 3].iter().flat_map(|i| i.to_le_bytes()).collect());
    array("voxel_size", "<f8", &[3], [1.0f64; 3].iter().flat_map(|i| i.to_le_bytes()).collect());
    npz.finish().unwrap();
    assert!(matches!(read_volume(&path, Some(1 << 30)), Err(VolumeReadError::Memory { .. })));
    assert_eq!(read_grid(&path).unwrap().grid.dims(), [32_768; 3]);
}

/// Each level declares one more namespace, so that a reader which keeps for each element those in scope takes gigabytes.
#[test]
fn a_vti_of_nested_namespaces_is_refused_soon() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.vti");
    let levels = 100_000;
    let opened: String = (0..levels).map(|i| format!("<a xmlns:n{i}=\"u{i}\">")).collect();
    fs::write(&path, format!("<VTKFile type=\"ImageData\">{opened}{}</VTKFile>", "</a>".repeat(levels))).unwrap();
    let start = std::time::Instant::now();
    let message = read_volume(&path, None).unwrap_err().to_string();
    assert!(message.contains("no element ImageData"), "{message}");
    assert!(start.elapsed().as_secs() < 5, "{:?}", start.elapsed());
}

/// Column-major indices keep two columns until the third comes: deflated zeros would make gigabytes of a few megabytes.
#[test]
fn column_major_indices_count_against_the_limit() {
    use std::io::Write;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npz");
    let rows = 1 << 16;
    for fortran in ["False", "True"] {
        let mut archive = zip::ZipWriter::new(fs::File::create(&path).unwrap());
        let mut array = |name: &str, dtype: &str, shape: &str, bytes: &[u8]| {
            let header = format!("{{'descr': '{dtype}', 'fortran_order': {fortran}, 'shape': ({shape})}}\n");
            archive.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
            archive.write_all(b"\x93NUMPY\x01\x00").unwrap();
            archive.write_all(&u16::try_from(header.len()).unwrap().to_le_bytes()).unwrap();
            archive.write_all(header.as_bytes()).unwrap();
            archive.write_all(bytes).unwrap();
        };
        array("indices.npy", "<i4", &format!("{rows}, 3"), &vec![0; rows * 12]);
        array("dims.npy", "|u1", "3,", &[4; 3]);
        array("origin.npy", "<f8", "3,", &[0; 24]);
        array("voxel_size.npy", "|u1", "3,", &[1; 3]);
        archive.finish().unwrap();
        assert_eq!(read_volume(&path, Some(1 << 20)).unwrap().volume.count(), 1);
        let small = read_volume(&path, Some(1 << 18));
        match fortran {
            "True" => assert!(matches!(small, Err(VolumeReadError::Memory { .. }))),
            _ => assert_eq!(small.unwrap().volume.count(), 1, "rows that are not kept take no memory"),
        }
    }
}

#[test]
fn bricks_are_written_as_the_dense_volume_would_be() {
    let mesh = trixel::scene::build("torus:48").unwrap();
    let grid = Grid::fit(&mesh.bounds().unwrap(), 150).unwrap();
    let folder = tempfile::tempdir().unwrap();
    for mode in [Mode::Conservative, Mode::Solid] {
        let job = Job::new(grid, mode);
        let dense = trixel::voxelize(&mesh, &job).unwrap();
        let lattice = LatticeMesh::snap(&mesh, &grid).unwrap();
        let bricks = CpuBackend::default().voxelize_bricks(&lattice, &job, None).unwrap();
        for (name, up) in [("a.npz", UpAxis::Z), ("a.ply", UpAxis::Z), ("a.vox", UpAxis::Y), ("a.vox", UpAxis::X)] {
            let options = WriteOptions { up, ..SPARSE };
            let (from_dense, from_bricks) = (folder.path().join(name), folder.path().join(format!("bricks-{name}")));
            write_volume(&from_dense, &dense, &options).unwrap().commit().unwrap();
            write_bricks(&from_bricks, &bricks, &options).unwrap().commit().unwrap();
            assert!(fs::read(&from_dense).unwrap() == fs::read(&from_bricks).unwrap(), "{name}, {mode}");
        }
        assert!(read_volume(&folder.path().join("bricks-a.npz"), None).unwrap().volume == dense);
    }
    let bricks = trixel::BrickMap::empty(grid);
    let error = write_bricks(&folder.path().join("a.vti"), &bricks, &SPARSE).unwrap_err().to_string();
    assert!(error.contains(".vti files hold whole grids") && error.contains(".npz, .vox and .ply"), "{error}");
    assert!(!folder.path().join("a.vti").exists());
}
