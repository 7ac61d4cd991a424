//! The point of a triangle nearest to a voxel's centre, as barycentric weights, and how far away it is.
//!
//! The regions are those of C. Ericson, *Real-Time Collision Detection*, 2005, section 5.1.5, decided exactly in
//! integers on corners that are rounded to `2^s` steps; [`super`] has the definition.

use crate::cpu::number::{Int, SMALL_EXTENT};
use crate::lattice::{STEP_BITS, STEPS_PER_VOXEL};

const S: i64 = STEPS_PER_VOXEL as i64;

/// Bits of a weight: three of them sum to `1 << WEIGHT_BITS`.
pub(super) const WEIGHT_BITS: u32 = 16;

/// Barycentric weights of a point of a triangle, none negative, that sum to `1 << WEIGHT_BITS`.
pub(super) type Weights = [u32; 3];

/// The weight of the whole.
const ONE: u32 = 1 << WEIGHT_BITS;

/// A triangle whose nearest points are asked for.
pub(super) struct Nearest {
    /// Corners in steps from the low corner of voxel `base`.
    corners: [[i64; 3]; 3],
    base: [i64; 3],
    shift: u32,
    /// The first corner and the two edges from it, in units of `2^shift` steps.
    reduced: [[i64; 3]; 3],
    /// Whether 64 bits are enough.
    small: bool,
}

/// An integer whose ratios can be had.
trait Ratio: Int {
    /// `numerator / self` in weights, rounded; 0 when `self` is not positive.
    fn weight(self, numerator: Self) -> u32;
}

macro_rules! ratio {
    ($int:ty, $bits:expr) => {
        impl Ratio for $int {
            fn weight(self, numerator: Self) -> u32 {
                if self <= 0 {
                    return 0;
                }
                let shift = ($bits - self.leading_zeros()).saturating_sub(31);
                let whole = u64::try_from(self >> shift).unwrap_or(1);
                let part = u64::try_from(numerator.clamp(0, self) >> shift).unwrap_or(0);
                let twice = (part << (WEIGHT_BITS + 1)) / whole;
                u32::try_from((twice + 1) >> 1).unwrap_or(ONE).min(ONE)
            }
        }
    };
}
ratio!(i64, i64::BITS);
ratio!(i128, i128::BITS);

impl Nearest {
    /// For voxels that are at most `reach` steps from the triangle's own along any axis.
    pub(super) fn new(triangle: &[[i64; 3]; 3], reach: i64) -> Self {
        let [a, b, c] = triangle;
        let low: [i64; 3] = std::array::from_fn(|i| a[i].min(b[i]).min(c[i]));
        let high: [i64; 3] = std::array::from_fn(|i| a[i].max(b[i]).max(c[i]));
        let longest = (0..3).map(|i| high[i] - low[i]).max().unwrap_or(0);
        let bits = i64::BITS - longest.leading_zeros();
        let shift = bits.saturating_sub(13).clamp(2, 9).max(bits.saturating_sub(30));
        let base = low.map(|c| c >> STEP_BITS);
        let corners = triangle.map(|v| std::array::from_fn(|i| v[i] - base[i] * S));
        let [a, b, c] = corners.map(|v: [i64; 3]| v.map(|c| (c + (1 << (shift - 1))) >> shift));
        let edge = |w: [i64; 3]| std::array::from_fn(|i| w[i] - a[i]);
        // With edges below 2^13 units and centres within 2^16 of them, products of four lengths stay below 2^62.
        let small = longest < SMALL_EXTENT * S && reach < 2 * S;
        Self { corners, base, shift, reduced: [a, edge(b), edge(c)], small }
    }

    /// The weights of the point nearest to the centre of `voxel`.
    pub(super) fn weights(&self, voxel: [i64; 3]) -> Weights {
        if self.small { self.weights_in::<i64>(voxel) } else { self.weights_in::<i128>(voxel) }
    }

    fn weights_in<T: Ratio>(&self, voxel: [i64; 3]) -> Weights {
        let [a, ab, ac] = self.reduced;
        let ap: [i64; 3] = std::array::from_fn(|i| (((voxel[i] - self.base[i]) * S + S / 2) >> self.shift) - a[i]);
        let dot = |u: [i64; 3], v: [i64; 3]| {
            T::from(u[0]) * T::from(v[0]) + T::from(u[1]) * T::from(v[1]) + T::from(u[2]) * T::from(v[2])
        };
        let zero = T::from(0);
        let (ab_ab, ab_ac, ac_ac) = (dot(ab, ab), dot(ab, ac), dot(ac, ac));
        // Along both edges from each corner: a, then b, then c.
        let (a1, a2) = (dot(ab, ap), dot(ac, ap));
        let (b1, b2) = (a1 - ab_ab, a2 - ab_ac);
        let (c1, c2) = (a1 - ab_ac, a2 - ac_ac);
        if a1 <= zero && a2 <= zero {
            return [ONE, 0, 0];
        }
        if b1 >= zero && b2 <= b1 {
            return [0, ONE, 0];
        }
        if c2 >= zero && c1 <= c2 {
            return [0, 0, ONE];
        }
        let for_c = a1 * b2 - b1 * a2;
        // An edge without length is no edge: another one has its place.
        if for_c <= zero && a1 >= zero && b1 <= zero && ab_ab > zero {
            let b = ab_ab.weight(a1);
            return [ONE - b, b, 0];
        }
        let for_b = c1 * a2 - a1 * c2;
        if for_b <= zero && a2 >= zero && c2 <= zero && ac_ac > zero {
            let c = ac_ac.weight(a2);
            return [ONE - c, 0, c];
        }
        let for_a = b1 * c2 - c1 * b2;
        let (towards_c, towards_b) = (b2 - b1, c1 - c2);
        if for_a <= zero && towards_c >= zero && towards_b >= zero {
            let c = (towards_c + towards_b).weight(towards_c);
            return [0, ONE - c, c];
        }
        let all = for_a + for_b + for_c;
        let b = all.weight(for_b);
        let c = all.weight(for_c).min(ONE - b);
        [ONE - b - c, b, c]
    }

    /// The squared distance between the centre of `voxel` and the point with `weights`, in units of (2^-12 voxels)^2;
    /// `u32::MAX` from 16 voxels on.
    pub(super) fn distance(&self, voxel: [i64; 3], weights: Weights) -> u32 {
        let mut squared = 0u64;
        for i in 0..3 {
            let centre = (voxel[i] - self.base[i]) * S + S / 2;
            let sum: i64 = (0..3).map(|k| i64::from(weights[k]) * (self.corners[k][i] - centre)).sum();
            let offset = ((sum + (1 << 19)) >> 20).unsigned_abs();
            squared = squared.saturating_add(offset.saturating_mul(offset));
        }
        u32::try_from(squared).unwrap_or(u32::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conformance::random::{Placement, Random, triangle};

    /// The nearest point by floats, from a fine net over the triangle's plane, edges and corners.
    fn nearest_by_floats(corners: [[f64; 3]; 3], p: [f64; 3]) -> f64 {
        let sub = |a: [f64; 3], b: [f64; 3]| -> [f64; 3] { std::array::from_fn(|i| a[i] - b[i]) };
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let on_segment = |a: [f64; 3], b: [f64; 3]| {
            let e = sub(b, a);
            let t = if dot(e, e) > 0.0 { (dot(sub(p, a), e) / dot(e, e)).clamp(0.0, 1.0) } else { 0.0 };
            let d = sub(p, std::array::from_fn(|i| a[i] + t * e[i]));
            dot(d, d).sqrt()
        };
        let [a, b, c] = corners;
        let edges = on_segment(a, b).min(on_segment(b, c)).min(on_segment(c, a));
        let (u, v, w) = (sub(b, a), sub(c, a), sub(p, a));
        let (uu, uv, vv, uw, vw) = (dot(u, u), dot(u, v), dot(v, v), dot(u, w), dot(v, w));
        let all = uu * vv - uv * uv;
        let (s, t) = ((vv * uw - uv * vw) / all, (uu * vw - uv * uw) / all);
        if all > 0.0 && s >= 0.0 && t >= 0.0 && s + t <= 1.0 {
            let d = sub(w, std::array::from_fn(|i| s * u[i] + t * v[i]));
            return dot(d, d).sqrt().min(edges);
        }
        edges
    }

    #[test]
    fn no_point_is_nearer() {
        let mut random = Random::new(11);
        for round in 0..40_000 {
            let extent = [1, 2, 12, 60, 900][round / 5 % 5];
            let corners = triangle(&mut random, Placement::ALL[round % 5], 0, 4, extent);
            // A voxel about the triangle's box.
            let voxel: [i64; 3] = std::array::from_fn(|i| {
                let values = corners.map(|v| v[i] >> STEP_BITS);
                random.range(*values.iter().min().unwrap() - 1, *values.iter().max().unwrap() + 1)
            });
            let nearest = Nearest::new(&corners, 0);
            let weights = nearest.weights(voxel);
            assert_eq!(weights.iter().sum::<u32>(), ONE);
            assert_eq!(weights, nearest.weights_in::<i128>(voxel), "{corners:?} {voxel:?}");
            let float = corners.map(|v| v.map(|c| c as f64 / S as f64));
            let centre = voxel.map(|c| c as f64 + 0.5);
            let point: [f64; 3] =
                std::array::from_fn(|i| (0..3).map(|k| f64::from(weights[k]) / 65536.0 * float[k][i]).sum());
            let found = (0..3).map(|i| (point[i] - centre[i]).powi(2)).sum::<f64>().sqrt();
            let best = nearest_by_floats(float, centre);
            let tolerance = 4.0 * extent as f64 / 8192.0 + 1e-3;
            assert!(found <= best + tolerance && found >= best - 1e-9, "{found} {best} {corners:?} {voxel:?}");
            let distance = f64::from(nearest.distance(voxel, weights)).sqrt() / 4096.0;
            if found < 15.0 {
                assert!((distance - found).abs() < 1e-3, "{distance} {found}");
            }
        }
    }

    #[test]
    fn weights_are_exact_where_they_can_be() {
        let at = |x: i64, y: i64| [x * S / 2, y * S / 2, S / 2];
        // A right triangle over centres: (0.5, 0.5), (8.5, 0.5), (0.5, 8.5).
        let nearest = Nearest::new(&[at(1, 1), at(17, 1), at(1, 17)], 0);
        assert_eq!(nearest.weights([0, 0, 0]), [ONE, 0, 0]);
        assert_eq!(nearest.weights([4, 0, 0]), [ONE / 2, ONE / 2, 0]);
        assert_eq!(nearest.weights([2, 4, 0]), [ONE / 4, ONE / 4, ONE / 2]);
        assert_eq!(nearest.weights([8, 8, 3]), [0, ONE / 2, ONE / 2]);
        assert_eq!(nearest.weights([-5, -5, 0]), [ONE, 0, 0]);
        assert_eq!(nearest.distance([2, 2, 1], nearest.weights([2, 2, 1])), 1 << 24);
    }

    #[test]
    fn the_largest_triangles_do_not_overflow() {
        let far = crate::lattice::MAX_COORDINATE;
        let nearest = Nearest::new(&[[-far, -far, -far], [far, -far, far], [-far, far, far]], 1024 * S);
        let weights = nearest.weights([16_000, 3, 32_767]);
        assert_eq!(weights.iter().sum::<u32>(), ONE);
        assert!(weights.iter().all(|&w| w > 0));
    }
}
