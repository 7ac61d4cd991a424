//! Triangles of a few columns: sixteen at a time, one a vector lane, one column of each after the other.
//!
//! In a column, the plane and each edge of the two projections that contain z bound the run from above or from below, and the
//! edges of the xy projection say whether there is one. All bounds are linear in x and y. They are found in f32, as the two
//! ends of what they may be for all that was rounded; where the ends are not in one voxel, and there may be a run, the
//! triangle is left to [`rows`](super::rows), which is exact.
//!
//! A voxel is the unit, and the centre of a box's lowest voxel the origin, so that voxels' centres are whole numbers, and
//! corners and edges are exact. Let `m` be the longest side of the box and `u = 2^-24` the most by which a sum, product or
//! quotient of floats is off, relative to it. Corners are within `m + 1/2`, voxels within `m + 1`.
//!
//! - An edge function is five sums of products of the edge's normal, with `l` for the sum of its two absolute values: off by
//!   less than `5 u l (2 m + 2)`, and by less than four times `u l (2 m + 2)` more where it is divided by the normal's part
//!   along z: [`EDGE_ERROR`] has twice of it.
//! - The plane's term, z included, is off by less than `32 u s (m + 2)`, with `s` for the sum of the normal's absolute
//!   components, each of which is off by `3 u` of itself where products and sums are fused (Kahan's algorithm): [`PLANE_ERROR`] has
//!   twice of it. Where they are not, components are at most `m^2` and off by `3 u m^2`: the term is off by less than `64 u m^2
//!   (m + 2)`, that is as if `s` were `2 m^2`. That is for z within the box: the bound itself may be off by more where the normal's
//!   part along z is tiny, so it is compared after the box's.
//! - Where products and sums are not fused, the sign of the normal's components may be wrong: such triangles are left whole.
//! - Where a normal has no part along z, the plane's bound is for all of a column or nothing, as if that part were tiny ([`NO_PART`]).
//! - An edge that a projection shows along an axis, or as a point, excludes only what is outside the box, and nothing here: so
//!   nothing is in doubt because an edge is on the side of a voxel. The same goes for a plane across an axis, and for none
//!   ([`filter`](super::filter)).

use fearless_simd::{Simd, f32x16, i32x16, mask32x16, prelude::*};

use super::filter::{FAR, Normal, UNIT, along_axis, between, faces_axis};
use super::instructions::fuses;
use super::kernel::NearClip;
use super::rows::{Rows, exchange};
use super::rule::SurfaceRule;
use super::sink::{ColumnSink, MOST_BITS};
use super::triangles::{LANES, Lanes, Queue, Vectors};
use crate::lattice::{STEP_BITS, STEPS_PER_VOXEL};

/// A share of an edge's length and of the longest side and two voxels by which an edge function may be off.
const EDGE_ERROR: f32 = 64.0 * UNIT;
/// A share of the normal's absolute components, and of the longest side and two voxels, by which the plane's term may be off.
const PLANE_ERROR: f32 = 64.0 * UNIT;
/// Instead of a normal's part along z that is 0: so small that bounds are beyond all voxels.
const NO_PART: f32 = 1e-30;

/// Triangles whose boxes are of at most so many columns along the longer and along the shorter side go together, because all
/// of a vector take as long as the largest.
const SIZES: [[i32; 2]; 5] = [[2, 2], [4, 4], [8, 4], [16, 8], [32, 2]];
const MOST_LONG: usize = 32;
const MOST_SHORT: i32 = 8;
/// Voxels of a column at most.
const MOST_HIGH: i32 = MOST_BITS.cast_signed();

/// Triangles that wait for their columns, by the size of their boxes.
pub(super) struct Columns {
    waiting: [Queue; SIZES.len()],
    by_long: ByLong,
}

/// What the projection that contains z and the longer side leaves of z, for each column along that side.
type ByLong = [[[f32; LANES]; 4]; MOST_LONG];

impl Columns {
    pub(super) fn new() -> Self {
        const NONE: Queue = Queue::EMPTY;
        Self { waiting: [NONE; SIZES.len()], by_long: [[[0.0; LANES]; 4]; MOST_LONG] }
    }

    /// Sends the runs of the triangles in `lanes`, some perhaps later, or leaves them to `rows`; gives those whose boxes,
    /// `extent` from the lowest to the highest voxel, are too large.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "a step of the kernel")]
    pub(super) fn push<V: Simd, R: SurfaceRule>(
        &mut self,
        simd: V,
        rule: &R,
        corners: &Vectors<V>,
        extent: &[i32x16<V>; 3],
        lanes: Lanes,
        clip: &NearClip<V>,
        rows: &mut Rows,
        sink: &mut impl ColumnSink,
    ) -> Lanes {
        let (short, long) = (extent[0].min(extent[1]), extent[0].max(extent[1]));
        let high = extent[2].simd_ge(MOST_HIGH).to_bitmask();
        let mut left = lanes & !high;
        for (size, [most_long, most_short]) in SIZES.into_iter().enumerate() {
            let here = left & (long.simd_lt(most_long) & short.simd_lt(most_short)).to_bitmask();
            if here != 0 && self.waiting[size].push(simd, corners, here) {
                self.flush(simd, rule, size, false, clip, rows, sink);
            }
            left &= !here;
        }
        left | lanes & high
    }

    /// Sends the runs of all triangles that wait.
    #[inline(always)]
    pub(super) fn finish<V: Simd, R: SurfaceRule>(
        &mut self,
        simd: V,
        rule: &R,
        clip: &NearClip<V>,
        rows: &mut Rows,
        sink: &mut impl ColumnSink,
    ) {
        for size in 0..SIZES.len() {
            self.flush(simd, rule, size, true, clip, rows, sink);
        }
    }

    #[inline(never)]
    #[expect(clippy::too_many_arguments, reason = "a step of the kernel")]
    fn flush<V: Simd, R: SurfaceRule>(
        &mut self,
        simd: V,
        rule: &R,
        size: usize,
        all: bool,
        clip: &NearClip<V>,
        rows: &mut Rows,
        sink: &mut impl ColumnSink,
    ) {
        let Self { waiting, by_long } = self;
        waiting[size].for_each(
            simd,
            all,
            #[inline(always)]
            |corners, count| {
                let doubtful = send(simd, rule, corners, Lanes::MAX >> (64 - count), clip, by_long, sink);
                if doubtful != 0 && rows.push(simd, corners, doubtful) {
                    rows.send(simd, rule, false, clip, sink);
                }
            },
        );
    }
}

/// Bounds of `-z` and of `z`: what exceeds one of these is outside, and what exceeds none of those for sure is inside,
/// whatever was rounded.
#[derive(Clone, Copy)]
struct Bounds<V: Simd> {
    below: f32x16<V>,
    below_surely: f32x16<V>,
    above: f32x16<V>,
    above_surely: f32x16<V>,
}

impl<V: Simd> Bounds<V> {
    #[inline(always)]
    fn load(simd: V, from: &[[f32; LANES]; 4]) -> Self {
        Self {
            below: f32x16::from_slice(simd, &from[0]),
            below_surely: f32x16::from_slice(simd, &from[1]),
            above: f32x16::from_slice(simd, &from[2]),
            above_surely: f32x16::from_slice(simd, &from[3]),
        }
    }

    #[inline(always)]
    fn store(&self, to: &mut [[f32; LANES]; 4]) {
        self.below.store_slice(&mut to[0]);
        self.below_surely.store_slice(&mut to[1]);
        self.above.store_slice(&mut to[2]);
        self.above_surely.store_slice(&mut to[3]);
    }
}

/// The bound that an edge of a projection containing z is: `start + step i` for the column `i` along the other axis.
#[derive(Clone, Copy)]
struct EdgeBound<V: Simd> {
    start: f32x16<V>,
    step: f32x16<V>,
    /// By how much it may be less, for all that was rounded.
    doubt: f32x16<V>,
    /// Where it bounds z from below.
    below: mask32x16<V>,
}

impl<V: Simd> EdgeBound<V> {
    #[inline(always)]
    fn none(simd: V) -> Self {
        let zero = f32x16::splat(simd, 0.0);
        Self { start: zero, step: zero, doubt: zero, below: zero.simd_eq(zero) }
    }

    /// Of an edge with the inward normal `(n_i, n_z)`, at `(v_i, v_z)`, that reaches `reach` beyond the edge.
    #[inline(always)]
    fn new(simd: V, n: [f32x16<V>; 2], v: [f32x16<V>; 2], reach: f32x16<V>, share: f32x16<V>) -> Self {
        let (zero, one) = (f32x16::splat(simd, 0.0), f32x16::splat(simd, 1.0));
        let error = (n[0].abs() + n[1].abs()) * share;
        let at_origin = (-n[0]).mul_add(v[0], (-n[1]).mul_add(v[1], reach));
        let along = along_axis(n[0].abs(), n[1].abs());
        let at_origin = along.select(f32x16::splat(simd, FAR), at_origin);
        let n_z = along.select(one, n[1]);
        let per_z = one / n_z.abs();
        Self {
            start: (at_origin + error) * per_z,
            step: n[0] * per_z,
            doubt: (error + error) * per_z,
            below: n_z.simd_gt(zero),
        }
    }

    /// Bounds z in column `i`.
    #[inline(always)]
    fn apply(&self, i: f32, to: &mut Bounds<V>) {
        let may = self.step.mul_add(i, self.start);
        let surely = may - self.doubt;
        to.below = self.below.select(to.below.min(may), to.below);
        to.below_surely = self.below.select(to.below_surely.min(surely), to.below_surely);
        to.above = self.below.select(to.above, to.above.min(may));
        to.above_surely = self.below.select(to.above_surely, to.above_surely.min(surely));
    }
}

/// Sends the runs of the triangles in `lanes`, and gives those of which rounding may have decided some.
#[inline(always)]
#[expect(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    reason = "of a few columns"
)]
fn send<V: Simd, R: SurfaceRule>(
    simd: V,
    rule: &R,
    corners: &Vectors<V>,
    lanes: Lanes,
    clip: &NearClip<V>,
    by_long: &mut ByLong,
    sink: &mut impl ColumnSink,
) -> Lanes {
    const PER_VOXEL: f32 = 1.0 / STEPS_PER_VOXEL as f32;
    const HALF: i32 = (STEPS_PER_VOXEL / 2) as i32;
    let (zero, one) = (f32x16::splat(simd, 0.0), f32x16::splat(simd, 1.0));
    let [low, high] = corners.boxes();
    let none = i32x16::splat(simd, 0);
    let (mut first, mut last, mut sides) = ([none; 3], [none; 3], none);
    for i in 0..3 {
        first[i] = (clip.low[i] - low[i]).max(none);
        last[i] = high[i].min(clip.high[i]) - low[i];
        sides = sides.max(corners.most(i) - corners.least(i));
    }
    let longest = sides.to_float::<f32x16<V>>() * PER_VOXEL;

    // Axis 0 is the shorter of x and y from here on: of the box, as columns are counted from its corner.
    let across = (high[0] - low[0]).simd_gt(high[1] - low[1]);
    let at = sink.place(&low, clip.base);
    let (step_x, step_y) = (i32x16::splat(simd, at.row), i32x16::splat(simd, 1));
    let steps = [across.select(step_y, step_x), across.select(step_x, step_y)];
    let [v0, v1, v2] = corners.0;
    let turned = Vectors([exchange(across, v0), exchange(across, v1), exchange(across, v2)]);
    let (low, first, last) = (exchange(across, low), exchange(across, first), exchange(across, last));
    let middle = [(low[0] << STEP_BITS) + HALF, (low[1] << STEP_BITS) + HALF, (low[2] << STEP_BITS) + HALF];
    let v = turned.floats(middle, PER_VOXEL);

    let e = [between(v[0], v[1]), between(v[1], v[2]), between(v[2], v[0])];
    let mut normal = Normal::new(simd);
    let n = [
        normal.surely_across(simd, &e, 1, 2),
        normal.surely_across(simd, &e, 2, 0),
        normal.surely_across(simd, &e, 0, 1),
    ];
    let near = longest + 2.0;
    let share = near * EDGE_ERROR;
    let mut lengths = e;
    for k in 0..3 {
        for i in 0..3 {
            lengths[k][i] = e[k][i].abs();
        }
    }

    // The xy projection: edge functions are at least 0.
    let side = one.copysign(n[2]);
    let xy_error = longest * share;
    let mut xy = [[zero; 3]; 3];
    for k in 0..3 {
        let (na, nb) = (-(e[k][1] * side), e[k][0] * side);
        let reach = rule.centre_reach(lengths[k][1], lengths[k][0]) * 0.5;
        let along = along_axis(lengths[k][0], lengths[k][1]);
        let at_origin = (-na).mul_add(v[k][0], (-nb).mul_add(v[k][1], reach));
        xy[k] = [along.select(f32x16::splat(simd, FAR), at_origin), na, nb];
    }
    // The projections to yz and zx.
    let side = one.copysign(n[0]);
    let mut long = [EdgeBound::none(simd); 3];
    for k in 0..3 {
        let n = [-(e[k][2] * side), e[k][1] * side];
        let reach = rule.centre_reach(lengths[k][2], lengths[k][1]) * 0.5;
        long[k] = EdgeBound::new(simd, n, [v[k][1], v[k][2]], reach, share);
    }
    let side = one.copysign(n[1]);
    let mut short = [EdgeBound::none(simd); 3];
    for k in 0..3 {
        let n = [e[k][2] * side, -(e[k][0] * side)];
        let reach = rule.centre_reach(lengths[k][2], lengths[k][0]) * 0.5;
        short[k] = EdgeBound::new(simd, n, [v[k][0], v[k][2]], reach, share);
    }
    // The plane, pointing up.
    let up = one.copysign(n[2]);
    let [n_x, n_y, n_z] = [n[0].abs(), n[1].abs(), n[2].abs()];
    let faces = faces_axis([n_x, n_y, n_z]);
    let per_z = faces.select(zero, one / n_z.max(f32x16::splat(simd, NO_PART)));
    let reach = rule.centre_plane_reach([n_x, n_y, n_z]) * 0.5;
    let components = if fuses(simd) { n_x + n_y + n_z } else { longest * longest * 2.0 };
    let error = components * near * PLANE_ERROR;
    let far = f32x16::splat(simd, FAR);
    let thick = faces.select(far, (reach + error) * per_z);
    let thick_surely = faces.select(far, (reach - error) * per_z);
    let slope = [n[0] * up * per_z, n[1] * up * per_z];
    let at_origin = -(n[0].mul_add(v[0][0], n[1].mul_add(v[0][1], n[2] * v[0][2])) * up * per_z);

    // With a wrong sign, edges exclude what is on the wrong side of them: nothing of such triangles may be sent.
    let mut doubtful = normal.doubtful(simd) & lanes;
    let lanes = lanes & !doubtful;
    let mut last_b = 0;
    for b in 0..MOST_LONG {
        if last[1].simd_ge(b as i32).to_bitmask() & lanes == 0 {
            break;
        }
        last_b = b;
        let far = f32x16::splat(simd, FAR);
        let mut bounds = Bounds { below: far, below_surely: far, above: far, above_surely: far };
        for edge in &long {
            edge.apply(b as f32, &mut bounds);
        }
        bounds.store(&mut by_long[b]);
    }
    let (bottom, top) = (-first[2].to_float::<f32x16<V>>(), last[2].to_float::<f32x16<V>>());
    for a in 0..MOST_SHORT {
        let not_past = last[0].simd_ge(a).to_bitmask() & lanes;
        if not_past == 0 {
            break;
        }
        let in_row = not_past & first[0].simd_le(a).to_bitmask();
        let mut by_short = Bounds { below: bottom, below_surely: bottom, above: top, above_surely: top };
        for edge in &short {
            edge.apply(a as f32, &mut by_short);
        }
        let mut row = [zero; 3];
        for k in 0..3 {
            row[k] = xy[k][1].mul_add(a as f32, xy[k][0]);
        }
        let height = slope[0].mul_add(a as f32, at_origin);
        let mut column = at.column + steps[0] * a;
        for b in 0..=last_b {
            let here = in_row & (last[1].simd_ge(b as i32) & first[1].simd_le(b as i32)).to_bitmask();
            let i = b as f32;
            let least = xy[0][2].mul_add(i, row[0]).min(xy[1][2].mul_add(i, row[1])).min(xy[2][2].mul_add(i, row[2]));
            let height = slope[1].mul_add(i, height);
            let by_long = Bounds::load(simd, &by_long[b]);
            let below = (thick + height).min(by_short.below).min(by_long.below).floor();
            let above = (thick - height).min(by_short.above).min(by_long.above).floor();
            let less = above + below;
            // In the same voxel as what they may be.
            let below_surely = (thick_surely + height).min(by_short.below_surely).min(by_long.below_surely);
            let above_surely = (thick_surely - height).min(by_short.above_surely).min(by_long.above_surely);
            let some = (less.simd_ge(zero) & (least + xy_error).simd_ge(zero)).to_bitmask() & here;
            let surely =
                (below_surely.simd_ge(below) & above_surely.simd_ge(above) & least.simd_ge(xy_error)).to_bitmask();
            doubtful |= some & !surely;
            let from = at.z - below.to_int::<i32x16<V>>();
            let bits = (i32x16::splat(simd, 2) << less.to_int::<i32x16<V>>()) - 1;
            sink.columns(simd, column, from, bits, some & surely);
            column += steps[1];
        }
    }
    doubtful
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conformance::random::{Placement, Random, triangle};
    use crate::cpu::instructions::Instructions;
    use crate::cpu::kernel::VoxelBox;
    use crate::cpu::large::{self, Scratch};
    use crate::cpu::rule::{Conservative, Thin};
    use crate::cpu::sink::{SetRuns, Slab};

    const ROUNDS: u32 = 1000;

    /// A grid of columns of one word.
    struct Words(Vec<u64>);

    const SIDE: usize = 64;

    impl Words {
        fn new() -> Self {
            Self(vec![0; SIDE * SIDE])
        }

        fn slab(&mut self) -> Slab<'_> {
            Slab { words: &mut self.0, start: [0; 3], columns: SIDE, column_words: 1 }
        }
    }

    /// Moves a corner to a few steps from another one: in floats, the normal's parts may then seem to be 0.
    fn needle(random: &mut Random, corners: &mut [[i64; 3]; 3]) {
        let axis = usize::try_from(random.range(0, 2)).unwrap();
        let far = corners[2][axis];
        corners[2] = corners[0].map(|at| at + random.range(-2, 2));
        if random.range(0, 1) == 0 {
            corners[2][axis] = far;
        }
    }

    /// The share of triangles that are decided, all of them as the exact path does.
    fn decided<V: Simd, R: SurfaceRule>(simd: V, rule: &R) -> f64 {
        let mut random = Random::new(9);
        let mut doubts = 0;
        for round in 0..ROUNDS {
            let placement = Placement::ALL[round as usize % Placement::ALL.len()];
            let mut rows = [[[0; LANES]; 3]; 3];
            let mut clip = VoxelBox { low: [0; 3], high: [63; 3] };
            if round % 3 == 0 {
                clip.low = [random.range(20, 26), random.range(20, 26), random.range(20, 26)];
                clip.high = [random.range(28, 34), random.range(28, 34), random.range(28, 34)];
            }
            let (size, longest) = [([8, 16, 16], 10), ([2, 32, 16], 26), ([32, 2, 16], 26)][round as usize / 60 % 3];
            for lane in 0..LANES {
                let extent = random.range(1, longest);
                let mut corners = triangle(&mut random, placement, 24, 30, extent);
                if round % 4 == 0 {
                    needle(&mut random, &mut corners);
                }
                // Of the most columns that go this way, and sixteen voxels.
                let most = size.map(|voxels| (24 + voxels) * i64::from(STEPS_PER_VOXEL) - 1);
                for (k, i) in (0..9).map(|at| (at / 3, at % 3)) {
                    let at = corners[k][i].clamp(24 * i64::from(STEPS_PER_VOXEL) + 1, most[i]);
                    rows[k][i][lane] = i32::try_from(at).unwrap();
                }
            }
            let [found, expected] = found_and_expected(simd, rule, &rows, &clip, &mut doubts);
            assert_eq!(found, expected, "{:?}, round {round}, {rows:?}, {clip:?}", simd.level());
        }
        1.0 - f64::from(doubts) / f64::from(ROUNDS * u32::try_from(LANES).unwrap())
    }

    /// What columns and the exact path set of triangles, at a level.
    fn found_and_expected<V: Simd, R: SurfaceRule>(
        simd: V,
        rule: &R,
        rows: &[[[i32; LANES]; 3]; 3],
        clip: &VoxelBox,
        doubts: &mut u32,
    ) -> [Vec<u64>; 2] {
        let mut scratch = Scratch::default();
        let (mut expected, mut found) = (Words::new(), Words::new());
        let exact = |lane: usize, into: &mut Words, scratch: &mut Scratch| {
            let corners = rows.map(|corner| corner.map(|row| i64::from(row[lane])));
            large::voxelize(simd.level(), rule, &corners, clip, &mut SetRuns::new(into.slab()), scratch);
        };
        let corners = Vectors(rows.map(|corner| corner.map(|row| i32x16::from_slice(simd, &row))));
        let near = NearClip::new(simd, clip, [0; 3]);
        let mut sink = SetRuns::new(found.slab());
        let by_long = &mut Columns::new().by_long;
        let doubtful = send(simd, rule, &corners, (1 << LANES) - 1, &near, by_long, &mut sink);
        sink.finish(simd);
        for lane in 0..LANES {
            exact(lane, &mut expected, &mut scratch);
            if doubtful >> lane & 1 != 0 {
                *doubts += 1;
                exact(lane, &mut found, &mut scratch);
            }
        }
        [found.0, expected.0]
    }

    #[test]
    fn what_rounding_may_have_decided_is_left() {
        for level in Instructions::ALL {
            let shares = fearless_simd::dispatch!(level.level(), simd => [
                decided(simd, &Conservative),
                decided(simd, &Thin),
            ]);
            // Of five placements, one has no ties and the others little else.
            assert!(shares.iter().all(|share| (0.15..0.9).contains(share)), "{level:?}, {shares:?}");
        }
    }

    /// Where products are rounded before they are subtracted, this triangle's normal seems to have no part along an axis, and
    /// its edges the wrong side.
    #[test]
    fn a_normal_of_the_wrong_sign_sets_nothing() {
        let corners = [[684_851, 668_467, 717_783], [1_340_211, 668_467, 1_383_143], [684_852, 865_075, 717_784]];
        let rows = corners.map(|corner| corner.map(|at| [at; LANES]));
        let clip = VoxelBox { low: [0; 3], high: [63; 3] };
        for level in Instructions::ALL {
            fearless_simd::dispatch!(level.level(), simd => {
                let [found, expected] = found_and_expected(simd, &Thin, &rows, &clip, &mut 0);
                assert_eq!(found, expected, "{level:?}");
                let [found, expected] = found_and_expected(simd, &Conservative, &rows, &clip, &mut 0);
                assert_eq!(found, expected, "{level:?}");
            });
        }
    }
}
