//! Where the kernel's runs go: bits of a slab of columns.

use super::rows::Tile;
use super::triangles::LANES;
use crate::volume::WORD_BITS;

/// Words of a column by shifting.
const WORD_SHIFT: u32 = WORD_BITS.trailing_zeros();

/// Receives runs of voxels.
pub(super) trait Sink {
    /// The voxels `(x, y, from..=to)`, all inside the clip that the kernel was given.
    fn run(&mut self, x: i64, y: i64, from: i64, to: i64);

    /// Runs of columns `(x, y)` of eight by eight from `at` on: those whose bit `8 x + y` is set in `columns`. The z of their
    /// ends are seen from `at`, where a word of each column begins, and are at most `last_z`.
    #[inline(always)]
    fn tile(&mut self, at: [i64; 3], columns: u64, from: &Tile, to: &Tile, _last_z: i64) {
        for_each_column(columns, |column| {
            let (x, y) = (at[0] + (column / 8) as i64, at[1] + (column % 8) as i64);
            self.run(x, y, at[2] + from[column], at[2] + to[column]);
        });
    }

    /// Whether a triangle that is not tiny, of which the number and the range of x inside the clip are given, is left for
    /// later.
    #[inline(always)]
    fn leaves(&mut self, _number: usize, _x: [i64; 2]) -> bool {
        false
    }
}

/// Receives cubes of voxels too, several at once.
pub(super) trait CubeSink: Sink {
    /// Looks up cubes whose low corners, a row for each axis, are seen from the voxel `base`; along z, they are inside the
    /// clip.
    fn places(&self, low: &[[i32; LANES]; 3], base: [i64; 3]) -> Places;

    /// Voxels of the cube of `SIDE` in a lane: those `(x, y, z)` from its low corner whose bit `(SIDE x + y) SIDE + z` is
    /// set. The set ones are inside the clip.
    fn cube<const SIDE: usize>(&mut self, places: &Places, lane: usize, bits: u64);
}

/// Where the low corners of cubes are: along x, and among a piece's words.
pub(super) struct Places {
    pub(super) x: [i64; LANES],
    /// Outside the piece: past its end, below 0, or a word for which no bit will be set.
    pub(super) word: [isize; LANES],
    pub(super) shift: [u32; LANES],
}

impl Places {
    /// In a piece that starts at a voxel, for its columns along y and the words of a column.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_possible_wrap,
        reason = "within the piece or a few voxels beside it"
    )]
    pub(super) fn new(
        low: &[[i32; LANES]; 3],
        base: [i64; 3],
        start: [i64; 3],
        columns: usize,
        column_words: usize,
    ) -> Self {
        let mut places = Self { x: [0; LANES], word: [0; LANES], shift: [0; LANES] };
        for lane in 0..LANES {
            let at = |i: usize| i64::from(low[i][lane]) + (base[i] - start[i]);
            let z = at(2);
            places.x[lane] = at(0);
            places.word[lane] = ((at(0) * columns as i64 + at(1)) * column_words as i64 + (z >> WORD_SHIFT)) as isize;
            places.shift[lane] = z as u32 % WORD_BITS;
        }
        places
    }
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
    fn layer(&self) -> usize {
        self.columns * self.column_words
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside the slab")]
    fn column(&mut self, x: i64, y: i64) -> &mut [u64] {
        let [x, y] = [(x - self.start[0]) as usize, (y - self.start[1]) as usize];
        let start = (x * self.columns + y) * self.column_words;
        &mut self.words[start..start + self.column_words]
    }

    /// Sets the voxels of a cube whose columns' bits are in the words from `first` on: all columns without asking which
    /// have any, as that guess is wrong too often. `false`, and nothing done, where not all are in the slab.
    #[inline(always)]
    #[expect(clippy::cast_sign_loss, reason = "too large, then")]
    fn set_cube<const SIDE: usize>(&mut self, first: isize, bits: u64, shift: u32) -> bool {
        let (beside, layer) = (self.column_words, self.layer());
        let last = (SIDE - 1) * (layer + beside);
        // At the end of a row, the column beside is the first of the next: its bits are 0 then.
        let Some(words) = self.words.get_mut(first as usize..).filter(|words| words.len() > last) else {
            return false;
        };
        for x in 0..SIDE {
            for y in 0..SIDE {
                let run = bits >> ((SIDE * x + y) * SIDE) & ((1 << SIDE) - 1);
                words[x * layer + y * beside] |= run << shift;
            }
        }
        true
    }

    /// Sets the voxels of a cube whose columns' bits are in the words from `first` on, which may lie outside the slab as
    /// long as its voxels do not.
    #[inline(always)]
    pub(super) fn paint_cube<const SIDE: usize>(&mut self, first: isize, bits: u64, shift: u32) {
        if shift > WORD_BITS - side::<SIDE>() || !self.set_cube::<SIDE>(first, bits, shift) {
            self.set_columns::<SIDE>(first, bits, shift);
        }
    }

    /// [`Self::paint_cube`], column by column.
    #[cold]
    #[inline(never)]
    #[expect(clippy::cast_sign_loss, reason = "voxels are inside the slab")]
    fn set_columns<const SIDE: usize>(&mut self, first: isize, mut bits: u64, shift: u32) {
        let side = side::<SIDE>();
        while bits != 0 {
            let column = bits.trailing_zeros() / side;
            let run = bits >> (column * side) & ((1 << side) - 1);
            bits ^= run << (column * side);
            let (x, y) = ((column / side) as usize, (column % side) as usize);
            let word = first.wrapping_add_unsigned(x * self.layer() + y * self.column_words) as usize;
            self.words[word] |= run << shift;
            if shift > WORD_BITS - side {
                let above = run >> (WORD_BITS - shift);
                if above != 0 {
                    self.words[word + 1] |= above;
                }
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
    fn tile(&mut self, at: [i64; 3], columns: u64, from: &Tile, to: &Tile, last_z: i64) {
        let Slab { words, start, columns: row, column_words } = &mut self.0;
        let [x, y, z] = [0, 1, 2].map(|i| (at[i] - start[i]) as usize);
        let first = (x * *row + y) * *column_words + z / WORD_BITS as usize;
        let layer = *row * *column_words;
        let word = |column: usize| first + column / 8 * layer + column % 8 * *column_words;
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
                let (x, y) = (at[0] + (column / 8) as i64, at[1] + (column % 8) as i64);
                self.run(x, y, at[2] + from[column], at[2] + to[column]);
            });
        }
    }
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
    #[inline(always)]
    fn places(&self, low: &[[i32; LANES]; 3], base: [i64; 3]) -> Places {
        Places::new(low, base, self.0.start, self.0.columns, self.0.column_words)
    }

    #[inline(always)]
    fn cube<const SIDE: usize>(&mut self, places: &Places, lane: usize, bits: u64) {
        self.0.paint_cube::<SIDE>(places.word[lane], bits, places.shift[lane]);
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
