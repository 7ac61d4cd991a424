//! The tests of triangles of a few voxels in f32, sixteen triangles at a time, and which of them rounding may have decided.
//!
//! Half a voxel is the unit, and the middle of a cuboid of voxels the origin, so that voxels' centres are whole numbers `p`
//! with `|p| < D`, for `D` voxels along an axis, and corners are exact, with `|v| <= D <= 3`. Let `m` be the longest side of
//! a triangle's box and `u = 2^-24` the most by which a sum or product of floats is off, relative to it.
//!
//! - Edges `e` are exact, with `|e| <= m`. A component of the normal, `p - q` of two products, is off by at most
//!   `u (|p| + |q| + |p - q|)`, so that its sign is right from `8 u (|p| + |q|)` on; where products and
//!   sums are fused, it is found with the right sign always ([`determinant`]).
//! - An edge function is `e x v + reach + e x p`, of which only sums and products of two are rounded: off by less than
//!   `64 u m`.
//! - The plane's term, `N . v + N . p` against its reach, is off by less than `256 u m^2`.
//!
//! Where the processor fuses a product and a sum, one rounding less is made.
//!
//! An edge that a projection shows as a point has only zeros. It passes whatever the voxel, and is given a reach that says
//! so; the reach of any other is at least a step, `2^-15`, and thus as large as `64 u m` without help.
//!
//! An edge along an axis, as a projection shows it, excludes only what is outside the triangle's box: in both modes it reaches
//! half a voxel, and where there is an area, the third corner is on its inner side, and where there is none, on it. So does a point.
//! A plane across an axis likewise excludes nothing inside the box, nor does a normal that is 0. Who looks at voxels in boxes
//! alone can pass over all of these (`SURER`): in meshes whose edges are on the sides of voxels, they are most of what is in
//! doubt. They are looked for only where there is some.

use fearless_simd::{Simd, SimdFloat, f32x16, i32x16, mask32x16, prelude::*};

use super::instructions::fuses;
use super::rule::SurfaceRule;

/// The longest side of a cuboid.
const MOST: usize = 3;

/// For each cell of a projection, the voxels that it shows. Voxel `(x, y, z)` of a cuboid of `A` by `B` by `C` is bit
/// `(B x + y) C + z`.
type Cells = [[i32; MOST]; MOST];

/// A share of the longest side by which an edge function may be off.
const EDGE_DOUBT: f32 = 64.0 * UNIT;
/// A share of its square by which the plane's term may be off.
const PLANE_DOUBT: f32 = 256.0 * UNIT;
/// A share of its products by which a component of the normal may be off.
const NORMAL_DOUBT: f32 = 8.0 * UNIT;
/// Beyond any voxel.
pub(super) const FAR: f32 = 1e9;
/// The most by which a sum or product is off, relative to it.
pub(super) const UNIT: f32 = 1.0 / (1 << 24) as f32;

/// Constants for cuboids of `A` by `B` by `C` voxels.
pub(super) struct Cuboid<const A: usize, const B: usize, const C: usize>;

/// Constants for cubes of `SIDE`.
pub(super) type Cube<const SIDE: usize> = Cuboid<SIDE, SIDE, SIDE>;

impl<const A: usize, const B: usize, const C: usize> Cuboid<A, B, C> {
    /// The cells of the projections to yz, zx and xy.
    pub(super) const CELLS: [Cells; 3] = [cells::<A, B, C>(1, 2), cells::<A, B, C>(2, 0), cells::<A, B, C>(0, 1)];
    /// The layers across each axis.
    pub(super) const LAYERS: [[i32; MOST]; 3] = [across::<A, B, C>(0), across::<A, B, C>(1), across::<A, B, C>(2)];
}

/// The bit of a voxel.
const fn bit<const B: usize, const C: usize>(x: usize, y: usize, z: usize) -> i32 {
    1 << ((B * x + y) * C + z)
}

/// What the projection to the axes a and b shows in each of its cells.
const fn cells<const A: usize, const B: usize, const C: usize>(a: usize, b: usize) -> Cells {
    let mut cells = [[0; MOST]; MOST];
    let mut voxel = 0;
    while voxel < A * B * C {
        let index = [voxel / (B * C), voxel / C % B, voxel % C];
        cells[index[a]][index[b]] |= bit::<B, C>(index[0], index[1], index[2]);
        voxel += 1;
    }
    cells
}

/// The voxels of each layer across an axis.
const fn across<const A: usize, const B: usize, const C: usize>(axis: usize) -> [i32; MOST] {
    let cells = cells::<A, B, C>(axis, (axis + 1) % 3);
    let mut layers = [0; MOST];
    let mut i = 0;
    while i < MOST * MOST {
        layers[i / MOST] |= cells[i / MOST][i % MOST];
        i += 1;
    }
    layers
}

/// What is known of sixteen triangles.
pub(super) struct Filtered<V: Simd> {
    /// The voxels that pass.
    pub(super) voxels: i32x16<V>,
    /// Lanes in which rounding may have decided.
    pub(super) doubtful: u64,
}

/// The voxels of cuboids of `A` by `B` by `C` that triangles meet, for their corners and the longest sides of their boxes: if
/// `SURER`, of those inside the boxes, with less doubt.
#[inline(always)]
pub(super) fn cuboids<V: Simd, R: SurfaceRule, const A: usize, const B: usize, const C: usize, const SURER: bool>(
    simd: V,
    rule: &R,
    v: &[[f32x16<V>; 3]; 3],
    longest: f32x16<V>,
) -> Filtered<V> {
    let mut tests = Tests::new(simd, longest);
    let e = [between(v[0], v[1]), between(v[1], v[2]), between(v[2], v[0])];
    let normal = &mut tests.normal;
    let n = [
        normal.surely_across(simd, &e, 1, 2),
        normal.surely_across(simd, &e, 2, 0),
        normal.surely_across(simd, &e, 0, 1),
    ];
    let cells = &Cuboid::<A, B, C>::CELLS;
    let voxels = tests.plane::<R, A, B, C, SURER>(simd, rule, n, v[0])
        & tests.edges::<R, B, C, SURER>(simd, rule, &Projection::new(v, &e, 1, 2, n[0]), &cells[0])
        & tests.edges::<R, C, A, SURER>(simd, rule, &Projection::new(v, &e, 2, 0, n[1]), &cells[1])
        & tests.edges::<R, A, B, SURER>(simd, rule, &Projection::new(v, &e, 0, 1, n[2]), &cells[2]);
    Filtered { voxels, doubtful: tests.doubtful(simd) }
}

/// The cells `(a, b)` of `SIDE` by `SIDE` that projections meet: bit `SIDE a + b`.
#[inline(always)]
pub(super) fn layers<V: Simd, R: SurfaceRule, const SIDE: usize>(
    simd: V,
    rule: &R,
    v: &[[f32x16<V>; 2]; 3],
    longest: f32x16<V>,
) -> Filtered<V> {
    let mut tests = Tests::new(simd, longest);
    let e = [between(v[0], v[1]), between(v[1], v[2]), between(v[2], v[0])];
    let area = tests.normal.surely_across(simd, &e, 0, 1);
    let cells = &Cuboid::<SIDE, SIDE, 1>::CELLS[2];
    let voxels = tests.edges::<R, SIDE, SIDE, false>(simd, rule, &Projection { v: *v, e, area }, cells);
    Filtered { voxels, doubtful: tests.doubtful(simd) }
}

/// Triangles as two axes show them.
struct Projection<V: Simd> {
    /// Corners.
    v: [[f32x16<V>; 2]; 3],
    /// Edges; edge k starts at corner k.
    e: [[f32x16<V>; 2]; 3],
    /// Twice the area, above 0 where it turns left.
    area: f32x16<V>,
}

impl<V: Simd> Projection<V> {
    /// To the axes a and b.
    #[inline(always)]
    fn new(v: &[[f32x16<V>; 3]; 3], e: &[[f32x16<V>; 3]; 3], a: usize, b: usize, area: f32x16<V>) -> Self {
        Self {
            v: [[v[0][a], v[0][b]], [v[1][a], v[1][b]], [v[2][a], v[2][b]]],
            e: [[e[0][a], e[0][b]], [e[1][a], e[1][b]], [e[2][a], e[2][b]]],
            area,
        }
    }
}

/// Components of normals, and how near they have come to having the wrong sign.
pub(super) struct Normal<V: Simd> {
    /// The least by which a component has the sign it seems to have.
    least: f32x16<V>,
}

impl<V: Simd> Normal<V> {
    #[inline(always)]
    pub(super) fn new(simd: V) -> Self {
        Self { least: f32x16::splat(simd, f32::MAX) }
    }

    /// The component across the axes i and j: a difference of two products.
    #[inline(always)]
    pub(super) fn across<const AXES: usize>(&mut self, e: &[[f32x16<V>; AXES]; 3], i: usize, j: usize) -> f32x16<V> {
        let (p, q) = (e[0][i] * e[1][j], e[0][j] * e[1][i]);
        let n = p - q;
        self.least = self.least.min((p.abs() + q.abs()).mul_add(-NORMAL_DOUBT, n.abs()));
        n
    }

    /// [`Self::across`], with the right sign wherever products and sums are fused: later, but nothing is left to be in doubt.
    #[inline(always)]
    pub(super) fn surely_across<const AXES: usize>(
        &mut self,
        simd: V,
        e: &[[f32x16<V>; AXES]; 3],
        i: usize,
        j: usize,
    ) -> f32x16<V> {
        if fuses(simd) { determinant(e[0], e[1], i, j) } else { self.across(e, i, j) }
    }

    /// The lanes in which a sign may be wrong.
    #[inline(always)]
    pub(super) fn doubtful(&self, simd: V) -> u64 {
        self.least.simd_lt(f32x16::splat(simd, 0.0)).to_bitmask()
    }
}

/// How near to rounding the tests have come.
pub(super) struct Tests<V: Simd> {
    edge_doubt: f32x16<V>,
    plane_doubt: f32x16<V>,
    pub(super) normal: Normal<V>,
    /// The least absolute values.
    pub(super) edge: f32x16<V>,
    pub(super) plane: f32x16<V>,
}

impl<V: Simd> Tests<V> {
    #[inline(always)]
    pub(super) fn new(simd: V, longest: f32x16<V>) -> Self {
        let far = f32x16::splat(simd, f32::MAX);
        Self {
            edge_doubt: longest * EDGE_DOUBT,
            plane_doubt: longest * longest * PLANE_DOUBT,
            normal: Normal::new(simd),
            edge: far,
            plane: far,
        }
    }

    #[inline(always)]
    pub(super) fn doubtful(&self, simd: V) -> u64 {
        let doubt = (self.edge - self.edge_doubt).min(self.plane - self.plane_doubt).min(self.normal.least);
        doubt.simd_lt(f32x16::splat(simd, 0.0)).to_bitmask()
    }

    /// The voxels within reach of the plane.
    #[inline(always)]
    fn plane<R: SurfaceRule, const A: usize, const B: usize, const C: usize, const SURER: bool>(
        &mut self,
        simd: V,
        rule: &R,
        n: [f32x16<V>; 3],
        v: [f32x16<V>; 3],
    ) -> i32x16<V> {
        let zero = f32x16::splat(simd, 0.0);
        let mut voxels = i32x16::splat(simd, 0);
        let lengths = [n[0].abs(), n[1].abs(), n[2].abs()];
        let mut reach = rule.centre_plane_reach(lengths);
        if SURER {
            reach = faces_axis(lengths).select(f32x16::splat(simd, FAR), reach);
        }
        let at_middle = n[2].mul_add(v[2], n[1].mul_add(v[1], n[0] * v[0]));
        for x in 0..A {
            // Against the normal, which is as good: only how far it is counts.
            let at_x = moved(at_middle, n[0], -centre::<A>(x));
            for y in 0..B {
                let at_y = moved(at_x, n[1], -centre::<B>(y));
                for z in 0..C {
                    let at = moved(at_y, n[2], -centre::<C>(z));
                    let within = reach - at.abs();
                    self.plane = self.plane.min(within.abs());
                    let bits = bit::<B, C>(x, y, z);
                    voxels = within.simd_ge(zero).select(voxels | bits, voxels);
                }
            }
        }
        voxels
    }

    /// The voxels that cells of a projection show in which all three edge functions hold.
    #[inline(always)]
    fn edges<R: SurfaceRule, const A: usize, const B: usize, const SURER: bool>(
        &mut self,
        simd: V,
        rule: &R,
        &Projection { v, e, area }: &Projection<V>,
        cells: &Cells,
    ) -> i32x16<V> {
        let zero = f32x16::splat(simd, 0.0);
        // Inward normals point left of the edges when the projection turns left.
        let side = f32x16::splat(simd, 1.0).copysign(area);
        let mut least = [[zero; B]; A];
        for k in 0..3 {
            // Lengths without their sign are the same in another projection, and found once.
            let (la, lb) = (e[k][0].abs(), e[k][1].abs());
            let mut reach = rule.centre_reach(la, lb);
            if SURER {
                reach = along_axis(la, lb).select(f32x16::splat(simd, FAR), reach);
            } else {
                reach = reach.max(self.edge_doubt);
            }
            let (ea, eb) = (e[k][0] * side, e[k][1] * side);
            let at_middle = (-ea).mul_add(v[k][1], eb.mul_add(v[k][0], reach));
            for a in 0..A {
                let at_a = moved(at_middle, eb, -centre::<A>(a));
                for b in 0..B {
                    let at = moved(at_a, ea, centre::<B>(b));
                    least[a][b] = if k == 0 { at } else { least[a][b].min(at) };
                }
            }
        }
        let mut voxels = i32x16::splat(simd, 0);
        for a in 0..A {
            for b in 0..B {
                self.edge = self.edge.min(least[a][b].abs());
                voxels = least[a][b].simd_ge(zero).select(voxels | cells[a][b], voxels);
            }
        }
        voxels
    }
}

/// `a_i b_j - a_j b_i`, where `mul_sub` rounds once: of the right sign, and 0 only if it is 0 (Kahan's algorithm).
#[inline(always)]
pub(super) fn determinant<V: Simd, const AXES: usize>(
    a: [f32x16<V>; AXES],
    b: [f32x16<V>; AXES],
    i: usize,
    j: usize,
) -> f32x16<V> {
    let product = a[j] * b[i];
    let lost = a[j].mul_sub(b[i], product);
    a[i].mul_sub(b[j], product) - lost
}

/// Where an edge, of which a projection's absolute components are given, is along an axis or a point.
#[inline(always)]
pub(super) fn along_axis<V: Simd>(la: f32x16<V>, lb: f32x16<V>) -> mask32x16<V> {
    la.min(lb).simd_le(0.0)
}

/// Where a normal, of which the absolute components are given, is along an axis or 0.
#[inline(always)]
pub(super) fn faces_axis<V: Simd>(n: [f32x16<V>; 3]) -> mask32x16<V> {
    (n[0] + n[1]).min(n[1] + n[2]).min(n[2] + n[0]).simd_le(0.0)
}

/// `at + step by`, where the compiler knows `by`, but must not leave out by itself what is times 0.
#[inline(always)]
fn moved<V: Simd>(at: f32x16<V>, step: f32x16<V>, by: f32) -> f32x16<V> {
    if by == 0.0 { at } else { step * by + at }
}

/// The centre of the `i`th voxel along a side.
#[inline(always)]
#[expect(clippy::cast_precision_loss, reason = "at most 3")]
const fn centre<const SIDE: usize>(i: usize) -> f32 {
    2.0 * i as f32 - (SIDE - 1) as f32
}

/// `b - a`.
#[inline(always)]
pub(super) fn between<V: Simd, F: SimdFloat<V>, const AXES: usize>(a: [F; AXES], b: [F; AXES]) -> [F; AXES] {
    let mut edge = b;
    for i in 0..AXES {
        edge[i] = b[i] - a[i];
    }
    edge
}
