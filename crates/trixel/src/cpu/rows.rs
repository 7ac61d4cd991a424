//! Triangles of a few voxels: row by row, eight columns of a row at a time, one a vector lane.
//!
//! What a triangle's tests need is found for eight triangles at a time ([`Tests`]). Then, for each x, the columns (x, y)
//! that the xy projection allows get the run that the plane and the other two projections leave; for each y, where the
//! triangle is longer along x, so that x and y in this file are the grid's y and x.
//!
//! All of it is exact in f64, which holds 53 bits. Corners are within 2^22 steps, normals thus below 2^44 and `n.v` of edges below
//! 2^45; the plane's terms are split so that they are whole numbers below 2^52, and fractions of 2^-16 below 2^18. The
//! quotients are floored exactly (see [`SMALL_EXTENT`]).
//!
//! [`SMALL_EXTENT`]: super::number::SMALL_EXTENT

use fearless_simd::{Simd, f64x8, i32x16, i64x8, mask32x16, prelude::*};

use super::crossings;
use super::kernel::NearClip;
use super::rule::VectorRule;
use super::sink::{Sink, turn};
use super::tiny::{between, cross};
use super::triangles::{self, Halves, Lanes, Queue, Vectors};
use crate::lattice::STEP_BITS;
use crate::volume::WORD_BITS;

/// Columns judged at once, and triangles whose tests are found at once.
const LANES: usize = 8;

/// A number for each column `(x, y)` of eight by eight, at `8 x + y`, or `8 y + x` where x and y are exchanged; or for each of
/// 64 columns of one row.
pub(super) type Tile = [i64; LANES * LANES];

/// Columns along an axis of the largest box, rounded up to whole vectors.
const MOST: usize = 64;

/// Beyond any index of a voxel, and exact.
const FAR: f64 = (1u64 << 40) as f64;

/// Triangles that wait for their rows, and buffers.
pub(super) struct Rows {
    waiting: Queue,
    tests: Tests,
    scratch: Scratch,
}

impl Default for Rows {
    fn default() -> Self {
        Self { waiting: Queue::EMPTY, tests: Tests::NONE, scratch: Scratch::NONE }
    }
}

impl Rows {
    /// Adds the triangles in `lanes`, of at most [`SMALL_EXTENT`](super::number::SMALL_EXTENT) voxels; `true` when
    /// [`Self::send`] must follow before the next ones.
    #[inline(always)]
    pub(super) fn push<V: Simd>(&mut self, simd: V, corners: &Vectors<V>, lanes: Lanes) -> bool {
        self.waiting.push(simd, corners, lanes)
    }

    /// Sends the runs of the waiting triangles inside the clip: of as many as fill vectors, or of all.
    #[inline(never)]
    pub(super) fn send<V: Simd, R: VectorRule>(
        &mut self,
        simd: V,
        rule: &R,
        all: bool,
        clip: &NearClip<V>,
        sink: &mut impl Sink,
    ) {
        let Self { waiting, tests, scratch } = self;
        waiting.for_each(
            simd,
            all,
            #[inline(always)]
            |corners, count| {
                let (boxes, halves) = Boxes::new::<_, R>(simd, corners, clip);
                for (half, corners) in halves.iter().enumerate() {
                    let lanes = LANES * half..count.min(LANES * (half + 1));
                    if !lanes.is_empty() {
                        tests.find(simd, rule, corners);
                    }
                    for lane in lanes {
                        send::<_, R>(simd, tests, &boxes, lane, sink, scratch);
                    }
                }
            },
        );
    }
}

struct Scratch {
    /// The z ranges (low, high) that the two projections containing z leave, for every x and y of the clipped box.
    by_x: [[f64; MOST]; 2],
    by_y: [[f64; MOST]; 2],
    /// The ends of the runs of a tile of eight rows and eight columns.
    starts: Tile,
    ends: Tile,
}

impl Scratch {
    const NONE: Self =
        Self { by_x: [[0.0; MOST]; 2], by_y: [[0.0; MOST]; 2], starts: [0; LANES * LANES], ends: [0; LANES * LANES] };
}

/// Where the triangles of a vector are. Where one is `turned`, x and y are exchanged.
struct Boxes {
    base: [i64; 3],
    /// The lowest voxel, from the base.
    low: [[i32; triangles::LANES]; 3],
    /// The part inside the clip, from the lowest voxel.
    from: [[i32; triangles::LANES]; 3],
    to: [[i32; triangles::LANES]; 3],
    turned: Lanes,
}

impl Boxes {
    /// With the corners, in steps from the low corners of the boxes.
    #[inline(always)]
    fn new<V: Simd, R: VectorRule>(simd: V, corners: &Vectors<V>, clip: &NearClip<V>) -> (Self, Halves<V>) {
        let [mut low, high] = corners.boxes();
        let (mut from, mut to) = if R::SURFACE {
            (
                [low[0].max(clip.low[0]), low[1].max(clip.low[1]), low[2].max(clip.low[2])],
                [high[0].min(clip.high[0]), high[1].min(clip.high[1]), high[2].min(clip.high[2])],
            )
        } else {
            let [[x, x_last], [y, y_last]] = crossings::columns(corners, clip);
            ([x, y, clip.low[2]], [x_last, y_last, clip.high[2]])
        };
        let mut corners = *corners;
        let mut turned = 0;
        // Centres on edges are told by x before y, which turning would change.
        if R::SURFACE {
            // Rows across the shorter side, so that there are few and they fill the lanes.
            let across = (to[0] - from[0]).simd_gt(to[1] - from[1]);
            turned = across.to_bitmask();
            let [v0, v1, v2] = corners.0;
            corners = Vectors([exchange(across, v0), exchange(across, v1), exchange(across, v2)]);
            (low, from, to) = (exchange(across, low), exchange(across, from), exchange(across, to));
        }
        let halves = corners.halves(simd, [low[0] << STEP_BITS, low[1] << STEP_BITS, low[2] << STEP_BITS], 1.0);
        let boxes = Self {
            base: clip.base,
            low: [*low[0], *low[1], *low[2]],
            from: [*(from[0] - low[0]), *(from[1] - low[1]), *(from[2] - low[2])],
            to: [*(to[0] - low[0]), *(to[1] - low[1]), *(to[2] - low[2])],
            turned,
        };
        (boxes, halves)
    }
}

/// Exchanges x and y.
#[inline(always)]
pub(super) fn exchange<V: Simd>(across: mask32x16<V>, [x, y, z]: [i32x16<V>; 3]) -> [i32x16<V>; 3] {
    [across.select(y, x), across.select(x, y), z]
}

/// What the tests of eight triangles start from, number by number, in voxels from the low corners of their boxes.
struct Tests {
    /// Of the projections to xy, xz and yz, the edges' na, nb and t: `na a + nb b >= t`.
    edges: [[[[f64; LANES]; 3]; 3]; 3],
    /// The normal, turned upwards.
    n: [[f64; LANES]; 3],
    /// The plane's upper bound, and how far its lower one is below: in all, and as a multiple of the normal's z and a rest.
    d2: [f64; LANES],
    thickness: [f64; LANES],
    thickness_whole: [f64; LANES],
    thickness_rest: [f64; LANES],
}

/// The axes of a projection, and the one along which it looks.
const PROJECTIONS: [[usize; 3]; 3] = [[0, 1, 2], [0, 2, 1], [1, 2, 0]];

impl Tests {
    const NONE: Self = {
        const ZEROS: [f64; LANES] = [0.0; LANES];
        Self {
            edges: [[[ZEROS; 3]; 3]; 3],
            n: [ZEROS; 3],
            d2: ZEROS,
            thickness: ZEROS,
            thickness_whole: ZEROS,
            thickness_rest: ZEROS,
        }
    };

    /// For corners in steps.
    #[inline(always)]
    fn find<V: Simd, R: VectorRule>(&mut self, simd: V, rule: &R, v: &[[f64x8<V>; 3]; 3]) {
        let one = f64x8::splat(simd, 1.0);
        let e = [between(v[0], v[1]), between(v[1], v[2]), between(v[2], v[0])];
        let n = [cross(&e, 1, 2), cross(&e, 2, 0), cross(&e, 0, 1)];
        for (tests, [a, b, c]) in self.edges.iter_mut().zip(PROJECTIONS) {
            // Inward normals point left where the projection turns left.
            let in_order = if b == (a + 1) % 3 { one } else { -one };
            let side = in_order.copysign(n[c]) * in_order;
            for k in 0..3 {
                let (na, nb) = (-e[k][b] * side, e[k][a] * side);
                let t = rule.edges(simd, na, nb, na * v[k][a] + nb * v[k][b]);
                na.store_slice(&mut tests[k][0]);
                nb.store_slice(&mut tests[k][1]);
                t.store_slice(&mut tests[k][2]);
            }
        }
        let up = one.copysign(n[2]);
        let n = [n[0] * up, n[1] * up, n[2] * up];
        let (d1, d2) = rule.planes(simd, n, v[0]);
        let thickness = d2 - d1;
        // Where the plane is along z, neither is used.
        let whole = (thickness / n[2]).floor();
        for i in 0..3 {
            n[i].store_slice(&mut self.n[i]);
        }
        d2.store_slice(&mut self.d2);
        thickness.store_slice(&mut self.thickness);
        whole.store_slice(&mut self.thickness_whole);
        (thickness - whole * n[2]).store_slice(&mut self.thickness_rest);
    }

    /// The edges of a triangle in a projection.
    #[inline(always)]
    fn edges(&self, projection: usize, lane: usize) -> [Edge; 3] {
        let edge = |k: usize| {
            let [na, nb, t] = &self.edges[projection][k];
            Edge { na: na[lane], nb: nb[lane], t: t[lane] }
        };
        [edge(0), edge(1), edge(2)]
    }
}

/// A constraint `na * a + nb * b >= t`.
#[derive(Clone, Copy)]
struct Edge {
    na: f64,
    nb: f64,
    t: f64,
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

/// Sends the runs of the triangle of a lane inside its box.
#[inline(always)]
fn send<V: Simd, R: VectorRule>(
    simd: V,
    tests: &Tests,
    boxes: &Boxes,
    lane: usize,
    sink: &mut impl Sink,
    scratch: &mut Scratch,
) {
    let number = |of: &[[i32; triangles::LANES]; 3], i: usize| of[i][lane % triangles::LANES];
    let from = [number(&boxes.from, 0), number(&boxes.from, 1), number(&boxes.from, 2)];
    let to = [number(&boxes.to, 0), number(&boxes.to, 1), number(&boxes.to, 2)];
    let (low, high) = (from.map(f64::from), to.map(f64::from));
    let turned = boxes.turned >> lane & 1 != 0;
    let [x, y] = turn(turned, [boxes.base[0], boxes.base[1]]);
    let at = |i: usize, base: i64| base + i64::from(number(&boxes.low, i));
    let base = [at(0, x), at(1, y), at(2, boxes.base[2])];
    let lane = lane % LANES;
    let n = [tests.n[0][lane], tests.n[1][lane], tests.n[2][lane]];
    if !R::SURFACE && n[2] == 0.0 {
        return;
    }
    let (d2, thickness) = (tests.d2[lane], tests.thickness[lane]);
    let (thickness_whole, thickness_rest) = (tests.thickness_whole[lane], tests.thickness_rest[lane]);
    let xy = tests.edges(0, lane);

    let Scratch { by_x, by_y, starts, ends } = scratch;
    if R::SURFACE {
        fill(simd, &tests.edges(1, lane), low[0], high[0], by_x);
        fill(simd, &tests.edges(2, lane), low[1], high[1], by_y);
    }

    let (zero, one) = (f64x8::splat(simd, 0.0), f64x8::splat(simd, 1.0));
    let (box_low, box_high) = (f64x8::splat(simd, low[2]), f64x8::splat(simd, high[2]));
    // Runs are seen from the word in which the lowest begins.
    let start_z = (base[2] + i64::from(from[2])) & !i64::from(WORD_BITS - 1);
    #[expect(clippy::cast_precision_loss, reason = "within a grid")]
    let to_word = f64x8::splat(simd, (base[2] - start_z) as f64);
    let last_z = base[2] + i64::from(to[2]) - start_z;
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
            let [x, y] = turn(turned, [x_start as i64 + base[0], y_start as i64 + base[1]]);
            sink.tile([x, y, start_z], turned, tile, starts, ends, last_z);
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
