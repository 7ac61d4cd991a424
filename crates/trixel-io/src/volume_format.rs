//! The file formats that volumes are written in.

use std::path::Path;

use crate::extension;

/// A volume file format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum VolumeFormat {
    /// NumPy archive with occupancy and grid, dense or sparse.
    Npz,
    /// NumPy array of the occupancy alone.
    Npy,
    /// binvox, run-length encoded, padded to a cube.
    Binvox,
    /// `MagicaVoxel` scene.
    Vox,
    /// VTK XML image data.
    Vti,
    /// NRRD, gzip-compressed.
    Nrrd,
    /// Exposed faces as Wavefront OBJ.
    Obj,
    /// Exposed faces as binary PLY.
    Ply,
    /// Exposed faces as binary STL.
    Stl,
    /// Exposed faces as binary glTF 2.0.
    Glb,
    /// One byte a voxel, with a `.json` file beside it.
    Raw,
}

/// Which attributes of voxels a format holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AttributeSupport {
    /// None.
    Nothing,
    /// Colours.
    Colors,
    /// Every one.
    All,
}

impl VolumeFormat {
    /// Every format.
    pub const ALL: [Self; 11] = [
        Self::Npz,
        Self::Npy,
        Self::Binvox,
        Self::Vox,
        Self::Vti,
        Self::Nrrd,
        Self::Obj,
        Self::Ply,
        Self::Stl,
        Self::Glb,
        Self::Raw,
    ];

    /// The file extension, in lower case, without the dot.
    #[must_use]
    pub fn extension(self) -> &'static str {
        match self {
            Self::Npz => "npz",
            Self::Npy => "npy",
            Self::Binvox => "binvox",
            Self::Vox => "vox",
            Self::Vti => "vti",
            Self::Nrrd => "nrrd",
            Self::Obj => "obj",
            Self::Ply => "ply",
            Self::Stl => "stl",
            Self::Glb => "glb",
            Self::Raw => "raw",
        }
    }

    /// The format that a path's extension names, in any case.
    #[must_use]
    pub fn from_path(path: &Path) -> Option<Self> {
        Self::ALL.into_iter().find(|format| extension::matches(path, format.extension()))
    }

    /// Whether it can be written from bricks ([`crate::write::write_bricks`]), so that the grid need not fit the memory.
    #[must_use]
    pub fn takes_bricks(self) -> bool {
        matches!(self, Self::Npz | Self::Ply | Self::Vox)
    }

    /// Which attributes are written with the voxels.
    #[must_use]
    pub fn attributes(self) -> AttributeSupport {
        match self {
            Self::Npz | Self::Vti => AttributeSupport::All,
            Self::Vox | Self::Obj | Self::Ply | Self::Glb => AttributeSupport::Colors,
            Self::Npy | Self::Binvox | Self::Nrrd | Self::Stl | Self::Raw => AttributeSupport::Nothing,
        }
    }

    /// Whether [`crate::volume_read`] reads the format back: those that hold voxels rather than faces, except `.vox`,
    /// whose readers need not keep what is unknown to the editor.
    #[must_use]
    pub fn is_readable(self) -> bool {
        match self {
            Self::Npz | Self::Npy | Self::Binvox | Self::Vti | Self::Nrrd | Self::Raw => true,
            Self::Vox | Self::Obj | Self::Ply | Self::Stl | Self::Glb => false,
        }
    }
}
