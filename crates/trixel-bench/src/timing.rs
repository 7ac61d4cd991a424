//! How long work takes, and what is typical of several times.

use std::time::Instant;

/// Milliseconds that the second of two runs of `work` takes: caches hold what it needs, not what another left, and threads
/// are awake.
pub fn second_run_ms(mut work: impl FnMut()) -> f64 {
    work();
    let start = Instant::now();
    work();
    start.elapsed().as_secs_f64() * 1e3
}

/// The median of `times`, which it sorts; 0 of none.
pub fn median(times: &mut [f64]) -> f64 {
    times.sort_by(f64::total_cmp);
    times.get(times.len() / 2).copied().unwrap_or(0.0)
}
