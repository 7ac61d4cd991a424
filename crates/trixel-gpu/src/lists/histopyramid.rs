//! Lists by HistoPyramids: G. Ziegler, A. Tevs, C. Theobalt & H.-P. Seidel, *On-the-fly Point Clouds through Histogram
//! Pyramids*, 2006; \[HCV\] 3.4.

use super::{Entries, Memory, by_slabs, slab_bound, slab_words};
use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::kernel::{Bound, Dispatcher, Kernel};
use crate::volume::{GpuVolume, Slab};

/// Cells that one cell sums.
const FAN: u32 = 4;

/// The sums over one slab, level by level, the last one of a single cell.
struct Pyramid {
    sums: wgpu::Buffer,
    /// The sum of all.
    total: wgpu::Buffer,
    /// Where each level begins, and how many cells it has.
    levels: Vec<[u32; 2]>,
}

impl Pyramid {
    fn new(dispatcher: &mut Dispatcher<'_>, volume: &GpuVolume, slab: &Slab) -> Result<Self, GpuError> {
        let gpu = dispatcher.gpu;
        let words = slab_words(volume, slab, 0, 0);
        let mut levels = vec![];
        let (mut cells, mut start) = (words[3].div_ceil(FAN).max(1), 0);
        loop {
            levels.push([start, cells]);
            // Missing cells of the last four are 0: new buffers are.
            start += cells.next_multiple_of(FAN);
            if cells == 1 {
                break;
            }
            cells = cells.div_ceil(FAN);
        }
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let sums = gpu.storage("a histopyramid's sums", u64::from(start) * 4, usage)?;
        let usage = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
        let total = gpu.buffer("trixel histopyramid total", 4, usage)?;
        let pyramid = Self { sums, total, levels };
        for (level, [start, cells]) in pyramid.levels.iter().enumerate() {
            let parameters = pyramid.parameters(level, *cells);
            let summed = [(2, Bound::Words(&parameters)), (3, Bound::Buffer(&pyramid.sums))];
            if level == 0 {
                let bound = [slab_bound(&words, slab), summed].concat();
                dispatcher.dispatch(Kernel::SumWords, &bound, *cells)?;
            } else {
                dispatcher.dispatch(Kernel::SumCells, &summed, *cells)?;
            }
            if *cells == 1 {
                dispatcher.copy((&pyramid.sums, u64::from(*start) * 4), (&pyramid.total, 0), 4);
            }
        }
        Ok(pyramid)
    }

    /// `Pyramid` of `histopyramid.wgsl`.
    fn parameters(&self, level: usize, cells: u32) -> [u32; 20] {
        let mut words = [0; 20];
        for (word, [start, _]) in words.iter_mut().zip(&self.levels) {
            *word = *start;
        }
        let number = |value: usize| u32::try_from(value).unwrap_or(u32::MAX);
        words[16] = number(self.levels.len());
        words[17] = number(level);
        words[18] = cells;
        words
    }
}

/// The list, in the order of the bits.
pub(super) fn list(gpu: &Gpu, volume: &GpuVolume, memory: &mut Memory) -> Result<Entries, GpuError> {
    let bytes = std::cell::Cell::new(0);
    let entries = by_slabs(
        gpu,
        volume,
        |dispatcher, slab| {
            let pyramid = Pyramid::new(dispatcher, volume, slab)?;
            bytes.set(bytes.get() + pyramid.sums.size());
            Ok(pyramid)
        },
        |pyramid| &pyramid.total,
        |dispatcher, words, slab, pyramid, list| {
            let parameters = pyramid.parameters(0, 0);
            let [slab, bits] = slab_bound(&words, slab);
            let pyramid = [(2, Bound::Words(&parameters)), (3, Bound::Buffer(&pyramid.sums))];
            let bound = [slab, bits, pyramid[0], pyramid[1], (4, Bound::Buffer(list))];
            dispatcher.dispatch(Kernel::Traverse, &bound, words[5])
        },
    )?;
    memory.reach(bytes.get());
    Ok(entries)
}
