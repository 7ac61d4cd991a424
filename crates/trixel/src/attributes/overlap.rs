//! How much of a triangle lies inside a voxel: clipped against the voxel's six faces (I. Sutherland & G. Hodgman,
//! *Reentrant Polygon Clipping*, 1974), in integers; [`super`] has the definition.

use crate::lattice::{STEP_BITS, STEPS_PER_VOXEL};

/// Bits of a coordinate below one voxel.
const BITS: u32 = 10;
/// A voxel's width.
const WIDTH: i64 = 1 << BITS;
/// Each face adds one corner at most; rounding might add more, which are left out.
const MOST_CORNERS: usize = 12;

/// Twice the area of the part of `triangle` inside the closed cube of `voxel`, in units of (2^-10 voxels)^2, rounded
/// down.
pub(super) fn doubled_area(triangle: &[[i64; 3]; 3], voxel: [i64; 3]) -> u32 {
    let mut polygon = Polygon::default();
    for corner in triangle {
        polygon.push(std::array::from_fn(|i| {
            let local = corner[i] - voxel[i] * i64::from(STEPS_PER_VOXEL);
            (local + (1 << (STEP_BITS - BITS - 1))) >> (STEP_BITS - BITS)
        }));
    }
    for axis in 0..3 {
        for (plane, side) in [(0, 1), (WIDTH, -1)] {
            polygon = polygon.clipped(axis, plane, side);
        }
    }
    let corners = polygon.corners();
    let Some((first, rest)) = corners.split_first() else { return 0 };
    let mut sum = [0i64; 3];
    for pair in rest.windows(2) {
        let [u, v] = [pair[0], pair[1]].map(|p| -> [i64; 3] { std::array::from_fn(|i| p[i] - first[i]) });
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            sum[i] += u[j] * v[k] - u[k] * v[j];
        }
    }
    let squared: u64 = sum.iter().map(|c| c.unsigned_abs() * c.unsigned_abs()).sum();
    u32::try_from(squared.isqrt()).unwrap_or(u32::MAX)
}

/// The corners of a convex polygon, one after the other.
#[derive(Default)]
struct Polygon {
    corners: [[i64; 3]; MOST_CORNERS],
    count: usize,
}

impl Polygon {
    fn corners(&self) -> &[[i64; 3]] {
        &self.corners[..self.count]
    }

    fn push(&mut self, corner: [i64; 3]) {
        if let Some(slot) = self.corners.get_mut(self.count) {
            *slot = corner;
            self.count += 1;
        }
    }

    /// The part where `side * (coordinate - plane) >= 0`.
    fn clipped(&self, axis: usize, plane: i64, side: i64) -> Self {
        let mut out = Self::default();
        let corners = self.corners();
        let depth = |corner: &[i64; 3]| side * (corner[axis] - plane);
        for (i, corner) in corners.iter().enumerate() {
            let next = &corners[(i + 1) % corners.len()];
            if depth(corner) >= 0 {
                out.push(*corner);
            }
            // From the inside out, so that an edge is cut in one place whichever way it is walked.
            match (depth(corner), depth(next)) {
                (a, b) if a > 0 && b < 0 => out.push(cut(corner, next, axis, plane, a, a - b)),
                (a, b) if a < 0 && b > 0 => out.push(cut(next, corner, axis, plane, b, b - a)),
                _ => {}
            }
        }
        out
    }
}

/// The point `part / whole` of the way from one corner to another, each coordinate rounded down.
fn cut(from: &[i64; 3], to: &[i64; 3], axis: usize, plane: i64, part: i64, whole: i64) -> [i64; 3] {
    std::array::from_fn(|i| {
        if i == axis {
            return plane;
        }
        let way = to[i] - from[i];
        let moved = match way.checked_mul(part) {
            Some(product) => product.div_euclid(whole),
            // At most as far as `way`, which fits.
            None => i64::try_from((i128::from(way) * i128::from(part)).div_euclid(i128::from(whole))).unwrap_or(way),
        };
        from[i] + moved
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conformance::random::{Placement, Random, triangle};

    const S: i64 = STEPS_PER_VOXEL as i64;

    #[test]
    fn closed_forms() {
        // A plane of constant z through a voxel: the whole face, then half of it.
        let quad_half = |z: i64| [[-9 * S, -9 * S, z], [20 * S, -9 * S, z], [-9 * S, 20 * S, z]];
        assert_eq!(doubled_area(&quad_half(S / 3), [0, 0, 0]), 2 << (2 * BITS));
        assert_eq!(doubled_area(&quad_half(S), [0, 0, 0]), 2 << (2 * BITS), "the closed cube has its faces");
        assert_eq!(doubled_area(&quad_half(S), [0, 0, 1]), 2 << (2 * BITS));
        assert_eq!(doubled_area(&quad_half(S + 64), [0, 0, 0]), 0);
        // The diagonal x + y = 11 cuts the voxel [5, 5] in halves.
        assert_eq!(doubled_area(&quad_half(S / 3), [5, 5, 0]), 1 << (2 * BITS));
        assert_eq!(doubled_area(&[[3, 4, 5]; 3], [0, 0, 0]), 0);
        // The hexagon x + y + z = 3/2 has the area 3 sqrt(3) / 4 of the unit cube's plane.
        let plane = [[90 * S, -45 * S, -87 * S / 2], [-45 * S, 90 * S, -87 * S / 2], [-45 * S, -45 * S, 183 * S / 2]];
        let expected = 2.0 * 0.75 * 3f64.sqrt() * f64::from(1u32 << (2 * BITS));
        let found = f64::from(doubled_area(&plane, [0, 0, 0]));
        assert!((found / expected - 1.0).abs() < 0.003, "{found} {expected}");
    }

    #[test]
    fn the_parts_of_a_triangle_add_up() {
        let mut random = Random::new(3);
        for round in 0..300 {
            let corners = triangle(&mut random, Placement::ALL[round % 3], 0, 3, 4);
            let e = [1, 2]
                .map(|k| -> [f64; 3] { std::array::from_fn(|i| (corners[k][i] - corners[0][i]) as f64 / S as f64) });
            let cross: [f64; 3] = std::array::from_fn(|i| {
                let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                e[0][j] * e[1][k] - e[0][k] * e[1][j]
            });
            let expected = cross.iter().map(|c| c * c).sum::<f64>().sqrt();
            let mut sum = 0.0;
            for x in -1..9 {
                for y in -1..9 {
                    for z in -1..9 {
                        sum += f64::from(doubled_area(&corners, [x, y, z])) / f64::from(1u32 << (2 * BITS));
                    }
                }
            }
            // In a plane of faces both sides have it.
            let doubled = (0..3).any(|i| corners.iter().all(|v| v[i] == corners[0][i] && v[i] % S == 0));
            let expected = if doubled { 2.0 * expected } else { expected };
            assert!((sum - expected).abs() < 0.02 * expected + 0.05, "{sum} {expected} {corners:?}");
        }
    }

    #[test]
    fn corners_at_the_end_of_the_lattice_do_not_overflow() {
        let far = crate::lattice::MAX_COORDINATE;
        let area = doubled_area(&[[-far, -far, 7], [far, -far, 7], [0, far, 7]], [100, 100, 0]);
        assert_eq!(area, 2 << (2 * BITS));
    }
}
