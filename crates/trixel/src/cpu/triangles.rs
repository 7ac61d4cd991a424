//! Which triangles the kernel is to go through, and their corners: one by one, or in blocks for vectors.

use std::ops::Range;

use fearless_simd::{Simd, f32x16, f64x8, i32x16, prelude::*};

use super::kernel::VoxelBox;
use super::prefetch::prefetch;
use crate::lattice::{LatticeMesh, LatticePositions, STEP_BITS};

/// Triangles that are judged together: lanes of a vector of `i32`.
pub(super) const LANES: usize = 16;

/// The lanes, of a vector's, in which something holds.
pub(super) type Lanes = u64;

/// Triangles that are loaded together. Several vectors' worth, because a vector can only be read back some time after its
/// parts were written.
pub(super) const BLOCK: usize = 64;

/// Some triangles of a mesh, one after the other.
#[derive(Clone)]
pub(super) struct Selected<'a> {
    mesh: &'a LatticeMesh<'a>,
    which: Which<'a>,
}

#[derive(Clone)]
enum Which<'a> {
    Range(Range<usize>),
    Listed(&'a [u32]),
}

impl<'a> Selected<'a> {
    /// A range of the triangles.
    pub(super) fn range(mesh: &'a LatticeMesh<'a>, range: Range<usize>) -> Self {
        Self { mesh, which: Which::Range(range) }
    }

    /// Those of a list of numbers.
    pub(super) fn listed(mesh: &'a LatticeMesh<'a>, numbers: &'a [u32]) -> Self {
        Self { mesh, which: Which::Listed(numbers) }
    }

    /// How many there are.
    #[inline(always)]
    pub(super) fn len(&self) -> usize {
        match &self.which {
            Which::Range(range) => range.len(),
            Which::Listed(numbers) => numbers.len(),
        }
    }

    /// The number of the `i`th in the mesh.
    #[inline(always)]
    pub(super) fn number(&self, i: usize) -> usize {
        match &self.which {
            Which::Range(range) => range.start + i,
            Which::Listed(numbers) => numbers[i] as usize,
        }
    }

    /// The corners of the `i`th.
    #[inline(always)]
    pub(super) fn corners(&self, i: usize) -> [[i64; 3]; 3] {
        corners(self.mesh, self.mesh.triangles[self.number(i)])
    }

    /// The triangles from `start` on, as many as fit a block.
    pub(super) fn load(&self, start: usize, base: [i64; 3], block: &mut Block) -> usize {
        let end = self.len().min(start + BLOCK);
        let all = &self.mesh.triangles;
        match (&self.mesh.positions, &self.which) {
            (LatticePositions::Narrow(positions), Which::Range(range)) => {
                let next = range.start + end;
                prefetch_block(all, next + BLOCK);
                // Not corner by corner: the loop would be so short that its place in memory decides how quick it is.
                for &[a, b, c] in &all[next..all.len().min(next + BLOCK)] {
                    prefetch(positions, a as usize);
                    prefetch(positions, b as usize);
                    prefetch(positions, c as usize);
                }
                let all = &all[range.start + start..next];
                block.fill(all, |&triangle| triangle, |vertex| positions[vertex as usize]);
            }
            (LatticePositions::Narrow(positions), Which::Listed(numbers)) => {
                block.fill(&numbers[start..end], |&i| all[i as usize], |vertex| positions[vertex as usize]);
            }
            (LatticePositions::Wide(positions), which) => {
                // Beyond 32 bits, a corner is outside the clip by far, here as there: its triangle is larger than what
                // is judged by these numbers, or does not come near the clip.
                #[expect(clippy::cast_possible_truncation, reason = "clamped")]
                let near = |at: i64, base: i64| {
                    (at - (base << STEP_BITS)).clamp(-i64::from(i32::MAX), i64::from(i32::MAX)) as i32
                };
                let corner = |vertex: u32| {
                    let [x, y, z] = positions[vertex as usize];
                    [near(x, base[0]), near(y, base[1]), near(z, base[2])]
                };
                match which {
                    Which::Range(range) => {
                        block.fill(&all[range.start + start..range.start + end], |&triangle| triangle, corner);
                    }
                    Which::Listed(numbers) => block.fill(&numbers[start..end], |&i| all[i as usize], corner),
                }
            }
        }
        end - start
    }
}

/// Asks for a block's triangles.
#[inline(always)]
fn prefetch_block(triangles: &[[u32; 3]], start: usize) {
    /// Triangles in a cache line, rounded down.
    const LINE: usize = 64 / size_of::<[u32; 3]>();
    for i in (0..BLOCK).step_by(LINE) {
        prefetch(triangles, start + i);
    }
}

/// The voxel that the corners of blocks are seen from, so that they fit 32 bits wherever they may meet `clip`.
pub(super) fn base(mesh: &LatticeMesh<'_>, clip: &VoxelBox) -> [i64; 3] {
    match mesh.positions {
        LatticePositions::Narrow(_) => [0; 3],
        LatticePositions::Wide(_) => [0, 1, 2].map(|i| (clip.low[i] + clip.high[i]) / 2),
    }
}

/// The corners of a triangle.
#[inline(always)]
pub(super) fn corners(mesh: &LatticeMesh<'_>, [a, b, c]: [u32; 3]) -> [[i64; 3]; 3] {
    let corner = |vertex: u32| match &mesh.positions {
        LatticePositions::Narrow(positions) => {
            let [x, y, z] = positions[vertex as usize];
            [i64::from(x), i64::from(y), i64::from(z)]
        }
        LatticePositions::Wide(positions) => positions[vertex as usize],
    };
    [corner(a), corner(b), corner(c)]
}

/// The corners of the triangles of one load.
pub(super) struct Block {
    /// Of each corner, x and y of one triangle after the other.
    xy: [[[i32; 2]; BLOCK]; 3],
    z: [[i32; BLOCK]; 3],
}

impl Block {
    pub(super) const NONE: Self = Self { xy: [[[0; 2]; BLOCK]; 3], z: [[0; BLOCK]; 3] };

    #[inline(always)]
    fn fill<T>(&mut self, from: &[T], triangle: impl Fn(&T) -> [u32; 3], corner: impl Fn(u32) -> [i32; 3]) {
        for (lane, from) in from.iter().enumerate().take(BLOCK) {
            let triangle = triangle(from);
            for k in 0..3 {
                let [x, y, z] = corner(triangle[k]);
                self.xy[k][lane] = [x, y];
                self.z[k][lane] = z;
            }
        }
    }

    /// The corners of the [`LANES`] triangles from `first` on.
    #[inline(always)]
    pub(super) fn vectors<V: Simd>(&self, simd: V, first: usize) -> Vectors<V> {
        Vectors([self.corner(simd, 0, first), self.corner(simd, 1, first), self.corner(simd, 2, first)])
    }

    #[inline(always)]
    fn corner<V: Simd>(&self, simd: V, k: usize, first: usize) -> [i32x16<V>; 3] {
        let xy = self.xy[k][first..first + LANES].as_flattened();
        let (one, two) = (i32x16::from_slice(simd, &xy[..LANES]), i32x16::from_slice(simd, &xy[LANES..]));
        [one.unzip_low(two), one.unzip_high(two), row(simd, &self.z[k], first)]
    }
}

/// Corners of up to `N` triangles in lattice steps, axis by axis: corner k's axis i is row `3 k + i`.
pub(super) struct Corners<const N: usize> {
    rows: [[i32; N]; 9],
}

impl<const N: usize> Corners<N> {
    const NONE: Self = Self { rows: [[0; N]; 9] };

    /// The corners of the [`LANES`] triangles from `first` on.
    #[inline(always)]
    pub(super) fn vectors<V: Simd>(&self, simd: V, first: usize) -> Vectors<V> {
        let rows = &self.rows;
        // Written out, because arrays filled in loops are kept in memory and copied.
        Vectors([
            [row(simd, &rows[0], first), row(simd, &rows[1], first), row(simd, &rows[2], first)],
            [row(simd, &rows[3], first), row(simd, &rows[4], first), row(simd, &rows[5], first)],
            [row(simd, &rows[6], first), row(simd, &rows[7], first), row(simd, &rows[8], first)],
        ])
    }
}

/// The numbers of a row from `first` on.
#[inline(always)]
fn row<V: Simd>(simd: V, row: &[i32], first: usize) -> i32x16<V> {
    i32x16::from_slice(simd, &row[first..first + LANES])
}

/// Corners of [`LANES`] triangles: corner k's axis i is `[k][i]`.
#[derive(Clone, Copy)]
pub(super) struct Vectors<V: Simd>(pub(super) [[i32x16<V>; 3]; 3]);

/// One vector's corners in memory, for functions that are called.
pub(super) type Stored = Corners<LANES>;

/// A triangle's corners in two halves of the lanes, as floats.
pub(super) type Halves<V> = [[[f64x8<V>; 3]; 3]; 2];

impl<V: Simd> Vectors<V> {
    #[inline(always)]
    pub(super) fn stored(&self) -> Stored {
        let mut rows = Stored::NONE.rows;
        for k in 0..3 {
            for i in 0..3 {
                self.0[k][i].store_slice(&mut rows[3 * k + i]);
            }
        }
        Stored { rows }
    }

    #[inline(always)]
    pub(super) fn least(&self, axis: usize) -> i32x16<V> {
        self.0[0][axis].min(self.0[1][axis]).min(self.0[2][axis])
    }

    #[inline(always)]
    pub(super) fn most(&self, axis: usize) -> i32x16<V> {
        self.0[0][axis].max(self.0[1][axis]).max(self.0[2][axis])
    }

    /// The voxels whose closed cubes meet the triangles' closed bounding boxes: lowest and highest along each axis.
    #[inline(always)]
    pub(super) fn boxes(&self) -> [[i32x16<V>; 3]; 2] {
        let (least, most) = ([self.least(0), self.least(1), self.least(2)], [self.most(0), self.most(1), self.most(2)]);
        [
            [(least[0] - 1) >> STEP_BITS, (least[1] - 1) >> STEP_BITS, (least[2] - 1) >> STEP_BITS],
            [most[0] >> STEP_BITS, most[1] >> STEP_BITS, most[2] >> STEP_BITS],
        ]
    }

    /// The corners as seen from `origin`, times `scale`, a power of two: exact within 2^22 steps.
    #[inline(always)]
    pub(super) fn floats(&self, origin: [i32x16<V>; 3], scale: f32) -> [[f32x16<V>; 3]; 3] {
        let bias = scale * BIAS;
        let bits = bias.to_bits().cast_signed();
        let origin = [origin[0] - bits, origin[1] - bits, origin[2] - bits];
        let [a, b, c] = self.0;
        [local(a, origin, bias), local(b, origin, bias), local(c, origin, bias)]
    }

    /// [`Self::floats`] in two halves of the lanes, wide enough to calculate with.
    #[inline(always)]
    pub(super) fn halves(&self, simd: V, origin: [i32x16<V>; 3], scale: f32) -> Halves<V> {
        let floats = self.floats(origin, scale);
        let mut halves = [[[f64x8::splat(simd, 0.0); 3]; 3]; 2];
        for k in 0..3 {
            for i in 0..3 {
                let (first, second) = floats[k][i].widen();
                halves[0][k][i] = first;
                halves[1][k][i] = second;
            }
        }
        halves
    }
}

/// The middle of the floats that are 1 apart: what is added to their bits is added to them, so that whole numbers become floats
/// without a conversion.
const BIAS: f32 = 3.0 * (1 << 22) as f32;

/// A corner as seen from `origin`, of which the bits of `bias` were subtracted.
#[inline(always)]
fn local<V: Simd>(corner: [i32x16<V>; 3], origin: [i32x16<V>; 3], bias: f32) -> [f32x16<V>; 3] {
    [
        (corner[0] - origin[0]).bitcast::<f32x16<V>>() - bias,
        (corner[1] - origin[1]).bitcast::<f32x16<V>>() - bias,
        (corner[2] - origin[2]).bitcast::<f32x16<V>>() - bias,
    ]
}

/// Triangles that wait for their path at most: several vectors' worth, for the reason given at [`BLOCK`].
const WAITING: usize = 128;

/// Triangles of one kind that wait until there are enough for all lanes.
pub(super) struct Queue {
    corners: Corners<WAITING>,
    count: usize,
}

impl Queue {
    pub(super) const EMPTY: Self = Self { corners: Corners::NONE, count: 0 };

    /// Adds the triangles of the lanes in `mask`; `true` when [`Self::for_each`] must follow before the next ones.
    #[inline(always)]
    pub(super) fn push<V: Simd>(&mut self, simd: V, from: &Vectors<V>, mask: u64) -> bool {
        let lanes = fearless_simd::mask32x16::from_bitmask(simd, mask);
        let at = self.count.min(WAITING - LANES);
        for k in 0..3 {
            for i in 0..3 {
                from.0[k][i].compress(lanes).store_slice(&mut self.corners.rows[3 * k + i][at..at + LANES]);
            }
        }
        self.count += mask.count_ones() as usize;
        self.count > WAITING - LANES
    }

    /// Calls `each` with vectors of the triangles that wait and how many of the lanes are used: with as many as fill vectors,
    /// which then wait no longer, or with all. Whoever does that with much code does it out of line, so that it is compiled
    /// once for the calls before and after the last triangle.
    #[inline(always)]
    pub(super) fn for_each<V: Simd>(&mut self, simd: V, all: bool, mut each: impl FnMut(&Vectors<V>, usize)) {
        simd.vectorize(
            #[inline(always)]
            || {
                let mut first = 0;
                loop {
                    let lanes = self.count.saturating_sub(first).min(LANES);
                    if lanes == 0 || lanes < LANES && !all {
                        break;
                    }
                    each(&self.vectors(simd, first), lanes);
                    first += LANES;
                }
                self.keep(simd, first);
            },
        );
    }

    /// The triangles that wait from `first` on; beyond the last, anything.
    #[inline(always)]
    fn vectors<V: Simd>(&self, simd: V, first: usize) -> Vectors<V> {
        self.corners.vectors(simd, first.min(WAITING - LANES))
    }

    /// Keeps the triangles, fewer than a vector's, from `first` on.
    #[inline(always)]
    fn keep<V: Simd>(&mut self, simd: V, first: usize) {
        let kept = self.vectors(simd, first);
        for k in 0..3 {
            for i in 0..3 {
                kept.0[k][i].store_slice(&mut self.corners.rows[3 * k + i][..LANES]);
            }
        }
        self.count = self.count.saturating_sub(first);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conformance::random::Random;
    use crate::cpu::instructions::Instructions;

    /// Corners become floats exactly, as far from the origin as is allowed and wherever that is.
    fn floats_are_exact<V: Simd>(simd: V) {
        const FARTHEST: i64 = 1 << 22;
        let mut random = Random::new(11);
        for round in 0..200 {
            let origin: [i32; 3] = std::array::from_fn(|_| {
                let ends = i64::from(i32::MAX) - FARTHEST;
                i32::try_from(random.range(-ends, ends)).unwrap()
            });
            let mut from_origin = || {
                let steps = match round % 4 {
                    0 => random.range(-1, 1),
                    1 => [-FARTHEST, FARTHEST][usize::try_from(random.range(0, 1)).unwrap()],
                    _ => random.range(-FARTHEST, FARTHEST),
                };
                i32::try_from(steps).unwrap()
            };
            let steps: [[[i32; LANES]; 3]; 3] =
                std::array::from_fn(|_| std::array::from_fn(|_| std::array::from_fn(|_| from_origin())));
            let corner = |k: usize| [0, 1, 2].map(|i| i32x16::from_slice(simd, &steps[k][i]) + origin[i]);
            let corners = Vectors([corner(0), corner(1), corner(2)]);
            let origin = origin.map(|at| i32x16::splat(simd, at));
            for scale in [1.0, 2f32.powi(-15), 2f32.powi(-16)] {
                let floats = corners.floats(origin, scale);
                for (k, i, lane) in (0..9 * LANES).map(|at| (at / LANES / 3, at / LANES % 3, at % LANES)) {
                    let expected = f64::from(steps[k][i][lane]) * f64::from(scale);
                    assert_eq!(f64::from(floats[k][i][lane]), expected, "scale {scale}");
                }
            }
        }
    }

    #[test]
    fn corners_become_floats_exactly() {
        for level in Instructions::ALL {
            fearless_simd::dispatch!(level.level(), simd => floats_are_exact(simd));
        }
    }
}
