//! Prefix sums within a recording: `scan.wgsl`.

use super::{Recorder, run};
use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::limits::SCAN_BLOCK;
use crate::pipelines::bind;
use crate::scratch::ScanBuffers;
use crate::shader::Stage;

/// Sets of words, each where a uniform's dynamic offset can point.
pub(super) struct WordSets {
    buffer: wgpu::Buffer,
    stride: u32,
    bytes: u64,
}

impl WordSets {
    pub(super) fn new<const N: usize>(gpu: &Gpu, sets: &[[u32; N]]) -> Result<Self, GpuError> {
        let stride = gpu.limits().parameter_stride;
        let mut bytes = vec![0u8; sets.len() * stride as usize];
        for (slot, words) in bytes.chunks_exact_mut(stride as usize).zip(sets) {
            slot[..4 * N].copy_from_slice(bytemuck::cast_slice(words));
        }
        let buffer = gpu.buffer_with("trixel word sets", &bytes, wgpu::BufferUsages::UNIFORM)?;
        Ok(Self { buffer, stride, bytes: 4 * N as u64 })
    }

    /// What is bound, with [`WordSets::offset`].
    pub(super) fn binding(&self) -> wgpu::BindingResource<'_> {
        let size = wgpu::BufferSize::new(self.bytes);
        wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer: &self.buffer, offset: 0, size })
    }

    pub(super) fn offset(&self, set: u32) -> u32 {
        set * self.stride
    }
}

/// The dispatches that replace numbers by the sums of those before them.
pub(super) struct PrefixSums {
    scan_blocks: wgpu::ComputePipeline,
    add_totals: wgpu::ComputePipeline,
    /// For each level its group, the offset of its length, and the workgroups.
    levels: Vec<(wgpu::BindGroup, u32, [u32; 2])>,
}

impl PrefixSums {
    pub(super) fn record(&self, pass: &mut wgpu::ComputePass<'_>) {
        for (group, offset, groups) in &self.levels {
            run(pass, &self.scan_blocks, group, Some(*offset), None, *groups);
        }
        for (group, offset, groups) in self.levels.iter().rev().skip(1) {
            run(pass, &self.add_totals, group, Some(*offset), None, *groups);
        }
    }
}

impl Recorder<'_> {
    /// For the first `length` numbers of the buffers; their sum goes to `scan.total`.
    pub(super) fn prefix_sums(&self, scan: &ScanBuffers, length: u32) -> Result<PrefixSums, GpuError> {
        let gpu = self.setting.gpu;
        let lengths: Vec<[u32; 1]> = std::iter::successors(Some(length), |length| Some(length.div_ceil(SCAN_BLOCK)))
            .take(scan.levels.len())
            .map(|length| [length])
            .collect();
        let words = WordSets::new(gpu, &lengths)?;
        let totals = scan.levels.iter().skip(1).chain([&scan.total]);
        let levels =
            scan.levels.iter().zip(totals).zip((0..).zip(&lengths)).map(|((data, totals), (level, [length]))| {
                let resources = [words.binding(), data.as_entire_binding(), totals.as_entire_binding()];
                let group = bind(gpu, &gpu.pipelines().layouts().scan, &resources);
                (group, words.offset(level), gpu.limits().dispatch(length.div_ceil(SCAN_BLOCK)))
            });
        Ok(PrefixSums {
            levels: levels.collect(),
            scan_blocks: self.pipeline(Stage::ScanBlocks),
            add_totals: self.pipeline(Stage::AddTotals),
        })
    }
}
