//! The CPU backend.
//!
//! - `kernel`: one triangle after the other, each to the path for its size
//! - `tiny`, `rows`, `large`: the paths
//! - `instructions`: the vector instructions they are compiled for
//! - `setup`: what paths compute first
//! - `rule`: the modes as thresholds
//! - `fragments`: the voxels of each triangle by itself, for attributes
//! - `number`: exact integers and floor lines
//! - `sink`: runs into bits, toggles into parity
//! - `slabs`: the grid cut along x, one piece a task, so that threads never share a word

pub(crate) mod fragments;
mod instructions;
mod kernel;
mod large;
pub(crate) mod number;
mod rows;
mod rule;
mod setup;
mod sink;
mod slabs;
mod tiny;

pub use instructions::Instructions;

use crate::backend::{Backend, Error};
use crate::job::{Job, Strategy};
use crate::lattice::LatticeMesh;
use crate::mode::Mode;
use crate::volume::Volume;

/// Voxelizes on the CPU. The result is the same for any number of threads.
#[derive(Debug, Default)]
pub struct CpuBackend {
    #[cfg(feature = "threads")]
    pool: Option<rayon::ThreadPool>,
    instructions: Instructions,
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
        Ok(Self { pool: Some(pool), ..Self::default() })
    }

    /// Uses no newer vector instructions than these.
    #[must_use]
    pub fn limited_to(mut self, instructions: Instructions) -> Self {
        self.instructions = instructions;
        self
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
        let level = self.instructions.level();
        let overlap = i64::from(job.overlap_steps());
        self.install(|| match job.mode() {
            Mode::Conservative => slabs::surface(level, &rule::Conservative, mesh, volume),
            Mode::Thin => slabs::surface(level, &rule::Thin, mesh, volume),
            Mode::Sliced => slabs::slice(level, &rule::Sliced { overlap }, mesh, volume),
            Mode::Solid => slabs::fill(level, mesh, volume),
        });
        Ok(strategy)
    }
}
