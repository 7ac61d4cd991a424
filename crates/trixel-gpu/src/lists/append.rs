//! Lists that are appended to while voxelizing: \[HCV\] 3.4, and the fragment list of C. Crassin & S. Green,
//! *Octree-Based Sparse Voxelization Using the GPU Hardware Rasterizer*, 2012.

use trixel::{Mode, VoxelOrder, voxel_list};

use super::{ENTRY_BYTES, Entries, GpuVoxelList, ListMethod, Memory, distinct, sort};
use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::kernel::Dispatcher;
use crate::mesh::GpuMesh;
use crate::shader::Sink;
use crate::volume::GpuVolume;
use crate::voxelizer::Voxelizer;

/// Words before the entries: `Appended` of `append.wgsl`.
const HEADER_WORDS: usize = 4;

/// A buffer to append to entries of so many words, begun with some.
fn begun(gpu: &Gpu, words: usize, capacity: u64, before: &[[u32; 2]]) -> Result<wgpu::Buffer, GpuError> {
    let number = |value: u64| u32::try_from(value).unwrap_or(u32::MAX);
    let count = before.len() as u64;
    let capacity = capacity.max(count);
    let bytes = (HEADER_WORDS as u64 + words as u64 * capacity) * 4;
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
    let buffer = gpu.storage("the voxels appended to a list", bytes, usage)?;
    let start = [&[number(count), number(capacity), 0, 0], before.as_flattened()].concat();
    gpu.guarded(|| gpu.queue().write_buffer(&buffer, 0, bytemuck::cast_slice(&start)))?;
    Ok(buffer)
}

/// Lets `run` voxelize into a list of entries of so many words, again with more room where it was too short. Gives the buffer
/// and how many entries it has. `capacity` is a guess; only entries of two words can be there `before`.
pub(crate) fn appended(
    gpu: &Gpu,
    words: usize,
    before: &[[u32; 2]],
    capacity: u64,
    mut run: impl FnMut(&wgpu::Buffer) -> Result<(), GpuError>,
) -> Result<(wgpu::Buffer, u32), GpuError> {
    let limit = (gpu.limits().binding_bytes / 4).saturating_sub(HEADER_WORDS as u64) / words.max(1) as u64;
    let mut capacity = capacity.min(limit);
    loop {
        let buffer = begun(gpu, words, capacity, before)?;
        run(&buffer)?;
        let header = Dispatcher::new(gpu).read_words(&[(&buffer, HEADER_WORDS)])?.into_iter().flatten();
        let header: Vec<u32> = header.collect();
        let (count, wrapped) = (header.first().copied().unwrap_or(0), header.get(2).copied().unwrap_or(0));
        let needed = if wrapped == 0 { u64::from(count) } else { 1 << 32 };
        if needed <= capacity.max(before.len() as u64) {
            return Ok((buffer, count));
        }
        if needed > limit {
            return Err(GpuError::BindingTooSmall {
                adapter: gpu.info().to_string(),
                what: "the voxels appended to a list",
                needed: needed * words as u64 * 4,
                limit: gpu.limits().binding_bytes,
            });
        }
        capacity = needed;
    }
}

/// The list by [`ListMethod::Atomic`] or [`ListMethod::FragmentList`].
pub(crate) fn append(
    voxelizer: &mut Voxelizer,
    mesh: &GpuMesh,
    method: ListMethod,
    order: VoxelOrder,
) -> Result<GpuVoxelList, GpuError> {
    let gpu = voxelizer.gpu().clone();
    let (grid, mode) = (*voxelizer.job().grid(), voxelizer.job().mode());
    let merges = method == ListMethod::FragmentList;
    if merges && mode == Mode::Solid {
        let (of, instead) = ("of a solid, whose inside no triangle meets", "scan, histopyramid or atomic");
        return Err(GpuError::ListMethod { method, of, instead });
    }
    let (sink, volume) = if merges {
        (Sink::Fragments, GpuVolume::without_voxels(&gpu, grid)?)
    } else {
        (Sink::List, GpuVolume::new(&gpu, grid)?)
    };
    // A solid's voxels are all appended at the end, those of the CPU's part among them.
    let by_cpu = if mode == Mode::Solid { None } else { voxelizer.cpu_part(mesh)? };
    let before: Vec<[u32; 2]> =
        by_cpu.iter().flat_map(|volume| voxel_list(volume, VoxelOrder::Xyz)).map(words).collect();
    // About the surface of the grid, or a few voxels a triangle; a wrong guess costs a second run.
    let [x, y, z] = grid.dims().map(u64::from);
    let surface = 2 * (x * y + y * z + z * x);
    let guess = if merges { 2 * surface + 4 * mesh.triangles() } else { surface };
    let (buffer, count) = appended(&gpu, sink.entry_words(), &before, guess, |list| {
        voxelizer.run_appending(mesh, &volume, (sink, list))
    })?;
    let mut memory = Memory::default();
    let entries = Entries::new(&gpu, count)?;
    let mut dispatcher = Dispatcher::new(&gpu);
    dispatcher.copy((&buffer, HEADER_WORDS as u64 * 4), (&entries.buffer, 0), u64::from(count) * ENTRY_BYTES);
    dispatcher.submit()?;
    memory.reach(buffer.size() + if merges { entries.buffer.size() } else { 0 });
    drop(buffer);
    let sorted = sort(&gpu, entries, &grid, order, &mut memory)?;
    let entries = if merges { distinct(&gpu, &sorted, &mut memory)? } else { sorted };
    Ok(GpuVoxelList::new(grid, order, entries, memory))
}

/// An entry: `entry.wgsl`.
fn words([x, y, z]: [u32; 3]) -> [u32; 2] {
    [x | y << 16, z]
}
