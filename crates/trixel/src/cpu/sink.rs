//! Where the kernel's runs go: bits of a slab of columns.

use std::ops::Range;

use fearless_simd::{Simd, i32x16, mask32x16, prelude::*};

use super::instructions::compresses;
use super::kernel::set_bits;
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

    /// Runs of the columns of a row from `at` on, along y or, if `turned`, along x: of those whose bit is set in `columns`. The
    /// z of their ends are seen from `at`.
    #[inline(always)]
    fn row(&mut self, at: [i64; 3], turned: bool, columns: u64, from: &Tile, to: &Tile) {
        for_each_column(columns, |column| {
            let [x, y] = turn(turned, [0, column as i64]);
            self.run(at[0] + x, at[1] + y, at[2] + from[column], at[2] + to[column]);
        });
    }

    /// Whether triangles that are not tiny are left for later.
    const LEAVES: bool = false;

    /// Leaves a triangle, of which the number and, of its box inside the clip, the range of x and the least y are given.
    #[inline(always)]
    fn leave(&mut self, _number: usize, _x: [i64; 2], _y: i64) {}

    /// Whether it should not be given more for now.
    #[inline(always)]
    fn is_full(&self) -> bool {
        false
    }
}

/// Receives parts of columns too, several at once.
pub(super) trait ColumnSink: Sink {
    /// Looks up voxels seen from the voxel `base`.
    fn place<V: Simd>(&self, low: &[i32x16<V>; 3], base: [i64; 3]) -> Place<V>;

    /// Voxels in `lanes`: of the columns with these numbers, those whose bit from `from` on, as seen from the piece, is set.
    fn columns<V: Simd>(&mut self, simd: V, columns: i32x16<V>, from: i32x16<V>, bits: i32x16<V>, lanes: Lanes);

    /// Does what was put off.
    fn finish<V: Simd>(&mut self, simd: V);
}

/// Receives cubes of voxels too, several at once.
pub(super) trait CubeSink: ColumnSink {
    /// Where cubes go.
    type Places<V: Simd>;

    /// Looks up cubes whose low corners are seen from the voxel `base`, and inside the clip along z: long before they are
    /// sent, because where vectors are read lane by lane, they take their time.
    fn places<V: Simd>(&self, low: &[i32x16<V>; 3], base: [i64; 3]) -> Self::Places<V>;

    /// Voxels of cubes of `SIDE` in `lanes`: those `(x, y, z)` from the corner whose bit `(SIDE x + y) SIDE + z` is set, all
    /// inside the clip.
    fn cubes<V: Simd, const SIDE: usize>(&mut self, simd: V, places: &Self::Places<V>, voxels: i32x16<V>, lanes: Lanes);
}

/// Where voxels are in a piece.
pub(super) struct Place<V: Simd> {
    /// The number of the column.
    pub(super) column: i32x16<V>,
    pub(super) z: i32x16<V>,
    /// Columns from one to the next along x.
    pub(super) row: i32,
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

impl<'a> Slab<'a> {
    /// The same piece, for a shorter time.
    pub(super) fn reborrow(&mut self) -> Slab<'_> {
        Slab { words: self.words, ..*self }
    }

    /// Words of a layer across x.
    #[inline(always)]
    pub(super) fn layer(&self) -> usize {
        self.columns * self.column_words
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside the slab")]
    fn column(&mut self, x: i64, y: i64) -> &mut [u64] {
        let [x, y] = [(x - self.start[0]) as usize, (y - self.start[1]) as usize];
        let start = (x * self.columns + y) * self.column_words;
        &mut self.words[start..start + self.column_words]
    }
}

/// Sets the voxels of runs, and of parts of columns once there are many, or at [`ColumnSink::finish`].
pub(super) struct SetRuns<'a> {
    slab: Slab<'a>,
    /// By the number of a word: the bits' shift in it, in [`WORD_SHIFT`] bits, and above it the bits.
    in_words: Parts,
    /// By the number of a column: the bits, in [`MOST_BITS`] bits, and above them the voxel of the lowest.
    in_columns: Parts,
}

/// Parts of columns that wait, so that the loop that sets them is long: in two halves, of which one is filled while the
/// memory of the other is on its way.
struct Parts {
    /// Where the half begins that is filled: 0 or [`HALF`].
    half: usize,
    /// Where the next part goes.
    next: usize,
    /// How many wait in the other half.
    asked_for: usize,
    places: [i32; 2 * HALF],
    bits: [i32; 2 * HALF],
}

/// Parts of a half from which on it takes no more.
const FULL: usize = 256;
const HALF: usize = FULL + LANES;

/// Voxels of a part of a column at most.
pub(super) const MOST_BITS: u32 = 16;

impl Parts {
    const NONE: Self = Self { half: 0, next: 0, asked_for: 0, places: [0; 2 * HALF], bits: [0; 2 * HALF] };

    /// Adds those in `lanes`; `true` when the half takes no more.
    #[inline(always)]
    fn push<V: Simd>(&mut self, simd: V, places: i32x16<V>, bits: i32x16<V>, lanes: mask32x16<V>) -> bool {
        let mut at = self.next.min(2 * HALF - LANES);
        if compresses(simd) {
            places.compress(lanes).store_slice(&mut self.places[at..at + LANES]);
            bits.compress(lanes).store_slice(&mut self.bits[at..at + LANES]);
            at += lanes.to_bitmask().count_ones() as usize;
        } else {
            let (places, bits) = (*places, *bits);
            for lane in set_bits(lanes.to_bitmask()) {
                let at_most = at.min(2 * HALF - 1);
                (self.places[at_most], self.bits[at_most]) = (places[lane % LANES], bits[lane % LANES]);
                at += 1;
            }
        }
        self.next = at;
        at > self.half + FULL
    }

    /// The half that is filled.
    #[inline(always)]
    fn filled(&self) -> Range<usize> {
        self.half..self.next.min(self.half + HALF)
    }

    /// The half of which the memory was asked for.
    #[inline(always)]
    fn asked_for(&self) -> Range<usize> {
        let half = HALF - self.half;
        half..half + self.asked_for
    }

    /// Those in a part of these, by place.
    #[inline(always)]
    #[expect(clippy::cast_sign_loss, reason = "never below 0")]
    fn of(&self, range: Range<usize>) -> impl Iterator<Item = (usize, u32)> {
        self.places[range.clone()].iter().zip(&self.bits[range]).map(|(&place, &bits)| (place as usize, bits as u32))
    }

    /// The memory of the half that was filled was asked for, and the other's parts are set.
    #[inline(always)]
    fn exchange(&mut self) {
        self.asked_for = self.filled().len();
        self.half = HALF - self.half;
        self.next = self.half;
    }

    /// All are set.
    #[inline(always)]
    fn clear(&mut self) {
        (self.half, self.next, self.asked_for) = (0, 0, 0);
    }
}

impl<'a> SetRuns<'a> {
    pub(super) fn new(slab: Slab<'a>) -> Self {
        Self { slab, in_words: Parts::NONE, in_columns: Parts::NONE }
    }

    /// Asks for the words of the half that is filled, and sets the parts of the other; or sets all, if it does not pay to ask.
    #[inline(never)]
    fn ask_for_words<V: Simd>(&mut self, simd: V) {
        if !asks(self.slab.words) {
            return self.set_in_words(simd);
        }
        simd.vectorize(
            #[inline(always)]
            || {
                let Self { slab: Slab { words, .. }, in_words, .. } = self;
                // By turns, because only so many words can be on their way.
                let mut next = in_words.of(in_words.filled());
                for (word, bits) in in_words.of(in_words.asked_for()) {
                    if let Some((next, _)) = next.next() {
                        prefetch(words, next);
                    }
                    set_in_word(words, word, bits);
                }
                for (next, _) in next {
                    prefetch(words, next);
                }
                in_words.exchange();
            },
        );
    }

    /// Sets the parts that wait by words.
    #[inline(never)]
    fn set_in_words<V: Simd>(&mut self, simd: V) {
        simd.vectorize(
            #[inline(always)]
            || {
                let Self { slab: Slab { words, .. }, in_words, .. } = self;
                for half in [in_words.asked_for(), in_words.filled()] {
                    for (word, bits) in in_words.of(half) {
                        set_in_word(words, word, bits);
                    }
                }
                in_words.clear();
            },
        );
    }

    /// Sets the parts that wait by columns.
    #[inline(never)]
    fn set_in_columns<V: Simd>(&mut self, simd: V) {
        simd.vectorize(
            #[inline(always)]
            || {
                let Self { slab: Slab { words, column_words, .. }, in_columns, .. } = self;
                for (column, bits) in in_columns.of(in_columns.filled()) {
                    let (from, bits) = (bits >> MOST_BITS, u64::from(bits % (1 << MOST_BITS)));
                    let word = column * *column_words + (from / WORD_BITS) as usize;
                    words[word] |= bits << (from % WORD_BITS);
                    let above = bits >> (WORD_BITS - 1 - from % WORD_BITS) >> 1;
                    if above != 0 {
                        words[word + 1] |= above;
                    }
                }
                in_columns.clear();
            },
        );
    }

    /// Cubes, as columns.
    #[inline(never)]
    #[expect(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "at most 24")]
    fn cubes_as_columns<V: Simd, const SIDE: usize>(
        &mut self,
        simd: V,
        place: &Place<V>,
        voxels: i32x16<V>,
        lanes: Lanes,
    ) {
        simd.vectorize(
            #[inline(always)]
            || {
                for x in 0..SIDE {
                    for y in 0..SIDE {
                        let bits = bits_of_column::<V, SIDE>(voxels, x, y);
                        let column = place.column + (x as i32 * place.row + y as i32);
                        let some = bits.simd_gt(i32x16::splat(simd, 0)).to_bitmask();
                        self.columns(simd, column, place.z, bits, some & lanes);
                    }
                }
            },
        );
    }
}

/// Sets the voxels of a run in all words of a column.
#[inline(always)]
fn set_run(column: &mut [u64], from: u32, to: u32) {
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

/// Sets a part in a word.
#[inline(always)]
fn set_in_word(words: &mut [u64], word: usize, bits: u32) {
    words[word] |= u64::from(bits >> WORD_SHIFT) << (bits % WORD_BITS);
}

/// Whether it pays to ask for words before they are set.
fn asks(words: &[u64]) -> bool {
    /// Words that come quickly enough: 5 MiB, measured; in tests, so few that some grids have more.
    const NEAR: usize = if cfg!(test) { 1 << 9 } else { 5 << 17 };
    prefetch::POSSIBLE && words.len() > NEAR
}

/// The bits of a column of cubes of `SIDE`.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "at most 24")]
fn bits_of_column<V: Simd, const SIDE: usize>(voxels: i32x16<V>, x: usize, y: usize) -> i32x16<V> {
    voxels >> ((SIDE * x + y) * SIDE) as u32 & ((1 << SIDE) - 1)
}

impl Sink for SetRuns<'_> {
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside the slab")]
    fn run(&mut self, x: i64, y: i64, from: i64, to: i64) {
        let (from, to) = ((from - self.slab.start[2]) as u32, (to - self.slab.start[2]) as u32);
        set_run(self.slab.column(x, y), from, to);
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside the slab")]
    fn row(&mut self, at: [i64; 3], turned: bool, columns: u64, from: &Tile, to: &Tile) {
        let Slab { words, start, columns: row, column_words } = &mut self.slab;
        let first = ((at[0] - start[0]) as usize * *row + (at[1] - start[1]) as usize) * *column_words;
        let step = if turned { *row * *column_words } else { *column_words };
        let z = at[2] - start[2];
        for_each_column(columns, |column| {
            let word = first + column * step;
            set_run(&mut words[word..word + *column_words], (from[column] + z) as u32, (to[column] + z) as u32);
        });
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside the slab")]
    fn tile(&mut self, at: [i64; 3], turned: bool, columns: u64, from: &Tile, to: &Tile, last_z: i64) {
        let Slab { words, start, columns: row, column_words } = &mut self.slab;
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

impl ColumnSink for SetRuns<'_> {
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "below 2^30")]
    fn place<V: Simd>(&self, low: &[i32x16<V>; 3], base: [i64; 3]) -> Place<V> {
        let Slab { start, columns, .. } = self.slab;
        let [x, y, z] = [(base[0] - start[0]) as i32, (base[1] - start[1]) as i32, (base[2] - start[2]) as i32];
        let row = columns as i32;
        Place { column: (low[0] + x) * row + (low[1] + y), z: low[2] + z, row }
    }

    #[inline(always)]
    fn columns<V: Simd>(&mut self, simd: V, columns: i32x16<V>, from: i32x16<V>, bits: i32x16<V>, lanes: Lanes) {
        let lanes = mask32x16::from_bitmask(simd, lanes);
        if self.in_columns.push(simd, columns, from << MOST_BITS | bits, lanes) {
            self.set_in_columns(simd);
        }
    }

    #[inline(always)]
    fn finish<V: Simd>(&mut self, simd: V) {
        self.set_in_words(simd);
        self.set_in_columns(simd);
    }
}

/// Where cubes are in a piece.
pub(super) struct PlaceInWords<V: Simd> {
    place: Place<V>,
    /// The word and the shift of the low corner.
    word: i32x16<V>,
    shift: i32x16<V>,
}

impl CubeSink for SetRuns<'_> {
    type Places<V: Simd> = PlaceInWords<V>;

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "where it may be, it is not used")]
    fn places<V: Simd>(&self, low: &[i32x16<V>; 3], base: [i64; 3]) -> PlaceInWords<V> {
        let place = self.place(low, base);
        let word = place.column * self.slab.column_words as i32 + (place.z >> WORD_SHIFT);
        let shift = place.z & (WORD_BITS as i32 - 1);
        PlaceInWords { place, word, shift }
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "words that fit")]
    fn cubes<V: Simd, const SIDE: usize>(
        &mut self,
        simd: V,
        places: &PlaceInWords<V>,
        voxels: i32x16<V>,
        lanes: Lanes,
    ) {
        let &PlaceInWords { ref place, word, shift } = places;
        let none = i32x16::splat(simd, 0);
        let in_a_word = shift.simd_le(WORD_BITS as i32 - SIDE as i32).to_bitmask();
        let here = if self.slab.words.len() > MOST_WORDS { 0 } else { lanes & in_a_word };
        if here != lanes {
            self.cubes_as_columns::<V, SIDE>(simd, place, voxels, lanes & !here);
        }
        let here = mask32x16::from_bitmask(simd, here);
        let voxels = here.select(voxels, none);
        let [layer, beside] = [self.slab.layer() as i32, self.slab.column_words as i32];
        for x in 0..SIDE {
            for y in 0..SIDE {
                let first = ((SIDE * x + y) * SIDE) as u32;
                let column = (1 << SIDE) - 1;
                // At once to above the shift.
                let bits =
                    if first < WORD_SHIFT { voxels << (WORD_SHIFT - first) } else { voxels >> (first - WORD_SHIFT) };
                let bits = bits & column << WORD_SHIFT | shift;
                let some = (voxels & column << first).simd_gt(none);
                let word = word + (x as i32 * layer + y as i32 * beside);
                if self.in_words.push(simd, word, bits, some) {
                    self.ask_for_words(simd);
                }
            }
        }
    }
}

/// Words of a slab whose numbers fit an `i32`; in tests, so few that some grids have more.
const MOST_WORDS: usize = if cfg!(test) { 1 << 12 } else { i32::MAX as usize };

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conformance::random::Random;
    use crate::cpu::instructions::Instructions;

    /// A piece of columns of two words, with so many that words are asked for.
    const DIMS: [usize; 3] = [25, 40, 128];
    const START: [i64; 3] = [3, 7, 64];

    /// Sets random cubes of `SIDE`, vector by vector, and in another piece their voxels one by one.
    fn cubes_are_set<V: Simd, const SIDE: usize>(simd: V, random: &mut Random, vectors: u32) {
        let column_words = DIMS[2] / WORD_BITS as usize;
        let mut words = vec![0; DIMS[0] * DIMS[1] * column_words];
        let mut expected = words.clone();
        assert!(asks(&words) == prefetch::POSSIBLE && words.len() <= MOST_WORDS);
        let slab = Slab { words: &mut words, start: START, columns: DIMS[1], column_words };
        let mut sink = SetRuns::new(slab);
        let base = [1, 5, 60];
        for _ in 0..vectors {
            let mut low = [[0i32; LANES]; 3];
            let mut voxels = [0i32; LANES];
            let lanes = random.range(0, (1 << LANES) - 1).cast_unsigned();
            for lane in 0..LANES {
                let corner: [usize; 3] = std::array::from_fn(|axis| index(random, DIMS[axis] - SIDE));
                for axis in 0..3 {
                    low[axis][lane] = i32::try_from(corner[axis] as i64 + START[axis] - base[axis]).unwrap();
                }
                voxels[lane] = i32::try_from(random.range(0, (1 << (SIDE * SIDE * SIDE)) - 1)).unwrap();
                for voxel in set_bits(voxels[lane].cast_unsigned().into()).filter(|_| lanes >> lane & 1 != 0) {
                    let [x, y, z] = [voxel / SIDE / SIDE, voxel / SIDE % SIDE, voxel % SIDE];
                    let (column, z) = ((corner[0] + x) * DIMS[1] + corner[1] + y, corner[2] + z);
                    expected[column * column_words + z / 64] |= 1 << (z % 64);
                }
            }
            let low = low.map(|row| i32x16::from_slice(simd, &row));
            let places = sink.places(&low, base);
            sink.cubes::<_, SIDE>(simd, &places, i32x16::from_slice(simd, &voxels), lanes);
        }
        sink.finish(simd);
        assert!(words == expected, "side {SIDE}, {vectors} vectors");
    }

    fn index(random: &mut Random, most: usize) -> usize {
        usize::try_from(random.range(0, i64::try_from(most).unwrap())).unwrap()
    }

    /// However many wait when there are no more.
    #[test]
    fn cubes_are_set_whether_or_not_their_words_were_asked_for() {
        for level in Instructions::ALL {
            let mut random = Random::new(13);
            fearless_simd::dispatch!(level.level(), simd => {
                for vectors in (0..30).chain([100, 1000]) {
                    cubes_are_set::<_, 2>(simd, &mut random, vectors);
                    cubes_are_set::<_, 3>(simd, &mut random, vectors);
                }
            });
        }
    }
}
