//! The exposed faces as binary little-endian PLY: quadrilaterals with shared vertices, in mesh coordinates (`double`);
//! colours on the vertices where there are any.

use std::io::{BufWriter, Write};

use trixel::Volume;

use super::surface::{IndexedSurface, coordinates};
use super::{Failure, WriteOptions};
use crate::numbers::spaced;

/// sRGB colours, as programs take them.
const COLOR_PROPERTIES: &str = "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar alpha\n";

/// Writes the surface of `volume`; comments hold the grid.
pub(super) fn write(volume: &Volume, options: &WriteOptions<'_>, out: &mut impl Write) -> Result<(), Failure> {
    let surface = IndexedSurface::new(volume, options)?;
    let grid = volume.grid();
    let ([nx, ny, nz], origin, size) = (grid.dims(), spaced(grid.origin()), spaced(grid.voxel_size()));
    let mut out = BufWriter::new(out);
    write!(
        out,
        "ply\n\
         format binary_little_endian 1.0\n\
         comment exposed faces of voxels\n\
         comment dims {nx} {ny} {nz}\n\
         comment origin {origin}\n\
         comment voxel_size {size}\n\
         element vertex {}\n\
         property double x\n\
         property double y\n\
         property double z\n\
         {}\
         element face {}\n\
         property list uchar uint vertex_indices\n\
         end_header\n",
        surface.vertices.len(),
        if surface.colors.is_some() { COLOR_PROPERTIES } else { "" },
        surface.quads.len(),
    )?;
    let coordinates = coordinates(grid);
    let colors = surface.colors.as_deref().unwrap_or_default();
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
