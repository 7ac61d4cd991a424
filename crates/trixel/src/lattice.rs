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

/// A position on the lattice of `grid`, as [`LatticeMesh::snap`] places it; `None` if it is not finite or more than
/// [`MAX_COORDINATE`] from the grid's origin.
#[must_use]
pub fn snap(position: [f64; 3], grid: &Grid) -> Option<[i64; 3]> {
    #[expect(clippy::cast_precision_loss, reason = "a power of two")]
    const LIMIT: f64 = MAX_COORDINATE as f64;
    let (origin, voxel_size) = (grid.origin(), grid.voxel_size());
    let snapped: [f64; 3] = std::array::from_fn(|axis| snap_coordinate(position[axis], origin[axis], voxel_size[axis]));
    #[expect(clippy::cast_possible_truncation, reason = "in range, or rejected")]
    snapped.iter().all(|q| q.abs() <= LIMIT).then(|| snapped.map(|q| q as i64))
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

/// Why a mesh cannot be put on a grid's lattice.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LatticeError {
    /// The mesh itself is broken.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A vertex is too far from the grid for exact arithmetic.
    #[error(
        "vertex {vertex} at ({}, {}, {}) is more than 16,777,216 voxels away from the grid's origin; \
         use larger voxels, or remove the stray vertex",
        position[0], position[1], position[2]
    )]
    TooFar {
        /// Index of the vertex.
        vertex: usize,
        /// Its position in the mesh's units.
        position: [f64; 3],
    },
}

impl LatticePositions {
    /// The number of vertices.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::Narrow(positions) => positions.len(),
            Self::Wide(positions) => positions.len(),
        }
    }

    /// Whether there is no vertex.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The position of one vertex.
    ///
    /// # Panics
    /// When the index is out of range.
    #[must_use]
    pub fn get(&self, vertex: u32) -> [i64; 3] {
        match self {
            Self::Narrow(positions) => positions[vertex as usize].map(i64::from),
            Self::Wide(positions) => positions[vertex as usize],
        }
    }
}

impl<'a> LatticeMesh<'a> {
    /// Snaps a mesh to the lattice of `grid`: `round_ties_even((v - origin) / voxel_size * S)`.
    ///
    /// Vertices that no triangle uses may be anywhere, even not finite.
    ///
    /// # Errors
    /// When a triangle names a vertex that does not exist, or uses one that is not finite or lies more than
    /// [`MAX_COORDINATE`] from the grid's origin.
    pub fn snap(mesh: &'a Mesh, grid: &Grid) -> Result<Self, LatticeError> {
        check_indices(mesh)?;
        let positions = match snap_narrow(&mesh.positions, grid) {
            Some(narrow) => LatticePositions::Narrow(narrow),
            None => LatticePositions::Wide(snap_wide(mesh, grid)?),
        };
        Ok(Self { positions, triangles: &mesh.triangles })
    }

    /// The corners of triangle `triangle`.
    ///
    /// # Panics
    /// When the index is out of range.
    #[must_use]
    pub fn corners(&self, triangle: usize) -> [[i64; 3]; 3] {
        self.triangles[triangle].map(|vertex| self.positions.get(vertex))
    }
}

fn check_indices(mesh: &Mesh) -> Result<(), MeshError> {
    let vertices = mesh.positions.len();
    // The maximum vectorizes; the search for the culprit runs only when there is one.
    let largest = mesh.triangles.as_flattened().iter().copied().max();
    if largest.is_none_or(|largest| (largest as usize) < vertices) {
        return Ok(());
    }
    mesh.check()
}

/// Snaps all vertices to 32 bits, or `None` if one does not fit or is not finite.
fn snap_narrow(positions: &[[f64; 3]], grid: &Grid) -> Option<Vec<[i32; 3]>> {
    const LIMIT: f64 = i32::MAX as f64;
    let (origin, voxel_size) = (grid.origin(), grid.voxel_size());
    let mut snapped = vec![[0i32; 3]; positions.len()];
    let snap_chunk = |(to, from): (&mut [[i32; 3]], &[[f64; 3]])| {
        let mut fits = true;
        for (to, from) in to.iter_mut().zip(from) {
            for axis in 0..3 {
                let q = snap_coordinate(from[axis], origin[axis], voxel_size[axis]);
                fits &= q.abs() <= LIMIT;
                #[expect(clippy::cast_possible_truncation, reason = "an integer in range, or rejected by `fits`")]
                {
                    to[axis] = q as i32;
                }
            }
        }
        fits
    };
    const CHUNK: usize = 1 << 14;
    #[cfg(feature = "threads")]
    let fits = {
        use rayon::prelude::*;
        snapped.par_chunks_mut(CHUNK).zip(positions.par_chunks(CHUNK)).map(snap_chunk).reduce(|| true, |a, b| a && b)
    };
    #[cfg(not(feature = "threads"))]
    let fits = snapped.chunks_mut(CHUNK).zip(positions.chunks(CHUNK)).all(snap_chunk);
    fits.then_some(snapped)
}

fn snap_wide(mesh: &Mesh, grid: &Grid) -> Result<Vec<[i64; 3]>, LatticeError> {
    #[expect(clippy::cast_precision_loss, reason = "a power of two")]
    const LIMIT: f64 = MAX_COORDINATE as f64;
    let (origin, voxel_size) = (grid.origin(), grid.voxel_size());
    let snap = |position: &[f64; 3]| -> [f64; 3] {
        std::array::from_fn(|axis| snap_coordinate(position[axis], origin[axis], voxel_size[axis]))
    };
    for &vertex in mesh.triangles.as_flattened() {
        let vertex = vertex as usize;
        let position = mesh.positions[vertex];
        if snap(&position).iter().all(|q| q.abs() <= LIMIT) {
            continue;
        }
        if position.iter().all(|c| c.is_finite()) {
            return Err(LatticeError::TooFar { vertex, position });
        }
        return Err(MeshError::NotFinite { vertex, position }.into());
    }
    #[expect(clippy::cast_possible_truncation, reason = "in range, or of a vertex that no triangle uses (saturates)")]
    Ok(mesh.positions.iter().map(|position| snap(position).map(|q| q as i64)).collect())
}
