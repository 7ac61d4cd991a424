//! Triangles whose box is at most two voxels along each axis, where touching is enough: the voxels are octants.
//!
//! A triangle inside a cube of 2^3 voxels meets one of them exactly if it meets the octant of space, around the cube's
//! middle, that the voxel is in. Of what separates a triangle from a voxel, an axis across an edge or the plane, an octant
//! leaves little: whatever does not point away from the octant along all axes, it reaches. So an edge of a projection that
//! has the middle strictly outside excludes the quadrant that opens away from it, and no other; the plane likewise an octant.
//! That takes one sign for each edge of each projection and one for the plane, and the signs of edges and normal, which
//! tell the octant. Signs are gathered lane by lane into words, where the rest is logic.
//!
//! An edge along an axis excludes two quadrants, and either may be taken: the triangle's box excludes both. A projection
//! without area has no inside, and either side may be taken: its edges go to and fro, and whatever is strictly beside
//! them, is outside.
//!
//! The signs are first taken in f32, with the unit, origin and bounds of [`filter`](super::filter). Where rounding may have
//! changed one, they are found again by Kahan's algorithm for the difference of two products, if the processor fuses products
//! and sums: all are right then, but the plane's. Where that is still in doubt, and on other processors, all are taken in f64
//! from lattice steps, which is exact: corners are within 2^16 steps of the middle, edges and products below 2^17 and 2^33,
//! normals below 2^35, and the three products of the plane's term below 2^52. Only in the latter two are edges through the
//! middle told from those beside it: at first they are in doubt.

use fearless_simd::{Simd, SimdFloat, f32x16, i32x16, mask32x16, prelude::*};

use super::filter::{Tests, between, determinant, faces_axis};
use super::instructions::fuses;
use super::triangles::{LANES, Lanes, Vectors};

/// For each axis, the lanes that have voxels in the first and in the second layer of their cube.
pub(super) type Layers = [[Lanes; 2]; 3];

/// For each projection, along x, y and z, the lanes whose triangles do not meet a quadrant.
type Excluded = [[[Lanes; 2]; 2]; 3];

/// The voxels of cubes of 2^3 around `middle` that triangles meet, of those in `layers`: voxel `(x, y, z)` is bit
/// `4 x + 2 y + z`. Only the lanes in `used` are right.
#[inline(always)]
pub(super) fn voxels<V: Simd>(
    simd: V,
    corners: &Vectors<V>,
    middle: [i32x16<V>; 3],
    longest: f32x16<V>,
    scale: f32,
    layers: Layers,
    used: Lanes,
) -> i32x16<V> {
    let v = corners.floats(middle, scale);
    let signs = Signs::new(&v);
    let mut tests = Tests::new(simd, longest);
    for i in 0..3 {
        tests.normal.across(&signs.e, (i + 1) % 3, (i + 2) % 3);
        for k in 0..3 {
            tests.edge = tests.edge.min(signs.edges[i][k].abs());
        }
    }
    tests.plane = signs.plane.abs();
    if tests.doubtful(simd) & used != 0 {
        // A copy, so that corners need not be in memory anywhere else.
        let corners = *corners;
        return surely(simd, &corners, middle, longest, scale, layers, used);
    }
    select(simd, signs.met::<_, false>(layers))
}

/// [`voxels`], whatever rounding may have changed.
#[cold]
#[inline(never)]
fn surely<V: Simd>(
    simd: V,
    corners: &Vectors<V>,
    middle: [i32x16<V>; 3],
    longest: f32x16<V>,
    scale: f32,
    layers: Layers,
    used: Lanes,
) -> i32x16<V> {
    simd.vectorize(
        #[inline(always)]
        || {
            if fuses(simd) {
                let signs = Signs::surely(&corners.floats(middle, scale));
                let mut tests = Tests::new(simd, longest);
                // Of a normal along an axis, the plane is one product.
                let [x, y, z] = signs.n;
                let sure = faces_axis([x.abs(), y.abs(), z.abs()]);
                tests.plane = sure.select(tests.plane, signs.plane.abs());
                if tests.doubtful(simd) & used == 0 {
                    return select(simd, signs.met::<_, true>(layers));
                }
            }
            exact(simd, corners, middle, layers)
        },
    )
}

/// [`voxels`] without rounding.
#[cold]
#[inline(never)]
pub(super) fn exact<V: Simd>(simd: V, corners: &Vectors<V>, middle: [i32x16<V>; 3], layers: Layers) -> i32x16<V> {
    const HALF: usize = LANES / 2;
    simd.vectorize(
        #[inline(always)]
        || {
            let mut both = [0; 8];
            for (half, v) in corners.halves(simd, middle, 1.0).iter().enumerate() {
                let met = Signs::new(v).met::<_, true>(layers.map(|axis| axis.map(|lanes| lanes >> (half * HALF))));
                for (both, met) in both.iter_mut().zip(met) {
                    *both |= (met & ((1 << HALF) - 1)) << (half * HALF);
                }
            }
            select(simd, both)
        },
    )
}

/// The voxels whose lanes are given.
#[inline(always)]
fn select<V: Simd>(simd: V, lanes: [Lanes; 8]) -> i32x16<V> {
    let mut voxels = i32x16::splat(simd, 0);
    for (voxel, lanes) in lanes.into_iter().enumerate() {
        let lanes = mask32x16::from_bitmask(simd, lanes & ((1 << LANES) - 1));
        voxels = lanes.select(voxels | 1 << voxel, voxels);
    }
    voxels
}

/// What is asked for its sign.
struct Signs<F> {
    /// Edges; edge k starts at corner k.
    e: [[F; 3]; 3],
    /// The normal.
    n: [F; 3],
    /// The edge functions at the middle, of the projection along each axis, turning left where the normal points along it.
    edges: [[F; 3]; 3],
    /// The plane's height above the middle, along the normal.
    plane: F,
}

impl<F> Signs<F> {
    /// For corners from the middle.
    #[inline(always)]
    fn new<V: Simd>(v: &[[F; 3]; 3]) -> Self
    where
        F: SimdFloat<V>,
    {
        let e = [between(v[0], v[1]), between(v[1], v[2]), between(v[2], v[0])];
        let n = [cross(&e, 1, 2), cross(&e, 2, 0), cross(&e, 0, 1)];
        let edge = |k: usize, a: usize, b: usize| v[k][a] * e[k][b] - v[k][b] * e[k][a];
        let edges = [
            [edge(0, 1, 2), edge(1, 1, 2), edge(2, 1, 2)],
            [edge(0, 2, 0), edge(1, 2, 0), edge(2, 2, 0)],
            [edge(0, 0, 1), edge(1, 0, 1), edge(2, 0, 1)],
        ];
        let plane = n[0] * v[0][0] + n[1] * v[0][1] + n[2] * v[0][2];
        Self { e, n, edges, plane }
    }
}

impl<V: Simd> Signs<f32x16<V>> {
    /// [`Self::new`], but all signs except the plane's are right where products and sums are fused.
    #[inline(always)]
    fn surely(v: &[[f32x16<V>; 3]; 3]) -> Self {
        let e = [between(v[0], v[1]), between(v[1], v[2]), between(v[2], v[0])];
        let n = [determinant(e[0], e[1], 1, 2), determinant(e[0], e[1], 2, 0), determinant(e[0], e[1], 0, 1)];
        let mut edges = e;
        for i in 0..3 {
            for k in 0..3 {
                edges[i][k] = determinant(v[k], e[k], (i + 1) % 3, (i + 2) % 3);
            }
        }
        let plane = n[0] * v[0][0] + n[1] * v[0][1] + n[2] * v[0][2];
        Self { e, n, edges, plane }
    }
}

impl<F> Signs<F> {
    /// The lanes that meet each of the voxels. Edges may go through the middle if `TIES`.
    #[inline(always)]
    fn met<V: Simd, const TIES: bool>(&self, layers: Layers) -> [Lanes; 8]
    where
        F: SimdFloat<V>,
        F::Element: From<f32>,
    {
        let n = [negative(self.n[0]), negative(self.n[1]), negative(self.n[2])];
        let mut excluded: Excluded = [[[0; 2]; 2]; 3];
        let mut e = [[0; 3]; 3];
        for k in 0..3 {
            for i in 0..3 {
                e[k][i] = negative(self.e[k][i]);
            }
        }
        for i in 0..3 {
            let (a, b) = ((i + 1) % 3, (i + 2) % 3);
            for k in 0..3 {
                let below = negative(self.edges[i][k]);
                // Against the normal, what is not below is above.
                let above = if TIES { positive(self.edges[i][k]) } else { !below };
                let outside = below & !n[i] | above & n[i];
                // Away from the triangle, the edge's normal is (e_b, -e_a) if it turns left.
                let (a_low, b_high) = (e[k][b] ^ n[i], e[k][a] ^ n[i]);
                let (low, high) = (outside & a_low, outside & !a_low);
                excluded[i][0][0] |= low & !b_high;
                excluded[i][0][1] |= low & b_high;
                excluded[i][1][0] |= high & !b_high;
                excluded[i][1][1] |= high & b_high;
            }
        }
        // Seen from the middle, the plane's other side is against the normal where the plane is along it.
        let (below, above) = (negative(self.plane), positive(self.plane));
        let high = [n[0] ^ below, n[1] ^ below, n[2] ^ below];
        let beyond = [[!high[0], high[0]], [!high[1], high[1]], [!high[2], high[2]]];
        let off_plane = below | above;

        let mut met = [0; 8];
        for x in 0..2 {
            for y in 0..2 {
                let column = layers[0][x] & layers[1][y] & !excluded[2][x][y];
                let off = beyond[0][x] & beyond[1][y] & off_plane;
                for z in 0..2 {
                    met[4 * x + 2 * y + z] =
                        column & layers[2][z] & !(excluded[0][y][z] | excluded[1][z][x] | off & beyond[2][z]);
                }
            }
        }
        met
    }
}

/// The component of the normal across the axes i and j.
#[inline(always)]
fn cross<V: Simd, F: SimdFloat<V>>(e: &[[F; 3]; 3], i: usize, j: usize) -> F {
    e[0][i] * e[1][j] - e[0][j] * e[1][i]
}

/// The lanes below 0.
#[inline(always)]
fn negative<V: Simd, F: SimdFloat<V, Element: From<f32>>>(of: F) -> Lanes {
    of.simd_lt(F::Element::from(0.0)).to_bitmask()
}

/// The lanes above 0.
#[inline(always)]
fn positive<V: Simd, F: SimdFloat<V, Element: From<f32>>>(of: F) -> Lanes {
    of.simd_gt(F::Element::from(0.0)).to_bitmask()
}
