//! binvox: <https://www.patrickmin.com/binvox/binvox.html>. Version 2, whose values may be any byte, is read alike.
//!
//! The padding that made the grid a cube cannot be told from unset voxels, so it stays. The voxel size is
//! `scale / dim`, which may differ from the one written in the last bit.

use std::io::{BufRead, Read};

use trixel::{Grid, Volume};

use super::{Failure, Input, LoadedGrid, LoadedVolume, check_backing, to_dims};
use crate::bits::{WORD, transpose, words_for};

/// Five lines, and comments.
const MAX_HEADER: u64 = 1 << 12;
/// A pair of bytes is a run of at most 255 voxels.
const VOXELS_PER_PAIR: u64 = 255;

fn read_header(input: &mut Input<'_>) -> Result<Grid, Failure> {
    let damaged = |what: String| Failure::damaged("header", what);
    let mut reader = (&mut input.reader).take(MAX_HEADER);
    let mut next_line = || -> Result<String, Failure> {
        let mut line = Vec::new();
        reader.read_until(b'\n', &mut line)?;
        if line.last() != Some(&b'\n') {
            return Err(damaged("it ends before a line \"data\"; the file was cut short or is not binvox".to_owned()));
        }
        Ok(String::from_utf8_lossy(&line).trim().to_owned())
    };
    let magic = next_line()?;
    match magic.strip_prefix("#binvox").map(str::trim) {
        Some("1" | "2") => {}
        Some(version) => return Err(damaged(format!("version {version} of binvox is unknown"))),
        None => return Err(damaged("the first line is not #binvox".to_owned())),
    }
    let (mut dims, mut translate, mut scale) = (None, [0.0; 3], 1.0);
    loop {
        let line = next_line()?;
        let mut words = line.split_whitespace();
        let keyword = words.next().unwrap_or_default();
        let numbers: Option<Vec<f64>> = words.map(|word| word.parse().ok()).collect();
        match (keyword, numbers.as_deref()) {
            ("data", _) => break,
            (comment, _) if comment.starts_with('#') => {}
            ("dim", Some(&[x, z, y])) if x == y && y == z && x.fract() == 0.0 && x >= 1.0 => dims = Some(x),
            ("dim", Some(&[x, z, y])) => {
                return Err(damaged(format!("dim {x} {z} {y}: binvox files are cubes, and only those are read")));
            }
            ("translate", Some(&[x, y, z])) => translate = [x, y, z],
            ("scale", Some(&[value])) => scale = value,
            _ => return Err(damaged(format!("the line {line:?} is not understood"))),
        }
    }
    let side = dims.ok_or_else(|| damaged("there is no line \"dim\"".to_owned()))?;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at least 1, and `as` saturates")]
    let dims = to_dims([side as u64; 3])?;
    Ok(Grid::new(translate, [scale / side; 3], dims)?)
}

pub(super) fn grid(mut input: Input<'_>) -> Result<LoadedGrid, Failure> {
    Ok(LoadedGrid { grid: read_header(&mut input)?, warnings: Vec::new() })
}

pub(super) fn volume(mut input: Input<'_>, memory_limit: Option<u64>) -> Result<LoadedVolume, Failure> {
    let grid = read_header(&mut input)?;
    check_backing(input.bytes / 2, VOXELS_PER_PAIR, grid.voxel_count())?;
    let mut volume = Volume::with_memory_limit(grid, memory_limit)?;
    let side = grid.dims()[0] as usize;
    let mut runs = Runs { reader: input.reader, value: false, left: 0 };
    let row_words = words_for(grid.dims()[0]);
    let column_words = volume.column_words();
    // One plane x: rows of bits along y for every z, up to a multiple of 64.
    let mut plane = vec![0; column_words * WORD * row_words];
    for columns in volume.words_mut().chunks_mut(side * column_words) {
        plane.fill(0);
        let mut any = false;
        let mut at = 0;
        while at < side * side {
            let (value, length) = runs.take(side * side - at)?;
            if value {
                any = true;
                set_run(&mut plane, row_words, side, at, length);
            }
            at += length;
        }
        if any {
            turn_plane(&plane, row_words, columns, column_words);
        }
    }
    runs.finish()?;
    Ok(LoadedVolume { volume, warnings: Vec::new() })
}

/// The runs of the data, cut where planes end.
struct Runs<R> {
    reader: R,
    value: bool,
    left: usize,
}

impl<R: Read> Runs<R> {
    /// The next voxels of equal value, at least one and at most `most`.
    fn take(&mut self, most: usize) -> Result<(bool, usize), Failure> {
        while self.left == 0 {
            let mut pair = [0; 2];
            self.reader.read_exact(&mut pair)?;
            (self.value, self.left) = (pair[0] != 0, usize::from(pair[1]));
        }
        let length = self.left.min(most);
        self.left -= length;
        Ok((self.value, length))
    }

    fn finish(mut self) -> Result<(), Failure> {
        if self.left == 0 && self.reader.read(&mut [0])? == 0 {
            return Ok(());
        }
        Err(Failure::damaged("data", "there are more voxels than the header says; one of them is wrong"))
    }
}

/// Sets voxels `at..at + length` of a plane, y fastest.
fn set_run(plane: &mut [u64], row_words: usize, side: usize, at: usize, length: usize) {
    let (mut row, mut bit, mut left) = (at / side, at % side, length);
    while left > 0 {
        // What of the run lies in one word.
        let count = left.min(side - bit).min(WORD - bit % WORD);
        plane[row * row_words + bit / WORD] |= u64::MAX >> (WORD - count) << (bit % WORD);
        left -= count;
        bit += count;
        if bit == side {
            (row, bit) = (row + 1, 0);
        }
    }
}

/// Rows along y of every z become columns along z of every y.
fn turn_plane(plane: &[u64], row_words: usize, columns: &mut [u64], column_words: usize) {
    for word in 0..column_words {
        for group in 0..row_words {
            let mut square: [u64; WORD] = std::array::from_fn(|z| plane[(word * WORD + z) * row_words + group]);
            if square.iter().all(|&row| row == 0) {
                continue;
            }
            transpose(&mut square);
            for (column, &bits) in columns.chunks_mut(column_words).skip(group * WORD).zip(&square) {
                column[word] = bits;
            }
        }
    }
}
