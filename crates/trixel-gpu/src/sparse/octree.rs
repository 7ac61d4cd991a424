//! Sparse voxel octrees: C. Crassin & S. Green, *Octree-Based Sparse Voxelization Using the GPU Hardware Rasterizer*, 2012;
//! M. Schwarz & H.-P. Seidel, *Fast Parallel Surface and Solid Voxelization on GPUs*, 2010, section 5.
//!
//! Built level by level from the voxels up: each level's cubes, still along the Morton curve, are the list of the next.

use trixel::octree::{Node, Octree};
use trixel::{Grid, VoxelOrder};

use super::{cubes, list_bound, read_word};
use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::kernel::{Bound, Dispatcher, Kernel};
use crate::lists::{Entries, GpuVoxelList};
use crate::prefix_sum::PrefixSum;

/// A sparse voxel octree without attributes in a buffer of a [`Gpu`]: the nodes of [`Octree`].
#[derive(Debug)]
pub struct GpuOctree {
    pub(super) grid: Grid,
    nodes: Entries,
    pub(super) everything: bool,
}

/// A coordinate outside every grid that fits an entry.
const BEYOND: u32 = 0xffff;

/// Levels of nodes over a grid: the root's cube is 2^height voxels wide.
pub(super) fn height_of(grid: &Grid) -> u32 {
    let longest = grid.dims().into_iter().max().unwrap_or(1);
    longest.next_power_of_two().trailing_zeros().max(1)
}

/// The cubes of one level that hold any voxel.
struct Level {
    cubes: Entries,
    /// Octants with voxels, and full ones above; and mixed cubes of the level below before the first child.
    masks: wgpu::Buffer,
    /// Summed up: how many mixed cubes come before each.
    mixed: PrefixSum,
}

impl Level {
    /// The cubes that eight of `below` make; of voxels where that level has no masks.
    fn above(gpu: &Gpu, below: (&wgpu::Buffer, u32), inner: Option<&Self>) -> Result<Self, GpuError> {
        let (list, length) = below;
        let parameters = [length, 1];
        let mut counting = Dispatcher::new(gpu);
        let begun = cubes(&mut counting, &parameters, list)?;
        let count = read_word(counting, begun.total())?;
        let usage = wgpu::BufferUsages::STORAGE;
        let level = Self {
            cubes: Entries::new(gpu, count)?,
            masks: gpu.storage("an octree's masks", u64::from(count.max(1)) * 8, usage)?,
            mixed: PrefixSum::new(gpu, count)?,
        };
        let mut bound = list_bound(&parameters, list, &begun).to_vec();
        if let Some(inner) = inner {
            bound.extend([(3, Bound::Buffer(&inner.masks)), (4, Bound::Buffer(inner.mixed.numbers()))]);
        }
        let written = [&level.cubes.buffer, &level.masks, level.mixed.numbers()];
        bound.extend((5..).zip(written.map(Bound::Buffer)));
        let mut gathering = Dispatcher::new(gpu);
        gathering.dispatch(Kernel::GatherOctants { voxels: inner.is_none() }, &bound, length)?;
        level.mixed.record(&mut gathering)?;
        gathering.submit()?;
        Ok(level)
    }
}

impl GpuOctree {
    /// The octree of a list's voxels.
    ///
    /// # Errors
    /// When the list is not along the Morton curve, the nodes exceed what the adapter binds, memory runs out or the device is
    /// lost.
    pub fn of(gpu: &Gpu, list: &GpuVoxelList) -> Result<Self, GpuError> {
        if list.order() != VoxelOrder::Morton {
            return Err(GpuError::ListOrder);
        }
        let mut levels: Vec<Level> = vec![];
        for _ in 0..height_of(list.grid()) {
            let level = match levels.last() {
                None => Level::above(gpu, (list.buffer(), list.len()), None)?,
                Some(below) => Level::above(gpu, (&below.cubes.buffer, below.cubes.length), Some(below))?,
            };
            levels.push(level);
        }
        let totals: Vec<_> = levels.iter().map(|level| (level.mixed.total(), 1)).collect();
        let counts: Vec<u32> = Dispatcher::new(gpu).read_words(&totals)?.into_iter().flatten().collect();
        // Sums of at most a list's length and a seventh more.
        let nodes = Entries::new(gpu, counts.iter().fold(0, |sum: u32, count| sum.saturating_add(*count)))?;
        let mut writing = Dispatcher::new(gpu);
        let mut start = 0;
        for (i, (level, count)) in levels.iter().zip(&counts).enumerate().rev() {
            // The voxels below the last level have no nodes.
            let below = if i == 0 { 0 } else { start + count };
            let parameters = [level.cubes.length, start, below];
            let buffers = [&level.masks, level.mixed.numbers(), &nodes.buffer];
            let mut bound = vec![(0, Bound::Words(&parameters))];
            bound.extend((1..).zip(buffers.map(Bound::Buffer)));
            writing.dispatch(Kernel::WriteNodes, &bound, level.cubes.length)?;
            start += count;
        }
        writing.submit()?;
        let everything = nodes.length == 0 && !list.is_empty();
        Ok(Self { grid: *list.grid(), nodes, everything })
    }

    /// How many nodes there are.
    #[must_use]
    pub fn len(&self) -> u32 {
        self.nodes.length
    }

    /// Whether there is no node: the grid is empty, or [full](Self::is_full).
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether every voxel of the root's cube is set.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.everything
    }

    /// The nodes, level by level from the root, two `u32` each: [`Node::some`] in the lowest eight bits of the first and
    /// [`Node::full`] in the next eight, then [`Node::first`].
    #[must_use]
    pub fn buffer(&self) -> &wgpu::Buffer {
        &self.nodes.buffer
    }

    /// Which of some voxels are set; voxels outside the grid are not.
    ///
    /// # Errors
    /// When there are more than the adapter binds, memory runs out or the device is lost.
    pub fn contains(&self, gpu: &Gpu, voxels: &[[u32; 3]]) -> Result<Vec<bool>, GpuError> {
        let count = u32::try_from(voxels.len()).unwrap_or(u32::MAX);
        let questions = Entries::new(gpu, count)?;
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let answers = gpu.storage("an octree's answers", u64::from(count) * 4, usage)?;
        // What lies beyond every grid must not lose the bits that tell.
        let words: Vec<[u32; 2]> =
            voxels.iter().map(|voxel| voxel.map(|c| c.min(BEYOND))).map(|[x, y, z]| [x | y << 16, z]).collect();
        gpu.guarded(|| gpu.queue().write_buffer(&questions.buffer, 0, bytemuck::cast_slice(&words)))?;
        let parameters = [height_of(&self.grid), u32::from(self.everything), self.len(), count];
        let mut bound = vec![(0, Bound::Words(&parameters))];
        bound.extend((1..).zip([self.buffer(), &questions.buffer, &answers].map(Bound::Buffer)));
        let mut asking = Dispatcher::new(gpu);
        asking.dispatch(Kernel::Answer, &bound, count)?;
        let read = asking.read_words(&[(&answers, voxels.len())])?;
        Ok(read.into_iter().flatten().map(|answer| answer != 0).collect())
    }

    /// The same octree as the CPU has it.
    ///
    /// # Errors
    /// When memory runs out, the device is lost, or what comes back is no octree.
    pub fn download(&self, gpu: &Gpu) -> Result<Octree, GpuError> {
        let read = Dispatcher::new(gpu).read_words(&[(self.buffer(), 2 * self.len() as usize)])?;
        let nodes = read.iter().flat_map(|words| words.as_chunks::<2>().0).map(|[masks, first]| {
            let [some, full, ..] = masks.to_le_bytes();
            Node { some, full, first: *first }
        });
        Ok(Octree::from_nodes(self.grid, nodes.collect(), self.everything)?)
    }
}
