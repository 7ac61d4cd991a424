//! Voxelizes one mesh over and over, for a profiler:
//! `cargo build --release -p trixel-bench --example hot_loop`, then
//! `perf record target/release/examples/hot_loop MESH N MODE SECONDS` or `valgrind --tool=callgrind` of the same.
//!
//! MESH is a name from the benchmarks (a scene, or a model relative to the folder of meshes); MODE `conservative`, `thin`,
//! `solid` or `sliced`. A fifth argument is the number of threads, 1 without; a sixth, `sse2`, `sse4.2` or `avx2`, limits the
//! instructions.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark")]

use std::time::{Duration, Instant};

use trixel::lattice::LatticeMesh;
use trixel::{Backend, CpuBackend, Grid, Instructions, Job, Mode, Volume};

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let [_, name, resolution, mode, seconds, rest @ ..] = args.as_slice() else {
        println!("usage: hot_loop MESH N MODE SECONDS [THREADS [INSTRUCTIONS]]");
        return;
    };
    let mesh = trixel_bench::load(name).unwrap();
    let mode = Mode::ALL.into_iter().find(|m| m.name() == mode).unwrap();
    let grid = Grid::fit(&mesh.bounds().unwrap(), resolution.parse().unwrap()).unwrap();
    let lattice = LatticeMesh::snap(&mesh, &grid).unwrap();
    let mut volume = Volume::new(grid).unwrap();
    let instructions = match rest.get(1).map(String::as_str) {
        Some("sse2") => Instructions::Sse2,
        Some("sse4.2") => Instructions::Sse42,
        Some("avx2") => Instructions::Avx2,
        _ => Instructions::Best,
    };
    let threads = rest.first().map_or(1, |threads| threads.parse().unwrap());
    let backend = CpuBackend::with_threads(threads).unwrap().limited_to(instructions);
    let job = Job::new(grid, mode);
    let limit = Duration::from_secs_f64(seconds.parse().unwrap());
    let mut times = Vec::new();
    let start = Instant::now();
    while times.is_empty() || start.elapsed() < limit {
        let begun = Instant::now();
        backend.voxelize(&lattice, &job, &mut volume).unwrap();
        times.push(begun.elapsed().as_secs_f64() * 1e3);
    }
    times.sort_by(f64::total_cmp);
    println!(
        "{name} {mode}, {} triangles, {} voxels: least {:.2} ms, median {:.2} ms of {} runs",
        mesh.triangles.len(),
        volume.count(),
        times[0],
        times[times.len() / 2],
        times.len()
    );
}
