//! The CPU backend.
//!
//! - `kernel`: one triangle after the other, each to the path for its size
//! - `tiny`, `columns`, `crossings`, `rows`, `large`: the paths
//! - `octants`: the tests of `tiny` for the smallest
//! - `filter`: its tests for all others in f32, and where they need to be repeated exactly
//! - `instructions`: the vector instructions they are compiled for
//! - `setup`: what `large` and `fragments` compute first
//! - `rule`: the modes as thresholds
//! - `fragments`: the voxels of each triangle by itself, for attributes
//! - `number`: exact integers and floor lines
//! - `sink`: runs into bits, toggles into parity
//! - `painter`: a mode and the instructions, together
//! - `prefetch`: memory before it is needed
//! - `triangles`: which triangles, and their corners, alone or as vectors
//! - `slabs`: a dense grid cut along x, one piece a task, so that threads never share a word; `outbox`, `gate`, `crew`: what
//!   it does that with
//! - `pillars`: a sparse grid cut into pillars of bricks

mod columns;
#[cfg(feature = "threads")]
mod crew;
mod crossings;
mod filter;
pub(crate) mod fragments;
#[cfg(feature = "threads")]
mod gate;
mod instructions;
mod kernel;
mod large;
pub(crate) mod number;
mod octants;
#[cfg(feature = "threads")]
mod outbox;
mod painter;
mod pillars;
mod prefetch;
mod rows;
mod rule;
mod setup;
mod sink;
mod slabs;
mod slanted;
mod tiny;
mod triangles;

pub use instructions::Instructions;
pub use pillars::BinnedMesh;

use std::ops::Range;

use painter::Painter;

use crate::backend::{Backend, Error};
use crate::bricks::BrickMap;
use crate::job::{Job, Strategy};
use crate::lattice::LatticeMesh;
use crate::mesh::MeshError;
use crate::volume::{Volume, VolumeError};

/// Voxelizes on the CPU. The result is the same for any number of threads.
///
/// It keeps scratch memory between calls, up to 32 MiB and 16 MiB a thread, so use one again rather than making another.
#[derive(Debug, Default)]
pub struct CpuBackend {
    #[cfg(feature = "threads")]
    pool: Option<rayon::ThreadPool>,
    instructions: Instructions,
    spare: slabs::Spare,
}

/// The threads could not be started.
#[derive(Debug, thiserror::Error)]
#[error("cannot start {threads} threads: {reason}; ask for fewer")]
pub struct ThreadsError {
    threads: usize,
    reason: String,
}

impl CpuBackend {
    /// A backend with a pool of `threads` threads of its own. ([`CpuBackend::default`] uses rayon's global one.) A thread that
    /// calls [`Backend::voxelize`] works too, with one less of the pool's, so several callers at the same time use more threads
    /// than that; whatever else is asked for runs in the pool alone.
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
        return self.crew().count();
        #[cfg(not(feature = "threads"))]
        1
    }

    /// The voxels of `mesh`, which was snapped to the job's grid, as bricks: for grids whose dense volume would not fit
    /// the memory. Memory and time follow the surface (mode `solid`: too, as the inside takes runs of whole bricks).
    ///
    /// # Errors
    /// When the strategy is another backend's, the mesh has too many triangles, or the bricks take more than `available`
    /// bytes.
    ///
    /// ```
    /// use trixel::{CpuBackend, Grid, Job, Mode, lattice::LatticeMesh, scene};
    /// let mesh = scene::build("sphere:64")?;
    /// // Dense, this grid would take 64 GiB.
    /// let job = Job::new(Grid::fit(&mesh.bounds().ok_or("empty")?, 8192)?, Mode::Solid);
    /// let map = CpuBackend::default().voxelize_bricks(&LatticeMesh::snap(&mesh, job.grid())?, &job, None)?;
    /// assert!(map.get([4096; 3]) && !map.get([0; 3]));
    /// assert!(map.bytes() < 512 << 20);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn voxelize_bricks(
        &self,
        mesh: &LatticeMesh<'_>,
        job: &Job,
        available: Option<u64>,
    ) -> Result<BrickMap, Error> {
        let [px, py] = BrickMap::pillars_of(job.grid());
        let binned = self.bin(mesh, job, 0..px)?;
        let available = available.unwrap_or(u64::MAX).saturating_sub(binned.bytes());
        let refused = VolumeError::Bricks { dims: job.grid().dims(), available };
        Ok(self.install(|| binned.voxelize_within(0..px, 0..py, available)).ok_or(refused)?)
    }

    /// Sorts the triangles of `mesh`, which was snapped to the job's grid, into the pillars `[x, y]` with x in `layers`
    /// (see [`BrickMap::pillars_of`]), so that pillars can be voxelized piece by piece.
    ///
    /// # Errors
    /// As [`CpuBackend::voxelize_bricks`], memory aside.
    pub fn bin<'a>(&self, mesh: &'a LatticeMesh<'a>, job: &Job, layers: Range<u32>) -> Result<BinnedMesh<'a>, Error> {
        self.strategy(job)?;
        if u32::try_from(mesh.triangles.len()).is_err() {
            return Err(MeshError::TooManyTriangles(mesh.triangles.len()).into());
        }
        let painter = Painter::new(self.instructions.level(), job);
        Ok(self.install(|| BinnedMesh::new(painter, mesh, *job.grid(), layers)))
    }

    /// The strategy that a job asks for.
    fn strategy(&self, job: &Job) -> Result<Strategy, Error> {
        let strategy = match job.strategy() {
            Strategy::Auto => Strategy::ColumnRuns,
            strategy => strategy,
        };
        if !self.strategies().contains(&strategy) {
            return Err(Error::Strategy { backend: self.name(), strategy, has: self.strategies() });
        }
        Ok(strategy)
    }

    #[cfg(feature = "threads")]
    fn crew(&self) -> crew::Crew<'_> {
        crew::Crew::new(self.pool.as_ref())
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
        let strategy = self.strategy(job)?;
        if volume.grid() != job.grid() {
            return Err(Error::GridMismatch);
        }
        let painter = Painter::new(self.instructions.level(), job);
        slabs::voxelize(
            &painter,
            mesh,
            volume,
            &self.spare,
            #[cfg(feature = "threads")]
            &self.crew(),
        );
        Ok(strategy)
    }
}
