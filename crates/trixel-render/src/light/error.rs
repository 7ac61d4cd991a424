//! What can go wrong when light is rendered.

use trixel_gpu::GpuError;

/// Why a picture of light could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LightError {
    /// There is nothing to render.
    #[error("there is no triangle to render, or all of them are in one point")]
    Empty,
    /// A position or an absorption is not finite.
    #[error(transparent)]
    Mesh(#[from] trixel::MeshError),
    /// An option is out of range or not a number.
    #[error("{option} = {value} is out of range: it takes {min} to {max}")]
    Range {
        /// What it is.
        option: &'static str,
        /// Its value.
        value: f64,
        /// The least it takes.
        min: f64,
        /// The most it takes.
        max: f64,
    },
    /// More media than the shaders tell apart.
    #[error(
        "the mesh has {found} materials of different optics, and {most} at most can be told apart; give some of them the same \
         refraction index and absorption"
    )]
    TooManyMedia {
        /// How many there are.
        found: usize,
        /// How many may be.
        most: usize,
    },
    /// A panorama whose size is wrong.
    #[error(
        "a panorama of {} x {} pixels with {pixels} values is out of range: each side takes 1 to {max}, and every pixel one \
         value", size[0], size[1], max = super::Panorama::MAX_SIDE
    )]
    Panorama {
        /// Width and height.
        size: [u32; 2],
        /// Values given.
        pixels: usize,
    },
    /// A panorama's file cannot be read.
    #[error("reading the picture failed: {0}")]
    PanoramaFile(#[from] image::ImageError),
    /// A picture too large for one buffer of the GPU.
    #[error("{adapter} holds pictures of at most {most} pixels; choose a smaller --size")]
    PictureTooLarge {
        /// The adapter.
        adapter: String,
        /// The most pixels.
        most: u64,
    },
    /// A picture or volume too large for a texture.
    #[error("textures of {adapter} have at most {most} {what} along a side; choose a smaller {option}")]
    TextureTooLarge {
        /// The adapter.
        adapter: String,
        /// The most along a side.
        most: u32,
        /// Of what.
        what: &'static str,
        /// What to change.
        option: &'static str,
    },
    /// The grid cannot be.
    #[error(transparent)]
    Grid(#[from] trixel::GridError),
    /// The voxels cannot be had.
    #[error(transparent)]
    Voxels(#[from] trixel::Error),
    /// The voxels' memory cannot be had.
    #[error(transparent)]
    Volume(#[from] trixel::VolumeError),
    /// The voxels' normals cannot be had.
    #[error(transparent)]
    Attributes(#[from] trixel::attributes::AttributeError),
    /// The GPU failed.
    #[error(transparent)]
    Gpu(#[from] GpuError),
}
