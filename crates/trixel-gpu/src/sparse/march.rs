//! Rays to the first set voxel, in batches.

use trixel::octree::Hit;

use super::{GpuBrickMap, GpuOctree, height_of};
use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::kernel::{Bound, Dispatcher, Kernel};

/// Words of a ray and of a hit.
const WORDS: usize = 6;
/// What became of a ray: as in `march.wgsl`.
const HIT: u32 = 1;
const UNDECIDED: u32 = 3;

/// A ray of integers, so that every device finds exactly the same first voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GridRay {
    origin: [i32; 3],
    direction: [i32; 3],
}

impl GridRay {
    /// Steps of an origin's coordinate in a voxel.
    pub const STEPS: i32 = 256;
    /// The farthest origin, in steps: 2^20 voxels.
    pub const MAX_ORIGIN: i32 = 1 << 28;
    /// The largest component of a direction.
    pub const MAX_DIRECTION: i32 = 1 << 15;

    /// A ray from `origin`, in [`GridRay::STEPS`] a voxel from the grid's minimum corner, along `direction`; `None` when
    /// either is out of range or the direction is 0.
    #[must_use]
    pub fn new(origin: [i32; 3], direction: [i32; 3]) -> Option<Self> {
        let within = |v: [i32; 3], most: i32| v.iter().all(|c| (-most..=most).contains(c));
        let fits = within(origin, Self::MAX_ORIGIN) && within(direction, Self::MAX_DIRECTION);
        (fits && direction != [0; 3]).then_some(Self { origin, direction })
    }

    /// The ray nearest to one in voxels: its origin is rounded to steps, and its direction made as long as fits. `None`
    /// when it is not finite, too far or without direction.
    #[must_use]
    pub fn rounded(origin: [f64; 3], direction: [f64; 3]) -> Option<Self> {
        let longest = direction.iter().fold(0.0, |longest: f64, c| longest.max(c.abs()));
        if !origin.iter().chain(&direction).all(|c| c.is_finite()) || longest == 0.0 {
            return None;
        }
        #[expect(clippy::cast_possible_truncation, reason = "saturates, and is looked at then")]
        let integers = |v: [f64; 3], scale: f64| v.map(|c| (c * scale).round_ties_even() as i32);
        let scale = f64::from(Self::MAX_DIRECTION) / longest;
        Self::new(integers(origin, f64::from(Self::STEPS)), integers(direction, scale))
    }

    /// Origin and direction as [`trixel::octree::Octree::march`] takes them, exact.
    #[must_use]
    pub fn floats(&self) -> ([f64; 3], [f64; 3]) {
        (self.origin.map(|c| f64::from(c) / f64::from(Self::STEPS)), self.direction.map(f64::from))
    }
}

/// Where rays enter the first set voxel, for a structure whose own bindings are `own`.
fn march(
    gpu: &Gpu,
    rays: &[GridRay],
    kernel: Kernel,
    [height, everything, nodes]: [u32; 3],
    own: &[&wgpu::Buffer],
) -> Result<Vec<Option<Hit>>, GpuError> {
    let count = u32::try_from(rays.len()).unwrap_or(u32::MAX);
    let bytes = rays.len() as u64 * WORDS as u64 * 4;
    let asked = gpu.storage("rays", bytes, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST)?;
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
    // New buffers hold zeros: rays that have not begun.
    let hits = gpu.storage("rays' hits", bytes, usage)?;
    let words: Vec<[i32; 3]> = rays.iter().flat_map(|ray| [ray.origin, ray.direction]).collect();
    gpu.guarded(|| gpu.queue().write_buffer(&asked, 0, bytemuck::cast_slice(&words)))?;
    let parameters = [height, everything, nodes, count];
    let buffers = [&asked, &hits].into_iter().chain(own.iter().copied()).map(Bound::Buffer);
    let bound: Vec<_> = std::iter::once((0, Bound::Words(&parameters))).chain((1..).zip(buffers)).collect();
    let read = loop {
        let mut marching = Dispatcher::new(gpu);
        marching.dispatch(kernel, &bound, count)?;
        let read = marching.read_words(&[(&hits, rays.len() * WORDS)])?;
        // Each dispatch takes every ray on by many cubes.
        if !read.iter().flat_map(|words| words.as_chunks::<WORDS>().0).any(|hit| hit[0] == UNDECIDED) {
            break read;
        }
    };
    let hits = read.iter().flat_map(|words| words.as_chunks::<WORDS>().0);
    let hit = |[state, xy, z, axis, num, den]: &[u32; WORDS]| {
        let steps = f64::from(num.cast_signed()) / f64::from(GridRay::STEPS);
        (*state == HIT).then(|| Hit {
            distance: steps / f64::from(*den),
            voxel: [xy & 0xffff, xy >> 16, *z],
            axis: *axis as usize,
        })
    };
    Ok(hits.map(hit).collect())
}

impl GpuOctree {
    /// Where each ray enters the first set voxel; the hits of [`trixel::octree::Octree::march`]. What is there looks like
    /// [`GpuOctree::find`] says, at any level of detail.
    ///
    /// # Errors
    /// When there are more rays than the adapter binds, memory runs out or the device is lost.
    pub fn march(&self, gpu: &Gpu, rays: &[GridRay]) -> Result<Vec<Option<Hit>>, GpuError> {
        let tree = [height_of(&self.grid), u32::from(self.everything), self.len()];
        march(gpu, rays, Kernel::MarchOctree, tree, &[self.buffer()])
    }
}

impl GpuBrickMap {
    /// Where each ray enters the first set voxel; the hits of [`trixel::octree::Octree::march`].
    ///
    /// # Errors
    /// When there are more rays than the adapter binds, memory runs out or the device is lost.
    pub fn march(&self, gpu: &Gpu, rays: &[GridRay]) -> Result<Vec<Option<Hit>>, GpuError> {
        // Bricks are 8 wide, however small the grid.
        let tree = [height_of(&self.grid).max(super::bricks::SHIFT), 0, self.len()];
        march(gpu, rays, Kernel::MarchBricks, tree, &[self.places(), self.bits()])
    }
}
