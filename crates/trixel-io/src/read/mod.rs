//! Mesh readers: one file a format, all behind [`read_mesh`].
//!
//! | format | what is read |
//! |---|---|
//! | OBJ | n-gons, negative indices, vertex colours (also with alpha), normals, texture coordinates; MTL libraries beside it |
//! | STL | ASCII and binary |
//! | PLY | ASCII and both byte orders, any scalar type, polygons, tristrips, colours, normals, texture coordinates |
//! | OFF | ASCII, with normals (N), vertex colours (C) and texture coordinates (ST) |
//! | glTF, GLB | nodes, instances, strips and fans, sparse and quantized accessors, morph weights; data URIs, files beside it |
//! | 3MF | components, build transforms, the production and materials extensions |
//! | COLLADA | nodes, instances, skins and morphs in their bind or base shape, polygons, strips and fans, common materials |
//!
//! Positions are `f64` as the file has them: units and the up axis are not applied, only named in [`Mesh::up`].
//!
//! A reader takes the whole file as bytes and gives a [`Mesh`] whose indices are in range and whose used positions are
//! finite, or one [`ReadError`]. It allocates in proportion to the bytes it was given, never to a count that the file
//! merely claims.

mod assemble;
mod collada;
pub(crate) mod color;
mod directory;
pub(crate) mod gltf;
mod instances;
mod mtl;
mod obj;
mod off;
mod pieces;
mod ply;
mod ply_header;
mod polygon;
mod sniff;
mod stl;
mod stream;
#[cfg(test)]
mod testing;
mod text;
mod threemf;
mod transform;
mod vertices;

use std::io::Read;
use std::path::{Path, PathBuf};

pub use stream::MeshStream;
pub(crate) use text::shown;
use trixel::{Mesh, MeshError};

use crate::open::open;
use crate::{VolumeFormat, extension};

/// A mesh file format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum MeshFormat {
    /// Wavefront OBJ with MTL materials.
    Obj,
    /// STL, ASCII or binary.
    Stl,
    /// PLY, ASCII or binary of either byte order.
    Ply,
    /// OFF and its variants COFF, NOFF, STOFF.
    Off,
    /// glTF 2.0, JSON with buffers beside or inside it.
    Gltf,
    /// glTF 2.0 in one binary file.
    Glb,
    /// 3MF.
    ThreeMf,
    /// COLLADA.
    Collada,
}

impl MeshFormat {
    /// Every format.
    pub const ALL: [Self; 8] =
        [Self::Obj, Self::Stl, Self::Ply, Self::Off, Self::Gltf, Self::Glb, Self::ThreeMf, Self::Collada];

    /// The file extension, in lower case.
    #[must_use]
    pub fn extension(self) -> &'static str {
        match self {
            Self::Obj => "obj",
            Self::Stl => "stl",
            Self::Ply => "ply",
            Self::Off => "off",
            Self::Gltf => "gltf",
            Self::Glb => "glb",
            Self::ThreeMf => "3mf",
            Self::Collada => "dae",
        }
    }

    /// The format that a path's extension names, in any case.
    #[must_use]
    pub fn from_path(path: &Path) -> Option<Self> {
        Self::ALL.into_iter().find(|format| extension::matches(path, format.extension()))
    }
}

/// What to read.
#[derive(Clone, Debug)]
pub struct ReadOptions {
    /// Also read normals, texture coordinates, colours, materials and textures; without it positions and triangles
    /// alone, which is faster.
    pub attributes: bool,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self { attributes: true }
    }
}

/// A mesh and what was odd about its file.
#[derive(Clone, Debug, Default)]
pub struct Loaded {
    /// The mesh.
    pub mesh: Mesh,
    /// What was skipped or repaired, one sentence each, without the file's name.
    pub warnings: Vec<String>,
}

/// Why a mesh could not be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The file, or one it refers to, could not be opened or read.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// No reader for this kind of file.
    #[error(
        "{}: unknown mesh format; trixel reads {}: export the mesh as one of them",
        path.display(),
        extension::list(MeshFormat::ALL.map(MeshFormat::extension))
    )]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// The file breaks its format's rules.
    #[error("{}: {problem}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Where and what.
        problem: Problem,
    },
    /// The file holds another format than its extension says.
    #[error("{}: the file is not .{} but .{} by its content; rename it", path.display(), named.extension(), found.extension())]
    WrongExtension {
        /// The file.
        path: PathBuf,
        /// The format that the extension names.
        named: MeshFormat,
        /// The format that the first bytes are of.
        found: MeshFormat,
    },
    /// The file is one of voxels.
    #[error("{}: this is a volume, and a mesh is wanted here: its voxels are there already", path.display())]
    IsVolume {
        /// The file.
        path: PathBuf,
    },
    /// There is no triangle in the file.
    #[error("{}: there is no triangle in this file; points and curves alone have no surface", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
}

/// Where a file is damaged, or uses what trixel does not support, and how.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{at}: {what}")]
pub struct Problem {
    /// Where: "line 12", "byte 84", "accessor 3".
    pub at: String,
    /// What is wrong there and what can be done.
    pub what: String,
}

impl Problem {
    /// A problem at a place.
    pub(crate) fn new(at: impl Into<String>, what: impl Into<String>) -> Self {
        Self { at: at.into(), what: what.into() }
    }
}

/// Loads files that a mesh file refers to (materials, buffers) by the relative path written in it.
pub(crate) trait Resources {
    /// The bytes of a file beside the mesh.
    fn load(&self, relative: &str) -> std::io::Result<Vec<u8>>;

    /// The path of a file beside the mesh, for images, which are decoded later; `None` if there is no such file.
    fn locate(&self, relative: &str) -> Option<PathBuf>;
}

/// Reads the mesh file at `path`, with the files beside it that it names.
///
/// The extension picks the reader, in upper or lower case; without a known one the first bytes do.
///
/// # Errors
/// When the file cannot be read, is of no known format, is damaged, or holds no triangle.
///
/// ```
/// use trixel_io::read::{ReadOptions, read_mesh};
/// # let folder = tempfile::tempdir()?;
/// let path = folder.path().join("triangle.off");
/// std::fs::write(&path, "OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")?;
/// let loaded = read_mesh(&path, &ReadOptions::default())?;
/// assert_eq!(loaded.mesh.triangles, [[0, 1, 2]]);
/// assert!(loaded.warnings.is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read_mesh(path: &Path, options: &ReadOptions) -> Result<Loaded, ReadError> {
    let bytes = load(path).map_err(|source| ReadError::Io { path: path.to_owned(), source })?;
    let resources = directory::Directory::of(path);
    let read = |format| read_bytes(format, path, &bytes, options, &resources);
    if let Some(named) = MeshFormat::from_path(path) {
        return read(named).map_err(|error| match sniff::format_of(&bytes) {
            // Both have one reader.
            Some(found) if found != named && [found, named] != [MeshFormat::Glb, MeshFormat::Gltf] => {
                ReadError::WrongExtension { path: path.to_owned(), named, found }
            }
            _ => error,
        });
    }
    if VolumeFormat::from_path(path).is_some_and(VolumeFormat::is_readable) {
        return Err(ReadError::IsVolume { path: path.to_owned() });
    }
    match sniff::format_of(&bytes) {
        Some(format) => read(format),
        None if bytes.is_empty() => Err(damaged(path, empty_file())),
        None => Err(ReadError::UnknownFormat { path: path.to_owned() }),
    }
}

fn load(path: &Path) -> std::io::Result<Vec<u8>> {
    /// The most that is read from what has no length: a pipe, or a device, which may never end.
    const ENDLESS: u64 = 1 << 30;
    let (file, length) = open(path)?;
    // The length is a hint only, and may not even fit the memory.
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(usize::try_from(length).unwrap_or(usize::MAX))?;
    let limit = if file.metadata()?.is_file() { u64::MAX } else { ENDLESS };
    file.take(limit).read_to_end(&mut bytes)?;
    if bytes.len() as u64 == limit {
        let what = "not a regular file, and it gives more than 1 GiB; save it to a file first";
        return Err(std::io::Error::new(std::io::ErrorKind::InvalidInput, what));
    }
    Ok(bytes)
}

/// Reads a mesh from the bytes of a file of a known format, where there is no file system or none to be trusted.
///
/// Files that it refers to count as missing: buffers are an error, materials and textures a warning. Errors name the
/// path `<bytes>.EXTENSION`.
///
/// # Errors
/// When the bytes break the format's rules or hold no triangle.
pub fn read_mesh_bytes(format: MeshFormat, bytes: &[u8], options: &ReadOptions) -> Result<Loaded, ReadError> {
    let path = PathBuf::from(format!("<bytes>.{}", format.extension()));
    read_bytes(format, &path, bytes, options, &directory::Nowhere)
}

/// Runs the reader of a format, and holds what it returns to what this module promises.
fn read_bytes(
    format: MeshFormat,
    path: &Path,
    bytes: &[u8],
    options: &ReadOptions,
    resources: &dyn Resources,
) -> Result<Loaded, ReadError> {
    if bytes.is_empty() {
        return Err(damaged(path, empty_file()));
    }
    if bytes.starts_with(b"version https://git-lfs.") {
        let what = "this is Git LFS's pointer to the file, not the file itself; fetch it with `git lfs pull`";
        return Err(damaged(path, Problem::new("start", what)));
    }
    let read = match format {
        MeshFormat::Obj => obj::read,
        MeshFormat::Stl => stl::read,
        MeshFormat::Ply => ply::read,
        MeshFormat::Off => off::read,
        MeshFormat::Gltf | MeshFormat::Glb => gltf::read,
        MeshFormat::ThreeMf => threemf::read,
        MeshFormat::Collada => collada::read,
    };
    let loaded = read(bytes, options, resources).map_err(|problem| damaged(path, problem))?;
    check_loaded(path, &loaded)?;
    Ok(loaded)
}

/// Reads glTF with what moves it.
pub(crate) fn read_gltf_animated(path: &Path, options: &ReadOptions) -> Result<(Loaded, gltf::Rig), ReadError> {
    let bytes = load(path).map_err(|source| ReadError::Io { path: path.to_owned(), source })?;
    let read = gltf::read_animated(&bytes, options, &directory::Directory::of(path));
    let (loaded, rig) = read.map_err(|problem| damaged(path, problem))?;
    check_loaded(path, &loaded)?;
    Ok((loaded, rig))
}

/// Holds what a reader returned to what this module promises.
fn check_loaded(path: &Path, loaded: &Loaded) -> Result<(), ReadError> {
    if loaded.mesh.triangles.is_empty() {
        return Err(ReadError::Empty { path: path.to_owned() });
    }
    check(&loaded.mesh).map_err(|error| damaged(path, problem_of(&error)))
}

/// Warns of things by name, of many only of the first few.
pub(crate) fn warn_of(warnings: &mut Vec<String>, names: &[String], kind: &str, what: &str) {
    const NAMED: usize = 5;
    for name in names.iter().take(NAMED) {
        warnings.push(format!("the {kind} `{name}` is {what}"));
    }
    if names.len() > NAMED {
        warnings.push(format!("{} more warnings like the last, each about another {kind}", names.len() - NAMED));
    }
}

fn damaged(path: &Path, problem: Problem) -> ReadError {
    ReadError::Damaged { path: path.to_owned(), problem }
}

pub(crate) fn empty_file() -> Problem {
    Problem::new("start", "the file is empty (0 bytes)")
}

/// [`Mesh::check`], several times faster for meshes that pass.
fn check(mesh: &Mesh) -> Result<(), MeshError> {
    // In both passes without branches, so that they run at memory speed.
    let highest = mesh.triangles.iter().flatten().fold(0, |highest, &vertex| highest.max(vertex));
    let finite = |position: &[f64; 3]| position.iter().fold(true, |all, c| all & c.is_finite());
    let all_finite =
        mesh.positions.as_chunks::<256>().0.iter().all(|chunk| chunk.iter().fold(true, |all, p| all & finite(p)))
            && mesh.positions.as_chunks::<256>().1.iter().all(finite);
    // A vertex that no triangle uses may be anything: the full check decides.
    if (highest as usize) < mesh.positions.len() && all_finite && u32::try_from(mesh.positions.len()).is_ok() {
        return Ok(());
    }
    mesh.check()
}

/// A mesh error as a place and a problem.
fn problem_of(error: &MeshError) -> Problem {
    match error {
        MeshError::IndexOutOfRange { triangle, vertex, vertices } => Problem::new(
            format!("triangle {triangle}"),
            format!("names vertex {vertex}, but the file has only {vertices} vertices, counted from 0; it is damaged"),
        ),
        MeshError::NotFinite { vertex, position: [x, y, z] } => Problem::new(
            format!("vertex {vertex} (counted from 0)"),
            format!("its position ({x}, {y}, {z}) is not finite; repair or remove it"),
        ),
        other => Problem::new("mesh", other.to_string()),
    }
}
