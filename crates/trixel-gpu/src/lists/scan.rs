//! Lists by prefix population counts: the twin of `trixel::Rank`.

use super::{Entries, Memory, by_slabs, slab_bound, slab_words};
use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::kernel::{Bound, Dispatcher, Kernel};
use crate::prefix_sum::PrefixSum;
use crate::volume::{GpuVolume, Slab};

/// Words whose bits are counted together: `BLOCK_WORDS` of `list_scan.wgsl`.
const BLOCK_WORDS: u32 = 8;

/// Records the counting of a slab's bits in blocks, summed up.
pub(crate) fn count(dispatcher: &mut Dispatcher<'_>, volume: &GpuVolume, slab: &Slab) -> Result<PrefixSum, GpuError> {
    let words = slab_words(volume, slab, 0, 0);
    let blocks = words[3].div_ceil(BLOCK_WORDS);
    let sums = PrefixSum::new(dispatcher.gpu, blocks)?;
    let [parameters, bits] = slab_bound(&words, slab);
    let bound = [parameters, bits, (2, Bound::Buffer(sums.numbers()))];
    dispatcher.dispatch(Kernel::CountBits, &bound, blocks)?;
    sums.record(dispatcher)?;
    Ok(sums)
}

/// The list, in the order of the bits.
pub(super) fn list(gpu: &Gpu, volume: &GpuVolume, memory: &mut Memory) -> Result<Entries, GpuError> {
    let bytes = std::cell::Cell::new(0);
    let entries = by_slabs(
        gpu,
        volume,
        |dispatcher, slab| {
            let sums = count(dispatcher, volume, slab)?;
            bytes.set(bytes.get() + sums.bytes());
            Ok(sums)
        },
        PrefixSum::total,
        |dispatcher, words, slab, sums, list| {
            let [parameters, bits] = slab_bound(&words, slab);
            let bound = [parameters, bits, (2, Bound::Buffer(sums.numbers())), (3, Bound::Buffer(list))];
            dispatcher.dispatch(Kernel::WriteList, &bound, words[3].div_ceil(BLOCK_WORDS))
        },
    )?;
    memory.reach(bytes.get());
    Ok(entries)
}
