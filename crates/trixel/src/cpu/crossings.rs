//! Mode solid for triangles whose box is at most four voxels along each axis: where the lines through the centres of its
//! columns cross them, sixteen triangles at a time, in two halves of eight lanes.
//!
//! Everything is f64 holding integers below 2^53, so it is exact: corners are within 2^18 steps of the first column's
//! centre, edge functions below 2^38, normals below 2^36, and the plane's terms below 3 * 2^36 * 2^15.

use fearless_simd::{Simd, f64x8, i32x16, mask64x8, prelude::*};

use super::kernel::{NearClip, VoxelBox};
use super::rule::split_centred;
use super::sink::Sink;
use super::tiny::{between, cross};
use super::triangles::{LANES, Queue, Vectors};
use crate::lattice::{STEP_BITS, STEPS_PER_VOXEL};

/// Half a voxel.
const HALF: i32 = (STEPS_PER_VOXEL / 2) as i32;

/// Along x and y, the first and the last column of the clip whose centres are inside the triangles' closed boxes.
#[inline(always)]
pub(super) fn columns<V: Simd>(corners: &Vectors<V>, clip: &NearClip<V>) -> [[i32x16<V>; 2]; 2] {
    let mut columns = [[clip.low[0]; 2]; 2];
    for i in 0..2 {
        let low = corners.least(i).saturating_add(HALF - 1) >> STEP_BITS;
        let high = corners.most(i).saturating_sub(HALF) >> STEP_BITS;
        columns[i] = [low.max(clip.low[i]), high.min(clip.high[i])];
    }
    columns
}

/// How far columns are from the first, for whoever needs that as a number of another kind.
const DISTANCES: [i32; 4] = [0, 1, 2, 3];

/// Sends the runs, from the lowest voxel whose centre is not below the triangle to the top of the clip, of the waiting
/// triangles, with centres of at most `SIDE` columns along x and y: of as many as fill vectors, or of all.
#[inline(never)]
pub(super) fn flush<V: Simd, const SIDE: usize>(
    simd: V,
    waiting: &mut Queue,
    all: bool,
    near: &NearClip<V>,
    clip: &VoxelBox,
    sink: &mut impl Sink,
) {
    waiting.for_each(
        simd,
        all,
        #[inline(always)]
        |corners, count| cross_columns::<_, SIDE>(simd, corners, count, near, clip, sink),
    );
}

/// [`flush`] of the first `count` lanes.
#[inline(always)]
fn cross_columns<V: Simd, const SIDE: usize>(
    simd: V,
    corners: &Vectors<V>,
    count: usize,
    near: &NearClip<V>,
    clip: &VoxelBox,
    sink: &mut impl Sink,
) {
    let [[x, x_last], [y, y_last]] = columns(corners, near);
    let z = (corners.least(2) - 1) >> STEP_BITS;
    let middle = [(x << STEP_BITS) + HALF, (y << STEP_BITS) + HALF, (z << STEP_BITS) + HALF];
    let halves = corners.halves(simd, middle, 1.0);
    let used = (1u64 << count) - 1;
    // The lanes that have a column so far from the first.
    let mut along_x = [used; SIDE];
    let mut along_y = [u64::MAX; SIDE];
    for d in 1..SIDE {
        along_x[d] &= (x + DISTANCES[d]).simd_le(x_last).to_bitmask();
        along_y[d] &= (y + DISTANCES[d]).simd_le(y_last).to_bitmask();
    }

    let mut at = [[0; LANES]; 3];
    for (axis, low) in [x, y, z].into_iter().enumerate() {
        low.store_slice(&mut at[axis]);
    }
    for (half, v) in halves.iter().enumerate() {
        let shift = half * LANES / 2;
        let crossed = Crossed::new(simd, v);
        for column in 0..SIDE * SIDE {
            let (dx, dy) = (column / SIDE, column % SIDE);
            let mut lanes = (along_x[dx] & along_y[dy]) >> shift & 0xff;
            if lanes == 0 {
                continue;
            }
            let (passing, height) = crossed.at(dx, dy);
            let mut heights = [0.0; LANES / 2];
            height.store_slice(&mut heights);
            lanes &= passing;
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize % (LANES / 2);
                lanes &= lanes - 1;
                let [x, y, z] = [at[0][shift + lane], at[1][shift + lane], at[2][shift + lane]].map(i64::from);
                #[expect(clippy::cast_possible_truncation, reason = "within a few voxels of the box")]
                let z = (z + near.base[2] + heights[lane] as i64).max(clip.low[2]);
                if z <= clip.high[2] {
                    let [x, y] =
                        [x + near.base[0] + i64::from(DISTANCES[dx]), y + near.base[1] + i64::from(DISTANCES[dy])];
                    sink.run(x, y, z, clip.high[2]);
                }
            }
        }
    }
}

/// What the columns of eight triangles have in common.
struct Crossed<V: Simd> {
    edges: [Edge<V>; 3],
    /// Lanes that are not parallel to z.
    slanted: mask64x8<V>,
    /// The normal, turned upwards.
    n: [f64x8<V>; 3],
    /// The plane at the first column: `N_z z >= plane` for voxels that are not below it.
    plane: f64x8<V>,
}

/// The edge function at the first column and its steps, and what it must exceed: the tie rule, as a fraction of a step
/// for a centre that lies on the edge.
#[derive(Clone, Copy)]
struct Edge<V: Simd> {
    at: f64x8<V>,
    step: [f64x8<V>; 2],
    beyond: f64x8<V>,
}

impl<V: Simd> Crossed<V> {
    /// For corners in steps from the centre of the voxel at the bottom of the first column.
    #[inline(always)]
    fn new(simd: V, v: &[[f64x8<V>; 3]; 3]) -> Self {
        /// A centre on an edge counts as shifted by (+e, +e^2) steps, for this e: by less than a step in all.
        const SHIFT: f64 = 1.0 / (1 << 20) as f64;
        let (zero, one) = (f64x8::splat(simd, 0.0), f64x8::splat(simd, 1.0));
        let e = [between(v[0], v[1]), between(v[1], v[2]), between(v[2], v[0])];
        let area = cross(&e, 0, 1);
        let up = one.copysign(area);
        let n = [cross(&e, 1, 2) * up, cross(&e, 2, 0) * up, area * up];
        let (whole, rest) = split_centred(n, v[0]);
        let mut edges = [Edge { at: zero, step: [zero; 2], beyond: zero }; 3];
        for (k, edge) in edges.iter_mut().enumerate() {
            let (na, nb) = (-e[k][1] * up, e[k][0] * up);
            edge.at = -(na * v[k][0] + nb * v[k][1]);
            edge.step = [na * f64::from(STEPS_PER_VOXEL), nb * f64::from(STEPS_PER_VOXEL)];
            edge.beyond = (na + nb * SHIFT) * -SHIFT;
        }
        Self { edges, slanted: n[2].simd_gt(zero), n, plane: whole + rest.ceil() }
    }

    /// The lanes whose triangle is crossed by the line `(dx, dy)` columns from the first, and the lowest voxels that are
    /// not below.
    #[inline(always)]
    fn at(&self, dx: usize, dy: usize) -> (u64, f64x8<V>) {
        let (dx, dy) = (f64::from(DISTANCES[dx]), f64::from(DISTANCES[dy]));
        let mut passing = self.slanted;
        for edge in &self.edges {
            passing &= (edge.at + edge.step[0] * dx + edge.step[1] * dy).simd_gt(edge.beyond);
        }
        let plane = self.plane - self.n[0] * dx - self.n[1] * dy;
        (passing.to_bitmask(), (plane / self.n[2]).ceil())
    }
}
