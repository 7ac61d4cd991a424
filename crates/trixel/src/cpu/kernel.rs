//! The kernel: one triangle after the other, each to the path for its size.
//!
//! The voxels that one triangle sets in one grid column along z are one run, whatever the mode. How its ends are found
//! depends on the size of the triangle's box:
//!
//! | box | path |
//! |---|---|
//! | at most two voxels along each axis, where touching is enough | [`octants`](super::octants): sixteen triangles at a time |
//! | at most three, on surfaces | [`tiny`]: sixteen triangles at a time |
//! | at most sixteen along z, and 16 by 8 or 32 by 2 columns, on surfaces | [`columns`](super::columns): a column of sixteen triangles at a time |
//! | at most four, in mode solid | [`crossings`]: sixteen triangles at a time |
//! | one voxel along two axes, where touching is enough | the box itself |
//! | at most 64 voxels | [`rows`]: eight columns of a triangle at a time |
//! | larger | [`large`]: runs that follow lines |

use fearless_simd::{Simd, i32x16, prelude::*};

use super::columns::Columns;
use super::number::SMALL_EXTENT;
use super::rule::{Solid, SurfaceRule, VectorRule};
use super::sink::{CubeSink, Sink};
use super::triangles::{Block, LANES, Lanes, Queue, Selected, Vectors, base};
use super::{crossings, large, rows, tiny};
use crate::lattice::{LatticeMesh, STEP_BITS, STEPS_PER_VOXEL};

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

    /// The columns whose centres are inside the triangle's closed bounding box, from the bottom to the top of `clip`.
    #[inline(always)]
    pub(super) fn columns([a, b, c]: &[[i64; 3]; 3], clip: &Self) -> Self {
        const HALF: i64 = (STEPS_PER_VOXEL / 2) as i64;
        let low = |i: usize| (a[i].min(b[i]).min(c[i]) + HALF - 1) >> STEP_BITS;
        let high = |i: usize| (a[i].max(b[i]).max(c[i]) - HALF) >> STEP_BITS;
        Self { low: [low(0), low(1), clip.low[2]], high: [high(0), high(1), clip.high[2]] }
    }

    /// The part inside `other`, or `None` if there is none.
    #[inline(always)]
    pub(super) fn clipped(&self, other: &Self) -> Option<Self> {
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
}

/// What one thread keeps between triangles that are not tiny.
#[derive(Default)]
struct Others {
    rows: rows::Rows,
    large: large::Scratch,
}

/// Lanes from which on it pays to look for triangles strictly inside a voxel or a row of two.
const WORTH_BOXES: u32 = 4;

/// Lanes from which on it pays to do triangles of at most two voxels along each axis without gathering more: by octants, or
/// by more tests.
const WORTH_OCTANTS: u32 = 9;
const WORTH_CUBES: u32 = 12;

/// Sends the voxels of a surface mode inside `clip` to `sink`, until it is full or there are no more pieces.
#[inline(always)]
pub(super) fn surface<'a, V: Simd, R: SurfaceRule, S: CubeSink>(
    simd: V,
    rule: &R,
    mesh: &LatticeMesh<'_>,
    pieces: impl Iterator<Item = Selected<'a>>,
    clip: &VoxelBox,
    sink: &mut S,
) {
    let mut others = Others::default();
    let (mut waiting, mut columns) = (TinyQueues::new(), Columns::new());
    let base = base(mesh, clip);
    let near = NearClip::new(simd, clip, base);
    for_each_vector(
        simd,
        pieces,
        base,
        sink,
        #[inline(always)]
        |sink, triangles, at, corners, lanes| {
            let [low, high] = corners.boxes();
            let meets = near.meets(&low, &high) & lanes;
            if meets == 0 {
                return;
            }
            let extent = [high[0] - low[0], high[1] - low[1], high[2] - low[2]];
            let longest = extent[0].max(extent[1]).max(extent[2]);
            let at_most = |voxels: i32| longest.simd_le(voxels - 1).to_bitmask();
            let inside = near.holds_z(&low, &high) & meets;
            let mut tiny = at_most(3) & inside;
            let mut settled = 0;
            if R::TOUCH_IS_ENOUGH {
                let boxed = (extent[0] + extent[1] + extent[2]).simd_le(1).to_bitmask() & tiny;
                if boxed.count_ones() >= WORTH_BOXES {
                    settled = boxed & near.holds_xy(&low, &high);
                    tiny &= !settled;
                    simd.vectorize(
                        #[inline(always)]
                        || tiny::send_boxes(simd, &low, &extent, settled, &near, sink),
                    );
                }
            }
            let two = at_most(2) & tiny;
            if R::TOUCH_IS_ENOUGH {
                if two.count_ones() >= WORTH_OCTANTS {
                    simd.vectorize(
                        #[inline(always)]
                        || tiny::send_octants(simd, &corners, two, &near, sink),
                    );
                } else if two != 0 && waiting.twos.push(simd, &corners, two) {
                    tiny::flush_octants(simd, &mut waiting.twos, false, &near, sink);
                }
            } else if two.count_ones() >= WORTH_CUBES {
                let flat = extent[0].min(extent[1]).min(extent[2]).simd_le(0).to_bitmask();
                if two & !flat == 0 {
                    simd.vectorize(
                        #[inline(always)]
                        || tiny::flats::<_, _, 2>(simd, rule, &corners, two, &near, sink),
                    );
                } else {
                    simd.vectorize(
                        #[inline(always)]
                        || tiny::send_cubes::<_, _, 2>(simd, rule, &corners, two, &near, sink),
                    );
                }
            } else if two != 0 && waiting.twos.push(simd, &corners, two) {
                tiny::flush::<_, _, 2>(simd, rule, &mut waiting.twos, false, &near, sink);
            }
            tiny &= !two;
            if tiny != 0 {
                let shortest = extent[0].min(extent[1]).min(extent[2]);
                let flat = shortest.simd_le(0).to_bitmask() & tiny;
                if flat != 0 && waiting.flat_threes.push(simd, &corners, flat) {
                    tiny::flush_flats::<_, _, 3>(simd, rule, &mut waiting.flat_threes, false, &near, sink);
                }
                if tiny & !flat != 0 && waiting.threes.push(simd, &corners, tiny & !flat) {
                    tiny::flush::<_, _, 3>(simd, rule, &mut waiting.threes, false, &near, sink);
                }
            }
            let mut left = meets & !settled & !two & !tiny;
            if S::LEAVES {
                leave(triangles, at, left, [[low[0], high[0]], [low[1], high[1]]], &near, sink);
            } else if left != 0 {
                left = columns.push(simd, rule, &corners, &extent, left, &near, &mut others.rows, sink);
                if left != 0 {
                    // A copy, so that corners need not be in memory anywhere else.
                    let stored = corners;
                    others.send(simd, rule, triangles, at, &stored, left, clip, &near, sink);
                }
            }
        },
    );
    if R::TOUCH_IS_ENOUGH {
        tiny::flush_octants(simd, &mut waiting.twos, true, &near, sink);
    } else {
        tiny::flush::<_, _, 2>(simd, rule, &mut waiting.twos, true, &near, sink);
    }
    tiny::flush_flats::<_, _, 3>(simd, rule, &mut waiting.flat_threes, true, &near, sink);
    tiny::flush::<_, _, 3>(simd, rule, &mut waiting.threes, true, &near, sink);
    if !S::LEAVES {
        columns.finish(simd, rule, &near, &mut others.rows, sink);
    }
    others.finish(simd, rule, &near, sink);
    sink.finish(simd);
}

/// Leaves the triangles in `lanes` of the vector that starts with the `at`th, with the columns that they have along
/// x and y.
#[inline(always)]
fn leave<V: Simd>(
    triangles: &Selected<'_>,
    at: usize,
    lanes: Lanes,
    [[x, x_last], [y, _]]: [[i32x16<V>; 2]; 2],
    near: &NearClip<V>,
    sink: &mut impl Sink,
) {
    if lanes != 0 {
        let (from, to) = ([*x.max(near.low[0]), *y.max(near.low[1])], *x_last.min(near.high[0]));
        for lane in set_bits(lanes) {
            let along = |i: usize, of: &[i32; LANES]| near.base[i] + i64::from(of[lane % LANES]);
            sink.leave(triangles.number(at + lane), [along(0, &from[0]), along(0, &to)], along(1, &from[1]));
        }
    }
}

/// Sends the voxels of mode sliced inside `clip`, or the toggles of mode solid, to `sink`, until it is full or there are no
/// more pieces: as if no triangle were tiny.
#[inline(always)]
pub(super) fn not_tiny<'a, V: Simd, R: VectorRule, S: Sink>(
    simd: V,
    rule: &R,
    mesh: &LatticeMesh<'_>,
    pieces: impl Iterator<Item = Selected<'a>>,
    clip: &VoxelBox,
    sink: &mut S,
) {
    let mut others = Others::default();
    let base = base(mesh, clip);
    let near = NearClip::new(simd, clip, base);
    for_each_vector(
        simd,
        pieces,
        base,
        sink,
        #[inline(always)]
        |sink, triangles, at, corners, mut lanes| {
            let columns = crossings::columns(&corners, &near);
            for [first, last] in columns {
                lanes &= first.simd_le(last).to_bitmask();
            }
            if S::LEAVES {
                leave(triangles, at, lanes, columns, &near, sink);
            } else if lanes != 0 {
                others.send(simd, rule, triangles, at, &corners, lanes, clip, &near, sink);
            }
        },
    );
    others.finish(simd, rule, &near, sink);
}

impl Others {
    /// Sends the voxels of the triangles in `lanes` of the vector that starts with the `at`th, some perhaps later.
    ///
    /// Out of line: its code would slow down tiny triangles' paths.
    #[inline(never)]
    #[expect(clippy::too_many_arguments, reason = "a step of the kernel")]
    fn send<V: Simd, R: VectorRule>(
        &mut self,
        simd: V,
        rule: &R,
        triangles: &Selected<'_>,
        at: usize,
        corners: &Vectors<V>,
        mut lanes: Lanes,
        clip: &VoxelBox,
        near: &NearClip<V>,
        sink: &mut impl Sink,
    ) {
        simd.vectorize(
            #[inline(always)]
            || {
                let [low, high] = corners.boxes();
                let extent = [high[0] - low[0], high[1] - low[1], high[2] - low[2]];
                if R::TOUCH_IS_ENOUGH {
                    // Strictly inside a row of voxels.
                    let row = (extent[0].min(1) + extent[1].min(1) + extent[2].min(1)).simd_le(1).to_bitmask() & lanes;
                    if row != 0 {
                        send_whole(row, &low, &high, near, sink);
                        lanes &= !row;
                    }
                }
                #[expect(clippy::cast_possible_truncation, reason = "63")]
                let short = extent[0].max(extent[1]).max(extent[2]).simd_le(SMALL_EXTENT as i32).to_bitmask();
                let small = if rule.fits_small() { short & lanes } else { 0 };
                if small != 0 && self.rows.push(simd, corners, small) {
                    self.rows.send(simd, rule, false, near, sink);
                }
                for lane in set_bits(lanes & !small) {
                    large::voxelize(simd.level(), rule, &triangles.corners(at + lane), clip, sink, &mut self.large);
                }
            },
        );
    }

    /// Sends what waits.
    #[inline(always)]
    fn finish<V: Simd, R: VectorRule, S: Sink>(&mut self, simd: V, rule: &R, near: &NearClip<V>, sink: &mut S) {
        if !S::LEAVES {
            self.rows.send(simd, rule, true, near, sink);
        }
    }
}

/// Sends all voxels inside the clip of the boxes of the lanes in `mask`.
#[inline(always)]
fn send_whole<V: Simd>(
    mask: Lanes,
    low: &[i32x16<V>; 3],
    high: &[i32x16<V>; 3],
    near: &NearClip<V>,
    sink: &mut impl Sink,
) {
    let from = [*low[0].max(near.low[0]), *low[1].max(near.low[1]), *low[2].max(near.low[2])];
    let to = [*high[0].min(near.high[0]), *high[1].min(near.high[1]), *high[2].min(near.high[2])];
    for lane in set_bits(mask) {
        let along = |i: usize, of: &[i32; LANES]| near.base[i] + i64::from(of[lane % LANES]);
        for x in along(0, &from[0])..=along(0, &to[0]) {
            for y in along(1, &from[1])..=along(1, &to[1]) {
                sink.run(x, y, along(2, &from[2]), along(2, &to[2]));
            }
        }
    }
}

/// Calls `each` with the sink, and of every vector of triangles the piece they are of, the number of the first, the corners
/// and the used lanes.
#[inline(always)]
fn for_each_vector<'a, V: Simd, S: Sink>(
    simd: V,
    mut pieces: impl Iterator<Item = Selected<'a>>,
    base: [i64; 3],
    sink: &mut S,
    mut each: impl FnMut(&mut S, &Selected<'a>, usize, Vectors<V>, Lanes),
) {
    let mut block = Block::NONE;
    while !sink.is_full()
        && let Some(triangles) = pieces.next()
    {
        let mut start = 0;
        while start < triangles.len() {
            let count = triangles.load(start, base, &mut block);
            let mut first = 0;
            while first < count {
                let lanes = Lanes::MAX >> (64 - (count - first).min(LANES));
                each(sink, &triangles, start + first, block.vectors(simd, first), lanes);
                first += LANES;
            }
            start += count;
        }
    }
}

/// The numbers of the bits that are set, ascending.
#[inline(always)]
pub(super) fn set_bits(mut mask: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (mask != 0).then_some(mask.trailing_zeros() as usize);
        mask &= mask.wrapping_sub(1);
        bit
    })
}

/// The clip as seen from the base of a block's corners.
pub(super) struct NearClip<V: Simd> {
    pub(super) base: [i64; 3],
    pub(super) low: [i32x16<V>; 3],
    pub(super) high: [i32x16<V>; 3],
}

impl<V: Simd> NearClip<V> {
    #[inline(always)]
    pub(super) fn new(simd: V, clip: &VoxelBox, base: [i64; 3]) -> Self {
        let splat = |voxel: [i64; 3]| {
            // Clips are pieces of grids, which have at most 32768 voxels along an axis.
            let near =
                |i: usize| i32::try_from(voxel[i] - base[i]).unwrap_or(if voxel[i] < base[i] { -LIMIT } else { LIMIT });
            [i32x16::splat(simd, near(0)), i32x16::splat(simd, near(1)), i32x16::splat(simd, near(2))]
        };
        const LIMIT: i32 = 1 << 30;
        Self { base, low: splat(clip.low), high: splat(clip.high) }
    }

    /// The lanes whose boxes meet the clip.
    #[inline(always)]
    pub(super) fn meets(&self, low: &[i32x16<V>; 3], high: &[i32x16<V>; 3]) -> u64 {
        let mut meets = low[0].simd_le(self.high[0]) & high[0].simd_ge(self.low[0]);
        for i in 1..3 {
            meets = meets & low[i].simd_le(self.high[i]) & high[i].simd_ge(self.low[i]);
        }
        meets.to_bitmask()
    }

    /// The lanes whose boxes are inside the clip along x and y.
    #[inline(always)]
    pub(super) fn holds_xy(&self, low: &[i32x16<V>; 3], high: &[i32x16<V>; 3]) -> u64 {
        let x = low[0].simd_ge(self.low[0]) & high[0].simd_le(self.high[0]);
        (x & low[1].simd_ge(self.low[1]) & high[1].simd_le(self.high[1])).to_bitmask()
    }

    /// The lanes whose boxes are inside the clip along z.
    #[inline(always)]
    fn holds_z(&self, low: &[i32x16<V>; 3], high: &[i32x16<V>; 3]) -> u64 {
        (low[2].simd_ge(self.low[2]) & high[2].simd_le(self.high[2])).to_bitmask()
    }
}

/// The tiny triangles that wait, by the size of their boxes.
struct TinyQueues {
    twos: Queue,
    threes: Queue,
    /// At most three voxels along two axes, and one along the third.
    flat_threes: Queue,
}

impl TinyQueues {
    fn new() -> Self {
        const NONE: Queue = Queue::EMPTY;
        Self { twos: NONE, threes: NONE, flat_threes: NONE }
    }
}

/// Sends the toggles of mode solid inside `clip` to `sink`: runs from the lowest voxel whose centre is not below the
/// triangle to the top of the clip. A triangle below the clip gives whole columns.
#[inline(always)]
pub(super) fn solid<'a, V: Simd, S: Sink>(
    simd: V,
    rule: &Solid,
    mesh: &LatticeMesh<'_>,
    pieces: impl Iterator<Item = Selected<'a>>,
    clip: &VoxelBox,
    sink: &mut S,
) {
    let mut others = Others::default();
    // Those with centres of at most two by two columns, and of four by four.
    let (mut twos, mut fours) = (Queue::EMPTY, Queue::EMPTY);
    let base = base(mesh, clip);
    let near = NearClip::new(simd, clip, base);
    for_each_vector(
        simd,
        pieces,
        base,
        sink,
        #[inline(always)]
        |sink, triangles, at, corners, lanes| {
            let columns = crossings::columns(&corners, &near);
            let mut some = lanes;
            let mut few = lanes;
            for [low, high] in columns {
                some &= low.simd_le(high).to_bitmask();
                few &= (high - low).simd_le(1).to_bitmask();
            }
            if some == 0 {
                return;
            }
            let [low, high] = corners.boxes();
            let longest = (high[0] - low[0]).max(high[1] - low[1]).max(high[2] - low[2]);
            let tiny = some & longest.simd_le(3).to_bitmask();
            let (two, four) = (tiny & few, tiny & !few);
            if two != 0 && twos.push(simd, &corners, two) {
                crossings::flush::<_, 2>(simd, &mut twos, false, &near, clip, sink);
            }
            if four != 0 && fours.push(simd, &corners, four) {
                crossings::flush::<_, 4>(simd, &mut fours, false, &near, clip, sink);
            }
            if S::LEAVES {
                leave(triangles, at, some & !tiny, columns, &near, sink);
            } else if some & !tiny != 0 {
                others.send(simd, rule, triangles, at, &corners, some & !tiny, clip, &near, sink);
            }
        },
    );
    crossings::flush::<_, 2>(simd, &mut twos, true, &near, clip, sink);
    crossings::flush::<_, 4>(simd, &mut fours, true, &near, clip, sink);
    others.finish(simd, rule, &near, sink);
}
