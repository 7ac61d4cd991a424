//! NumPy archives with `occupancy` or `indices` and `dims`, and `origin` and `voxel_size`.

use std::io::Read;

use trixel::{Grid, Volume, VolumeError};
use zip::ZipArchive;
use zip::read::ZipFile;
use zip::result::ZipError;

use super::npy::NpyHeader;
use super::{DEFLATE_RATIO, Failure, Input, LoadedGrid, LoadedVolume, Reader, check_backing, to_dims};
use crate::bits::WORD;

type Entry<'a, 'b> = ZipFile<'a, Reader<'b>>;

impl From<ZipError> for Failure {
    fn from(error: ZipError) -> Self {
        match error {
            ZipError::Io(error) => error.into(),
            error => Self::damaged("archive", format!("{error}; the file was cut short or is not a NumPy archive")),
        }
    }
}

/// An opened archive.
struct Archive<'a> {
    zip: ZipArchive<Reader<'a>>,
    bytes: u64,
}

impl<'a> Archive<'a> {
    fn open(input: Input<'a>) -> Result<Self, Failure> {
        Ok(Self { bytes: input.bytes, zip: ZipArchive::new(input.reader)? })
    }

    fn has(&self, name: &str) -> bool {
        self.zip.index_for_name(&format!("{name}.npy")).is_some()
    }

    /// The header of an array, and its data.
    fn array(&mut self, name: &str) -> Result<(NpyHeader, Entry<'_, 'a>), Failure> {
        if !self.has(name) {
            let what = format!(
                "there is no array named {name}; a volume has occupancy (or indices and dims), origin and voxel_size"
            );
            return Err(Failure::damaged("archive", what));
        }
        let mut entry = self.zip.by_name(&format!("{name}.npy"))?;
        let header = NpyHeader::read(&mut entry)?;
        Ok((header, entry))
    }

    /// The most bytes that the data of an entry can have.
    fn most_bytes(file_bytes: u64, entry: &Entry<'_, 'a>) -> (u64, u64) {
        let ratio = if entry.compression() == zip::CompressionMethod::Stored { 1 } else { DEFLATE_RATIO };
        // The entry's own word on its size is not to be trusted beyond the file's.
        (entry.compressed_size().min(file_bytes), ratio)
    }

    /// Three numbers, or one for all three.
    fn triple(&mut self, name: &str) -> Result<[f64; 3], Failure> {
        let (header, entry) = self.array(name)?;
        let count = match header.shape.as_slice() {
            [] | [1] => 1,
            [3] => 3,
            shape => return Err(Failure::damaged(name, format!("shape {shape:?} should be [3]"))),
        };
        match *Numbers::new(name, &header.dtype, entry)?.read(count)? {
            [x, y, z] => Ok([x, y, z]),
            [value] => Ok([value; 3]),
            _ => Err(Failure::damaged(name, "it should hold three numbers")),
        }
    }

    fn grid(&mut self) -> Result<Grid, Failure> {
        let dims = if self.has("occupancy") {
            self.array("occupancy")?.0.occupancy()?.0
        } else if self.has("indices") {
            let dims = self.triple("dims")?;
            if dims.iter().any(|&n| n.fract() != 0.0 || n < 1.0 || n > f64::from(Grid::MAX_DIM)) {
                return Err(Failure::damaged("dims", format!("{dims:?} are not dimensions of a grid")));
            }
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked just above")]
            to_dims(dims.map(|n| n as u64))?
        } else {
            let what = "there is neither an array named occupancy nor one named indices, so this is not a volume";
            return Err(Failure::damaged("archive", what));
        };
        let missing: Vec<_> = ["origin", "voxel_size"].into_iter().filter(|name| !self.has(name)).collect();
        if !missing.is_empty() {
            let what = format!(
                "there is no array named {}, so nobody knows where the voxels are; add it (three float64)",
                missing.join(" and none named ")
            );
            return Err(Failure::damaged("archive", what));
        }
        Ok(Grid::new(self.triple("origin")?, self.triple("voxel_size")?, dims)?)
    }
}

/// Appends the numbers that bytes hold.
type Decode = fn(&[u8], &mut Vec<f64>);

/// The numbers of an array, in the order of the file.
struct Numbers<R> {
    reader: R,
    /// Bytes of a number.
    size: u64,
    decode: Decode,
    bytes: Vec<u8>,
    values: Vec<f64>,
}

impl<R: Read> Numbers<R> {
    /// Numbers of NumPy type `dtype`.
    fn new(name: &str, dtype: &str, reader: R) -> Result<Self, Failure> {
        // Integers above 2^53 round, and are far outside any grid.
        macro_rules! numbers {
            ($type:ty) => {
                (size_of::<$type>() as u64, |bytes, values| {
                    values.extend(bytes.as_chunks().0.iter().map(|&bytes| <$type>::from_le_bytes(bytes) as f64));
                })
            };
        }
        let (size, decode): (u64, Decode) = match dtype {
            "<f8" => numbers!(f64),
            "<f4" => numbers!(f32),
            "|i1" => numbers!(i8),
            "|u1" => numbers!(u8),
            "<i2" => numbers!(i16),
            "<u2" => numbers!(u16),
            "<i4" => numbers!(i32),
            "<u4" => numbers!(u32),
            "<i8" => numbers!(i64),
            "<u8" => numbers!(u64),
            other => {
                let what = format!("values of type {other} are not read; store little-endian int32, int64 or float64");
                return Err(Failure::damaged(name, what));
            }
        };
        Ok(Self { reader, size, decode, bytes: Vec::new(), values: Vec::new() })
    }

    /// The next `count` numbers.
    fn read(&mut self, count: u64) -> Result<&[f64], Failure> {
        let length = count * self.size;
        self.bytes.clear();
        self.reader.by_ref().take(length).read_to_end(&mut self.bytes)?;
        if self.bytes.len() as u64 != length {
            return Err(std::io::Error::from(std::io::ErrorKind::UnexpectedEof).into());
        }
        self.values.clear();
        (self.decode)(&self.bytes, &mut self.values);
        Ok(&self.values)
    }

    /// Makes sure that nothing follows; this also lets the archive check the checksum.
    fn finish(mut self, name: &str) -> Result<(), Failure> {
        if self.reader.read(&mut [0])? == 0 {
            return Ok(());
        }
        Err(Failure::damaged(name, "there is more data than the header says"))
    }
}

pub(super) fn grid(input: Input<'_>) -> Result<LoadedGrid, Failure> {
    Ok(LoadedGrid { grid: Archive::open(input)?.grid()?, warnings: Vec::new() })
}

pub(super) fn volume(input: Input<'_>, memory_limit: Option<u64>) -> Result<LoadedVolume, Failure> {
    let mut archive = Archive::open(input)?;
    let grid = archive.grid()?;
    let file_bytes = archive.bytes;
    if archive.has("occupancy") {
        let (header, entry) = archive.array("occupancy")?;
        let (bytes, ratio) = Archive::most_bytes(file_bytes, &entry);
        check_backing(bytes, ratio, grid.voxel_count())?;
        let mut volume = Volume::with_memory_limit(grid, memory_limit)?;
        header.read_occupancy(entry, &mut volume)?;
        return Ok(LoadedVolume { volume, warnings: Vec::new() });
    }
    let mut volume = Volume::with_memory_limit(grid, memory_limit)?;
    read_indices(&mut archive, &mut volume, memory_limit)?;
    Ok(LoadedVolume { volume, warnings: Vec::new() })
}

/// Sets the voxels that the rows of `indices` name.
fn read_indices(archive: &mut Archive<'_>, volume: &mut Volume, memory_limit: Option<u64>) -> Result<(), Failure> {
    /// Rows that are decoded at a time.
    const CHUNK: usize = 1 << 12;
    let at = "indices";
    let (header, entry) = archive.array(at)?;
    let &[rows, 3] = header.shape.as_slice() else {
        return Err(Failure::damaged(at, format!("shape {:?} should be [N, 3]", header.shape)));
    };
    if header.dtype.as_bytes().get(1) == Some(&b'f') {
        return Err(Failure::damaged(at, format!("values of type {} cannot be indices; store int32", header.dtype)));
    }
    let mut numbers = Numbers::new(at, &header.dtype, entry)?;
    let [nx, ny, nz] = volume.grid().dims();
    let index = |value: f64, n: u32, row: u64| {
        if (0.0..f64::from(n)).contains(&value) {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked just above")]
            return Ok(value as u32);
        }
        let what = format!("index {value} of row {row} is outside the grid, whose axis has {n} voxels");
        Err(Failure::damaged(at, what))
    };
    let column_words = volume.column_words();
    let needed = Volume::required_bytes(volume.grid()).saturating_add(rows.saturating_mul(8));
    let dims = volume.grid().dims();
    let words = volume.words_mut();
    let mut set = |x: u32, y: u32, z: u32| {
        let column = x as usize * ny as usize + y as usize;
        words[column * column_words + z as usize / WORD] |= 1 << (z as usize % WORD);
    };
    let chunks = || (0..rows).step_by(CHUNK).map(|first| (first, (rows - first).min(CHUNK as u64)));
    if header.fortran {
        // Column after column, as `numpy.argwhere` leaves its result: x and y are kept until z comes.
        if let Some(available) = memory_limit.filter(|&limit| needed > limit) {
            return Err(VolumeError::OutOfMemory { dims, needed, available: Some(available) }.into());
        }
        // Grown as they are read, not by the stated length.
        let mut columns = [Vec::new(), Vec::new()];
        for (column, n) in columns.iter_mut().zip([nx, ny]) {
            for (first, count) in chunks() {
                for (row, &value) in (first..).zip(numbers.read(count)?) {
                    column.push(index(value, n, row)?);
                }
            }
        }
        let [xs, ys] = columns;
        let mut columns = xs.into_iter().zip(ys);
        for (first, count) in chunks() {
            for ((row, &value), (x, y)) in (first..).zip(numbers.read(count)?).zip(&mut columns) {
                set(x, y, index(value, nz, row)?);
            }
        }
    } else {
        for (first, count) in chunks() {
            for (row, &[x, y, z]) in (first..).zip(numbers.read(3 * count)?.as_chunks().0) {
                set(index(x, nx, row)?, index(y, ny, row)?, index(z, nz, row)?);
            }
        }
    }
    numbers.finish(at)
}
