//! Triangles whose box is at most two voxels along each axis: eight at a time, one a vector lane.
//!
//! Everything is f64 holding integers below 2^53, so it is exact: corners are below 2^17.1 steps from the box's corner,
//! normals below 2^34, and the plane's terms below 3 * 2^51.2.

use fearless_simd::{Simd, f64x8, mask64x8, prelude::*};

use super::rule::SurfaceRule;
use super::sink::Sink;
use crate::lattice::{STEP_BITS, STEPS_PER_VOXEL};

/// Triangles in one batch.
pub(super) const LANES: usize = 8;

/// S, the lattice steps of a voxel.
const S: f64 = STEPS_PER_VOXEL as f64;

/// Triangles that wait until there are enough for all lanes.
pub(super) struct Batch<const COORDINATES: usize> {
    /// Corners relative to the low corner of the voxel box: corner k's axis i is row `k * axes + i`.
    corners: [[f64; LANES]; COORDINATES],
    /// The low corner of each box, in voxels, and how many voxels it has along each axis, less one.
    boxes: [([i64; 3], [i64; 3]); LANES],
    count: usize,
}

impl<const COORDINATES: usize> Batch<COORDINATES> {
    pub(super) fn new() -> Self {
        Self { corners: [[0.0; LANES]; COORDINATES], boxes: [([0; 3], [0; 3]); LANES], count: 0 }
    }
}

/// Boxes of two voxels along every axis (or, for rules without a shortcut for flat boxes, of one or two).
pub(super) type Cubes = Batch<9>;

/// Boxes of two voxels along two axes and one along the third.
pub(super) type Flats = Batch<6>;

/// Steps from the box's corner, as a float.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "below 2^18")]
fn local(coordinate: i64, low: i64) -> f64 {
    f64::from((coordinate - (low << STEP_BITS)) as i32)
}

impl Cubes {
    /// Adds a triangle; `true` when the batch is full.
    #[inline(always)]
    pub(super) fn push(&mut self, triangle: &[[i64; 3]; 3], low: [i64; 3], extent: [i64; 3]) -> bool {
        let lane = self.count % LANES;
        for k in 0..3 {
            for i in 0..3 {
                self.corners[3 * k + i][lane] = local(triangle[k][i], low[i]);
            }
        }
        self.boxes[lane] = (low, extent);
        self.count += 1;
        self.count == LANES
    }

    /// Sends the voxels of all waiting triangles to the sink.
    #[inline(always)]
    pub(super) fn flush<V: Simd, R: SurfaceRule>(&mut self, simd: V, rule: &R, sink: &mut impl Sink) {
        if self.count == 0 {
            return;
        }
        let c = &self.corners;
        let v =
            [load(simd, [&c[0], &c[1], &c[2]]), load(simd, [&c[3], &c[4], &c[5]]), load(simd, [&c[6], &c[7], &c[8]])];
        let e = [between(v[0], v[1]), between(v[1], v[2]), between(v[2], v[0])];
        let n = [cross(&e, 1, 2), cross(&e, 2, 0), cross(&e, 0, 1)];

        // In each projection, the least of the three edge functions at the four voxels (a, b).
        let xy = edges_at_four(simd, rule, pick(&v, 0, 1), pick(&e, 0, 1), n[2]);
        let yz = edges_at_four(simd, rule, pick(&v, 1, 2), pick(&e, 1, 2), n[0]);
        let zx = edges_at_four(simd, rule, pick(&v, 2, 0), pick(&e, 2, 0), n[1]);

        // The plane: between -reach_down and +reach_up of N . (S p - v0).
        let (above, below) = rule.plane_reach(simd, n);
        let at_origin = -(n[0] * v[0][0] + n[1] * v[0][1] + n[2] * v[0][2]);
        let step = [n[0] * S, n[1] * S, n[2] * S];
        let (upper, lower) = (at_origin + above, -at_origin - below);

        let zero = f64x8::splat(simd, 0.0);
        let mut bits = [0u64; 8];
        let mut index = 0;
        for x in 0..2 {
            for y in 0..2 {
                for z in 0..2 {
                    let mut offset = zero;
                    for (i, on) in [x, y, z].into_iter().enumerate() {
                        if on == 1 {
                            offset += step[i];
                        }
                    }
                    let plane = (upper + offset).min(lower - offset);
                    let least = xy[2 * x + y].min(yz[2 * y + z]).min(zx[2 * z + x]).min(plane);
                    bits[index] = least.simd_ge(zero).to_bitmask();
                    index += 1;
                }
            }
        }
        let masks = transpose(bits);
        for lane in 0..self.count {
            let (low, extent) = self.boxes[lane];
            sink.cube(low, u64::from(masks[lane]) & within(extent));
        }
        self.count = 0;
    }
}

impl Flats {
    /// Adds a triangle whose box is one voxel thick along one axis; `true` when the batch is full.
    #[inline(always)]
    pub(super) fn push(&mut self, triangle: &[[i64; 3]; 3], low: [i64; 3], extent: [i64; 3]) -> bool {
        let lane = self.count % LANES;
        let (a, b) = flat_axes(extent);
        for k in 0..3 {
            self.corners[2 * k][lane] = local(triangle[k][a], low[a]);
            self.corners[2 * k + 1][lane] = local(triangle[k][b], low[b]);
        }
        self.boxes[lane] = (low, extent);
        self.count += 1;
        self.count == LANES
    }

    /// Sends the voxels of all waiting triangles to the sink: strictly inside their layer, they meet a voxel where their
    /// projections meet.
    #[inline(always)]
    pub(super) fn flush<V: Simd, R: SurfaceRule>(&mut self, simd: V, rule: &R, sink: &mut impl Sink) {
        if self.count == 0 {
            return;
        }
        let c = &self.corners;
        let v = [load(simd, [&c[0], &c[1]]), load(simd, [&c[2], &c[3]]), load(simd, [&c[4], &c[5]])];
        let e = [between(v[0], v[1]), between(v[1], v[2]), between(v[2], v[0])];
        let area = cross(&e, 0, 1);
        let zero = f64x8::splat(simd, 0.0);
        let four = edges_at_four(simd, rule, v, e, area);
        let mut bits = [0u64; 8];
        for i in 0..4 {
            bits[i] = four[i].simd_ge(zero).to_bitmask();
        }
        let masks = transpose(bits);
        for lane in 0..self.count {
            let (low, extent) = self.boxes[lane];
            sink.cube(low, spread_flat(masks[lane], extent));
        }
        self.count = 0;
    }
}

// The vector helpers are functions, not closures, because only functions can be forced inline everywhere, and a vector
// operation outside a function compiled for the vector unit is a call.

/// One corner of every triangle.
#[inline(always)]
fn load<V: Simd, const AXES: usize>(simd: V, rows: [&[f64; LANES]; AXES]) -> [f64x8<V>; AXES] {
    let mut corner = [f64x8::splat(simd, 0.0); AXES];
    for i in 0..AXES {
        corner[i] = f64x8::from_slice(simd, rows[i]);
    }
    corner
}

/// `b - a`.
#[inline(always)]
fn between<V: Simd, const AXES: usize>(a: [f64x8<V>; AXES], b: [f64x8<V>; AXES]) -> [f64x8<V>; AXES] {
    let mut edge = b;
    for i in 0..AXES {
        edge[i] = b[i] - a[i];
    }
    edge
}

/// The component of the normal across the axes i and j.
#[inline(always)]
fn cross<V: Simd, const AXES: usize>(e: &[[f64x8<V>; AXES]; 3], i: usize, j: usize) -> f64x8<V> {
    e[0][i] * e[1][j] - e[0][j] * e[1][i]
}

/// The components a and b of three vectors.
#[inline(always)]
fn pick<V: Simd>(of: &[[f64x8<V>; 3]; 3], a: usize, b: usize) -> [[f64x8<V>; 2]; 3] {
    [[of[0][a], of[0][b]], [of[1][a], of[1][b]], [of[2][a], of[2][b]]]
}

/// The two axes along which a flat box has two voxels, ascending.
#[inline(always)]
fn flat_axes(extent: [i64; 3]) -> (usize, usize) {
    if extent[2] == 0 {
        (0, 1)
    } else if extent[1] == 0 {
        (0, 2)
    } else {
        (1, 2)
    }
}

/// Bit `2 a + b` of a flat box to bit `4 x + 2 y + z`.
#[inline(always)]
fn spread_flat(mask: u8, extent: [i64; 3]) -> u64 {
    let mask = u64::from(mask & 0xF);
    if extent[2] == 0 {
        // (x, y): bits 0, 2, 4, 6.
        (mask & 1) | (mask & 2) << 1 | (mask & 4) << 2 | (mask & 8) << 3
    } else if extent[1] == 0 {
        // (x, z): bits 0, 1, 4, 5.
        (mask & 3) | (mask & 0xC) << 2
    } else {
        // (y, z): bits 0 to 3.
        mask
    }
}

/// The voxels of a box of one or two voxels along each axis, bit `4 x + 2 y + z`.
#[inline(always)]
fn within(extent: [i64; 3]) -> u64 {
    let keep = |i: usize, low: u64| if extent[i] == 0 { low } else { 0xFF };
    keep(0, 0x0F) & keep(1, 0x33) & keep(2, 0x55)
}

/// The least of three edge functions at the voxels (0, 0), (0, 1), (1, 0), (1, 1); not negative where all hold.
#[inline(always)]
fn edges_at_four<V: Simd, R: SurfaceRule>(
    simd: V,
    rule: &R,
    v: [[f64x8<V>; 2]; 3],
    e: [[f64x8<V>; 2]; 3],
    area: f64x8<V>,
) -> [f64x8<V>; 4] {
    let zero = f64x8::splat(simd, 0.0);
    // Inward normals point left of the edges when the projection turns left.
    let turns_right: mask64x8<V> = area.simd_lt(zero);
    let mut least = [zero; 4];
    for k in 0..3 {
        let na = turns_right.select(e[k][1], -e[k][1]);
        let nb = turns_right.select(-e[k][0], e[k][0]);
        let at_origin = rule.edge_reach(simd, na, nb) - (na * v[k][0] + nb * v[k][1]);
        let (step_a, step_b) = (na * S, nb * S);
        let at = [at_origin, at_origin + step_b, at_origin + step_a, at_origin + step_a + step_b];
        for i in 0..4 {
            least[i] = if k == 0 { at[i] } else { least[i].min(at[i]) };
        }
    }
    least
}

/// Lane masks of eight voxels to voxel masks of eight lanes (the transposition of an 8 x 8 bit matrix).
#[inline(always)]
fn transpose(rows: [u64; 8]) -> [u8; 8] {
    let mut m = 0u64;
    for (i, row) in rows.into_iter().enumerate() {
        m |= (row & 0xFF) << (8 * i);
    }
    // Swap ever larger blocks across the diagonal.
    for (shift, mask) in [(7, 0x00AA_00AA_00AA_00AA), (14, 0x0000_CCCC_0000_CCCC), (28, 0x0000_0000_F0F0_F0F0u64)] {
        let t = (m ^ (m >> shift)) & mask;
        m ^= t ^ (t << shift);
    }
    m.to_le_bytes()
}
