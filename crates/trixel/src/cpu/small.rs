//! Small triangles: boxes of a few voxels, judged 4 x 4 x 4 voxels at a time with bit masks instead of divisions.
//!
//! Each projection of a tile is 16 bits, a voxel set 64. The loops over fixed arrays are meant to become vector
//! instructions.

use super::column_runs::VoxelBox;
use super::rule::Rule;
use super::setup::{Constraint, Setup};
use super::sink::Sink;

/// The largest box, in voxels beyond the first along an axis, that is judged by tiles. Measured: see the benchmark.
pub(super) const TILED_EXTENT: i64 = 7;

/// Voxels along the edge of a tile.
const TILE: i64 = 4;

/// An edge `na * a + nb * b >= t` in 32 bits: with boxes of 8 voxels all terms stay below 2^24.
#[derive(Clone, Copy, Default)]
struct Edge {
    na: i32,
    nb: i32,
    t: i32,
}

impl Edge {
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "small triangles: below 2^24")]
    fn new(edge: Constraint<i64>) -> Self {
        Self { na: edge.na as i32, nb: edge.nb as i32, t: edge.t as i32 }
    }

    /// The same edge seen from a tile that starts at (a, b).
    #[inline(always)]
    fn at(self, a: i32, b: i32) -> Self {
        Self { t: self.t - self.na * a - self.nb * b, ..self }
    }
}

/// The voxels (a, b) of a tile, bit `4 a + b`, that satisfy all three edges.
#[inline(always)]
fn tile_mask(edges: &[Edge; 3], a: i32, b: i32) -> u64 {
    // Negative where some edge fails.
    let mut outside = [[0i32; 4]; 4];
    for edge in edges {
        let Edge { na, nb, t } = edge.at(a, b);
        let mut row = [-t, nb - t, 2 * nb - t, 3 * nb - t];
        for outside_row in &mut outside {
            for c in 0..4 {
                outside_row[c] |= row[c];
                row[c] += na;
            }
        }
    }
    let mut failed = [0i32; 4];
    for (r, row) in outside.iter().enumerate() {
        for c in 0..4 {
            failed[c] |= (row[c] >> 31) & (1 << (4 * r + c));
        }
    }
    let failed = failed[0] | failed[1] | failed[2] | failed[3];
    u64::from(failed.cast_unsigned() ^ 0xFFFF)
}

/// Bit `4 x + y` to the four bits `16 x + 4 y + z`.
#[inline(always)]
fn spread_xy(mask: u64) -> u64 {
    let mask = (mask | mask << 24) & 0x0000_00FF_0000_00FF;
    let mask = (mask | mask << 12) & 0x000F_000F_000F_000F;
    let mask = (mask | mask << 6) & 0x0303_0303_0303_0303;
    let mask = (mask | mask << 3) & 0x1111_1111_1111_1111;
    mask * 0xF
}

/// Bit `4 x + z` to the four bits `16 x + 4 y + z`.
#[inline(always)]
fn spread_xz(mask: u64) -> u64 {
    let mask = (mask | mask << 24) & 0x0000_00FF_0000_00FF;
    let mask = (mask | mask << 12) & 0x000F_000F_000F_000F;
    mask * 0x1111
}

/// Bit `4 y + z` to the four bits `16 x + 4 y + z`.
#[inline(always)]
fn spread_yz(mask: u64) -> u64 {
    mask * 0x0001_0001_0001_0001
}

/// Bits `low..=high` of four; none when the range misses them.
#[inline(always)]
fn range_mask(low: i64, high: i64) -> u64 {
    let (low, high) = (low.max(0), high.min(TILE - 1));
    if low > high { 0 } else { (2u64 << high) - (1 << low) }
}

/// The voxels of a tile within a box, both local to the tile; the box may reach beyond it.
#[inline(always)]
fn box_mask(low: [i64; 3], high: [i64; 3]) -> u64 {
    let [x, y, z] = [range_mask(low[0], high[0]), range_mask(low[1], high[1]), range_mask(low[2], high[2])];
    // Bits apart by 16, 4 and 1, each to a full group.
    let x = ((x | x << 15 | x << 30 | x << 45) & 0x0001_0001_0001_0001) * 0xFFFF;
    let y = ((y | y << 3 | y << 6 | y << 9) & 0x1111) * 0xF;
    x & spread_yz(y) & (z * 0x1111_1111_1111_1111)
}

/// Sends the voxels of a small surface triangle inside `clipped` to the sink.
#[inline(always)]
pub(super) fn surface<R: Rule>(
    rule: &R,
    triangle: &[[i64; 3]; 3],
    around: &VoxelBox,
    clipped: &VoxelBox,
    sink: &mut impl Sink,
) {
    let base = around.low;
    let setup = Setup::<i64>::new(triangle, base);
    let edges = |a, b| {
        let [e0, e1, e2] = setup.projection(rule, a, b);
        [Edge::new(e0), Edge::new(e1), Edge::new(e2)]
    };
    let (xy, xz, yz) = (edges(0, 1), edges(0, 2), edges(1, 2));
    let (n, d1, d2) = setup.plane(rule);

    let from_base = |p: [i64; 3]| [p[0] - base[0], p[1] - base[1], p[2] - base[2]];
    let (low, high) = (from_base(clipped.low), from_base(clipped.high));
    let mut tx = 0;
    while tx <= high[0] {
        let mut ty = 0;
        while ty <= high[1] {
            #[expect(clippy::cast_possible_truncation, reason = "at most TILED_EXTENT")]
            let (ax, ay) = (tx as i32, ty as i32);
            let xy_mask = tile_mask(&xy, ax, ay);
            let mut tz = 0;
            while xy_mask != 0 && tz <= high[2] {
                #[expect(clippy::cast_possible_truncation, reason = "at most TILED_EXTENT")]
                let az = tz as i32;
                let inside =
                    box_mask([low[0] - tx, low[1] - ty, low[2] - tz], [high[0] - tx, high[1] - ty, high[2] - tz]);
                let mut rest =
                    inside & spread_xy(xy_mask) & spread_xz(tile_mask(&xz, ax, az)) & spread_yz(tile_mask(&yz, ay, az));
                // The plane, one column of four voxels at a time.
                while rest != 0 {
                    let column = rest.trailing_zeros() / 4;
                    let (x, y) = (tx + i64::from(column / 4), ty + i64::from(column % 4));
                    let candidates = rest >> (4 * column) & 0xF;
                    rest &= !(0xF << (4 * column));
                    let mut at = n[0] * x + n[1] * y + n[2] * tz;
                    let mut failed = 0u64;
                    for z in 0..4 {
                        failed |= (((at - d1) | (d2 - at)).cast_unsigned() >> 63) << z;
                        at += n[2];
                    }
                    let bits = candidates & !failed;
                    if bits != 0 {
                        sink.four(x + base[0], y + base[1], tz + base[2], bits);
                    }
                }
                tz += TILE;
            }
            ty += TILE;
        }
        tx += TILE;
    }
}
