//! What is tunable: how triangles are told small from large, and how they are dilated.

use crate::adapter::AdapterInfo;

/// What a triangle's size is measured by; all in voxels of the projection to its dominant axis. \[HCV\] 3.3 discusses them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Heuristic {
    /// The area of the projected triangle.
    #[default]
    ProjectedArea,
    /// The area of the projection's bounding rectangle.
    BoxArea,
    /// The area of the projection dilated by half a voxel on all sides: its fragments.
    DilatedArea,
    /// The projected area over the dilated one, 0 to 1.
    AreaRatio,
    /// The voxels of the triangle's bounding box.
    Extent,
}

impl Heuristic {
    /// Every heuristic.
    pub const ALL: [Self; 5] = [Self::ProjectedArea, Self::BoxArea, Self::DilatedArea, Self::AreaRatio, Self::Extent];

    /// The name on the command line and in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::ProjectedArea => "projected-area",
            Self::BoxArea => "box-area",
            Self::DilatedArea => "dilated-area",
            Self::AreaRatio => "area-ratio",
            Self::Extent => "extent",
        }
    }

    pub(crate) fn code(self) -> u32 {
        match self {
            Self::ProjectedArea => 0,
            Self::BoxArea => 1,
            Self::DilatedArea => 2,
            Self::AreaRatio => 3,
            Self::Extent => 4,
        }
    }

    /// The cutoff that means about the same as this many square voxels of projected area, for a well-shaped triangle.
    pub(crate) fn cutoff_for(self, area: f32) -> f32 {
        // A right triangle with equal legs: sides sqrt(2 area), box twice the area.
        let side = (2.0 * area).sqrt();
        match self {
            Self::ProjectedArea => area,
            Self::BoxArea => 2.0 * area,
            Self::DilatedArea => area + 2.0 * side + 1.0,
            Self::AreaRatio => area / (area + 2.0 * side + 1.0),
            Self::Extent => (side + 2.0).powi(2) * 2.0,
        }
    }
}

/// How triangles are enlarged so that the rasterizer misses no column: \[HCV\] figure 3.7.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Dilation {
    /// Hasselgren's first: the convex hull of a pixel-sized square at each corner, as a fan.
    HasselgrenHull,
    /// Hasselgren's second: each edge moved out by half a pixel's reach, one triangle.
    #[default]
    HasselgrenTriangle,
    /// Hertel's: each edge moved out by half a pixel's diagonal.
    Hertel,
}

impl Dilation {
    /// Every dilation.
    pub const ALL: [Self; 3] = [Self::HasselgrenHull, Self::HasselgrenTriangle, Self::Hertel];

    /// The name on the command line and in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::HasselgrenHull => "hasselgren-hull",
            Self::HasselgrenTriangle => "hasselgren-triangle",
            Self::Hertel => "hertel",
        }
    }

    pub(crate) fn code(self) -> u32 {
        match self {
            Self::HasselgrenHull => 0,
            Self::HasselgrenTriangle => 1,
            Self::Hertel => 2,
        }
    }

    /// Vertices that the vertex stage makes of one triangle.
    pub(crate) fn vertices(self) -> u32 {
        match self {
            Self::HasselgrenHull => 15,
            Self::HasselgrenTriangle | Self::Hertel => 3,
        }
    }
}

/// From which size on a triangle is large, and goes to the rasterizer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cutoff {
    /// What the size is.
    pub heuristic: Heuristic,
    /// Triangles of this size and above are large; 0 makes all of them large, infinity none.
    pub value: f32,
}

impl Cutoff {
    /// The default for a kind of adapter.
    ///
    /// Software adapters: measured on lavapipe, see docs/gpu.md. Real GPUs: the 2 to 4 square voxels of \[HCV\] 3.3.
    #[must_use]
    pub fn default_for(adapter: &AdapterInfo, heuristic: Heuristic) -> Self {
        let area = if adapter.software { 64.0 } else { 4.0 };
        Self { heuristic, value: heuristic.cutoff_for(area) }
    }
}
