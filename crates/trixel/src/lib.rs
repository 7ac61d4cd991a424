//! Exact mesh voxelization.

mod backend;
#[cfg(any(test, feature = "conformance"))]
pub mod conformance;
mod cpu;
mod grid;
mod job;
pub mod lattice;
mod material;
mod mesh;
mod mode;
pub mod scene;
mod topology;
mod volume;

pub use backend::{Backend, Error, voxelize};
pub use cpu::{CpuBackend, ThreadsError};
pub use grid::{Grid, GridError};
pub use job::{Job, JobError, Strategy};
pub use material::{AlphaMode, Filter, Image, ImageSource, Material, Texture, TextureRef, Wrap};
pub use mesh::{Attribute, Bounds, Mesh, MeshError, UpAxis};
pub use mode::Mode;
pub use topology::Topology;
pub use volume::{Bytes, Volume, VolumeError, WORD_BITS, set_bits};
