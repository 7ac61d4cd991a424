//! How many tiles a mesh's triangles meet, counted before it is uploaded: what the rounds of `tiled` are sized by.

use trixel::lattice::STEP_BITS;

use crate::limits::TILE_SHIFT;

/// Numbers of tiles by their logarithm: how many triangles meet so many, and how many tiles they meet together.
#[derive(Clone, Debug)]
pub(crate) struct TileCounts([(u64, u64); 64]);

impl TileCounts {
    /// Of triangles in lattice steps. Boxes are taken one voxel higher than they are, which is as far as solids toggle.
    pub(crate) fn of(positions: &[i32], indices: &[u32]) -> Self {
        let mut counts = Self([(0, 0); 64]);
        let vertices = positions.as_chunks::<3>().0;
        let corner = |index: u32| vertices.get(index as usize).copied().unwrap_or_default();
        for triangle in indices.as_chunks::<3>().0 {
            let corners = triangle.map(corner);
            let mut tiles = 1u64;
            for (axis, shift) in TILE_SHIFT.into_iter().enumerate() {
                let along = corners.map(|corner| i64::from(corner[axis]));
                let low = along.into_iter().min().unwrap_or(0) - 1;
                let high = along.into_iter().max().unwrap_or(0);
                let high = (high >> STEP_BITS) + i64::from(axis == 2);
                tiles *= ((high >> shift) - (low >> (STEP_BITS + shift)) + 1).unsigned_abs();
            }
            let (triangles, sum) = &mut counts.0[tiles.ilog2() as usize & 63];
            *triangles += 1;
            *sum += tiles;
        }
        counts
    }

    /// The most pairs of triangle and tile in a part of a grid that has so many tiles, where slices overlap by so many voxels.
    pub(crate) fn most(&self, tiles: u64, overlap_voxels: u32) -> u64 {
        // Each triangle's tiles along z, and those that the overlaps on both sides add to them.
        let times =
            if overlap_voxels == 0 { 1 } else { 2 + u64::from((2 * overlap_voxels).div_ceil(1 << TILE_SHIFT[2])) };
        let most = |(triangles, sum): &(u64, u64)| (sum * times).min(triangles * tiles);
        self.0.iter().map(most).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_are_counted_and_no_more_than_there_are() {
        const S: i32 = 1 << STEP_BITS;
        // Within a tile; across 3 x 2 x 1 tiles.
        let positions = [S, S, S, 2 * S, S, S, S, 2 * S, S, S, S, S, 40 * S, S, S, S, 20 * S, S];
        let counts = TileCounts::of(&positions, &[0, 1, 2, 3, 4, 5]);
        assert_eq!(counts.most(1000, 0), 1 + 6);
        assert_eq!(counts.most(4, 0), 1 + 4);
        assert_eq!(counts.most(1000, 1), 3 * 7);
        // Faces on a tile's border belong to both sides.
        let touching = [16 * S, S, S, 17 * S, S, S, 16 * S, 2 * S, S];
        assert_eq!(TileCounts::of(&touching, &[0, 1, 2]).most(1000, 0), 2);
    }
}
