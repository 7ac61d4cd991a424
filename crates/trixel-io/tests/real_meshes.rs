//! Every real mesh that is there, in every mode, against the oracle: not one wrong voxel.
//!
//! The meshes may not be published, so the test says that it skips where they are absent.

#![expect(clippy::unwrap_used, clippy::print_stdout, clippy::panic, reason = "a failure here is a failed test")]

#[path = "common/models.rs"]
mod models;

use std::path::{Path, PathBuf};

use rayon::prelude::*;
use trixel::conformance::{oracle, suite};
use trixel::lattice::LatticeMesh;
use trixel::{CpuBackend, Grid, Job, Mesh, Mode};
use trixel_io::read::{MeshFormat, ReadOptions, read_mesh};

fn mesh_files(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            mesh_files(&path, files);
        } else if MeshFormat::from_path(&path).is_some() {
            files.push(path);
        }
    }
}

fn load_all() -> Option<Vec<(String, Mesh)>> {
    let folder = models::models_folder()?;
    let mut files = Vec::new();
    mesh_files(&folder, &mut files);
    files.sort();
    assert!(!files.is_empty(), "{} holds no mesh", folder.display());
    let load = |path: &PathBuf| {
        let mesh = read_mesh(path, &ReadOptions { attributes: false }).unwrap_or_else(|error| panic!("{error}")).mesh;
        (path.strip_prefix(&folder).unwrap().display().to_string(), mesh)
    };
    Some(files.par_iter().map(load).collect())
}

#[test]
fn every_mesh_in_every_mode_is_exact() {
    let Some(meshes) = load_all() else { return };
    let backend = CpuBackend::default();
    let cells: Vec<_> = meshes
        .iter()
        .flat_map(|(name, mesh)| [64, 128].map(|resolution| (name, mesh, resolution)))
        .flat_map(|(name, mesh, resolution)| Mode::ALL.map(|mode| (name, mesh, resolution, mode)))
        .collect();
    println!("{} meshes, {} cells", meshes.len(), cells.len());
    cells.par_iter().for_each(|&(name, mesh, resolution, mode)| {
        let job = Job::new(Grid::fit(&mesh.bounds().unwrap(), resolution).unwrap(), mode);
        let lattice = LatticeMesh::snap(mesh, job.grid()).unwrap();
        let expected = oracle::voxelize(&lattice, &job).unwrap();
        let got = suite::run(&backend, mesh, &job);
        suite::assert_same(&format!("{name} at {resolution}, {mode}"), &got, &expected);
        assert!(mode == Mode::Solid || mode == Mode::Sliced || got.count() > 0, "{name}: nothing was set");
    });
}
