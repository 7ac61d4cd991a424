//! What is compared closely, by turns in one process, at 512: thin beside conservative on one thread, and two threads
//! beside one in each mode, into a volume that is already there. The machine's noise, which is slower than a turn, is then
//! in both.
//!
//! `cargo bench -p trixel-bench --bench turns`; `-- dragon` one mesh. Milliseconds, medians of the second of two runs; of the
//! ratios of neighbouring runs the median, and in brackets the limits between which it lies with 95 % confidence.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark")]

use std::time::{Duration, Instant};

use trixel::lattice::LatticeMesh;
use trixel::{Backend, CpuBackend, Grid, Job, Mode, Volume};
use trixel_bench::{asked_for, load, median, second_run_ms};

const RESOLUTION: u32 = 512;
const TIME_FOR_EACH: Duration = Duration::from_secs(6);

fn main() {
    println!("{:44} {:32} {:>8} {:>8} {:>26} {:>6}", "mesh", "first / second", "first", "second", "ratio", "turns");
    let backends = [1, 2].map(|threads| CpuBackend::with_threads(threads).unwrap());
    for name in asked_for() {
        let mesh = load(name).unwrap();
        let grid = Grid::fit(&mesh.bounds().unwrap(), RESOLUTION).unwrap();
        let lattice = LatticeMesh::snap(&mesh, &grid).unwrap();
        let mut volume = Volume::new(grid).unwrap();
        let mut compare = |what: &str, modes: [Mode; 2], backends: [&CpuBackend; 2]| {
            let mut time = |which: usize| {
                let job = Job::new(grid, modes[which]);
                second_run_ms(|| {
                    backends[which].voxelize(&lattice, &job, &mut volume).unwrap();
                })
            };
            let (mut first, mut second, mut ratios) = (Vec::new(), Vec::new(), Vec::new());
            let begun = Instant::now();
            while first.len() < 10 || begun.elapsed() < TIME_FOR_EACH {
                // First, second, second, first: neither always has the other's leavings.
                let turn = first.len() % 2;
                let times = [time(turn), time(1 - turn)];
                first.push(times[turn]);
                second.push(times[1 - turn]);
                ratios.push(times[turn] / times[1 - turn]);
            }
            let [low, middle, high] = median_and_limits(&mut ratios);
            println!(
                "{name:44} {what:32} {:8.2} {:8.2} {:>26} {:6}",
                median(&mut first),
                median(&mut second),
                format!("{middle:.3} ({low:.3} to {high:.3})"),
                ratios.len()
            );
        };
        let [one, two] = &backends;
        compare("thin / conservative", [Mode::Thin, Mode::Conservative], [one, one]);
        for mode in [Mode::Conservative, Mode::Thin, Mode::Solid] {
            compare(&format!("{mode}, one / two threads"), [mode, mode], [one, two]);
        }
    }
}

/// The median between the two samples that have it between them 19 times of 20: above and below are as many by chance.
fn median_and_limits(samples: &mut [f64]) -> [f64; 3] {
    let middle = median(samples);
    // Two standard deviations of how many of so many tosses of a coin are heads.
    let (at, spread) = (samples.len() / 2, samples.len().isqrt());
    [samples[at.saturating_sub(spread)], middle, samples[(at + spread).min(samples.len() - 1)]]
}
