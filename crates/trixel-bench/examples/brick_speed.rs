//! Time and memory of voxelizing into bricks: `cargo run --release -p trixel-bench --example brick_speed -- MESH N MODE THREADS`.
//!
//! MESH is a name from the benchmarks (a scene, or a model relative to the folder of meshes); MODE `conservative`, `thin`,
//! `solid` or `sliced`.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark")]

use std::time::Instant;

use trixel::lattice::LatticeMesh;
use trixel::{Bytes, CpuBackend, Grid, Job, Mode, Occupancy};

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let [_, name, resolution, mode, threads] = args.as_slice() else {
        println!("usage: brick_speed MESH N MODE THREADS");
        return;
    };
    let mesh = trixel_bench::load(name).unwrap();
    let mode = Mode::ALL.into_iter().find(|m| m.name() == mode).unwrap();
    let job = Job::new(Grid::fit(&mesh.bounds().unwrap(), resolution.parse().unwrap()).unwrap(), mode);
    let backend = CpuBackend::with_threads(threads.parse().unwrap()).unwrap();
    let start = Instant::now();
    let lattice = LatticeMesh::snap(&mesh, job.grid()).unwrap();
    let snapped = start.elapsed();
    let map = backend.voxelize_bricks(&lattice, &job, None).unwrap();
    let done = start.elapsed();
    println!(
        "{name} {:?} {mode}, {threads} threads: snap {:.0} ms, all {:.0} ms; {} voxels in {} bricks, {}; peak {}",
        job.grid().dims(),
        snapped.as_secs_f64() * 1e3,
        done.as_secs_f64() * 1e3,
        map.count(),
        map.brick_count(),
        Bytes(map.bytes()),
        peak()
    );
}

fn peak() -> String {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap_or("unknown").trim().to_owned()
}
