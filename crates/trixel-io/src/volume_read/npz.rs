//! NumPy archives with `occupancy` or `indices` and `dims`, and `origin` and `voxel_size`.

use std::fs::File;
use std::io::{BufReader, Read};

use trixel::{Grid, Volume};
use zip::ZipArchive;
use zip::read::ZipFile;
use zip::result::ZipError;

use super::npy::NpyHeader;
use super::{BUFFER_BYTES, DEFLATE_RATIO, Failure, Input, LoadedGrid, LoadedVolume, check_backing, to_dims};

type Entry<'a> = ZipFile<'a, BufReader<File>>;
/// Reads one number.
type NumberReader = fn(&mut dyn Read) -> Result<f64, Failure>;

impl From<ZipError> for Failure {
    fn from(error: ZipError) -> Self {
        match error {
            ZipError::Io(error) => error.into(),
            error => Self::damaged("archive", error.to_string()),
        }
    }
}

/// An opened archive.
struct Archive {
    zip: ZipArchive<BufReader<File>>,
    bytes: u64,
}

impl Archive {
    fn open(input: Input) -> Result<Self, Failure> {
        Ok(Self { bytes: input.bytes, zip: ZipArchive::new(input.reader)? })
    }

    fn has(&self, name: &str) -> bool {
        self.zip.index_for_name(&format!("{name}.npy")).is_some()
    }

    /// The header of an array, and its data.
    fn array(&mut self, name: &str) -> Result<(NpyHeader, Entry<'_>), Failure> {
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
    fn most_bytes(file_bytes: u64, entry: &Entry<'_>) -> (u64, u64) {
        let ratio = if entry.compression() == zip::CompressionMethod::Stored { 1 } else { DEFLATE_RATIO };
        // The entry's own word on its size is not to be trusted beyond the file's.
        (entry.compressed_size().min(file_bytes), ratio)
    }

    /// Three numbers, or one for all three.
    fn triple(&mut self, name: &str) -> Result<[f64; 3], Failure> {
        let (header, mut entry) = self.array(name)?;
        let number = number_reader(name, &header.dtype)?;
        let mut next = || number(&mut entry);
        match header.shape.as_slice() {
            [3] => Ok([next()?, next()?, next()?]),
            [] | [1] => next().map(|value| [value; 3]),
            shape => Err(Failure::damaged(name, format!("shape {shape:?} should be [3]"))),
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

/// A function that reads one number of NumPy type `dtype`.
fn number_reader(name: &str, dtype: &str) -> Result<NumberReader, Failure> {
    fn bytes<const N: usize>(reader: &mut dyn Read) -> Result<[u8; N], Failure> {
        let mut bytes = [0; N];
        reader.read_exact(&mut bytes)?;
        Ok(bytes)
    }
    #[expect(clippy::cast_precision_loss, reason = "indices and dimensions are small; larger ones are refused after")]
    Ok(match dtype {
        "<f8" => |reader| Ok(f64::from_le_bytes(bytes(reader)?)),
        "<f4" => |reader| Ok(f64::from(f32::from_le_bytes(bytes(reader)?))),
        "<i4" => |reader| Ok(f64::from(i32::from_le_bytes(bytes(reader)?))),
        "<u4" => |reader| Ok(f64::from(u32::from_le_bytes(bytes(reader)?))),
        "<i2" => |reader| Ok(f64::from(i16::from_le_bytes(bytes(reader)?))),
        "<u2" => |reader| Ok(f64::from(u16::from_le_bytes(bytes(reader)?))),
        "<i8" => |reader| Ok(i64::from_le_bytes(bytes(reader)?) as f64),
        "<u8" => |reader| Ok(u64::from_le_bytes(bytes(reader)?) as f64),
        other => {
            let what = format!("values of type {other} are not read; store little-endian int32, int64 or float64");
            return Err(Failure::damaged(name, what));
        }
    })
}

pub(super) fn grid(input: Input) -> Result<LoadedGrid, Failure> {
    Ok(LoadedGrid { grid: Archive::open(input)?.grid()?, warnings: Vec::new() })
}

pub(super) fn volume(input: Input, memory_limit: Option<u64>) -> Result<LoadedVolume, Failure> {
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
    read_indices(&mut archive, &mut volume)?;
    Ok(LoadedVolume { volume, warnings: Vec::new() })
}

/// Sets the voxels that the rows of `indices` name.
fn read_indices(archive: &mut Archive, volume: &mut Volume) -> Result<(), Failure> {
    let at = "indices";
    let (header, entry) = archive.array(at)?;
    // Numbers are read one by one.
    let mut entry = BufReader::with_capacity(BUFFER_BYTES, entry);
    let &[rows, 3] = header.shape.as_slice() else {
        return Err(Failure::damaged(at, format!("shape {:?} should be [N, 3]", header.shape)));
    };
    if header.dtype.as_bytes().get(1) == Some(&b'f') {
        return Err(Failure::damaged(at, format!("values of type {} cannot be indices; store int32", header.dtype)));
    }
    let number = number_reader(at, &header.dtype)?;
    let dims = volume.grid().dims();
    let mut next = |axis: usize, row: u64| -> Result<u32, Failure> {
        let (value, n) = (number(&mut entry)?, dims[axis]);
        if !(0.0..f64::from(n)).contains(&value) {
            let what = format!("index {value} of row {row} is outside the grid, whose axis has {n} voxels");
            return Err(Failure::damaged(at, what));
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked just above")]
        Ok(value as u32)
    };
    if header.fortran {
        // Column after column, as `numpy.argwhere` leaves its result: grown as it is read, not by the stated length.
        let xs = (0..rows).map(|row| next(0, row)).collect::<Result<Vec<_>, _>>()?;
        let ys = (0..rows).map(|row| next(1, row)).collect::<Result<Vec<_>, _>>()?;
        for ((row, x), y) in (0..rows).zip(xs).zip(ys) {
            volume.set([x, y, next(2, row)?]);
        }
    } else {
        for row in 0..rows {
            volume.set([next(0, row)?, next(1, row)?, next(2, row)?]);
        }
    }
    if entry.read(&mut [0])? != 0 {
        return Err(Failure::damaged(at, "there is more data than the header says"));
    }
    Ok(())
}
