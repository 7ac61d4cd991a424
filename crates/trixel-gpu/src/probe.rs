//! The check before the first use: does this driver compute right voxels?

use trixel::lattice::LatticeMesh;
use trixel::{Backend, CpuBackend, Grid, Job, Mesh, Strategy, Volume};

use crate::cutoff::{Cutoff, Dilation, Heuristic};
use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::mesh::GpuMesh;
use crate::shader::Variant;
use crate::volume::GpuVolume;
use crate::voxelizer::{Options, Voxelizer};

/// A small scene in which drivers have gone wrong: one triangle with more columns than an invocation may loop over,
/// a needle whose dilation flies off, edges and corners on voxel boundaries, degenerate triangles, and crumbs.
fn scene() -> Mesh {
    let mut positions = vec![
        [1.0, 2.0, 3.0],
        [290.0, 4.0, 2.5],
        [3.0, 280.0, 4.75],
        [0.0, 0.0, 0.0],
        [300.0, 150.00001, 7.0],
        [299.0, 150.0, 7.25],
        [16.0, 16.0, 1.0],
        [48.0, 16.0, 1.0],
        [16.0, 48.0, 1.0],
        [5.5, 5.5, 0.5],
        [200.5, 205.5, 7.5],
        [120.0, -40.0, 3.0],
        [121.0, 400.0, 5.0],
        [119.0, 400.0, -60.0],
    ];
    let mut triangles = vec![[0, 1, 2], [3, 4, 5], [6, 7, 8], [9, 10, 9], [10, 10, 10], [11, 12, 13]];
    // Crumbs: a spiral of triangles below a voxel in size.
    for i in 0..64u32 {
        let t = f64::from(i);
        let at = [150.0 + t * (t * 0.7).cos(), 150.0 + t * (t * 0.7).sin(), 4.0 + 0.05 * t];
        let first = 14 + 3 * i;
        positions.extend([at, [at[0] + 0.4, at[1], at[2] + 0.1], [at[0], at[1] + 0.3, at[2] - 0.6]]);
        triangles.push([first, first + 1, first + 2]);
    }
    Mesh::new(positions, triangles)
}

/// What is checked together, once per device: what pipelines are specialized for. Not everything at once, because building
/// all pipelines takes some drivers many seconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Checked {
    pub(crate) variant: Variant,
    pub(crate) strategy: Strategy,
    pub(crate) heuristic: Heuristic,
    pub(crate) dilation: Dilation,
}

/// Voxelizes the scene and compares with the CPU.
pub(crate) fn check(gpu: &Gpu, what: Checked) -> Result<(), GpuError> {
    if gpu.is_checked(&what) {
        return Ok(());
    }
    let Checked { variant, strategy, heuristic, dilation } = what;
    let mesh = scene();
    let grid = Grid::new([0.0; 3], [1.0; 3], [301, 283, 9]).map_err(trixel::Error::from)?;
    let job = Job::new(grid, variant.mode);
    let lattice = LatticeMesh::snap(&mesh, &grid).map_err(trixel::Error::from)?;
    let mut expected = Volume::new(grid).map_err(trixel::Error::from)?;
    CpuBackend::default().voxelize(&lattice, &job, &mut expected)?;
    let on_gpu = GpuMesh::upload(gpu, &lattice)?;
    let voxels = GpuVolume::new(gpu, grid)?;
    // Some of the scene on either side.
    let cutoff = Cutoff { heuristic, value: heuristic.cutoff_for(8.0) };
    let options = Options { cutoff: Some(cutoff), dilation, count: variant.counting };
    Voxelizer::unchecked(gpu, &job.with_strategy(strategy), &options)?.run(&on_gpu, &voxels)?;
    let mut found = Volume::new(grid).map_err(trixel::Error::from)?;
    voxels.download(gpu, &mut found)?;
    let pairs = expected.words().iter().zip(found.words());
    let wrong: u64 = pairs.map(|(expected, found)| u64::from((expected ^ found).count_ones())).sum();
    if wrong > 0 {
        return Err(GpuError::WrongVoxels {
            adapter: gpu.info().to_string(),
            reason: format!("{wrong} of {} in mode {} by {strategy}", expected.count(), variant.mode),
        });
    }
    gpu.set_checked(what);
    Ok(())
}
