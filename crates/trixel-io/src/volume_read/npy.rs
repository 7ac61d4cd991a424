//! NumPy's `.npy`: <https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html>.

use std::io::Read;

use trixel::{Grid, Volume};

use super::elements::{Element, read_x_fastest, read_z_fastest};
use super::{Failure, Input, LoadedGrid, LoadedVolume, check_backing, to_dims};

/// Headers of plain arrays take about a hundred bytes.
const MAX_HEADER: u64 = 1 << 16;

/// What the header of an array says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct NpyHeader {
    /// NumPy's `descr`, for example `<f8`.
    pub(super) dtype: String,
    /// Whether the first index is fastest.
    pub(super) fortran: bool,
    pub(super) shape: Vec<u64>,
    /// Length of the header, up to the data.
    pub(super) bytes: u64,
}

impl NpyHeader {
    pub(super) fn read(reader: &mut impl Read) -> Result<Self, Failure> {
        let damaged = |what: &str| Failure::damaged("header", what);
        let mut prefix = [0; 8];
        reader.read_exact(&mut prefix)?;
        if &prefix[..6] != b"\x93NUMPY" {
            return Err(damaged("this is not a NumPy array: it does not start with \\x93NUMPY"));
        }
        let (length, field) = match prefix[6] {
            1 => {
                let mut length = [0; 2];
                reader.read_exact(&mut length)?;
                (u64::from(u16::from_le_bytes(length)), 2)
            }
            2 | 3 => {
                let mut length = [0; 4];
                reader.read_exact(&mut length)?;
                (u64::from(u32::from_le_bytes(length)), 4)
            }
            version => return Err(damaged(&format!("version {version} of .npy is unknown"))),
        };
        if length > MAX_HEADER {
            return Err(damaged(&format!("a header of {length} bytes is not one of a plain array")));
        }
        let mut text = Vec::new();
        reader.take(length).read_to_end(&mut text)?;
        if text.len() as u64 != length {
            return Err(std::io::Error::from(std::io::ErrorKind::UnexpectedEof).into());
        }
        let text = String::from_utf8_lossy(&text);
        let dtype = value(&text, "descr")
            .and_then(|rest| rest.strip_prefix('\'')?.split_once('\''))
            .ok_or_else(|| damaged("'descr' is missing or not of a plain type"))?;
        let order = value(&text, "fortran_order").ok_or_else(|| damaged("'fortran_order' is missing"))?;
        let shape = value(&text, "shape")
            .and_then(|rest| rest.strip_prefix('(')?.split_once(')'))
            .ok_or_else(|| damaged("'shape' is missing"))?;
        let shape: Result<Vec<u64>, _> = shape
            .0
            .split(',')
            .map(str::trim)
            .filter(|n| !n.is_empty())
            .map(|n| n.trim_end_matches('L').parse())
            .collect();
        Ok(Self {
            dtype: dtype.0.to_owned(),
            fortran: order.starts_with("True"),
            shape: shape.map_err(|_| damaged("'shape' is not a list of sizes"))?,
            bytes: 8 + field + length,
        })
    }

    /// The array as occupancy: its dimensions and element.
    pub(super) fn occupancy(&self) -> Result<([u32; 3], Element), Failure> {
        let at = "occupancy";
        if !matches!(self.dtype.get(1..), Some("b1" | "u1" | "i1")) {
            let what = format!("values of type {} are not read as occupancy; store bool or uint8", self.dtype);
            return Err(Failure::damaged(at, what));
        }
        let &[nx, ny, nz] = self.shape.as_slice() else {
            let what = format!("the array has {} axes; occupancy has three, [x, y, z]", self.shape.len());
            return Err(Failure::damaged(at, what));
        };
        Ok((to_dims([nx, ny, nz])?, Element::BYTE))
    }

    /// Reads the array, whose header this is, into `volume`.
    pub(super) fn read_occupancy(&self, reader: impl Read, volume: &mut Volume) -> Result<(), Failure> {
        let (_, element) = self.occupancy()?;
        if self.fortran { read_x_fastest(reader, element, volume) } else { read_z_fastest(reader, element, volume) }
    }
}

/// What follows `'key':` in a Python dictionary.
fn value<'a>(dictionary: &'a str, key: &str) -> Option<&'a str> {
    let (_, rest) = dictionary.split_once(&format!("'{key}'"))?;
    Some(rest.trim_start().strip_prefix(':')?.trim_start())
}

const NO_PLACE: &str = ".npy holds no grid: its origin was taken as 0 and its voxel size as 1";

pub(super) fn grid(mut input: Input<'_>) -> Result<LoadedGrid, Failure> {
    let (dims, _) = NpyHeader::read(&mut input.reader)?.occupancy()?;
    Ok(LoadedGrid { grid: Grid::new([0.0; 3], [1.0; 3], dims)?, warnings: vec![NO_PLACE.to_owned()] })
}

pub(super) fn volume(mut input: Input<'_>, memory_limit: Option<u64>) -> Result<LoadedVolume, Failure> {
    let header = NpyHeader::read(&mut input.reader)?;
    let (dims, _) = header.occupancy()?;
    let grid = Grid::new([0.0; 3], [1.0; 3], dims)?;
    check_backing(input.bytes.saturating_sub(header.bytes), 1, grid.voxel_count())?;
    let mut volume = Volume::with_memory_limit(grid, memory_limit)?;
    header.read_occupancy(input.reader, &mut volume)?;
    Ok(LoadedVolume { volume, warnings: vec![NO_PLACE.to_owned()] })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(dictionary: &str) -> Result<NpyHeader, Failure> {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend(u16::try_from(dictionary.len()).unwrap().to_le_bytes());
        bytes.extend(dictionary.as_bytes());
        NpyHeader::read(&mut &bytes[..])
    }

    #[test]
    fn headers_of_any_numpy_are_read() {
        let read = header("{'descr': '|b1', 'fortran_order': True, 'shape': (7, 70L, 131), }  \n").unwrap();
        assert_eq!((read.dtype.as_str(), read.fortran, read.shape.as_slice()), ("|b1", true, &[7, 70, 131][..]));
        assert!(header("{'descr': '<f8', 'fortran_order': False, 'shape': ()}").unwrap().shape.is_empty());
        assert_eq!(header("{'shape': (3,), 'fortran_order': False, 'descr': '<f8'}").unwrap().shape, [3]);
    }

    #[test]
    fn headers_of_other_things_are_refused() {
        for text in [
            "",
            "{}",
            "{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (3,)}",
            "{'descr': '<f8', 'fortran_order': False, 'shape': (-3,)}",
            "{'descr': '<f8', 'fortran_order': False, 'shape': (3",
            "{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999999999999,)}",
        ] {
            assert!(matches!(header(text), Err(Failure::Problem(_))), "{text}");
        }
        let floats = header("{'descr': '<f8', 'fortran_order': False, 'shape': (1, 1, 1)}").unwrap();
        assert!(floats.occupancy().is_err());
    }
}
