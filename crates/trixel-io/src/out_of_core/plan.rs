//! How the work is cut so that it stays within the memory: slabs of layers of pillars, one pass over a streamed mesh each.

use std::ops::Range;
use std::time::Instant;

use trixel::{BrickMap, Bytes, Grid, Job, WORD_BITS};

use super::OutOfCoreError;
use super::source::{LayerCounts, Soup, Source};
use super::zarr::ZarrWriter;
use crate::read::MeshStream;

/// What every process takes, with its threads' stacks and the allocator's slack.
const PROCESS_BYTES: u64 = 64 << 20;
/// A triangle in the pillars that it meets: at least one pair of 8 bytes, twice while pairs are sorted, and half as much
/// again for triangles that meet several.
const BYTES_PER_BINNED: u64 = 24;

/// How an out-of-core voxelization is cut, and what it takes.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Layers of pillars that are in memory together, in order: 64 voxels along x each.
    pub(super) slabs: Vec<Slab>,
    /// Whether coordinates need more than 32 bits.
    pub(super) wide: bool,
    /// Files of the result at most, in rows of shards.
    pub(super) rows: [u32; 2],
    /// Bytes that are needed at most.
    pub memory: u64,
    /// Estimated time, in seconds; rough.
    pub seconds: f64,
    /// Bytes that are read from the mesh's file in all; 0 for a mesh in memory.
    pub bytes_to_read: u64,
    tile: [u32; 3],
}

/// Layers that are in memory together.
#[derive(Clone, Debug)]
pub(super) struct Slab {
    pub(super) layers: Range<u32>,
    pub(super) triangles: u64,
}

impl Plan {
    /// Plans `job` within `limit` bytes on `threads` threads; `held` bytes are taken already. Goes through the mesh once.
    ///
    /// # Errors
    /// When the limit is too small even for the smallest tiles, the mesh cannot be read, or a vertex is not on the
    /// lattice.
    pub fn new(source: Source<'_>, job: &Job, threads: usize, held: u64, limit: u64) -> Result<Self, OutOfCoreError> {
        let grid = job.grid();
        let start = Instant::now();
        let counts = source.count_layers(grid)?;
        let pass_seconds = start.elapsed().as_secs_f64();
        let rows = ZarrWriter::rows(grid);
        let row_pillars = ZarrWriter::pillars_of_row(grid, 0).len() as u64;
        let fixed =
            PROCESS_BYTES + held + threads as u64 * (ZarrWriter::row_bytes(grid) + brick_bytes(grid, row_pillars));
        let (per_triangle, fixed, pass_bytes) = match source {
            Source::Mesh(mesh) => {
                let lattice = mesh.positions.len() as u64 * if counts.wide { 24 } else { 12 };
                (BYTES_PER_BINNED, fixed + lattice, 0)
            }
            Source::Stream(stream) => {
                let per_triangle = Soup::bytes_per_triangle(counts.wide) + BYTES_PER_BINNED;
                (per_triangle, fixed + stream.bytes_held() + MeshStream::bytes_in_flight(), stream.bytes_per_pass())
            }
        };
        let room = limit.checked_sub(fixed).ok_or(OutOfCoreError::Limit { limit, needed: fixed })?;
        let slabs = cut(&counts, grid, room / per_triangle)
            .map_err(|triangles| OutOfCoreError::Layer { triangles, bytes: fixed + triangles * per_triangle })?;
        let most = slabs.iter().map(|slab| slab.triangles).max().unwrap_or(0);
        #[expect(clippy::cast_precision_loss, reason = "an estimate")]
        let seconds = {
            // Rough: nanoseconds of one thread for a voxel of the surface and for a triangle.
            let work = 30e-9 * counts.voxels + 300e-9 * source.triangle_count() as f64;
            work / threads as f64 + if pass_bytes > 0 { pass_seconds * slabs.len() as f64 } else { 0.0 }
        };
        Ok(Self {
            wide: counts.wide,
            rows,
            memory: fixed + most * per_triangle,
            seconds,
            // One pass is behind us.
            bytes_to_read: pass_bytes * slabs.len() as u64,
            tile: tile(grid, &slabs),
            slabs,
        })
    }
}

/// Bricks of so many pillars at worst.
fn brick_bytes(grid: &Grid, pillars: u64) -> u64 {
    let bits = u64::from(WORD_BITS) * u64::from(WORD_BITS) * u64::from(grid.dims()[2]);
    // 66 bytes a brick of 64, and once more while a pillar is finished; but surfaces fill an eighth of it at the most.
    pillars * bits / 8 / 4
}

/// Voxels of the largest slab's tiles: what is written as one row.
fn tile(grid: &Grid, slabs: &[Slab]) -> [u32; 3] {
    let [nx, _, nz] = grid.dims();
    let layers = slabs.iter().map(|slab| slab.layers.len()).max().and_then(|n| u32::try_from(n).ok()).unwrap_or(1);
    let row = ZarrWriter::pillars_of_row(grid, 0);
    [(layers * WORD_BITS).min(nx), ((row.end - row.start) * WORD_BITS).min(grid.dims()[1]), nz]
}

/// Slabs of at most `most` triangles, as few as possible; the triangles of a layer that has more by itself.
fn cut(counts: &LayerCounts, grid: &Grid, most: u64) -> Result<Vec<Slab>, u64> {
    let [layers, _] = BrickMap::pillars_of(grid);
    let mut slabs = Vec::new();
    let mut start = 0;
    while start < layers {
        let mut end = start + 1;
        let mut triangles = counts.within(&(start..end));
        if triangles > most {
            return Err(triangles);
        }
        while end < layers {
            let more = counts.within(&(start..end + 1));
            if more > most {
                break;
            }
            (end, triangles) = (end + 1, more);
        }
        slabs.push(Slab { layers: start..end, triangles });
        start = end;
    }
    Ok(slabs)
}

impl std::fmt::Display for Plan {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [rows_x, rows_y] = self.rows;
        let [x, y, z] = self.tile;
        let many = |count: u64, what: &str| format!("{count} {what}{}", if count == 1 { "" } else { "s" });
        let (tiles, slabs) =
            (many(u64::from(rows_x) * u64::from(rows_y), "tile"), many(self.slabs.len() as u64, "slab"));
        write!(f, "plan: {tiles} of 64 x {y} x {z} voxels in {slabs} of at most {x} layers; ")?;
        write!(f, "at most {} of memory", Bytes(self.memory))?;
        if self.bytes_to_read > 0 {
            write!(f, "; {} to read", Bytes(self.bytes_to_read))?;
        }
        write!(f, "; about {:.0} s", self.seconds.max(1.0))
    }
}
