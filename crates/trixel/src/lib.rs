//! Exact mesh voxelization.

mod grid;
pub mod lattice;
mod material;
mod mesh;
mod mode;
pub mod scene;
mod volume;

pub use grid::{Grid, GridError};
pub use material::{AlphaMode, Filter, Image, ImageSource, Material, Texture, TextureRef, Wrap};
pub use mesh::{Attribute, Bounds, Mesh, MeshError, UpAxis};
pub use mode::Mode;
pub use volume::{Bytes, Volume, VolumeError, WORD_BITS, set_bits};
