//! Exact mesh voxelization on any GPU, through wgpu: \[HCV\] chapter 3.
//!
//! Every strategy gives precisely the voxels that [`trixel::Mode`] defines, on every driver. The shaders need what WebGPU has
//! everywhere: 32-bit integers and floats, storage buffers, atomics, and a rasterizer; a [`Tier`] says what more they use. Floats only ever estimate, with an
//! error bound; what they leave open is decided in integers of 64 and 96 bits.
//!
//! Uploading, voxelizing and reading back are separate: [`GpuMesh`], [`Voxelizer`], [`GpuVolume`]. [`GpuBackend`] does all
//! three, as a [`trixel::Backend`].

mod adapter;
mod attributes;
mod backend;
mod counters;
mod cutoff;
mod error;
mod fill;
mod gpu;
mod kernel;
mod layout;
mod limits;
mod lists;
mod material_volume;
mod mesh;
mod passes;
mod pipelines;
mod prefix_sum;
mod probe;
mod rank;
mod scratch;
mod shader;
mod sparse;
mod targets;
mod texture;
mod tier;
mod tiles;
mod timer;
mod tune;
mod volume;
mod voxelizer;

pub use wgpu;

pub use adapter::{AdapterChoice, AdapterInfo, adapters, hardware_is_possible};
pub use attributes::{GpuAttributes, GpuSurface};
pub use backend::GpuBackend;
pub use counters::Counters;
pub use cutoff::{Cutoff, Dilation, Heuristic};
pub use error::GpuError;
pub use gpu::Gpu;
pub use limits::MAX_EXTENT;
pub use lists::{GpuVoxelList, ListMethod, UnknownListMethod};
pub use material_volume::{Decoding, MaterialTexels, MaterialVolume, Media, Medium, Precision, Slicing, VoxelMaterial};
pub use mesh::GpuMesh;
pub use sparse::{GpuBrickMap, GpuOctree, GridRay};
pub use targets::{Blend, GpuTargets, Source, Target};
pub use tier::Tier;
pub use timer::PassTime;
pub use tune::{Sample, Tuning, measure, tune};
pub use volume::{GpuVolume, Slab};
pub use voxelizer::{Classification, Options, STRATEGIES, Voxelizer, strategies_of};
