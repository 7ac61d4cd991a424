//! How the time grows with triangles, with resolution and with threads: voxelizing alone, into a volume that is already
//! allocated and was written before.
//!
//! `cargo bench -p trixel-bench --bench scaling`; `-- --svg FOLDER` draws it there too. Milliseconds, medians.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark")]

use std::path::PathBuf;
use std::time::Instant;

use trixel::lattice::LatticeMesh;
use trixel::{Backend, CpuBackend, Grid, Job, Mode, Volume};
use trixel_bench::plot::{Line, plot};
use trixel_bench::{inputs, load};

const ROUNDS: usize = 9;
const RESOLUTION: u32 = 512;
const RESOLUTIONS: [u32; 5] = [64, 128, 256, 512, 1024];
/// Edges of an icosahedron's edge: 20 triangles times its square.
const SPHERES: [u32; 8] = [4, 8, 16, 32, 64, 128, 256, 512];

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let folder = arguments.iter().position(|a| a == "--svg").and_then(|i| arguments.get(i + 1)).map(PathBuf::from);
    let show = |file: &str, title: &str, across: &str, lines: &[Line]| {
        println!("\n{title}");
        for line in lines {
            let points: Vec<String> = line.points.iter().map(|(at, ms)| format!("{at}: {ms:.2}")).collect();
            println!("{:48} {}", line.name, points.join(", "));
        }
        if let Some(folder) = &folder {
            std::fs::create_dir_all(folder).unwrap();
            std::fs::write(folder.join(file), plot(title, across, true, lines).unwrap()).unwrap();
        }
    };
    let modes = [Mode::Conservative, Mode::Thin, Mode::Solid];

    let mut lines = modes.map(|mode| Line { name: mode.name().into(), points: vec![] });
    for sphere in SPHERES {
        let times = measure(&format!("scene:sphere:{sphere}"), RESOLUTION, &modes.map(|mode| (mode, 1)));
        for (line, ms) in lines.iter_mut().zip(times) {
            line.points.push((f64::from(20 * sphere * sphere), ms));
        }
    }
    show("cpu-triangles.svg", "Spheres at 512, one thread", "triangles", &lines);

    let names = inputs();
    let chosen = || names.iter().filter(|name| !name.contains("city") && !name.contains("rotated"));
    let mut lines = vec![];
    for name in chosen() {
        let time = |n| (f64::from(n), measure(name, n, &[(Mode::Conservative, 1)])[0]);
        lines.push(Line { name: short(name), points: RESOLUTIONS.map(time).to_vec() });
    }
    show("cpu-resolution.svg", "Conservative, one thread", "voxels along the longest side", &lines);

    let most = std::thread::available_parallelism().map_or(1, usize::from);
    let counts: Vec<usize> = (0..).map(|i| 1 << i).take_while(|count| *count <= most).collect();
    let mut lines = vec![];
    for name in chosen() {
        let settings: Vec<_> = counts.iter().map(|count| (Mode::Conservative, *count)).collect();
        let times = measure(name, RESOLUTION, &settings);
        #[expect(clippy::cast_precision_loss, reason = "a number of threads")]
        let points = counts.iter().map(|count| *count as f64).zip(times).collect();
        lines.push(Line { name: short(name), points });
    }
    show("cpu-threads.svg", "Conservative at 512", "threads", &lines);
}

/// The end of a name that is a path.
fn short(name: &str) -> String {
    name.rsplit('/').next().unwrap_or(name).to_owned()
}

/// The median of each setting, a mode and a number of threads, measured by turns.
fn measure(name: &str, resolution: u32, settings: &[(Mode, usize)]) -> Vec<f64> {
    let mesh = load(name).unwrap();
    let grid = Grid::fit(&mesh.bounds().unwrap(), resolution).unwrap();
    let lattice = LatticeMesh::snap(&mesh, &grid).unwrap();
    let mut volume = Volume::new(grid).unwrap();
    let backends: Vec<_> =
        settings.iter().map(|(mode, threads)| (*mode, CpuBackend::with_threads(*threads).unwrap())).collect();
    let mut times = vec![vec![]; settings.len()];
    // The first round warms up.
    for round in 0..=ROUNDS {
        for ((mode, backend), times) in backends.iter().zip(&mut times) {
            let start = Instant::now();
            backend.voxelize(&lattice, &Job::new(grid, *mode), &mut volume).unwrap();
            if round > 0 {
                times.push(start.elapsed().as_secs_f64() * 1e3);
            }
        }
    }
    times.into_iter().map(median).collect()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
