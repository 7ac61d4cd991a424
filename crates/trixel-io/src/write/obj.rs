//! The exposed faces as Wavefront OBJ: quadrilaterals with shared vertices, in mesh coordinates.
//!
//! Colours follow the coordinates of a vertex (`v x y z r g b`, sRGB from 0 to 1), as several programs read them.
//! Coordinates are printed so that reading them as `f64` gives them back to the last bit.

use std::io::{BufWriter, Write};

use trixel::Volume;

use super::surface::{IndexedSurface, coordinates};
use super::{Failure, WriteOptions};
use crate::numbers::spaced;

/// Writes the surface of `volume`; comments hold the grid.
pub(super) fn write(volume: &Volume, options: &WriteOptions<'_>, out: &mut impl Write) -> Result<(), Failure> {
    let surface = IndexedSurface::new(volume, options)?;
    let grid = volume.grid();
    let ([nx, ny, nz], origin, size) = (grid.dims(), spaced(grid.origin()), spaced(grid.voxel_size()));
    // Small writes are cheaper into a buffer whose type is known here.
    let mut out = BufWriter::new(out);
    writeln!(out, "# exposed faces of voxels\n# dims {nx} {ny} {nz}\n# origin {origin}")?;
    writeln!(out, "# voxel_size {size}")?;
    // A coordinate is one of a few: print each once.
    let texts = coordinates(grid).map(|axis| axis.iter().map(|value| format!("{value:?}")).collect::<Vec<_>>());
    let colors = surface.colors.as_deref().unwrap_or_default();
    for (index, [x, y, z]) in surface.vertices.iter().enumerate() {
        write!(out, "v {} {} {}", texts[0][*x as usize], texts[1][*y as usize], texts[2][*z as usize])?;
        if let Some([r, g, b, _]) = colors.get(index).map(|color| color.map(|c| f32::from(c) / 255.0)) {
            write!(out, " {r:.4} {g:.4} {b:.4}")?;
        }
        writeln!(out)?;
    }
    options.report(5, 6);
    for quad in &surface.quads {
        let [a, b, c, d] = quad.map(|index| u64::from(index) + 1);
        writeln!(out, "f {a} {b} {c} {d}")?;
    }
    Ok(out.flush()?)
}
