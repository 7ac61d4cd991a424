//! binvox, version 1: <https://www.patrickmin.com/binvox/binvox.html>.
//!
//! The format knows cubes only: `translate` is the minimum corner and `scale` the edge of the cube, so that the centre of
//! voxel i is `(i + 0.5) / dim * scale + translate`. A grid that is not a cube is padded with unset voxels at the high
//! ends. Voxels are ordered x, then z, then y fastest, and stored as pairs of a value and a count up to 255.

use std::io::{self, Write};

use rayon::prelude::*;
use trixel::{Grid, Volume};

use super::WriteOptions;
use crate::bits::{WORD, transpose, words_for};
use crate::numbers::spaced;

/// The format has one voxel size.
pub(super) fn check(grid: &Grid) -> Result<(), String> {
    let [hx, hy, hz] = grid.voxel_size();
    if grid.is_cubic() {
        return Ok(());
    }
    Err(format!(
        ".binvox holds cubic voxels only, and these measure {hx} x {hy} x {hz}; \
         choose one voxel size, or another format such as .npz, .vti or .nrrd"
    ))
}

/// Writes the volume, which [`check`] has passed.
pub(super) fn write(volume: &Volume, options: &WriteOptions<'_>, out: &mut impl Write) -> io::Result<()> {
    let grid = volume.grid();
    let [nx, ny, nz] = grid.dims();
    let side = nx.max(ny).max(nz);
    let translate = spaced(grid.origin());
    let scale = grid.voxel_size()[0] * f64::from(side);
    write!(out, "#binvox 1\ndim {side} {side} {side}\ntranslate {translate}\nscale {scale:?}\ndata\n")?;
    let mut runs = RunWriter { out, value: false, length: 0 };
    let batch = u32::try_from(rayon::current_num_threads() * 8).unwrap_or(8);
    for start in (0..nx).step_by(batch as usize) {
        let end = nx.min(start + batch);
        let planes: Vec<Vec<u64>> = (start..end).into_par_iter().map(|x| plane_runs(volume, x, side)).collect();
        for plane in planes {
            let mut value = false;
            for length in plane {
                runs.push(value, length)?;
                value = !value;
            }
        }
        options.report(u64::from(end), u64::from(nx));
    }
    runs.push(false, u64::from(side - nx) * u64::from(side) * u64::from(side))?;
    runs.finish()
}

/// The lengths of the alternating runs of plane `x`, the first one unset.
fn plane_runs(volume: &Volume, x: u32, side: u32) -> Vec<u64> {
    let [_, ny, nz] = volume.grid().dims();
    let row_words = words_for(ny);
    let mut rows = vec![0; WORD * row_words];
    let mut runs = Runs { lengths: vec![0], value: false };
    for word in 0..volume.column_words() {
        for (group, first) in (0..ny).step_by(WORD).enumerate() {
            let mut square = [0; WORD];
            for (y, row) in (first..ny).zip(&mut square) {
                *row = volume.column(x, y)[word];
            }
            transpose(&mut square);
            for (z, row) in square.into_iter().enumerate() {
                rows[z * row_words + group] = row;
            }
        }
        let layers = (nz as usize - word * WORD).min(WORD);
        for row in rows.chunks(row_words).take(layers) {
            runs.push_bits(row, ny);
            runs.push(false, u64::from(side - ny));
        }
    }
    runs.push(false, u64::from(side - nz) * u64::from(side));
    runs.lengths
}

/// Alternating runs in the making.
struct Runs {
    lengths: Vec<u64>,
    value: bool,
}

impl Runs {
    fn push(&mut self, value: bool, length: u64) {
        if length == 0 {
            return;
        }
        if value != self.value {
            self.lengths.push(0);
            self.value = value;
        }
        if let Some(last) = self.lengths.last_mut() {
            *last += length;
        }
    }

    fn push_bits(&mut self, words: &[u64], bits: u32) {
        let mut left = bits;
        for &word in words {
            let mut rest = word;
            let mut bits = left.min(u64::BITS);
            left -= bits;
            while bits > 0 {
                let value = rest & 1 == 1;
                let length = if value { rest.trailing_ones() } else { rest.trailing_zeros() }.min(bits);
                self.push(value, u64::from(length));
                rest = rest.checked_shr(length).unwrap_or(0);
                bits -= length;
            }
        }
    }
}

/// Joins runs and writes them as pairs.
struct RunWriter<'a, W> {
    out: &'a mut W,
    value: bool,
    length: u64,
}

impl<W: Write> RunWriter<'_, W> {
    fn push(&mut self, value: bool, length: u64) -> io::Result<()> {
        if value != self.value && length > 0 {
            self.flush()?;
            self.value = value;
        }
        self.length += length;
        Ok(())
    }

    fn flush(&mut self) -> io::Result<()> {
        let value = u8::from(self.value);
        for _ in 0..self.length / 255 {
            self.out.write_all(&[value, 255])?;
        }
        if let Ok(rest @ 1..) = u8::try_from(self.length % 255) {
            self.out.write_all(&[value, rest])?;
        }
        self.length = 0;
        Ok(())
    }

    fn finish(mut self) -> io::Result<()> {
        self.flush()
    }
}
