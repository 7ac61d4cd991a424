//! Timestamps around passes, where the adapter has them.

use crate::error::GpuError;
use crate::gpu::Gpu;

/// Passes timed at most; further ones run untimed.
const CAPACITY: u32 = 128;

/// The time that a pass took on the device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassTime {
    /// What the pass did.
    pub name: &'static str,
    /// Milliseconds.
    pub ms: f64,
}

/// Hands out pairs of timestamps to passes.
#[derive(Debug)]
pub(crate) struct Timer {
    set: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    staging: wgpu::Buffer,
    names: Vec<&'static str>,
}

impl Timer {
    pub(crate) fn new(gpu: &Gpu) -> Result<Option<Self>, GpuError> {
        if !gpu.has_timestamps() {
            return Ok(None);
        }
        let bytes = u64::from(CAPACITY) * 16;
        let set = gpu.guarded(|| {
            gpu.device().create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("trixel passes"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * CAPACITY,
            })
        })?;
        let resolve = wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC;
        let staging = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        Ok(Some(Self {
            set,
            resolved: gpu.buffer("trixel timestamps", bytes, resolve)?,
            staging: gpu.buffer("trixel timestamps read", bytes, staging)?,
            names: vec![],
        }))
    }

    pub(crate) fn restart(&mut self) {
        self.names.clear();
    }

    /// The indices of a pass's two timestamps.
    fn next(&mut self, name: &'static str) -> Option<[u32; 2]> {
        let index = u32::try_from(self.names.len()).ok().filter(|index| *index < CAPACITY)?;
        self.names.push(name);
        Some([2 * index, 2 * index + 1])
    }

    pub(crate) fn compute(&mut self, name: &'static str) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        let [begin, end] = self.next(name)?;
        Some(wgpu::ComputePassTimestampWrites {
            query_set: &self.set,
            beginning_of_pass_write_index: Some(begin),
            end_of_pass_write_index: Some(end),
        })
    }

    pub(crate) fn render(&mut self, name: &'static str) -> Option<wgpu::RenderPassTimestampWrites<'_>> {
        let [begin, end] = self.next(name)?;
        Some(wgpu::RenderPassTimestampWrites {
            query_set: &self.set,
            beginning_of_pass_write_index: Some(begin),
            end_of_pass_write_index: Some(end),
        })
    }

    fn bytes(&self) -> u64 {
        self.names.len() as u64 * 16
    }

    pub(crate) fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        if let Ok(count @ 1..) = u32::try_from(2 * self.names.len()) {
            encoder.resolve_query_set(&self.set, 0..count, &self.resolved, 0);
            encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.staging, 0, self.bytes());
        }
    }

    pub(crate) fn read(&self, gpu: &Gpu) -> Result<Vec<PassTime>, GpuError> {
        let period = f64::from(gpu.queue().get_timestamp_period());
        gpu.read(&self.staging, self.bytes(), |bytes| {
            let stamps = bytes.as_chunks::<16>().0;
            self.names
                .iter()
                .zip(stamps)
                .map(|(&name, stamp)| {
                    let word = |i: usize| u64::from_le_bytes(std::array::from_fn(|byte| stamp[8 * i + byte]));
                    #[expect(clippy::cast_precision_loss, reason = "nanoseconds of a pass")]
                    let ticks = word(1).saturating_sub(word(0)) as f64;
                    PassTime { name, ms: ticks * period * 1e-6 }
                })
                .collect()
        })
    }
}
