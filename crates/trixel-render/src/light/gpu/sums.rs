//! A picture's sums over samples, in a buffer.

use trixel_gpu::{Gpu, wgpu};

use super::super::error::LightError;

/// Four numbers for each pixel, or several times four.
pub(super) struct Sums {
    buffer: wgpu::Buffer,
    bytes: u64,
}

impl Sums {
    /// Zeros for a picture of so many pixels, with so many times four numbers each.
    pub(super) fn new(gpu: &Gpu, size: [u32; 2], values: u64) -> Result<Self, LightError> {
        let bytes = u64::from(size[0]) * u64::from(size[1]) * 16 * values;
        let limits = gpu.device().limits();
        let limit = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        if bytes > limit {
            return Err(LightError::PictureTooLarge { adapter: gpu.info().to_string(), most: limit / (16 * values) });
        }
        let buffer = gpu.buffer("trixel sums", bytes, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC)?;
        Ok(Self { buffer, bytes })
    }

    pub(super) fn buffer(&self) -> &wgpu::Buffer {
        &self.buffer
    }

    pub(super) fn read(&self, gpu: &Gpu) -> Result<Vec<[f32; 4]>, LightError> {
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let copy = gpu.buffer("trixel sums, to read", self.bytes, usage)?;
        gpu.guarded(|| {
            let mut encoder = gpu.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            encoder.copy_buffer_to_buffer(&self.buffer, 0, &copy, 0, self.bytes);
            gpu.queue().submit([encoder.finish()]);
        })?;
        Ok(gpu.read(&copy, self.bytes, bytemuck::pod_collect_to_vec)?)
    }
}
