//! Exact mesh voxelization: the library.
//!
//! A [`Mesh`] is snapped to the lattice of a [`Grid`] and voxelized by a [`Backend`] into a [`Volume`], one bit a voxel.
//! Each [`Mode`] has one definition in integers, so there is one right answer, whatever the backend, strategy or number of
//! threads. It follows and extends
//!
//! - **\[HCV\]** R. Rauwendaal, *Hybrid Computational Voxelization Using the Graphics Pipeline*, MSc thesis, Oregon State
//!   University, 2012
//! - **\[CL\]** H.-H. Chang and Y.-C. Lai, *Real-time GPU-based Voxelization and Applications*, TR 1688, 2011
//!
//! ```
//! use trixel::{Grid, Job, Mode};
//!
//! let mesh = trixel::scene::build("torus:64")?;
//! let bounds = mesh.bounds().expect("a torus has triangles");
//! let job = Job::new(Grid::fit(&bounds, 100)?, Mode::Solid);
//! let volume = trixel::voxelize(&mesh, &job)?;
//! assert!(volume.get([15, 50, 14]) && !volume.get([50, 50, 14]));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! To voxelize many times into one volume, use the steps: [`lattice::LatticeMesh::snap`], [`Volume::new`] and
//! [`CpuBackend`]'s [`Backend::voxelize`].
//!
//! # Features
//!
//! - `threads` (default): rayon. Without it everything runs on the calling thread.
//! - `conformance`: the oracle and the suite for those who write a backend.

#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;

pub mod attributes;
mod backend;
mod bricks;
#[cfg(any(test, feature = "conformance"))]
pub mod conformance;
mod cpu;
pub mod fill;
mod frame;
mod grid;
mod job;
pub mod lattice;
mod material;
mod mesh;
mod mode;
pub mod octree;
mod rank;
pub mod scene;
mod topology;
mod volume;

pub use backend::{Backend, Error, voxelize};
pub use bricks::{BrickMap, Occupancy};
pub use cpu::{BinnedMesh, CpuBackend, Instructions, ThreadsError};
pub use frame::{Frame, FrameError, FramedMesh};
pub use grid::{Grid, GridError};
pub use job::{Job, JobError, Strategy};
pub use material::{AlphaMode, Filter, Image, ImageSource, Material, Texture, TextureRef, Wrap};
pub use mesh::{Attribute, Bounds, Mesh, MeshError, UpAxis};
pub use mode::Mode;
pub use rank::{Rank, VoxelOrder, morton, voxel_list};
pub use topology::Topology;
pub use volume::{Bytes, Volume, VolumeError, WORD_BITS, set_bits};
