//! Triangles of a few voxels: row by row, eight columns of a row at a time, one a vector lane.
//!
//! For each x, the columns (x, y) that the xy projection allows get the run that the plane and the other two projections
//! leave. All numbers are integers below 2^53 in f64; the quotients are floored exactly (see [`SMALL_EXTENT`]).
//!
//! [`SMALL_EXTENT`]: super::number::SMALL_EXTENT

use fearless_simd::{Simd, f64x8, i64x8, prelude::*};

use super::kernel::VoxelBox;
use super::rule::Rule;
use super::setup::{Constraint, Setup};
use super::sink::Sink;
use crate::volume::WORD_BITS;

/// Columns judged at once.
const LANES: usize = 8;

/// A number for each column `(x, y)` of eight by eight, at `8 x + y`.
pub(super) type Tile = [i64; LANES * LANES];

/// Columns along an axis of the largest box, rounded up to whole vectors.
const MOST: usize = 64;

/// Beyond any index of a voxel, and exact.
const FAR: f64 = (1u64 << 40) as f64;

/// Buffers that one thread keeps between triangles.
pub(super) struct Scratch {
    /// The z ranges (low, high) that the two projections containing z leave, for every x and y of the clipped box.
    by_x: [[f64; MOST]; 2],
    by_y: [[f64; MOST]; 2],
    /// The ends of the runs of a tile of eight rows and eight columns.
    starts: Tile,
    ends: Tile,
}

impl Default for Scratch {
    fn default() -> Self {
        Self { by_x: [[0.0; MOST]; 2], by_y: [[0.0; MOST]; 2], starts: [0; LANES * LANES], ends: [0; LANES * LANES] }
    }
}

/// A constraint `na * a + nb * b >= t`.
#[derive(Clone, Copy)]
struct Edge {
    na: f64,
    nb: f64,
    t: f64,
}

impl Edge {
    #[inline(always)]
    #[expect(clippy::cast_precision_loss, reason = "below 2^53")]
    fn new(edge: Constraint<i64>) -> Self {
        Self { na: edge.na as f64, nb: edge.nb as f64, t: edge.t as f64 }
    }
}

#[inline(always)]
fn projection<R: Rule>(setup: &Setup<i64>, rule: &R, a: usize, b: usize) -> [Edge; 3] {
    let [e0, e1, e2] = setup.projection(rule, a, b);
    [Edge::new(e0), Edge::new(e1), Edge::new(e2)]
}

/// The index of a voxel as a float.
#[inline(always)]
#[expect(clippy::cast_precision_loss, reason = "far below 2^53")]
fn index(i: i64) -> f64 {
    i as f64
}

/// 0, 1, 2, ... from `start` on.
#[inline(always)]
fn count_from<V: Simd>(simd: V, start: f64) -> f64x8<V> {
    f64x8::from_slice(simd, &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]) + start
}

/// The range of z that the edges of a projection (a, z) leave at each a. Without branches: which edges limit z from below
/// is as good as random.
#[inline(always)]
fn z_range<V: Simd>(simd: V, edges: &[Edge; 3], a: f64x8<V>) -> (f64x8<V>, f64x8<V>) {
    let far = f64x8::splat(simd, FAR);
    let (mut low, mut high) = (-far, far);
    for edge in edges {
        // A vertical edge constrains a alone, and the box already does.
        let (at, nb) = (edge.t - a * edge.na, f64x8::splat(simd, edge.nb));
        let bound = at / nb;
        let zero = f64x8::splat(simd, 0.0);
        low = low.max(nb.simd_gt(zero).select(bound.ceil(), -far));
        high = high.min(nb.simd_lt(zero).select(bound.floor(), far));
    }
    (low, high)
}

/// Sends the runs of a triangle of at most [`SMALL_EXTENT`](super::number::SMALL_EXTENT) voxels inside `clipped`.
#[inline(always)]
pub(super) fn voxelize<V: Simd, R: Rule>(
    simd: V,
    rule: &R,
    triangle: &[[i64; 3]; 3],
    around: &VoxelBox,
    clipped: &VoxelBox,
    sink: &mut impl Sink,
    scratch: &mut Scratch,
) {
    let base = around.low;
    let setup = Setup::<i64>::new(triangle, base);
    if !R::SURFACE && setup.normal[2] == 0 {
        return;
    }
    let from_base = |p: [i64; 3]| [index(p[0] - base[0]), index(p[1] - base[1]), index(p[2] - base[2])];
    let (low, high) = (from_base(clipped.low), from_base(clipped.high));
    let xy = projection(&setup, rule, 0, 1);
    let (up, d1, d2) = setup.plane(rule);
    #[expect(clippy::cast_precision_loss, reason = "below 2^53")]
    let (n, d2, thickness) = ([up[0] as f64, up[1] as f64, up[2] as f64], d2 as f64, (d2 - d1) as f64);
    let thickness_whole = if n[2] > 0.0 { (thickness / n[2]).floor() } else { 0.0 };
    let thickness_rest = thickness - thickness_whole * n[2];

    let Scratch { by_x, by_y, starts, ends } = scratch;
    if R::SURFACE {
        fill(simd, &projection(&setup, rule, 0, 2), low[0], high[0], by_x);
        fill(simd, &projection(&setup, rule, 1, 2), low[1], high[1], by_y);
    }

    let (zero, one) = (f64x8::splat(simd, 0.0), f64x8::splat(simd, 1.0));
    let (box_low, box_high) = (f64x8::splat(simd, low[2]), f64x8::splat(simd, high[2]));
    // Runs are seen from the word in which the lowest begins.
    let start_z = clipped.low[2] & !i64::from(WORD_BITS - 1);
    let to_word = f64x8::splat(simd, index(base[2] - start_z));
    let last_z = clipped.high[2] - start_z;
    let mut y_start = low[1];
    let mut first = 0;
    while y_start <= high[1] {
        let y = count_from(simd, y_start);
        let (y_low, y_high) = if R::SURFACE {
            let low = f64x8::from_slice(simd, &by_y[0][first..first + LANES]);
            let high = f64x8::from_slice(simd, &by_y[1][first..first + LANES]);
            (low.max(box_low), high.min(box_high))
        } else {
            (box_low, box_high)
        };
        let xy_at = [y * xy[0].nb - xy[0].t, y * xy[1].nb - xy[1].t, y * xy[2].nb - xy[2].t];
        let plane_at = d2 - y * n[1];
        // Columns up to the box's end.
        let in_box = y.simd_le(f64x8::splat(simd, high[1]));
        let mut x_start = low[0];
        let mut first_row = 0;
        while x_start <= high[0] {
            // Judge up to eight rows without a branch that depends on them, then send: so the divisions of all rows
            // overlap, and the processor guesses wrong about once a tile rather than once a row.
            let mut tile = 0u64;
            let mut x = x_start;
            let mut row = 0;
            while row < LANES && x <= high[0] {
                let least = (xy_at[0] + xy[0].na * x).min(xy_at[1] + xy[1].na * x).min(xy_at[2] + xy[2].na * x);
                let mut set = in_box & least.simd_ge(zero);
                let above = plane_at - n[0] * x;
                let (mut from, mut to) = (y_low, y_high);
                if n[2] > 0.0 {
                    // With above = q N + r and thickness = w N + s, ceil((above - thickness) / N) is q - w + (r > s).
                    let top = (above / n[2]).floor();
                    let carry = (above - top * n[2]).simd_gt(f64x8::splat(simd, thickness_rest));
                    to = to.min(top);
                    from = from.max(top - thickness_whole + carry.select(one, zero));
                } else {
                    // A plane along z lets a column pass or not.
                    set = set & above.simd_ge(zero) & (above - thickness).simd_le(zero);
                }
                if R::SURFACE {
                    from = from.max(f64x8::splat(simd, by_x[0][first_row + row]));
                    to = to.min(f64x8::splat(simd, by_x[1][first_row + row]));
                }
                if R::TO_TOP {
                    to = box_high;
                }
                tile |= (set & from.simd_le(to)).to_bitmask() << (LANES * row);
                (from + to_word).to_int::<i64x8<V>>().store_slice(&mut starts[LANES * row..LANES * row + LANES]);
                (to + to_word).to_int::<i64x8<V>>().store_slice(&mut ends[LANES * row..LANES * row + LANES]);
                x += 1.0;
                row += 1;
            }
            #[expect(clippy::cast_possible_truncation, reason = "indices")]
            let (gx, gy) = (x_start as i64 + base[0], y_start as i64 + base[1]);
            sink.tile([gx, gy, start_z], tile, starts, ends, last_z);
            x_start += 8.0;
            first_row += LANES;
        }
        y_start += 8.0;
        first += LANES;
    }
}

/// The z ranges of a projection (a, z) at `low..=high`; past the end they are computed too, and not used.
#[inline(always)]
fn fill<V: Simd>(simd: V, edges: &[Edge; 3], low: f64, high: f64, ranges: &mut [[f64; MOST]; 2]) {
    let mut a = low;
    let mut first = 0;
    while a <= high {
        let (from, to) = z_range(simd, edges, count_from(simd, a));
        from.store_slice(&mut ranges[0][first..first + LANES]);
        to.store_slice(&mut ranges[1][first..first + LANES]);
        a += 8.0;
        first += LANES;
    }
}
