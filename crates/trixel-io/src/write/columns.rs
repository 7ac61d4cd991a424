//! Attributes as arrays of an `.npz` file.
//!
//! Sparse, an attribute has one row for each row of `indices`. Dense, its array has the grid's dimensions before its own;
//! voxels that are not set have zeros, and 2^32 - 1 for ids. Where every triangle of a voxel keeps a row
//! ([`Combine::All`](trixel::attributes::Combine)), attributes are rows either way, and `offsets` (u64, N + 1) tells where
//! those of each set voxel begin, in the order of x, y, z. Beside `material`, `material_names` says what the numbers mean.

use std::io::{self, Seek, Write};

use trixel::attributes::{AttributeKind, Described, Values};
use trixel::set_bits;

use super::NpzWriter;
use super::deflate::BLOCK_BYTES;

/// Adds every attribute to an archive.
pub(super) fn write<W: Write + Seek>(
    described: &Described<'_>,
    sparse: bool,
    npz: &mut NpzWriter<W>,
) -> io::Result<()> {
    let attributes = described.attributes();
    if let Some(offsets) = attributes.offsets() {
        let per_chunk = BLOCK_BYTES / 8;
        let fill = |chunk: usize, out: &mut Vec<u8>| {
            let offsets = offsets.chunks(per_chunk).nth(chunk).unwrap_or_default();
            out.extend(offsets.iter().flat_map(|offset| offset.to_le_bytes()));
        };
        npz.array("offsets", "<u8", &[offsets.len() as u64], offsets.len().div_ceil(per_chunk), &fill, &mut |_| {})?;
    }
    for (kind, values) in attributes.columns() {
        if sparse || attributes.offsets().is_some() {
            rows(kind.name(), values, npz)?;
        } else {
            dense(kind.name(), values, described, npz)?;
        }
    }
    if attributes.get(AttributeKind::Material).is_some() {
        names("material_names", attributes.material_names(), npz)?;
    }
    Ok(())
}

/// Texts of at most this many characters; of longer ones the beginning. NumPy gives all the room of the longest.
const MOST_CHARACTERS: usize = 256;

fn names<W: Write + Seek>(name: &str, names: &[String], npz: &mut NpzWriter<W>) -> io::Result<()> {
    let width = names.iter().map(|name| name.chars().count().min(MOST_CHARACTERS)).max().unwrap_or(0).max(1);
    let fill = |index: usize, out: &mut Vec<u8>| {
        let characters = names[index].chars().take(width).map(u32::from).chain(std::iter::repeat(0));
        out.extend(characters.take(width).flat_map(u32::to_le_bytes));
    };
    npz.array(name, &format!("<U{width}"), &[names.len() as u64], names.len(), &fill, &mut |_| {})
}

/// The shape of an array whose last axis is the attribute's own, if it has more than one number.
fn shape(mut before: Vec<u64>, channels: u64) -> Vec<u64> {
    if channels > 1 {
        before.push(channels);
    }
    before
}

fn rows<W: Write + Seek>(name: &str, values: &Values, npz: &mut NpzWriter<W>) -> io::Result<()> {
    let (dtype, channels) = values.layout();
    let per_chunk = BLOCK_BYTES / values.row_bytes();
    let fill = |chunk: usize, out: &mut Vec<u8>| {
        for row in chunk * per_chunk..values.len().min((chunk + 1) * per_chunk) {
            values.append_row(row, out);
        }
    };
    let shape = shape(vec![values.len() as u64], channels);
    npz.array(name, dtype, &shape, values.len().div_ceil(per_chunk), &fill, &mut |_| {})
}

fn dense<W: Write + Seek>(
    name: &str,
    values: &Values,
    described: &Described<'_>,
    npz: &mut NpzWriter<W>,
) -> io::Result<()> {
    let (dtype, channels) = values.layout();
    let volume = described.rank().volume();
    let [nx, ny, nz] = volume.grid().dims();
    let (columns, column_bytes) = (nx as usize * ny as usize, nz as usize * values.row_bytes());
    let per_chunk = (BLOCK_BYTES / column_bytes).max(1);
    let fill = |chunk: usize, out: &mut Vec<u8>| {
        out.reserve(per_chunk * column_bytes);
        for column in chunk * per_chunk..columns.min((chunk + 1) * per_chunk) {
            // Both are below 2^15.
            let [x, y] = [column / ny as usize, column % ny as usize].map(|i| u32::try_from(i).unwrap_or(u32::MAX));
            let first = usize::try_from(described.rank().before_column(x, y)).unwrap_or(usize::MAX);
            let mut next = 0;
            for (row, z) in (first..).zip(set_bits(volume.column(x, y))) {
                (next..z).for_each(|_| values.append_nothing(out));
                values.append_row(row, out);
                next = z + 1;
            }
            (next..nz).for_each(|_| values.append_nothing(out));
        }
    };
    let shape = shape([nx, ny, nz].map(u64::from).to_vec(), channels);
    npz.array(name, dtype, &shape, columns.div_ceil(per_chunk), &fill, &mut |_| {})
}
