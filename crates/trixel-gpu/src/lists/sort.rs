//! Sorting and merging lists on the device.

use trixel::{Grid, VoxelOrder};

use super::{Entries, Memory};
use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::kernel::{Bound, Dispatcher, Kernel};
use crate::prefix_sum::PrefixSum;

/// Entries of one invocation: `BLOCK` of `radix_sort.wgsl`.
const SORT_BLOCK: u32 = 64;
/// Entries of one invocation: `BLOCK` of `merge.wgsl`.
const MERGE_BLOCK: u32 = 64;
/// Values of a digit of 4 bits.
const DIGITS: u32 = 16;

/// Bits of the largest of `count` numbers from 0 on.
fn bits(count: u32) -> u32 {
    u32::BITS - count.saturating_sub(1).leading_zeros()
}

/// What entries are sorted by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum SortKey {
    Voxels(VoxelOrder),
    /// The first word, then the second.
    Pairs,
}

impl SortKey {
    /// Every key.
    #[cfg(test)]
    pub(crate) const ALL: [Self; 3] = [Self::Voxels(VoxelOrder::Xyz), Self::Voxels(VoxelOrder::Morton), Self::Pairs];

    /// `ORDER` of `sort_key.wgsl`.
    pub(crate) fn code(self) -> u32 {
        match self {
            Self::Voxels(VoxelOrder::Xyz) => 0,
            Self::Voxels(VoxelOrder::Morton) => 1,
            Self::Pairs => 2,
        }
    }
}

/// Sorts voxels of a grid.
pub(crate) fn sort(
    gpu: &Gpu,
    entries: Entries,
    grid: &Grid,
    order: VoxelOrder,
    memory: &mut Memory,
) -> Result<Entries, GpuError> {
    let [x_bits, y_bits, z_bits] = grid.dims().map(bits);
    let key_bits = match order {
        VoxelOrder::Xyz => x_bits + y_bits + z_bits,
        VoxelOrder::Morton => 3 * x_bits.max(y_bits).max(z_bits),
    };
    sort_by(gpu, entries, SortKey::Voxels(order), [key_bits, y_bits, z_bits], memory)
}

/// Sorts pairs of numbers below `first` and `second`, the latter at most 2^31.
pub(crate) fn sort_pairs(
    gpu: &Gpu,
    entries: Entries,
    first: u32,
    second: u32,
    memory: &mut Memory,
) -> Result<Entries, GpuError> {
    let low = bits(second);
    sort_by(gpu, entries, SortKey::Pairs, [bits(first) + low, 0, low], memory)
}

/// By the lowest `key_bits` of the keys.
fn sort_by(
    gpu: &Gpu,
    entries: Entries,
    key: SortKey,
    [key_bits, y_bits, z_bits]: [u32; 3],
    memory: &mut Memory,
) -> Result<Entries, GpuError> {
    let length = entries.length;
    if length < 2 {
        return Ok(entries);
    }
    let blocks = length.div_ceil(SORT_BLOCK);
    let sums = PrefixSum::new(gpu, blocks * DIGITS)?;
    let (mut from, mut to) = (entries, Entries::new(gpu, length)?);
    let room = from.buffer.size() + to.buffer.size() - u64::from(length) * super::ENTRY_BYTES;
    memory.reach(room + sums.bytes());
    let mut dispatcher = Dispatcher::new(gpu);
    for shift in (0..key_bits).step_by(4) {
        let parameters = [length, blocks, shift, y_bits, z_bits];
        let bound = |to| {
            let [parameters, to] = [Bound::Words(&parameters), Bound::Buffer(to)];
            [(0, parameters), (1, Bound::Buffer(&from.buffer)), (2, Bound::Buffer(sums.numbers())), (3, to)]
        };
        dispatcher.dispatch(Kernel::CountDigits(key), &bound(&to.buffer)[..3], blocks)?;
        sums.record(&mut dispatcher)?;
        dispatcher.dispatch(Kernel::MoveEntries(key), &bound(&to.buffer), blocks)?;
        std::mem::swap(&mut from, &mut to);
    }
    dispatcher.submit()?;
    Ok(Entries { buffer: from.buffer, length })
}

/// Keeps one of each of equal neighbours.
pub(crate) fn distinct(gpu: &Gpu, fragments: &Entries, memory: &mut Memory) -> Result<Entries, GpuError> {
    let blocks = fragments.length.div_ceil(MERGE_BLOCK);
    let sums = PrefixSum::new(gpu, blocks)?;
    let length = [fragments.length];
    let bound = [(0, Bound::Words(&length)), (1, Bound::Buffer(&fragments.buffer)), (2, Bound::Buffer(sums.numbers()))];
    let mut dispatcher = Dispatcher::new(gpu);
    dispatcher.dispatch(Kernel::CountDistinct, &bound, blocks)?;
    sums.record(&mut dispatcher)?;
    let total = dispatcher.read_words(&[(sums.total(), 1)])?.into_iter().flatten().next().unwrap_or(0);
    let list = Entries::new(gpu, total)?;
    memory.reach(fragments.buffer.size() + sums.bytes());
    let [length, from, counts] = bound;
    let mut dispatcher = Dispatcher::new(gpu);
    dispatcher.dispatch(Kernel::WriteDistinct, &[length, from, counts, (3, Bound::Buffer(&list.buffer))], blocks)?;
    dispatcher.submit()?;
    Ok(list)
}
