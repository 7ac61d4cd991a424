//! Streams of array elements, packed into a volume: an element that is not zero is a set voxel.

use std::io::{self, BufReader, Read};

use rayon::prelude::*;
use trixel::Volume;

use super::{BUFFER_BYTES, Failure};
use crate::bits::{WORD, pack, transpose, words_for};
use crate::read::shown;

/// How an element is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Element {
    /// Its size.
    pub(super) bytes: usize,
    /// For floating point, the byte that holds the sign, so that -0 counts as 0.
    pub(super) sign_byte: Option<usize>,
}

impl Element {
    pub(super) const BYTE: Self = Self { bytes: 1, sign_byte: None };

    fn is_set(self, bytes: &[u8]) -> bool {
        bytes.iter().enumerate().any(|(i, &byte)| if Some(i) == self.sign_byte { byte & 0x7f } else { byte } != 0)
    }
}

/// Rows of elements, read one by one as bits.
struct Rows<R: Read> {
    /// Rows are short, and decoders slow at handing out little.
    reader: BufReader<R>,
    element: Element,
    buffer: Vec<u8>,
    flags: Vec<u8>,
}

impl<R: Read> Rows<R> {
    fn new(reader: R, element: Element, length: u32) -> Self {
        let length = length as usize;
        // Elements of one byte need no flags of their own.
        let flags = if element == Element::BYTE { Vec::new() } else { vec![0; length] };
        let reader = BufReader::with_capacity(BUFFER_BYTES, reader);
        Self { reader, element, buffer: vec![0; length * element.bytes], flags }
    }

    fn read(&mut self, words: &mut [u64]) -> io::Result<()> {
        self.reader.read_exact(&mut self.buffer)?;
        if self.element == Element::BYTE {
            pack(&self.buffer, words);
        } else {
            for (flag, bytes) in self.flags.iter_mut().zip(self.buffer.chunks(self.element.bytes)) {
                *flag = u8::from(self.element.is_set(bytes));
            }
            pack(&self.flags, words);
        }
        Ok(())
    }

    /// Makes sure that the data ends here; this also lets decoders check their checksums.
    fn finish(mut self) -> Result<(), Failure> {
        if self.reader.read(&mut [0])? == 0 {
            return Ok(());
        }
        Err(Failure::damaged("data", "there is more data than the header says; one of them is wrong"))
    }
}

/// Reads elements in the order `a[x, y, z]`, z fastest.
pub(super) fn read_z_fastest(reader: impl Read, element: Element, volume: &mut Volume) -> Result<(), Failure> {
    let mut rows = Rows::new(reader, element, volume.grid().dims()[2]);
    let column_words = volume.column_words();
    for column in volume.words_mut().chunks_mut(column_words) {
        rows.read(column)?;
    }
    rows.finish()
}

/// Reads elements with x fastest, then y, then z.
pub(super) fn read_x_fastest(reader: impl Read, element: Element, volume: &mut Volume) -> Result<(), Failure> {
    let [nx, ny, nz] = volume.grid().dims().map(|n| n as usize);
    let column_words = volume.column_words();
    let row_words = words_for(volume.grid().dims()[0]);
    let mut rows = Rows::new(reader, element, volume.grid().dims()[0]);
    // 64 layers as bits, each line's together: `slab[y][z][..]`.
    // Flat grids have fewer.
    let depth = WORD.min(nz);
    let mut slab = vec![0; ny * depth * row_words];
    for word in 0..column_words {
        let layers = (nz - word * WORD).min(WORD);
        for z in 0..layers {
            for y in 0..ny {
                let start = (y * depth + z) * row_words;
                rows.read(&mut slab[start..start + row_words])?;
            }
        }
        // 64 planes x at a time, so that each square of bits is turned once.
        volume.words_mut().par_chunks_mut(WORD * ny * column_words).enumerate().for_each(|(group, planes)| {
            for y in 0..ny {
                let mut square = [0; WORD];
                for (z, row) in square.iter_mut().enumerate().take(layers) {
                    *row = slab[(y * depth + z) * row_words + group];
                }
                if square.iter().all(|&row| row == 0) {
                    continue;
                }
                transpose(&mut square);
                for (x, &row) in square.iter().enumerate().take(nx - group * WORD) {
                    planes[(x * ny + y) * column_words + word] = row;
                }
            }
        });
    }
    rows.finish()
}

/// Numbers separated by white space or commas, as one byte each: 1 where the number is not zero.
pub(super) fn flags_of_text(text: &[u8]) -> Result<Vec<u8>, Failure> {
    text.split(|&byte| byte.is_ascii_whitespace() || byte == b',')
        .filter(|token| !token.is_empty())
        .map(|token| {
            let number = str::from_utf8(token).ok().and_then(|token| token.parse::<f64>().ok());
            let number =
                number.ok_or_else(|| Failure::damaged("data", format!("`{}` is not a number", shown(token))))?;
            Ok(u8::from(number != 0.0))
        })
        .collect()
}
