//! Places of voxels in the list of all, from the bits: what `place.wgsl` reads.

use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::kernel::{Bound, Dispatcher, Kernel};
use crate::lists;
use crate::prefix_sum::PrefixSum;
use crate::volume::{GpuVolume, Slab};

/// A slab of bits with the sums that give places.
pub(crate) struct Ranked<'a> {
    pub(crate) slab: &'a Slab,
    pub(crate) sums: PrefixSum,
    /// How many voxels come before each plane of constant x, of all slabs, and before what follows the last.
    pub(crate) before: Vec<u32>,
}

impl Ranked<'_> {
    /// How many voxels the slabs before have.
    pub(crate) fn first(&self) -> u32 {
        self.before.first().copied().unwrap_or(0)
    }
}

/// `Locate` of `place.wgsl`.
pub(crate) fn locate_words(volume: &GpuVolume, slab: &Slab, items: u32, first: u32, first_triangle: u32) -> [u32; 7] {
    [items, volume.grid().dims()[1], volume.column_words, slab.x(), slab.nx(), first, first_triangle]
}

/// The places of all slabs' voxels.
pub(crate) fn rank<'a>(gpu: &Gpu, volume: &'a GpuVolume) -> Result<Vec<Ranked<'a>>, GpuError> {
    let mut start = 0;
    let ranked = volume.slabs().iter().map(|slab| {
        let mut dispatcher = Dispatcher::new(gpu);
        let sums = lists::count(&mut dispatcher, volume, slab)?;
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let planes = gpu.storage("trixel planes", u64::from(slab.nx()) * 4, usage)?;
        let words = locate_words(volume, slab, slab.nx(), 0, 0);
        let buffers = [slab.buffer(), sums.numbers(), &planes].map(Bound::Buffer);
        let bound = [vec![(0, Bound::Words(&words))], (1..).zip(buffers).collect()].concat();
        dispatcher.dispatch(Kernel::CountBeforePlanes, &bound, slab.nx())?;
        let read = dispatcher.read_words(&[(&planes, slab.nx() as usize), (sums.total(), 1)])?;
        let before: Vec<u32> = read.into_iter().flatten().map(|place| place + start).collect();
        start = before.last().copied().unwrap_or(start);
        Ok(Ranked { slab, sums, before })
    });
    ranked.collect()
}
