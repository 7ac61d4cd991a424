//! Where triangles come from: a mesh in memory, or a file that is read in passes.

use trixel::lattice::{self, LatticeMesh, LatticePositions};
use trixel::{Bounds, BrickMap, Grid, Mesh};

use super::OutOfCoreError;
use crate::read::MeshStream;

/// The triangles to voxelize.
#[derive(Clone, Copy, Debug)]
pub enum Source<'a> {
    /// All in memory.
    Mesh(&'a Mesh),
    /// Read again for every part of the grid.
    Stream(&'a MeshStream),
}

/// Triangles of each layer of pillars.
#[derive(Clone, Debug, Default)]
pub(super) struct LayerCounts {
    /// Triangles whose lowest, and whose highest, layer it is.
    lowest: Vec<u64>,
    highest: Vec<u64>,
    /// Estimated voxels of the surface.
    pub(super) voxels: f64,
    /// Whether a coordinate needs more than 32 bits.
    pub(super) wide: bool,
}

impl LayerCounts {
    fn new(layers: u32) -> Self {
        let zeros = vec![0; layers as usize];
        Self { lowest: zeros.clone(), highest: zeros, voxels: 0.0, wide: false }
    }

    fn add(&mut self, grid: &Grid, triangle: &[[i64; 3]; 3]) {
        let layers = BrickMap::layers_of(grid, triangle);
        if layers.is_empty() {
            return;
        }
        self.lowest[layers.start as usize] += 1;
        self.highest[layers.end as usize - 1] += 1;
        self.voxels += 1.5 + 1.5 * area_in_voxels(triangle);
        self.wide |= triangle.as_flattened().iter().any(|&c| i32::try_from(c).is_err());
    }

    fn merge(&mut self, other: &Self) {
        let add = |to: &mut Vec<u64>, from: &[u64]| to.iter_mut().zip(from).for_each(|(to, from)| *to += from);
        add(&mut self.lowest, &other.lowest);
        add(&mut self.highest, &other.highest);
        self.voxels += other.voxels;
        self.wide |= other.wide;
    }

    /// The triangles that meet some of the layers.
    pub(super) fn within(&self, layers: &std::ops::Range<u32>) -> u64 {
        let started: u64 = self.lowest[..layers.end as usize].iter().sum();
        let ended: u64 = self.highest[..layers.start as usize].iter().sum();
        started - ended
    }
}

/// The area of the largest of a triangle's projections, in voxel faces: about its conservative voxels.
#[expect(clippy::cast_precision_loss, reason = "an estimate")]
fn area_in_voxels([a, b, c]: &[[i64; 3]; 3]) -> f64 {
    let edge = |to: &[i64; 3]| [to[0] - a[0], to[1] - a[1], to[2] - a[2]].map(|c| c as f64 / 65536.0);
    let (e, f) = (edge(b), edge(c));
    let cross = |i: usize, j: usize| (e[i] * f[j] - e[j] * f[i]).abs();
    0.5 * cross(0, 1).max(cross(1, 2)).max(cross(2, 0))
}

/// The first triangle that is too far away, or not finite, as an error.
fn snap_triangle(index: u64, corners: &[[f64; 3]; 3], grid: &Grid) -> Result<[[i64; 3]; 3], OutOfCoreError> {
    let corner = |k: usize| {
        lattice::snap(corners[k], grid).ok_or(OutOfCoreError::Position { triangle: index, position: corners[k] })
    };
    Ok([corner(0)?, corner(1)?, corner(2)?])
}

impl Source<'_> {
    /// The number of triangles.
    #[must_use]
    pub fn triangle_count(&self) -> u64 {
        match self {
            Self::Mesh(mesh) => mesh.triangles.len() as u64,
            Self::Stream(stream) => stream.triangle_count(),
        }
    }

    /// The box around every triangle, or `None` when there is none.
    ///
    /// # Errors
    /// When the file cannot be read, or a coordinate is not finite.
    pub fn bounds(&self) -> Result<Option<Bounds>, OutOfCoreError> {
        let stream = match self {
            Self::Mesh(mesh) => return Ok(mesh.bounds()),
            Self::Stream(stream) => stream,
        };
        let empty = Bounds { min: [f64::INFINITY; 3], max: [f64::NEG_INFINITY; 3] };
        let grow = |bounds: &mut Bounds, other: Bounds| {
            for axis in 0..3 {
                bounds.min[axis] = bounds.min[axis].min(other.min[axis]);
                bounds.max[axis] = bounds.max[axis].max(other.max[axis]);
            }
        };
        let of_block = |first: u64, triangles: &[[[f64; 3]; 3]]| {
            let mut bounds = empty;
            for (triangle, corners) in (first..).zip(triangles) {
                for &position in corners {
                    if !position.iter().all(|c| c.is_finite()) {
                        return Err(OutOfCoreError::Position { triangle, position });
                    }
                    grow(&mut bounds, Bounds { min: position, max: position });
                }
            }
            Ok(bounds)
        };
        let mut all = Ok(empty);
        stream.for_each(of_block, |block| match (&mut all, block) {
            (Ok(all), Ok(block)) => grow(all, block),
            (Ok(_), Err(error)) => all = Err(error),
            (Err(_), _) => {}
        })?;
        Ok((stream.triangle_count() > 0).then_some(all?))
    }

    /// Counts the triangles of each layer.
    pub(super) fn count_layers(&self, grid: &Grid) -> Result<LayerCounts, OutOfCoreError> {
        let [layers, _] = BrickMap::pillars_of(grid);
        let mut all = LayerCounts::new(layers);
        match self {
            Self::Mesh(mesh) => {
                let lattice = LatticeMesh::snap(mesh, grid).map_err(trixel::Error::from)?;
                (0..mesh.triangles.len()).for_each(|i| all.add(grid, &lattice.corners(i)));
                all.wide = matches!(lattice.positions, LatticePositions::Wide(_));
            }
            Self::Stream(stream) => {
                let of_block = |first: u64, triangles: &[[[f64; 3]; 3]]| {
                    let mut counts = LayerCounts::new(layers);
                    for (index, corners) in (first..).zip(triangles) {
                        counts.add(grid, &snap_triangle(index, corners, grid)?);
                    }
                    Ok(counts)
                };
                let mut failed = None;
                stream.for_each(of_block, |block| match block {
                    Ok(counts) => all.merge(&counts),
                    Err(error) => failed = failed.take().or(Some(error)),
                })?;
                if let Some(error) = failed {
                    return Err(error);
                }
            }
        }
        Ok(all)
    }
}

/// Triangles of some layers, each with corners of its own.
pub(super) struct Soup {
    positions: LatticePositions,
    triangles: Vec<[u32; 3]>,
}

impl Soup {
    /// Bytes of a triangle.
    pub(super) fn bytes_per_triangle(wide: bool) -> u64 {
        if wide { 72 + 12 } else { 36 + 12 }
    }

    /// Reads the triangles of `layers`, `count` in number.
    pub(super) fn read(
        stream: &MeshStream,
        grid: &Grid,
        layers: &std::ops::Range<u32>,
        count: u64,
        wide: bool,
    ) -> Result<Self, OutOfCoreError> {
        let Some(vertices) = u32::try_from(count).ok().and_then(|count| count.checked_mul(3)) else {
            return Err(OutOfCoreError::Layer { triangles: count, bytes: u64::MAX });
        };
        let of_block = |first: u64, triangles: &[[[f64; 3]; 3]]| {
            let mut found = Vec::new();
            for (index, corners) in (first..).zip(triangles) {
                let triangle = snap_triangle(index, corners, grid)?;
                let met = BrickMap::layers_of(grid, &triangle);
                if met.start < layers.end && met.end > layers.start {
                    found.push(triangle);
                }
            }
            Ok(found)
        };
        let capacity = vertices as usize;
        let mut positions = if wide {
            LatticePositions::Wide(Vec::with_capacity(capacity))
        } else {
            LatticePositions::Narrow(Vec::with_capacity(capacity))
        };
        let mut failed = None;
        stream.for_each(of_block, |block| match (block, &mut positions) {
            (Ok(found), LatticePositions::Wide(positions)) => positions.extend_from_slice(found.as_flattened()),
            (Ok(found), LatticePositions::Narrow(positions)) => {
                #[expect(clippy::cast_possible_truncation, reason = "the counting pass found all to fit")]
                positions.extend(found.as_flattened().iter().map(|corner| corner.map(|c| c as i32)));
            }
            (Err(error), _) => failed = failed.take().or(Some(error)),
        })?;
        if let Some(error) = failed {
            return Err(error);
        }
        if positions.len() != capacity {
            return Err(OutOfCoreError::Changed);
        }
        let triangles = (0..vertices / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        Ok(Self { positions, triangles })
    }

    /// The mesh, for as long as the soup lives.
    pub(super) fn into_lattice(self, triangles: &mut Vec<[u32; 3]>) -> LatticeMesh<'_> {
        *triangles = self.triangles;
        LatticeMesh { positions: self.positions, triangles }
    }
}
