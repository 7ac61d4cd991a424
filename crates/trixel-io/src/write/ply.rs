//! Binary little-endian PLY in mesh coordinates (`double`): the exposed faces as quadrilaterals with shared vertices, or
//! the centres of the set voxels as points; with colours where there are any.

use std::io::{BufWriter, Write};

use trixel::attributes::Described;
use trixel::{Grid, Occupancy, Volume};

use super::dense::write_blocks;
use super::sparse_blocks::SparseBlocks;
use super::surface::{IndexedSurface, coordinates};
use super::{Failure, WriteOptions};
use crate::numbers::spaced;

/// sRGB colours, as programs take them.
const COLOR_PROPERTIES: &str = "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar alpha\n";

/// Writes the surface of `volume`; comments hold the grid.
pub(super) fn write(volume: &Volume, options: &WriteOptions<'_>, out: &mut impl Write) -> Result<(), Failure> {
    let surface = IndexedSurface::new(volume, options)?;
    let mut out = BufWriter::new(out);
    let colors = surface.colors.as_deref();
    let faces = format!("element face {}\nproperty list uchar uint vertex_indices\n", surface.quads.len());
    let header = Header { what: "exposed faces of voxels", vertices: surface.vertices.len() as u64, faces: &faces };
    header.write(volume.grid(), colors.is_some(), &mut out)?;
    let coordinates = coordinates(volume.grid());
    let colors = colors.unwrap_or_default();
    for (index, vertex) in surface.vertices.iter().enumerate() {
        for (axis, &at) in coordinates.iter().zip(vertex) {
            out.write_all(&axis[at as usize].to_le_bytes())?;
        }
        if let Some(color) = colors.get(index) {
            out.write_all(color)?;
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
    let colors = options.described.filter(Described::has_colors);
    let header = Header { what: "centres of voxels", vertices: blocks.voxel_count(), faces: "" };
    header.write(grid, colors.is_some(), out)?;
    let fill = |index, out: &mut Vec<u8>| {
        blocks.for_each(index, |voxel| {
            out.extend_from_slice(grid.center(voxel).map(f64::to_le_bytes).as_flattened());
            if let Some(colors) = &colors {
                out.extend_from_slice(&colors.color(voxel).unwrap_or([u8::MAX; 4]));
            }
        });
    };
    write_blocks(blocks.count(), &fill, options, out)
}

struct Header<'a> {
    what: &'a str,
    vertices: u64,
    faces: &'a str,
}

impl Header<'_> {
    fn write(&self, grid: &Grid, colored: bool, out: &mut impl Write) -> std::io::Result<()> {
        let Self { what, vertices, faces } = self;
        let ([nx, ny, nz], origin, size) = (grid.dims(), spaced(grid.origin()), spaced(grid.voxel_size()));
        let colors = if colored { COLOR_PROPERTIES } else { "" };
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
         {colors}{faces}end_header\n",
        )
    }
}
