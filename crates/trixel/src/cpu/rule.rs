//! The modes as thresholds: DESIGN's factored forms of the definitions.
//!
//! With voxel indices p, an edge of a projection is `n.p >= t` and the plane is `d1 <= N.p <= d2`. A mode is what it
//! makes of t, d1 and d2. The forms follow [HCV] figures 6.1 and 6.2, in integers.

use fearless_simd::{Simd, f64x8, prelude::*};

use super::number::Int;
use crate::lattice::STEPS_PER_VOXEL;

/// S, the lattice steps of a voxel.
const S: i64 = STEPS_PER_VOXEL as i64;

/// Half a voxel.
const HALF: f64 = STEPS_PER_VOXEL as f64 / 2.0;

/// What distinguishes one mode from another.
pub(super) trait Rule: Copy + Send + Sync {
    /// Whether the two projections that contain z constrain the run, and the triangle's box does; otherwise the plane
    /// alone gives the run's ends.
    const SURFACE: bool;

    /// Whether the voxels of a triangle are all those that it meets, so that a triangle strictly inside a row of voxels
    /// sets the whole row, and one strictly inside a layer sets what its projection meets.
    const TOUCH_IS_ENOUGH: bool;

    /// Whether a run goes on to the top of the clip whatever the plane's upper bound.
    const TO_TOP: bool = false;

    /// Whether arithmetic in 64 bits, and in the 53 of f64, is exact for small triangles.
    #[inline(always)]
    fn fits_small(&self) -> bool {
        true
    }

    /// The t of `n.p >= t` for an edge with inward normal `(na, nb)` and `nv = n.v`.
    fn edge<T: Int>(&self, na: T, nb: T, nv: T) -> T;

    /// `(d1, d2)` for the normal `n` (with `n[2] >= 0`) and the corner `v0` in local lattice coordinates.
    fn plane<T: Int>(&self, n: [T; 3], v0: [i64; 3]) -> (T, T);
}

/// A mode's thresholds for eight triangles at a time, of at most 2^22 steps along each axis.
pub(super) trait VectorRule: Rule {
    /// [`Rule::edge`].
    fn edges<V: Simd>(&self, simd: V, na: f64x8<V>, nb: f64x8<V>, nv: f64x8<V>) -> f64x8<V>;

    /// [`Rule::plane`]; on surfaces the normal may point down.
    fn planes<V: Simd>(&self, simd: V, n: [f64x8<V>; 3], v0: [f64x8<V>; 3]) -> (f64x8<V>, f64x8<V>);
}

/// A surface mode's tests, seen from voxels' centres.
pub(super) trait SurfaceRule: VectorRule {
    /// How far beyond an edge's line a voxel's centre passes, for the absolute values of the edge's normal in a
    /// projection: times half a voxel.
    fn centre_reach<V: Simd, F: SimdFloat<V>>(&self, na: F, nb: F) -> F;

    /// How far from the plane a voxel's centre passes, for the absolute values of the normal: times half a voxel.
    fn centre_plane_reach<V: Simd, F: SimdFloat<V>>(&self, n: [F; 3]) -> F;
}

/// N.p and N.r / S for `v0 = S p + r` with r within half a voxel of 0. With |N_i| at most 2^36 no term reaches 2^53.
#[inline(always)]
pub(super) fn split_centred<V: Simd>(n: [f64x8<V>; 3], v0: [f64x8<V>; 3]) -> (f64x8<V>, f64x8<V>) {
    let steps = f64::from(STEPS_PER_VOXEL);
    let p = [
        (v0[0] * (1.0 / steps)).round_ties_even(),
        (v0[1] * (1.0 / steps)).round_ties_even(),
        (v0[2] * (1.0 / steps)).round_ties_even(),
    ];
    let whole = n[0] * p[0] + n[1] * p[1] + n[2] * p[2];
    let rest = n[0] * (v0[0] - p[0] * steps) + n[1] * (v0[1] - p[1] * steps) + n[2] * (v0[2] - p[2] * steps);
    (whole, rest * (1.0 / steps))
}

/// N.v0 / S as the sum of a whole number and of fractions, for |N_i| below 2^44 and |v0| below 2^22 and two voxels. With `v0 =
/// S p + r` and `N = S m + l`, N.p and m.r are whole, N.p below 3 * 2^44 * 67 < 2^52, and l.r is below 3 * 2^31.
#[inline(always)]
fn split_long<V: Simd>(simd: V, n: [f64x8<V>; 3], v0: [f64x8<V>; 3]) -> (f64x8<V>, f64x8<V>) {
    let steps = f64::from(STEPS_PER_VOXEL);
    let mut whole = f64x8::splat(simd, 0.0);
    let mut rest = whole;
    for i in 0..3 {
        let p = (v0[i] * (1.0 / steps)).round_ties_even();
        let r = v0[i] - p * steps;
        let multiples = (n[i] * (1.0 / steps)).floor();
        whole += n[i] * p + multiples * r;
        rest += (n[i] - multiples * steps) * r;
    }
    (whole, rest * (1.0 / steps))
}

impl<R: SurfaceRule> VectorRule for R {
    #[inline(always)]
    fn edges<V: Simd>(&self, _simd: V, na: f64x8<V>, nb: f64x8<V>, nv: f64x8<V>) -> f64x8<V> {
        let reach = na + nb + self.centre_reach(na.abs(), nb.abs());
        ((nv - reach * HALF) * (1.0 / f64::from(STEPS_PER_VOXEL))).ceil()
    }

    #[inline(always)]
    fn planes<V: Simd>(&self, simd: V, n: [f64x8<V>; 3], v0: [f64x8<V>; 3]) -> (f64x8<V>, f64x8<V>) {
        let (whole, rest) = split_long(simd, n, [v0[0] - HALF, v0[1] - HALF, v0[2] - HALF]);
        let reach = self.centre_plane_reach([n[0].abs(), n[1].abs(), n[2].abs()]) * 0.5;
        let reach_whole = reach.floor();
        let reach_rest = reach - reach_whole;
        (whole - reach_whole + (rest - reach_rest).ceil(), whole + reach_whole + (rest + reach_rest).floor())
    }
}

/// [`centre_edge`] of eight triangles.
#[inline(always)]
fn centre_edges<V: Simd>(simd: V, na: f64x8<V>, nb: f64x8<V>, nv: f64x8<V>) -> f64x8<V> {
    let (zero, one) = (f64x8::splat(simd, 0.0), f64x8::splat(simd, 1.0));
    let inclusive = na.simd_gt(zero) | (na.simd_eq(zero) & nb.simd_gt(zero));
    let shift = inclusive.select(zero, one);
    ((nv - (na + nb) * HALF + shift) * (1.0 / f64::from(STEPS_PER_VOXEL))).ceil()
}

/// `N.p + floor or ceil of the rest`, where `v0 = S p + rest`: keeps the products small. Gives N.p and N.(rest + shift).
#[inline(always)]
fn split<T: Int>(n: [T; 3], v0: [i64; 3], shift: [i64; 3]) -> (T, T) {
    let whole = |i: usize| n[i] * T::from(v0[i].div_euclid(S));
    let rest = |i: usize| n[i] * T::from(v0[i].rem_euclid(S) + shift[i]);
    (whole(0) + whole(1) + whole(2), rest(0) + rest(1) + rest(2))
}

#[inline(always)]
fn ceil_voxels<T: Int>(value: T) -> T {
    (value + T::from(S - 1)).floor_voxels()
}

#[inline(always)]
fn abs<T: Int>(value: T) -> T {
    value.max(-value)
}

/// [`crate::Mode::Conservative`].
#[derive(Clone, Copy)]
pub(super) struct Conservative;

impl Rule for Conservative {
    const SURFACE: bool = true;
    const TOUCH_IS_ENOUGH: bool = true;

    #[inline(always)]
    fn edge<T: Int>(&self, na: T, nb: T, nv: T) -> T {
        let zero = T::from(0);
        ceil_voxels(nv) - zero.max(na) - zero.max(nb)
    }

    #[inline(always)]
    fn plane<T: Int>(&self, n: [T; 3], v0: [i64; 3]) -> (T, T) {
        let zero = T::from(0);
        let (whole, rest) = split(n, v0, [0; 3]);
        let above = zero.max(n[0]) + zero.max(n[1]) + zero.max(n[2]);
        let below = zero.min(n[0]) + zero.min(n[1]) + zero.min(n[2]);
        (whole + ceil_voxels(rest) - above, whole + rest.floor_voxels() - below)
    }
}

impl SurfaceRule for Conservative {
    #[inline(always)]
    fn centre_reach<V: Simd, F: SimdFloat<V>>(&self, na: F, nb: F) -> F {
        na + nb
    }

    #[inline(always)]
    fn centre_plane_reach<V: Simd, F: SimdFloat<V>>(&self, n: [F; 3]) -> F {
        n[0] + n[1] + n[2]
    }
}

/// [`crate::Mode::Thin`].
#[derive(Clone, Copy)]
pub(super) struct Thin;

impl Rule for Thin {
    const SURFACE: bool = true;
    const TOUCH_IS_ENOUGH: bool = false;

    #[inline(always)]
    fn edge<T: Int>(&self, na: T, nb: T, nv: T) -> T {
        ceil_voxels(nv - T::from(S / 2) * (na + nb + abs(na).max(abs(nb))))
    }

    #[inline(always)]
    fn plane<T: Int>(&self, n: [T; 3], v0: [i64; 3]) -> (T, T) {
        let half = T::from(S / 2);
        let (whole, rest) = split(n, v0, [-S / 2; 3]);
        let reach = half * abs(n[0]).max(abs(n[1])).max(abs(n[2]));
        (whole + ceil_voxels(rest - reach), whole + (rest + reach).floor_voxels())
    }
}

impl SurfaceRule for Thin {
    #[inline(always)]
    fn centre_reach<V: Simd, F: SimdFloat<V>>(&self, na: F, nb: F) -> F {
        na.max(nb)
    }

    #[inline(always)]
    fn centre_plane_reach<V: Simd, F: SimdFloat<V>>(&self, n: [F; 3]) -> F {
        n[0].max(n[1]).max(n[2])
    }
}

/// The t of an edge whose inside is judged at the voxel's centre, shifted by (+e, +e^2) when it lies on the edge.
#[inline(always)]
fn centre_edge<T: Int>(na: T, nb: T, nv: T) -> T {
    let zero = T::from(0);
    let inclusive = na > zero || na == zero && nb > zero;
    ceil_voxels(nv - T::from(S / 2) * (na + nb) + T::from(i64::from(!inclusive)))
}

/// [`crate::Mode::Solid`]: d1 gives the lowest voxel whose centre is not below the triangle; d2 is not used.
#[derive(Clone, Copy)]
pub(super) struct Solid;

impl Rule for Solid {
    const SURFACE: bool = false;
    const TOUCH_IS_ENOUGH: bool = false;
    const TO_TOP: bool = true;

    #[inline(always)]
    fn edge<T: Int>(&self, na: T, nb: T, nv: T) -> T {
        centre_edge(na, nb, nv)
    }

    #[inline(always)]
    fn plane<T: Int>(&self, n: [T; 3], v0: [i64; 3]) -> (T, T) {
        let (whole, rest) = split(n, v0, [-S / 2; 3]);
        let d1 = whole + ceil_voxels(rest);
        (d1, d1)
    }
}

impl VectorRule for Solid {
    #[inline(always)]
    fn edges<V: Simd>(&self, simd: V, na: f64x8<V>, nb: f64x8<V>, nv: f64x8<V>) -> f64x8<V> {
        centre_edges(simd, na, nb, nv)
    }

    #[inline(always)]
    fn planes<V: Simd>(&self, simd: V, n: [f64x8<V>; 3], v0: [f64x8<V>; 3]) -> (f64x8<V>, f64x8<V>) {
        let (whole, rest) = split_long(simd, n, [v0[0] - HALF, v0[1] - HALF, v0[2] - HALF]);
        let d1 = whole + rest.ceil();
        (d1, d1)
    }
}

/// [`crate::Mode::Sliced`].
#[derive(Clone, Copy)]
pub(super) struct Sliced {
    /// The overlap, in lattice steps.
    pub(super) overlap: i64,
}

impl Rule for Sliced {
    const SURFACE: bool = false;
    const TOUCH_IS_ENOUGH: bool = false;

    #[inline(always)]
    fn fits_small(&self) -> bool {
        // The overlap adds itself times N_z to the numerators, which have room for two voxels of it.
        self.overlap < 2 * S
    }

    #[inline(always)]
    fn edge<T: Int>(&self, na: T, nb: T, nv: T) -> T {
        centre_edge(na, nb, nv)
    }

    #[inline(always)]
    fn plane<T: Int>(&self, n: [T; 3], v0: [i64; 3]) -> (T, T) {
        // Whole voxels of overlap go to the whole part, so that the rest stays small.
        let (whole, rest) = split(n, v0, [-S / 2, -S / 2, 0]);
        let overlap_whole = n[2] * T::from(self.overlap.div_euclid(S));
        let overlap_rest = n[2] * T::from(self.overlap.rem_euclid(S));
        let low = whole - overlap_whole + ceil_voxels(rest - overlap_rest) - n[2];
        let high = whole + overlap_whole + (rest + overlap_rest).floor_voxels();
        (low, high)
    }
}

impl VectorRule for Sliced {
    #[inline(always)]
    fn edges<V: Simd>(&self, simd: V, na: f64x8<V>, nb: f64x8<V>, nv: f64x8<V>) -> f64x8<V> {
        centre_edges(simd, na, nb, nv)
    }

    #[inline(always)]
    #[expect(clippy::cast_precision_loss, reason = "less than two voxels")]
    fn planes<V: Simd>(&self, simd: V, n: [f64x8<V>; 3], v0: [f64x8<V>; 3]) -> (f64x8<V>, f64x8<V>) {
        let overlap = self.overlap as f64;
        let (low, low_rest) = split_long(simd, n, [v0[0] - HALF, v0[1] - HALF, v0[2] - overlap]);
        let (high, high_rest) = split_long(simd, n, [v0[0] - HALF, v0[1] - HALF, v0[2] + overlap]);
        (low + low_rest.ceil() - n[2], high + high_rest.floor())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conformance::random::Random;

    const LANES: usize = 8;
    const ROUNDS: usize = 2000;

    /// Corners of the largest small triangles, mostly within a step of whole and half voxels or of their limits.
    fn corner(random: &mut Random) -> [i64; 3] {
        [0; 3].map(|_: i64| match random.range(0, 3) {
            0 => random.range(0, 64 * S),
            1 => (random.range(0, 128) * S / 2 + random.range(-1, 1)).clamp(0, 64 * S),
            2 => random.range(0, 1) * 64 * S,
            _ => random.range(0, 2 * S),
        })
    }

    /// One number of each triangle.
    fn vector<V: Simd>(simd: V, number: impl Fn(usize) -> i64) -> f64x8<V> {
        #[expect(clippy::cast_precision_loss, reason = "below 2^53")]
        let numbers: [f64; LANES] = std::array::from_fn(|lane| number(lane) as f64);
        f64x8::from_slice(simd, &numbers)
    }

    /// In vectors, thresholds are what they are one by one.
    fn vectors_agree<V: Simd, R: VectorRule>(simd: V, rule: &R) {
        let mut random = Random::new(10);
        for round in 0..ROUNDS {
            let v: [[[i64; 3]; 3]; LANES] = std::array::from_fn(|_| std::array::from_fn(|_| corner(&mut random)));
            let edge = |lane: usize, i: usize, k: usize| v[lane][(k + 1) % 3][i] - v[lane][k][i];
            let cross = |lane: usize, i: usize| {
                let (a, b) = ((i + 1) % 3, (i + 2) % 3);
                edge(lane, a, 0) * edge(lane, b, 1) - edge(lane, b, 0) * edge(lane, a, 1)
            };
            let up = |lane: usize, i: usize| if cross(lane, 2) < 0 { -cross(lane, i) } else { cross(lane, i) };
            for (k, a, b) in (0..9).map(|i| (i / 3, i % 3, (i + 1) % 3)) {
                let (na, nb) = (|lane| -edge(lane, b, k), |lane| edge(lane, a, k));
                let nv = |lane: usize| na(lane) * v[lane][k][a] + nb(lane) * v[lane][k][b];
                let edges = rule.edges(simd, vector(simd, na), vector(simd, nb), vector(simd, nv));
                let one_by_one = vector(simd, |lane| rule.edge(na(lane), nb(lane), nv(lane)));
                assert_eq!(*edges, *one_by_one, "round {round}, {v:?}");
            }
            let n = [0, 1, 2].map(|i| vector(simd, |lane| up(lane, i)));
            let (d1, d2) = rule.planes(simd, n, [0, 1, 2].map(|i| vector(simd, |lane| v[lane][0][i])));
            let plane = |lane: usize| rule.plane([0, 1, 2].map(|i| up(lane, i)), v[lane][0]);
            assert_eq!(*d1, *vector(simd, |lane| plane(lane).0), "round {round}, {v:?}");
            assert_eq!(*d2, *vector(simd, |lane| plane(lane).1), "round {round}, {v:?}");
        }
    }

    #[test]
    fn thresholds_of_vectors_are_those_of_integers() {
        fearless_simd::dispatch!(fearless_simd::Level::new(), simd => {
            vectors_agree(simd, &Conservative);
            vectors_agree(simd, &Thin);
            vectors_agree(simd, &Solid);
            for overlap in [0, 1, S / 2, S, 2 * S - 1] {
                vectors_agree(simd, &Sliced { overlap });
            }
        });
    }
}
