//! Render targets of `tiled`, after J. Pantaleoni, *VoxelPipe: A Programmable Pipeline for 3D Voxelization*, 2011: values that
//! the triangles of a voxel blend in a workgroup's memory, in the pass that finds the voxels.
//!
//! A workgroup appends its tile's voxels with their values to a list. Tiles that several workgroups share, and triangles that
//! are too many for one round, give a voxel several such rows; when all are there and the bits finished, each row finds its
//! voxel's place by prefix sums and is blended into the row that stays. Blends are of integers and in any order the same.

mod plan;

use trixel::{Mode, Strategy, VoxelOrder};

use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::kernel::{Bound, Dispatcher, Kernel};
use crate::lists::{self, GpuVoxelList, ListMethod};
use crate::mesh::GpuMesh;
use crate::passes::Appending;
use crate::rank::{locate_words, rank};
use crate::shader::Sink;
use crate::volume::GpuVolume;
use crate::voxelizer::Voxelizer;

pub(crate) use plan::Plan;
use plan::most_targets;

/// How the values of a voxel's triangles become one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Blend {
    /// The least.
    Min,
    /// The largest.
    Max,
    /// The sum, modulo 2^32.
    Add,
}

/// What a triangle paints on each of its voxels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Source<'a> {
    /// Its number in the mesh.
    Triangle,
    /// 1.
    One,
    /// A value that the caller chose: one for each triangle of the mesh, in order.
    Values(&'a [u32]),
}

/// A render target of [`Voxelizer::tiled_targets`]: a `u32` for each set voxel, blended from all triangles that set it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Target<'a> {
    /// How.
    pub blend: Blend,
    /// From what.
    pub source: Source<'a>,
}

impl<'a> Target<'a> {
    /// The lowest triangle of each voxel.
    pub const ID: Self = Self { blend: Blend::Min, source: Source::Triangle };
    /// How many triangles set each voxel.
    pub const COUNT: Self = Self { blend: Blend::Add, source: Source::One };

    /// The least of the values of each voxel's triangles.
    #[must_use]
    pub fn min(values: &'a [u32]) -> Self {
        Self { blend: Blend::Min, source: Source::Values(values) }
    }

    /// The largest of the values of each voxel's triangles.
    #[must_use]
    pub fn max(values: &'a [u32]) -> Self {
        Self { blend: Blend::Max, source: Source::Values(values) }
    }

    /// The sum of the values of each voxel's triangles, modulo 2^32.
    #[must_use]
    pub fn add(values: &'a [u32]) -> Self {
        Self { blend: Blend::Add, source: Source::Values(values) }
    }
}

/// Blended targets in a buffer of a [`Gpu`]: rows in the order of [`GpuVoxelList`] by x, y, z.
#[derive(Debug)]
pub struct GpuTargets {
    list: GpuVoxelList,
    rows: wgpu::Buffer,
    targets: usize,
    appended: u32,
    scratch_bytes: u64,
}

impl GpuTargets {
    /// The set voxels, in the order of the rows.
    #[must_use]
    pub fn list(&self) -> &GpuVoxelList {
        &self.list
    }

    /// A `u32` for each target, for each voxel. The buffer may be longer than that.
    #[must_use]
    pub fn buffer(&self) -> &wgpu::Buffer {
        &self.rows
    }

    /// How many targets there are: words of a row.
    #[must_use]
    pub fn targets(&self) -> usize {
        self.targets
    }

    /// Bytes of the rows.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        u64::from(self.list.len()) * self.targets as u64 * 4
    }

    /// How many rows workgroups wrote: one for each voxel, and more where tiles were shared.
    #[must_use]
    pub fn appended(&self) -> u32 {
        self.appended
    }

    /// Bytes that making them took beside the volume, the list, the rows and what strategy `tiled` takes anyway.
    #[must_use]
    pub fn scratch_bytes(&self) -> u64 {
        self.scratch_bytes
    }

    /// The values of each target, in the order of the voxels.
    ///
    /// # Errors
    /// When memory runs out or the device is lost.
    pub fn download(&self, gpu: &Gpu) -> Result<Vec<Vec<u32>>, GpuError> {
        let words = self.list.len() as usize * self.targets;
        let read = Dispatcher::new(gpu).read_words(&[(&self.rows, words)])?;
        let words = read.into_iter().next().unwrap_or_default();
        Ok((0..self.targets).map(|target| words.iter().skip(target).step_by(self.targets).copied().collect()).collect())
    }
}

/// One value of each target that has some, triangle by triangle.
fn given(gpu: &Gpu, mesh: &GpuMesh, targets: &[Target<'_>]) -> Result<wgpu::Buffer, GpuError> {
    let mut columns = vec![];
    for (target, Target { source, .. }) in targets.iter().enumerate() {
        if let Source::Values(values) = source {
            let (given, triangles) = (values.len() as u64, mesh.triangles());
            if given != triangles {
                return Err(GpuError::TargetValues { target, given, triangles });
            }
            columns.push(*values);
        }
    }
    let words = mesh.triangles() * columns.len() as u64;
    gpu.check_storage("the triangles' values for render targets", words * 4)?;
    let triangles = 0..columns.first().map_or(0, |values| values.len());
    let words: Vec<u32> =
        triangles.flat_map(|i| columns.iter().filter_map(move |values| values.get(i).copied())).collect();
    gpu.buffer_with("trixel values of triangles", bytemuck::cast_slice(&words), wgpu::BufferUsages::STORAGE)
}

/// Voxelizes and blends.
pub(crate) fn blend(
    voxelizer: &mut Voxelizer,
    mesh: &GpuMesh,
    volume: &GpuVolume,
    targets: &[Target<'_>],
) -> Result<GpuTargets, GpuError> {
    let gpu = voxelizer.gpu().clone();
    let (strategy, mode) = (voxelizer.strategy(), voxelizer.job().mode());
    if strategy != Strategy::Tiled || mode == Mode::Solid {
        return Err(GpuError::NoTargets { strategy, mode });
    }
    let memory = gpu.limits().workgroup_bytes;
    let Some(plan) = Plan::new(targets, memory) else {
        let (adapter, most) = (gpu.info().to_string(), most_targets(memory));
        return Err(GpuError::TargetCount { adapter, given: targets.len(), most });
    };
    if mesh.cpu_triangles() > 0 {
        return Err(GpuError::TrianglesTooLarge(mesh.cpu_triangles() as u64));
    }
    let given = given(&gpu, mesh, targets)?;
    let sink = Sink::Targets(plan);
    let pairs = voxelizer.count_pairs(mesh, volume, sink)?;

    // More than the surface of the grid; a wrong guess costs a second run.
    let [x, y, z] = volume.grid().dims().map(u64::from);
    let guess = 3 * (x * y + y * z + z * x) + 1024;
    let (appended, count) = lists::appended(&gpu, sink.entry_words(), &[], guess, |rows| {
        voxelizer.run_into(mesh, volume, Appending { sink, buffers: &[rows, &given], pairs: Some(&pairs) })
    })?;
    let list = GpuVoxelList::of(&gpu, volume, ListMethod::Scan, VoxelOrder::Xyz)?;
    let bytes = u64::from(list.len()) * plan.len() as u64 * 4;
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
    let rows = gpu.storage("the voxels' render targets", bytes, usage)?;
    let ranked = rank(&gpu, volume)?;
    let mut dispatcher = Dispatcher::new(&gpu);
    let length = [list.len()];
    let bound = [(0, Bound::Words(&length)), (1, Bound::Buffer(&rows))];
    dispatcher.dispatch(Kernel::BeginTargets(plan), &bound, list.len())?;
    for slab in &ranked {
        // So that places count from the first slab on.
        let words = locate_words(volume, slab.slab, count, slab.first().wrapping_neg(), 0);
        let buffers = [slab.slab.buffer(), slab.sums.numbers(), &appended, &rows].map(Bound::Buffer);
        let bound = [vec![(0, Bound::Words(&words))], (1..).zip(buffers).collect()].concat();
        dispatcher.dispatch(Kernel::JoinTargets(plan), &bound, count)?;
    }
    dispatcher.submit()?;
    let scratch_bytes = appended.size() + given.size() + ranked.iter().map(|slab| slab.sums.bytes()).sum::<u64>();
    Ok(GpuTargets { list, rows, targets: plan.len(), appended: count, scratch_bytes })
}
