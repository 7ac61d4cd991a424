//! Binary little-endian PLY in mesh coordinates (`double`): the exposed faces as quadrilaterals with shared vertices, or
//! the centres of the set voxels as points.

use std::io::{BufWriter, Write};

use trixel::{Grid, Occupancy, Volume};

use super::dense::write_blocks;
use super::sparse_blocks::SparseBlocks;
use super::surface::{IndexedSurface, coordinates};
use super::{Failure, WriteOptions};
use crate::numbers::spaced;

/// Writes the surface of `volume`; comments hold the grid.
pub(super) fn write(volume: &Volume, options: &WriteOptions<'_>, out: &mut impl Write) -> Result<(), Failure> {
    let surface = IndexedSurface::new(volume, options)?;
    let mut out = BufWriter::new(out);
    let faces = format!("element face {}\nproperty list uchar uint vertex_indices\n", surface.quads.len());
    write_header("exposed faces of voxels", volume.grid(), surface.vertices.len() as u64, &faces, &mut out)?;
    let coordinates = coordinates(volume.grid());
    for vertex in &surface.vertices {
        for (axis, &at) in coordinates.iter().zip(vertex) {
            out.write_all(&axis[at as usize].to_le_bytes())?;
        }
    }
    options.report(5, 6);
    for quad in &surface.quads {
        let mut record = [4; 17];
        for (bytes, index) in record[1..].chunks_mut(4).zip(quad) {
            bytes.copy_from_slice(&index.to_le_bytes());
        }
        out.write_all(&record)?;
    }
    Ok(out.flush()?)
}

/// Writes the centres of the set voxels, sorted by x, y, z; comments hold the grid.
pub(super) fn write_points(
    voxels: &impl Occupancy,
    options: &WriteOptions<'_>,
    out: &mut impl Write,
) -> std::io::Result<()> {
    let blocks = SparseBlocks::new(voxels);
    let grid = voxels.grid();
    write_header("centres of voxels", grid, blocks.voxel_count(), "", out)?;
    let fill = |index, out: &mut Vec<u8>| {
        blocks.for_each(index, |voxel| out.extend_from_slice(grid.center(voxel).map(f64::to_le_bytes).as_flattened()));
    };
    write_blocks(blocks.count(), &fill, options, out)
}

fn write_header(what: &str, grid: &Grid, vertices: u64, faces: &str, out: &mut impl Write) -> std::io::Result<()> {
    let ([nx, ny, nz], origin, size) = (grid.dims(), spaced(grid.origin()), spaced(grid.voxel_size()));
    write!(
        out,
        "ply\n\
         format binary_little_endian 1.0\n\
         comment {what}\n\
         comment dims {nx} {ny} {nz}\n\
         comment origin {origin}\n\
         comment voxel_size {size}\n\
         element vertex {vertices}\n\
         property double x\n\
         property double y\n\
         property double z\n\
         {faces}end_header\n",
    )
}
