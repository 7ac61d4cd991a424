//! Time of voxelizing alone, for each mode, at 512 along the longest side, on one thread, into a volume that is already
//! allocated and was written before.
//!
//! `cargo bench -p trixel-bench` runs all of it; `cargo bench -p trixel-bench -- solid` one mode; `-- bunny` one mesh.

#![expect(clippy::unwrap_used, reason = "a benchmark")]

use divan::Bencher;
use trixel::lattice::LatticeMesh;
use trixel::{Backend, CpuBackend, Grid, Job, Mode, Volume};
use trixel_bench::{inputs, load};

const RESOLUTION: u32 = 512;

fn main() {
    divan::main();
}

fn run(bencher: Bencher<'_, '_>, name: &str, mode: Mode) {
    let mesh = load(name).unwrap();
    let job = Job::new(Grid::fit(&mesh.bounds().unwrap(), RESOLUTION).unwrap(), mode);
    let lattice = LatticeMesh::snap(&mesh, job.grid()).unwrap();
    let backend = CpuBackend::with_threads(1).unwrap();
    let mut volume = Volume::new(*job.grid()).unwrap();
    backend.voxelize(&lattice, &job, &mut volume).unwrap();
    bencher.bench_local(|| backend.voxelize(&lattice, &job, &mut volume).unwrap());
}

#[divan::bench(args = inputs(), sample_count = 15, sample_size = 1)]
fn conservative(bencher: Bencher<'_, '_>, name: &str) {
    run(bencher, name, Mode::Conservative);
}

#[divan::bench(args = inputs(), sample_count = 15, sample_size = 1)]
fn thin(bencher: Bencher<'_, '_>, name: &str) {
    run(bencher, name, Mode::Thin);
}

#[divan::bench(args = inputs(), sample_count = 15, sample_size = 1)]
fn solid(bencher: Bencher<'_, '_>, name: &str) {
    run(bencher, name, Mode::Solid);
}

#[divan::bench(args = inputs(), sample_count = 15, sample_size = 1)]
fn sliced(bencher: Bencher<'_, '_>, name: &str) {
    run(bencher, name, Mode::Sliced);
}
