//! The kernel: one triangle after the other, each to the path for its size.
//!
//! The voxels that one triangle sets in one grid column along z are one run, whatever the mode. How its ends are found
//! depends on the size of the triangle's box:
//!
//! | box | path |
//! |---|---|
//! | one voxel along at least two axes, where touching is enough | the box itself |
//! | at most four voxels along each axis | [`tiny`]: eight triangles at a time |
//! | at most 64 voxels | [`rows`]: eight columns at a time |
//! | larger | [`large`]: runs that follow lines |

use fearless_simd::Simd;

use super::number::SMALL_EXTENT;
use super::rule::{Rule, SurfaceRule};
use super::sink::Sink;
use super::tiny::TinyBox;
use super::triangles::Selected;
use super::{large, rows, tiny};
use crate::lattice::{STEP_BITS, STEPS_PER_VOXEL};

/// The voxel indices of a box, both ends included.
#[derive(Clone, Copy, Debug)]
pub(super) struct VoxelBox {
    pub(super) low: [i64; 3],
    pub(super) high: [i64; 3],
}

impl VoxelBox {
    /// The voxels whose closed cubes meet the triangle's closed bounding box.
    #[inline(always)]
    pub(super) fn around([a, b, c]: &[[i64; 3]; 3]) -> Self {
        let low = |i: usize| (a[i].min(b[i]).min(c[i]) - 1) >> STEP_BITS;
        let high = |i: usize| a[i].max(b[i]).max(c[i]) >> STEP_BITS;
        Self { low: [low(0), low(1), low(2)], high: [high(0), high(1), high(2)] }
    }

    /// The part inside `other`, or `None` if there is none.
    #[inline(always)]
    fn clipped(&self, other: &Self) -> Option<Self> {
        let low = |i: usize| self.low[i].max(other.low[i]);
        let high = |i: usize| self.high[i].min(other.high[i]);
        let (low, high) = ([low(0), low(1), low(2)], [high(0), high(1), high(2)]);
        (low[0] <= high[0] && low[1] <= high[1] && low[2] <= high[2]).then_some(Self { low, high })
    }

    /// Voxels along each axis, less one.
    #[inline(always)]
    pub(super) fn extent(&self) -> [i64; 3] {
        [self.high[0] - self.low[0], self.high[1] - self.low[1], self.high[2] - self.low[2]]
    }

    /// Whether the box meets `other`, and lies inside it along z.
    #[inline(always)]
    fn meets_with_all_of_z(&self, other: &Self) -> bool {
        (self.high[0] >= other.low[0])
            & (self.high[1] >= other.low[1])
            & (self.low[2] >= other.low[2])
            & (self.low[0] <= other.high[0])
            & (self.low[1] <= other.high[1])
            & (self.high[2] <= other.high[2])
    }
}

/// Buffers that one thread keeps between triangles.
#[derive(Default)]
struct Scratch {
    rows: rows::Scratch,
    large: large::Scratch,
}

/// Sends the voxels of a surface mode inside `clip` to `sink`.
#[inline(always)]
pub(super) fn surface<V: Simd, R: SurfaceRule>(
    simd: V,
    rule: &R,
    triangles: Selected<'_>,
    clip: &VoxelBox,
    sink: &mut impl Sink,
) {
    let mut scratch = Scratch::default();
    let mut tiny = Tiny::new();
    triangles.for_each(
        #[inline(always)]
        |triangle| {
            let around = VoxelBox::around(triangle);
            let extent = around.extent();
            if extent[0] | extent[1] | extent[2] <= 3 && around.meets_with_all_of_z(clip) {
                tiny.push(simd, rule, triangle, &TinyBox::new(&around, clip), sink);
                return;
            }
            let Some(clipped) = around.clipped(clip) else { return };
            if R::TOUCH_IS_ENOUGH && extent[0].min(1) + extent[1].min(1) + extent[2].min(1) <= 1 {
                // Strictly inside a row of voxels.
                for x in clipped.low[0]..=clipped.high[0] {
                    for y in clipped.low[1]..=clipped.high[1] {
                        sink.run(x, y, clipped.low[2], clipped.high[2]);
                    }
                }
                return;
            }
            by_size(simd, rule, triangle, &around, &clipped, sink, &mut scratch);
        },
    );
    tiny.flush(simd, rule, sink);
}

/// `extent + 1` bits, `step` apart.
#[inline(always)]
fn row_bits(extent: i64, step: u32) -> u64 {
    let all = 1 | 1 << step | 1 << (2 * step) | 1 << (3 * step);
    all & ((2 << (extent * i64::from(step))) - 1)
}

/// The batches of tiny triangles, by the size of their boxes.
struct Tiny {
    cubes2: tiny::Cubes<2>,
    cubes3: tiny::Cubes<3>,
    cubes4: tiny::Cubes<4>,
    flats2: tiny::Flats<2>,
    flats4: tiny::Flats<4>,
}

impl Tiny {
    fn new() -> Self {
        Self {
            cubes2: tiny::Cubes::new(),
            cubes3: tiny::Cubes::new(),
            cubes4: tiny::Cubes::new(),
            flats2: tiny::Flats::new(),
            flats4: tiny::Flats::new(),
        }
    }

    /// Takes a triangle whose box has at most four voxels along each axis.
    #[inline(always)]
    fn push<V: Simd, R: SurfaceRule>(
        &mut self,
        simd: V,
        rule: &R,
        triangle: &[[i64; 3]; 3],
        tiny: &TinyBox,
        sink: &mut impl Sink,
    ) {
        let extent = tiny.extent;
        let longest = extent[0].max(extent[1]).max(extent[2]);
        if R::TOUCH_IS_ENOUGH {
            let axes = extent[0].min(1) + extent[1].min(1) + extent[2].min(1);
            if axes <= 1 {
                // Strictly inside a row of voxels, and connected: it meets them all. Bits of a cube of four.
                let bits = row_bits(extent[2], 1) | row_bits(extent[1], 4) | row_bits(extent[0], 16);
                sink.cube::<4>(tiny.low, bits & tiny.keep::<4>());
                return;
            }
            if axes == 2 {
                if longest <= 1 {
                    if self.flats2.push(triangle, tiny) {
                        simd.vectorize(
                            #[inline(always)]
                            || self.flats2.flush(simd, rule, sink),
                        );
                    }
                } else if self.flats4.push(triangle, tiny) {
                    simd.vectorize(
                        #[inline(always)]
                        || self.flats4.flush(simd, rule, sink),
                    );
                }
                return;
            }
        }
        if longest <= 1 {
            if self.cubes2.push(triangle, tiny) {
                simd.vectorize(
                    #[inline(always)]
                    || self.cubes2.flush(simd, rule, sink),
                );
            }
        } else if longest <= 2 {
            if self.cubes3.push(triangle, tiny) {
                simd.vectorize(
                    #[inline(always)]
                    || self.cubes3.flush(simd, rule, sink),
                );
            }
        } else if self.cubes4.push(triangle, tiny) {
            simd.vectorize(
                #[inline(always)]
                || self.cubes4.flush(simd, rule, sink),
            );
        }
    }

    /// Sends the voxels of all triangles that still wait.
    #[inline(always)]
    fn flush<V: Simd, R: SurfaceRule>(&mut self, simd: V, rule: &R, sink: &mut impl Sink) {
        self.cubes2.flush(simd, rule, sink);
        self.cubes3.flush(simd, rule, sink);
        self.cubes4.flush(simd, rule, sink);
        self.flats2.flush(simd, rule, sink);
        self.flats4.flush(simd, rule, sink);
    }
}

/// Sends the voxels of a mode that looks along z from voxel centres to `sink`.
///
/// For [`super::rule::Solid`], the sink gets runs from the lowest voxel whose centre is not below the triangle to the top
/// of the clip; a triangle below the clip gives whole columns.
#[inline(always)]
pub(super) fn centres<V: Simd, R: Rule>(
    simd: V,
    rule: &R,
    triangles: Selected<'_>,
    clip: &VoxelBox,
    sink: &mut impl Sink,
) {
    const HALF: i64 = (STEPS_PER_VOXEL / 2) as i64;
    let mut scratch = Scratch::default();
    triangles.for_each(
        #[inline(always)]
        |triangle| {
            let [a, b, c] = triangle;
            // The columns whose centres are inside the closed box: for small triangles mostly none.
            let low = |i: usize| (a[i].min(b[i]).min(c[i]) - HALF + (2 * HALF - 1)) >> STEP_BITS;
            let high = |i: usize| (a[i].max(b[i]).max(c[i]) - HALF) >> STEP_BITS;
            let columns = VoxelBox {
                low: [low(0).max(clip.low[0]), low(1).max(clip.low[1]), clip.low[2]],
                high: [high(0).min(clip.high[0]), high(1).min(clip.high[1]), clip.high[2]],
            };
            if columns.low[0] <= columns.high[0] && columns.low[1] <= columns.high[1] {
                let around = VoxelBox::around(triangle);
                by_size(simd, rule, triangle, &around, &columns, sink, &mut scratch);
            }
        },
    );
}

/// The path for a triangle that is not tiny.
#[inline(always)]
fn by_size<V: Simd, R: Rule>(
    simd: V,
    rule: &R,
    triangle: &[[i64; 3]; 3],
    around: &VoxelBox,
    clipped: &VoxelBox,
    sink: &mut impl Sink,
    scratch: &mut Scratch,
) {
    let extent = around.extent();
    if extent[0].max(extent[1]).max(extent[2]) <= SMALL_EXTENT && rule.fits_small() {
        simd.vectorize(
            #[inline(always)]
            || rows::voxelize(simd, rule, triangle, around, clipped, sink, &mut scratch.rows),
        );
    } else {
        large::voxelize(rule, triangle, around, clipped, sink, &mut scratch.large);
    }
}
