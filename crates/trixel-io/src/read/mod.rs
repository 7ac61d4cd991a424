//! Mesh readers: one file a format, all behind [`read_mesh`].
//!
//! A reader takes the whole file as bytes and gives a [`Mesh`] whose indices are in range and whose used positions are
//! finite, or one [`ReadError`]. It allocates in proportion to the bytes it was given, never to a count that the file
//! merely claims.

mod assemble;
mod collada;
mod gltf;
mod instances;
mod obj;
mod off;
mod ply;
mod stl;
#[cfg(test)]
mod testing;
mod threemf;
mod transform;

use std::path::{Path, PathBuf};

use trixel::Mesh;

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
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        Self::ALL.into_iter().find(|format| format.extension() == extension)
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
        "{}: unknown mesh format; trixel reads .obj, .stl, .ply, .off, .gltf, .glb, .3mf and .dae",
        path.display()
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
    /// There is no triangle in the file.
    #[error("{}: no triangles in this file", path.display())]
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

/// Reads the mesh file at `path`.
///
/// # Errors
/// When the file cannot be read, is of no known format, is damaged, or holds no triangle.
pub fn read_mesh(path: &Path, options: &ReadOptions) -> Result<Loaded, ReadError> {
    let _ = options;
    Err(ReadError::UnknownFormat { path: path.to_owned() })
}
