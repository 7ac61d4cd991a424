//! The columns of a volume of boundary voxels, and what switching at each of these makes of them.

use crate::volume::{Volume, WORD_BITS};

/// Columns of boundary voxels.
pub(super) struct Columns<'a> {
    boundary: &'a Volume,
    nx: usize,
    ny: usize,
}

impl<'a> Columns<'a> {
    pub(super) fn of(boundary: &'a Volume) -> Self {
        let [nx, ny, _] = boundary.grid().dims().map(|n| n as usize);
        Self { boundary, nx, ny }
    }

    pub(super) fn count(&self) -> usize {
        self.nx * self.ny
    }

    /// The boundary voxels of a column.
    pub(super) fn words(&self, column: usize) -> &'a [u64] {
        let words = self.boundary.column_words();
        self.boundary.words().get(column * words..(column + 1) * words).unwrap_or(&[])
    }

    /// Whether the number of a column's boundary voxels is odd.
    pub(super) fn is_questionable(&self, column: usize) -> bool {
        self.words(column).iter().fold(0, |odd, word| odd ^ word.count_ones() & 1) == 1
    }

    /// How many are.
    pub(super) fn questionable(&self) -> u64 {
        (0..self.count()).filter(|column| self.is_questionable(*column)).count() as u64
    }

    /// Inside from each boundary voxel to the next: the bits of a column's words.
    pub(super) fn switched(&self, column: usize) -> impl Iterator<Item = u64> + 'a {
        let nz = self.boundary.grid().dims()[2];
        let last = self.boundary.column_words().saturating_sub(1);
        let mut inside = 0u64;
        self.words(column).iter().enumerate().map(move |(i, word)| {
            let mut parity = *word;
            for shift in [1, 2, 4, 8, 16, 32] {
                parity ^= parity << shift;
            }
            parity ^= inside;
            inside = 0u64.wrapping_sub(parity >> 63);
            let used = nz % WORD_BITS;
            if i == last && used > 0 { parity & (u64::MAX >> (WORD_BITS - used)) } else { parity }
        })
    }

    /// Fills the good columns. Questionable ones get their boundary voxels, or if `all` what switching makes of them.
    pub(super) fn switch(&self, filled: &mut Volume, all: bool) {
        let words = self.boundary.column_words();
        for (column, into) in filled.words_mut().chunks_exact_mut(words).enumerate() {
            if all || !self.is_questionable(column) {
                into.iter_mut().zip(self.switched(column)).for_each(|(into, word)| *into = word);
            } else {
                into.copy_from_slice(self.words(column));
            }
        }
    }

    /// The up to eight columns around one.
    pub(super) fn around(&self, column: usize) -> impl Iterator<Item = usize> + '_ {
        let (x, y) = (column / self.ny, column % self.ny);
        let xs = x.saturating_sub(1)..=(x + 1).min(self.nx - 1);
        let ys = y.saturating_sub(1)..=(y + 1).min(self.ny - 1);
        xs.flat_map(move |x| ys.clone().map(move |y| x * self.ny + y)).filter(move |other| *other != column)
    }
}
