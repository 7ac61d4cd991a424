//! Sparse occupancy: bricks of 8 x 8 x 8 voxels, for grids whose dense bits would not fit the memory.
//!
//! Bricks without a set voxel are not stored, and bricks without an unset one are stored as runs along z, so that memory
//! follows the surface, also of a solid. The bricks over 64 x 64 columns make a *pillar*; a pillar is built by one
//! thread and never changed after.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::grid::Grid;
use crate::lattice::STEP_BITS;
use crate::volume::{Volume, VolumeError, WORD_BITS};

/// Voxels along the edge of a brick.
pub(crate) const BRICK_SIDE: u32 = 8;
/// Columns along the edge of a pillar.
pub(crate) const PILLAR_SIDE: u32 = 64;
/// Bars of bricks along the edge of a pillar.
const BARS: u32 = PILLAR_SIDE / BRICK_SIDE;

/// 8 x 8 x 8 voxels: bit z of byte y of word x.
pub(crate) type Brick = [u64; BRICK_SIDE as usize];

/// Set voxels that can be visited in order, however they are stored.
///
/// ```
/// use trixel::{Grid, Occupancy, Volume};
/// fn first_in_layer(voxels: &impl Occupancy, x: u32) -> Option<[u32; 3]> {
///     let [_, ny, nz] = voxels.grid().dims();
///     let mut first = None;
///     voxels.for_each_word(&[x..x + 1, 0..ny, 0..nz], |[x, y, z], word| {
///         first.get_or_insert([x, y, z + word.trailing_zeros()]);
///     });
///     first
/// }
/// let mut volume = Volume::new(Grid::new([0.0; 3], [1.0; 3], [4, 5, 6])?)?;
/// volume.set([2, 3, 4]);
/// assert_eq!(first_in_layer(&volume, 2), Some([2, 3, 4]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Occupancy: Sync {
    /// The grid.
    fn grid(&self) -> &Grid;

    /// How many voxels are set.
    fn count(&self) -> u64;

    /// Calls `visit` for the set voxels `[x, y, z]` in `range`, up to 64 along z at a time, sorted by x, then y, then z:
    /// bit i of the word, which is not 0, is the voxel `[x, y, z + i]`. The word may start before the range, by less than
    /// 64; its set bits do not. Voxels outside the grid are not set.
    fn for_each_word(&self, range: &[Range<u32>; 3], visit: impl FnMut([u32; 3], u64));
}

/// The bits of a word, which starts at z = `start`, that are in `range`.
fn in_range(word: u64, start: u32, range: &Range<u32>) -> u64 {
    if range.end <= start || range.start >= start + WORD_BITS {
        return 0;
    }
    let from = u64::MAX << range.start.saturating_sub(start);
    let to = u64::MAX >> (start + WORD_BITS).saturating_sub(range.end);
    word & from & to
}

impl Occupancy for Volume {
    fn grid(&self) -> &Grid {
        Self::grid(self)
    }

    fn count(&self) -> u64 {
        Self::count(self)
    }

    fn for_each_word(&self, [xs, ys, zs]: &[Range<u32>; 3], mut visit: impl FnMut([u32; 3], u64)) {
        let [nx, ny, _] = self.grid().dims();
        let first = zs.start / WORD_BITS;
        for x in xs.start..xs.end.min(nx) {
            for y in ys.start..ys.end.min(ny) {
                let words = self.column(x, y).iter().skip(first as usize);
                for (start, &word) in (first * WORD_BITS..zs.end).step_by(WORD_BITS as usize).zip(words) {
                    let bits = in_range(word, start, zs);
                    if bits != 0 {
                        visit([x, y, start], bits);
                    }
                }
            }
        }
    }
}

/// The set voxels of a [`Grid`] as bricks: sparse, and exactly the voxels that a [`Volume`] would hold.
///
/// Made by [`CpuBackend::voxelize_bricks`](crate::CpuBackend::voxelize_bricks). Two maps of the same voxels are equal,
/// whatever made them.
#[derive(Clone, Debug, PartialEq)]
pub struct BrickMap {
    grid: Grid,
    /// The pillars that may hold voxels, along x and y; all others are empty.
    covered: [Range<u32>; 2],
    /// With y fastest.
    pillars: Vec<Pillar>,
}

/// The bricks over 64 x 64 columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Pillar {
    /// Bar (bx, by) has the bricks `bars[i][0]..bars[i + 1][0]` and the runs `bars[i][1]..bars[i + 1][1]`, with
    /// `i = 8 bx + by`. Empty for a pillar without voxels.
    bars: Vec<[u32; 2]>,
    /// Place of each brick along z, in bricks; ascending in a bar.
    heights: Vec<u16>,
    bricks: Vec<Brick>,
    /// First and last height of bricks whose voxels are all set; ascending in a bar, and as long as possible.
    runs: Vec<[u16; 2]>,
}

/// Collects the bricks of one pillar, each bar's from low to high.
#[derive(Debug, Default)]
pub(crate) struct PillarBuilder {
    /// Bar, height, brick.
    bricks: Vec<(u8, u16, Brick)>,
    /// Bar, first and last height.
    runs: Vec<(u8, [u16; 2])>,
}

impl PillarBuilder {
    /// Adds a brick of bar `8 bx + by`, above all that the bar has.
    pub(crate) fn push(&mut self, bar: u8, height: u16, brick: &Brick) {
        if brick.iter().all(|&word| word == u64::MAX) {
            self.push_run(bar, [height, height]);
        } else if brick.iter().any(|&word| word != 0) {
            self.bricks.push((bar, height, *brick));
        }
    }

    /// Adds bricks whose voxels are all set, first to last, above all that the bar has.
    pub(crate) fn push_run(&mut self, bar: u8, run: [u16; 2]) {
        self.runs.push((bar, run));
    }

    /// The pillar; the builder is empty again.
    pub(crate) fn finish(&mut self) -> Pillar {
        if self.bricks.is_empty() && self.runs.is_empty() {
            return Pillar::default();
        }
        // Stable, so that a bar's bricks stay in order.
        self.bricks.sort_by_key(|&(bar, ..)| bar);
        self.runs.sort_by_key(|&(bar, _)| bar);
        let mut runs: Vec<(u8, [u16; 2])> = Vec::with_capacity(self.runs.len());
        for &(bar, run) in &self.runs {
            match runs.last_mut() {
                Some((last_bar, [_, last])) if *last_bar == bar && *last + 1 == run[0] => *last = run[1],
                _ => runs.push((bar, run)),
            }
        }
        let mut bars = Vec::with_capacity((BARS * BARS + 1) as usize);
        let (mut brick, mut run) = (0, 0);
        bars.push([0, 0]);
        for bar in 0..=u8::MAX {
            if u32::from(bar) >= BARS * BARS {
                break;
            }
            brick += self.bricks.get(brick..).unwrap_or_default().iter().take_while(|b| b.0 == bar).count();
            run += runs.get(run..).unwrap_or_default().iter().take_while(|r| r.0 == bar).count();
            // A pillar has at most 2^18 bricks.
            bars.push([brick, run].map(|n| u32::try_from(n).unwrap_or(u32::MAX)));
        }
        let pillar = Pillar {
            bars,
            heights: self.bricks.iter().map(|&(_, height, _)| height).collect(),
            bricks: self.bricks.iter().map(|&(.., brick)| brick).collect(),
            runs: runs.into_iter().map(|(_, run)| run).collect(),
        };
        self.bricks.clear();
        self.runs.clear();
        pillar
    }
}

/// The part of one bar.
struct Bar<'a> {
    heights: &'a [u16],
    bricks: &'a [Brick],
    runs: &'a [[u16; 2]],
}

impl Pillar {
    fn bar(&self, bx: u32, by: u32) -> Bar<'_> {
        let i = (bx * BARS + by) as usize;
        let [from, to] = match self.bars.get(i..i + 2) {
            Some(&[from, to]) => [from, to].map(|ends| ends.map(|end| end as usize)),
            _ => [[0; 2]; 2],
        };
        Bar {
            heights: &self.heights[from[0]..to[0]],
            bricks: &self.bricks[from[0]..to[0]],
            runs: &self.runs[from[1]..to[1]],
        }
    }

    fn is_empty(&self) -> bool {
        self.bars.is_empty()
    }

    /// Bytes that it takes.
    pub(crate) fn bytes(&self) -> u64 {
        let lists = [
            size_of_val(&*self.bars),
            size_of_val(&*self.heights),
            size_of_val(&*self.bricks),
            size_of_val(&*self.runs),
        ];
        (size_of::<Self>() + lists.iter().sum::<usize>()) as u64
    }

    fn count(&self) -> u64 {
        let of_brick = |brick: &Brick| brick.iter().map(|word| u64::from(word.count_ones())).sum::<u64>();
        let of_run = |&[first, last]: &[u16; 2]| (u64::from(last - first) + 1) * u64::from(BRICK_SIDE).pow(3);
        self.bricks.iter().map(of_brick).sum::<u64>() + self.runs.iter().map(of_run).sum::<u64>()
    }
}

impl Bar<'_> {
    fn get(&self, height: u16, x: u32, y: u32, z: u32) -> bool {
        if let Ok(i) = self.heights.binary_search(&height) {
            return self.bricks[i][x as usize] >> (BRICK_SIDE * y + z) & 1 == 1;
        }
        let run = self.runs.partition_point(|run| run[1] < height);
        self.runs.get(run).is_some_and(|run| run[0] <= height)
    }

    /// Visits the voxels of column (x, y) of the bar, as z and a word.
    fn for_each_word(&self, [x, y]: [u32; 2], zs: &Range<u32>, mut visit: impl FnMut(u32, u64)) {
        let mut visit_in_range = |z: u32, word: u64| {
            let bits = in_range(word, z, zs);
            if bits != 0 {
                visit(z, bits);
            }
        };
        let first_height = zs.start / BRICK_SIDE;
        let brick = self.heights.partition_point(|&height| u32::from(height) < first_height);
        let mut bricks = self.heights[brick..].iter().zip(&self.bricks[brick..]).peekable();
        let mut visit_bricks_below = |limit: u32, visit: &mut dyn FnMut(u32, u64)| {
            while let Some((&height, brick)) = bricks.next_if(|(height, _)| u32::from(**height) < limit) {
                visit(u32::from(height) * BRICK_SIDE, brick[x as usize] >> (BRICK_SIDE * y) & 0xff);
            }
        };
        for &[first, last] in &self.runs[self.runs.partition_point(|run| u32::from(run[1]) < first_height)..] {
            let [start, end] = [u32::from(first), u32::from(last) + 1].map(|height| height * BRICK_SIDE);
            if start >= zs.end {
                break;
            }
            visit_bricks_below(u32::from(first), &mut visit_in_range);
            for z in (start..end).step_by(WORD_BITS as usize) {
                visit_in_range(z, u64::MAX >> (z + WORD_BITS).saturating_sub(end));
            }
        }
        visit_bricks_below(zs.end.div_ceil(BRICK_SIDE), &mut visit_in_range);
    }
}

impl BrickMap {
    /// The voxels of the pillars in `covered`, with y fastest.
    pub(crate) fn new(grid: Grid, covered: [Range<u32>; 2], pillars: Vec<Pillar>) -> Self {
        debug_assert_eq!(pillars.len(), covered[0].len() * covered[1].len(), "pillars of {covered:?}");
        Self { grid, covered, pillars }
    }

    /// A map without voxels.
    #[must_use]
    pub fn empty(grid: Grid) -> Self {
        Self { grid, covered: [0..0, 0..0], pillars: Vec::new() }
    }

    /// A map of bricks that were made elsewhere: each the place of an 8 x 8 x 8 cube, in cubes, and its voxels, bit z of
    /// byte y of word x. In any order; of two of one place the last counts. Voxels outside the grid must not be set, and
    /// bricks outside are left out.
    #[must_use]
    pub fn from_bricks(grid: Grid, bricks: impl IntoIterator<Item = ([u32; 3], [u64; 8])>) -> Self {
        let side = PILLAR_SIDE / BRICK_SIDE;
        let dims = grid.dims().map(|n| n.div_ceil(BRICK_SIDE));
        let inside = |&([x, y, z], _): &([u32; 3], Brick)| x < dims[0] && y < dims[1] && z < dims[2];
        let mut sorted: BTreeMap<[u32; 2], BTreeMap<(u8, u16), Brick>> = BTreeMap::new();
        for ([x, y, z], brick) in bricks.into_iter().filter(inside) {
            // A bar is below 64, and a grid below 2^15 voxels high.
            let bar = u8::try_from(x % side * side + y % side).unwrap_or(u8::MAX);
            let height = u16::try_from(z).unwrap_or(u16::MAX);
            sorted.entry([x / side, y / side]).or_default().insert((bar, height), brick);
        }
        let range = |along: fn(&[u32; 2]) -> u32| {
            let ends = sorted.keys().map(along);
            let first = ends.clone().min().unwrap_or(0);
            first..ends.max().map_or(0, |last| last + 1)
        };
        let covered = [range(|pillar| pillar[0]), range(|pillar| pillar[1])];
        let mut builder = PillarBuilder::default();
        let places = covered[0].clone().flat_map(|px| covered[1].clone().map(move |py| [px, py]));
        let pillars = places
            .map(|place| {
                for (&(bar, height), brick) in sorted.get(&place).into_iter().flatten() {
                    builder.push(bar, height, brick);
                }
                builder.finish()
            })
            .collect();
        Self::new(grid, covered, pillars)
    }

    /// How many pillars a grid has along x and y: pieces of 64 x 64 columns, which are computed one by one.
    #[must_use]
    pub fn pillars_of(grid: &Grid) -> [u32; 2] {
        let [nx, ny, _] = grid.dims();
        [nx, ny].map(|n| n.div_ceil(PILLAR_SIDE))
    }

    /// The x of the pillars whose voxels a triangle may meet, with its corners on the grid's lattice.
    #[must_use]
    pub fn layers_of(grid: &Grid, triangle: &[[i64; 3]; 3]) -> Range<u32> {
        let [a, b, c] = triangle.map(|corner| corner[0]);
        let last = i64::from(grid.dims()[0]) - 1;
        let low = (a.min(b).min(c) - 1) >> STEP_BITS;
        let high = a.max(b).max(c) >> STEP_BITS;
        if low > last || high < 0 {
            return 0..0;
        }
        let layer = |x: i64| u32::try_from(x.clamp(0, last)).unwrap_or(0) / PILLAR_SIDE;
        layer(low)..layer(high) + 1
    }

    /// The pillar at `[px, py]`, if it may hold voxels.
    fn pillar(&self, px: u32, py: u32) -> Option<&Pillar> {
        let [xs, ys] = &self.covered;
        if !xs.contains(&px) || !ys.contains(&py) {
            return None;
        }
        self.pillars.get((px - xs.start) as usize * ys.len() + (py - ys.start) as usize)
    }

    /// Whether a voxel is set; a voxel outside the grid is not.
    #[must_use]
    pub fn get(&self, [x, y, z]: [u32; 3]) -> bool {
        let Some(pillar) = self.pillar(x / PILLAR_SIDE, y / PILLAR_SIDE) else { return false };
        let bar = pillar.bar(x % PILLAR_SIDE / BRICK_SIDE, y % PILLAR_SIDE / BRICK_SIDE);
        let Ok(height) = u16::try_from(z / BRICK_SIDE) else { return false };
        bar.get(height, x % BRICK_SIDE, y % BRICK_SIDE, z % BRICK_SIDE)
    }

    /// Bricks that are stored one by one: those with both set and unset voxels.
    #[must_use]
    pub fn brick_count(&self) -> u64 {
        self.pillars.iter().map(|pillar| pillar.bricks.len() as u64).sum()
    }

    /// Bytes that it takes.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.pillars.iter().map(Pillar::bytes).sum()
    }

    /// The same voxels, dense.
    ///
    /// # Errors
    /// When a dense volume takes more than `available` bytes or cannot be had.
    pub fn to_volume(&self, available: Option<u64>) -> Result<Volume, VolumeError> {
        let mut volume = Volume::with_memory_limit(self.grid, available)?;
        let [_, ny, nz] = self.grid.dims();
        let column_words = volume.column_words();
        let fill_layer = |(x, words): (u32, &mut [u64])| {
            self.for_each_word(&[x..x + 1, 0..ny, 0..nz], |[_, y, z], bits| {
                let word = y as usize * column_words + (z / WORD_BITS) as usize;
                words[word] |= bits << (z % WORD_BITS);
                // Words of a run start at any brick.
                let above = bits.checked_shr(WORD_BITS - z % WORD_BITS).unwrap_or(0);
                if above != 0 {
                    words[word + 1] |= above;
                }
            });
        };
        let layers = volume.words_mut().chunks_mut(ny as usize * column_words);
        (0u32..).zip(layers).for_each(fill_layer);
        Ok(volume)
    }
}

impl Occupancy for BrickMap {
    fn grid(&self) -> &Grid {
        &self.grid
    }

    fn count(&self) -> u64 {
        self.pillars.iter().map(Pillar::count).sum()
    }

    fn for_each_word(&self, [xs, ys, zs]: &[Range<u32>; 3], mut visit: impl FnMut([u32; 3], u64)) {
        let [nx, ny, _] = self.grid.dims();
        for x in xs.start..xs.end.min(nx) {
            let mut y = ys.start;
            while y < ys.end.min(ny) {
                let pillar = self.pillar(x / PILLAR_SIDE, y / PILLAR_SIDE);
                let Some(pillar) = pillar.filter(|pillar| !pillar.is_empty()) else {
                    y = (y / PILLAR_SIDE + 1) * PILLAR_SIDE;
                    continue;
                };
                let bar = pillar.bar(x % PILLAR_SIDE / BRICK_SIDE, y % PILLAR_SIDE / BRICK_SIDE);
                let end = ys.end.min(ny).min((y / BRICK_SIDE + 1) * BRICK_SIDE);
                if !bar.bricks.is_empty() || !bar.runs.is_empty() {
                    for y in y..end {
                        bar.for_each_word([x % BRICK_SIDE, y % BRICK_SIDE], zs, |z, word| visit([x, y, z], word));
                    }
                }
                y = end;
            }
        }
    }
}
