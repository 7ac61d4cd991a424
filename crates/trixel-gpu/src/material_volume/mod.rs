//! What is in each voxel, as 3D textures: existence, normal, colour, absorption and index of refraction.
//!
//! H.-H. Chang and Y.-C. Lai, *Real-time GPU-based Voxelization and Applications*, 2011, sections 2.1 and 2.2: a texel of a 3D
//! texture holds a voxel, in a format of the application's choice, and lighting effects read it where it is.

mod encoding;
mod faces;
mod from_attributes;
mod medium;
mod sliced;

pub use encoding::{Decoding, Precision, VoxelMaterial};
pub use medium::{Media, Medium};
pub use sliced::Slicing;

pub(crate) use encoding::Encoding;

use trixel::Frame;

use crate::error::GpuError;
use crate::gpu::Gpu;

/// 3D textures of the materials of a frame's voxels. Texel `(x, y, z)` is voxel `[x, y, z]` of the [`Frame`]: x fastest in
/// memory, slices along z.
///
/// | texture | r, g, b | a |
/// |---|---|---|
/// | [`surface`](Self::surface) | the surface's unit normal, in the world's space | 1 where a surface is in the voxel, else 0 |
/// | [`color`](Self::color) | linear base colour | opacity of the material |
/// | [`medium`](Self::medium) | r: absorption per world unit of length; g: index of refraction - 1; b: 1 where the voxel is inside a solid, once filled | 1 where r and g mean something: at surfaces and inside |
///
/// All texels of empty voxels are 0, which in `medium` is air. 8-bit texels hold normals and the medium scaled:
/// [`decoding`](Self::decoding) undoes that, in the same way for each precision and also for filtered texels.
///
/// The textures have usages `TEXTURE_BINDING`, `STORAGE_BINDING` (write), `RENDER_ATTACHMENT` and both copies. Those of
/// [`Precision::Full`] cannot be filtered on every device (WebGPU's `float32-filterable`), the others can.
#[derive(Debug)]
pub struct MaterialVolume {
    frame: Frame,
    encoding: Encoding,
    surface: wgpu::Texture,
    color: wgpu::Texture,
    medium: wgpu::Texture,
}

/// The texels of a [`MaterialVolume`] in memory.
#[derive(Clone, Debug)]
pub struct MaterialTexels {
    dims: [u32; 3],
    encoding: Encoding,
    /// Of surface, colour and medium.
    bytes: [Vec<u8>; 3],
}

impl MaterialTexels {
    /// What is in a voxel; nothing outside of the frame.
    #[must_use]
    pub fn get(&self, voxel: [u32; 3]) -> VoxelMaterial {
        let [nx, ny, nz] = self.dims.map(|n| n as usize);
        let [x, y, z] = voxel.map(|c| c as usize);
        if x >= nx || y >= ny || z >= nz {
            return VoxelMaterial::default();
        }
        let place = ((z * ny + y) * nx + x) * self.encoding.precision.texel_bytes();
        let texels = [0, 1, 2].map(|texture: usize| {
            let bytes = self.bytes.get(texture).and_then(|bytes| bytes.get(place..)).unwrap_or(&[]);
            self.encoding.precision.texel(bytes)
        });
        self.encoding.decode(texels)
    }

    /// Voxels along x, y and z.
    #[must_use]
    pub fn dims(&self) -> [u32; 3] {
        self.dims
    }
}

impl MaterialVolume {
    /// An empty volume: air everywhere. `media` sets the range of 8-bit texels.
    ///
    /// # Errors
    /// When a side of the frame exceeds the device's 3D textures, or memory runs out.
    pub fn new(gpu: &Gpu, frame: Frame, precision: Precision, media: &Media) -> Result<Self, GpuError> {
        let [width, height, depth_or_array_layers] = frame.dims();
        let most = gpu.device().limits().max_texture_dimension_3d;
        let longest = width.max(height).max(depth_or_array_layers);
        if longest > most {
            return Err(GpuError::TextureTooLarge { adapter: gpu.info().to_string(), side: longest, limit: most });
        }
        let texture = |label| {
            gpu.guarded(|| {
                gpu.device().create_texture(&wgpu::TextureDescriptor {
                    label: Some(label),
                    size: wgpu::Extent3d { width, height, depth_or_array_layers },
                    mip_level_count: 1,
                    sample_count: 1,
                    dimension: wgpu::TextureDimension::D3,
                    format: precision.format(),
                    usage: wgpu::TextureUsages::TEXTURE_BINDING
                        | wgpu::TextureUsages::STORAGE_BINDING
                        | wgpu::TextureUsages::RENDER_ATTACHMENT
                        | wgpu::TextureUsages::COPY_SRC
                        | wgpu::TextureUsages::COPY_DST,
                    view_formats: &[],
                })
            })
        };
        Ok(Self {
            frame,
            encoding: Encoding::new(precision, media),
            surface: texture("trixel surfaces")?,
            color: texture("trixel colours")?,
            medium: texture("trixel media")?,
        })
    }

    /// A volume of what `voxel` says of each voxel, asked slice by slice along z, x fastest.
    ///
    /// # Errors
    /// As for [`MaterialVolume::new`].
    pub fn from_voxels(
        gpu: &Gpu,
        frame: Frame,
        precision: Precision,
        media: &Media,
        mut voxel: impl FnMut([u32; 3]) -> VoxelMaterial,
    ) -> Result<Self, GpuError> {
        let volume = Self::new(gpu, frame, precision, media)?;
        let [nx, ny, nz] = frame.dims();
        let mut slices: [Vec<u8>; 3] = Default::default();
        for z in 0..nz {
            slices.iter_mut().for_each(Vec::clear);
            for y in 0..ny {
                for x in 0..nx {
                    let texels = volume.encoding.encode(&voxel([x, y, z]));
                    for (slice, texel) in slices.iter_mut().zip(texels) {
                        precision.append(texel, slice);
                    }
                }
            }
            gpu.guarded(|| {
                for (texture, slice) in volume.textures().into_iter().zip(&slices) {
                    gpu.queue().write_texture(
                        wgpu::TexelCopyTextureInfo {
                            texture,
                            mip_level: 0,
                            origin: wgpu::Origin3d { x: 0, y: 0, z },
                            aspect: wgpu::TextureAspect::All,
                        },
                        slice,
                        wgpu::TexelCopyBufferLayout {
                            offset: 0,
                            bytes_per_row: Some(nx * precision.texel_bytes_u32()),
                            rows_per_image: Some(ny),
                        },
                        wgpu::Extent3d { width: nx, height: ny, depth_or_array_layers: 1 },
                    );
                }
                // Without a submission the staged slices of a large volume would pile up.
                gpu.queue().submit([]);
            })?;
        }
        Ok(volume)
    }

    /// The frame.
    #[must_use]
    pub fn frame(&self) -> &Frame {
        &self.frame
    }

    /// The format of the texels.
    #[must_use]
    pub fn precision(&self) -> Precision {
        self.encoding.precision
    }

    /// How shaders turn texels into values.
    #[must_use]
    pub fn decoding(&self) -> Decoding {
        self.encoding.decoding()
    }

    /// Normals and existence.
    #[must_use]
    pub fn surface(&self) -> &wgpu::Texture {
        &self.surface
    }

    /// Colours and opacity.
    #[must_use]
    pub fn color(&self) -> &wgpu::Texture {
        &self.color
    }

    /// Absorption, index of refraction and what is inside.
    #[must_use]
    pub fn medium(&self) -> &wgpu::Texture {
        &self.medium
    }

    fn textures(&self) -> [&wgpu::Texture; 3] {
        [&self.surface, &self.color, &self.medium]
    }

    /// Copies the texels into memory, after everything submitted so far.
    ///
    /// # Errors
    /// When memory runs out or the device is lost.
    pub fn download(&self, gpu: &Gpu) -> Result<MaterialTexels, GpuError> {
        let [nx, ny, nz] = self.frame.dims();
        let row = nx * self.precision().texel_bytes_u32();
        let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let slice_bytes = u64::from(padded) * u64::from(ny);
        // A few megabytes at a time.
        let step = u32::try_from((1u64 << 25) / slice_bytes).unwrap_or(nz).clamp(1, nz);
        let usage = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ;
        let staging = gpu.buffer("trixel texels read", slice_bytes * u64::from(step), usage)?;
        let mut bytes: [Vec<u8>; 3] = Default::default();
        for (texture, bytes) in self.textures().into_iter().zip(&mut bytes) {
            for z in (0..nz).step_by(step as usize) {
                let depth = step.min(nz - z);
                gpu.guarded(|| {
                    let mut encoder = gpu.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
                    encoder.copy_texture_to_buffer(
                        wgpu::TexelCopyTextureInfo {
                            texture,
                            mip_level: 0,
                            origin: wgpu::Origin3d { x: 0, y: 0, z },
                            aspect: wgpu::TextureAspect::All,
                        },
                        wgpu::TexelCopyBufferInfo {
                            buffer: &staging,
                            layout: wgpu::TexelCopyBufferLayout {
                                offset: 0,
                                bytes_per_row: Some(padded),
                                rows_per_image: Some(ny),
                            },
                        },
                        wgpu::Extent3d { width: nx, height: ny, depth_or_array_layers: depth },
                    );
                    gpu.queue().submit([encoder.finish()]);
                })?;
                gpu.read(&staging, slice_bytes * u64::from(depth), |rows| {
                    for padded in rows.chunks_exact(padded as usize) {
                        bytes.extend_from_slice(padded.get(..row as usize).unwrap_or(padded));
                    }
                })?;
            }
        }
        Ok(MaterialTexels { dims: self.frame.dims(), encoding: self.encoding, bytes })
    }
}
