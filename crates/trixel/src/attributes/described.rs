//! Attributes asked for by voxel, for those who write or draw them.

use super::{AttributeKind, VoxelAttributes};
use crate::rank::Rank;
use crate::volume::{Volume, VolumeError};

/// A volume with the attributes of its voxels.
#[derive(Clone, Copy, Debug)]
pub struct Described<'a> {
    rank: &'a Rank<'a>,
    attributes: &'a VoxelAttributes,
}

impl<'a> Described<'a> {
    /// The attributes of the voxels that `rank` numbers; `None` when their numbers differ.
    #[must_use]
    pub fn new(rank: &'a Rank<'a>, attributes: &'a VoxelAttributes) -> Option<Self> {
        (rank.count() == attributes.voxels() as u64).then_some(Self { rank, attributes })
    }

    /// The attributes.
    #[must_use]
    pub fn attributes(&self) -> &'a VoxelAttributes {
        self.attributes
    }

    /// The places of the voxels.
    #[must_use]
    pub fn rank(&self) -> &'a Rank<'a> {
        self.rank
    }

    /// Whether there are colours.
    #[must_use]
    pub fn has_colors(&self) -> bool {
        self.attributes.get(AttributeKind::Color).is_some()
    }

    /// The row that stands for a voxel; `None` when it is not set or has no row.
    #[must_use]
    pub fn row(&self, voxel: [u32; 3]) -> Option<usize> {
        self.attributes.row(usize::try_from(self.rank.of(voxel)?).ok()?)
    }

    /// The colour of a voxel, sRGB and alpha; `None` when it is not set, has no triangle, or colours were not asked for.
    #[must_use]
    pub fn color(&self, voxel: [u32; 3]) -> Option<[u8; 4]> {
        self.attributes.color(usize::try_from(self.rank.of(voxel)?).ok()?)
    }

    /// The volume without the voxels that the alpha test cut out; `None` when that is the volume itself.
    ///
    /// # Errors
    /// When there is no memory for a second volume.
    pub fn without_cut_out(&self) -> Result<Option<Volume>, VolumeError> {
        if !self.attributes.cuts_out() {
            return Ok(None);
        }
        let volume = self.rank.volume();
        let mut shown = Volume::new(*volume.grid())?;
        let mut rank = 0;
        for (to, &from) in shown.words_mut().iter_mut().zip(volume.words()) {
            let mut rest = from;
            while rest != 0 {
                let bit = rest & rest.wrapping_neg();
                rest ^= bit;
                if self.attributes.is_covered(rank) {
                    *to |= bit;
                }
                rank += 1;
            }
        }
        Ok(Some(shown))
    }
}
