//! Every limit, derived in one place.

use trixel::Mode;
use trixel::lattice::STEP_BITS;

/// Triangles this long along an axis, in lattice steps (8192 voxels), do not fit the shaders' 32-bit arithmetic; the CPU
/// voxelizes them.
pub const MAX_EXTENT: i64 = 1 << 29;

/// Pairs of triangle and column that `balanced` can number: whole rows of workgroups below 2^32.
pub(crate) const MAX_PAIRS: u32 = 65_535 * 64 * 1024;

/// Voxels along each axis of a tile of `tiled`, as logarithms: a column of it is one word.
pub(crate) const TILE_SHIFT: [u32; 3] = [4, 4, 5];

/// Likewise of tiles whose voxels have values, the largest first: each value of a voxel takes four bytes of a workgroup's
/// memory, and smaller tiles take more pairs.
pub(crate) const TARGET_TILES: [[u32; 3]; 3] = [[3, 3, 5], [3, 2, 5], [2, 2, 5]];

/// Pairs of triangle and tile that `tiled` sorts at a time: 8 bytes each, twice.
pub(crate) const TILE_ROUND: u32 = 1 << 22;

/// Pairs that one workgroup of `tiled` takes: 64 an invocation, whose at most 512 columns keep its loops short of
/// [`SAFE_ITERATIONS`].
pub(crate) const TILE_SHARE: u32 = 64 * WORKGROUP;

/// Likewise where voxels have values, which costs an iteration a voxel: 16 an invocation. In a tile of 8 x 8 x 32 a triangle
/// has at most 256 columns, and invocations that run in step take up to 4 iterations for bits along z and 4 for those across:
/// 2300 iterations, or along slices 64 columns of 32 voxels.
pub(crate) const TARGET_SHARE: u32 = 16 * WORKGROUP;

/// Invocations of a workgroup.
pub(crate) const WORKGROUP: u32 = 64;

/// Elements that one workgroup of `scan.wgsl` sums.
pub(crate) const SCAN_BLOCK: u32 = 1024;

/// Iterations after which lavapipe ends the loops of an invocation, all of them together, without an error.
const SAFE_ITERATIONS: u32 = 65_535;

/// What an adapter allows, as trixel needs it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    /// Bytes of a storage buffer that a shader sees at once.
    pub(crate) binding_bytes: u64,
    /// Pixels along a side of a raster target.
    pub(crate) target_size: u32,
    /// Workgroups along one dimension of a dispatch.
    pub(crate) groups: u32,
    /// Bytes between the parameter sets of consecutive dispatches.
    pub(crate) parameter_stride: u32,
    /// Bytes of a workgroup's own memory.
    pub(crate) workgroup_bytes: u32,
}

impl Limits {
    /// From a device's limits.
    pub(crate) fn new(device: &wgpu::Limits) -> Self {
        // Sizes of bindings must be multiples of 4 and word indices fit 32 bits.
        let binding_bytes = device.max_storage_buffer_binding_size.min(device.max_buffer_size).min(1 << 32) & !3;
        Self {
            binding_bytes,
            target_size: device.max_texture_dimension_2d.min(8192),
            groups: device.max_compute_workgroups_per_dimension.min(65_535),
            parameter_stride: device.min_uniform_buffer_offset_alignment.max(256),
            workgroup_bytes: device.max_compute_workgroup_storage_size,
        }
    }

    /// Triangles, or vertices, of which one binding holds three words each.
    pub(crate) fn chunk_elements(&self) -> usize {
        // 15 vertices a triangle must stay within 32 bits, and a dispatch within its two dimensions.
        usize::try_from((self.binding_bytes / 12).min(1 << 24)).unwrap_or(1 << 24)
    }

    /// Planes of constant x that fit one binding, for columns of so many bytes.
    pub(crate) fn slab_planes(&self, plane_bytes: u64) -> u64 {
        self.binding_bytes / plane_bytes.max(1)
    }

    /// The two dimensions of a dispatch of at least so many workgroups.
    pub(crate) fn dispatch(&self, groups: u32) -> [u32; 2] {
        let width = groups.min(self.groups).max(1);
        [width, groups.div_ceil(width)]
    }
}

/// Columns of one triangle that one invocation may take, so that every driver finishes its loops.
///
/// Voxels that are appended to a list take an iteration each, and invocations that run in step those of all their branches:
/// at most 8 for bits along z and 4 for those across, or 14 for the doubled cubes of a solid's shell.
pub(crate) fn columns_per_invocation(mode: Mode, overlap_steps: u32, appends: bool) -> u32 {
    let overlap_voxels = overlap_steps.div_ceil(1 << STEP_BITS);
    let words = 3 + 2 * overlap_voxels.div_ceil(32);
    match (mode, appends) {
        (Mode::Sliced, true) => SAFE_ITERATIONS / (1 + 33 * words),
        (Mode::Sliced, false) => SAFE_ITERATIONS / 4 / words,
        (_, true) => SAFE_ITERATIONS / 16,
        (_, false) => SAFE_ITERATIONS / 4,
    }
}
