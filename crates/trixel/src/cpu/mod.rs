//! The CPU backend.
//!
//! - `kernel`: one triangle after the other, each to the path for its size
//! - `tiny`, `rows`, `large`: the paths
//! - `setup`: what paths compute first
//! - `rule`: the modes as thresholds
//! - `number`: exact integers and floor lines
//! - `sink`: runs into bits, toggles into parity
//! - `slabs`: the grid cut along x, one piece a task, so that threads never share a word

mod kernel;
mod large;
mod number;
mod rows;
mod rule;
mod setup;
mod sink;
mod slabs;
mod tiny;

use crate::backend::{Backend, Error};
use crate::job::{Job, Strategy};
use crate::lattice::{LatticeMesh, LatticePositions};
use crate::mode::Mode;
use crate::volume::Volume;

/// Voxelizes on the CPU. The result is the same for any number of threads.
#[derive(Debug, Default)]
pub struct CpuBackend {
    #[cfg(feature = "threads")]
    pool: Option<rayon::ThreadPool>,
}

/// The threads could not be started.
#[derive(Debug, thiserror::Error)]
#[error("cannot start {threads} threads: {reason}; ask for fewer")]
pub struct ThreadsError {
    threads: usize,
    reason: String,
}

impl CpuBackend {
    /// A backend with `threads` threads of its own. ([`CpuBackend::default`] uses rayon's global pool.)
    ///
    /// # Errors
    /// When the system refuses to start them.
    #[cfg(feature = "threads")]
    pub fn with_threads(threads: usize) -> Result<Self, ThreadsError> {
        let refused = |e: rayon::ThreadPoolBuildError| ThreadsError { threads, reason: e.to_string() };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(refused)?;
        Ok(Self { pool: Some(pool) })
    }

    /// The number of threads it works with.
    #[must_use]
    pub fn threads(&self) -> usize {
        #[cfg(feature = "threads")]
        return self.pool.as_ref().map_or_else(rayon::current_num_threads, rayon::ThreadPool::current_num_threads);
        #[cfg(not(feature = "threads"))]
        1
    }

    /// Runs `work` where its parallel loops use this backend's threads.
    pub fn install<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        #[cfg(feature = "threads")]
        if let Some(pool) = &self.pool {
            return pool.install(work);
        }
        work()
    }
}

impl Backend for CpuBackend {
    fn name(&self) -> &'static str {
        "cpu"
    }

    fn strategies(&self) -> &'static [Strategy] {
        &[Strategy::ColumnRuns]
    }

    fn voxelize(&self, mesh: &LatticeMesh<'_>, job: &Job, volume: &mut Volume) -> Result<Strategy, Error> {
        let strategy = match job.strategy() {
            Strategy::Auto => Strategy::ColumnRuns,
            strategy => strategy,
        };
        if !self.strategies().contains(&strategy) {
            return Err(Error::Strategy { backend: self.name(), strategy, has: self.strategies() });
        }
        if volume.grid() != job.grid() {
            return Err(Error::GridMismatch);
        }
        self.install(|| match &mesh.positions {
            LatticePositions::Narrow(positions) => voxelize_mode(positions, mesh.triangles, job, volume),
            LatticePositions::Wide(positions) => voxelize_mode(positions, mesh.triangles, job, volume),
        });
        Ok(strategy)
    }
}

fn voxelize_mode<C: Into<i64> + Copy + Send + Sync>(
    positions: &[[C; 3]],
    triangles: &[[u32; 3]],
    job: &Job,
    volume: &mut Volume,
) {
    let mesh = slabs::Corners { positions, triangles };
    match job.mode() {
        Mode::Conservative => slabs::surface(&rule::Conservative, mesh, volume),
        Mode::Thin => slabs::surface(&rule::Thin, mesh, volume),
        Mode::Sliced => slabs::slice(&rule::Sliced { overlap: i64::from(job.overlap_steps()) }, mesh, volume),
        Mode::Solid => slabs::fill(mesh, volume),
    }
}
