//! Volume writers: one file a format, all behind [`write_volume`].
//!
//! Every writer streams: it takes memory in proportion to a slab of the grid (the surface formats: to the surface),
//! never to the grid. The bytes written depend on the volume and the options alone, not on time or threads.
//!
//! | format | voxels | where the grid is |
//! |---|---|---|
//! | `.npz` | `occupancy[x, y, z]` or `indices`; attributes | arrays `origin`, `voxel_size` |
//! | `.npy` | `[x, y, z]` | not in the file |
//! | `.binvox` | padded to a cube at the high ends | `translate`, `scale` |
//! | `.vox` | one colour, or at most 255, z up, centred | attributes of the root node; the editor knows only whole voxels |
//! | `.vti` | cell data `occupancy`, and attributes | `Origin`, `Spacing` |
//! | `.nrrd` | x fastest | `space origin` (centre of the first voxel), `space directions` |
//! | `.obj`, `.ply` | exposed faces, coloured, in mesh coordinates, f64 | the coordinates, and comments |
//! | `.stl` | exposed faces in mesh coordinates, f32 | the coordinates |
//! | `.glb` | exposed faces, coloured, from the grid's origin, f32 | the node's matrix (y up), and `extras` |
//! | `.raw` | `[x, y, z]`, one byte each | `.json` file beside it |

mod binvox;
mod colored;
mod columns;
mod deflate;
mod dense;
mod glb;
mod little_endian;
mod npy_header;
mod npz;
mod nrrd;
mod obj;
mod palette;
mod ply;
mod raw;
mod sparse_blocks;
mod stl;
mod surface;
mod vox;
mod vti;
mod x_fastest;

use std::io;
use std::path::{Path, PathBuf};

use trixel::attributes::Described;
use trixel::{BrickMap, Grid, Occupancy, UpAxis, Volume};

pub use crate::atomic_file::{CommitError, Staged};
pub use crate::volume_format::VolumeFormat;
pub use npz::NpzWriter;

use crate::atomic_file::AtomicFile;
use crate::extension;

/// How to write.
#[derive(Clone, Copy)]
pub struct WriteOptions<'a> {
    /// The axis of the mesh that points up: `.vox` files are turned so that it is z, `.glb` files so that it is y.
    pub up: UpAxis,
    /// Write `.npz` as a list of the set voxels instead of a dense array, and `.ply` as points at their centres instead of
    /// faces.
    pub sparse: bool,
    /// What is in the voxels, for the formats that can tell: `.npz` and `.vti` write every attribute; `.vox`, `.ply`,
    /// `.obj` and `.glb` show colours, and like `.stl` leave out what the alpha test cut out.
    pub described: Option<Described<'a>>,
    /// Called now and then, from the calling thread, with the fraction that is done.
    pub progress: Option<&'a dyn Fn(f32)>,
}

impl Default for WriteOptions<'_> {
    fn default() -> Self {
        Self { up: UpAxis::Z, sparse: false, described: None, progress: None }
    }
}

impl WriteOptions<'_> {
    /// Tells that `done` of `total` is done.
    #[expect(clippy::cast_precision_loss, clippy::cast_possible_truncation, reason = "a fraction for people")]
    fn report(&self, done: u64, total: u64) {
        if let Some(progress) = self.progress {
            progress((done as f64 / total.max(1) as f64) as f32);
        }
    }
}

/// Why a volume could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// No writer for this kind of file.
    #[error(
        "{}: unknown volume format; trixel writes {}",
        path.display(),
        extension::list(VolumeFormat::ALL.map(VolumeFormat::extension))
    )]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// The target's folder does not exist.
    #[error("cannot write {}: there is no folder {}; create it first", path.display(), folder.display())]
    NoFolder {
        /// The file.
        path: PathBuf,
        /// The missing folder.
        folder: PathBuf,
    },
    /// The target is a folder.
    #[error("cannot write {}: a folder has this name; choose another", path.display())]
    IsFolder {
        /// The file.
        path: PathBuf,
    },
    /// The system refused.
    #[error("cannot write {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The format cannot hold this volume.
    #[error("{}: {problem}", path.display())]
    Limit {
        /// The file.
        path: PathBuf,
        /// What the format cannot hold and what to do.
        problem: String,
    },
}

/// What goes wrong inside one format's writer, which does not know the path.
#[derive(Debug)]
enum Failure {
    Io(io::Error),
    Limit(String),
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

impl Failure {
    fn at(self, path: &Path) -> WriteError {
        let path = path.to_owned();
        match self {
            Self::Io(source) => WriteError::Io { path, source },
            Self::Limit(problem) => WriteError::Limit { path, problem },
        }
    }
}

/// Checks what can be known before there is a volume: the extension, that the folder can be written, and the limits of
/// the format.
///
/// # Errors
/// What [`write_volume`] would fail with.
pub fn check_target(path: &Path, grid: &Grid) -> Result<(), WriteError> {
    let Some(format) = VolumeFormat::from_path(path) else {
        return Err(WriteError::UnknownFormat { path: path.to_owned() });
    };
    check_limits(format, grid).map_err(|problem| Failure::Limit(problem).at(path))?;
    // Dropped at once, which removes it.
    open(path).map(drop)
}

/// Writes `volume` to a temporary file beside `path`; [`Staged::commit`] gives it its name. The extension picks the
/// format. A `.raw` file comes with a `.json` file of the same stem.
///
/// # Errors
/// When the format is unknown or cannot hold the volume, or the system refuses. Nothing is left behind then.
///
/// ```
/// use trixel::{Grid, Volume};
/// use trixel_io::write::{WriteOptions, write_volume};
///
/// let mut volume = Volume::new(Grid::new([0.0; 3], [0.5; 3], [4, 4, 8])?)?;
/// volume.set([1, 2, 3]);
/// # let folder = tempfile::tempdir()?;
/// # let folder = folder.path();
/// let (surface, data) = (folder.join("voxel.glb"), folder.join("voxel.nrrd"));
/// // Both files appear, or neither.
/// let staged = write_volume(&surface, &volume, &WriteOptions::default())?;
/// staged.join(write_volume(&data, &volume, &WriteOptions::default())?).commit()?;
/// assert!(surface.is_file() && data.is_file());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_volume(path: &Path, volume: &Volume, options: &WriteOptions<'_>) -> Result<Staged, WriteError> {
    let Some(format) = VolumeFormat::from_path(path) else {
        return Err(WriteError::UnknownFormat { path: path.to_owned() });
    };
    check_limits(format, volume.grid()).map_err(|problem| Failure::Limit(problem).at(path))?;
    let mut file = open(path)?;
    let out = &mut file;
    let shown = match (format, options.described) {
        (
            VolumeFormat::Vox | VolumeFormat::Obj | VolumeFormat::Ply | VolumeFormat::Stl | VolumeFormat::Glb,
            Some(described),
        ) => described.without_cut_out().map_err(|error| Failure::Limit(error.to_string()).at(path))?,
        _ => None,
    };
    let volume = shown.as_ref().unwrap_or(volume);
    match format {
        _ if options.sparse && format.takes_bricks() => write_voxels(format, volume, options, out),
        VolumeFormat::Npz => npz::write(volume, options, out).map_err(Failure::Io),
        VolumeFormat::Npy => dense::write_npy(volume, options, out).map_err(Failure::Io),
        VolumeFormat::Binvox => binvox::write(volume, options, out).map_err(Failure::Io),
        VolumeFormat::Vox => vox::write(volume, options, out),
        VolumeFormat::Vti => vti::write(volume, options, out).map_err(Failure::Io),
        VolumeFormat::Nrrd => nrrd::write(volume, options, out).map_err(Failure::Io),
        VolumeFormat::Obj => obj::write(volume, options, out),
        VolumeFormat::Ply => ply::write(volume, options, out),
        VolumeFormat::Stl => stl::write(volume, options, out),
        VolumeFormat::Glb => glb::write(volume, options, out),
        VolumeFormat::Raw => dense::write_raw(volume, options, out).map_err(Failure::Io),
    }
    .map_err(|failure| failure.at(path))?;
    let mut staged = stage(file, path)?;
    if format == VolumeFormat::Raw {
        let sidecar = path.with_extension("json");
        let mut file = open(&sidecar)?;
        raw::write_sidecar(volume, path, &mut file).map_err(|error| Failure::Io(error).at(&sidecar))?;
        staged = staged.join(stage(file, &sidecar)?);
    }
    options.report(1, 1);
    Ok(staged)
}

/// [`write_volume`] for bricks, in the formats that take them (see [`VolumeFormat::takes_bricks`]): `.npz` as `indices`,
/// `.ply` as points, `.vox`.
///
/// # Errors
/// As [`write_volume`]; other formats are refused.
pub fn write_bricks(path: &Path, bricks: &BrickMap, options: &WriteOptions<'_>) -> Result<Staged, WriteError> {
    let Some(format) = VolumeFormat::from_path(path) else {
        return Err(WriteError::UnknownFormat { path: path.to_owned() });
    };
    check_limits(format, bricks.grid()).map_err(|problem| Failure::Limit(problem).at(path))?;
    let mut file = open(path)?;
    write_voxels(format, bricks, options, &mut file).map_err(|failure| failure.at(path))?;
    options.report(1, 1);
    stage(file, path)
}

/// Writes voxels that need not be dense.
fn write_voxels(
    format: VolumeFormat,
    voxels: &impl Occupancy,
    options: &WriteOptions<'_>,
    out: &mut AtomicFile,
) -> Result<(), Failure> {
    match format {
        VolumeFormat::Npz => npz::write_sparse(voxels, options, out).map_err(Failure::Io),
        VolumeFormat::Ply => ply::write_points(voxels, options, out).map_err(Failure::Io),
        VolumeFormat::Vox => vox::write(voxels, options, out),
        _ => Err(Failure::Limit(format!(
            ".{} files hold whole grids, and this grid is voxelized into bricks because it is too large or because \
             of --sparse; write .{}",
            format.extension(),
            extension::list(VolumeFormat::ALL.into_iter().filter(|f| f.takes_bricks()).map(VolumeFormat::extension))
        ))),
    }
}

fn check_limits(format: VolumeFormat, grid: &Grid) -> Result<(), String> {
    match format {
        VolumeFormat::Binvox => binvox::check(grid),
        VolumeFormat::Vox => vox::check(grid),
        VolumeFormat::Stl => stl::check(grid),
        VolumeFormat::Glb => glb::check(grid),
        _ => Ok(()),
    }
}

fn open(path: &Path) -> Result<AtomicFile, WriteError> {
    let folder = match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    if !folder.is_dir() {
        return Err(WriteError::NoFolder { path: path.to_owned(), folder: folder.to_owned() });
    }
    if path.is_dir() {
        return Err(WriteError::IsFolder { path: path.to_owned() });
    }
    AtomicFile::create(path).map_err(|error| Failure::Io(error).at(path))
}

fn stage(file: AtomicFile, path: &Path) -> Result<Staged, WriteError> {
    file.stage().map_err(|error| Failure::Io(error).at(path))
}
