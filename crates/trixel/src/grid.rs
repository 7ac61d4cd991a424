//! Voxel grids: where the voxels are.

use crate::lattice::{self, STEPS_PER_VOXEL};
use crate::mesh::Bounds;

/// A regular grid of voxels.
///
/// Voxel `[i, j, k]` is the closed box `origin + [i..i+1, j..j+1, k..k+1] * voxel_size`; its centre is at `+ 0.5`.
/// Axes are always `x, y, z`; units are the mesh's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    origin: [f64; 3],
    voxel_size: [f64; 3],
    dims: [u32; 3],
}

/// What is wrong with a grid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GridError {
    /// A dimension is zero or too large.
    #[error("a grid of {} x {} x {} voxels is out of range: each axis takes 1 to {max}", dims[0], dims[1], dims[2], max = Grid::MAX_DIM)]
    Dims {
        /// The dimensions asked for.
        dims: [u64; 3],
    },
    /// A voxel size is not a positive finite number.
    #[error("voxel size {:?} x {:?} x {:?} must be positive, finite and not denormal", voxel_size[0], voxel_size[1], voxel_size[2])]
    VoxelSize {
        /// The size asked for.
        voxel_size: [f64; 3],
    },
    /// The origin, or the far corner, is not finite.
    #[error("grid origin ({:?}, {:?}, {:?}) must be finite, and so must the far corner", origin[0], origin[1], origin[2])]
    Origin {
        /// The origin asked for.
        origin: [f64; 3],
    },
    /// A grid was to be fitted to a box so large or small that f64 cannot express the voxels.
    #[error(
        "the mesh is {extent:?} long, which f64 cannot divide into {resolution} voxels; \
         scale the mesh, or remove stray vertices"
    )]
    Extent {
        /// The longest side.
        extent: f64,
        /// The resolution asked for.
        resolution: u32,
    },
    /// A grid was to be fitted to a box without extent.
    #[error("the mesh is a single point, so a resolution does not define a voxel size: give a voxel size instead")]
    NoExtent,
}

impl Grid {
    /// The most voxels along one axis.
    pub const MAX_DIM: u32 = 32_768;

    /// A grid from its parts.
    ///
    /// # Errors
    /// When a dimension is 0 or above [`Grid::MAX_DIM`], a size is not positive and finite, or a corner is not finite.
    ///
    /// ```
    /// let grid = trixel::Grid::new([0.0; 3], [0.5; 3], [4, 5, 6])?;
    /// assert_eq!(grid.center([0, 0, 1]), [0.25, 0.25, 0.75]);
    /// # Ok::<(), trixel::GridError>(())
    /// ```
    pub fn new(origin: [f64; 3], voxel_size: [f64; 3], dims: [u32; 3]) -> Result<Self, GridError> {
        if dims.iter().any(|&d| d == 0 || d > Self::MAX_DIM) {
            return Err(GridError::Dims { dims: dims.map(u64::from) });
        }
        if voxel_size.iter().any(|&h| !h.is_normal() || h < 0.0) {
            return Err(GridError::VoxelSize { voxel_size });
        }
        let grid = Self { origin, voxel_size, dims };
        if grid.origin.iter().chain(&grid.bounds().max).any(|c| !c.is_finite()) {
            return Err(GridError::Origin { origin });
        }
        Ok(grid)
    }

    /// Unit voxels at the origin; `dims` are in range.
    pub(crate) fn of_units(dims: [u32; 3]) -> Self {
        Self { origin: [0.0; 3], voxel_size: [1.0; 3], dims }
    }

    /// Cubic voxels fitted to `bounds`: exactly `resolution` along the longest side, and along the other sides the
    /// fewest that cover the box (as snapped to the lattice, so an equal side gets an equal count).
    ///
    /// # Errors
    /// When the resolution is out of range or the box has no extent.
    pub fn fit(bounds: &Bounds, resolution: u32) -> Result<Self, GridError> {
        let size = bounds.size();
        let longest = size.iter().copied().fold(0.0, f64::max);
        if longest == 0.0 {
            return Err(GridError::NoExtent);
        }
        if resolution == 0 || resolution > Self::MAX_DIM {
            return Err(GridError::Dims { dims: [u64::from(resolution); 3] });
        }
        let voxel_size = [longest / f64::from(resolution); 3];
        if !voxel_size[0].is_normal() {
            return Err(GridError::Extent { extent: longest, resolution });
        }
        let mut grid = Self::cover(bounds, voxel_size)?;
        for axis in 0..3 {
            // `longest / (longest / n)` may round to either side of n.
            if size[axis] == longest {
                grid.dims[axis] = resolution;
            }
        }
        Ok(grid)
    }

    /// Voxels of the given size, as few as cover `bounds`, with the origin at the box's minimum corner.
    ///
    /// # Errors
    /// When the sizes are not positive and finite or an axis would need too many voxels.
    pub fn cover(bounds: &Bounds, voxel_size: [f64; 3]) -> Result<Self, GridError> {
        if voxel_size.iter().any(|&h| !h.is_normal() || h < 0.0) {
            return Err(GridError::VoxelSize { voxel_size });
        }
        let mut dims = [0; 3];
        let mut wanted = [0; 3];
        for axis in 0..3 {
            let steps = lattice::snap_coordinate(bounds.max[axis], bounds.min[axis], voxel_size[axis]);
            // `as` saturates, so an absurd extent is refused below with a huge number.
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates; checked below")]
            let voxels = (steps / f64::from(STEPS_PER_VOXEL)).ceil().max(1.0) as u64;
            wanted[axis] = voxels;
            dims[axis] = u32::try_from(voxels).unwrap_or(u32::MAX);
        }
        if dims.iter().any(|&d| d > Self::MAX_DIM) {
            return Err(GridError::Dims { dims: wanted });
        }
        Self::new(bounds.min, voxel_size, dims)
    }

    /// The minimum corner.
    #[must_use]
    pub fn origin(&self) -> [f64; 3] {
        self.origin
    }

    /// The edge lengths of a voxel.
    #[must_use]
    pub fn voxel_size(&self) -> [f64; 3] {
        self.voxel_size
    }

    /// The number of voxels along each axis.
    #[must_use]
    pub fn dims(&self) -> [u32; 3] {
        self.dims
    }

    /// The number of voxels in all.
    #[must_use]
    pub fn voxel_count(&self) -> u64 {
        self.dims.iter().map(|&d| u64::from(d)).product()
    }

    /// Whether a voxel has the same edge length along every axis.
    #[must_use]
    pub fn is_cubic(&self) -> bool {
        self.voxel_size[0] == self.voxel_size[1] && self.voxel_size[1] == self.voxel_size[2]
    }

    /// The centre of voxel `[i, j, k]`.
    #[must_use]
    pub fn center(&self, voxel: [u32; 3]) -> [f64; 3] {
        std::array::from_fn(|i| self.origin[i] + (f64::from(voxel[i]) + 0.5) * self.voxel_size[i])
    }

    /// The box that the grid fills.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        let max = std::array::from_fn(|i| self.origin[i] + f64::from(self.dims[i]) * self.voxel_size[i]);
        Bounds { min: self.origin, max }
    }
}
