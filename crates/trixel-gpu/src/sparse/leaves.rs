//! The attributes of a list's voxels as octrees add them up.

use std::ops::Range;

use trixel::attributes::Combine;
use trixel::attributes::device::NOTHING;

use crate::attributes::{GpuAttributes, Recipe};
use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::kernel::{Bound, Dispatcher, Kernel};
use crate::lists::GpuVoxelList;

/// What each voxel of a list along the Morton curve has: four words each, as `octree_leaf.wgsl` tells. The attributes are of
/// the same voxels by x, y, z.
pub(super) fn leaves(gpu: &Gpu, list: &GpuVoxelList, attributes: &GpuAttributes) -> Result<wgpu::Buffer, GpuError> {
    let (rows_of, ranges) = rows_of(attributes);
    let what = "the voxels' rows";
    gpu.check_storage(what, rows_of.len() as u64 * 4)?;
    let rows_of = gpu.buffer_with(what, bytemuck::cast_slice(&rows_of), wgpu::BufferUsages::STORAGE)?;
    // New buffers hold zeros: no attributes.
    let bytes = u64::from(list.len()) * 16;
    let leaves = gpu.storage("an octree's leaves", bytes.max(16), wgpu::BufferUsages::STORAGE)?;
    let recipe = Recipe::of(attributes.request());
    let mut finding = Dispatcher::new(gpu);
    for ((rows, _), voxels) in attributes.rows().iter().zip(ranges).filter(|(_, voxels)| !voxels.is_empty()) {
        let parameters = [list.len(), voxels.start, voxels.end - voxels.start];
        let mut bound = vec![(0, Bound::Words(&parameters))];
        let buffers = [list.buffer(), attributes.list().buffer(), &rows_of, rows, &leaves];
        bound.extend((1..).zip(buffers.map(Bound::Buffer)));
        finding.dispatch(Kernel::FindLeaves(recipe), &bound, list.len())?;
    }
    finding.submit()?;
    Ok(leaves)
}

/// For each voxel the row that stands for it, its first, in the piece that has its rows; and the voxels of each piece.
fn rows_of(attributes: &GpuAttributes) -> (Vec<u32>, Vec<Range<u32>>) {
    let each_triangle = attributes.request().combine() == Combine::All;
    let mut counts = attributes.counts().iter();
    let (mut all, mut ranges) = (vec![], vec![]);
    let place = |all: &Vec<u32>| u32::try_from(all.len()).unwrap_or(u32::MAX);
    for (_, length) in attributes.rows() {
        let start = place(&all);
        let mut row = 0;
        while row < *length
            && let Some(count) = counts.next()
        {
            all.push(if *count > 0 { row } else { NOTHING });
            row += if each_triangle { *count } else { 1 };
        }
        ranges.push(start..place(&all));
    }
    all.extend(counts.map(|_| NOTHING));
    (all, ranges)
}
