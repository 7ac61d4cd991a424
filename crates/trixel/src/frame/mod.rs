//! Oriented boxes of voxels: aligned to a camera or a light, orthographic or perspective.
//!
//! \[CL\] sections 3.1 and 3.2 voxelize in the space of a light or a camera, so that the slices lie across its rays. Here a
//! [`Frame`] is a projective map from the world to voxel space. It is applied to a mesh's positions in f64, before the snap;
//! what follows is the exact voxelization of [`crate::Mode`] in a plain [`Grid`] of unit voxels. Such a map keeps lines
//! straight and planes flat, so triangles stay triangles.

mod clip;
mod framed_mesh;

pub use framed_mesh::FramedMesh;

use glam::{DMat4, DVec3, DVec4};

use crate::grid::{Grid, GridError};
use crate::mesh::Bounds;

/// A box of voxels anywhere in space: the map from the world to voxel space, and how many voxels there are.
///
/// Voxel `[i, j, k]` is the part of the world that the map takes to `[i..i+1, j..j+1, k..k+1]`. Slices lie along z, which
/// points away from the camera or the light.
///
/// ```
/// use trixel::{Bounds, Frame};
/// // A light from above: its rays enter at slice 0.
/// let bounds = Bounds { min: [0.0; 3], max: [4.0, 2.0, 1.0] };
/// let frame = Frame::aligned([0.0, 0.0, -1.0], [0.0, 1.0, 0.0], &bounds, 8)?;
/// assert_eq!(frame.dims(), [8, 4, 2]);
/// assert_eq!(frame.to_voxels([0.0, 2.0, 1.0]), [0.0, 0.0, 0.0]);
/// assert_eq!(frame.to_world([0.0, 0.0, 2.0]), [0.0, 2.0, 0.0]);
/// # Ok::<(), trixel::FrameError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    dims: [u32; 3],
    to_voxels: DMat4,
    to_world: DMat4,
}

/// What is wrong with a frame.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// A number of voxels is out of range.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The map cannot be turned around.
    #[error(
        "the frame's matrix is not finite or has no inverse; check that its axes are not parallel and its sides not empty"
    )]
    Singular,
    /// A view without a direction.
    #[error("the view needs a direction and an up vector that are finite, not zero and not parallel")]
    View,
    /// A perspective box that does not begin before it ends.
    #[error("a perspective frame needs 0 < near < far and positive tangents, not {near} to {far} and {tangents:?}")]
    Frustum {
        /// Where the slices begin.
        near: f64,
        /// Where they end.
        far: f64,
        /// Half the width and half the height at distance 1.
        tangents: [f64; 2],
    },
}

/// x to the right, y down, z forward, as the pixels of a picture go.
struct Axes {
    x: DVec3,
    y: DVec3,
    z: DVec3,
}

impl Axes {
    fn looking(forward: DVec3, up: DVec3) -> Result<Self, FrameError> {
        let z = forward.try_normalize().ok_or(FrameError::View)?;
        let up = up.try_normalize().ok_or(FrameError::View)?;
        let x = z.cross(up);
        if x.length() < 1e-9 {
            return Err(FrameError::View);
        }
        let x = x.normalize();
        Ok(Self { x, y: z.cross(x), z })
    }

    fn components(&self, v: DVec3) -> DVec3 {
        DVec3::new(self.x.dot(v), self.y.dot(v), self.z.dot(v))
    }
}

fn corners(bounds: &Bounds) -> impl Iterator<Item = DVec3> + '_ {
    (0..8).map(|corner| {
        let side = |axis: usize| if corner >> axis & 1 == 1 { bounds.max[axis] } else { bounds.min[axis] };
        DVec3::new(side(0), side(1), side(2))
    })
}

/// The fewest voxels that cover `length`, but for rounding.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates, and is checked with the frame")]
fn voxels_along(length: f64, size: f64) -> u32 {
    (length / size - 1e-9).ceil().max(1.0) as u32
}

impl Frame {
    /// A frame by its map from the world to voxel space, in homogeneous coordinates: four columns, as in WGSL and glTF.
    /// Where the map is perspective, what lies in front must have a positive fourth coordinate.
    ///
    /// # Errors
    /// When the map is not finite or has no inverse, or a dimension is out of [`Grid`]'s range.
    pub fn new(to_voxels: [[f64; 4]; 4], dims: [u32; 3]) -> Result<Self, FrameError> {
        Self::from_matrix(DMat4::from_cols_array_2d(&to_voxels), dims)
    }

    fn from_matrix(to_voxels: DMat4, dims: [u32; 3]) -> Result<Self, FrameError> {
        Grid::new([0.0; 3], [1.0; 3], dims)?;
        // Neither of the two alone notices every matrix of huge or tiny numbers.
        let to_world = to_voxels.try_inverse().ok_or(FrameError::Singular)?;
        if !to_voxels.is_finite() || !to_world.is_finite() {
            return Err(FrameError::Singular);
        }
        Ok(Self { dims, to_voxels, to_world })
    }

    /// The voxels of a grid.
    ///
    /// # Errors
    /// When the grid's sizes are so extreme that f64 cannot turn the map around.
    pub fn of_grid(grid: &Grid) -> Result<Self, FrameError> {
        let edges = grid.voxel_size();
        let axes = std::array::from_fn(|axis| std::array::from_fn(|i| if i == axis { edges[axis] } else { 0.0 }));
        Self::oriented(grid.origin(), axes, grid.dims())
    }

    /// A box with a corner at `origin` and voxels with the edges `axes`, in world units; these need not be orthogonal.
    ///
    /// # Errors
    /// When the edges lie in one plane or are not finite, or a dimension is out of range.
    pub fn oriented(origin: [f64; 3], axes: [[f64; 3]; 3], dims: [u32; 3]) -> Result<Self, FrameError> {
        let [x, y, z] = axes.map(|axis| DVec3::from_array(axis).extend(0.0));
        let to_world = DMat4::from_cols(x, y, z, DVec3::from_array(origin).extend(1.0));
        Self::from_matrix(to_world.try_inverse().ok_or(FrameError::Singular)?, dims)
    }

    /// The box around `bounds` whose slices a parallel light or an orthographic camera passes in the order of z: cubic
    /// voxels, `resolution` of them along the longest side. x points to the right and y down, seen along `direction`.
    ///
    /// # Errors
    /// When the direction and `up` do not make a view, the bounds have no extent, or the resolution is out of range.
    pub fn aligned(direction: [f64; 3], up: [f64; 3], bounds: &Bounds, resolution: u32) -> Result<Self, FrameError> {
        let axes = Axes::looking(direction.into(), up.into())?;
        let mut low = DVec3::INFINITY;
        let mut high = DVec3::NEG_INFINITY;
        for corner in corners(bounds) {
            low = low.min(axes.components(corner));
            high = high.max(axes.components(corner));
        }
        let size = high - low;
        let edge = size.max_element() / f64::from(resolution);
        let dims = size.to_array().map(|length| voxels_along(length, edge));
        let origin = axes.x * low.x + axes.y * low.y + axes.z * low.z;
        let [x, y, z] = [axes.x, axes.y, axes.z].map(|axis| (axis * edge).to_array());
        Self::oriented(origin.to_array(), [x, y, z], dims)
    }

    /// The pyramid that a camera at `eye` sees towards `target`: x to the right, y down, z away from it. `tangents` are half
    /// the width and half the height at distance 1. Slices reach from distance `near` to `far` along the axis; they are
    /// equal in 1 / distance, as a depth buffer is, because only so triangles stay flat: the first are thinner than the
    /// last by (near / far)^2.
    ///
    /// # Errors
    /// When the vectors do not make a view, not 0 < near < far, or a dimension is out of range.
    pub fn perspective(
        eye: [f64; 3],
        target: [f64; 3],
        up: [f64; 3],
        tangents: [f64; 2],
        [near, far]: [f64; 2],
        dims: [u32; 3],
    ) -> Result<Self, FrameError> {
        if !(near > 0.0 && near < far && far.is_finite() && tangents.iter().all(|t| *t > 0.0 && t.is_finite())) {
            return Err(FrameError::Frustum { near, far, tangents });
        }
        let eye = DVec3::from_array(eye);
        let axes = Axes::looking(DVec3::from_array(target) - eye, up.into())?;
        let plane = |normal: DVec3, offset: f64| normal.extend(offset - normal.dot(eye));
        let half = dims.map(|n| f64::from(n) / 2.0);
        let distance = plane(axes.z, 0.0);
        let depth = f64::from(dims[2]) * far / (far - near);
        let rows = [
            plane(axes.x, 0.0) * (half[0] / tangents[0]) + distance * half[0],
            plane(axes.y, 0.0) * (half[1] / tangents[1]) + distance * half[1],
            (distance - DVec4::W * near) * depth,
            distance,
        ];
        Self::from_matrix(DMat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose(), dims)
    }

    /// The pyramid from `eye` around `bounds`: `resolution` voxels across the wider side, the other in proportion, and so
    /// many slices that voxels half-way are about as deep as wide.
    ///
    /// # Errors
    /// When the eye is at the bounds' centre or `up` points along the view, or the resolution is out of range.
    pub fn perspective_around(
        eye: [f64; 3],
        up: [f64; 3],
        bounds: &Bounds,
        resolution: u32,
    ) -> Result<Self, FrameError> {
        let at = DVec3::from_array(eye);
        let target = (DVec3::from_array(bounds.min) + DVec3::from_array(bounds.max)) / 2.0;
        let axes = Axes::looking(target - at, up.into())?;
        let seen: Vec<DVec3> = corners(bounds).map(|corner| axes.components(corner - at)).collect();
        let far = seen.iter().map(|corner| corner.z).fold(0.0, f64::max);
        // An eye inside the bounds sees all around; this much of the space before it is left out.
        let near = seen.iter().map(|corner| corner.z).fold(f64::INFINITY, f64::min).max(far * 1e-3);
        let tangent = |side: fn(&DVec3) -> f64| {
            let widest = seen.iter().map(|corner| side(corner).abs() / corner.z.max(near)).fold(0.0, f64::max);
            widest.max(1e-6)
        };
        let tangents = [tangent(|v| v.x), tangent(|v| v.y)];
        let widest = tangents[0].max(tangents[1]);
        let edge = widest / f64::from(resolution.max(1));
        let middle = (near + far) / 2.0;
        let dims = [
            voxels_along(tangents[0], edge),
            voxels_along(tangents[1], edge),
            voxels_along(far - near, 2.0 * edge * middle).min(2048),
        ];
        Self::perspective(eye, target.to_array(), up, tangents, [near, far], dims)
    }

    /// Voxels along x, y and z.
    #[must_use]
    pub fn dims(&self) -> [u32; 3] {
        self.dims
    }

    /// The grid of unit voxels at the origin that voxelization sees.
    #[must_use]
    pub fn grid(&self) -> Grid {
        // The dimensions were checked, and the rest is constant.
        Grid::of_units(self.dims)
    }

    /// Where a point of the world lies in voxel space; behind a perspective camera that means nothing.
    #[must_use]
    pub fn to_voxels(&self, world: [f64; 3]) -> [f64; 3] {
        self.to_voxels.project_point3(world.into()).to_array()
    }

    /// Where a point of voxel space lies in the world.
    #[must_use]
    pub fn to_world(&self, voxel: [f64; 3]) -> [f64; 3] {
        self.to_world.project_point3(voxel.into()).to_array()
    }

    /// The map from the world to voxel space: four columns.
    #[must_use]
    pub fn matrix(&self) -> [[f64; 4]; 4] {
        self.to_voxels.to_cols_array_2d()
    }

    /// The map from voxel space to the world: four columns.
    #[must_use]
    pub fn inverse(&self) -> [[f64; 4]; 4] {
        self.to_world.to_cols_array_2d()
    }

    /// Whether lines along z meet in an eye, so that voxels differ in size.
    #[must_use]
    pub fn is_perspective(&self) -> bool {
        let row = self.to_voxels.row(3);
        row.truncate() != DVec3::ZERO
    }

    /// How long the line along z through the centre of column `[x, y]` is inside slice `z`, in world units: \[CL\] figure
    /// 3's thickness / cos θ, for any frame.
    #[must_use]
    pub fn thickness(&self, [x, y, z]: [u32; 3]) -> f64 {
        let at = |z: f64| DVec3::from_array(self.to_world([f64::from(x) + 0.5, f64::from(y) + 0.5, z]));
        at(f64::from(z)).distance(at(f64::from(z) + 1.0))
    }
}

#[cfg(test)]
mod tests;
