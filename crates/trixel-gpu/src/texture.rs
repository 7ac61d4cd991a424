//! Voxels as a 3D texture, for programs that sample them.

use bytemuck::{Pod, Zeroable};

use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::limits::WORKGROUP;
use crate::pipelines::bind;
use crate::shader::{Stage, Variant};
use crate::volume::GpuVolume;

/// `Expand` of `expand.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Expand {
    size: [u32; 3],
    first_z: u32,
    column_words: u32,
    row_words: u32,
    padding: [u32; 2],
}

impl GpuVolume {
    /// Records the copy of the voxels into a new 3D texture: `R8Unorm`, 1 where a voxel is set, texel `(x, y, z)` for voxel
    /// `[x, y, z]`, to be bound and copied from. It takes 8 times the memory of the bits.
    ///
    /// # Errors
    /// When a side of the grid exceeds the device's 3D textures, or memory runs out.
    pub fn record_texture(&self, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder) -> Result<wgpu::Texture, GpuError> {
        let [width, height, depth_or_array_layers] = self.grid().dims();
        let most = gpu.device().limits().max_texture_dimension_3d;
        let longest = width.max(height).max(depth_or_array_layers);
        if longest > most {
            return Err(GpuError::TextureTooLarge { adapter: gpu.info().to_string(), side: longest, limit: most });
        }
        gpu.guarded(|| {
            let texture = gpu.device().create_texture(&wgpu::TextureDescriptor {
                label: Some("trixel voxels"),
                size: wgpu::Extent3d { width, height, depth_or_array_layers },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D3,
                format: wgpu::TextureFormat::R8Unorm,
                usage: wgpu::TextureUsages::TEXTURE_BINDING
                    | wgpu::TextureUsages::COPY_SRC
                    | wgpu::TextureUsages::COPY_DST,
                view_formats: &[],
            });
            self.record_into(gpu, encoder, &texture)?;
            Ok(texture)
        })?
    }

    fn record_into(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        texture: &wgpu::Texture,
    ) -> Result<(), GpuError> {
        let [_, ny, nz] = self.grid().dims();
        let pipeline = gpu.pipelines().compute(gpu, Stage::Expand, Variant::ANY);
        for slab in self.slabs() {
            let row_bytes = slab.nx().next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
            let plane_bytes = u64::from(row_bytes) * u64::from(ny);
            // As many planes at a time as one binding holds, and a dispatch counts.
            let planes = gpu.limits().slab_planes(plane_bytes).min(u64::from(nz.min(gpu.limits().groups)));
            let Some(planes) = u32::try_from(planes).ok().filter(|planes| *planes > 0) else {
                return Err(gpu.plane_too_large(plane_bytes));
            };
            let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
            let bytes = gpu.buffer("trixel texels", plane_bytes * u64::from(planes), usage)?;
            for first_z in (0..nz).step_by(planes as usize) {
                let depth = planes.min(nz - first_z);
                let params = Expand {
                    size: [slab.nx(), ny, depth],
                    first_z,
                    column_words: self.column_words,
                    row_words: row_bytes / 4,
                    padding: [0; 2],
                };
                let params =
                    gpu.buffer_with("trixel parameters", bytemuck::bytes_of(&params), wgpu::BufferUsages::UNIFORM)?;
                let group = bind(
                    gpu,
                    &gpu.pipelines().layouts().expand,
                    &[params.as_entire_binding(), slab.buffer().as_entire_binding(), bytes.as_entire_binding()],
                );
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
                pass.set_pipeline(&pipeline);
                pass.set_bind_group(0, &group, &[0]);
                pass.dispatch_workgroups((row_bytes / 4).div_ceil(WORKGROUP), ny, depth);
                drop(pass);
                encoder.copy_buffer_to_texture(
                    wgpu::TexelCopyBufferInfo {
                        buffer: &bytes,
                        layout: wgpu::TexelCopyBufferLayout {
                            offset: 0,
                            bytes_per_row: Some(row_bytes),
                            rows_per_image: Some(ny),
                        },
                    },
                    wgpu::TexelCopyTextureInfo {
                        texture,
                        mip_level: 0,
                        origin: wgpu::Origin3d { x: slab.x(), y: 0, z: first_z },
                        aspect: wgpu::TextureAspect::All,
                    },
                    wgpu::Extent3d { width: slab.nx(), height: ny, depth_or_array_layers: depth },
                );
            }
        }
        Ok(())
    }
}
