//! Finding the best cutoff by measurement: the bracketing search that \[HCV\] 3.3 proposes.

use std::time::Instant;

use trixel::{Job, Strategy};

use crate::cutoff::{Cutoff, Heuristic};
use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::mesh::GpuMesh;
use crate::volume::GpuVolume;
use crate::voxelizer::{Options, Voxelizer};

/// One measured cutoff.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The cutoff, in the heuristic's unit.
    pub cutoff: f32,
    /// The median of the runs, in milliseconds.
    pub ms: f64,
}

/// What a search found.
#[derive(Clone, Debug, PartialEq)]
pub struct Tuning {
    /// The best cutoff.
    pub best: Cutoff,
    /// Its time.
    pub best_ms: f64,
    /// Everything measured, by ascending cutoff.
    pub curve: Vec<Sample>,
}

/// The golden ratio's smaller part.
const SECTION: f64 = 0.381_966_011_250_105_1;

/// The smallest position that the golden-section search ends at, within `low..high` to within `tolerance`, of a function
/// that falls and then rises. Where it has steps or noise, the best position that was looked at is given.
fn golden_section<E>(
    mut low: f64,
    mut high: f64,
    tolerance: f64,
    mut value: impl FnMut(f64) -> Result<f64, E>,
) -> Result<(f64, f64), E> {
    let mut left = low + SECTION * (high - low);
    let mut right = high - SECTION * (high - low);
    let mut at_left = value(left)?;
    let mut at_right = value(right)?;
    let mut best = if at_left <= at_right { (left, at_left) } else { (right, at_right) };
    while high - low > tolerance {
        // The right part goes on a tie: on a plateau the smaller cutoff spares single invocations the long loops.
        let (at, found) = if at_left <= at_right {
            high = right;
            (right, at_right) = (left, at_left);
            left = low + SECTION * (high - low);
            at_left = value(left)?;
            (left, at_left)
        } else {
            low = left;
            (left, at_left) = (right, at_right);
            right = high - SECTION * (high - low);
            at_right = value(right)?;
            (right, at_right)
        };
        if found < best.1 {
            best = (at, found);
        }
    }
    Ok(best)
}

/// The median time of `runs` voxelizations, in milliseconds, without upload and download.
///
/// # Errors
/// As for [`Voxelizer::run`].
pub fn measure(gpu: &Gpu, mesh: &GpuMesh, job: &Job, options: &Options, runs: usize) -> Result<f64, GpuError> {
    let volume = GpuVolume::new(gpu, *job.grid())?;
    median_ms(&mut Voxelizer::new(gpu, job, options)?, mesh, &volume, runs)
}

fn median_ms(voxelizer: &mut Voxelizer, mesh: &GpuMesh, volume: &GpuVolume, runs: usize) -> Result<f64, GpuError> {
    let mut times = vec![];
    for _ in 0..runs.max(1) {
        let start = Instant::now();
        voxelizer.run(mesh, volume)?;
        times.push(start.elapsed().as_secs_f64() * 1e3);
    }
    times.sort_by(f64::total_cmp);
    Ok(times[times.len() / 2])
}

/// Searches the cutoff at which [`Strategy::Hybrid`] is fastest for this mesh and job, by the median of `runs` runs each.
/// `progress` is told every sample.
///
/// # Errors
/// As for [`Voxelizer::run`].
pub fn tune(
    gpu: &Gpu,
    mesh: &GpuMesh,
    job: &Job,
    options: &Options,
    heuristic: Heuristic,
    runs: usize,
    mut progress: impl FnMut(Sample),
) -> Result<Tuning, GpuError> {
    let volume = GpuVolume::new(gpu, *job.grid())?;
    // The pipelines depend on the heuristic, not on the value.
    let options = Options { cutoff: Some(Cutoff::default_for(gpu.info(), heuristic)), ..*options };
    let mut voxelizer = Voxelizer::new(gpu, &job.with_strategy(Strategy::Hybrid), &options)?;
    let mut curve = vec![];
    let mut at_cutoff = |cutoff: f32| {
        voxelizer.set_cutoff(cutoff);
        let sample = Sample { cutoff, ms: median_ms(&mut voxelizer, mesh, &volume, runs)? };
        curve.push(sample);
        progress(sample);
        Ok::<f64, GpuError>(sample.ms)
    };
    // In octaves: sizes of triangles spread over orders of magnitude.
    let (low, high) = match heuristic {
        Heuristic::AreaRatio => (-10.0, 0.0),
        _ => (-4.0, 18.0),
    };
    // Both ends, which are the pure strategies but for the overhead: the minimum may lie there.
    #[expect(clippy::cast_possible_truncation, reason = "a cutoff")]
    let mut at = |octave: f64| at_cutoff(octave.exp2() as f32);
    let ends = [(low, at(low)?), (high, at(high)?)];
    let inner = golden_section(low, high, 0.5, &mut at)?;
    let (octave, best_ms) = ends.into_iter().fold(inner, |best, end| if end.1 < best.1 { end } else { best });
    curve.sort_by(|a, b| a.cutoff.total_cmp(&b.cutoff));
    #[expect(clippy::cast_possible_truncation, reason = "a cutoff")]
    let value = octave.exp2() as f32;
    Ok(Tuning { best: Cutoff { heuristic, value }, best_ms, curve })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn golden_section_brackets_a_minimum() {
        let mut looked = 0;
        let (at, value) = golden_section(-4.0, 18.0, 0.01, |x: f64| {
            looked += 1;
            Ok::<_, ()>((x - 5.25).powi(2) + 3.0)
        })
        .unwrap();
        assert!((at - 5.25).abs() < 0.01 && (value - 3.0).abs() < 1e-4, "{at} {value}");
        assert!(looked < 25, "{looked}");
        // At an end.
        let (at, _) = golden_section(0.0, 8.0, 0.01, |x: f64| Ok::<_, ()>(x)).unwrap();
        assert!(at < 0.02, "{at}");
    }
}
