//! Materials as texels.

use bytemuck::{Pod, Zeroable};
use half::f16;

use super::medium::{Media, Medium};

/// The format of a [`super::MaterialVolume`]'s texels, four numbers each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Precision {
    /// `Rgba8Unorm`: 4 bytes a texel.
    Eight,
    /// `Rgba16Float`: 8 bytes.
    #[default]
    Half,
    /// `Rgba32Float`: 16 bytes, as in \[CL\] section 4. Not filterable on every device.
    Full,
}

impl Precision {
    /// Every precision.
    pub const ALL: [Self; 3] = [Self::Eight, Self::Half, Self::Full];

    /// The textures' format.
    #[must_use]
    pub fn format(self) -> wgpu::TextureFormat {
        match self {
            Self::Eight => wgpu::TextureFormat::Rgba8Unorm,
            Self::Half => wgpu::TextureFormat::Rgba16Float,
            Self::Full => wgpu::TextureFormat::Rgba32Float,
        }
    }

    /// The same in WGSL.
    pub(crate) fn wgsl_format(self) -> &'static str {
        match self {
            Self::Eight => "rgba8unorm",
            Self::Half => "rgba16float",
            Self::Full => "rgba32float",
        }
    }

    pub(crate) fn texel_bytes_u32(self) -> u32 {
        match self {
            Self::Eight => 4,
            Self::Half => 8,
            Self::Full => 16,
        }
    }

    pub(super) fn texel_bytes(self) -> usize {
        self.texel_bytes_u32() as usize
    }

    pub(super) fn append(self, texel: [f32; 4], out: &mut Vec<u8>) {
        for channel in texel {
            match self {
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
                Self::Eight => out.push((channel.clamp(0.0, 1.0) * 255.0).round() as u8),
                Self::Half => out.extend(f16::from_f32(channel).to_le_bytes()),
                Self::Full => out.extend(channel.to_le_bytes()),
            }
        }
    }

    /// The first texel of some bytes; zeros where there are too few.
    pub(super) fn texel(self, bytes: &[u8]) -> [f32; 4] {
        std::array::from_fn(|channel| match self {
            Self::Eight => bytes.get(channel).map_or(0.0, |byte| f32::from(*byte) / 255.0),
            Self::Half => bytes.as_chunks().0.get(channel).map_or(0.0, |bytes| f16::from_le_bytes(*bytes).to_f32()),
            Self::Full => bytes.as_chunks().0.get(channel).map_or(0.0, |bytes| f32::from_le_bytes(*bytes)),
        })
    }
}

/// What is in a voxel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoxelMaterial {
    /// Whether a surface is.
    pub exists: bool,
    /// The surface's unit normal in the world's space.
    pub normal: [f32; 3],
    /// Linear base colour and opacity.
    pub color: [f32; 4],
    /// The medium; `None` where there is neither surface nor filling.
    pub medium: Option<Medium>,
    /// Whether a fill found it inside a solid.
    pub inside: bool,
}

impl Default for VoxelMaterial {
    /// Air.
    fn default() -> Self {
        Self { exists: false, normal: [0.0; 3], color: [0.0; 4], medium: None, inside: false }
    }
}

/// What a shader multiplies texels with, laid out as a uniform of four `f32`:
///
/// ```wgsl
/// normal = normalize(surface.rgb * d.normal_scale - surface.a * d.normal_offset);
/// absorption = medium.r * d.absorption_scale;
/// refraction_index = 1.0 + medium.g * d.index_scale;
/// ```
///
/// Filtered texels decode the same way, before the normalization; between a surface and air they are premultiplied.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Decoding {
    /// Multiplies a normal's texel.
    pub normal_scale: f32,
    /// Subtracted for each existing voxel.
    pub normal_offset: f32,
    /// Multiplies absorption.
    pub absorption_scale: f32,
    /// Multiplies the index of refraction less 1.
    pub index_scale: f32,
}

/// A precision, and what 1 means in 8 bits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Encoding {
    pub(crate) precision: Precision,
    absorption: f32,
    index: f32,
}

impl Encoding {
    pub(crate) fn new(precision: Precision, media: &Media) -> Self {
        if precision != Precision::Eight {
            return Self { precision, absorption: 1.0, index: 1.0 };
        }
        let largest = |of: fn(&Medium) -> f32| {
            let most = media.iter().map(of).filter(|value| value.is_finite()).fold(0.0, f32::max);
            if most > 0.0 { most } else { 1.0 }
        };
        Self {
            precision,
            absorption: largest(|medium| medium.absorption),
            index: largest(|medium| medium.refraction_index - 1.0),
        }
    }

    pub(crate) fn decoding(&self) -> Decoding {
        let [normal_scale, normal_offset] = if self.precision == Precision::Eight { [2.0, 1.0] } else { [1.0, 0.0] };
        Decoding { normal_scale, normal_offset, absorption_scale: self.absorption, index_scale: self.index }
    }

    /// Texels of surface, colour and medium, before they are rounded to the precision.
    pub(super) fn encode(&self, voxel: &VoxelMaterial) -> [[f32; 4]; 3] {
        let decoding = self.decoding();
        let mut texels = [[0.0; 4]; 3];
        if voxel.exists {
            let [x, y, z] = voxel.normal.map(|c| (c + decoding.normal_offset) / decoding.normal_scale);
            texels[0] = [x, y, z, 1.0];
            texels[1] = voxel.color;
        }
        if let Some(Medium { absorption, refraction_index }) = voxel.medium {
            let inside = f32::from(u8::from(voxel.inside));
            texels[2] = [absorption / self.absorption, (refraction_index - 1.0) / self.index, inside, 1.0];
        }
        texels
    }

    pub(super) fn decode(&self, [surface, color, medium]: [[f32; 4]; 3]) -> VoxelMaterial {
        let decoding = self.decoding();
        let exists = surface[3] > 0.5;
        VoxelMaterial {
            exists,
            normal: std::array::from_fn(|i| surface[i] * decoding.normal_scale - surface[3] * decoding.normal_offset),
            color,
            medium: (medium[3] > 0.5).then_some(Medium {
                absorption: medium[0] * self.absorption,
                refraction_index: 1.0 + medium[1] * self.index,
            }),
            inside: medium[2] > 0.5,
        }
    }
}
