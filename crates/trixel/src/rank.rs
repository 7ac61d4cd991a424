//! Rank: the place of each set voxel in the compact list of all of them.
//!
//! The list is sorted by x, then y, then z, which is the order of a volume's bits, so that a voxel's place is the number
//! of bits set before its own: a prefix sum over blocks of words, and population counts within a block (G. Jacobson,
//! *Space-efficient Static Trees and Graphs*, 1989). It adds an eighth to the volume's memory, and attributes then take
//! room for set voxels only.

use crate::volume::{Volume, WORD_BITS};

/// Words whose bits are counted anew by each query.
const BLOCK_WORDS: usize = 8;

/// The places of a volume's set voxels in the list of all of them, sorted by x, y, z.
///
/// ```
/// use trixel::{Grid, Rank, Volume};
/// let mut volume = Volume::new(Grid::new([0.0; 3], [1.0; 3], [4, 4, 200])?)?;
/// volume.set([1, 0, 7]);
/// volume.set([1, 0, 150]);
/// let rank = Rank::new(&volume);
/// assert_eq!((rank.of([1, 0, 150]), rank.of([1, 0, 8]), rank.count()), (Some(1), None, 2));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Rank<'a> {
    volume: &'a Volume,
    /// Set bits before each block of [`BLOCK_WORDS`] words, and the number of all of them at the end.
    before: Vec<u64>,
}

impl<'a> Rank<'a> {
    /// Counts the bits of `volume`.
    #[must_use]
    pub fn new(volume: &'a Volume) -> Self {
        let count = |words: &[u64]| words.iter().map(|word| u64::from(word.count_ones())).sum::<u64>();
        #[cfg(feature = "threads")]
        let mut before: Vec<u64> = {
            use rayon::prelude::*;
            volume.words().par_chunks(BLOCK_WORDS).with_min_len(1 << 12).map(count).collect()
        };
        #[cfg(not(feature = "threads"))]
        let mut before: Vec<u64> = volume.words().chunks(BLOCK_WORDS).map(count).collect();
        let mut total = 0;
        for block in &mut before {
            total += std::mem::replace(block, total);
        }
        before.push(total);
        Self { volume, before }
    }

    /// The volume.
    #[must_use]
    pub fn volume(&self) -> &'a Volume {
        self.volume
    }

    /// How many voxels are set.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.before.last().copied().unwrap_or(0)
    }

    /// The place of `voxel` in the list, from 0; `None` when it is not set or outside the grid.
    #[must_use]
    pub fn of(&self, voxel: [u32; 3]) -> Option<u64> {
        self.volume.get(voxel).then(|| self.before(voxel))
    }

    /// How many voxels are set before `voxel`, itself set or not: its place in the list if it is.
    ///
    /// # Panics
    /// When the voxel is outside the grid.
    #[must_use]
    pub fn before(&self, [x, y, z]: [u32; 3]) -> u64 {
        let index = self.column_word(x, y) + (z / WORD_BITS) as usize;
        let below = (1 << (z % WORD_BITS)) - 1;
        self.before_word(index) + u64::from((self.volume.words()[index] & below).count_ones())
    }

    /// How many voxels are set in the columns before `(x, y)`: the place of the column's first one. `y` may be the number
    /// of columns along y, and `x` that along x when `y` is 0.
    ///
    /// # Panics
    /// When the column is farther outside.
    #[must_use]
    pub fn before_column(&self, x: u32, y: u32) -> u64 {
        self.before_word(self.column_word(x, y))
    }

    fn column_word(&self, x: u32, y: u32) -> usize {
        (x as usize * self.volume.grid().dims()[1] as usize + y as usize) * self.volume.column_words()
    }

    fn before_word(&self, index: usize) -> u64 {
        let block = index / BLOCK_WORDS;
        let words = &self.volume.words()[block * BLOCK_WORDS..index];
        self.before[block] + words.iter().map(|word| u64::from(word.count_ones())).sum::<u64>()
    }
}

/// The order of a voxel list.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum VoxelOrder {
    /// By x, then y, then z: the order of ranks.
    #[default]
    Xyz,
    /// Along the Morton curve: by the bits of the coordinates interleaved, x's the highest of each three.
    Morton,
}

/// The set voxels of `volume` as a list.
///
/// ```
/// use trixel::{Grid, Volume, VoxelOrder, voxel_list};
/// let mut volume = Volume::new(Grid::new([0.0; 3], [1.0; 3], [4, 4, 4])?)?;
/// for voxel in [[0, 1, 1], [0, 0, 2], [1, 0, 0]] {
///     volume.set(voxel);
/// }
/// assert_eq!(voxel_list(&volume, VoxelOrder::Xyz), [[0, 0, 2], [0, 1, 1], [1, 0, 0]]);
/// assert_eq!(voxel_list(&volume, VoxelOrder::Morton), [[0, 1, 1], [1, 0, 0], [0, 0, 2]]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[must_use]
pub fn voxel_list(volume: &Volume, order: VoxelOrder) -> Vec<[u32; 3]> {
    let mut list: Vec<[u32; 3]> = volume.iter().collect();
    if order == VoxelOrder::Morton {
        list.sort_unstable_by_key(|&voxel| morton(voxel));
    }
    list
}

/// The place of a voxel on the Morton curve, for coordinates below 2^21.
///
/// ```
/// assert_eq!(trixel::morton([1, 0, 0]), 0b100);
/// assert_eq!(trixel::morton([0b10, 0b11, 0b00]), 0b110_010);
/// ```
#[must_use]
pub fn morton([x, y, z]: [u32; 3]) -> u64 {
    /// Puts two zeros between each two bits.
    fn spread(coordinate: u32) -> u64 {
        let mut bits = u64::from(coordinate) & 0x1f_ffff;
        bits = (bits | bits << 32) & 0x001f_0000_0000_ffff;
        bits = (bits | bits << 16) & 0x001f_0000_ff00_00ff;
        bits = (bits | bits << 8) & 0x100f_00f0_0f00_f00f;
        bits = (bits | bits << 4) & 0x10c3_0c30_c30c_30c3;
        (bits | bits << 2) & 0x1249_2492_4924_9249
    }
    spread(x) << 2 | spread(y) << 1 | spread(z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conformance::random::Random;
    use crate::grid::Grid;

    fn random_volume(dims: [u32; 3], voxels: u32, seed: u64) -> Volume {
        let mut volume = Volume::new(Grid::new([0.0; 3], [1.0; 3], dims).unwrap()).unwrap();
        let mut random = Random::new(seed);
        for _ in 0..voxels {
            volume.set(dims.map(|d| u32::try_from(random.range(0, i64::from(d) - 1)).unwrap()));
        }
        volume
    }

    #[test]
    fn rank_is_the_place_in_the_list() {
        for (dims, voxels) in [([7, 9, 130], 500), ([1, 1, 1], 1), ([3, 2, 64], 384), ([5, 5, 5], 0)] {
            let volume = random_volume(dims, voxels, 1);
            let rank = Rank::new(&volume);
            assert_eq!(rank.count(), volume.count());
            let mut next = 0;
            for x in 0..dims[0] {
                for y in 0..dims[1] {
                    assert_eq!(rank.before_column(x, y), next);
                    for z in 0..dims[2] {
                        let expected = volume.get([x, y, z]).then_some(next);
                        assert_eq!(rank.of([x, y, z]), expected);
                        next += u64::from(expected.is_some());
                    }
                }
            }
            assert_eq!(rank.before_column(dims[0], 0), next);
            assert_eq!(rank.of(dims), None);
        }
    }

    #[test]
    fn morton_interleaves_bit_by_bit() {
        let mut random = Random::new(2);
        for _ in 0..1000 {
            let voxel: [u32; 3] = std::array::from_fn(|_| u32::try_from(random.range(0, (1 << 21) - 1)).unwrap());
            let slow = (0..21).fold(0, |code, bit| {
                (0..3).fold(code, |code, axis| code | u64::from(voxel[axis] >> bit & 1) << (3 * bit + 2 - axis))
            });
            assert_eq!(morton(voxel), slow);
        }
    }

    #[test]
    fn a_morton_list_has_the_same_voxels() {
        let volume = random_volume([20, 33, 70], 800, 3);
        let mut list = voxel_list(&volume, VoxelOrder::Morton);
        assert!(list.is_sorted_by_key(|&voxel| morton(voxel)));
        list.sort_unstable();
        assert_eq!(list, voxel_list(&volume, VoxelOrder::Xyz));
    }
}
