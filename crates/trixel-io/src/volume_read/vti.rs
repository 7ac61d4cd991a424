//! VTK XML image data: one piece, cell data, any of VTK's encodings, uncompressed or compressed by zlib.
//!
//! The format: VTK File Formats, "XML File Formats". The whole file is held in memory while it is read.

use std::borrow::Cow;
use std::io::{self, Cursor, Read};

use flate2::bufread::ZlibDecoder;
use memchr::memmem::find;
use trixel::{Grid, Volume};

use super::elements::{Element, flags_of_text, read_x_fastest};
use super::{DEFLATE_RATIO, Failure, Input, LoadedGrid, LoadedVolume, check_backing, to_dims};
use crate::xml::{Document, Element as Node};

/// The array that holds occupancy, where there are several.
const OCCUPANCY: &str = "occupancy";

/// The file taken apart: its XML, and what follows the opening tag of `AppendedData`, which need not be XML.
struct Parts<'a> {
    xml: Cow<'a, str>,
    appended: &'a [u8],
}

fn damaged(at: &str, what: impl Into<String>) -> Failure {
    Failure::damaged(at, what)
}

fn take_apart(bytes: &[u8]) -> Result<Parts<'_>, Failure> {
    fn utf8(bytes: &[u8]) -> Result<&str, Failure> {
        str::from_utf8(bytes).map_err(|_| damaged("header", "the XML is not UTF-8; the file is damaged"))
    }
    let Some(tag) = find(bytes, b"<AppendedData") else {
        return Ok(Parts { xml: utf8(bytes)?.into(), appended: &[] });
    };
    let end = find(&bytes[tag..], b">").ok_or_else(|| damaged("AppendedData", "the file was cut short"))? + tag;
    // Closed here, so that what comes before is a document of its own.
    let xml = format!("{}/></VTKFile>", utf8(&bytes[..end])?);
    let rest = &bytes[end + 1..];
    let start = find(rest, b"_").ok_or_else(|| damaged("AppendedData", "there is no _ before the data"))?;
    Ok(Parts { xml: xml.into(), appended: &rest[start + 1..] })
}

fn child<'a>(node: Node<'a>, name: &str) -> Result<Node<'a>, Failure> {
    node.child(name).ok_or_else(|| damaged(node.name(), format!("there is no element {name} in it")))
}

fn numbers<const N: usize>(node: Node<'_>, name: &str) -> Result<Option<[f64; N]>, Failure> {
    let Some(text) = node.attribute(name) else { return Ok(None) };
    let values: Option<Vec<f64>> = text.split_whitespace().map(|number| number.parse().ok()).collect();
    match values.and_then(|values| <[f64; N]>::try_from(values).ok()) {
        Some(values) => Ok(Some(values)),
        None => Err(damaged(name, format!("{text:?} should be {N} numbers"))),
    }
}

/// The root, the grid and the piece.
fn read_header<'a>(document: &'a Document<'a>) -> Result<(Node<'a>, Grid, Node<'a>), Failure> {
    let root = document.root().filter(|root| root.name() == "VTKFile");
    let Some(root) = root.filter(|root| root.attribute("type").as_deref() == Some("ImageData")) else {
        return Err(damaged("header", "this is not a VTK file of type ImageData"));
    };
    let image = child(root, "ImageData")?;
    let pieces = image.all("Piece").count();
    if pieces != 1 {
        return Err(damaged("ImageData", format!("{pieces} pieces; only files of one piece are read")));
    }
    let piece = child(image, "Piece")?;
    let extent: [f64; 6] =
        numbers(image, "WholeExtent")?.ok_or_else(|| damaged("ImageData", "there is no WholeExtent"))?;
    if numbers::<6>(piece, "Extent")?.is_some_and(|piece| piece != extent) {
        return Err(damaged("Piece", "it does not cover the whole extent, which is not supported"));
    }
    if numbers::<9>(image, "Direction")?.is_some_and(|d| d != [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]) {
        return Err(damaged("Direction", "turned or mirrored images are not supported"));
    }
    let spacing = numbers(image, "Spacing")?.unwrap_or([1.0; 3]);
    let origin: [f64; 3] = numbers(image, "Origin")?.unwrap_or([0.0; 3]);
    let low = [extent[0], extent[2], extent[4]];
    let counts: [f64; 3] = std::array::from_fn(|i| extent[2 * i + 1] - extent[2 * i]);
    if extent.iter().any(|n| n.fract() != 0.0) || counts.iter().any(|&n| n < 1.0) {
        return Err(damaged("WholeExtent", "there are no cells in it"));
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at least 1, and `as` saturates")]
    let dims = to_dims(counts.map(|n| n as u64))?;
    // Extents may start anywhere; the origin is where point 0 would be.
    let corner = std::array::from_fn(|i| if low[i] == 0.0 { origin[i] } else { origin[i] + low[i] * spacing[i] });
    Ok((root, Grid::new(corner, spacing, dims)?, piece))
}

/// The array of cell data that is the occupancy.
fn find_array(piece: Node<'_>) -> Result<Node<'_>, Failure> {
    let cells = child(piece, "CellData")?;
    let arrays: Vec<_> = cells.all("DataArray").collect();
    let named = |name: &str| arrays.iter().find(|array| array.attribute("Name").as_deref() == Some(name));
    let chosen = named(OCCUPANCY).or_else(|| named(&cells.attribute("Scalars")?)).or(match arrays.as_slice() {
        [only] => Some(only),
        _ => None,
    });
    let array = *chosen.ok_or_else(|| {
        let what = format!("{} arrays, none of them named {OCCUPANCY}; voxels are cells, not points", arrays.len());
        damaged("CellData", what)
    })?;
    match array.attribute("NumberOfComponents").as_deref() {
        None | Some("1") => Ok(array),
        Some(n) => Err(damaged("DataArray", format!("{n} components; occupancy has one"))),
    }
}

fn element(kind: &str, big_endian: bool) -> Result<Element, Failure> {
    let float = |bytes| Element { bytes, sign_byte: Some(if big_endian { 0 } else { bytes - 1 }) };
    let integer = |bytes| Element { bytes, sign_byte: None };
    Ok(match kind {
        "Int8" | "UInt8" => Element::BYTE,
        "Int16" | "UInt16" => integer(2),
        "Int32" | "UInt32" => integer(4),
        "Int64" | "UInt64" => integer(8),
        "Float32" => float(4),
        "Float64" => float(8),
        other => return Err(damaged("DataArray", format!("values of type {other} are not read as occupancy"))),
    })
}

pub(super) fn grid(mut input: Input<'_>) -> Result<LoadedGrid, Failure> {
    let mut bytes = Vec::new();
    input.reader.read_to_end(&mut bytes)?;
    let parts = take_apart(&bytes)?;
    let document = Document::parse(&parts.xml)?;
    let (_, grid, _) = read_header(&document)?;
    Ok(LoadedGrid { grid, warnings: Vec::new() })
}

pub(super) fn volume(mut input: Input<'_>, memory_limit: Option<u64>) -> Result<LoadedVolume, Failure> {
    let mut bytes = Vec::new();
    input.reader.read_to_end(&mut bytes)?;
    let parts = take_apart(&bytes)?;
    let document = Document::parse(&parts.xml)?;
    let (root, grid, piece) = read_header(&document)?;
    let array = find_array(piece)?;
    let big_endian = root.attribute("byte_order").as_deref() == Some("BigEndian");
    let element = element(&array.attribute("type").unwrap_or_default(), big_endian)?;
    let needed = grid.voxel_count().saturating_mul(element.bytes as u64);
    let integers = Integers { big_endian, wide: root.attribute("header_type").as_deref() == Some("UInt64") };
    let text = array.text();
    let (data, base64) = match array.attribute("format").as_deref() {
        Some("ascii") => {
            check_backing(text.len() as u64, 1, grid.voxel_count())?;
            let mut volume = Volume::with_memory_limit(grid, memory_limit)?;
            read_x_fastest(Cursor::new(flags_of_text(text.as_bytes())?), Element::BYTE, &mut volume)?;
            return Ok(LoadedVolume { volume, warnings: Vec::new() });
        }
        Some("binary") => (text.as_bytes(), true),
        Some("appended") => {
            let encoding = child(root, "AppendedData")?.attribute("encoding");
            let encoding = encoding.as_deref().unwrap_or("base64");
            if !matches!(encoding, "raw" | "base64") {
                return Err(damaged(
                    "AppendedData",
                    format!("encoding {encoding} is not supported; use raw or base64"),
                ));
            }
            let offset = array.attribute("offset").and_then(|offset| offset.parse::<usize>().ok());
            let data = offset.and_then(|offset| parts.appended.get(offset..));
            let data = data.ok_or_else(|| damaged("DataArray", "its offset lies outside the appended data"))?;
            (data, encoding == "base64")
        }
        other => return Err(damaged("DataArray", format!("format {other:?} is unknown"))),
    };
    let reader: Box<dyn Read + '_> = if base64 { Box::new(Base64::new(data)) } else { Box::new(data) };
    match root.attribute("compressor").as_deref() {
        None | Some("") => {
            check_backing(data.len() as u64, 1, needed)?;
            let mut reader = reader;
            let stated = integers.read(&mut reader)?;
            if stated != needed {
                return Err(damaged("DataArray", format!("it has {stated} bytes, and the extent takes {needed}")));
            }
            let mut volume = Volume::with_memory_limit(grid, memory_limit)?;
            read_x_fastest(reader.take(needed), element, &mut volume)?;
            Ok(LoadedVolume { volume, warnings: Vec::new() })
        }
        Some("vtkZLibDataCompressor") => {
            check_backing(data.len() as u64, DEFLATE_RATIO, needed)?;
            let blocks = ZlibBlocks::new(reader, integers, data.len() as u64)?;
            let mut volume = Volume::with_memory_limit(grid, memory_limit)?;
            read_x_fastest(blocks, element, &mut volume)?;
            Ok(LoadedVolume { volume, warnings: Vec::new() })
        }
        Some(other) => Err(damaged("VTKFile", format!("compressor {other} is not supported; use zlib or none"))),
    }
}

/// The integers of block headers.
#[derive(Clone, Copy)]
struct Integers {
    big_endian: bool,
    wide: bool,
}

impl Integers {
    fn read(self, reader: &mut impl Read) -> io::Result<u64> {
        let mut bytes = [0; 8];
        let used = if self.wide { &mut bytes[..] } else { &mut bytes[..4] };
        reader.read_exact(used)?;
        if self.big_endian {
            used.reverse();
        }
        Ok(u64::from_le_bytes(bytes))
    }
}

/// VTK's compressed data: the number of blocks, their size, the last one's size (0 if it is full), each one's compressed
/// size; then the blocks, each a zlib stream.
struct ZlibBlocks<'a> {
    source: Box<dyn Read + 'a>,
    /// Compressed sizes of the blocks to come, last first.
    sizes: Vec<u64>,
    current: ZlibDecoder<Cursor<Vec<u8>>>,
}

impl<'a> ZlibBlocks<'a> {
    fn new(mut source: Box<dyn Read + 'a>, integers: Integers, available: u64) -> Result<Self, Failure> {
        let count = integers.read(&mut source)?;
        let _block_size = integers.read(&mut source)?;
        let _last_size = integers.read(&mut source)?;
        if count > available / 4 {
            return Err(damaged("DataArray", format!("{count} blocks are more than the data can hold")));
        }
        let mut sizes = (0..count).map(|_| integers.read(&mut source)).collect::<io::Result<Vec<_>>>()?;
        sizes.reverse();
        Ok(Self { source, sizes, current: ZlibDecoder::new(Cursor::new(Vec::new())) })
    }
}

impl Read for ZlibBlocks<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        loop {
            // An empty source, before the first block, also reads as its end.
            if !self.current.get_ref().get_ref().is_empty() {
                let read = self.current.read(out)?;
                if read > 0 {
                    return Ok(read);
                }
            }
            let Some(size) = self.sizes.pop() else { return Ok(0) };
            let mut block = Vec::new();
            self.source.by_ref().take(size).read_to_end(&mut block)?;
            if block.len() as u64 != size {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
            self.current = ZlibDecoder::new(Cursor::new(block));
        }
    }
}

/// Base64 as VTK writes it: sections, each padded at its end, follow each other and are read as one stream. Own code,
/// because decoders take padding for the end.
struct Base64<'a> {
    text: std::slice::Iter<'a, u8>,
    /// Up to three decoded bytes that were not asked for yet.
    pending: [u8; 3],
    next: usize,
    end: usize,
}

impl<'a> Base64<'a> {
    fn new(text: &'a [u8]) -> Self {
        Self { text: text.iter(), pending: [0; 3], next: 0, end: 0 }
    }

    /// Decodes the next four characters; no bytes at the end of the text.
    fn refill(&mut self) -> io::Result<()> {
        let mut value = 0;
        let (mut characters, mut padding) = (0, 0);
        while characters < 4 {
            let Some(&byte) = self.text.next() else { break };
            let digit = match byte {
                b'A'..=b'Z' => byte - b'A',
                b'a'..=b'z' => byte - b'a' + 26,
                b'0'..=b'9' => byte - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                b'=' => {
                    padding += 1;
                    0
                }
                _ if byte.is_ascii_whitespace() => continue,
                // The closing tag after appended data.
                b'<' => {
                    self.text = [].iter();
                    break;
                }
                _ => return Err(io::Error::new(io::ErrorKind::InvalidData, "a character is not base64")),
            };
            value = value << 6 | u32::from(digit);
            characters += 1;
        }
        (self.next, self.end) = (0, 0);
        match (characters, padding) {
            (0, _) => Ok(()),
            (4, 0..=2) => {
                let [_, bytes @ ..] = value.to_be_bytes();
                self.pending = bytes;
                self.end = 3 - padding;
                Ok(())
            }
            _ => Err(io::ErrorKind::UnexpectedEof.into()),
        }
    }
}

impl Read for Base64<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let mut written = 0;
        while written < out.len() {
            if self.next == self.end {
                self.refill()?;
                if self.end == 0 {
                    break;
                }
            }
            out[written] = self.pending[self.next];
            self.next += 1;
            written += 1;
        }
        Ok(written)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_sections_follow_each_other() {
        let mut bytes = Vec::new();
        Base64::new(b"AQ==\n AgM= BAUG</AppendedData>").read_to_end(&mut bytes).unwrap();
        assert_eq!(bytes, [1, 2, 3, 4, 5, 6]);
        for text in [&b"AQ="[..], b"A", b"A-AA", b"A==="] {
            assert!(Base64::new(text).read_to_end(&mut Vec::new()).is_err());
        }
    }
}
