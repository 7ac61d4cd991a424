//! Out-of-core results against the dense volumes that they stand for, and against themselves after a stop.
#![cfg(feature = "zarr")]
#![allow(clippy::unwrap_used, reason = "a test")]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use trixel::{CpuBackend, Grid, Job, Mesh, Mode, Volume};
use trixel_io::out_of_core::{OutOfCore, OutOfCoreError, Plan, Source, Written, partial_path};
use trixel_io::read::{MeshStream, ReadError, ReadOptions, read_mesh};
use zarrs::array::Array;
use zarrs::filesystem::FilesystemStore;

fn run(source: Source<'_>, job: &Job, limit: u64, target: &Path, resume: bool) -> Result<Written, OutOfCoreError> {
    let backend = CpuBackend::with_threads(2).unwrap();
    let plan = Plan::new(source, job, 2, 0, limit)?;
    OutOfCore { source, job, plan: &plan, backend: &backend, input: "a mesh" }.write(target, resume, &|_| {})
}

/// Asserts that the array in `folder` holds `expected`.
fn assert_holds(folder: &Path, expected: &Volume) {
    let array = Array::open(Arc::new(FilesystemStore::new(folder).unwrap()), "/occupancy").unwrap();
    assert_eq!(array.shape(), expected.grid().dims().map(u64::from));
    assert_eq!(array.attributes()["origin"], serde_json::json!(expected.grid().origin()));
    assert_eq!(array.attributes()["voxel_size"], serde_json::json!(expected.grid().voxel_size()));
    let voxels: Vec<bool> = array.retrieve_array_subset(&array.subset_all()).unwrap();
    let [_, ny, nz] = expected.grid().dims().map(|n| n as usize);
    assert_eq!(voxels.iter().filter(|&&set| set).count() as u64, expected.count());
    for [x, y, z] in expected.iter() {
        assert!(voxels[(x as usize * ny + y as usize) * nz + z as usize], "[{x}, {y}, {z}]");
    }
}

/// Every file of a folder, by its path in it.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(current) = folders.pop() {
        for entry in fs::read_dir(current).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                found.insert(path.strip_prefix(folder).unwrap().to_owned(), fs::read(&path).unwrap());
            }
        }
    }
    found
}

fn torus() -> Mesh {
    trixel::scene::build("torus:60").unwrap()
}

fn binary_stl(mesh: &Mesh) -> Vec<u8> {
    let mut bytes = vec![0; 80];
    bytes.extend(u32::try_from(mesh.triangles.len()).unwrap().to_le_bytes());
    for triangle in &mesh.triangles {
        bytes.extend([0; 12]);
        for &vertex in triangle {
            #[expect(clippy::cast_possible_truncation, reason = "as files do")]
            mesh.positions[vertex as usize].iter().for_each(|&c| bytes.extend((c as f32).to_le_bytes()));
        }
        bytes.extend([0; 2]);
    }
    bytes
}

/// With a colour on every vertex and a flag on every face, as rows in files have.
fn binary_ply(mesh: &Mesh, big: bool, double: bool) -> Vec<u8> {
    let (order, real) = (if big { "big" } else { "little" }, if double { "double" } else { "float" });
    let mut bytes = format!(
        "ply\nformat binary_{order}_endian 1.0\nelement vertex {}\nproperty uchar red\nproperty {real} x\nproperty {real} \
         y\nproperty {real} z\nelement face {}\nproperty list uchar int vertex_indices\nproperty uchar flag\nend_header\n",
        mesh.positions.len(),
        mesh.triangles.len()
    )
    .into_bytes();
    for position in &mesh.positions {
        bytes.push(7);
        for &c in position {
            #[expect(clippy::cast_possible_truncation, reason = "as files do")]
            let single = c as f32;
            match (double, big) {
                (false, false) => bytes.extend(single.to_le_bytes()),
                (false, true) => bytes.extend(single.to_be_bytes()),
                (true, false) => bytes.extend(c.to_le_bytes()),
                (true, true) => bytes.extend(c.to_be_bytes()),
            }
        }
    }
    for triangle in &mesh.triangles {
        bytes.push(3);
        triangle.iter().for_each(|v| bytes.extend(if big { v.to_be_bytes() } else { v.to_le_bytes() }));
        bytes.push(1);
    }
    bytes
}

#[test]
fn what_is_written_tile_by_tile_is_the_dense_volume() {
    let folder = tempfile::tempdir().unwrap();
    // Several layers, rows and shards along z, none of them full; inside the solid, bricks run on over shards.
    let mesh = trixel::scene::build("sphere:24").unwrap();
    let grid = Grid::fit(&mesh.bounds().unwrap(), 330).unwrap();
    for mode in Mode::ALL {
        let job = Job::new(grid, mode);
        let target = folder.path().join(format!("{mode}.zarr"));
        let written = run(Source::Mesh(&mesh), &job, 1 << 30, &target, false).unwrap();
        let dense = trixel::voxelize(&mesh, &job).unwrap();
        assert_eq!(written, Written { voxels: dense.count(), resumed: 0 });
        assert_holds(&target, &dense);
        assert!(!partial_path(&target).exists());
        assert!(!target.join("trixel-journal").exists());
    }
}

#[test]
fn meshes_in_passes_give_what_meshes_in_memory_give() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = torus();
    let samples = [
        ("a.stl", binary_stl(&mesh)),
        ("a.ply", binary_ply(&mesh, false, false)),
        ("b.ply", binary_ply(&mesh, true, true)),
        ("c.ply", binary_ply(&mesh, true, false)),
    ];
    for (name, bytes) in samples {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        let loaded = read_mesh(&path, &ReadOptions::default()).unwrap().mesh;
        let stream = MeshStream::open(&path).unwrap().unwrap();
        let source = Source::Stream(&stream);
        assert_eq!(source.triangle_count(), loaded.triangles.len() as u64);
        assert_eq!(source.bounds().unwrap(), loaded.bounds());
        let job = Job::new(Grid::fit(&loaded.bounds().unwrap(), 300).unwrap(), Mode::Conservative);
        // So little memory that every layer is a slab of its own.
        let error = run(source, &job, 1 << 20, &folder.path().join("none.zarr"), false).unwrap_err();
        let OutOfCoreError::Limit { needed, .. } = error else { panic!("{error}") };
        let layer = (0..).map(|i| needed + i * 10_000).find(|&limit| Plan::new(source, &job, 2, 0, limit).is_ok());
        let plan = Plan::new(source, &job, 2, 0, layer.unwrap()).unwrap().to_string();
        assert!(plan.contains("in 4 slabs") || plan.contains("in 5 slabs"), "{plan}");
        let (tight, loose) =
            (folder.path().join(format!("{name}-tight.zarr")), folder.path().join(format!("{name}.zarr")));
        run(source, &job, layer.unwrap(), &tight, false).unwrap();
        run(Source::Mesh(&loaded), &job, 1 << 30, &loose, false).unwrap();
        assert!(files(&tight) == files(&loose), "{name}");
        assert_holds(&tight, &trixel::voxelize(&loaded, &job).unwrap());
    }
}

#[test]
fn a_stopped_run_goes_on_where_it_was_and_ends_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = torus();
    let job = Job::new(Grid::fit(&mesh.bounds().unwrap(), 700).unwrap(), Mode::Solid);
    let whole = folder.path().join("whole.zarr");
    run(Source::Mesh(&mesh), &job, 1 << 30, &whole, false).unwrap();

    let target = folder.path().join("stopped.zarr");
    let partial = partial_path(&target);
    let backend = CpuBackend::with_threads(2).unwrap();
    let plan = Plan::new(Source::Mesh(&mesh), &job, 2, 0, 1 << 30).unwrap();
    let work = OutOfCore { source: Source::Mesh(&mesh), job: &job, plan: &plan, backend: &backend, input: "a mesh" };
    let fails_at_the_end = |fraction: f32| assert!(fraction < 1.0, "on purpose");
    let run_to_the_end = std::panic::AssertUnwindSafe(|| work.write(&target, false, &fails_at_the_end));
    let stopped = std::panic::catch_unwind(run_to_the_end);
    assert!(stopped.is_err() && !target.exists());
    // What a kill leaves: a journal whose last line is cut, and shards that are missing, or cut, of rows not in it.
    let journal = fs::read_to_string(partial.join("trixel-journal")).unwrap();
    let lines: Vec<&str> = journal.lines().collect();
    let kept = lines.len() / 3;
    fs::write(partial.join("trixel-journal"), lines[..kept].join("\n") + "\n" + &lines[kept][..3]).unwrap();
    for (i, line) in lines[kept..].iter().enumerate() {
        let mut words = line.split(' ');
        let row = partial.join("occupancy/c").join(words.next().unwrap()).join(words.next().unwrap());
        let Ok(shards) = fs::read_dir(&row) else { continue };
        for shard in shards.map(|entry| entry.unwrap().path()) {
            let bytes = fs::read(&shard).unwrap();
            if i % 2 == 0 { fs::remove_file(&shard).unwrap() } else { fs::write(&shard, &bytes[..9]).unwrap() }
        }
    }
    assert!(files(&partial) != files(&whole));
    let written = work.write(&target, true, &|_| {}).unwrap();
    assert_eq!(written.resumed, kept as u64 - 1);
    assert!(files(&target) == files(&whole));
    assert_eq!(written.voxels, trixel::voxelize(&mesh, &job).unwrap().count());
}

#[test]
fn what_is_resumed_must_be_the_same_job() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = torus();
    let job = Job::new(Grid::fit(&mesh.bounds().unwrap(), 100).unwrap(), Mode::Thin);
    let target = folder.path().join("a.zarr");
    let error = run(Source::Mesh(&mesh), &job, 1 << 30, &target, true).unwrap_err();
    assert!(matches!(error, OutOfCoreError::NothingToResume { .. }), "{error}");
    // A result without its last line.
    run(Source::Mesh(&mesh), &job, 1 << 30, &target, false).unwrap();
    let error = run(Source::Mesh(&mesh), &job, 1 << 30, &target, false).unwrap_err();
    assert!(matches!(error, OutOfCoreError::Exists { .. }), "{error}");
    fs::rename(&target, partial_path(&target)).unwrap();
    fs::write(partial_path(&target).join("trixel-journal"), "another job\n0 0 5\n").unwrap();
    let error = run(Source::Mesh(&mesh), &job, 1 << 30, &target, true).unwrap_err();
    assert!(matches!(error, OutOfCoreError::AnotherJob { .. }), "{error}");
    // Without `resume`, it starts again.
    assert_eq!(run(Source::Mesh(&mesh), &job, 1 << 30, &target, false).unwrap().resumed, 0);
}

#[test]
fn files_that_cannot_be_read_in_passes_say_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let mesh = torus();
    fs::write(path("ascii.stl"), "solid\nendsolid\n").unwrap();
    fs::write(path("a.obj"), "v 0 0 0\n").unwrap();
    assert!(MeshStream::open(&path("ascii.stl")).unwrap().is_none());
    assert!(MeshStream::open(&path("a.obj")).unwrap().is_none());
    assert!(matches!(MeshStream::open(&path("none.stl")), Err(ReadError::Io { .. })));
    let ply = binary_ply(&mesh, false, false);
    fs::write(path("cut.ply"), &ply[..ply.len() - 5]).unwrap();
    let error = MeshStream::open(&path("cut.ply")).unwrap_err().to_string();
    assert!(error.contains("truncated"), "{error}");
    // A quadrilateral, a vertex that is not there, a coordinate that is no number.
    let rows = ply.len() - mesh.triangles.len() * 14;
    let cases =
        [(rows + 14 * 3, vec![4], "face 3"), (rows + 14 * 5 + 1, vec![0xff, 0xff, 0xff, 0x7f], "face 5: it names")];
    for (at, bytes, what) in cases {
        let mut damaged = ply.clone();
        damaged[at..at + bytes.len()].copy_from_slice(&bytes);
        fs::write(path("damaged.ply"), damaged).unwrap();
        let stream = MeshStream::open(&path("damaged.ply")).unwrap().unwrap();
        let error = Source::Stream(&stream).bounds().unwrap_err().to_string();
        assert!(error.contains(what) && error.contains("damaged.ply"), "{error}");
    }
    let mut stl = binary_stl(&mesh);
    let at = 84 + 50 * 7 + 12;
    stl[at..at + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    fs::write(path("nan.stl"), stl).unwrap();
    let stream = MeshStream::open(&path("nan.stl")).unwrap().unwrap();
    let error = Source::Stream(&stream).bounds().unwrap_err().to_string();
    assert!(error.contains("triangle 7 has a corner at (NaN"), "{error}");
}
