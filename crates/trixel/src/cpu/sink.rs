//! Where the kernel's runs go: bits of a slab of columns.

use super::triangles::LANES;
use crate::volume::WORD_BITS;

/// Words of a column by shifting.
const WORD_SHIFT: u32 = WORD_BITS.trailing_zeros();

/// Receives runs of voxels.
pub(super) trait Sink {
    /// The voxels `(x, y, from..=to)`, all inside the clip that the kernel was given.
    fn run(&mut self, x: i64, y: i64, from: i64, to: i64);
}

/// Receives cubes of voxels too, several at once.
pub(super) trait CubeSink: Sink {
    /// Looks up cubes whose low corners, a row for each axis, are seen from the voxel `base`; along z, they are inside the
    /// slab.
    fn places(&self, low: &[[i32; LANES]; 3], base: [i64; 3]) -> Places;

    /// Voxels of the cube of `SIDE` in a lane: those `(x, y, z)` from its low corner whose bit `(SIDE x + y) SIDE + z` is
    /// set. The set ones are inside the clip.
    fn cube<const SIDE: usize>(&mut self, places: &Places, lane: usize, bits: u64);
}

/// Where the low corners of cubes are: from the slab's start on, and among its words.
pub(super) struct Places {
    at: [[i64; LANES]; 3],
    word: [usize; LANES],
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

impl Slab<'_> {
    /// The same piece, for a shorter time.
    pub(super) fn reborrow(&mut self) -> Slab<'_> {
        Slab { words: self.words, ..*self }
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside the slab")]
    fn column(&mut self, x: i64, y: i64) -> &mut [u64] {
        let [x, y] = [(x - self.start[0]) as usize, (y - self.start[1]) as usize];
        let start = (x * self.columns + y) * self.column_words;
        &mut self.words[start..start + self.column_words]
    }
}

impl Slab<'_> {
    /// Sets the voxels of a cube whose columns' bits are in the words after `first`: all columns without asking which
    /// have any, as that guess is wrong too often. `false`, and nothing done, where not all are in the slab.
    #[inline(always)]
    fn set_cube<const SIDE: usize>(&mut self, first: usize, bits: u64, shift: u32) -> bool {
        let (beside, layer) = (self.column_words, self.columns * self.column_words);
        let last = (SIDE - 1) * (layer + beside);
        // At the end of a row, the column beside is the first of the next: its bits are 0 then.
        let Some(words) = self.words.get_mut(first..).filter(|words| words.len() > last) else {
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
}

impl CubeSink for SetRuns<'_> {
    #[inline(always)]
    fn places(&self, low: &[[i32; LANES]; 3], base: [i64; 3]) -> Places {
        let Slab { words, start, columns, column_words } = &self.0;
        let mut places = Places { at: [[0; LANES]; 3], word: [0; LANES] };
        for i in 0..3 {
            for lane in 0..LANES {
                places.at[i][lane] = i64::from(low[i][lane]) + (base[i] - start[i]);
            }
        }
        let [xs, ys, zs] = &places.at;
        for lane in 0..LANES {
            // Outside the slab this is a word past its end, or one for which no bit will be set.
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                clippy::cast_possible_wrap,
                reason = "see above"
            )]
            {
                let column = xs[lane] * *columns as i64 + ys[lane];
                places.word[lane] = (column * *column_words as i64 + (zs[lane] >> WORD_SHIFT)) as usize;
            }
        }
        // Reads what will be changed, so that the memory is under way while voxels are still computed.
        let layer = columns * column_words;
        let mut seen = 0;
        for &word in &places.word {
            seen |= words.get(word).copied().unwrap_or(0);
            seen |= words.get(word.wrapping_add(layer)).copied().unwrap_or(0);
        }
        std::hint::black_box(seen);
        places
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside the slab")]
    fn cube<const SIDE: usize>(&mut self, places: &Places, lane: usize, mut bits: u64) {
        let side = SIDE as u32;
        let low = [0, 1, 2].map(|i| places.at[i][lane]);
        let shift = low[2] as u32 % WORD_BITS;
        if shift <= WORD_BITS - side && self.0.set_cube::<SIDE>(places.word[lane], bits, shift) {
            return;
        }
        let word = (low[2] >> WORD_SHIFT) as usize;
        while bits != 0 {
            let column = bits.trailing_zeros() / side;
            let run = bits >> (column * side) & ((1 << side) - 1);
            bits ^= run << (column * side);
            let at = [low[0] + i64::from(column / side), low[1] + i64::from(column % side)];
            let words = self.0.column(at[0] + self.0.start[0], at[1] + self.0.start[1]);
            words[word] |= run << shift;
            if shift > WORD_BITS - side {
                let above = run >> (WORD_BITS - shift);
                if above != 0 {
                    words[word + 1] |= above;
                }
            }
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
