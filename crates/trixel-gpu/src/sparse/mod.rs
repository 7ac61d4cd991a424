//! Sparse structures on the GPU, built from a list along the Morton curve and equal to the CPU's.

mod bricks;
mod leaves;
mod march;
mod octree;
mod query;

pub use bricks::GpuBrickMap;
pub use march::GridRay;
pub(crate) use octree::Below;
pub use octree::GpuOctree;
use octree::height_of;

use crate::error::GpuError;
use crate::kernel::{Bound, Dispatcher, Kernel};
use crate::prefix_sum::PrefixSum;

/// `Sparse` of `sparse.wgsl`: a list's length and the cubes' width.
type Parameters = [u32; 2];

/// The bindings that all kernels over a list begin with.
fn list_bound<'a>(parameters: &'a Parameters, list: &'a wgpu::Buffer, begun: &'a PrefixSum) -> [(u32, Bound<'a>); 3] {
    [(0, Bound::Words(parameters)), (1, Bound::Buffer(list)), (2, Bound::Buffer(begun.numbers()))]
}

/// Records the finding of the first entry of each cube, summed up: at each entry, how many cubes begin before it.
fn cubes(dispatcher: &mut Dispatcher<'_>, parameters: &Parameters, list: &wgpu::Buffer) -> Result<PrefixSum, GpuError> {
    let begun = PrefixSum::new(dispatcher.gpu, parameters[0])?;
    dispatcher.dispatch(Kernel::MarkCubes, &list_bound(parameters, list, &begun), parameters[0])?;
    begun.record(dispatcher)?;
    Ok(begun)
}

/// Submits what was recorded and reads one word.
fn read_word(dispatcher: Dispatcher<'_>, buffer: &wgpu::Buffer) -> Result<u32, GpuError> {
    Ok(dispatcher.read_words(&[(buffer, 1)])?.into_iter().flatten().next().unwrap_or(0))
}
