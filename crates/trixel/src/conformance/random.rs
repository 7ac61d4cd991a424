//! Random triangles that sit where tests tie: on voxel corners, faces and centres, in planes, on lines, on points.

/// A small deterministic generator (splitmix64 by Steele, Lea and Flood, 2014).
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// A generator with a seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// A number in `low..=high`.
    pub fn range(&mut self, low: i64, high: i64) -> i64 {
        let span = u64::try_from(high - low).unwrap_or(0).saturating_add(1);
        low + i64::try_from(self.bits() % span).unwrap_or(0)
    }
}

/// How a random triangle is placed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Placement {
    /// Anywhere on the lattice.
    Anywhere,
    /// On multiples of half a voxel, so that faces, edges, corners and centres are all hit.
    HalfVoxels,
    /// On multiples of a quarter of a voxel, at most one lattice step off.
    NearQuarters,
    /// All corners in one plane of constant x, y or z on a half voxel.
    InAxisPlane,
    /// Corners on one line, or all on one point.
    Degenerate,
}

impl Placement {
    /// Every placement.
    pub const ALL: [Self; 5] =
        [Self::Anywhere, Self::HalfVoxels, Self::NearQuarters, Self::InAxisPlane, Self::Degenerate];
}

/// A triangle with lattice coordinates around `[low, high]` on each axis (in voxels), at most `extent` voxels across.
pub fn triangle(random: &mut Random, placement: Placement, low: i64, high: i64, extent: i64) -> [[i64; 3]; 3] {
    const S: i64 = crate::lattice::STEPS_PER_VOXEL as i64;
    let start: [i64; 3] = std::array::from_fn(|_| random.range(low * S, high * S));
    let mut corners: [[i64; 3]; 3] =
        std::array::from_fn(|_| std::array::from_fn(|axis| start[axis] + random.range(0, extent * S)));
    let to_multiple = |c: i64, step: i64| c.div_euclid(step) * step;
    match placement {
        Placement::Anywhere => {}
        Placement::HalfVoxels => corners = corners.map(|v| v.map(|c| to_multiple(c, S / 2))),
        Placement::NearQuarters => {
            corners = corners.map(|v| v.map(|c| to_multiple(c, S / 4) + random.range(-1, 1)));
        }
        Placement::InAxisPlane => {
            corners = corners.map(|v| v.map(|c| to_multiple(c, S / 4)));
            let axis = usize::try_from(random.range(0, 2)).unwrap_or(0);
            let level = to_multiple(corners[0][axis], S / 2) + random.range(-1, 1) * random.range(0, 1);
            for corner in &mut corners {
                corner[axis] = level;
            }
        }
        Placement::Degenerate => {
            let step = [1, S / 4, S / 2, S][usize::try_from(random.range(0, 3)).unwrap_or(0)];
            let [a, direction, _] = corners.map(|v| v.map(|c| to_multiple(c, step)));
            // Points a + t (b - a) with small whole t are exactly collinear.
            let direction: [i64; 3] = std::array::from_fn(|i| (direction[i] - a[i]) / 4);
            let along = |t: i64| -> [i64; 3] { std::array::from_fn(|i| a[i] + t * direction[i]) };
            corners = [a, along(random.range(0, 4)), along(random.range(-1, 4))];
            if random.range(0, 5) == 0 {
                corners = [a; 3];
            }
        }
    }
    corners
}
