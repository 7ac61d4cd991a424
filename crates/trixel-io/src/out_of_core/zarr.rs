//! Zarr v3: a group with the boolean array `occupancy[x, y, z]`, in chunks of 64 x 64 x 64 voxels, many chunks a shard
//! file (Zarr Enhancement Proposals 1 and 2). Chunks and shards without a set voxel are not stored.

use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use serde_json::json;
use trixel::{BrickMap, Grid, Mode, Occupancy, WORD_BITS};
use zarrs::array::codec::ZstdCodec;
use zarrs::array::{Array, ArrayBuilder, ArrayBytes, CodecOptions, FillValue, data_type};
use zarrs::filesystem::FilesystemStore;
use zarrs::group::GroupBuilder;

/// Voxels along the edge of a chunk: those of a pillar.
const CHUNK: u32 = 64;
/// Occupancy is long runs of equal bytes: higher levels save little.
const ZSTD_LEVEL: i32 = 1;

/// What the storage library said.
type Failure = Box<dyn std::error::Error + Send + Sync>;

/// The array in a folder, written by rows of shards.
pub(super) struct ZarrWriter {
    array: Array<FilesystemStore>,
    grid: Grid,
    shard_side: u32,
}

impl ZarrWriter {
    /// Voxels of a shard along y and z; along x it is one chunk thick.
    fn shard_side(grid: &Grid) -> u32 {
        // About 16 along each axis, so that there are neither too many files nor too large ones.
        let [_, ny, nz] = grid.dims();
        (ny.max(nz) / 16).next_multiple_of(CHUNK).clamp(256, 1024)
    }

    /// Bytes that writing a row takes.
    pub(super) fn row_bytes(grid: &Grid) -> u64 {
        let side = u64::from(Self::shard_side(grid));
        // A byte a voxel, and the compressed chunks at worst as large.
        2 * u64::from(CHUNK) * side * side
    }

    /// Rows of shards along x and y.
    pub(super) fn rows(grid: &Grid) -> [u32; 2] {
        let [layers, _] = BrickMap::pillars_of(grid);
        [layers, grid.dims()[1].div_ceil(Self::shard_side(grid))]
    }

    /// The pillars along y of a row.
    pub(super) fn pillars_of_row(grid: &Grid, row: u32) -> Range<u32> {
        let [_, pillars] = BrickMap::pillars_of(grid);
        let side = Self::shard_side(grid) / CHUNK;
        row * side..((row + 1) * side).min(pillars)
    }

    /// Writes what describes the array in `folder`.
    pub(super) fn create(folder: &Path, grid: &Grid, mode: Option<Mode>) -> Result<Self, Failure> {
        let store = Arc::new(FilesystemStore::new(folder)?);
        GroupBuilder::new().build(Arc::clone(&store), "/")?.store_metadata()?;
        let shard_side = Self::shard_side(grid);
        let shard = [CHUNK, shard_side, shard_side].map(u64::from);
        let attributes = json!({
            "origin": grid.origin(),
            "voxel_size": grid.voxel_size(),
            "mode": mode.map(Mode::name),
        });
        let mut builder = ArrayBuilder::new(
            grid.dims().map(u64::from).to_vec(),
            shard.to_vec(),
            data_type::bool(),
            FillValue::from(false),
        );
        builder
            .subchunk_shape(vec![u64::from(CHUNK); 3])
            .bytes_to_bytes_codecs(vec![Arc::new(ZstdCodec::new(ZSTD_LEVEL, false))])
            .dimension_names(["x", "y", "z"].into());
        if let serde_json::Value::Object(attributes) = attributes {
            builder.attributes(attributes);
        }
        let array = builder.build(store, "/occupancy")?;
        array.store_metadata()?;
        Ok(Self { array, grid: *grid, shard_side })
    }

    /// Writes the shards of row `[x, y]`. `buffer` is kept between rows.
    pub(super) fn write_row(
        &self,
        [x, y]: [u32; 2],
        voxels: &impl Occupancy,
        buffer: &mut Vec<u8>,
    ) -> Result<(), Failure> {
        let side = self.shard_side;
        let nz = self.grid.dims()[2];
        // One thread: which chunk comes first in the file must not depend on chance.
        let options = CodecOptions::default().with_concurrent_target(1);
        buffer.resize(CHUNK as usize * side as usize * side as usize, 0);
        for z in 0..nz.div_ceil(side) {
            let low = [x * CHUNK, y * side, z * side];
            let range = [low[0]..low[0] + CHUNK, low[1]..low[1] + side, low[2]..low[2] + side];
            let mut any = false;
            voxels.for_each_word(&range, |mut at, mut word| {
                // A word may start before the range; its bits do not.
                let before = low[2].saturating_sub(at[2]);
                at[2] += before;
                word >>= before;
                if !any {
                    buffer.fill(0);
                    any = true;
                }
                let [dx, dy, dz] = [0, 1, 2].map(|axis| (at[axis] - low[axis]) as usize);
                let start = (dx * side as usize + dy) * side as usize + dz;
                if word == u64::MAX {
                    buffer[start..start + WORD_BITS as usize].fill(1);
                    return;
                }
                while word != 0 {
                    buffer[start + word.trailing_zeros() as usize] = 1;
                    word &= word - 1;
                }
            });
            let shard = [x, y, z].map(u64::from);
            if any {
                self.array.store_chunk_opt(&shard, ArrayBytes::new_flen(buffer.as_slice()), &options)?;
            } else {
                // A run that was killed may have left one.
                self.array.erase_chunk(&shard)?;
            }
        }
        Ok(())
    }
}
