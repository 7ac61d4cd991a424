//! Triangles whose box is at most four voxels along each axis: eight at a time, one a vector lane.
//!
//! Everything is f64 holding integers below 2^53, so it is exact: corners are below 2^18 steps from the box's corner,
//! edge functions below 2^38, normals below 2^36, and the plane's terms below 2^53 ([`SurfaceRule::plane_bounds`]).

use fearless_simd::{Simd, f64x8, mask64x8, prelude::*};

use super::kernel::VoxelBox;
use super::rule::SurfaceRule;
use super::sink::Sink;
use crate::lattice::{STEP_BITS, STEPS_PER_VOXEL};

/// Triangles in one batch.
const LANES: usize = 8;

/// S, the lattice steps of a voxel.
const S: f64 = STEPS_PER_VOXEL as f64;

/// Boxes of at most `SIDE` voxels along every axis, waiting until there are enough for all lanes.
pub(super) struct Cubes<const SIDE: usize> {
    /// Corners relative to the low corner of the voxel box: corner k's axis i is row `3 k + i`.
    corners: [[f64; LANES]; 9],
    boxes: Boxes,
}

/// Boxes of at most `SIDE` voxels along two axes and one along the third.
pub(super) struct Flats<const SIDE: usize> {
    /// As in [`Cubes`], for the two axes of [`flat_axes`]: corner k's axis i is row `2 k + i`.
    corners: [[f64; LANES]; 6],
    boxes: Boxes,
}

/// The boxes of the triangles that wait.
struct Boxes {
    low: [[i64; 3]; LANES],
    /// Voxels along each axis, less one.
    extent: [[i64; 3]; LANES],
    /// The voxels of the box inside the clip, as bits of a cube.
    keep: [u64; LANES],
    count: usize,
}

impl Boxes {
    const EMPTY: Self = Self { low: [[0; 3]; LANES], extent: [[0; 3]; LANES], keep: [0; LANES], count: 0 };

    /// Adds a box and gives its lane.
    #[inline(always)]
    fn push(&mut self, tiny: &TinyBox, keep: u64) -> usize {
        let lane = self.count % LANES;
        self.low[lane] = tiny.low;
        self.extent[lane] = tiny.extent;
        self.keep[lane] = keep;
        self.count += 1;
        lane
    }
}

/// The voxel box of a tiny triangle.
pub(super) struct TinyBox {
    pub(super) low: [i64; 3],
    /// Voxels along each axis, less one: at most 3.
    pub(super) extent: [i64; 3],
    /// The first and the last voxel from `low` on that are inside the clip.
    kept: [[i64; 3]; 2],
}

impl TinyBox {
    /// A box that meets `clip`.
    #[inline(always)]
    pub(super) fn new(around: &VoxelBox, clip: &VoxelBox) -> Self {
        let (low, extent) = (around.low, around.extent());
        let from = |i: usize| (clip.low[i] - low[i]).max(0);
        let to = |i: usize| (clip.high[i] - low[i]).min(extent[i]);
        Self { low, extent, kept: [[from(0), from(1), from(2)], [to(0), to(1), to(2)]] }
    }

    /// The voxels inside the clip, in the bits of a cube.
    #[inline(always)]
    pub(super) fn keep<const SIDE: usize>(&self) -> u64 {
        /// Bit 0 of each of `count` groups of `width` bits.
        const fn every(width: usize, count: usize) -> u64 {
            let mut mask = 0;
            let mut i = 0;
            while i < count {
                mask |= 1 << (width * i);
                i += 1;
            }
            mask
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to SIDE - 1")]
        let [from, to] = [self.kept[0].map(|i| i as usize), self.kept[1].map(|i| i as usize + 1)];
        let range = |axis: usize, step: usize| row_mask(step * to[axis]) & !row_mask(step * from[axis]);
        range(0, SIDE * SIDE) & (range(1, SIDE) * every(SIDE * SIDE, SIDE)) & (range(2, 1) * every(SIDE, SIDE * SIDE))
    }
}

/// Steps from the box's corner, as a float.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "below 2^18")]
fn local(coordinate: i64, low: i64) -> f64 {
    f64::from((coordinate - (low << STEP_BITS)) as i32)
}

impl<const SIDE: usize> Cubes<SIDE> {
    pub(super) fn new() -> Self {
        Self { corners: [[0.0; LANES]; 9], boxes: Boxes::EMPTY }
    }

    /// Adds a triangle; `true` when the batch is full.
    #[inline(always)]
    pub(super) fn push(&mut self, triangle: &[[i64; 3]; 3], tiny: &TinyBox) -> bool {
        let lane = self.boxes.push(tiny, tiny.keep::<SIDE>());
        for k in 0..3 {
            for i in 0..3 {
                self.corners[3 * k + i][lane] = local(triangle[k][i], tiny.low[i]);
            }
        }
        self.boxes.count == LANES
    }

    /// Sends the voxels of all waiting triangles to the sink.
    #[inline(always)]
    pub(super) fn flush<V: Simd, R: SurfaceRule>(&mut self, simd: V, rule: &R, sink: &mut impl Sink) {
        if self.boxes.count == 0 {
            return;
        }
        let c = &self.corners;
        let v =
            [load(simd, [&c[0], &c[1], &c[2]]), load(simd, [&c[3], &c[4], &c[5]]), load(simd, [&c[6], &c[7], &c[8]])];
        let e = [between(v[0], v[1]), between(v[1], v[2]), between(v[2], v[0])];
        let n = [cross(&e, 1, 2), cross(&e, 2, 0), cross(&e, 0, 1)];

        // In each projection, the lanes in which the voxel (a, b) passes.
        let xy = passing::<V, R, SIDE>(simd, rule, pick(&v, 0, 1), pick(&e, 0, 1), n[2]);
        let yz = passing::<V, R, SIDE>(simd, rule, pick(&v, 1, 2), pick(&e, 1, 2), n[0]);
        let zx = passing::<V, R, SIDE>(simd, rule, pick(&v, 2, 0), pick(&e, 2, 0), n[1]);

        // The plane: d1 <= N . p <= d2.
        let (d1, d2) = rule.plane_bounds(simd, n, v[0]);
        let zero = f64x8::splat(simd, 0.0);
        let mut lanes_of_voxel = [0u8; 64];
        let mut at_x = zero;
        for x in 0..SIDE {
            let mut at_y = at_x;
            for y in 0..SIDE {
                let mut at = at_y;
                for z in 0..SIDE {
                    let plane = (at - d1).min(d2 - at).simd_ge(zero).to_bitmask();
                    let lanes = xy[x][y] & yz[y][z] & zx[z][x] & narrow(plane);
                    lanes_of_voxel[(x * SIDE + y) * SIDE + z] = lanes;
                    at += n[2];
                }
                at_y += n[1];
            }
            at_x += n[0];
        }
        let voxels_of_lane = transpose(&lanes_of_voxel, SIDE * SIDE * SIDE);
        for lane in 0..self.boxes.count {
            sink.cube::<SIDE>(self.boxes.low[lane], voxels_of_lane[lane] & self.boxes.keep[lane]);
        }
        self.boxes.count = 0;
    }
}

impl<const SIDE: usize> Flats<SIDE> {
    pub(super) fn new() -> Self {
        Self { corners: [[0.0; LANES]; 6], boxes: Boxes::EMPTY }
    }

    /// Adds a triangle whose box is one voxel thick along one axis; `true` when the batch is full.
    #[inline(always)]
    pub(super) fn push(&mut self, triangle: &[[i64; 3]; 3], tiny: &TinyBox) -> bool {
        let lane = self.boxes.push(tiny, tiny.keep::<SIDE>());
        let (a, b) = flat_axes(tiny.extent);
        for k in 0..3 {
            self.corners[2 * k][lane] = local(triangle[k][a], tiny.low[a]);
            self.corners[2 * k + 1][lane] = local(triangle[k][b], tiny.low[b]);
        }
        self.boxes.count == LANES
    }

    /// Sends the voxels of all waiting triangles to the sink: strictly inside their layer, they meet a voxel where their
    /// projections meet.
    #[inline(always)]
    pub(super) fn flush<V: Simd, R: SurfaceRule>(&mut self, simd: V, rule: &R, sink: &mut impl Sink) {
        if self.boxes.count == 0 {
            return;
        }
        let c = &self.corners;
        let v = [load(simd, [&c[0], &c[1]]), load(simd, [&c[2], &c[3]]), load(simd, [&c[4], &c[5]])];
        let e = [between(v[0], v[1]), between(v[1], v[2]), between(v[2], v[0])];
        let area = cross(&e, 0, 1);
        let passing = passing::<V, R, SIDE>(simd, rule, v, e, area);
        let mut lanes_of_voxel = [0u8; 64];
        for a in 0..SIDE {
            for b in 0..SIDE {
                lanes_of_voxel[a * SIDE + b] = passing[a][b];
            }
        }
        let voxels_of_lane = transpose(&lanes_of_voxel, SIDE * SIDE);
        for lane in 0..self.boxes.count {
            let cube = spread_flat::<SIDE>(voxels_of_lane[lane], self.boxes.extent[lane]);
            sink.cube::<SIDE>(self.boxes.low[lane], cube & self.boxes.keep[lane]);
        }
        self.boxes.count = 0;
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

/// The axes along which a flat box has more than one voxel, ascending.
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

/// Bit `SIDE a + b` of a flat box to the bit of its voxel in a cube, `(SIDE x + y) SIDE + z`.
#[inline(always)]
fn spread_flat<const SIDE: usize>(mask: u64, extent: [i64; 3]) -> u64 {
    let mut cube = 0;
    if extent[2] == 0 {
        for i in 0..SIDE * SIDE {
            cube |= (mask >> i & 1) << (SIDE * i);
        }
    } else if extent[1] == 0 {
        for x in 0..SIDE {
            cube |= (mask >> (SIDE * x) & row_mask(SIDE)) << (SIDE * SIDE * x);
        }
    } else {
        cube = mask & row_mask(SIDE * SIDE);
    }
    cube
}

/// The lowest `bits` bits.
#[inline(always)]
const fn row_mask(bits: usize) -> u64 {
    if bits >= 64 { u64::MAX } else { (1 << bits) - 1 }
}

/// The lanes in which all three edge functions hold at voxel (a, b), for all of a tile.
#[inline(always)]
fn passing<V: Simd, R: SurfaceRule, const SIDE: usize>(
    simd: V,
    rule: &R,
    v: [[f64x8<V>; 2]; 3],
    e: [[f64x8<V>; 2]; 3],
    area: f64x8<V>,
) -> [[u8; SIDE]; SIDE] {
    let zero = f64x8::splat(simd, 0.0);
    // Inward normals point left of the edges when the projection turns left.
    let turns_right: mask64x8<V> = area.simd_lt(zero);
    let mut at = [zero; 3];
    let mut step_a = [zero; 3];
    let mut step_b = [zero; 3];
    for k in 0..3 {
        let na = turns_right.select(e[k][1], -e[k][1]);
        let nb = turns_right.select(-e[k][0], e[k][0]);
        at[k] = rule.edge_reach(simd, na, nb) - (na * v[k][0] + nb * v[k][1]);
        step_a[k] = na * S;
        step_b[k] = nb * S;
    }
    let mut passing = [[0u8; SIDE]; SIDE];
    for row in &mut passing {
        let mut here = at;
        for cell in row {
            *cell = narrow(here[0].min(here[1]).min(here[2]).simd_ge(zero).to_bitmask());
            for k in 0..3 {
                here[k] += step_b[k];
            }
        }
        for k in 0..3 {
            at[k] += step_a[k];
        }
    }
    passing
}

/// A mask of eight lanes.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "eight lanes")]
fn narrow(mask: u64) -> u8 {
    mask as u8
}

/// The lanes of up to 64 voxels to the voxels of eight lanes.
#[inline(always)]
fn transpose(lanes_of_voxel: &[u8; 64], voxels: usize) -> [u64; LANES] {
    let mut voxels_of_lane = [0u64; LANES];
    for group in 0..voxels.div_ceil(8) {
        // Transpose a matrix of 8 x 8 bits by swapping ever larger blocks across the diagonal.
        let bytes = &lanes_of_voxel[8 * group..8 * group + 8];
        let mut m =
            u64::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3], bytes[4], bytes[5], bytes[6], bytes[7]]);
        for (shift, mask) in [(7, 0x00AA_00AA_00AA_00AA), (14, 0x0000_CCCC_0000_CCCC), (28, 0x0000_0000_F0F0_F0F0u64)] {
            let t = (m ^ (m >> shift)) & mask;
            m ^= t ^ (t << shift);
        }
        for (voxels, byte) in voxels_of_lane.iter_mut().zip(m.to_le_bytes()) {
            *voxels |= u64::from(byte) << (8 * group);
        }
    }
    voxels_of_lane
}
