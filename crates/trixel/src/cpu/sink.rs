//! Where the kernel's runs go: bits of a slab of columns.

use crate::volume::WORD_BITS;

/// Receives runs of voxels.
pub(super) trait Sink {
    /// The voxels `(x, y, from..=to)`, all inside the clip that the kernel was given.
    fn run(&mut self, x: i64, y: i64, from: i64, to: i64);

    /// Voxels of the cube of `SIDE` from `low` on: `low + (x, y, z)` where bit `(SIDE x + y) SIDE + z` is set. The set
    /// ones are inside the clip.
    fn cube<const SIDE: usize>(&mut self, low: [i64; 3], bits: u64);
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
    /// Sets the voxels of a cube of two, whose columns' bits are in one word: all four without asking which are set, as
    /// that guess is wrong too often. `false`, and nothing done, where the four are not all in the slab.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked to be inside the slab")]
    fn set_four(&mut self, low: [i64; 3], word: usize, bits: u64, shift: u32) -> bool {
        let [x, y] = [low[0] - self.start[0], low[1] - self.start[1]];
        if (x | y) < 0 {
            return false;
        }
        let first = (x as usize * self.columns + y as usize) * self.column_words + word;
        let (beside, layer) = (self.column_words, self.columns * self.column_words);
        // At the end of a row, the column beside is the first of the next: its bits are 0 then.
        let Some(words) = self.words.get_mut(first..).filter(|words| words.len() > layer + beside) else {
            return false;
        };
        words[0] |= (bits & 3) << shift;
        words[beside] |= (bits >> 2 & 3) << shift;
        words[layer] |= (bits >> 4 & 3) << shift;
        words[layer + beside] |= (bits >> 6 & 3) << shift;
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

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside the slab")]
    fn cube<const SIDE: usize>(&mut self, low: [i64; 3], mut bits: u64) {
        let z = (low[2] - self.0.start[2]) as u32;
        let (word, shift) = ((z / WORD_BITS) as usize, z % WORD_BITS);
        let side = SIDE as u32;
        if SIDE == 2 && shift <= WORD_BITS - side && self.0.set_four(low, word, bits, shift) {
            return;
        }
        while bits != 0 {
            let column = bits.trailing_zeros() / side;
            let run = bits >> (column * side) & ((1 << side) - 1);
            bits ^= run << (column * side);
            let words = self.0.column(low[0] + i64::from(column / side), low[1] + i64::from(column % side));
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

    /// Parity needs whole runs: batches are for surfaces.
    fn cube<const SIDE: usize>(&mut self, low: [i64; 3], bits: u64) {
        debug_assert!(false, "a batch of a solid at {low:?}: {bits:#x}");
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
