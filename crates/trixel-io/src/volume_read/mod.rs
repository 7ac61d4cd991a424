//! Volume readers: one file a format, all behind [`read_volume`] and [`read_grid`].
//!
//! They read what [`crate::write`] writes and what NumPy, VTK, pynrrd and binvox tools write of the same kind: a voxel is
//! set where the stored value is not zero. What a file cannot say is never guessed silently: it becomes a warning, or the
//! file is refused. Memory is bounded by what the bytes in the file can back up, not by what its header claims.

mod binvox;
mod elements;
mod npy;
mod npz;
mod nrrd;
mod raw;
mod vti;

use std::io::{self, BufReader, Cursor, Read, Seek};
use std::path::{Path, PathBuf};

use trixel::{Grid, GridError, Volume, VolumeError};

use crate::read::{Problem, empty_file};
use crate::{VolumeFormat, extension, open};

/// A volume and what was odd about its file.
#[derive(Debug)]
pub struct LoadedVolume {
    /// The volume.
    pub volume: Volume,
    /// What had to be assumed, one sentence each, without the file's name.
    pub warnings: Vec<String>,
}

/// A volume's grid and what was odd about its file.
#[derive(Debug)]
pub struct LoadedGrid {
    /// The grid.
    pub grid: Grid,
    /// What had to be assumed, one sentence each, without the file's name.
    pub warnings: Vec<String>,
}

/// Why a volume could not be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VolumeReadError {
    /// The file could not be opened or read.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// No reader for this kind of file.
    #[error(
        "{}: not a volume format that trixel reads; it reads {}",
        path.display(),
        extension::list(VolumeFormat::ALL.into_iter().filter(|f| f.is_readable()).map(VolumeFormat::extension))
    )]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// The file breaks its format's rules, or uses a part of the format that trixel does not read.
    #[error("{}: {problem}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Where and what.
        problem: Problem,
    },
    /// The volume does not fit the memory.
    #[error("{}: {source}", path.display())]
    Memory {
        /// The file.
        path: PathBuf,
        /// What is needed.
        source: VolumeError,
    },
}

/// What goes wrong inside one format's reader, which does not know the path.
#[derive(Debug)]
enum Failure {
    Io(io::Error),
    Problem(Problem),
    Memory(VolumeError),
}

impl From<Problem> for Failure {
    fn from(problem: Problem) -> Self {
        Self::Problem(problem)
    }
}

impl From<VolumeError> for Failure {
    fn from(error: VolumeError) -> Self {
        Self::Memory(error)
    }
}

impl From<GridError> for Failure {
    fn from(error: GridError) -> Self {
        Self::Problem(Problem::new("grid", error.to_string()))
    }
}

/// Decoders report damage as I/O errors too; what the system itself refuses has an error number.
impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        if error.raw_os_error().is_some() {
            Self::Io(error)
        } else if error.kind() == io::ErrorKind::UnexpectedEof {
            Self::Problem(Problem::new("data", "the file ends too early; it was cut short or its header is wrong"))
        } else {
            Self::Problem(Problem::new("data", format!("{error}; the file is damaged")))
        }
    }
}

impl Failure {
    /// The file breaks a rule.
    fn damaged(at: impl Into<String>, what: impl Into<String>) -> Self {
        Self::Problem(Problem::new(at, what))
    }

    fn at(self, path: &Path) -> VolumeReadError {
        let path = path.to_owned();
        match self {
            Self::Io(source) => VolumeReadError::Io { path, source },
            Self::Problem(problem) => VolumeReadError::Damaged { path, problem },
            Self::Memory(source) => VolumeReadError::Memory { path, source },
        }
    }
}

/// Reads of a few bytes each are served from buffers of this size.
const BUFFER_BYTES: usize = 1 << 16;

/// What a volume is read from: a file, or bytes in memory.
trait Source: Read + Seek {}

impl<T: Read + Seek> Source for T {}

/// A source, buffered.
type Reader<'a> = BufReader<Box<dyn Source + 'a>>;

/// An opened file, or bytes in memory, and its length.
struct Input<'a> {
    reader: Reader<'a>,
    bytes: u64,
}

impl<'a> Input<'a> {
    fn new(source: impl Source + 'a, bytes: u64) -> Self {
        Self { reader: BufReader::with_capacity(BUFFER_BYTES, Box::new(source)), bytes }
    }

    fn of(bytes: &'a [u8]) -> Self {
        Self::new(Cursor::new(bytes), bytes.len() as u64)
    }

    fn open(path: &Path) -> io::Result<Self> {
        let (file, bytes) = open::open(path)?;
        Ok(Self::new(file, bytes))
    }
}

/// Reads the volume at `path`; the extension picks the format. With `memory_limit`, in bytes, a grid that needs more is
/// refused before anything is allocated: a sparse `.npz` can name a grid of any size in a few bytes.
///
/// # Errors
/// When the file cannot be read, is of no format that is read, is damaged, uses a part of its format that is not
/// supported (which is then named), or needs more memory than there is.
pub fn read_volume(path: &Path, memory_limit: Option<u64>) -> Result<LoadedVolume, VolumeReadError> {
    let (format, input) = open_volume(path)?;
    read(format, path, input, || sidecar_of(path), memory_limit)
}

/// Reads a volume from the bytes of a file, where there is no file system or none to be trusted; `sidecar` holds those of
/// the `.json` file beside a `.raw` file, and is not looked at for other formats. Errors name the path
/// `<bytes>.EXTENSION`. For `memory_limit` see [`read_volume`].
///
/// # Errors
/// As [`read_volume`].
///
/// ```
/// use trixel_io::{VolumeFormat, volume_read::read_volume_bytes};
/// let bytes = b"#binvox 1\ndim 2 2 2\ntranslate 0 0 0\nscale 1\ndata\n\x00\x07\x01\x01";
/// let volume = read_volume_bytes(VolumeFormat::Binvox, bytes, None, Some(1 << 20))?.volume;
/// assert_eq!(volume.iter().collect::<Vec<_>>(), [[1, 1, 1]]);
/// assert_eq!(volume.grid().voxel_size(), [0.5; 3]);
/// # Ok::<(), trixel_io::volume_read::VolumeReadError>(())
/// ```
pub fn read_volume_bytes(
    format: VolumeFormat,
    bytes: &[u8],
    sidecar: Option<&[u8]>,
    memory_limit: Option<u64>,
) -> Result<LoadedVolume, VolumeReadError> {
    let path = PathBuf::from(format!("<bytes>.{}", format.extension()));
    let sidecar = || raw::Sidecar {
        name: "<bytes>.json".to_owned(),
        input: sidecar.map(Input::of).ok_or_else(|| io::Error::new(io::ErrorKind::NotFound, "it was not given")),
    };
    read(format, &path, Input::of(bytes), sidecar, memory_limit)
}

fn read<'a>(
    format: VolumeFormat,
    path: &Path,
    input: Input<'a>,
    sidecar: impl FnOnce() -> raw::Sidecar<'a>,
    memory_limit: Option<u64>,
) -> Result<LoadedVolume, VolumeReadError> {
    check_not_empty(path, &input)?;
    match format {
        VolumeFormat::Npz => npz::volume(input, memory_limit),
        VolumeFormat::Npy => npy::volume(input, memory_limit),
        VolumeFormat::Binvox => binvox::volume(input, memory_limit),
        VolumeFormat::Vti => vti::volume(input, memory_limit),
        VolumeFormat::Nrrd => nrrd::volume(input, memory_limit),
        VolumeFormat::Raw => raw::volume(input, sidecar(), memory_limit),
        VolumeFormat::Vox | VolumeFormat::Obj | VolumeFormat::Ply | VolumeFormat::Stl | VolumeFormat::Glb => {
            return Err(VolumeReadError::UnknownFormat { path: path.to_owned() });
        }
    }
    .map_err(|failure| failure.at(path))
}

/// The `.json` file beside a `.raw` file.
fn sidecar_of(path: &Path) -> raw::Sidecar<'static> {
    let path = path.with_extension("json");
    raw::Sidecar { name: path.display().to_string(), input: Input::open(&path) }
}

/// Reads only where the voxels of the volume at `path` are, without decoding them.
///
/// # Errors
/// As [`read_volume`], as far as the header tells.
pub fn read_grid(path: &Path) -> Result<LoadedGrid, VolumeReadError> {
    let (format, input) = open_volume(path)?;
    check_not_empty(path, &input)?;
    match format {
        VolumeFormat::Npz => npz::grid(input),
        VolumeFormat::Npy => npy::grid(input),
        VolumeFormat::Binvox => binvox::grid(input),
        VolumeFormat::Vti => vti::grid(input),
        VolumeFormat::Nrrd => nrrd::grid(input),
        VolumeFormat::Raw => raw::grid(&input, sidecar_of(path)),
        VolumeFormat::Vox | VolumeFormat::Obj | VolumeFormat::Ply | VolumeFormat::Stl | VolumeFormat::Glb => {
            return Err(VolumeReadError::UnknownFormat { path: path.to_owned() });
        }
    }
    .map_err(|failure| failure.at(path))
}

fn open_volume(path: &Path) -> Result<(VolumeFormat, Input<'static>), VolumeReadError> {
    let Some(format) = VolumeFormat::from_path(path).filter(|format| format.is_readable()) else {
        return Err(VolumeReadError::UnknownFormat { path: path.to_owned() });
    };
    let input = Input::open(path).map_err(|source| VolumeReadError::Io { path: path.to_owned(), source })?;
    Ok((format, input))
}

fn check_not_empty(path: &Path, input: &Input<'_>) -> Result<(), VolumeReadError> {
    if input.bytes == 0 {
        return Err(VolumeReadError::Damaged { path: path.to_owned(), problem: empty_file() });
    }
    Ok(())
}

/// Dimensions as the grid takes them.
fn to_dims(dims: [u64; 3]) -> Result<[u32; 3], Failure> {
    let narrow = dims.map(|n| u32::try_from(n).unwrap_or(u32::MAX));
    if narrow.iter().any(|&n| n == 0 || n > Grid::MAX_DIM) {
        return Err(GridError::Dims { dims }.into());
    }
    Ok(narrow)
}

/// Deflate makes at most this many bytes out of one (zlib's "Maximum expansion factor").
const DEFLATE_RATIO: u64 = 1032;

/// Refuses a header that promises more than the data can hold, before memory is taken for it: `bytes` of data of which
/// each makes at most `ratio` bytes, for `needed` bytes.
fn check_backing(bytes: u64, ratio: u64, needed: u64) -> Result<(), Failure> {
    if needed <= bytes.saturating_mul(ratio) {
        return Ok(());
    }
    let what = format!(
        "the header promises {needed} bytes of voxels, but the {bytes} bytes of data cannot hold them; \
         the file was cut short or its header is wrong"
    );
    Err(Failure::damaged("header", what))
}
