//! The GPU as a [`trixel::Backend`].

use trixel::lattice::LatticeMesh;
use trixel::{Backend, Error, Job, Strategy, Volume};

use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::mesh::GpuMesh;
use crate::volume::GpuVolume;
use crate::voxelizer::{Options, STRATEGIES, Voxelizer};

/// Uploads, voxelizes and downloads. Programs that have their mesh on the GPU, or want the voxels there, use
/// [`Voxelizer`] instead.
#[derive(Clone, Debug)]
pub struct GpuBackend {
    gpu: Gpu,
    options: Options,
}

impl GpuBackend {
    /// On an open device.
    #[must_use]
    pub fn new(gpu: Gpu, options: Options) -> Self {
        Self { gpu, options }
    }

    fn run(&self, mesh: &LatticeMesh<'_>, job: &Job, volume: &mut Volume) -> Result<Strategy, GpuError> {
        let on_gpu = GpuMesh::upload(&self.gpu, mesh)?;
        let voxels = GpuVolume::new(&self.gpu, *job.grid())?;
        let mut voxelizer = Voxelizer::new(&self.gpu, job, &self.options)?;
        voxelizer.run(&on_gpu, &voxels)?;
        voxels.download(&self.gpu, volume)?;
        Ok(voxelizer.strategy())
    }
}

impl Backend for GpuBackend {
    fn name(&self) -> &'static str {
        "gpu"
    }

    fn strategies(&self) -> &'static [Strategy] {
        &STRATEGIES
    }

    fn voxelize(&self, mesh: &LatticeMesh<'_>, job: &Job, volume: &mut Volume) -> Result<Strategy, Error> {
        if volume.grid() != job.grid() {
            return Err(Error::GridMismatch);
        }
        if job.strategy() != Strategy::Auto && !STRATEGIES.contains(&job.strategy()) {
            return Err(Error::Strategy { backend: self.name(), strategy: job.strategy(), has: self.strategies() });
        }
        self.run(mesh, job, volume).map_err(|error| match error {
            GpuError::Cpu(error) => error,
            error => Error::Device { backend: self.name().to_owned(), reason: error.to_string() },
        })
    }
}
