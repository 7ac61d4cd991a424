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
use trixel_bench::{inputs, load};

const RESOLUTION: u32 = 512;
const TIME_FOR_EACH: Duration = Duration::from_secs(6);

fn main() {
    let filter = std::env::args().skip(1).find(|argument| !argument.starts_with('-'));
    println!("{:44} {:28} {:>8} {:>8} {:>26} {:>6}", "mesh", "first / second", "first", "second", "ratio", "turns");
    let backends = [1, 2].map(|threads| CpuBackend::with_threads(threads).unwrap());
    for name in inputs().into_iter().filter(|name| filter.as_ref().is_none_or(|filter| name.contains(filter.as_str())))
    {
        let mesh = load(name).unwrap();
        let grid = Grid::fit(&mesh.bounds().unwrap(), RESOLUTION).unwrap();
        let lattice = LatticeMesh::snap(&mesh, &grid).unwrap();
        let mut volume = Volume::new(grid).unwrap();
        let mut compare = |what: &str, modes: [Mode; 2], backends: [&CpuBackend; 2]| {
            let mut time = |which: usize| {
                let job = Job::new(grid, modes[which]);
                milliseconds(|| {
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
            let [low, middle, high] = median_and_limits(ratios.clone());
            println!(
                "{name:44} {what:28} {:8.2} {:8.2} {:>26} {:6}",
                median_and_limits(first)[1],
                median_and_limits(second)[1],
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

/// What the second of two runs takes: caches hold what the work needs, not what another left, and threads are awake.
fn milliseconds(mut work: impl FnMut()) -> f64 {
    work();
    let start = Instant::now();
    work();
    start.elapsed().as_secs_f64() * 1e3
}

/// The median between the two samples that have it between them 19 times of 20: above and below are as many by chance.
fn median_and_limits(mut samples: Vec<f64>) -> [f64; 3] {
    samples.sort_by(f64::total_cmp);
    let (middle, last) = (samples.len() / 2, samples.len() - 1);
    // Two standard deviations of how many of so many tosses of a coin are heads.
    let spread = samples.len().isqrt();
    [samples[middle.saturating_sub(spread)], samples[middle], samples[(middle + spread).min(last)]]
}
