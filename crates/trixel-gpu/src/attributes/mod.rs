//! What is in a voxel, on the GPU: the [definition](trixel::attributes) in shaders, with results equal to the CPU's.
//!
//! After \[HCV\] 3.4 and 3.5 and the fragment list of C. Crassin & S. Green, *Octree-Based Sparse Voxelization Using the GPU
//! Hardware Rasterizer*, 2012. The passes of a strategy append every voxel of every triangle with the triangle's number;
//! prefix sums over the bits give each fragment its voxel's place in the list; each fragment adds itself to its voxel's state;
//! and each voxel turns its state into a row. Nothing is as large as the grid but its bits.

#[cfg(test)]
mod interpolation;
mod recipe;
mod surface;

use std::ops::Range;

use trixel::attributes::device::DeviceRows;
use trixel::attributes::{AttributeRequest, Combine, VoxelAttributes};
use trixel::{Job, Mesh, Mode, Strategy, VoxelOrder};

use crate::cutoff::Dilation;
use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::kernel::{Bound, Dispatcher, Kernel};
use crate::lists::{self, Entries, GpuVoxelList, ListMethod, Memory};
use crate::rank::{Ranked, locate_words, rank};
use crate::shader::Sink;
use crate::volume::GpuVolume;
use crate::voxelizer::{Options, Voxelizer};

pub(crate) use recipe::Recipe;
use surface::Chunk;
pub use surface::GpuSurface;

/// Voxels whose states are kept at once: more passes over the triangles, but memory that follows neither grid nor list.
const BATCH_VOXELS: u32 = 1 << 20;
/// Fragments a voxel that there is room for at first.
const GUESSED_FRAGMENTS: u64 = 3;

/// The attributes of a volume's set voxels in buffers of a [`Gpu`], in the order of [`GpuVoxelList`] by x, y, z.
#[derive(Debug)]
pub struct GpuAttributes {
    list: GpuVoxelList,
    request: AttributeRequest,
    row_words: u32,
    /// Rows in order, and how many.
    parts: Vec<(wgpu::Buffer, u32)>,
    /// Triangles of each voxel.
    counts: Vec<u32>,
    surface: bool,
    scratch_bytes: u64,
}

impl GpuAttributes {
    /// The voxels, in the order of the rows.
    #[must_use]
    pub fn list(&self) -> &GpuVoxelList {
        &self.list
    }

    /// What was asked for.
    #[must_use]
    pub fn request(&self) -> &AttributeRequest {
        &self.request
    }

    /// Rows, one after the other as [`trixel::attributes::device::DeviceRows`] tells: a buffer, and how many it has. One
    /// piece with a row a voxel, but with [`Combine::All`] several, with a row a triangle of each voxel.
    #[must_use]
    pub fn rows(&self) -> &[(wgpu::Buffer, u32)] {
        &self.parts
    }

    /// How many triangles each voxel has.
    #[must_use]
    pub fn counts(&self) -> &[u32] {
        &self.counts
    }

    /// Words of a row.
    #[must_use]
    pub fn row_words(&self) -> u32 {
        self.row_words
    }

    /// Bytes of the rows.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.parts.iter().map(|(_, rows)| u64::from(*rows) * u64::from(self.row_words) * 4).sum()
    }

    /// The most bytes that making them took at any time, beside rows, bits and [`GpuSurface`], with [`GpuAttributes::list`].
    #[must_use]
    pub fn scratch_bytes(&self) -> u64 {
        self.scratch_bytes
    }

    /// The same attributes as the CPU has them; `mesh` names the materials.
    ///
    /// # Errors
    /// When memory runs out or the device is lost.
    pub fn download(&self, gpu: &Gpu, mesh: &Mesh) -> Result<VoxelAttributes, GpuError> {
        let mut words = vec![];
        for (buffer, rows) in &self.parts {
            let length = *rows as usize * self.row_words as usize;
            words.extend(Dispatcher::new(gpu).read_words(&[(buffer, length)])?.into_iter().flatten());
        }
        let rows = DeviceRows { words: &words, counts: &self.counts };
        Ok(VoxelAttributes::from_device(mesh, &self.request, self.surface, &rows))
    }
}

/// Voxels with x in a range of a slab, and their places among all.
#[derive(Clone)]
struct Batch {
    x: Range<u32>,
    voxels: Range<u32>,
}

/// All that the batches share.
struct Work<'a> {
    gpu: &'a Gpu,
    surface: &'a GpuSurface,
    recipe: Recipe,
    list: &'a GpuVoxelList,
    /// Makes the fragments.
    painter: Voxelizer,
    sink: Sink,
    memory: Memory,
    parts: Vec<(wgpu::Buffer, u32)>,
    counts: Vec<u32>,
}

/// The attributes of `volume`'s voxels.
pub(crate) fn compute(
    voxelizer: &Voxelizer,
    surface: &GpuSurface,
    volume: &GpuVolume,
) -> Result<GpuAttributes, GpuError> {
    let (gpu, job) = (voxelizer.gpu(), voxelizer.job());
    if volume.grid() != job.grid() || surface.grid() != job.grid() {
        return Err(GpuError::GridMismatch);
    }
    let recipe = Recipe::of(&surface.request);
    let list = GpuVoxelList::of(gpu, volume, ListMethod::Scan, VoxelOrder::Xyz)?;
    let row_words = recipe.row_words();
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
    let mut parts = vec![];
    if recipe.combine() != Combine::All {
        let bytes = u64::from(list.len()) * u64::from(row_words) * 4;
        parts.push((gpu.storage("the voxels' attributes", bytes, usage)?, list.len()));
    }
    let (sink, painted) = match job.mode() {
        // No other strategy's passes know this rule.
        Mode::Solid => {
            (Sink::Shell, Job::new(*job.grid(), Mode::Conservative).with_strategy(Strategy::TriangleParallel))
        }
        // A tile's memory does not keep triangles apart.
        _ if job.strategy() == Strategy::Tiled => (Sink::Pairs, job.with_strategy(Strategy::TriangleParallel)),
        _ => (Sink::Pairs, *job),
    };
    // One triangle each, so that no column can come twice.
    let options = Options { dilation: Dilation::HasselgrenTriangle, cutoff: Some(voxelizer.cutoff()), count: false };
    let painter = Voxelizer::unchecked(gpu, &painted, &options)?;
    let memory = Memory::default();
    let mut work = Work { gpu, surface, recipe, list: &list, painter, sink, memory, parts, counts: vec![] };
    let ranked = rank(gpu, volume)?;
    for slab in &ranked {
        work.batches(volume, slab)?;
    }
    let sums: u64 = ranked.iter().map(|slab| slab.sums.bytes()).sum();
    let Work { memory, parts, counts, .. } = work;
    let scratch_bytes = memory.most() + list.bytes() + sums;
    Ok(GpuAttributes {
        list,
        request: surface.request.clone(),
        row_words,
        parts,
        counts,
        surface: job.mode() != Mode::Solid,
        scratch_bytes,
    })
}

impl Work<'_> {
    /// A slab's voxels, as many planes at a time as there is room for.
    fn batches(&mut self, volume: &GpuVolume, ranked: &Ranked<'_>) -> Result<(), GpuError> {
        let state_bytes = u64::from(self.recipe.state_words()) * 4;
        let fits = u32::try_from(self.gpu.limits().binding_bytes / state_bytes).unwrap_or(u32::MAX);
        let most = BATCH_VOXELS.min(fits);
        let planes = ranked.slab.nx() as usize;
        // A stack, so that what must be halved stays in order.
        let mut waiting: Vec<Range<usize>> = vec![];
        let mut start = 0;
        while start < planes {
            let first = ranked.before[start];
            let length = ranked.before[start + 1..].partition_point(|&place| place - first <= most).max(1);
            waiting.push(start..start + length);
            start += length;
        }
        waiting.reverse();
        while let Some(range) = waiting.pop() {
            let place = |plane: usize| u32::try_from(plane).unwrap_or(u32::MAX) + ranked.slab.x();
            let voxels = ranked.before[range.start]..ranked.before[range.end];
            if voxels.is_empty() {
                continue;
            }
            let batch = Batch { x: place(range.start)..place(range.end), voxels };
            match self.batch(volume, ranked, &batch) {
                Err(GpuError::BindingTooSmall { .. }) if range.len() > 1 => {
                    let middle = range.start + range.len() / 2;
                    waiting.extend([middle..range.end, range.start..middle]);
                }
                done => done?,
            }
        }
        Ok(())
    }

    /// The rows of one batch.
    fn batch(&mut self, volume: &GpuVolume, ranked: &Ranked<'_>, batch: &Batch) -> Result<(), GpuError> {
        let (gpu, recipe) = (self.gpu, self.recipe);
        let voxels = batch.voxels.end - batch.voxels.start;
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        // New buffers hold zeros.
        let bytes = u64::from(voxels) * u64::from(recipe.state_words()) * 4;
        let state = gpu.storage("the voxels' states", bytes, usage)?;
        let mut chunks = vec![];
        let surface = self.surface;
        for chunk in &surface.chunks {
            let fragments = self.fragments(volume, ranked, batch, chunk)?;
            chunks.push((chunk, fragments));
        }
        let held: u64 = chunks.iter().map(|(_, (buffer, _))| buffer.size()).sum();
        self.memory.reach(state.size() + held);
        let each = |dispatcher: &mut Dispatcher<'_>, kernel: Kernel| -> Result<(), GpuError> {
            for (chunk, (fragments, count)) in &chunks {
                let words = chunk.work(*count, batch.voxels.start, voxels);
                let buffers = [fragments, self.list.buffer(), &state].map(Bound::Buffer);
                let own = [vec![(0, Bound::Words(&words))], (1..).zip(buffers).collect()].concat();
                dispatcher.dispatch(kernel, &[own, chunk.bound().to_vec()].concat(), *count)?;
            }
            Ok(())
        };
        let mut dispatcher = Dispatcher::new(gpu);
        if recipe.priorities() {
            each(&mut dispatcher, Kernel::Prioritize(recipe))?;
        }
        each(&mut dispatcher, Kernel::Weigh(recipe))?;
        dispatcher.submit()?;
        if recipe.combine() == Combine::All {
            self.rows_of_fragments(&chunks, batch)?;
        } else {
            self.rows_of_voxels(&chunks, batch, &state)?;
        }
        self.count(&state, voxels)
    }

    /// The fragments of one batch of voxels and one chunk of triangles, located, and how many.
    fn fragments(
        &mut self,
        volume: &GpuVolume,
        ranked: &Ranked<'_>,
        batch: &Batch,
        chunk: &Chunk,
    ) -> Result<(wgpu::Buffer, u32), GpuError> {
        let voxels = batch.voxels.end - batch.voxels.start;
        let window = GpuVolume::window(self.gpu, *volume.grid(), batch.x.clone())?;
        let guess = GUESSED_FRAGMENTS * u64::from(voxels) + 1024;
        let (fragments, count) = lists::appended(self.gpu, self.sink.entry_words(), &[], guess, |list| {
            self.painter.run_appending(&chunk.mesh, &window, (self.sink, list))
        })?;
        let first = batch.voxels.start - ranked.first();
        let words = locate_words(volume, ranked.slab, count, first, chunk.triangles.start);
        let buffers = [ranked.slab.buffer(), ranked.sums.numbers(), &fragments].map(Bound::Buffer);
        let bound = [vec![(0, Bound::Words(&words))], (1..).zip(buffers).collect()].concat();
        let mut dispatcher = Dispatcher::new(self.gpu);
        dispatcher.dispatch(Kernel::LocateFragments, &bound, count)?;
        dispatcher.submit()?;
        Ok((fragments, count))
    }

    fn rows_of_voxels(
        &mut self,
        chunks: &[(&Chunk, (wgpu::Buffer, u32))],
        batch: &Batch,
        state: &wgpu::Buffer,
    ) -> Result<(), GpuError> {
        let Some((rows, _)) = self.parts.first() else { return Ok(()) };
        let voxels = batch.voxels.end - batch.voxels.start;
        let mut dispatcher = Dispatcher::new(self.gpu);
        for (_, (fragments, count)) in chunks {
            let words = [*count];
            let bound = [(0, Bound::Words(&words)), (1, Bound::Buffer(fragments)), (3, Bound::Buffer(state))];
            dispatcher.dispatch(Kernel::ChooseWinners(self.recipe), &bound, *count)?;
        }
        for (chunk, _) in chunks {
            let words = chunk.work(voxels, batch.voxels.start, voxels);
            let own = [(0, Bound::Words(&words)), (2, Bound::Buffer(self.list.buffer())), (3, Bound::Buffer(state))];
            let bound = [&own[..], &chunk.bound(), &[(9, Bound::Buffer(rows))]].concat();
            dispatcher.dispatch(Kernel::WriteVoxelRows(self.recipe), &bound, voxels)?;
        }
        dispatcher.submit()
    }

    fn rows_of_fragments(&mut self, chunks: &[(&Chunk, (wgpu::Buffer, u32))], batch: &Batch) -> Result<(), GpuError> {
        let gpu = self.gpu;
        let most = chunks.iter().fold(0u32, |sum, (_, (_, count))| sum.saturating_add(*count));
        let mut pairs = Entries::new(gpu, most)?;
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let gathered = gpu.storage("trixel pairs gathered", 4, usage)?;
        let mut dispatcher = Dispatcher::new(gpu);
        for (_, (fragments, count)) in chunks {
            let words = [*count];
            let buffers = [fragments, &gathered, &pairs.buffer].map(Bound::Buffer);
            let bound = [vec![(0, Bound::Words(&words))], (1..).zip(buffers).collect()].concat();
            dispatcher.dispatch(Kernel::GatherPairs(self.recipe), &bound, *count)?;
        }
        let read = dispatcher.read_words(&[(&gathered, 1)])?;
        pairs.length = read.into_iter().flatten().next().unwrap_or(0);
        let voxels = batch.voxels.end - batch.voxels.start;
        let triangles = self.surface.chunks.last().map_or(0, |chunk| chunk.triangles.end);
        let pairs = lists::sort_pairs(gpu, pairs, voxels, triangles, &mut self.memory)?;
        let bytes = u64::from(pairs.length) * u64::from(self.recipe.row_words()) * 4;
        let rows = gpu.storage("the voxels' attributes", bytes, usage)?;
        let mut dispatcher = Dispatcher::new(gpu);
        for (chunk, _) in chunks {
            let words = chunk.work(pairs.length, batch.voxels.start, voxels);
            let [pairs_bound, list] = [&pairs.buffer, self.list.buffer()].map(Bound::Buffer);
            let own = [(0, Bound::Words(&words)), (1, pairs_bound), (2, list)];
            let bound = [&own[..], &chunk.bound(), &[(9, Bound::Buffer(&rows))]].concat();
            dispatcher.dispatch(Kernel::WriteFragmentRows(self.recipe), &bound, pairs.length)?;
        }
        dispatcher.submit()?;
        self.parts.push((rows, pairs.length));
        Ok(())
    }

    /// Reads how many triangles the batch's voxels have.
    fn count(&mut self, state: &wgpu::Buffer, voxels: u32) -> Result<(), GpuError> {
        let counts = Entries::new(self.gpu, voxels.div_ceil(2))?;
        let words = [voxels];
        let bound = [(0, Bound::Words(&words)), (3, Bound::Buffer(&counts.buffer)), (4, Bound::Buffer(state))];
        let mut dispatcher = Dispatcher::new(self.gpu);
        dispatcher.dispatch(Kernel::CopyCounts(self.recipe), &bound, counts.length)?;
        let read = dispatcher.read_words(&[(&counts.buffer, voxels as usize)])?;
        self.counts.extend(read.into_iter().flatten());
        Ok(())
    }
}
