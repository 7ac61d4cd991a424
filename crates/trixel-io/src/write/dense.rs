//! One byte a voxel in C order `a[x, y, z]`: the data of `.npz`, `.npy` and `.raw`.

use std::io::{self, Write};

use rayon::prelude::*;
use trixel::Volume;

use super::WriteOptions;
use super::deflate::{BLOCK_BYTES, Fill};
use super::npy_header::npy_header;
use crate::bits::expand;

/// A volume cut into blocks of whole columns of about [`BLOCK_BYTES`] bytes.
#[derive(Clone, Copy)]
pub(super) struct DenseBlocks<'a> {
    volume: &'a Volume,
    columns: usize,
}

impl<'a> DenseBlocks<'a> {
    pub(super) fn new(volume: &'a Volume) -> Self {
        let columns = (BLOCK_BYTES / volume.grid().dims()[2] as usize).max(1);
        Self { volume, columns }
    }

    pub(super) fn count(self) -> usize {
        let words = self.columns * self.volume.column_words();
        self.volume.words().len().div_ceil(words)
    }

    /// Appends block `index`, bytes 0 and 1.
    pub(super) fn fill(self, index: usize, out: &mut Vec<u8>) {
        let column_words = self.volume.column_words();
        let nz = self.volume.grid().dims()[2];
        let words = self.volume.words().chunks(self.columns * column_words).nth(index).unwrap_or_default();
        out.reserve(words.len() / column_words * nz as usize);
        for column in words.chunks(column_words) {
            expand(column, nz, out);
        }
    }
}

/// Writes `.npy`: a boolean array without a place for the grid.
pub(super) fn write_npy(volume: &Volume, options: &WriteOptions<'_>, out: &mut impl Write) -> io::Result<()> {
    out.write_all(&npy_header("|b1", &volume.grid().dims().map(u64::from)))?;
    write_raw(volume, options, out)
}

/// Writes the bytes alone.
pub(super) fn write_raw(volume: &Volume, options: &WriteOptions<'_>, out: &mut impl Write) -> io::Result<()> {
    let blocks = DenseBlocks::new(volume);
    write_blocks(blocks.count(), &|index, out: &mut Vec<u8>| blocks.fill(index, out), options, out)
}

/// Writes blocks in order, which `fill` makes on several threads, a bounded number at a time.
pub(super) fn write_blocks(
    count: usize,
    fill: &Fill<'_>,
    options: &WriteOptions<'_>,
    out: &mut impl Write,
) -> io::Result<()> {
    let mut buffers = vec![Vec::new(); rayon::current_num_threads() * 2];
    for start in (0..count).step_by(buffers.len()) {
        let used = buffers.len().min(count - start);
        buffers[..used].par_iter_mut().enumerate().for_each(|(i, buffer)| {
            buffer.clear();
            fill(start + i, buffer);
        });
        for buffer in &buffers[..used] {
            out.write_all(buffer)?;
        }
        options.report((start + used) as u64, count as u64);
    }
    Ok(())
}
