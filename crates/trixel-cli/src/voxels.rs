//! The voxels of a run: dense, or as bricks where the grid is too large or the user wants them sparse.

use std::path::Path;

use anyhow::{Result, bail};
use trixel::fill::Fill;
use trixel::{BrickMap, Bytes, CpuBackend, Job, Occupancy, Strategy, Volume};
use trixel_io::VolumeFormat;
use trixel_io::atomic_file::Staged;
use trixel_io::write::{WriteOptions, write_bricks};

use crate::args::VoxelizeArgs;
use crate::engine::{self, Engine, Ran, Task};
use crate::progress::Reporter;
use crate::{memory, volume};

/// What a run fills.
pub(crate) enum Voxels {
    Dense(Volume),
    Bricks(BrickMap),
}

impl Voxels {
    /// Empty, and bricks if `--sparse` asks for them or the dense grid would not fit the memory, and every output takes
    /// them. A GPU that was asked for, attributes and fills want dense ones.
    pub(crate) fn allocate(args: &VoxelizeArgs, engine: &Engine, job: &Job) -> Result<Self> {
        let takes_bricks = |path: &Path| VolumeFormat::from_path(path).is_some_and(VolumeFormat::takes_bricks);
        let dense_only = args.outputs.iter().find(|path| !takes_bricks(path));
        let bricks_will_do = engine.cpu_may_compute()
            && args.attributes.attributes.is_empty()
            && Fill::from(args.method.fill) == Fill::Parity;
        let available = memory::available_for_voxels();
        let needed = Volume::required_bytes(job.grid());
        let fits = available.is_none_or(|available| needed <= available);
        match dense_only {
            None if bricks_will_do && (args.sparse || !fits) => Ok(Self::Bricks(BrickMap::empty(*job.grid()))),
            Some(path) if !fits => bail!(
                "{} takes a dense grid, which needs {} here, but only {} are available; write sparse formats alone \
                 (.npz, .ply, .vox), or choose a lower resolution or a larger voxel size",
                path.display(),
                Bytes(needed),
                Bytes(available.unwrap_or(0))
            ),
            _ => Ok(Self::Dense(Volume::with_memory_limit(*job.grid(), available)?)),
        }
    }

    /// Overwrites them with the voxels of a mesh, as often as the task says.
    pub(crate) fn fill(&mut self, engine: &Engine, task: &Task<'_>, reporter: &Reporter) -> Result<Ran> {
        match self {
            Self::Dense(volume) => engine.run(task, volume, reporter),
            Self::Bricks(map) => engine::on_cpu(task.repeat, reporter, || {
                let Task { lattice, job, .. } = task;
                // The last ones first, so that there is room for the new.
                *map = BrickMap::empty(*job.grid());
                *map = CpuBackend::default().voxelize_bricks(lattice, job, memory::available_for_voxels())?;
                Ok(Strategy::ColumnRuns)
            }),
        }
    }

    /// The dense ones, if they are dense.
    pub(crate) fn dense(&self) -> Option<&Volume> {
        match self {
            Self::Dense(volume) => Some(volume),
            Self::Bricks(_) => None,
        }
    }

    /// How many are set.
    pub(crate) fn count(&self) -> u64 {
        match self {
            Self::Dense(volume) => volume.count(),
            Self::Bricks(map) => map.count(),
        }
    }

    /// Writes one output beside its target.
    pub(crate) fn stage_output(&self, path: &Path, options: &WriteOptions<'_>) -> Result<Staged> {
        match self {
            Self::Dense(dense) => volume::stage_output(path, dense, options),
            Self::Bricks(map) => Ok(write_bricks(path, map, options)?),
        }
    }
}
