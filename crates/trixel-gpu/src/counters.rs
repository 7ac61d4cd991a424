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
    /// Columns that the lanes of compute invocations took, of the strategies' own loops.
    #[cfg_attr(feature = "serde", serde(default))]
    pub lane_columns: u64,
    /// Columns that they could have taken meanwhile: where 32 neighbours run in step, each waits for the slowest.
    #[cfg_attr(feature = "serde", serde(default))]
    pub lane_slots: u64,
}

impl Counters {
    /// The share of lanes that have a column to work on while any of their 32 has one, from 0 to 1; `None` where all work was
    /// the rasterizer's.
    #[must_use]
    pub fn lane_use(&self) -> Option<f64> {
        #[expect(clippy::cast_precision_loss, reason = "a ratio for people")]
        let share = self.lane_columns as f64 / self.lane_slots as f64;
        (self.lane_slots > 0).then_some(share)
    }
}

/// Counters in the buffer: `counters.wgsl`.
const COUNT: usize = 10;

/// Bytes of the buffer: two words each.
pub(crate) const BYTES: u64 = COUNT as u64 * 8;

/// The counters, and how many triangles were too large to voxelize.
pub(crate) fn parse(bytes: &[u8]) -> (Counters, u64) {
    let mut values = [0u64; COUNT];
    for (value, word) in values.iter_mut().zip(bytes.as_chunks::<8>().0) {
        *value = u64::from_le_bytes(*word);
    }
    let [invocations, fragments, fragments_discarded, columns, voxel_tests, voxels_written, ..] = values;
    let [.., atomics, too_large, lane_columns, lane_slots] = values;
    let counters = Counters {
        invocations,
        fragments,
        fragments_discarded,
        columns,
        voxel_tests,
        voxels_written,
        atomics,
        lane_columns,
        lane_slots,
    };
    (counters, too_large)
}
