//! The modes: which voxels a mesh sets. DESIGN's definitions, in words, on each variant.

/// Which voxels are set. Each mode has one exact definition; every backend and strategy gives precisely that set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Mode {
    /// 26-separating surface: the closed voxel and the closed triangle share a point.
    #[default]
    Conservative,
    /// 6-separating surface (\[HCV\] figure 6.2): the triangle passes the voxel's centre within half a voxel along the
    /// dominant axis of its plane and of each projected edge.
    Thin,
    /// Interior by parity: an odd number of triangles cross the ray from the voxel's centre towards -z.
    Solid,
    /// The one-pass slicing of \[CL\]: the line along z through the voxel's centre meets a triangle inside the voxel's closed
    /// slice. Misses walls parallel to z.
    Sliced,
}

impl Mode {
    /// Every mode.
    pub const ALL: [Self; 4] = [Self::Conservative, Self::Thin, Self::Solid, Self::Sliced];

    /// The name on the command line and in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Conservative => "conservative",
            Self::Thin => "thin",
            Self::Solid => "solid",
            Self::Sliced => "sliced",
        }
    }
}

impl std::fmt::Display for Mode {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}
