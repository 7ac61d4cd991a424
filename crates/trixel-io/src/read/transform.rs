//! Affine maps in `f64`: where the nodes of a scene put their meshes.

/// An affine map: rows of a 3x4 matrix applied to column vectors `[x, y, z, 1]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Affine(pub(super) [[f64; 4]; 3]);

impl Affine {
    /// Changes nothing.
    pub(super) const IDENTITY: Self = Self([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]);

    /// Moves by `t`.
    pub(super) fn translation(t: [f64; 3]) -> Self {
        let mut map = Self::IDENTITY;
        for (row, t) in map.0.iter_mut().zip(t) {
            row[3] = t;
        }
        map
    }

    /// Scales along the axes.
    pub(super) fn scale(s: [f64; 3]) -> Self {
        Self([[s[0], 0.0, 0.0, 0.0], [0.0, s[1], 0.0, 0.0], [0.0, 0.0, s[2], 0.0]])
    }

    /// Rotates by the quaternion `[x, y, z, w]`, made a unit one first; one of no length does not rotate.
    pub(super) fn rotation(quaternion: [f64; 4]) -> Self {
        let length = quaternion.iter().map(|c| c * c).sum::<f64>().sqrt();
        if length == 0.0 {
            return Self::IDENTITY;
        }
        let [x, y, z, w] = quaternion.map(|c| c / length);
        Self([
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w), 0.0],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w), 0.0],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y), 0.0],
        ])
    }

    /// This map after `first`.
    pub(super) fn after(&self, first: &Self) -> Self {
        let (a, b) = (&self.0, &first.0);
        Self(std::array::from_fn(|row| {
            std::array::from_fn(|column| {
                let linear = a[row][0] * b[0][column] + a[row][1] * b[1][column] + a[row][2] * b[2][column];
                if column == 3 { linear + a[row][3] } else { linear }
            })
        }))
    }

    /// Where the point `p` goes.
    pub(super) fn point(&self, p: [f64; 3]) -> [f64; 3] {
        self.0.map(|row| row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3])
    }

    /// The determinant of the linear part: negative when the map mirrors.
    pub(super) fn determinant(&self) -> f64 {
        let cofactors = self.cofactors();
        (0..3).map(|column| self.0[0][column] * cofactors[0][column]).sum()
    }

    /// The map of normals, up to their length: the inverse transpose times the determinant's absolute value. It exists
    /// for maps that flatten space too.
    pub(super) fn normals(&self) -> [[f64; 3]; 3] {
        let sign = if self.determinant() < 0.0 { -1.0 } else { 1.0 };
        self.cofactors().map(|row| row.map(|c| c * sign))
    }

    /// Whether the linear part changes nothing.
    pub(super) fn is_translation(&self) -> bool {
        (0..3).all(|row| (0..3).all(|column| self.0[row][column] == Self::IDENTITY.0[row][column]))
    }

    fn cofactors(&self) -> [[f64; 3]; 3] {
        let m = &self.0;
        std::array::from_fn(|row| {
            std::array::from_fn(|column| {
                let (r1, r2) = ((row + 1) % 3, (row + 2) % 3);
                let (c1, c2) = ((column + 1) % 3, (column + 2) % 3);
                m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1]
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identity_is_exact() {
        let p = [0.1, -3.3e-17, 7.0e12];
        assert_eq!(Affine::IDENTITY.point(p), p);
        assert_eq!(Affine::rotation([0.0, 0.0, 0.0, 1.0]), Affine::IDENTITY);
    }

    #[test]
    fn after_applies_the_argument_first() {
        let map = Affine::translation([1.0, 0.0, 0.0]).after(&Affine::scale([2.0, 2.0, 2.0]));
        assert_eq!(map.point([3.0, 1.0, 0.0]), [7.0, 2.0, 0.0]);
    }

    #[test]
    fn quarter_turn_about_z() {
        let half = 0.5f64.sqrt();
        let p = Affine::rotation([0.0, 0.0, half, half]).point([1.0, 0.0, 0.0]);
        assert!((p[0]).abs() < 1e-15 && (p[1] - 1.0).abs() < 1e-15 && p[2] == 0.0, "{p:?}");
    }

    #[test]
    fn normals_stay_square_to_a_surface_that_is_stretched() {
        // The plane x + y = 0 with normal (1, 1, 0), stretched by 2 along x, is x + 2y = 0.
        let m = Affine::scale([2.0, 1.0, 1.0]).normals();
        let n = m.map(|row| row[0] + row[1]);
        assert_eq!(n[1] / n[0], 2.0);
        assert!(n[0] > 0.0);
    }

    #[test]
    fn mirror_keeps_normals_outward() {
        let mirror = Affine::scale([-1.0, 1.0, 1.0]);
        assert!(mirror.determinant() < 0.0);
        assert_eq!(mirror.normals()[1][1], 1.0);
        assert_eq!(mirror.normals()[0][0], -1.0);
    }
}
