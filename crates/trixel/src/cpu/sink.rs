//! Where the kernel's runs go: bits of a slab of columns.

use fearless_simd::{Simd, i32x16, i64x8, prelude::*};

use super::filter::Voxels;
use super::prefetch::{self, prefetch};
use super::rows::Tile;
use super::triangles::{LANES, Lanes};
use crate::volume::WORD_BITS;

/// Words of a column by shifting.
const WORD_SHIFT: u32 = WORD_BITS.trailing_zeros();

/// Receives runs of voxels.
pub(super) trait Sink {
    /// The voxels `(x, y, from..=to)`, all inside the clip that the kernel was given.
    fn run(&mut self, x: i64, y: i64, from: i64, to: i64);

    /// Runs of columns `(x, y)` of eight by eight from `at` on: those whose bit `8 x + y`, or if `turned` `8 y + x`, is set
    /// in `columns`. The z of their ends are seen from `at`, where a word of each column begins, and are at most `last_z`.
    #[inline(always)]
    fn tile(&mut self, at: [i64; 3], turned: bool, columns: u64, from: &Tile, to: &Tile, _last_z: i64) {
        for_each_column(columns, |column| {
            let [x, y] = turn(turned, [(column / 8) as i64, (column % 8) as i64]);
            self.run(at[0] + x, at[1] + y, at[2] + from[column], at[2] + to[column]);
        });
    }

    /// Whether triangles that are not tiny are left for later.
    const LEAVES: bool = false;

    /// Leaves a triangle, of which the number and, of its box inside the clip, the range of x and the least y are given.
    #[inline(always)]
    fn leave(&mut self, _number: usize, _x: [i64; 2], _y: i64) {}

    /// Whether [`Self::prefetch`] is of use.
    #[inline(always)]
    fn prefetches(&self) -> bool {
        false
    }

    /// Asks for the memory of small cubes, whose low corners are seen from the voxel `base`.
    #[inline(always)]
    fn prefetch<V: Simd>(&self, _low: &[i32x16<V>; 3], _base: [i64; 3]) {}

    /// Whether it should not be given more for now.
    #[inline(always)]
    fn is_full(&self) -> bool {
        false
    }
}

/// Receives cubes of voxels too, several at once.
pub(super) trait CubeSink: Sink {
    /// Where cubes go.
    type Places<V: Simd>;

    /// Looks up cubes whose low corners are seen from the voxel `base`, and inside the clip along z: long before they are
    /// sent, because vectors take their time to be read lane by lane.
    fn places<V: Simd>(&self, low: &[i32x16<V>; 3], base: [i64; 3]) -> Self::Places<V>;

    /// Voxels of cubes of `SIDE` in `lanes`: those `(x, y, z)` from the corner whose bit `(SIDE x + y) SIDE + z` is set, all
    /// inside the clip.
    fn cubes<V: Simd, const SIDE: usize>(&mut self, places: &Self::Places<V>, voxels: &Voxels<V>, lanes: Lanes);
}

/// Where voxels are among a piece's words.
pub(super) struct InWords<V: Simd> {
    /// Along x.
    #[cfg(feature = "threads")]
    pub(super) x: i32x16<V>,
    /// Outside the piece: past its end, below 0, or a word for which no bit will be set.
    pub(super) words: [i64x8<V>; 2],
    pub(super) shifts: i32x16<V>,
}

impl<V: Simd> InWords<V> {
    /// Voxels seen from `base`, in a piece that starts at a voxel, for its columns along y and the words of a column.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_possible_wrap,
        reason = "all in or near a grid, of at most 2^15 voxels along an axis"
    )]
    pub(super) fn new(
        voxels: &[i32x16<V>; 3],
        base: [i64; 3],
        start: [i64; 3],
        columns: usize,
        column_words: usize,
    ) -> Self {
        let move_by = |i: usize| (base[i] - start[i]) as i32;
        let at = [voxels[0] + move_by(0), voxels[1] + move_by(1), voxels[2] + move_by(2)];
        let column = at[0] * columns as i32 + at[1];
        let (first, second) = column.widening_mul(column_words as i32);
        let (above_first, above_second) = (at[2] >> WORD_SHIFT).widen();
        Self {
            #[cfg(feature = "threads")]
            x: at[0],
            words: [first + above_first, second + above_second],
            shifts: at[2] & (WORD_BITS as i32 - 1),
        }
    }
}

/// Where the low corners of cubes are among a piece's words, lane by lane.
pub(super) struct Places {
    words: [[i64; LANES / 2]; 2],
    shifts: [i32; LANES],
}

impl Places {
    /// The word and the shift of a lane.
    #[inline(always)]
    #[expect(clippy::cast_sign_loss, clippy::cast_possible_truncation, reason = "of a word")]
    fn of(&self, lane: usize) -> (isize, u32) {
        (self.words.as_flattened()[lane % LANES] as isize, self.shifts[lane % LANES] as u32)
    }
}

/// Bits of the cube of a lane.
#[inline(always)]
pub(super) fn bits_of<const SIDE: usize>(words: &[[i32; LANES]; 2], lane: usize) -> u64 {
    let word = |i: usize| u64::from(words[i][lane % LANES].cast_unsigned());
    if SIDE < 4 { word(0) } else { word(0) | word(1) << 32 }
}

/// The words of a piece of the grid: what one thread owns.
pub(super) struct Slab<'a> {
    pub(super) words: &'a mut [u64],
    /// The piece's first voxel; a whole word along z.
    pub(super) start: [i64; 3],
    /// Columns along y.
    pub(super) columns: usize,
    pub(super) column_words: usize,
}

/// Words from a column to the next along x, and along y.
#[derive(Clone, Copy)]
pub(super) struct Steps {
    layer: u32,
    beside: u32,
}

impl<'a> Slab<'a> {
    /// The same piece, for a shorter time.
    pub(super) fn reborrow(&mut self) -> Slab<'_> {
        Slab { words: self.words, ..*self }
    }

    /// Words of a layer across x.
    #[inline(always)]
    fn layer(&self) -> usize {
        self.columns * self.column_words
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "at most 2^15 columns of 2^9 words")]
    pub(super) fn steps(&self) -> Steps {
        Steps { layer: self.layer() as u32, beside: self.column_words as u32 }
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside the slab")]
    fn column(&mut self, x: i64, y: i64) -> &mut [u64] {
        let [x, y] = [(x - self.start[0]) as usize, (y - self.start[1]) as usize];
        let start = (x * self.columns + y) * self.column_words;
        &mut self.words[start..start + self.column_words]
    }
}

/// Sets the voxels of a cube whose columns' bits are in the words from `first` on, and `steps` further along x and y: of all
/// columns without asking which have any, as that guess is wrong too often. `false`, and nothing done, where a column needs
/// two words, or some would not be among the words: then it is for [`set_columns`].
#[inline(always)]
#[expect(clippy::cast_sign_loss, reason = "too large, then")]
pub(super) fn set_cube<const SIDE: usize>(
    words: &mut [u64],
    steps: Steps,
    first: isize,
    bits: u64,
    shift: u32,
) -> bool {
    if shift > WORD_BITS - side::<SIDE>() {
        return false;
    }
    // Of numbers known to be small, the compiler sees that no word is past the last.
    let (layer, beside) = (steps.layer as usize, steps.beside as usize);
    let last = (SIDE - 1) * (layer + beside);
    // At the end of a row, the column beside is the first of the next: its bits are 0 then.
    let Some(words) = words.get_mut(first as usize..) else { return false };
    if words.len() <= last {
        return false;
    }
    for x in 0..SIDE {
        for y in 0..SIDE {
            let run = bits >> ((SIDE * x + y) * SIDE) & ((1 << SIDE) - 1);
            words[x * layer + y * beside] |= run << shift;
        }
    }
    true
}

/// [`set_cube`] column by column; those without voxels may lie outside the words.
#[cold]
#[inline(never)]
#[expect(clippy::cast_sign_loss, reason = "voxels are inside the slab")]
pub(super) fn set_columns<const SIDE: usize>(words: &mut [u64], steps: Steps, first: isize, mut bits: u64, shift: u32) {
    let side = side::<SIDE>();
    while bits != 0 {
        let column = bits.trailing_zeros() / side;
        let run = bits >> (column * side) & ((1 << side) - 1);
        bits ^= run << (column * side);
        let (x, y) = ((column / side) as usize, (column % side) as usize);
        let word = first.wrapping_add_unsigned(x * steps.layer as usize + y * steps.beside as usize) as usize;
        words[word] |= run << shift;
        if shift > WORD_BITS - side {
            let above = run >> (WORD_BITS - shift);
            if above != 0 {
                words[word + 1] |= above;
            }
        }
    }
}

#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "at most 4")]
const fn side<const SIDE: usize>() -> u32 {
    SIDE as u32
}

/// Sets the voxels of a run.
pub(super) struct SetRuns<'a>(pub(super) Slab<'a>);

impl Sink for SetRuns<'_> {
    #[inline(always)]
    fn prefetches(&self) -> bool {
        /// Words that come quickly enough: 5 MiB, measured.
        const NEAR: usize = 5 << 17;
        prefetch::POSSIBLE && self.0.words.len() > NEAR
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an address, whatever it is")]
    fn prefetch<V: Simd>(&self, low: &[i32x16<V>; 3], base: [i64; 3]) {
        let InWords { words, .. } = InWords::new(low, base, self.0.start, self.0.columns, self.0.column_words);
        // The columns beside are near enough.
        for &at in [*words[0], *words[1]].as_flattened() {
            prefetch(self.0.words, at as usize);
            prefetch(self.0.words, (at as usize).wrapping_add(self.0.layer()));
        }
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside the slab")]
    fn run(&mut self, x: i64, y: i64, from: i64, to: i64) {
        let (from, to) = ((from - self.0.start[2]) as u32, (to - self.0.start[2]) as u32);
        let column = self.0.column(x, y);
        let (first, last) = ((from / WORD_BITS) as usize, (to / WORD_BITS) as usize);
        let from_bits = u64::MAX << (from % WORD_BITS);
        let to_bits = u64::MAX >> (WORD_BITS - 1 - to % WORD_BITS);
        if first == last {
            column[first] |= from_bits & to_bits;
        } else {
            column[first] |= from_bits;
            column[first + 1..last].fill(u64::MAX);
            column[last] |= to_bits;
        }
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside the slab")]
    fn tile(&mut self, at: [i64; 3], turned: bool, columns: u64, from: &Tile, to: &Tile, last_z: i64) {
        let Slab { words, start, columns: row, column_words } = &mut self.0;
        let [x, y, z] = [0, 1, 2].map(|i| (at[i] - start[i]) as usize);
        let first = (x * *row + y) * *column_words + z / WORD_BITS as usize;
        let [step, beside] = turn(turned, [*row * *column_words, *column_words]);
        let word = |column: usize| first + column / 8 * step + column % 8 * beside;
        if last_z < i64::from(WORD_BITS) {
            for_each_column(columns, |column| {
                let (from, to) = (from[column] as u32 % WORD_BITS, to[column] as u32 % WORD_BITS);
                words[word(column)] |= (u64::MAX << from) & (u64::MAX >> (WORD_BITS - 1 - to));
            });
        } else if last_z < i64::from(2 * WORD_BITS) {
            for_each_column(columns, |column| {
                let (from, to) = (from[column] as u32 % (2 * WORD_BITS), to[column] as u32 % (2 * WORD_BITS));
                let bits = (u128::MAX << from) & (u128::MAX >> (2 * WORD_BITS - 1 - to));
                let (word, above) = (word(column), (bits >> WORD_BITS) as u64);
                words[word] |= bits as u64;
                if above != 0 {
                    words[word + 1] |= above;
                }
            });
        } else {
            for_each_column(columns, |column| {
                let [x, y] = turn(turned, [(column / 8) as i64, (column % 8) as i64]);
                self.run(at[0] + x, at[1] + y, at[2] + from[column], at[2] + to[column]);
            });
        }
    }
}

/// What is along x and along y, or along y and x.
#[inline(always)]
pub(super) fn turn<T>(turned: bool, [a, b]: [T; 2]) -> [T; 2] {
    if turned { [b, a] } else { [a, b] }
}

/// Calls `each` with the numbers of the bits set in `columns`.
#[inline(always)]
fn for_each_column(mut columns: u64, mut each: impl FnMut(usize)) {
    while columns != 0 {
        each(columns.trailing_zeros() as usize % 64);
        columns &= columns - 1;
    }
}

impl CubeSink for SetRuns<'_> {
    type Places<V: Simd> = Places;

    #[inline(always)]
    fn places<V: Simd>(&self, low: &[i32x16<V>; 3], base: [i64; 3]) -> Places {
        let InWords { words, shifts, .. } = InWords::new(low, base, self.0.start, self.0.columns, self.0.column_words);
        Places { words: [*words[0], *words[1]], shifts: *shifts }
    }

    #[inline(always)]
    fn cubes<V: Simd, const SIDE: usize>(&mut self, places: &Places, voxels: &Voxels<V>, mut lanes: Lanes) {
        // What is behind a reference to a slab would be loaded again after each word.
        let steps = self.0.steps();
        let words = &mut *self.0.words;
        let bits = [*voxels[0], *voxels[1]];
        // Those that need a call, kept out of the loop.
        let mut left = 0u64;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            let (first, shift) = places.of(lane);
            if !set_cube::<SIDE>(words, steps, first, bits_of::<SIDE>(&bits, lane), shift) {
                left |= 1 << lane;
            }
            lanes &= lanes - 1;
        }
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            let (first, shift) = places.of(lane);
            set_columns::<SIDE>(words, steps, first, bits_of::<SIDE>(&bits, lane), shift);
            left &= left - 1;
        }
    }
}

/// Toggles the lowest voxel of a run; [`prefix_xor`] turns toggles into the parity of each voxel.
pub(super) struct ToggleRuns<'a>(pub(super) Slab<'a>);

impl Sink for ToggleRuns<'_> {
    #[inline(always)]
    fn run(&mut self, x: i64, y: i64, from: i64, _to: i64) {
        // Below the piece: whoever clips lower than it starts does not want what is carried into it.
        let Ok(from) = u32::try_from(from - self.0.start[2]) else { return };
        self.0.column(x, y)[(from / WORD_BITS) as usize] ^= 1 << (from % WORD_BITS);
    }
}

/// Bit i is the parity of the bits 0 to i of `word`.
#[inline(always)]
pub(super) fn prefix_parity(word: u64) -> u64 {
    let mut parity = word;
    for shift in [1, 2, 4, 8, 16, 32] {
        parity ^= parity << shift;
    }
    parity
}

/// Replaces every bit of each column by the parity of the bits up to and including it.
pub(super) fn prefix_xor(words: &mut [u64], column_words: usize, nz: u32) {
    let last_bits = u64::MAX >> ((WORD_BITS - nz % WORD_BITS) % WORD_BITS);
    for column in words.chunks_exact_mut(column_words) {
        let mut carry = 0u64;
        for word in column.iter_mut() {
            if *word == 0 && carry == 0 {
                continue;
            }
            *word = prefix_parity(*word) ^ carry;
            // All ones if the column is inside at this word's end.
            carry = 0u64.wrapping_sub(*word >> (WORD_BITS - 1));
        }
        if let Some(last) = column.last_mut() {
            *last &= last_bits;
        }
    }
}
