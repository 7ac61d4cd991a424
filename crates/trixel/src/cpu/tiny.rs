//! Triangles whose box is at most four voxels along each axis: sixteen at a time, in two halves of eight lanes.
//!
//! Everything is f64 holding integers below 2^53, times a power of two, so it is exact: corners are below 2^18 steps from
//! the box's corner, edge functions below 2^38, normals below 2^36, and the plane's terms below 2^53
//! ([`SurfaceRule::plane_bounds`]). For boxes of two voxels, corners are seen from the middle, where they are within 2^16
//! steps, and normals are within 2^34, the square of the box's side: then no term of the plane needs to be split.

use fearless_simd::{Simd, f64x8, i32x16, mask64x8, prelude::*};

use super::kernel::NearClip;
use super::rule::SurfaceRule;
use super::sink::{CubeSink, Places};
use super::triangles::{LANES, Queue, Vectors};
use crate::lattice::{STEP_BITS, STEPS_PER_VOXEL};

/// Lanes of a vector of f64.
const HALF: usize = LANES / 2;

/// S, the lattice steps of a voxel.
const S: f64 = STEPS_PER_VOXEL as f64;

/// The boxes of the triangles in all lanes.
struct Boxes<V: Simd> {
    low: [i32x16<V>; 3],
    extent: [i32x16<V>; 3],
    /// For each axis, `4 from + to`: the first and the last voxel of the box that are inside the clip.
    kept: [[i32; LANES]; 3],
}

impl<V: Simd> Boxes<V> {
    #[inline(always)]
    fn new(simd: V, corners: &Vectors<V>, clip: &NearClip<V>) -> Self {
        let [low, high] = corners.boxes();
        let zero = i32x16::splat(simd, 0);
        let (mut extent, mut kept) = ([zero; 3], [[0; LANES]; 3]);
        for i in 0..3 {
            extent[i] = high[i] - low[i];
            let from = (clip.low[i] - low[i]).max(zero);
            let to = (clip.high[i] - low[i]).min(extent[i]);
            ((from << 2) + to).store_slice(&mut kept[i]);
        }
        Self { low, extent, kept }
    }

    #[inline(always)]
    fn places(&self, clip: &NearClip<V>, sink: &impl CubeSink) -> Places {
        let mut low = [[0; LANES]; 3];
        for i in 0..3 {
            self.low[i].store_slice(&mut low[i]);
        }
        sink.places(&low, clip.base)
    }
}

/// The bits of a cube of `SIDE` whose voxels have an index `from..=to` along an axis: at `4 from + to`.
const fn kept_along<const SIDE: usize>(axis: usize) -> [u64; 16] {
    let mut masks = [0; 16];
    let mut at = 0;
    while at < 16 {
        let mut voxel = 0;
        while voxel < SIDE * SIDE * SIDE {
            let index = [voxel / (SIDE * SIDE), voxel / SIDE % SIDE, voxel % SIDE][axis];
            if index >= at / 4 && index <= at % 4 {
                masks[at] |= 1 << voxel;
            }
            voxel += 1;
        }
        at += 1;
    }
    masks
}

/// [`kept_along`] of every axis.
struct Kept<const SIDE: usize>;

impl<const SIDE: usize> Kept<SIDE> {
    const MASKS: [[u64; 16]; 3] = [kept_along::<SIDE>(0), kept_along::<SIDE>(1), kept_along::<SIDE>(2)];
}

/// Sends the voxels of the waiting triangles, at most [`LANES`], whose boxes have at most `SIDE` voxels along each axis.
#[inline(always)]
pub(super) fn flush<V: Simd, R: SurfaceRule, const SIDE: usize>(
    simd: V,
    rule: &R,
    waiting: &mut Queue,
    clip: &NearClip<V>,
    sink: &mut impl CubeSink,
) {
    let corners = waiting.vectors(simd);
    let boxes = Boxes::new(simd, &corners, clip);
    let places = boxes.places(clip, sink);
    let voxels = if SIDE == 2 {
        // From the middle of the box, in half voxels.
        let halves = corners.floats(simd, corner(&boxes.low, 1), 2.0 / STEPS_PER_VOXEL as f32);
        [two(simd, rule, &halves[0]), two(simd, rule, &halves[1])]
    } else {
        let halves = corners.floats(simd, corner(&boxes.low, 0), 1.0);
        [cube::<_, _, SIDE>(simd, rule, &halves[0]), cube::<_, _, SIDE>(simd, rule, &halves[1])]
    };
    send::<_, SIDE>(&voxels, waiting.count(), &boxes, &places, sink);
    waiting.take();
}

/// [`flush`] for boxes of at most four voxels along two axes and one along the third: strictly inside their layer,
/// triangles meet a voxel where their projections meet.
#[inline(always)]
pub(super) fn flush_flats<V: Simd, R: SurfaceRule>(
    simd: V,
    rule: &R,
    waiting: &mut Queue,
    clip: &NearClip<V>,
    sink: &mut impl CubeSink,
) {
    const SIDE: usize = 4;
    let corners = waiting.vectors(simd);
    let boxes = Boxes::new(simd, &corners, clip);
    let places = boxes.places(clip, sink);
    // The axes (a, b) of the layer, ascending; of a row of voxels, one of its two layers.
    let along_x = boxes.extent[0].simd_le(0);
    let along_z = boxes.extent[2].simd_le(0) & !along_x;
    let mut flattened = corners;
    for p in &mut flattened.0 {
        *p = [along_x.select(p[1], p[0]), along_z.select(p[1], p[2]), i32x16::splat(simd, 0)];
    }
    let low = corner(&boxes.low, 0);
    let low = [along_x.select(low[1], low[0]), along_z.select(low[1], low[2]), i32x16::splat(simd, 0)];
    let halves = flattened.floats(simd, low, 1.0);
    let mut voxels = [[0; HALF]; 2];
    for half in 0..2 {
        let v = pick(&halves[half], 0, 1);
        let e = [between(v[0], v[1]), between(v[1], v[2]), between(v[2], v[0])];
        let area = cross(&e, 0, 1);
        let passing = passing::<V, R, SIDE>(simd, rule, v, e, area);
        let mut lanes_of_voxel = [0u8; 64];
        for a in 0..SIDE {
            for b in 0..SIDE {
                lanes_of_voxel[a * SIDE + b] = passing[a][b];
            }
        }
        voxels[half] = transpose(&lanes_of_voxel, SIDE * SIDE);
    }
    let (along_x, along_z) = (along_x.to_bitmask(), along_z.to_bitmask());
    for half in 0..2 {
        for (lane, voxels) in voxels[half].iter_mut().enumerate() {
            let lane = half * HALF + lane;
            *voxels = spread_flat::<SIDE>(*voxels, along_x >> lane & 1 != 0, along_z >> lane & 1 != 0);
        }
    }
    send::<_, SIDE>(&voxels, waiting.count(), &boxes, &places, sink);
    waiting.take();
}

/// The lattice points of voxels' low corners, moved by `voxels`.
#[inline(always)]
fn corner<V: Simd>(low: &[i32x16<V>; 3], voxels: i32) -> [i32x16<V>; 3] {
    [(low[0] + voxels) << STEP_BITS, (low[1] + voxels) << STEP_BITS, (low[2] + voxels) << STEP_BITS]
}

/// Sends the voxels of the first `count` lanes that are in their boxes and in the clip.
#[inline(always)]
fn send<V: Simd, const SIDE: usize>(
    voxels: &[[u64; HALF]; 2],
    count: usize,
    boxes: &Boxes<V>,
    places: &Places,
    sink: &mut impl CubeSink,
) {
    #[expect(clippy::cast_sign_loss, reason = "any 16 entries will do in lanes that are not used")]
    let kept = |axis: usize, lane: usize| Kept::<SIDE>::MASKS[axis][boxes.kept[axis][lane] as usize % 16];
    for (lane, &voxels) in voxels.as_flattened().iter().enumerate().take(count) {
        sink.cube::<SIDE>(places, lane, voxels & kept(0, lane) & kept(1, lane) & kept(2, lane));
    }
}

/// The voxels of cubes of two, for corners in half voxels from the middle, where voxels' centres are at +-1.
#[inline(always)]
fn two<V: Simd, R: SurfaceRule>(simd: V, rule: &R, v: &[[f64x8<V>; 3]; 3]) -> [u64; HALF] {
    let e = [between(v[0], v[1]), between(v[1], v[2]), between(v[2], v[0])];
    let n = [cross(&e, 1, 2), cross(&e, 2, 0), cross(&e, 0, 1)];

    // In each projection, the lanes in which the voxel (a, b) passes.
    let xy = two_passing(simd, rule, pick(v, 0, 1), pick(&e, 0, 1), n[2]);
    let yz = two_passing(simd, rule, pick(v, 1, 2), pick(&e, 1, 2), n[0]);
    let zx = two_passing(simd, rule, pick(v, 2, 0), pick(&e, 2, 0), n[1]);

    // The plane: |N . (c - v0)| <= reach.
    let at_corner = n[0] * v[0][0] + n[1] * v[0][1] + n[2] * v[0][2];
    let reach = rule.centre_plane_reach([n[0].abs(), n[1].abs(), n[2].abs()]);
    let (sum, difference) = (n[0] + n[1], n[0] - n[1]);
    let along = [sum + n[2], sum - n[2], difference + n[2], difference - n[2]];
    let mut lanes = 0;
    for i in 0..4 {
        // Voxel 7 - i, and the opposite one.
        let near = (along[i] - at_corner).abs().simd_le(reach);
        let far = (along[i] + at_corner).abs().simd_le(reach);
        for (plane, voxel) in [(near, 7 - i), (far, i)] {
            let [x, y, z] = [voxel / 4, voxel / 2 % 2, voxel % 2];
            lanes |= (plane & xy[x][y] & yz[y][z] & zx[z][x]).to_bitmask() << (8 * voxel);
        }
    }
    let mut voxels = [0; HALF];
    for (voxels, byte) in voxels.iter_mut().zip(transpose_bits(lanes).to_le_bytes()) {
        *voxels = u64::from(byte);
    }
    voxels
}

/// The lanes in which all three edge functions hold at voxel (a, b) of two by two, as in [`two`].
#[inline(always)]
fn two_passing<V: Simd, R: SurfaceRule>(
    simd: V,
    rule: &R,
    v: [[f64x8<V>; 2]; 3],
    e: [[f64x8<V>; 2]; 3],
    area: f64x8<V>,
) -> [[mask64x8<V>; 2]; 2] {
    let zero = f64x8::splat(simd, 0.0);
    // Inward normals point left of the edges when the projection turns left.
    let side = f64x8::splat(simd, 1.0).copysign(area);
    let mut least = [[zero; 2]; 2];
    for k in 0..3 {
        let [ea, eb] = e[k];
        let reach = rule.centre_reach(ea.abs(), eb.abs());
        let middle = side.mul_add(eb * v[k][0] - ea * v[k][1], reach);
        let (up, down) = (side * (ea + eb), side * (ea - eb));
        let at = [[middle - down, middle + up], [middle - up, middle + down]];
        for a in 0..2 {
            for b in 0..2 {
                least[a][b] = if k == 0 { at[a][b] } else { least[a][b].min(at[a][b]) };
            }
        }
    }
    [[least[0][0].simd_ge(zero), least[0][1].simd_ge(zero)], [least[1][0].simd_ge(zero), least[1][1].simd_ge(zero)]]
}

/// The voxels of cubes of `SIDE`, for corners in steps from the low corner.
#[inline(always)]
fn cube<V: Simd, R: SurfaceRule, const SIDE: usize>(simd: V, rule: &R, v: &[[f64x8<V>; 3]; 3]) -> [u64; HALF] {
    let e = [between(v[0], v[1]), between(v[1], v[2]), between(v[2], v[0])];
    let n = [cross(&e, 1, 2), cross(&e, 2, 0), cross(&e, 0, 1)];

    // In each projection, the lanes in which the voxel (a, b) passes.
    let xy = passing::<V, R, SIDE>(simd, rule, pick(v, 0, 1), pick(&e, 0, 1), n[2]);
    let yz = passing::<V, R, SIDE>(simd, rule, pick(v, 1, 2), pick(&e, 1, 2), n[0]);
    let zx = passing::<V, R, SIDE>(simd, rule, pick(v, 2, 0), pick(&e, 2, 0), n[1]);

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
    transpose(&lanes_of_voxel, SIDE * SIDE * SIDE)
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

/// The components a and b of three vectors.
#[inline(always)]
fn pick<V: Simd>(of: &[[f64x8<V>; 3]; 3], a: usize, b: usize) -> [[f64x8<V>; 2]; 3] {
    [[of[0][a], of[0][b]], [of[1][a], of[1][b]], [of[2][a], of[2][b]]]
}

/// Bit `SIDE a + b` of a flat box to the bit of its voxel in a cube, `(SIDE x + y) SIDE + z`. The box has one voxel along
/// x if `along_x`, along z if `along_z`, or else along y.
#[inline(always)]
fn spread_flat<const SIDE: usize>(mask: u64, along_x: bool, along_z: bool) -> u64 {
    let mut cube = 0;
    if along_x {
        cube = mask & row_mask(SIDE * SIDE);
    } else if along_z {
        for i in 0..SIDE * SIDE {
            cube |= (mask >> i & 1) << (SIDE * i);
        }
    } else {
        for x in 0..SIDE {
            cube |= (mask >> (SIDE * x) & row_mask(SIDE)) << (SIDE * SIDE * x);
        }
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
    let half = S / 2.0;
    // Inward normals point left of the edges when the projection turns left.
    let turns_right: mask64x8<V> = area.simd_lt(zero);
    let mut at = [zero; 3];
    let mut step_a = [zero; 3];
    let mut step_b = [zero; 3];
    for k in 0..3 {
        let na = turns_right.select(e[k][1], -e[k][1]);
        let nb = turns_right.select(-e[k][0], e[k][0]);
        let reach = (na + nb + rule.centre_reach(na.abs(), nb.abs())) * half;
        at[k] = reach - (na * v[k][0] + nb * v[k][1]);
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
fn transpose(lanes_of_voxel: &[u8; 64], voxels: usize) -> [u64; HALF] {
    let mut voxels_of_lane = [0u64; HALF];
    for group in 0..voxels.div_ceil(8) {
        let bytes = &lanes_of_voxel[8 * group..8 * group + 8];
        let lanes =
            u64::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3], bytes[4], bytes[5], bytes[6], bytes[7]]);
        for (voxels, byte) in voxels_of_lane.iter_mut().zip(transpose_bits(lanes).to_le_bytes()) {
            *voxels |= u64::from(byte) << (8 * group);
        }
    }
    voxels_of_lane
}

/// A matrix of 8 x 8 bits, transposed by swapping ever larger blocks across the diagonal.
#[inline(always)]
fn transpose_bits(mut m: u64) -> u64 {
    for (shift, mask) in [(7, 0x00AA_00AA_00AA_00AA), (14, 0x0000_CCCC_0000_CCCC), (28, 0x0000_0000_F0F0_F0F0u64)] {
        let t = (m ^ (m >> shift)) & mask;
        m ^= t ^ (t << shift);
    }
    m
}
