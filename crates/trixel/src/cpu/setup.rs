//! What is computed first of one triangle by itself: local coordinates, edges, normal, and edge constraints.

use super::number::Int;
use super::rule::Rule;
use crate::lattice::STEPS_PER_VOXEL;

/// A triangle in local coordinates: the low corner of its voxel box is the origin, so that numbers stay as small as the
/// triangle.
pub(super) struct Setup<T> {
    /// Corners, in lattice steps.
    pub(super) v: [[i64; 3]; 3],
    /// Edges; edge k starts at corner k.
    e: [[T; 3]; 3],
    /// The normal, not oriented.
    pub(super) normal: [T; 3],
}

/// A constraint `na * a + nb * b >= t` on the voxel indices (a, b) of a projection.
#[derive(Clone, Copy)]
pub(super) struct Constraint<T> {
    pub(super) na: T,
    pub(super) nb: T,
    pub(super) t: T,
}

impl<T: Int> Setup<T> {
    #[inline(always)]
    pub(super) fn new(triangle: &[[i64; 3]; 3], base: [i64; 3]) -> Self {
        // Spelled out: the closures of `map` and `from_fn` are not always inlined, and calls cost more than what they do.
        let local = |p: [i64; 3]| {
            let steps = i64::from(STEPS_PER_VOXEL);
            [p[0] - base[0] * steps, p[1] - base[1] * steps, p[2] - base[2] * steps]
        };
        let v = [local(triangle[0]), local(triangle[1]), local(triangle[2])];
        let edge = |v: [i64; 3], w: [i64; 3]| [T::from(w[0] - v[0]), T::from(w[1] - v[1]), T::from(w[2] - v[2])];
        let e = [edge(v[0], v[1]), edge(v[1], v[2]), edge(v[2], v[0])];
        let cross = |i: usize, j: usize| e[0][i] * e[1][j] - e[0][j] * e[1][i];
        Self { v, e, normal: [cross(1, 2), cross(2, 0), cross(0, 1)] }
    }

    /// The constraints of the three edges in the projection to the axes (a, b).
    #[inline(always)]
    pub(super) fn projection<R: Rule>(&self, rule: &R, a: usize, b: usize) -> [Constraint<T>; 3] {
        // With c the third axis, the projection's area is +-N_c; inward normals point left when it turns left.
        let c = 3 - a - b;
        let in_order = b == (a + 1) % 3;
        let turns_right = (self.normal[c] < T::from(0)) == in_order;
        let edge = |k: usize| {
            let e = &self.e[k];
            let (na, nb) = if turns_right { (e[b], -e[a]) } else { (-e[b], e[a]) };
            let nv = na * T::from(self.v[k][a]) + nb * T::from(self.v[k][b]);
            Constraint { na, nb, t: rule.edge(na, nb, nv) }
        };
        [edge(0), edge(1), edge(2)]
    }

    /// The normal turned so that it points up (or is level), and the plane's bounds with it.
    #[inline(always)]
    pub(super) fn plane<R: Rule>(&self, rule: &R) -> ([T; 3], T, T) {
        let n = self.normal;
        let up = if n[2] < T::from(0) { [-n[0], -n[1], -n[2]] } else { n };
        let (d1, d2) = rule.plane(up, self.v[0]);
        (up, d1, d2)
    }
}
