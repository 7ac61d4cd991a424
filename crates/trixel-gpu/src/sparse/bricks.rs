//! Brick maps: 8 x 8 x 8 bits a brick.

use trixel::{BrickMap, Grid, VoxelOrder};

use super::{cubes, list_bound, read_word};
use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::kernel::{Bound, Dispatcher, Kernel};
use crate::lists::{Entries, GpuVoxelList};

/// `u32` words of a brick.
const BRICK_WORDS: u32 = 16;
/// A brick is 2^3 voxels wide.
pub(super) const SHIFT: u32 = 3;

/// The set voxels of a grid as bricks of 8 x 8 x 8 bits in buffers of a [`Gpu`], along the Morton curve.
#[derive(Debug)]
pub struct GpuBrickMap {
    pub(super) grid: Grid,
    places: Entries,
    bits: wgpu::Buffer,
}

impl GpuBrickMap {
    /// The bricks that a list has voxels of.
    ///
    /// # Errors
    /// When the list is not along the Morton curve, the bricks exceed what the adapter binds, memory runs out or the device
    /// is lost.
    pub fn of(gpu: &Gpu, list: &GpuVoxelList) -> Result<Self, GpuError> {
        if list.order() != VoxelOrder::Morton {
            return Err(GpuError::ListOrder);
        }
        let parameters = [list.len(), SHIFT];
        let mut counting = Dispatcher::new(gpu);
        let begun = cubes(&mut counting, &parameters, list.buffer())?;
        let count = read_word(counting, begun.total())?;
        let places = Entries::new(gpu, count)?;
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        // New buffers hold zeros.
        let bits = gpu.storage("a brick map's bits", u64::from(count.max(1)) * u64::from(BRICK_WORDS) * 4, usage)?;
        let [parameters, entries, begun] = list_bound(&parameters, list.buffer(), &begun);
        let bound = [parameters, entries, begun, (3, Bound::Buffer(&places.buffer)), (4, Bound::Buffer(&bits))];
        let mut writing = Dispatcher::new(gpu);
        writing.dispatch(Kernel::WriteBricks, &bound, list.len())?;
        writing.submit()?;
        Ok(Self { grid: *list.grid(), places, bits })
    }

    /// How many bricks there are, full ones among them.
    #[must_use]
    pub fn len(&self) -> u32 {
        self.places.length
    }

    /// Whether there is no brick.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Where the bricks are, in bricks: entries like those of [`GpuVoxelList::buffer`].
    #[must_use]
    pub fn places(&self) -> &wgpu::Buffer {
        &self.places.buffer
    }

    /// The bricks' voxels: 16 `u32` a brick, voxel (x, y, z) of it being bit `64 x + 8 y + z`.
    #[must_use]
    pub fn bits(&self) -> &wgpu::Buffer {
        &self.bits
    }

    /// The same voxels as the CPU keeps them.
    ///
    /// # Errors
    /// When memory runs out or the device is lost.
    pub fn download(&self, gpu: &Gpu) -> Result<BrickMap, GpuError> {
        let count = self.len() as usize;
        let wanted = [(self.places(), 2 * count), (&self.bits, BRICK_WORDS as usize * count)];
        let read = Dispatcher::new(gpu).read_words(&wanted)?;
        let [places, bits] = read.as_slice() else { return Ok(BrickMap::empty(self.grid)) };
        let places = places.as_chunks::<2>().0.iter().map(|[xy, z]| [xy & 0xffff, xy >> 16, *z]);
        let bricks = bits.as_chunks::<{ BRICK_WORDS as usize }>().0.iter().map(|words| {
            let pairs = words.as_chunks::<2>().0;
            std::array::from_fn(|x| u64::from(pairs[x][0]) | u64::from(pairs[x][1]) << 32)
        });
        Ok(BrickMap::from_bricks(self.grid, places.zip(bricks)))
    }
}
