//! What a backend is: something that runs a [`Job`].

use crate::grid::GridError;
use crate::job::{Job, JobError, Strategy};
use crate::lattice::{LatticeError, LatticeMesh};
use crate::mesh::{Mesh, MeshError};
use crate::mode::Mode;
use crate::volume::{Volume, VolumeError};

/// Voxelizes on some device. Every backend gives the same voxels; the suite in [`crate::conformance`] checks that.
pub trait Backend {
    /// The name in messages and reports.
    fn name(&self) -> &'static str;

    /// The strategies that it has, [`Strategy::Auto`] aside.
    fn strategies(&self) -> &'static [Strategy];

    /// The modes that it has: all of them, unless it is bound to a strategy with fewer.
    fn modes(&self) -> &'static [Mode] {
        &Mode::ALL
    }

    /// Overwrites `volume` with the voxels of `mesh`, which was snapped to the job's grid, and says which strategy it
    /// used.
    ///
    /// # Errors
    /// When the volume has another grid than the job, or the backend lacks the strategy. The volume may then hold
    /// anything, but never passes as a result.
    fn voxelize(&self, mesh: &LatticeMesh<'_>, job: &Job, volume: &mut Volume) -> Result<Strategy, Error>;
}

/// Why a voxelization did not happen.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The mesh is broken.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The mesh does not fit the lattice.
    #[error(transparent)]
    Lattice(#[from] LatticeError),
    /// The grid is impossible.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The job is impossible.
    #[error(transparent)]
    Job(#[from] JobError),
    /// The volume cannot be had.
    #[error(transparent)]
    Volume(#[from] VolumeError),
    /// The backend lacks the strategy.
    #[error("the {backend} backend has no strategy `{strategy}`; it has: {}", list(has))]
    Strategy {
        /// The backend's name.
        backend: &'static str,
        /// The strategy asked for.
        strategy: Strategy,
        /// What it has.
        has: &'static [Strategy],
    },
    /// The volume to write into has another grid than the job.
    #[error("the volume's grid is not the job's; make the volume with `Volume::new(*job.grid())`")]
    GridMismatch,
    /// The device failed; what it computed is lost.
    #[error("{backend}: {reason}")]
    Device {
        /// The device's name.
        backend: String,
        /// What happened and what to do.
        reason: String,
    },
}

fn list(strategies: &[Strategy]) -> String {
    strategies.iter().map(|s| s.name()).collect::<Vec<_>>().join(", ")
}

/// Voxelizes a mesh on the CPU with all threads: snap, allocate, voxelize.
///
/// # Errors
/// When the mesh is broken or too far from the grid, or memory is short.
///
/// ```
/// use trixel::{Grid, Job, Mesh, Mode};
/// let mesh = Mesh::new(vec![[0.0; 3], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]], vec![[0, 1, 2]]);
/// let grid = Grid::new([-0.5; 3], [1.0; 3], [5, 5, 1])?;
/// let volume = trixel::voxelize(&mesh, &Job::new(grid, Mode::Conservative))?;
/// assert_eq!(volume.count(), 19);
/// assert!(volume.get([1, 4, 0]) && !volume.get([2, 4, 0]));
/// # Ok::<(), trixel::Error>(())
/// ```
pub fn voxelize(mesh: &Mesh, job: &Job) -> Result<Volume, Error> {
    let lattice = LatticeMesh::snap(mesh, job.grid())?;
    let mut volume = Volume::new(*job.grid())?;
    crate::cpu::CpuBackend::default().voxelize(&lattice, job, &mut volume)?;
    Ok(volume)
}
