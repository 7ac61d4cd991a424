//! The lattice: voxel space in integers.
//!
//! Vertices are snapped once, to [`STEPS_PER_VOXEL`] steps a voxel; everything after that is exact.

use crate::grid::Grid;
use crate::mesh::{Mesh, MeshError};

/// Bits of a lattice coordinate below one voxel.
pub const STEP_BITS: u32 = 16;

/// Lattice steps along the edge of a voxel.
pub const STEPS_PER_VOXEL: u32 = 1 << STEP_BITS;

/// The largest absolute lattice coordinate: 2^24 voxels from the grid's origin. Products of three such numbers, as the
/// exact tests need them, stay within 128 bits.
pub const MAX_COORDINATE: i64 = 1 << 40;

/// `round_ties_even((v - origin) / voxel_size * S)` of one coordinate, still as a float.
#[inline]
pub(crate) fn snap_coordinate(v: f64, origin: f64, voxel_size: f64) -> f64 {
    ((v - origin) / voxel_size * f64::from(STEPS_PER_VOXEL)).round_ties_even()
}

/// A mesh on the lattice of a grid.
#[derive(Clone, Debug)]
pub struct LatticeMesh<'a> {
    /// Snapped vertex positions.
    pub positions: LatticePositions,
    /// The mesh's triangles.
    pub triangles: &'a [[u32; 3]],
}

/// Snapped positions, in 32 bits where all of them fit.
#[derive(Clone, Debug)]
pub enum LatticePositions {
    /// Every coordinate is within `i32`.
    Narrow(Vec<[i32; 3]>),
    /// Some coordinate needs more; all are within [`MAX_COORDINATE`].
    Wide(Vec<[i64; 3]>),
}
