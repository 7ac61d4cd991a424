//! Textures of voxels and panoramas.

use half::f16;
use trixel_gpu::{Gpu, GpuError, wgpu};

use super::super::environment::Panorama;
use super::super::error::LightError;

/// What a texture is made of.
pub(super) struct Texels<'a> {
    pub(super) dimension: wgpu::TextureDimension,
    pub(super) size: [u32; 3],
    pub(super) format: wgpu::TextureFormat,
    pub(super) bytes: &'a [u8],
}

impl Texels<'static> {
    /// One black pixel, where something must be bound.
    pub(super) fn dark() -> Self {
        let (dimension, format) = (wgpu::TextureDimension::D2, wgpu::TextureFormat::Rgba16Float);
        Self { dimension, size: [1; 3], format, bytes: &[0; 8] }
    }
}

/// Makes a texture of texels, which follow one another without gaps.
pub(super) fn upload(gpu: &Gpu, texels: &Texels<'_>) -> Result<wgpu::Texture, GpuError> {
    let Texels { dimension, size: [width, height, depth], format, bytes } = *texels;
    let size = wgpu::Extent3d { width, height, depth_or_array_layers: depth };
    gpu.guarded(|| {
        let texture = gpu.device().create_texture(&wgpu::TextureDescriptor {
            label: Some("trixel light"),
            size,
            mip_level_count: 1,
            sample_count: 1,
            dimension,
            format,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let texel_bytes = format.block_copy_size(None).unwrap_or(1);
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(width * texel_bytes),
            rows_per_image: Some(height),
        };
        gpu.queue().write_texture(texture.as_image_copy(), bytes, layout, size);
        texture
    })
}

/// Voxels of four bytes or half floats each, x fastest.
pub(super) fn voxels(
    gpu: &Gpu,
    size: [u32; 3],
    format: wgpu::TextureFormat,
    bytes: &[u8],
) -> Result<wgpu::Texture, LightError> {
    let most = gpu.device().limits().max_texture_dimension_3d;
    if size.iter().any(|&side| side > most) {
        let adapter = gpu.info().to_string();
        return Err(LightError::TextureTooLarge { adapter, most, what: "voxels", option: "--resolution" });
    }
    Ok(upload(gpu, &Texels { dimension: wgpu::TextureDimension::D3, size, format, bytes })?)
}

pub(super) fn panorama(gpu: &Gpu, panorama: &Panorama) -> Result<wgpu::Texture, GpuError> {
    let texel = |p: &[f32; 3]| [f16::from_f32(p[0]), f16::from_f32(p[1]), f16::from_f32(p[2]), f16::ONE];
    let texels: Vec<_> = panorama.pixels.iter().map(texel).collect();
    let [width, height] = panorama.size;
    let (dimension, format) = (wgpu::TextureDimension::D2, wgpu::TextureFormat::Rgba16Float);
    upload(gpu, &Texels { dimension, size: [width, height, 1], format, bytes: bytemuck::cast_slice(&texels) })
}

pub(super) fn whole(texture: &wgpu::Texture) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

/// A sampler that mixes neighbours; along the first axis it does at the ends what `first_axis` says.
pub(super) fn sampler(gpu: &Gpu, first_axis: wgpu::AddressMode) -> wgpu::Sampler {
    gpu.device().create_sampler(&wgpu::SamplerDescriptor {
        label: Some("trixel light"),
        address_mode_u: first_axis,
        mag_filter: wgpu::FilterMode::Linear,
        min_filter: wgpu::FilterMode::Linear,
        ..Default::default()
    })
}
