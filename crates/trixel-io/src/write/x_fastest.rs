//! One byte a voxel with x fastest, then y, then z: the order of `.vti` and `.nrrd`, the transpose of the volume's own.
//!
//! 64 layers along z, one word of every column, are transposed at a time as bits; bytes exist only inside blocks.

use std::io;

use rayon::prelude::*;
use trixel::Volume;

use super::deflate::Fill;
use crate::bits::{WORD, expand, transpose, words_for};

/// Rows along x that blocks of about `bytes` take.
pub(super) fn rows_per_block(volume: &Volume, bytes: usize) -> usize {
    (bytes / volume.grid().dims()[0] as usize).max(1)
}

/// Cuts the volume into blocks of `block_rows` rows along x (the last one may have fewer) and hands them to `emit` in
/// batches, each as a count and a function that fills.
pub(super) fn for_each_batch(
    volume: &Volume,
    block_rows: usize,
    mut emit: impl FnMut(usize, &Fill<'_>) -> io::Result<()>,
) -> io::Result<()> {
    let [nx, ny, nz] = volume.grid().dims();
    let (row_bytes, ny_rows) = (nx as usize, ny as usize);
    let row_words = words_for(nx);
    // Rows of the slabs before that did not fill a block, as bytes.
    let mut carry: Vec<u8> = Vec::new();
    // Flat grids have fewer layers than a word has bits.
    let depth = WORD.min(nz as usize);
    let mut slab = vec![0; ny_rows * depth * row_words];
    for word in 0..volume.column_words() {
        transpose_slab(volume, word, depth, &mut slab);
        // Row `r` of this slab is layer r / ny, line r % ny; the slab holds a line's layers together.
        let expand_rows = |rows: std::ops::Range<usize>, out: &mut Vec<u8>| {
            for row in rows {
                let start = (row % ny_rows * depth + row / ny_rows) * row_words;
                expand(&slab[start..start + row_words], nx, out);
            }
        };
        let layers = (nz as usize - word * WORD).min(WORD);
        let (carried, rows) = (carry.len() / row_bytes, layers * ny_rows);
        let last = word + 1 == volume.column_words();
        let blocks = if last { (carried + rows).div_ceil(block_rows) } else { (carried + rows) / block_rows };
        let fill = |block: usize, out: &mut Vec<u8>| {
            let (start, end) = (block * block_rows, ((block + 1) * block_rows).min(carried + rows));
            out.reserve((end - start) * row_bytes);
            if start < carried {
                out.extend(&carry[start * row_bytes..end.min(carried) * row_bytes]);
            }
            expand_rows(start.saturating_sub(carried)..end.saturating_sub(carried), out);
        };
        if blocks > 0 {
            emit(blocks, &fill)?;
        }
        if !last {
            let used = blocks * block_rows;
            let mut rest = carry.get(used * row_bytes..).unwrap_or_default().to_vec();
            expand_rows(used.saturating_sub(carried)..rows, &mut rest);
            carry = rest;
        }
    }
    Ok(())
}

/// Turns word `word` of every column into rows along x of its first `depth` layers: `slab[y][z][..]`.
fn transpose_slab(volume: &Volume, word: usize, depth: usize, slab: &mut [u64]) {
    let [nx, ny, _] = volume.grid().dims();
    let row_words = words_for(nx);
    let column_words = volume.column_words();
    let words = volume.words();
    slab.par_chunks_mut(depth * row_words).enumerate().for_each(|(y, rows)| {
        for (group, first) in (0..nx as usize).step_by(WORD).enumerate() {
            let mut square = [0; WORD];
            for (x, row) in (first..nx as usize).zip(&mut square) {
                *row = words[(x * ny as usize + y) * column_words + word];
            }
            transpose(&mut square);
            for (z, row) in square.into_iter().enumerate().take(depth) {
                rows[z * row_words + group] = row;
            }
        }
    });
}
