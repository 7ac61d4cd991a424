//! Mesh readers and volume writers, one file a format.
//!
//! - [`read::read_mesh`] reads a mesh, with materials and what else shades it; the extension or the first bytes pick the
//!   reader.
//! - [`animation::read_animated`] reads a mesh that deforms: skins, morph targets and animations of glTF.
//! - [`textures::decode_textures`] decodes the images that materials name, when colours are wanted.
//! - [`write::write_volume`] writes a volume in the format that the extension names; the table in [`mod@write`] says what
//!   each format keeps.
//! - [`volume_read::read_volume`] reads a volume back, also from other programs, and [`volume_read::read_grid`] only
//!   where its voxels are.
//! - [`out_of_core`] voxelizes meshes and grids that do not fit the memory, into Zarr (feature `zarr`, on by default).
//!
//! Readers trust nothing: a damaged or hostile file gives an error that names the file, the place in it and what to do,
//! never a panic, a hang or unbounded memory. What is odd but harmless becomes a warning beside the result. Files are
//! written whole or not at all: see [`atomic_file`].
//!
//! From a mesh file to a volume file and back:
//!
//! ```
//! use trixel::{Grid, Job, Mode, voxelize};
//! use trixel_io::read::{ReadOptions, read_mesh};
//! use trixel_io::volume_read::read_volume;
//! use trixel_io::write::{WriteOptions, write_volume};
//!
//! # let folder = tempfile::tempdir()?;
//! # let folder = folder.path();
//! std::fs::write(folder.join("triangle.off"), "OFF 3 1 0\n0 0 0\n4 0 0\n0 4 1\n3 0 1 2\n")?;
//!
//! let mesh = read_mesh(&folder.join("triangle.off"), &ReadOptions::default())?.mesh;
//! let grid = Grid::fit(&mesh.bounds().ok_or("no vertices")?, 8)?;
//! let volume = voxelize(&mesh, &Job::new(grid, Mode::Conservative))?;
//! write_volume(&folder.join("triangle.npz"), &volume, &WriteOptions::default())?.commit()?;
//!
//! let loaded = read_volume(&folder.join("triangle.npz"), None)?;
//! assert_eq!(loaded.volume, volume);
//! assert!(loaded.warnings.is_empty());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod animation;
pub mod atomic_file;
mod bits;
mod extension;
mod numbers;
mod open;
#[cfg(feature = "zarr")]
pub mod out_of_core;
pub mod read;
pub mod textures;
mod volume_format;
pub mod volume_read;
pub mod write;
mod xml;

pub use volume_format::{AttributeSupport, VolumeFormat};
