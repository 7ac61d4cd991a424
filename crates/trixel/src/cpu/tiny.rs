//! Triangles whose box is at most three voxels along each axis: sixteen at a time, one a vector lane.
//!
//! First in f32 ([`filter`]). Where rounding may have decided a test, all are repeated with less doubt, and where there is
//! still some, in f64, in two halves of eight lanes. That is exact, as everything is integers below 2^53: corners are below
//! 2^18 steps from the box's corner, edge functions below 2^38, normals below 2^36, and the plane's terms smaller than those
//! of larger triangles, which fit too ([`rows`](super::rows)).

use fearless_simd::{Simd, f32x16, f64x8, i32x16, i64x8, mask32x16, prelude::*};

use super::filter::{self, Cube, Filtered};
use super::kernel::NearClip;
use super::octants;
use super::rule::SurfaceRule;
use super::sink::CubeSink;
use super::triangles::{Lanes, Queue, Stored, Vectors};
use crate::lattice::{STEP_BITS, STEPS_PER_VOXEL};

/// S, the lattice steps of a voxel.
const S: f64 = STEPS_PER_VOXEL as f64;

/// The scale of half voxels.
const PER_HALF: f32 = 2.0 / STEPS_PER_VOXEL as f32;

/// The boxes of the triangles in all lanes.
struct Boxes<V: Simd> {
    low: [i32x16<V>; 3],
    high: [i32x16<V>; 3],
    /// The highest voxel, from the lowest.
    extent: [i32x16<V>; 3],
    /// The longest side, in steps.
    longest: i32x16<V>,
}

impl<V: Simd> Boxes<V> {
    #[inline(always)]
    fn new(simd: V, corners: &Vectors<V>) -> Self {
        let zero = i32x16::splat(simd, 0);
        let (mut low, mut high, mut extent, mut longest) = ([zero; 3], [zero; 3], [zero; 3], zero);
        for i in 0..3 {
            let (least, most) = (corners.least(i), corners.most(i));
            low[i] = (least - 1) >> STEP_BITS;
            high[i] = most >> STEP_BITS;
            extent[i] = high[i] - low[i];
            longest = if i == 0 { most - least } else { longest.max(most - least) };
        }
        Self { low, high, extent, longest }
    }

    /// The lanes that have voxels inside the clip in each layer of cubes of 2^3.
    #[inline(always)]
    fn layers(&self, clip: &NearClip<V>) -> octants::Layers {
        let mut layers = [[0; 2]; 3];
        for axis in 0..3 {
            let last = self.high[axis].min(clip.high[axis]) - self.low[axis];
            layers[axis] = [self.low[axis].simd_ge(clip.low[axis]).to_bitmask(), last.simd_ge(1).to_bitmask()];
        }
        layers
    }

    /// Whether any of the boxes in `lanes`, which are inside the clip along z, is not along x or y.
    #[inline(always)]
    fn meets_side(&self, clip: &NearClip<V>, lanes: Lanes) -> bool {
        clip.holds_xy(&self.low, &self.high) & lanes != lanes
    }

    /// Those of the voxels of cubes of `SIDE` that are inside the boxes and the clip, where boxes meet it and are inside
    /// along z.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "at most 3")]
    fn keep<const SIDE: usize>(&self, clip: &NearClip<V>, mut voxels: i32x16<V>, lanes: Lanes) -> i32x16<V> {
        for axis in 0..3 {
            for i in 1..SIDE {
                let layer = Cube::<SIDE>::LAYERS[axis][i];
                voxels = self.extent[axis].simd_lt(i as i32).select(voxels & !layer, voxels);
            }
        }
        if self.meets_side(clip, lanes) {
            for axis in 0..2 {
                let from = clip.low[axis] - self.low[axis];
                let to = clip.high[axis] - self.low[axis];
                for (i, &layer) in (0..).zip(&Cube::<SIDE>::LAYERS[axis][..SIDE]) {
                    // The last layer is not before all that is inside, nor the first behind it.
                    if i + 1 < SIDE as i32 {
                        voxels = from.simd_gt(i).select(voxels & !layer, voxels);
                    }
                    if i > 0 {
                        voxels = to.simd_lt(i).select(voxels & !layer, voxels);
                    }
                }
            }
        }
        voxels
    }
}

/// Sends the boxes of the lanes in `mask`, which are a voxel or a row of two.
#[inline(always)]
pub(super) fn send_boxes<V: Simd>(
    simd: V,
    low: &[i32x16<V>; 3],
    extent: &[i32x16<V>; 3],
    mask: Lanes,
    clip: &NearClip<V>,
    sink: &mut impl CubeSink,
) {
    // The other end of the row is the cube's voxel 4, 2 or 1.
    let voxels = extent[0] << 4 | extent[1] << 2 | extent[2] << 1 | 1;
    let places = sink.places(low, clip.base);
    sink.cubes::<_, 2>(simd, &places, voxels, mask);
}

/// Sends the voxels of the waiting triangles, whose boxes have at most `SIDE` voxels along each axis: of as many as fill
/// vectors, or of all.
#[inline(never)]
pub(super) fn flush<V: Simd, R: SurfaceRule, const SIDE: usize>(
    simd: V,
    rule: &R,
    waiting: &mut Queue,
    all: bool,
    clip: &NearClip<V>,
    sink: &mut impl CubeSink,
) {
    waiting.for_each(
        simd,
        all,
        #[inline(always)]
        |corners, count| send_cubes::<_, _, SIDE>(simd, rule, corners, used(count), clip, sink),
    );
}

/// [`flush`] of the triangles in `lanes`.
#[inline(always)]
pub(super) fn send_cubes<V: Simd, R: SurfaceRule, const SIDE: usize>(
    simd: V,
    rule: &R,
    corners: &Vectors<V>,
    lanes: Lanes,
    clip: &NearClip<V>,
    sink: &mut impl CubeSink,
) {
    let boxes = Boxes::new(simd, corners);
    let places = sink.places(&boxes.low, clip.base);
    let middle = middles(&boxes.low, SIDE);
    let longest = boxes.longest.to_float::<f32x16<V>>() * PER_HALF;
    let Filtered { mut voxels, doubtful } =
        filter::cuboids::<_, _, SIDE, SIDE, SIDE, false>(simd, rule, &corners.floats(middle, PER_HALF), longest);
    if doubtful & lanes != 0 {
        voxels = sure_cubes::<_, _, SIDE>(simd, rule, &corners.stored(), lanes);
    }
    sink.cubes::<_, SIDE>(simd, &places, boxes.keep::<SIDE>(clip, voxels, lanes), lanes);
}

/// Sends the voxels of the triangles in `lanes`, whose boxes have at most two voxels along each axis.
#[inline(always)]
pub(super) fn send_octants<V: Simd>(
    simd: V,
    corners: &Vectors<V>,
    lanes: Lanes,
    clip: &NearClip<V>,
    sink: &mut impl CubeSink,
) {
    const SIDE: usize = 2;
    let boxes = Boxes::new(simd, corners);
    let places = sink.places(&boxes.low, clip.base);
    let middle = middles(&boxes.low, SIDE);
    let longest = boxes.longest.to_float::<f32x16<V>>() * PER_HALF;
    let voxels = octants::voxels(simd, corners, middle, longest, PER_HALF, boxes.layers(clip), lanes);
    sink.cubes::<_, SIDE>(simd, &places, voxels, lanes);
}

/// [`send_octants`] of the waiting triangles: of as many as fill vectors, or of all.
#[inline(never)]
pub(super) fn flush_octants<V: Simd>(
    simd: V,
    waiting: &mut Queue,
    all: bool,
    clip: &NearClip<V>,
    sink: &mut impl CubeSink,
) {
    waiting.for_each(
        simd,
        all,
        #[inline(always)]
        |corners, count| send_octants(simd, corners, used(count), clip, sink),
    );
}

/// [`flush`] for boxes of one voxel along some axis. Where touching is enough, triangles strictly inside their layer meet a
/// voxel where their projections meet.
#[inline(never)]
pub(super) fn flush_flats<V: Simd, R: SurfaceRule, const SIDE: usize>(
    simd: V,
    rule: &R,
    waiting: &mut Queue,
    all: bool,
    clip: &NearClip<V>,
    sink: &mut impl CubeSink,
) {
    waiting.for_each(
        simd,
        all,
        #[inline(always)]
        |corners, count| flats::<_, _, SIDE>(simd, rule, corners, used(count), clip, sink),
    );
}

/// [`flush_flats`] of the triangles in `lanes`.
#[inline(always)]
pub(super) fn flats<V: Simd, R: SurfaceRule, const SIDE: usize>(
    simd: V,
    rule: &R,
    corners: &Vectors<V>,
    lanes: Lanes,
    clip: &NearClip<V>,
    sink: &mut impl CubeSink,
) {
    let boxes = Boxes::new(simd, corners);
    let places = sink.places(&boxes.low, clip.base);
    let Filtered { mut voxels, doubtful } = in_layers::<_, _, SIDE>(simd, rule, corners, &boxes);
    if doubtful & lanes != 0 {
        voxels = sure_cubes::<_, _, SIDE>(simd, rule, &corners.stored(), lanes);
    }
    sink.cubes::<_, SIDE>(simd, &places, boxes.keep::<SIDE>(clip, voxels, lanes), lanes);
}

/// The voxels of cubes of `SIDE` that triangles meet whose boxes are one layer: of those inside the boxes. A row of voxels is
/// in two layers, of which either will do.
#[inline(always)]
fn in_layers<V: Simd, R: SurfaceRule, const SIDE: usize>(
    simd: V,
    rule: &R,
    corners: &Vectors<V>,
    boxes: &Boxes<V>,
) -> Filtered<V> {
    let across_x = boxes.extent[0].simd_le(0);
    let layer = Layer { across_x, across_z: boxes.extent[2].simd_le(0) & !across_x };
    let [a, b, c] = layer.turned(boxes.low);
    let [v0, v1, v2] = corners.0;
    let turned = Vectors([layer.turned(v0), layer.turned(v1), layer.turned(v2)]);
    let v = turned.floats([middle(a, SIDE), middle(b, SIDE), middle(c, 1)], PER_HALF);
    let longest = boxes.longest.to_float::<f32x16<V>>() * PER_HALF;
    let Filtered { voxels: cells, doubtful } = if R::TOUCH_IS_ENOUGH {
        let v = [[v[0][0], v[0][1]], [v[1][0], v[1][1]], [v[2][0], v[2][1]]];
        filter::layers::<_, _, SIDE>(simd, rule, &v, longest)
    } else {
        filter::cuboids::<_, _, SIDE, SIDE, 1, false>(simd, rule, &v, longest)
    };
    let voxels = if SIDE == 2 { layer.spread_two(cells) } else { layer.spread_three(cells) };
    Filtered { voxels, doubtful }
}

/// The lattice points at the middle of cubes of `side` voxels.
#[inline(always)]
fn middles<V: Simd>(low: &[i32x16<V>; 3], side: usize) -> [i32x16<V>; 3] {
    [middle(low[0], side), middle(low[1], side), middle(low[2], side)]
}

/// The middle of `side` voxels along an axis.
#[inline(always)]
fn middle<V: Simd>(low: i32x16<V>, side: usize) -> i32x16<V> {
    #[expect(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "at most 3")]
    let half = side as i32 * (STEPS_PER_VOXEL / 2) as i32;
    (low << STEP_BITS) + half
}

/// The first `count` lanes.
#[inline(always)]
fn used(count: usize) -> Lanes {
    (1 << count) - 1
}

/// Where layers of voxels are across x or z, or else across y.
struct Layer<V: Simd> {
    across_x: mask32x16<V>,
    across_z: mask32x16<V>,
}

impl<V: Simd> Layer<V> {
    /// The axes of the layer, ascending, and the one across it.
    #[inline(always)]
    fn turned(&self, p: [i32x16<V>; 3]) -> [i32x16<V>; 3] {
        let Self { across_x, across_z } = *self;
        [across_x.select(p[1], p[0]), across_z.select(p[1], p[2]), across_x.select(p[0], across_z.select(p[2], p[1]))]
    }

    /// Bit `2 a + b` of a layer of 2 x 2 voxels to the bit of its voxel in a cube.
    #[inline(always)]
    fn spread_two(&self, cells: i32x16<V>) -> i32x16<V> {
        let rows = cells & 0b11 | (cells & 0b1100) << 2;
        let bits = rows & 0b1_0001 | (rows & 0b10_0010) << 1;
        self.across_x.select(cells, self.across_z.select(bits, rows))
    }

    /// Bit `3 a + b` of a layer of 3 x 3 voxels to the bit of its voxel in a cube.
    #[inline(always)]
    fn spread_three(&self, cells: i32x16<V>) -> i32x16<V> {
        // Each row's three bits to every ninth, each bit to every third.
        let rows = cells & 0o7 | (cells & 0o70) << 6 | (cells & 0o700) << 12;
        let bits = rows & 0o001_001_001 | (rows & 0o002_002_002) << 2 | (rows & 0o004_004_004) << 4;
        self.across_x.select(cells, self.across_z.select(bits, rows))
    }
}

/// The voxels of cubes of `SIDE` that triangles meet, of those inside their boxes; only the lanes in `lanes` are right.
#[inline(never)]
fn sure_cubes<V: Simd, R: SurfaceRule, const SIDE: usize>(
    simd: V,
    rule: &R,
    stored: &Stored,
    lanes: Lanes,
) -> i32x16<V> {
    simd.vectorize(
        #[inline(always)]
        || {
            let corners = stored.vectors(simd, 0);
            let boxes = Boxes::new(simd, &corners);
            let longest = boxes.longest.to_float::<f32x16<V>>() * PER_HALF;
            let v = corners.floats(middles(&boxes.low, SIDE), PER_HALF);
            let Filtered { voxels, doubtful } =
                filter::cuboids::<_, _, SIDE, SIDE, SIDE, true>(simd, rule, &v, longest);
            if doubtful & lanes == 0 { voxels } else { exact_cubes::<_, _, SIDE>(simd, rule, stored) }
        },
    )
}

/// The voxels of cubes of `SIDE`, without rounding.
#[inline(never)]
fn exact_cubes<V: Simd, R: SurfaceRule, const SIDE: usize>(simd: V, rule: &R, corners: &Stored) -> i32x16<V> {
    simd.vectorize(
        #[inline(always)]
        || {
            let corners = corners.vectors(simd, 0);
            let boxes = Boxes::new(simd, &corners);
            let low = [boxes.low[0] << STEP_BITS, boxes.low[1] << STEP_BITS, boxes.low[2] << STEP_BITS];
            let [first, second] = corners.halves(simd, low, 1.0);
            let (first, second) = (exact::<_, _, SIDE>(simd, rule, &first), exact::<_, _, SIDE>(simd, rule, &second));
            first.narrow(second)
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
    let (d1, d2) = rule.planes(simd, n, v[0]);
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
        for &shown in &row[..SIDE] {
            let passing = here[0].min(here[1]).min(here[2]).simd_ge(zero);
            voxels = passing.select(voxels | i64::from(shown), voxels);
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
    use crate::cpu::instructions::{Instructions, fuses};
    use crate::cpu::rule::{Conservative, Thin};
    use crate::cpu::triangles::LANES;

    const ROUNDS: u32 = 500;
    const ALL: Lanes = (1 << LANES) - 1;

    /// Triangles whose boxes are inside a cube of `side` voxels at the origin: corner, axis, lane.
    fn in_cube(random: &mut Random, round: u32, side: i64) -> [[[i32; LANES]; 3]; 3] {
        let placement = Placement::ALL[round as usize % Placement::ALL.len()];
        let mut rows = [[[0; LANES]; 3]; 3];
        for lane in 0..LANES {
            // Of any extent, and anywhere in the cube: cut off at its border.
            let extent = random.range(1, side);
            let corners = triangle(random, placement, 0, side - 1, extent);
            for (k, i) in (0..9).map(|at| (at / 3, at % 3)) {
                // A box of the cube's voxels and no more.
                let most = side * i64::from(STEPS_PER_VOXEL) - 1;
                rows[k][i][lane] = i32::try_from(corners[k][i].clamp(1, most)).unwrap();
            }
        }
        rows
    }

    fn vectors<V: Simd>(simd: V, rows: &[[[i32; LANES]; 3]; 3]) -> Vectors<V> {
        Vectors(rows.map(|corner| corner.map(|row| i32x16::from_slice(simd, &row))))
    }

    /// The share of triangles that the filter decides, all of them as the exact tests do.
    fn decided<V: Simd, R: SurfaceRule, const SIDE: usize, const SURER: bool>(simd: V, rule: &R) -> f64 {
        let mut random = Random::new(SIDE as u64);
        let mut decided = 0;
        for round in 0..ROUNDS {
            let rows = in_cube(&mut random, round, i64::try_from(SIDE).unwrap());
            let corners = vectors(simd, &rows);
            let boxes = Boxes::new(simd, &corners);
            let exact = exact_cubes::<_, _, SIDE>(simd, rule, &corners.stored());
            let Filtered { voxels, doubtful } = filter::cuboids::<_, _, SIDE, SIDE, SIDE, SURER>(
                simd,
                rule,
                &corners.floats(middles(&boxes.low, SIDE), PER_HALF),
                boxes.longest.to_float::<f32x16<V>>() * PER_HALF,
            );
            decided += agreeing::<_, SIDE>(simd, &rows, &boxes, exact, voxels, doubtful);
        }
        f64::from(decided) / f64::from(ROUNDS * u32::try_from(LANES).unwrap())
    }

    /// How many of the lanes are decided: all of them as the exact tests do, inside the boxes.
    fn agreeing<V: Simd, const SIDE: usize>(
        simd: V,
        rows: &[[[i32; LANES]; 3]; 3],
        boxes: &Boxes<V>,
        exact: i32x16<V>,
        voxels: i32x16<V>,
        doubtful: u64,
    ) -> u32 {
        let all = i32x16::splat(simd, i32::try_from(SIDE).unwrap());
        let clip = NearClip { base: [0; 3], low: [i32x16::splat(simd, 0); 3], high: [all; 3] };
        let [exact, voxels] = [exact, voxels].map(|voxels| boxes.keep::<SIDE>(&clip, voxels, ALL));
        let mut decided = 0;
        for lane in (0..LANES).filter(|lane| doubtful >> lane & 1 == 0) {
            let corners = rows.map(|corner| corner.map(|row| row[lane]));
            assert_eq!(voxels[lane], exact[lane], "side {SIDE}, {corners:?}");
            decided += 1;
        }
        decided
    }

    /// The share of triangles in one layer that the filter decides, all of them as the exact tests do.
    fn decided_in_layers<V: Simd, R: SurfaceRule, const SIDE: usize>(simd: V, rule: &R) -> f64 {
        let mut random = Random::new(SIDE as u64);
        let mut decided = 0;
        for round in 0..ROUNDS {
            let mut rows = in_cube(&mut random, round, i64::try_from(SIDE).unwrap());
            for lane in 0..LANES {
                // Into one of the voxels along an axis, each corner to anywhere in it.
                let axis = usize::try_from(random.range(0, 2)).unwrap();
                let voxel = i32::try_from(random.range(0, i64::try_from(SIDE).unwrap() - 1)).unwrap();
                let steps = i32::try_from(STEPS_PER_VOXEL).unwrap();
                for corner in &mut rows {
                    let step = &mut corner[axis][lane];
                    *step = voxel * steps + 1 + (*step - 1) % (steps - 1);
                }
            }
            let corners = vectors(simd, &rows);
            let boxes = Boxes::new(simd, &corners);
            let exact = exact_cubes::<_, _, SIDE>(simd, rule, &corners.stored());
            let Filtered { voxels, doubtful } = in_layers::<_, _, SIDE>(simd, rule, &corners, &boxes);
            decided += agreeing::<_, SIDE>(simd, &rows, &boxes, exact, voxels, doubtful);
        }
        f64::from(decided) / f64::from(ROUNDS * u32::try_from(LANES).unwrap())
    }

    /// `(c, d)` with `a d - b c = 1`, for `a` and `b` without a common divisor, no larger than they are.
    fn beside(a: i64, b: i64) -> [i64; 2] {
        if b == 0 {
            return [0, 1];
        }
        let [c, d] = beside(b, a % b);
        [-d - a / b * c, -c]
    }

    /// In a projection, moves the first edge of each triangle as near to the middle of the cube as the lattice allows: there,
    /// floats do not tell on which side it is.
    fn through_middle(random: &mut Random, rows: &mut [[[i32; LANES]; 3]; 3]) {
        let (i, j) = [(0, 1), (1, 2), (2, 0)][usize::try_from(random.range(0, 2)).unwrap()];
        for lane in 0..LANES {
            let [a, b] = [random.range(1, 60_000), random.range(1, 60_000)];
            let [c, d] = beside(a, b);
            if a * d - b * c == 1 {
                let at = |from_middle: i64| i32::try_from(i64::from(STEPS_PER_VOXEL) + from_middle).unwrap();
                (rows[0][i][lane], rows[0][j][lane]) = (at(a), at(b));
                (rows[1][i][lane], rows[1][j][lane]) = (at(-c), at(-d));
            }
        }
    }

    /// Octants give the voxels of boxes that the exact tests do, in clips that cut some.
    fn octants_are_exact<V: Simd>(simd: V) {
        let mut random = Random::new(8);
        for round in 0..2 * ROUNDS {
            let mut rows = in_cube(&mut random, round, 2);
            if round % 2 == 0 {
                through_middle(&mut random, &mut rows);
            }
            let corners = vectors(simd, &rows);
            let boxes = Boxes::new(simd, &corners);
            let mut clip = || i32x16::splat(simd, i32::try_from(random.range(0, 1)).unwrap());
            let (zero, one) = (i32x16::splat(simd, 0), i32x16::splat(simd, 1));
            let clip = NearClip { base: [0; 3], low: [clip(), zero, zero], high: [one, clip(), one] };
            let expected = exact_cubes::<_, _, 2>(simd, &Conservative, &corners.stored());
            let expected = boxes.keep::<2>(&clip, expected, ALL);

            let (middle, layers) = (middles(&boxes.low, 2), boxes.layers(&clip));
            let longest = boxes.longest.to_float::<f32x16<V>>() * PER_HALF;
            let exact = octants::exact(simd, &corners, middle, layers);
            let meets = clip.meets(&boxes.low, &boxes.high);
            for lane in (0..LANES).filter(|lane| meets >> lane & 1 != 0) {
                let corners_of = rows.map(|corner| corner.map(|row| row[lane]));
                // Alone, so that the others' doubts do not matter.
                let alone = octants::voxels(simd, &corners, middle, longest, PER_HALF, layers, 1 << lane);
                assert_eq!([exact[lane], alone[lane]], [expected[lane]; 2], "round {round}, {corners_of:?}");
            }
        }
    }

    /// Triangles of which some are in doubt get the voxels of boxes that the exact tests do.
    fn sure_cubes_are_exact<V: Simd, R: SurfaceRule, const SIDE: usize>(simd: V, rule: &R) {
        let mut random = Random::new(9);
        for round in 0..ROUNDS {
            let rows = in_cube(&mut random, round, i64::try_from(SIDE).unwrap());
            let corners = vectors(simd, &rows);
            let stored = corners.stored();
            let exact = exact_cubes::<_, _, SIDE>(simd, rule, &stored);
            for lane in 0..LANES {
                // Alone, so that the others' doubts do not matter.
                let alone = sure_cubes::<_, _, SIDE>(simd, rule, &stored, 1 << lane);
                agreeing::<_, SIDE>(simd, &rows, &Boxes::new(simd, &corners), exact, alone, !(1 << lane));
            }
        }
    }

    #[test]
    fn sure_cubes_give_what_the_exact_tests_do() {
        for level in Instructions::ALL {
            fearless_simd::dispatch!(level.level(), simd => {
                sure_cubes_are_exact::<_, _, 2>(simd, &Conservative);
                sure_cubes_are_exact::<_, _, 3>(simd, &Conservative);
                sure_cubes_are_exact::<_, _, 2>(simd, &Thin);
                sure_cubes_are_exact::<_, _, 3>(simd, &Thin);
            });
        }
    }

    #[test]
    fn octants_give_what_the_exact_tests_do() {
        for level in Instructions::ALL {
            fearless_simd::dispatch!(level.level(), simd => octants_are_exact(simd));
        }
    }

    #[test]
    fn the_filter_doubts_whatever_it_may_get_wrong() {
        for level in Instructions::ALL {
            let shares = fearless_simd::dispatch!(level.level(), simd => [
                decided::<_, _, 2, false>(simd, &Conservative),
                decided::<_, _, 3, false>(simd, &Conservative),
                decided::<_, _, 2, false>(simd, &Thin),
                decided::<_, _, 3, false>(simd, &Thin),
                decided::<_, _, 2, true>(simd, &Conservative),
                decided::<_, _, 3, true>(simd, &Conservative),
                decided::<_, _, 2, true>(simd, &Thin),
                decided::<_, _, 3, true>(simd, &Thin),
                decided_in_layers::<_, _, 3>(simd, &Conservative),
                decided_in_layers::<_, _, 2>(simd, &Thin),
                decided_in_layers::<_, _, 3>(simd, &Thin),
            ]);
            // Of five placements, one has no ties and the others little else.
            assert!(shares.iter().all(|share| (0.15..0.9).contains(share)), "{level:?}, {shares:?}");
            for fast in 0..4 {
                assert!(shares[fast] < shares[fast + 4], "{level:?}, {shares:?}");
            }
        }
    }

    /// Nothing is in doubt because it lies on the side of a voxel.
    #[test]
    fn what_is_on_sides_of_voxels_is_decided() {
        const S: i32 = STEPS_PER_VOXEL as i32;
        let corners = [[S + 7, S + 9, S], [2 * S - 5, S + 9, S], [S + 7, 2 * S + 777, S]];
        fearless_simd::dispatch!(fearless_simd::Level::new(), simd => {
            for turn in 0..3 {
                let rows = corners.map(|corner| [0, 1, 2].map(|i| [corner[(i + turn) % 3]; LANES]));
                let corners = vectors(simd, &rows);
                let boxes = Boxes::new(simd, &corners);
                let v = corners.floats(middles(&boxes.low, 2), PER_HALF);
                let longest = boxes.longest.to_float::<f32x16<_>>() * PER_HALF;
                let filtered = filter::cuboids::<_, _, 2, 2, 2, true>(simd, &Thin, &v, longest);
                if fuses(simd) {
                    assert_eq!(filtered.doubtful, 0, "{turn}");
                }
            }
        });
    }
}
