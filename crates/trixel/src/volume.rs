//! Dense occupancy: one bit a voxel.

use crate::grid::Grid;

/// Bits of one storage word.
pub const WORD_BITS: u32 = u64::BITS;

/// The voxels of a [`Grid`], one bit each.
///
/// Bits are packed along z: the column of voxels `[x, y, 0..nz]` is [`Volume::column_words`] consecutive words, voxel
/// `z` being bit `z % 64` of word `z / 64`. Columns follow each other with y fastest, then x, so that `a[x, y, z]` in C
/// order is the order of the bits. Bits at and above `nz` in a column's last word are always 0.
#[derive(Clone, Debug)]
pub struct Volume {
    grid: Grid,
    column_words: usize,
    words: Vec<u64>,
    /// Whether no word was ever lent out for writing, so that clearing has nothing to do (and touches no memory).
    pristine: bool,
}

/// Why a volume could not be made.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum VolumeError {
    /// The memory could not be had.
    #[error(
        "a dense grid of {} x {} x {} voxels needs {}, but {}; \
         choose a lower resolution or a larger voxel size, or voxelize a part of the mesh with an explicit grid",
        dims[0], dims[1], dims[2], Bytes(*needed),
        available.map_or_else(|| "the allocation failed".to_owned(), |bytes| format!("only {} are available", Bytes(bytes)))
    )]
    OutOfMemory {
        /// The grid's dimensions.
        dims: [u32; 3],
        /// Bytes needed.
        needed: u64,
        /// Bytes available, where known.
        available: Option<u64>,
    },
    /// The bricks of a sparse grid take more memory than allowed.
    #[error(
        "the voxels of this grid of {} x {} x {} take more than {} even as bricks; \
         choose a lower resolution or a larger voxel size, or voxelize parts of the mesh with explicit grids",
        dims[0], dims[1], dims[2], Bytes(*available)
    )]
    Bricks {
        /// The grid's dimensions.
        dims: [u32; 3],
        /// Bytes available.
        available: u64,
    },
}

/// A number of bytes, printed with a binary unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bytes(pub u64);

impl std::fmt::Display for Bytes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        const UNITS: [&str; 5] = ["bytes", "KiB", "MiB", "GiB", "TiB"];
        #[expect(clippy::cast_precision_loss, reason = "printed to one decimal")]
        let mut value = self.0 as f64;
        let mut unit = 0;
        while value >= 1024.0 && unit + 1 < UNITS.len() {
            value /= 1024.0;
            unit += 1;
        }
        let decimals = usize::from(unit > 0);
        write!(f, "{value:.decimals$} {}", UNITS[unit])
    }
}

impl Volume {
    /// Bytes that a dense volume of `grid` takes.
    #[must_use]
    pub fn required_bytes(grid: &Grid) -> u64 {
        let [nx, ny, nz] = grid.dims().map(u64::from);
        nx * ny * nz.div_ceil(u64::from(WORD_BITS)) * 8
    }

    /// An empty volume. The memory is zeroed by the operating system as it is touched.
    ///
    /// # Errors
    /// When the allocator refuses.
    pub fn new(grid: Grid) -> Result<Self, VolumeError> {
        Self::with_memory_limit(grid, None)
    }

    /// An empty volume, refused if it takes more than `available` bytes.
    ///
    /// # Errors
    /// When it does not fit or the allocator refuses.
    pub fn with_memory_limit(grid: Grid, available: Option<u64>) -> Result<Self, VolumeError> {
        let needed = Self::required_bytes(&grid);
        let refused = VolumeError::OutOfMemory { dims: grid.dims(), needed, available };
        if available.is_some_and(|available| needed > available) {
            return Err(refused);
        }
        let Ok(words) = usize::try_from(needed / 8) else { return Err(refused) };
        // `vec![0; n]` gets zeroed pages lazily but aborts when it fails, so ask first.
        if Vec::<u64>::new().try_reserve_exact(words).is_err() {
            return Err(refused);
        }
        let column_words = grid.dims()[2].div_ceil(WORD_BITS) as usize;
        Ok(Self { grid, column_words, words: vec![0; words], pristine: true })
    }

    /// The grid.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Words of one column.
    #[must_use]
    pub fn column_words(&self) -> usize {
        self.column_words
    }

    /// All words, column after column.
    #[must_use]
    pub fn words(&self) -> &[u64] {
        &self.words
    }

    /// All words, to write. Bits at and above `nz` of a column must stay 0.
    pub fn words_mut(&mut self) -> &mut [u64] {
        self.pristine = false;
        &mut self.words
    }

    /// Whether nothing was ever written, so that every word is known to be 0 without looking.
    #[must_use]
    pub fn is_pristine(&self) -> bool {
        self.pristine
    }

    /// Unsets every voxel.
    pub fn clear(&mut self) {
        if !self.pristine {
            self.words.fill(0);
            self.pristine = true;
        }
    }

    fn column_start(&self, x: u32, y: u32) -> usize {
        (x as usize * self.grid.dims()[1] as usize + y as usize) * self.column_words
    }

    /// The words of column `(x, y)`.
    ///
    /// # Panics
    /// When the column is outside the grid.
    #[must_use]
    pub fn column(&self, x: u32, y: u32) -> &[u64] {
        let start = self.column_start(x, y);
        &self.words[start..start + self.column_words]
    }

    /// Whether a voxel is set; a voxel outside the grid is not.
    #[must_use]
    pub fn get(&self, [x, y, z]: [u32; 3]) -> bool {
        let [nx, ny, nz] = self.grid.dims();
        x < nx && y < ny && z < nz && {
            let word = self.words[self.column_start(x, y) + (z / WORD_BITS) as usize];
            word >> (z % WORD_BITS) & 1 == 1
        }
    }

    /// Sets one voxel. For loops over many, write words instead.
    ///
    /// # Panics
    /// When the voxel is outside the grid.
    pub fn set(&mut self, [x, y, z]: [u32; 3]) {
        let [nx, ny, nz] = self.grid.dims();
        assert!(x < nx && y < ny && z < nz, "voxel [{x}, {y}, {z}] is outside the grid of {nx} x {ny} x {nz}");
        let word = self.column_start(x, y) + (z / WORD_BITS) as usize;
        self.words_mut()[word] |= 1 << (z % WORD_BITS);
    }

    /// How many voxels are set.
    #[must_use]
    pub fn count(&self) -> u64 {
        let count = |words: &[u64]| words.iter().map(|w| u64::from(w.count_ones())).sum::<u64>();
        if self.pristine {
            return 0;
        }
        #[cfg(feature = "threads")]
        {
            use rayon::prelude::*;
            self.words.par_chunks(1 << 16).map(count).sum()
        }
        #[cfg(not(feature = "threads"))]
        count(&self.words)
    }

    /// The set voxels `[x, y, z]`, sorted by x, then y, then z.
    pub fn iter(&self) -> impl Iterator<Item = [u32; 3]> + '_ {
        let [nx, ny, _] = self.grid.dims();
        (0..nx).flat_map(move |x| (0..ny).flat_map(move |y| set_bits(self.column(x, y)).map(move |z| [x, y, z])))
    }
}

/// The positions of the set bits of consecutive words, ascending.
pub fn set_bits(words: &[u64]) -> impl Iterator<Item = u32> + '_ {
    (0u32..).zip(words).flat_map(|(i, &word)| {
        let mut rest = word;
        std::iter::from_fn(move || {
            (rest != 0).then(|| {
                let bit = rest.trailing_zeros();
                rest &= rest - 1;
                i * WORD_BITS + bit
            })
        })
    })
}

impl PartialEq for Volume {
    fn eq(&self, other: &Self) -> bool {
        self.grid == other.grid && self.words == other.words
    }
}
