//! What the shaders count.

/// Counts over one voxelization, exact on every driver: the shaders add to a buffer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Counters {
    /// Compute invocations that had something to look at.
    pub invocations: u64,
    /// Fragments shaded.
    pub fragments: u64,
    /// Fragments that set no voxel.
    pub fragments_discarded: u64,
    /// Columns of triangles tested.
    pub columns: u64,
    /// Voxels tested against the two projections that the columns leave.
    pub voxel_tests: u64,
    /// Voxels that were not set before; in mode solid, toggles.
    pub voxels_written: u64,
    /// Atomic operations on voxels.
    pub atomics: u64,
}

/// Counters in the buffer, `counters.wgsl`'s last being the triangles too large.
const COUNT: usize = 8;

/// Bytes of the buffer: two words each.
pub(crate) const BYTES: u64 = COUNT as u64 * 8;

/// The counters, and how many triangles were too large to voxelize.
pub(crate) fn parse(bytes: &[u8]) -> (Counters, u64) {
    let mut values = [0u64; COUNT];
    for (value, word) in values.iter_mut().zip(bytes.as_chunks::<8>().0) {
        *value = u64::from_le_bytes(*word);
    }
    let [invocations, fragments, fragments_discarded, columns, voxel_tests, voxels_written, atomics, too_large] =
        values;
    let counters =
        Counters { invocations, fragments, fragments_discarded, columns, voxel_tests, voxels_written, atomics };
    (counters, too_large)
}
