//! What can go wrong on a GPU.

use crate::lists::ListMethod;

/// Why a GPU did not voxelize.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GpuError {
    /// There is no adapter at all.
    #[error(
        "no GPU adapter found; install the driver of your GPU (on Debian and Ubuntu `mesa-vulkan-drivers` has those of AMD, \
         Intel and a software one), or use the CPU backend"
    )]
    NoAdapter,
    /// No adapter has the name asked for.
    #[error("no GPU adapter's name or driver contains `{wanted}`; there are: {}", list(there))]
    NoSuchAdapter {
        /// What was asked for.
        wanted: String,
        /// The names of those there are.
        there: Vec<String>,
    },
    /// Only software adapters were found, and none was asked for by name.
    #[error(
        "only software adapters found ({}), which are slower than the CPU backend; name one to use it anyway",
        list(.0)
    )]
    OnlySoftware(Vec<String>),
    /// The adapter gave no device.
    #[error("{adapter}: cannot open the device: {reason}")]
    Device {
        /// The adapter.
        adapter: String,
        /// The driver's reason.
        reason: String,
    },
    /// The adapter computes wrong voxels, so it is not used.
    #[error(
        "{adapter}: refused, because it computes wrong voxels: {reason}; update the driver, choose another adapter or use \
         the CPU backend"
    )]
    WrongVoxels {
        /// The adapter and its driver.
        adapter: String,
        /// What was wrong in the start-up check.
        reason: String,
    },
    /// Something that a shader must see whole is larger than what the adapter binds.
    #[error(
        "{adapter}: {what} need {} in one piece, and the adapter binds {} at most; choose a lower resolution, or use the CPU",
        trixel::Bytes(*needed), trixel::Bytes(*limit)
    )]
    BindingTooSmall {
        /// The adapter.
        adapter: String,
        /// What does not fit.
        what: &'static str,
        /// Bytes needed.
        needed: u64,
        /// Bytes that the adapter binds.
        limit: u64,
    },
    /// A way to make lists that does not suit.
    #[error("{method} makes no list {of}; use {instead}")]
    ListMethod {
        /// The method.
        method: ListMethod,
        /// Of what it makes none.
        of: &'static str,
        /// What does.
        instead: &'static str,
    },
    /// A list in an order that a structure cannot be built from.
    #[error(
        "octrees and brick maps are built from lists along the Morton curve; make the list with `VoxelOrder::Morton`"
    )]
    ListOrder,
    /// Attributes of other voxels than a list's.
    #[error(
        "the attributes are of {attributes} voxels and the list has {list}, or their grids differ; make both of one volume"
    )]
    AttributesOfOthers {
        /// Voxels that the attributes are of.
        attributes: u32,
        /// Voxels of the list.
        list: u32,
    },
    /// The nodes that came back are not an octree's.
    #[error(transparent)]
    Octree(#[from] trixel::octree::OctreeError),
    /// Memory ran out.
    #[error("{adapter}: out of GPU memory; choose a lower resolution, or use the CPU backend")]
    OutOfMemory {
        /// The adapter.
        adapter: String,
    },
    /// The device was lost.
    #[error("{adapter}: the device was lost ({reason}); nothing was written: run again, or use the CPU backend")]
    Lost {
        /// The adapter.
        adapter: String,
        /// The driver's reason.
        reason: String,
    },
    /// The driver or wgpu refused something.
    #[error("{adapter}: {reason}")]
    Refused {
        /// The adapter.
        adapter: String,
        /// Its reason.
        reason: String,
    },
    /// The strategy is not one of the GPU's.
    #[error("the gpu backend has no strategy `{0}`")]
    Strategy(trixel::Strategy),
    /// The strategy has not that mode.
    #[error(
        "strategy `{strategy}` is for mode {}, not for `{mode}`; choose another strategy or mode",
        strategy.modes().iter().map(|mode| format!("`{mode}`")).collect::<Vec<_>>().join(", ")
    )]
    StrategyOfOtherModes {
        /// The strategy.
        strategy: trixel::Strategy,
        /// The job's mode.
        mode: trixel::Mode,
    },
    /// A grid whose single plane of voxels does not fit a binding.
    #[error(
        "one plane of the grid takes {needed} bytes, and {adapter} binds {limit} at most; choose a coarser grid, or use the \
         CPU backend"
    )]
    PlaneTooLarge {
        /// The adapter.
        adapter: String,
        /// Bytes of a plane.
        needed: u64,
        /// Bytes of the largest binding.
        limit: u64,
    },
    /// A grid too long for a 3D texture.
    #[error(
        "the grid is {side} voxels long, and 3D textures of {adapter} at most {limit}; read the voxels from the buffers"
    )]
    TextureTooLarge {
        /// The adapter.
        adapter: String,
        /// The grid's longest side.
        side: u32,
        /// The device's longest.
        limit: u32,
    },
    /// An image of a texture that is too long for the shaders.
    #[error("an image is {side} texels long, and attributes on the GPU take {limit} at most; scale it, or use the CPU")]
    ImageTooLarge {
        /// The image's longer side.
        side: u32,
        /// The longest that the shaders take.
        limit: u32,
    },
    /// The volume has another grid than the job.
    #[error("the volume's grid is not the job's")]
    GridMismatch,
    /// A result that is not there yet.
    #[error(
        "nothing ran since the last recording: submit the encoder's commands to the queue before `Voxelizer::check`"
    )]
    NotSubmitted,
    /// A classification of something else.
    #[error("the classification is of another mesh, grid, mode or dilation; make a new one with `Voxelizer::classify`")]
    OtherClassification,
    /// Triangles of a caller's own buffers are too large for the shaders.
    #[error(
        "{0} triangles are 8192 voxels or longer along an axis, too long for the shaders' arithmetic; upload the mesh with \
         `GpuMesh::upload`, which gives these to the CPU, or split them"
    )]
    TrianglesTooLarge(u64),
    /// More pairs of triangle and column, or of triangle and tile, than 32 bits count.
    #[error("`balanced` and `tiled` would need more than 2^32 invocations for this mesh and grid; use `hybrid`")]
    TooManyColumns,
    /// A strategy whose fragments claim no voxels.
    #[error(
        "strategy `{0}` writes no 3D textures itself; use `sliced` or `slice-per-pass`, or make them from its voxels with \
         `MaterialVolume::from_attributes`"
    )]
    NoClaims(trixel::Strategy),
    /// More copies of triangles than 32 bits number the vertices of.
    #[error("`sliced` would draw more than 2^32 vertices for this mesh, grid and overlap; use `hybrid`")]
    TooManySlices,
    /// Triangles of a caller's own buffers meet more tiles than `tiled` made room for.
    #[error(
        "the triangles meet {needed} tiles, and `tiled` has room for {room} of a mesh whose sizes it does not know; upload it \
         with `GpuMesh::upload`, or use `hybrid`"
    )]
    TooManyTiles {
        /// Pairs of triangle and tile.
        needed: u32,
        /// Those there was room for.
        room: u32,
    },
    /// A job that blends no render targets.
    #[error(
        "render targets are blended by strategy `tiled` on surfaces, not by `{strategy}` in mode `{mode}`; use `tiled` with \
         another mode than `solid`, or `Voxelizer::attributes`"
    )]
    NoTargets {
        /// The job's strategy.
        strategy: trixel::Strategy,
        /// The job's mode.
        mode: trixel::Mode,
    },
    /// No render targets, or more than a workgroup's memory holds.
    #[error(
        "{given} render targets were asked for, and {adapter} blends 1 to {most} at a time, which is what the memory of a \
         workgroup holds; blend them in several runs"
    )]
    TargetCount {
        /// The adapter.
        adapter: String,
        /// Those asked for.
        given: usize,
        /// The most there can be.
        most: usize,
    },
    /// A render target whose values are not one a triangle.
    #[error("render target {target} has {given} values, and the mesh {triangles} triangles; give one value a triangle")]
    TargetValues {
        /// The target's place among those asked for, from 0 on.
        target: usize,
        /// Its values.
        given: u64,
        /// The mesh's triangles.
        triangles: u64,
    },
    /// The part of the mesh that the CPU does failed.
    #[error(transparent)]
    Cpu(#[from] trixel::Error),
}

fn list(names: &[String]) -> String {
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}
