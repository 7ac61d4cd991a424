//! Exclusive prefix sums on the device, in place: `scan.wgsl`.

use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::kernel::{Bound, Dispatcher, Kernel};
use crate::limits::SCAN_BLOCK;

/// Numbers whose prefix sums are wanted.
pub(crate) struct PrefixSum {
    /// The numbers, then each time the totals of the blocks of the ones before, and at the end one sum of all.
    levels: Vec<wgpu::Buffer>,
    length: u32,
}

impl PrefixSum {
    /// Room for so many numbers.
    pub(crate) fn new(gpu: &Gpu, length: u32) -> Result<Self, GpuError> {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let level = |length: u32| gpu.storage("trixel prefix sums", u64::from(length) * 4, usage);
        let mut levels = vec![level(length)?];
        let mut rest = length;
        while rest > 1 || levels.len() == 1 {
            rest = rest.div_ceil(SCAN_BLOCK).max(1);
            levels.push(level(rest)?);
        }
        Ok(Self { levels, length })
    }

    /// The numbers; after the sums are recorded, the sums of those before each.
    pub(crate) fn numbers(&self) -> &wgpu::Buffer {
        &self.levels[0]
    }

    /// The sum of all: one word.
    pub(crate) fn total(&self) -> &wgpu::Buffer {
        &self.levels[self.levels.len() - 1]
    }

    /// Bytes of all levels.
    pub(crate) fn bytes(&self) -> u64 {
        self.levels.iter().map(wgpu::Buffer::size).sum()
    }

    /// Replaces the numbers by their prefix sums.
    pub(crate) fn record(&self, dispatcher: &mut Dispatcher<'_>) -> Result<(), GpuError> {
        let lengths = std::iter::successors(Some(self.length), |length| Some(length.div_ceil(SCAN_BLOCK)));
        let steps: Vec<_> = self.levels.windows(2).zip(lengths).collect();
        let mut step = |kernel, pair: &[wgpu::Buffer], length: u32| {
            let bound = [(0, Bound::Words(&[length])), (1, Bound::Buffer(&pair[0])), (2, Bound::Buffer(&pair[1]))];
            dispatcher.dispatch_groups(kernel, &bound, length.div_ceil(SCAN_BLOCK))
        };
        for (pair, length) in &steps {
            step(Kernel::ScanBlocks, pair, *length)?;
        }
        for (pair, length) in steps.iter().rev().skip(1) {
            step(Kernel::AddTotals, pair, *length)?;
        }
        Ok(())
    }
}
