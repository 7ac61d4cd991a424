//! `tiled`, after J. Pantaleoni, *VoxelPipe: A Programmable Pipeline for 3D Voxelization*, 2011: pairs of tile and triangle,
//! sorted by tile, and a workgroup for each tile.
//!
//! How many pairs there are is known only on the GPU, but nothing here waits for it: [`crate::tiles::TileCounts`] bounds it,
//! and the pairs are sorted and voxelized in as many rounds as that takes.

use super::sums::WordSets;
use super::{Recorder, Setting, bind, run, run_indirect};
use crate::error::GpuError;
use crate::layout::Unit;
use crate::limits::{MAX_PAIRS, TILE_ROUND};
use crate::scratch::digit_counts;
use crate::shader::Stage;
use crate::volume::Slab;

/// Bits of a digit of the sort: `radix_sort.wgsl`.
const DIGIT_BITS: u32 = 4;
/// Pairs for which there is room beside eight a triangle, where the triangles' sizes are not known.
const UNKNOWN_PAIRS: u64 = 1 << 20;

/// Tiles that a slab meets.
fn tiles_of(slab: &Slab, [_, ny, nz]: [u32; 3], [x, y, z]: [u32; 3]) -> u64 {
    let along = |shift: u32, first: u32, voxels: u32| u64::from(((first + voxels - 1) >> shift) - (first >> shift) + 1);
    along(x, slab.x(), slab.nx()) * along(y, 0, ny) * along(z, 0, nz)
}

impl Recorder<'_> {
    pub(super) fn tiled(&mut self, slab: &Slab, unit: &Unit<'_>) -> Result<(), GpuError> {
        let Setting { gpu, job, variant, appending, .. } = self.setting;
        // One number is that of no tile. A grid of more can only be a list's, without voxels of its own.
        let Some(tiles) = u32::try_from(tiles_of(slab, job.grid().dims(), variant.sink.tile()))
            .ok()
            .filter(|tiles| *tiles < u32::MAX)
        else {
            return self.triangle_parallel(unit);
        };
        let triangles = unit.chunk.triangles;
        let overlap = job.overlap_steps().div_ceil(1 << trixel::lattice::STEP_BITS);
        let known = match appending.pairs {
            Some(counted) => counted.get(unit.index).map(|pairs| u64::from(*pairs)),
            None => unit.chunk.tiles.as_ref().map(|counts| counts.most(u64::from(tiles), overlap)),
        };
        let most = known.unwrap_or(8 * u64::from(triangles) + UNKNOWN_PAIRS);
        let most = u32::try_from(most).unwrap_or(u32::MAX).clamp(1, MAX_PAIRS);
        if known.is_none() {
            self.setting.scratch.limit_pairs(most);
        }
        let binding_pairs = u32::try_from(gpu.limits().binding_bytes / 8).unwrap_or(u32::MAX);
        let capacity = most.min(TILE_ROUND).min(binding_pairs);

        self.count_tiles(unit)?;
        for first in (0..most).step_by(capacity as usize) {
            self.tile_round(unit, [first, capacity.min(most - first)], tiles)?;
        }
        Ok(())
    }

    /// The pairs of each triangle, summed up.
    pub(super) fn count_tiles(&mut self, unit: &Unit<'_>) -> Result<(), GpuError> {
        let gpu = self.setting.gpu;
        let triangles = unit.chunk.triangles;
        let scan = self.setting.scratch.scan(gpu, self.capacity)?;
        let sums = self.prefix_sums(&scan, triangles)?;
        let counted = bind(gpu, &gpu.pipelines().layouts().columns, &[scan.counted().as_entire_binding()]);
        let count = self.pipeline(Stage::CountTiles);
        let groups = self.groups(triangles);
        let mut pass = self.pass("count tiles");
        run(&mut pass, &count, &unit.bind_group, Some(unit.parameters), Some(&counted), groups);
        sums.record(&mut pass);
        drop(pass);
        let total = self.status.total_offset(unit.index);
        self.encoder.copy_buffer_to_buffer(&scan.total, 0, &self.status.buffer, total, 4);
        Ok(())
    }

    /// Sorts and voxelizes so many pairs from the first on, the prefix sums of all being in place.
    fn tile_round(&mut self, unit: &Unit<'_>, [first, length]: [u32; 2], tiles: u32) -> Result<(), GpuError> {
        let gpu = self.setting.gpu;
        let layouts = gpu.pipelines().layouts();
        let whole = wgpu::Buffer::as_entire_binding;
        let scan = self.setting.scratch.scan(gpu, self.capacity)?;
        let share = self.setting.variant.sink.tile_share();
        let buffers = self.setting.scratch.tiles(gpu, length, tiles, share)?;
        let round = bytemuck::cast_slice(&[first, length, tiles]).to_vec();
        let round = gpu.buffer_with("trixel round", &round, wgpu::BufferUsages::STORAGE)?;

        let paired = [&scan.levels[0], &scan.total, &round, &buffers.pairs[0]].map(whole);
        let paired = bind(gpu, &layouts.pair_tiles, &paired);
        let blocks = length.div_ceil(64);
        let key_bits = u32::BITS - tiles.leading_zeros();
        let digits: Vec<_> =
            (0..key_bits).step_by(DIGIT_BITS as usize).map(|shift| [length, blocks, shift, 0, 0]).collect();
        let words = WordSets::new(gpu, &digits)?;
        let [from, to] = [[0, 1], [1, 0]].map(|[from, to]: [usize; 2]| {
            let [from, to] = [from, to].map(|i| whole(&buffers.pairs[i]));
            bind(gpu, &layouts.sort, &[words.binding(), from, whole(&buffers.digits.levels[0]), to])
        });
        let sums = self.prefix_sums(&buffers.digits, digit_counts(length))?;
        let sorted = &buffers.pairs[digits.len() % 2];
        let found = bind(gpu, &layouts.find_tiles, &[&round, sorted, &buffers.shares].map(whole));
        let arguments = self.arguments_group(&buffers.shares, &buffers.arguments);
        let read = bind(gpu, &layouts.list_read, &[sorted, &buffers.shares].map(whole));
        let [pair, count_digits, move_entries, find, write_arguments, main] = [
            Stage::PairTiles,
            Stage::CountDigits,
            Stage::MoveEntries,
            Stage::FindTiles,
            Stage::Arguments { vertices: 0 },
            Stage::Tiled,
        ]
        .map(|stage| self.pipeline(stage));
        let (each, each_block) = (self.groups(length), self.groups(blocks));

        self.encoder.clear_buffer(&buffers.shares, 0, Some(8));
        let mut pass = self.pass("pair and sort");
        run(&mut pass, &pair, &unit.bind_group, Some(unit.parameters), Some(&paired), each);
        for ((digit, _), group) in (0..).zip(&digits).zip([&from, &to].into_iter().cycle()) {
            run(&mut pass, &count_digits, group, Some(words.offset(digit)), None, each_block);
            sums.record(&mut pass);
            run(&mut pass, &move_entries, group, Some(words.offset(digit)), None, each_block);
        }
        run(&mut pass, &find, &found, None, None, each);
        run(&mut pass, &write_arguments, &arguments, None, None, [1, 1]);
        drop(pass);
        let mut pass = self.pass("tiled");
        run_indirect(&mut pass, &main, &unit.bind_group, unit.parameters, &read, &buffers.arguments);
        Ok(())
    }
}
