//! The set voxels in order, cut into blocks that can be written on several threads: the data of sparse `.npz` and of
//! point clouds.

use std::ops::Range;

use rayon::prelude::*;
use trixel::Occupancy;

/// The set voxels, sorted by x, y, z, in blocks of about [`Self::VOXELS`].
pub(super) struct SparseBlocks<'a, O> {
    voxels: &'a O,
    /// Parts of layers that hold voxels, in order.
    parts: Vec<Part>,
    /// Ranges of `parts`.
    blocks: Vec<Range<usize>>,
    voxel_count: u64,
}

/// Columns of one layer.
struct Part {
    x: u32,
    ys: Range<u32>,
    count: u64,
}

impl<'a, O: Occupancy> SparseBlocks<'a, O> {
    const VOXELS: u64 = 1 << 17;
    /// Columns of a part, so that no block is large even where every voxel is set.
    const COLUMNS: u32 = 64;

    pub(super) fn new(voxels: &'a O) -> Self {
        let [nx, ny, nz] = voxels.grid().dims();
        let parts_of_layer = |x: u32| -> Vec<Part> {
            let bands = (0..ny).step_by(Self::COLUMNS as usize).map(|y| y..ny.min(y + Self::COLUMNS));
            let part = |ys: Range<u32>| {
                let mut count = 0;
                voxels.for_each_word(&[x..x + 1, ys.clone(), 0..nz], |_, word| count += u64::from(word.count_ones()));
                Part { x, ys, count }
            };
            bands.map(part).filter(|part| part.count > 0).collect()
        };
        let parts: Vec<Part> = (0..nx).into_par_iter().flat_map_iter(parts_of_layer).collect();
        let mut blocks: Vec<Range<usize>> = Vec::new();
        let (mut start, mut held) = (0, 0);
        for (i, part) in parts.iter().enumerate() {
            held += part.count;
            if held >= Self::VOXELS || i + 1 == parts.len() {
                blocks.push(start..i + 1);
                (start, held) = (i + 1, 0);
            }
        }
        let voxel_count = parts.iter().map(|part| part.count).sum();
        Self { voxels, parts, blocks, voxel_count }
    }

    /// The number of blocks.
    pub(super) fn count(&self) -> usize {
        self.blocks.len()
    }

    /// The number of voxels in all of them.
    pub(super) fn voxel_count(&self) -> u64 {
        self.voxel_count
    }

    /// Calls `visit` for every voxel of block `index`.
    pub(super) fn for_each(&self, index: usize, mut visit: impl FnMut([u32; 3])) {
        let nz = self.voxels.grid().dims()[2];
        let parts = self.blocks.get(index).and_then(|range| self.parts.get(range.clone()));
        for part in parts.unwrap_or_default() {
            self.voxels.for_each_word(&[part.x..part.x + 1, part.ys.clone(), 0..nz], |[x, y, z], mut word| {
                while word != 0 {
                    visit([x, y, z + word.trailing_zeros()]);
                    word &= word - 1;
                }
            });
        }
    }
}
