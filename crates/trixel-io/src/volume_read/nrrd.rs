//! NRRD with an attached header: <https://teem.sourceforge.net/nrrd/format.html>.
//!
//! `space origin` is the centre of the first voxel; the grid's corner is half a voxel before it. The key/value pair
//! `trixel origin`, which [`crate::write`] adds, gives the corner to the last bit and is believed where it agrees.

use std::io::{BufRead, Cursor, Read};

use flate2::bufread::MultiGzDecoder;
use trixel::{Grid, Volume};

use super::elements::{Element, read_x_fastest};
use super::{DEFLATE_RATIO, Failure, Input, LoadedGrid, LoadedVolume, check_backing, to_dims};

/// Headers are text of a few lines; key/value pairs may make them longer.
const MAX_HEADER: u64 = 1 << 20;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Encoding {
    Raw,
    Gzip,
    Ascii,
}

struct Header {
    grid: Grid,
    encoding: Encoding,
    bytes: u64,
    warnings: Vec<String>,
}

/// What the lines of a header say.
#[derive(Default)]
struct Fields {
    sizes: Option<[u64; 3]>,
    spacings: Option<[f64; 3]>,
    axis_mins: Option<[f64; 3]>,
    space_origin: Option<[f64; 3]>,
    corner: Option<[f64; 3]>,
    node_centered: bool,
    byte_type: bool,
    encoding: Option<Encoding>,
}

fn damaged(at: &str, what: impl Into<String>) -> Failure {
    Failure::damaged(format!("field \"{at}\""), what)
}

fn numbers<const N: usize>(at: &str, text: &str) -> Result<[f64; N], Failure> {
    let separators = |c: char| c.is_whitespace() || matches!(c, '(' | ')' | ',');
    let values: Option<Vec<f64>> = text.split(separators).filter(|t| !t.is_empty()).map(|t| t.parse().ok()).collect();
    values
        .and_then(|values| <[f64; N]>::try_from(values).ok())
        .ok_or_else(|| damaged(at, format!("{text:?} should be {N} numbers; only three spatial axes are read")))
}

impl Fields {
    fn set(&mut self, field: &str, text: &str) -> Result<(), Failure> {
        match field {
            "type" => {
                self.byte_type =
                    matches!(text, "uchar" | "unsigned char" | "uint8" | "uint8_t" | "signed char" | "int8" | "int8_t");
                if !self.byte_type {
                    return Err(damaged(field, format!("{text} is not read as occupancy; store uint8")));
                }
            }
            "dimension" if text != "3" => {
                return Err(damaged(field, format!("{text} axes; occupancy has three")));
            }
            "sizes" => {
                let sizes: Option<Vec<u64>> = text.split_whitespace().map(|n| n.parse().ok()).collect();
                let sizes = sizes.and_then(|sizes| <[u64; 3]>::try_from(sizes).ok());
                self.sizes = Some(sizes.ok_or_else(|| damaged(field, format!("{text:?} should be three sizes")))?);
            }
            "spacings" => self.spacings = Some(numbers(field, text)?),
            "space directions" => {
                let [xx, xy, xz, yx, yy, yz, zx, zy, zz] = numbers(field, text)?;
                if [xy, xz, yx, yz, zx, zy].iter().any(|&v| v != 0.0) || [xx, yy, zz].iter().any(|&v| v <= 0.0) {
                    return Err(damaged(field, format!("{text} turns or mirrors the grid, which is not supported")));
                }
                self.spacings = Some([xx, yy, zz]);
            }
            "space origin" => self.space_origin = Some(numbers(field, text)?),
            "axis mins" | "axismins" => self.axis_mins = Some(numbers(field, text)?),
            "centers" | "centerings" => self.node_centered = text.split_whitespace().any(|word| word == "node"),
            "encoding" => {
                self.encoding = Some(match text {
                    "raw" => Encoding::Raw,
                    "gzip" | "gz" => Encoding::Gzip,
                    "ascii" | "text" | "txt" => Encoding::Ascii,
                    _ => return Err(damaged(field, format!("{text} is not supported; use raw, gzip or ascii"))),
                });
            }
            "data file" | "datafile" => {
                return Err(damaged(field, "data in another file is not supported; attach it to the header"));
            }
            "line skip" | "lineskip" | "byte skip" | "byteskip" if text != "0" => {
                return Err(damaged(field, "skipping data is not supported"));
            }
            // Kinds, labels, units and the like change nothing here.
            _ => {}
        }
        Ok(())
    }

    fn finish(self, bytes: u64) -> Result<Header, Failure> {
        let missing = |field: &str| Failure::damaged("header", format!("there is no field \"{field}\""));
        let dims = to_dims(self.sizes.ok_or_else(|| missing("sizes"))?)?;
        if !self.byte_type {
            return Err(missing("type"));
        }
        let encoding = self.encoding.ok_or_else(|| missing("encoding"))?;
        let size = self.spacings.ok_or_else(|| missing("space directions\" or \"spacings"))?;
        let before = |center: [f64; 3]| std::array::from_fn(|i| center[i] - 0.5 * size[i]);
        let mut warnings = Vec::new();
        let origin = match (self.space_origin, self.axis_mins) {
            (Some(center), _) => match self.corner {
                Some(corner) if Grid::new(corner, size, dims)?.center([0; 3]) == center => corner,
                _ => before(center),
            },
            (None, Some(mins)) if self.node_centered => before(mins),
            (None, Some(mins)) => mins,
            (None, None) => {
                warnings.push("the file has no space origin: the grid's origin was taken as 0".to_owned());
                [0.0; 3]
            }
        };
        Ok(Header { grid: Grid::new(origin, size, dims)?, encoding, bytes, warnings })
    }
}

fn read_header(reader: &mut impl BufRead) -> Result<Header, Failure> {
    let mut reader = reader.take(MAX_HEADER);
    let mut fields = Fields::default();
    let mut line = Vec::new();
    let mut bytes = 0;
    loop {
        line.clear();
        reader.read_until(b'\n', &mut line)?;
        let first = bytes == 0;
        bytes += line.len() as u64;
        if first && !line.starts_with(b"NRRD000") {
            return Err(Failure::damaged("header", "the file does not start with NRRD000, so it is not an NRRD file"));
        }
        if line.last() != Some(&b'\n') {
            return Err(Failure::damaged("header", "it has no end (an empty line); the file was cut short"));
        }
        let text = String::from_utf8_lossy(&line);
        let text = text.trim_end_matches(['\n', '\r']);
        if text.is_empty() {
            return fields.finish(bytes);
        }
        if first || text.starts_with('#') {
            continue;
        }
        if let Some((key, value)) = text.split_once(":=") {
            if key == "trixel origin" {
                fields.corner = Some(numbers(key, value)?);
            }
        } else if let Some((field, value)) = text.split_once(':') {
            fields.set(field.trim(), value.trim())?;
        } else {
            return Err(Failure::damaged("header", format!("the line {text:?} is not understood")));
        }
    }
}

pub(super) fn grid(mut input: Input<'_>) -> Result<LoadedGrid, Failure> {
    let header = read_header(&mut input.reader)?;
    Ok(LoadedGrid { grid: header.grid, warnings: header.warnings })
}

pub(super) fn volume(mut input: Input<'_>, memory_limit: Option<u64>) -> Result<LoadedVolume, Failure> {
    let Header { grid, encoding, bytes, warnings } = read_header(&mut input.reader)?;
    let ratio = if encoding == Encoding::Gzip { DEFLATE_RATIO } else { 1 };
    check_backing(input.bytes.saturating_sub(bytes), ratio, grid.voxel_count())?;
    let mut volume = Volume::with_memory_limit(grid, memory_limit)?;
    match encoding {
        Encoding::Raw => read_x_fastest(input.reader, Element::BYTE, &mut volume)?,
        Encoding::Gzip => read_x_fastest(MultiGzDecoder::new(input.reader), Element::BYTE, &mut volume)?,
        Encoding::Ascii => {
            let mut text = Vec::new();
            input.reader.read_to_end(&mut text)?;
            read_x_fastest(Cursor::new(super::elements::flags_of_text(&text)?), Element::BYTE, &mut volume)?;
        }
    }
    Ok(LoadedVolume { volume, warnings })
}
