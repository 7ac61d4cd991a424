//! Triangles whose box is at most four voxels along each axis: sixteen at a time, one a vector lane.
//!
//! First in f32 ([`filter`]). Where rounding may have decided a test, all are repeated in f64, in two halves of eight
//! lanes. That is exact, as everything is integers below 2^53: corners are below 2^18 steps from the box's corner, edge
//! functions below 2^38, normals below 2^36, and the plane's terms below 2^53 ([`SurfaceRule::plane_bounds`]).

use fearless_simd::{Simd, f32x16, f64x8, i32x16, i64x8, mask32x16, prelude::*};

use super::filter::{self, Cube, Filtered, Voxels};
use super::kernel::NearClip;
use super::rule::SurfaceRule;
use super::sink::{CubeSink, Places};
use super::triangles::{LANES, Queue, Vectors};
use crate::lattice::{STEP_BITS, STEPS_PER_VOXEL};

/// Lanes of a vector of f64.
const HALF: usize = LANES / 2;

/// S, the lattice steps of a voxel.
const S: f64 = STEPS_PER_VOXEL as f64;

/// The scale of half voxels.
const PER_HALF: f32 = 2.0 / STEPS_PER_VOXEL as f32;

/// The boxes of the triangles in all lanes.
struct Boxes<V: Simd> {
    low: [i32x16<V>; 3],
    /// The highest voxel, from the lowest.
    extent: [i32x16<V>; 3],
    /// The longest side, in steps.
    longest: i32x16<V>,
}

impl<V: Simd> Boxes<V> {
    #[inline(always)]
    fn new(simd: V, corners: &Vectors<V>) -> Self {
        let zero = i32x16::splat(simd, 0);
        let (mut low, mut extent, mut longest) = ([zero; 3], [zero; 3], zero);
        for i in 0..3 {
            let (least, most) = (corners.least(i), corners.most(i));
            low[i] = (least - 1) >> STEP_BITS;
            extent[i] = (most >> STEP_BITS) - low[i];
            longest = longest.max(most - least);
        }
        Self { low, extent, longest }
    }

    #[inline(always)]
    fn places(&self, clip: &NearClip<V>, sink: &impl CubeSink) -> Places {
        let mut low = [[0; LANES]; 3];
        for i in 0..3 {
            self.low[i].store_slice(&mut low[i]);
        }
        sink.places(&low, clip.base)
    }

    /// Drops the voxels of cubes of `SIDE` that are outside the boxes or the clip.
    #[inline(always)]
    fn keep<const SIDE: usize>(&self, simd: V, clip: &NearClip<V>, voxels: &mut Voxels<V>) {
        for axis in 0..3 {
            let mut kept = [i32x16::splat(simd, 0); 2];
            let from = clip.low[axis] - self.low[axis];
            let to = (clip.high[axis] - self.low[axis]).min(self.extent[axis]);
            for (i, bits) in (0..).zip(&Cube::<SIDE>::LAYERS[axis][..SIDE]) {
                let inside = from.simd_le(i) & to.simd_ge(i);
                for word in 0..Cube::<SIDE>::WORDS {
                    kept[word] = inside.select(kept[word] | bits[word], kept[word]);
                }
            }
            for word in 0..Cube::<SIDE>::WORDS {
                voxels[word] &= kept[word];
            }
        }
    }
}

/// Sends the boxes of the lanes in `mask`, which are a voxel or a row of two.
#[inline(always)]
pub(super) fn send_boxes<V: Simd>(
    low: &[i32x16<V>; 3],
    extent: &[i32x16<V>; 3],
    mask: u64,
    clip: &NearClip<V>,
    sink: &mut impl CubeSink,
) {
    const SIDE: usize = 2;
    let mut corners = [[0; LANES]; 3];
    for i in 0..3 {
        low[i].store_slice(&mut corners[i]);
    }
    let places = sink.places(&corners, clip.base);
    let mut bits = [0; LANES];
    // The other end of the row is the cube's voxel 4, 2 or 1.
    (extent[0] << 4 | extent[1] << 2 | extent[2] << 1 | 1).store_slice(&mut bits);
    let mut left = mask;
    while left != 0 {
        let lane = left.trailing_zeros() as usize % LANES;
        sink.cube::<SIDE>(&places, lane, u64::from(bits[lane].cast_unsigned()));
        left &= left - 1;
    }
}

/// Sends the voxels of the waiting triangles, whose boxes have at most `SIDE` voxels along each axis: of as many as fill
/// vectors, or of all.
#[inline(always)]
pub(super) fn flush<V: Simd, R: SurfaceRule, const SIDE: usize>(
    simd: V,
    rule: &R,
    waiting: &mut Queue,
    all: bool,
    clip: &NearClip<V>,
    sink: &mut impl CubeSink,
) {
    let mut first = 0;
    loop {
        let count = waiting.lanes(first, all);
        if count == 0 {
            break;
        }
        cubes::<_, _, SIDE>(simd, rule, waiting, first, count, clip, sink);
        first += LANES;
    }
    waiting.keep(simd, first);
}

/// [`flush`] of `count` of the lanes from `first` on.
#[inline(always)]
fn cubes<V: Simd, R: SurfaceRule, const SIDE: usize>(
    simd: V,
    rule: &R,
    waiting: &Queue,
    first: usize,
    count: usize,
    clip: &NearClip<V>,
    sink: &mut impl CubeSink,
) {
    let corners = waiting.vectors(simd, first);
    let boxes = Boxes::new(simd, &corners);
    let places = boxes.places(clip, sink);
    let middle = half_voxels(&boxes.low, SIDE);
    let longest = boxes.longest.to_float::<f32x16<V>>() * PER_HALF;
    let Filtered { mut voxels, doubtful } =
        filter::cubes::<_, _, SIDE>(simd, rule, &corners.floats(middle, PER_HALF), longest);
    if doubtful & used(count) != 0 {
        voxels = exact_cubes::<_, _, SIDE>(simd, rule, waiting, first);
    }
    boxes.keep::<SIDE>(simd, clip, &mut voxels);
    send::<_, SIDE>(&voxels, count, &places, sink);
}

/// [`flush`] for boxes of one voxel along some axis: strictly inside their layer, triangles meet a voxel where their
/// projections meet.
#[inline(always)]
pub(super) fn flush_flats<V: Simd, R: SurfaceRule, const SIDE: usize>(
    simd: V,
    rule: &R,
    waiting: &mut Queue,
    all: bool,
    clip: &NearClip<V>,
    sink: &mut impl CubeSink,
) {
    let mut first = 0;
    loop {
        let count = waiting.lanes(first, all);
        if count == 0 {
            break;
        }
        flats::<_, _, SIDE>(simd, rule, waiting, first, count, clip, sink);
        first += LANES;
    }
    waiting.keep(simd, first);
}

/// [`flush_flats`] of `count` of the lanes from `first` on.
#[inline(always)]
fn flats<V: Simd, R: SurfaceRule, const SIDE: usize>(
    simd: V,
    rule: &R,
    waiting: &Queue,
    first: usize,
    count: usize,
    clip: &NearClip<V>,
    sink: &mut impl CubeSink,
) {
    let corners = waiting.vectors(simd, first);
    let boxes = Boxes::new(simd, &corners);
    let places = boxes.places(clip, sink);
    // The axes (a, b) of the layer, ascending; of a row of voxels, one of its two layers.
    let along_x = boxes.extent[0].simd_le(0);
    let along_z = boxes.extent[2].simd_le(0) & !along_x;
    let middle = half_voxels(&boxes.low, SIDE);
    let mut flattened = corners;
    for p in &mut flattened.0 {
        for i in 0..3 {
            p[i] -= middle[i];
        }
        *p = [along_x.select(p[1], p[0]), along_z.select(p[1], p[2]), p[0]];
    }
    let v = flattened.floats([i32x16::splat(simd, 0); 3], PER_HALF);
    let layer = [[v[0][0], v[0][1]], [v[1][0], v[1][1]], [v[2][0], v[2][1]]];
    let longest = boxes.longest.to_float::<f32x16<V>>() * PER_HALF;
    let Filtered { mut voxels, doubtful } = filter::layers::<_, _, SIDE>(simd, rule, &layer, longest);
    if doubtful & used(count) != 0 {
        voxels = exact_cubes::<_, _, SIDE>(simd, rule, waiting, first);
    } else if SIDE == 2 {
        voxels[0] = spread_two(voxels[0], along_x, along_z);
    } else {
        let mut cells = [0; LANES];
        voxels[0].store_slice(&mut cells);
        let (along_x, along_z) = (along_x.to_bitmask(), along_z.to_bitmask());
        let mut words = [[0; LANES]; 2];
        for lane in 0..LANES {
            let cube = spread_four(cells[lane], along_x >> lane & 1 != 0, along_z >> lane & 1 != 0);
            #[expect(clippy::cast_possible_truncation, reason = "the halves")]
            {
                words[0][lane] = cube as i32;
                words[1][lane] = (cube >> 32) as i32;
            }
        }
        voxels = [i32x16::from_slice(simd, &words[0]), i32x16::from_slice(simd, &words[1])];
    }
    boxes.keep::<SIDE>(simd, clip, &mut voxels);
    send::<_, SIDE>(&voxels, count, &places, sink);
}

/// The lattice points at the middle of cubes of `side` voxels.
#[inline(always)]
fn half_voxels<V: Simd>(low: &[i32x16<V>; 3], side: usize) -> [i32x16<V>; 3] {
    #[expect(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "at most 4")]
    let half = side as i32 * (STEPS_PER_VOXEL / 2) as i32;
    [(low[0] << STEP_BITS) + half, (low[1] << STEP_BITS) + half, (low[2] << STEP_BITS) + half]
}

/// The first `count` lanes.
#[inline(always)]
fn used(count: usize) -> u64 {
    (1 << count) - 1
}

/// Bit `2 a + b` of a layer of 2 x 2 voxels to the bit of its voxel in a cube: a layer across x if `along_x`, across z if
/// `along_z`, or else across y.
#[inline(always)]
fn spread_two<V: Simd>(cells: i32x16<V>, along_x: mask32x16<V>, along_z: mask32x16<V>) -> i32x16<V> {
    // Each row's two bits to every fourth, each bit to every other.
    let rows = (cells | cells << 2) & 0b0011_0011;
    let bits = (rows | rows << 1) & 0b0101_0101;
    along_x.select(cells, along_z.select(bits, rows))
}

/// [`spread_two`] for a layer of 4 x 4.
#[inline(always)]
fn spread_four(cells: i32, along_x: bool, along_z: bool) -> u64 {
    // Each row's four bits to every 16th, each bit to every fourth.
    let row = u64::from(cells.cast_unsigned());
    let rows = (row | row << 24) & 0x0000_00ff_0000_00ff;
    let rows = (rows | rows << 12) & 0x000f_000f_000f_000f;
    let bits = (rows | rows << 6) & 0x0303_0303_0303_0303;
    let bits = (bits | bits << 3) & 0x1111_1111_1111_1111;
    if along_x {
        row
    } else if along_z {
        bits
    } else {
        rows
    }
}

/// Sends the voxels of the first `count` lanes.
#[inline(always)]
fn send<V: Simd, const SIDE: usize>(voxels: &Voxels<V>, count: usize, places: &Places, sink: &mut impl CubeSink) {
    let mut bits = [[0; LANES]; 2];
    for word in 0..Cube::<SIDE>::WORDS {
        voxels[word].store_slice(&mut bits[word]);
    }
    for lane in 0..count.min(LANES) {
        let [low, high] = [bits[0][lane], bits[1][lane]].map(|word| u64::from(word.cast_unsigned()));
        sink.cube::<SIDE>(places, lane, low | high << 32);
    }
}

/// The voxels of cubes of `SIDE`, without rounding.
#[inline(never)]
fn exact_cubes<V: Simd, R: SurfaceRule, const SIDE: usize>(
    simd: V,
    rule: &R,
    waiting: &Queue,
    first: usize,
) -> Voxels<V> {
    simd.vectorize(
        #[inline(always)]
        || {
            let corners = waiting.vectors(simd, first);
            let boxes = Boxes::new(simd, &corners);
            let low = [boxes.low[0] << STEP_BITS, boxes.low[1] << STEP_BITS, boxes.low[2] << STEP_BITS];
            let halves = corners.halves(simd, low, 1.0);
            let mut words = [[0; LANES]; 2];
            for half in 0..2 {
                let mut lanes = [0; HALF];
                exact::<_, _, SIDE>(simd, rule, &halves[half]).store_slice(&mut lanes);
                for (lane, voxels) in lanes.into_iter().enumerate() {
                    #[expect(clippy::cast_possible_truncation, reason = "the halves")]
                    {
                        words[0][HALF * half + lane] = voxels as i32;
                        words[1][HALF * half + lane] = (voxels >> 32) as i32;
                    }
                }
            }
            [i32x16::from_slice(simd, &words[0]), i32x16::from_slice(simd, &words[1])]
        },
    )
}

/// [`exact_cubes`] of half the lanes, for corners in steps from the low corner.
#[inline(always)]
fn exact<V: Simd, R: SurfaceRule, const SIDE: usize>(simd: V, rule: &R, v: &[[f64x8<V>; 3]; 3]) -> i64x8<V> {
    let e = [between(v[0], v[1]), between(v[1], v[2]), between(v[2], v[0])];
    let n = [cross(&e, 1, 2), cross(&e, 2, 0), cross(&e, 0, 1)];
    let zero = f64x8::splat(simd, 0.0);
    let mut voxels = i64x8::splat(simd, 0);

    // The plane: d1 <= N . p <= d2.
    let (d1, d2) = rule.plane_bounds(simd, n, v[0]);
    let mut at_x = zero;
    for x in 0..SIDE {
        let mut at_y = at_x;
        for y in 0..SIDE {
            let mut at = at_y;
            for z in 0..SIDE {
                let passing = (at - d1).min(d2 - at).simd_ge(zero);
                voxels = passing.select(voxels | 1i64 << ((SIDE * x + y) * SIDE + z), voxels);
                at += n[2];
            }
            at_y += n[1];
        }
        at_x += n[0];
    }
    for i in 0..3 {
        voxels &= projected::<_, _, SIDE>(simd, rule, v, &e, n[i], i);
    }
    voxels
}

/// The voxels of which the projection along an axis meets the triangle's.
#[inline(always)]
fn projected<V: Simd, R: SurfaceRule, const SIDE: usize>(
    simd: V,
    rule: &R,
    v: &[[f64x8<V>; 3]; 3],
    e: &[[f64x8<V>; 3]; 3],
    area: f64x8<V>,
    axis: usize,
) -> i64x8<V> {
    let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
    let zero = f64x8::splat(simd, 0.0);
    let side = f64x8::splat(simd, 1.0).copysign(area);
    let mut at = [zero; 3];
    let mut step_a = [zero; 3];
    let mut step_b = [zero; 3];
    for k in 0..3 {
        let (na, nb) = (-e[k][b] * side, e[k][a] * side);
        let reach = (na + nb + rule.centre_reach(na.abs(), nb.abs())) * (S / 2.0);
        at[k] = reach - (na * v[k][a] + nb * v[k][b]);
        step_a[k] = na * S;
        step_b[k] = nb * S;
    }
    let mut voxels = i64x8::splat(simd, 0);
    for row in &Cube::<SIDE>::CELLS[axis][..SIDE] {
        let mut here = at;
        for &[low, high] in &row[..SIDE] {
            let passing = here[0].min(here[1]).min(here[2]).simd_ge(zero);
            let shown = i64::from(low.cast_unsigned()) | i64::from(high) << 32;
            voxels = passing.select(voxels | shown, voxels);
            for k in 0..3 {
                here[k] += step_b[k];
            }
        }
        for k in 0..3 {
            at[k] += step_a[k];
        }
    }
    voxels
}

// The vector helpers are functions, not closures, because only functions can be forced inline everywhere, and a vector
// operation outside a function compiled for the vector unit is a call.

/// `b - a`.
#[inline(always)]
pub(super) fn between<V: Simd, const AXES: usize>(a: [f64x8<V>; AXES], b: [f64x8<V>; AXES]) -> [f64x8<V>; AXES] {
    let mut edge = b;
    for i in 0..AXES {
        edge[i] = b[i] - a[i];
    }
    edge
}

/// The component of the normal across the axes i and j.
#[inline(always)]
pub(super) fn cross<V: Simd, const AXES: usize>(e: &[[f64x8<V>; AXES]; 3], i: usize, j: usize) -> f64x8<V> {
    e[0][i] * e[1][j] - e[0][j] * e[1][i]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conformance::random::{Placement, Random, triangle};
    use crate::cpu::rule::{Conservative, Thin};

    const ROUNDS: u32 = 500;

    /// The share of triangles that the filter decides, all of them as the exact tests do.
    fn decided<V: Simd, R: SurfaceRule, const SIDE: usize>(simd: V, rule: &R) -> f64 {
        let mut random = Random::new(SIDE as u64);
        let side = i64::try_from(SIDE).unwrap();
        let mut decided = 0;
        for round in 0..ROUNDS {
            let placement = Placement::ALL[round as usize % Placement::ALL.len()];
            let mut rows = [[[0; LANES]; 3]; 3];
            for lane in 0..LANES {
                let extent = random.range(1, side - 1);
                let corners = triangle(&mut random, placement, 0, side - 1 - extent, extent);
                for (k, i) in (0..9).map(|at| (at / 3, at % 3)) {
                    // A box of the cube's voxels and no more.
                    let most = side * i64::from(STEPS_PER_VOXEL) - 1;
                    rows[k][i][lane] = i32::try_from(corners[k][i].clamp(1, most)).unwrap();
                }
            }
            let corners = Vectors(rows.map(|corner| corner.map(|row| i32x16::from_slice(simd, &row))));
            let longest = Boxes::new(simd, &corners).longest.to_float::<f32x16<V>>() * PER_HALF;
            let low = [i32x16::splat(simd, 0); 3];
            let filtered =
                filter::cubes::<_, _, SIDE>(simd, rule, &corners.floats(half_voxels(&low, SIDE), PER_HALF), longest);
            let mut bits = [[0; LANES]; 2];
            for (bits, voxels) in bits.iter_mut().zip(&filtered.voxels) {
                voxels.store_slice(bits);
            }
            for (half, corners) in corners.halves(simd, low, 1.0).iter().enumerate() {
                let mut exact_bits = [0; HALF];
                exact::<_, _, SIDE>(simd, rule, corners).store_slice(&mut exact_bits);
                for (i, exact) in exact_bits.into_iter().enumerate() {
                    let lane = HALF * half + i;
                    if filtered.doubtful >> lane & 1 == 0 {
                        let [low, high] = [bits[0][lane], bits[1][lane]].map(|word| u64::from(word.cast_unsigned()));
                        let corners = rows.map(|corner| corner.map(|row| row[lane]));
                        assert_eq!(low | high << 32, exact.cast_unsigned(), "side {SIDE}, {placement:?}, {corners:?}");
                        decided += 1;
                    }
                }
            }
        }
        f64::from(decided) / f64::from(ROUNDS * u32::try_from(LANES).unwrap())
    }

    #[test]
    fn the_filter_doubts_whatever_it_may_get_wrong() {
        let shares = fearless_simd::dispatch!(fearless_simd::Level::new(), simd => [
            decided::<_, _, 2>(simd, &Conservative),
            decided::<_, _, 3>(simd, &Conservative),
            decided::<_, _, 4>(simd, &Conservative),
            decided::<_, _, 2>(simd, &Thin),
            decided::<_, _, 3>(simd, &Thin),
            decided::<_, _, 4>(simd, &Thin),
        ]);
        // Of five placements, one has no ties and the others little else.
        assert!(shares.iter().all(|share| (0.15..0.9).contains(share)), "{shares:?}");
    }
}
