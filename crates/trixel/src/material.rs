//! Materials, textures and images: read with a mesh, used when voxels get attributes.

use std::path::PathBuf;

/// A surface material, after glTF's metallic-roughness model; other formats are mapped onto it.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// The name in the file, or empty.
    pub name: String,
    /// Base colour, linear RGBA; multiplied by the texture and the vertex colour.
    pub base_color: [f32; 4],
    /// Texture of the base colour (sRGB).
    pub base_color_texture: Option<TextureRef>,
    /// Metalness, 0 to 1.
    pub metallic: f32,
    /// Roughness, 0 to 1.
    pub roughness: f32,
    /// Texture of roughness (green) and metalness (blue), linear.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Emitted light, linear RGB.
    pub emissive: [f32; 3],
    /// Texture of the emitted light (sRGB).
    pub emissive_texture: Option<TextureRef>,
    /// Texture of opacity alone (OBJ's `map_d`), linear: the red channel.
    pub opacity_texture: Option<TextureRef>,
    /// What alpha means.
    pub alpha_mode: AlphaMode,
    /// Whether the back faces are meant to be seen.
    pub double_sided: bool,
    /// Share of light that passes through the surface, 0 to 1.
    pub transmission: f32,
    /// Index of refraction.
    pub index_of_refraction: f32,
}

impl Default for Material {
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: [1.0; 4],
            base_color_texture: None,
            metallic: 0.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            emissive: [0.0; 3],
            emissive_texture: None,
            opacity_texture: None,
            alpha_mode: AlphaMode::Opaque,
            double_sided: false,
            transmission: 0.0,
            index_of_refraction: 1.5,
        }
    }
}

/// What a material's alpha means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AlphaMode {
    /// Alpha is ignored.
    Opaque,
    /// Texels with alpha below the cutoff are not there.
    Mask {
        /// The cutoff.
        cutoff: f32,
    },
    /// Alpha blends.
    Blend,
}

/// A texture as a material uses it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// Index into [`crate::Mesh::textures`].
    pub texture: u32,
    /// Index into [`crate::Mesh::uvs`].
    pub uv_set: u32,
    /// Affine map of the texture coordinates, rows `[a, b, c]` of `u' = a u + b v + c` and the same for `v'`.
    pub transform: [[f32; 3]; 2],
}

impl TextureRef {
    /// Texture `texture` with the first set of coordinates, not transformed.
    #[must_use]
    pub fn new(texture: u32) -> Self {
        Self { texture, uv_set: 0, transform: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] }
    }
}

/// An image and how it is sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Texture {
    /// Index into [`crate::Mesh::images`].
    pub image: u32,
    /// What happens outside [0, 1], along u and v.
    pub wrap: [Wrap; 2],
    /// How texels are combined.
    pub filter: Filter,
    /// Whether a texture that is finer than the voxels is averaged first, as samplers with mipmaps do.
    pub mipmaps: bool,
}

/// What a sampler does outside [0, 1].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Wrap {
    /// Start again.
    #[default]
    Repeat,
    /// Back and forth.
    Mirror,
    /// Keep the edge's texel.
    Clamp,
}

/// How a sampler combines texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Filter {
    /// The nearest texel.
    Nearest,
    /// Bilinear.
    #[default]
    Linear,
}

/// A picture, not yet decoded: decoding waits until an attribute needs it.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// The name or path in the file, for messages.
    pub name: String,
    /// Where the pixels are.
    pub source: ImageSource,
}

/// Where an image's pixels are.
#[derive(Clone, Debug, PartialEq)]
pub enum ImageSource {
    /// A file beside the mesh.
    File(PathBuf),
    /// Encoded bytes (PNG, JPEG, ...) that the mesh file itself held.
    Encoded(Vec<u8>),
    /// Decoded pixels.
    Rgba8 {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// Rows from the top, four bytes a pixel.
        pixels: Vec<u8>,
    },
}
