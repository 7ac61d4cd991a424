//! The exposed faces as binary glTF 2.0 (`.glb`).
//!
//! Positions are `f32` and count from the grid's origin, so that a grid far away loses nothing. The node's matrix moves
//! them to mesh coordinates and turns the mesh's up axis to y, which glTF prescribes. There are no normals: a viewer
//! must then shade flat (glTF 2.0, section 3.7.2.1), which is right for voxels and lets vertices be shared. The node's
//! `extras` hold the grid.

use std::io::{BufWriter, Write};

use serde_json::{Value, json};
use trixel::{Grid, UpAxis, Volume};

use super::surface::IndexedSurface;
use super::{Failure, WriteOptions};
use crate::numbers::narrow;
use crate::read::color;

const UNSIGNED_INT: u32 = 5125;
const UNSIGNED_SHORT: u32 = 5123;
const FLOAT: u32 = 5126;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// Linear base colour of the voxels: a plain light grey.
const BASE_COLOR: [f32; 4] = [0.6, 0.6, 0.6, 1.0];

/// The format has single precision.
pub(super) fn check(grid: &Grid) -> Result<(), String> {
    let largest = grid.bounds().size().into_iter().chain(grid.origin().map(f64::abs)).fold(0.0, f64::max);
    let smallest = grid.voxel_size().into_iter().fold(f64::INFINITY, f64::min);
    if largest > f64::from(f32::MAX) || smallest < f64::from(f32::MIN_POSITIVE) {
        return Err(format!(
            ".glb holds single precision, and this grid's sizes go from {smallest:e} to {largest:e}; \
             scale the mesh, or write .obj or .ply"
        ));
    }
    Ok(())
}

/// Writes the surface of `volume`, whose grid [`check`] has passed.
pub(super) fn write(volume: &Volume, options: &WriteOptions<'_>, out: &mut impl Write) -> Result<(), Failure> {
    let surface = IndexedSurface::new(volume, options)?;
    let grid = volume.grid();
    let size = grid.voxel_size();
    let coordinates: [Vec<f32>; 3] =
        std::array::from_fn(|axis| (0..=grid.dims()[axis]).map(|i| narrow(f64::from(i) * size[axis])).collect());
    let position = |vertex: &[u32; 3]| -> [f32; 3] { std::array::from_fn(|i| coordinates[i][vertex[i] as usize]) };
    let position_bytes = surface.vertices.len() as u64 * 12;
    let index_bytes = surface.quads.len() as u64 * 24;
    let color_bytes = surface.colors.as_ref().map_or(0, |colors| colors.len() as u64 * 8);
    let binary_bytes = position_bytes + index_bytes + color_bytes;
    let mut document = json!({
        "asset": { "version": "2.0", "generator": concat!("trixel ", env!("CARGO_PKG_VERSION")) },
        "scene": 0,
        "scenes": [{ "name": "voxels" }],
    });
    // Empty lists are not allowed in glTF: without faces the scene stays empty.
    if !surface.quads.is_empty() {
        let mut low = [f32::INFINITY; 3];
        let mut high = [f32::NEG_INFINITY; 3];
        for vertex in &surface.vertices {
            let position = position(vertex);
            low = std::array::from_fn(|i| low[i].min(position[i]));
            high = std::array::from_fn(|i| high[i].max(position[i]));
        }
        document["scenes"][0]["nodes"] = json!([0]);
        document["nodes"] = json!([{
            "name": "voxels",
            "mesh": 0,
            "matrix": matrix(grid, options.up),
            "extras": { "origin": grid.origin(), "voxel_size": size, "dims": grid.dims() },
        }]);
        document["meshes"] = json!([{
            "name": "voxels",
            "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1, "material": 0 }],
        }]);
        document["materials"] = json!([{
            "name": "voxels",
            "pbrMetallicRoughness": { "baseColorFactor": BASE_COLOR, "metallicFactor": 0.0, "roughnessFactor": 1.0 },
        }]);
        document["accessors"] = json!([
            {
                "bufferView": 0, "componentType": FLOAT, "type": "VEC3",
                "count": surface.vertices.len(), "min": low, "max": high,
            },
            {
                "bufferView": 1, "componentType": UNSIGNED_INT, "type": "SCALAR",
                "count": surface.quads.len() as u64 * 6,
            },
        ]);
        document["bufferViews"] = json!([
            { "buffer": 0, "byteOffset": 0, "byteLength": position_bytes, "target": ARRAY_BUFFER },
            { "buffer": 0, "byteOffset": position_bytes, "byteLength": index_bytes, "target": ELEMENT_ARRAY_BUFFER },
        ]);
        document["buffers"] = json!([{ "byteLength": binary_bytes }]);
        if surface.colors.is_some() {
            add_colors(&mut document, surface.vertices.len(), position_bytes + index_bytes, color_bytes);
        }
    }
    let mut out = BufWriter::new(out);
    write_headers(&document, binary_bytes, &mut out)?;
    for vertex in &surface.vertices {
        for value in position(vertex) {
            out.write_all(&value.to_le_bytes())?;
        }
    }
    options.report(5, 6);
    for [a, b, c, d] in &surface.quads {
        for index in [a, b, c, a, c, d] {
            out.write_all(&index.to_le_bytes())?;
        }
    }
    for color in surface.colors.iter().flatten() {
        for value in linear16(*color) {
            out.write_all(&value.to_le_bytes())?;
        }
    }
    Ok(out.flush()?)
}

/// Declares linear colours of 16 bits (glTF 2.0, section 3.7.2.1) behind positions and indices.
fn add_colors(document: &mut Value, count: usize, offset: u64, bytes: u64) {
    document["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(2);
    document["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = json!([1.0, 1.0, 1.0, 1.0]);
    if let Some(accessors) = document["accessors"].as_array_mut() {
        accessors.push(json!({
            "bufferView": 2, "componentType": UNSIGNED_SHORT, "normalized": true, "type": "VEC4", "count": count,
        }));
    }
    if let Some(views) = document["bufferViews"].as_array_mut() {
        views.push(json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes, "target": ARRAY_BUFFER }));
    }
}

/// The linear colour of an sRGB one; alpha is linear already.
fn linear16([r, g, b, a]: [u8; 4]) -> [u16; 4] {
    let linear = |byte: u8| {
        let [value, ..] = color::linear([f32::from(byte) / 255.0; 4]);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 65535")]
        let value = (value * 65535.0).round() as u16;
        value
    };
    [linear(r), linear(g), linear(b), u16::from(a) * 257]
}

/// Writes the file header, the JSON chunk and the head of the binary chunk of `binary_bytes` (a multiple of 4).
fn write_headers(document: &Value, binary_bytes: u64, out: &mut impl Write) -> Result<(), Failure> {
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let binary_chunk = if binary_bytes == 0 { 0 } else { 8 + binary_bytes };
    let total = 12 + 8 + text.len() as u64 + binary_chunk;
    let Ok(total) = u32::try_from(total) else {
        return Err(Failure::Limit(format!(
            ".glb files end at 4 GiB, and this surface takes {total} bytes; choose a lower resolution, or .ply"
        )));
    };
    out.write_all(b"glTF")?;
    out.write_all(&2u32.to_le_bytes())?;
    out.write_all(&total.to_le_bytes())?;
    // Parts of `total`, which fits.
    let chunk_length = |bytes: u64| u32::try_from(bytes).unwrap_or(u32::MAX).to_le_bytes();
    out.write_all(&chunk_length(text.len() as u64))?;
    out.write_all(b"JSON")?;
    out.write_all(&text)?;
    if binary_bytes > 0 {
        out.write_all(&chunk_length(binary_bytes))?;
        out.write_all(b"BIN\0")?;
    }
    Ok(())
}

/// The column-major matrix that moves positions by the grid's origin, then turns `up` to y.
fn matrix(grid: &Grid, up: UpAxis) -> [f64; 16] {
    // The images of x, y and z.
    let turned: [[f64; 3]; 3] = match up {
        UpAxis::X => [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
        UpAxis::Y => [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        UpAxis::Z => [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]],
    };
    let mut matrix = [0.0; 16];
    for (column, image) in turned.iter().enumerate() {
        matrix[column * 4..column * 4 + 3].copy_from_slice(image);
    }
    for row in 0..3 {
        // Adding 0 turns -0 into 0.
        matrix[12 + row] = (0..3).map(|axis| turned[axis][row] * grid.origin()[axis]).sum::<f64>() + 0.0;
    }
    matrix[15] = 1.0;
    matrix
}
