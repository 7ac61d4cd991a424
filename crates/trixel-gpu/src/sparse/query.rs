//! Questions to an octree, in batches.

use trixel::octree::{Cell, Look};

use super::GpuOctree;
use super::octree::{LOOK_WORDS, Looks, look_of};
use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::kernel::{Bound, Dispatcher, Kernel};
use crate::lists::Entries;

/// Words of an answer: what the cube holds, and its look.
const WORDS: usize = 1 + LOOK_WORDS;
/// What a cube holds: as in `octree_descent.wgsl`.
const EMPTY: u32 = 0;
const FULL: u32 = 1;

impl GpuOctree {
    /// The cubes of level `level` (2^level voxels wide) that hold some voxels, `None` where they are empty: the answers of
    /// [`trixel::octree::Octree::find`]. Level 0 asks for the voxels themselves.
    ///
    /// # Errors
    /// When there are more than the adapter binds, memory runs out or the device is lost.
    pub fn find(&self, gpu: &Gpu, voxels: &[[u32; 3]], level: u32) -> Result<Vec<Option<Cell>>, GpuError> {
        let count = u32::try_from(voxels.len()).unwrap_or(u32::MAX);
        let questions = Entries::new(gpu, count)?;
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let answers = gpu.storage("an octree's answers", u64::from(count) * 4 * WORDS as u64, usage)?;
        let width = 1 << self.height();
        // Those beyond are not asked for; they only have to fit.
        let words: Vec<[u32; 2]> =
            voxels.iter().map(|voxel| voxel.map(|c| c.min(width - 1))).map(|[x, y, z]| [x | y << 16, z]).collect();
        gpu.guarded(|| gpu.queue().write_buffer(&questions.buffer, 0, bytemuck::cast_slice(&words)))?;
        let nothing = if self.looks.is_some() { None } else { Some(Looks::new(gpu, 0, 0)?) };
        let Some(looks) = self.looks.as_ref().or(nothing.as_ref()) else { return Ok(vec![]) };
        let tree = [self.height(), u32::from(self.everything), self.len(), count, level.min(self.height())];
        let buffers = [&questions.buffer, &answers, self.buffer(), &looks.nodes, &looks.voxels];
        let mut bound = vec![(0, Bound::Words(&tree))];
        bound.extend((1..).zip(buffers.map(Bound::Buffer)));
        let mut asking = Dispatcher::new(gpu);
        asking.dispatch(Kernel::Answer, &bound, count)?;
        let read = asking.read_words(&[(&answers, WORDS * voxels.len())])?;
        let answers = read.iter().flat_map(|words| words.as_chunks::<WORDS>().0);
        let cell = |(voxel, [content, look @ ..]): (&[u32; 3], &[u32; WORDS])| {
            let look = self.looks.as_ref().map(|_| look_of(look));
            let full = *content == FULL;
            let there = *content != EMPTY && voxel.iter().all(|&c| c < width);
            there.then(|| Cell {
                cell: voxel.map(|c| c.checked_shr(level).unwrap_or(0)),
                full,
                // Full cubes and voxels without attributes have none, but cubes that hold such are averages of nothing.
                look: look.filter(|look| !full || *look != Look::default()),
            })
        };
        Ok(voxels.iter().zip(answers).map(cell).collect())
    }

    /// Which of some voxels are set; voxels outside the grid are not.
    ///
    /// # Errors
    /// When there are more than the adapter binds, memory runs out or the device is lost.
    pub fn contains(&self, gpu: &Gpu, voxels: &[[u32; 3]]) -> Result<Vec<bool>, GpuError> {
        Ok(self.find(gpu, voxels, 0)?.iter().map(Option::is_some).collect())
    }

    /// What some voxels look like; `None` where they are not set or have no attributes.
    ///
    /// # Errors
    /// When there are more than the adapter binds, memory runs out or the device is lost.
    pub fn look(&self, gpu: &Gpu, voxels: &[[u32; 3]]) -> Result<Vec<Option<Look>>, GpuError> {
        Ok(self.find(gpu, voxels, 0)?.into_iter().map(|cell| cell?.look).collect())
    }
}
