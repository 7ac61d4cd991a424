//! The exposed faces as binary STL: triangles in mesh coordinates.
//!
//! STL holds `f32` only, so coordinates round; a grid so far from the origin that voxels would collapse is refused.

use std::io::{BufWriter, Write};

use trixel::{Grid, Volume};

use super::surface::{coordinates, rectangles};
use super::{Failure, WriteOptions};
use crate::numbers::narrow;

/// The format has single precision.
pub(super) fn check(grid: &Grid) -> Result<(), String> {
    let distinct = |axis: Vec<f64>| {
        let axis: Vec<f32> = axis.into_iter().map(narrow).collect();
        axis.iter().all(|value| value.is_finite()) && axis.is_sorted_by(|a, b| a < b)
    };
    if coordinates(grid).into_iter().all(distinct) {
        return Ok(());
    }
    Err(".stl holds coordinates in single precision, which cannot tell the sides of these voxels apart; \
         move the mesh nearer to the origin, or write .obj or .ply, which hold double precision"
        .to_owned())
}

/// Writes the surface of `volume`, whose grid [`check`] has passed.
pub(super) fn write(volume: &Volume, options: &WriteOptions<'_>, out: &mut impl Write) -> Result<(), Failure> {
    let rectangles = rectangles(volume, options);
    let triangles = rectangles.len() as u64 * 2;
    let Ok(triangles) = u32::try_from(triangles) else {
        return Err(Failure::Limit(format!(
            "the surface has {triangles} triangles, and .stl counts them with 32 bits; choose a lower resolution"
        )));
    };
    let coordinates = coordinates(volume.grid()).map(|axis| axis.into_iter().map(narrow).collect::<Vec<_>>());
    let mut out = BufWriter::new(out);
    // Must not begin with "solid", which marks the ASCII variant.
    let mut header = [0; 80];
    let text = b"binary STL: exposed faces of voxels";
    header[..text.len()].copy_from_slice(text);
    out.write_all(&header)?;
    out.write_all(&triangles.to_le_bytes())?;
    for rectangle in &rectangles {
        let mut normal = [0.0f32; 3];
        normal[rectangle.axis] = if rectangle.positive { 1.0 } else { -1.0 };
        let [a, b, c, d] = rectangle.corners().map(|corner| {
            let [x, y, z] = corner.map(|at| at as usize);
            [coordinates[0][x], coordinates[1][y], coordinates[2][z]]
        });
        for [p, q, r] in [[a, b, c], [a, c, d]] {
            let mut record = [0; 50];
            let values = [normal, p, q, r];
            for (bytes, value) in record.chunks_mut(4).zip(values.as_flattened()) {
                bytes.copy_from_slice(&value.to_le_bytes());
            }
            out.write_all(&record)?;
        }
    }
    Ok(out.flush()?)
}
