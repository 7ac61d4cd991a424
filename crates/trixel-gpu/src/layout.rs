//! How a job is cut into dispatches and draws: slabs of the grid, chunks of the mesh, shares of the columns, windows of the
//! raster target.

use bytemuck::{Pod, Zeroable};
use trixel::{Job, Mode};

use crate::error::GpuError;
use crate::limits::{self, MAX_EXTENT};
use crate::mesh::{Chunk, GpuMesh};
use crate::passes::Setting;
use crate::pipelines::bind;
use crate::volume::{GpuVolume, Slab};

/// `Params` of `common.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Params {
    dims: [u32; 3],
    column_words: u32,
    slab_x: u32,
    slab_nx: u32,
    overlap: u32,
    triangles: u32,
    first_column: u32,
    max_columns: u32,
    cutoff: f32,
    first_triangle: u32,
    window: [u32; 2],
    window_size: [f32; 2],
}

/// The parts of a job, and the buffer with the parameters of all their dispatches.
pub(crate) struct Layout<'a> {
    pub(crate) parts: Vec<Part<'a>>,
    /// Pixels along a side of the raster target.
    pub(crate) target_size: u32,
    /// The largest chunk's triangles.
    pub(crate) most_triangles: u32,
    pub(crate) parameters: wgpu::Buffer,
    /// Where in that buffer the run's number lies.
    pub(crate) run_offset: u64,
}

/// One slab of voxels, and what goes into it.
pub(crate) struct Part<'a> {
    pub(crate) slab: &'a Slab,
    /// Bound for stages that look at no triangles, with `parameters`.
    pub(crate) bind_group: wgpu::BindGroup,
    pub(crate) parameters: u32,
    pub(crate) units: Vec<Unit<'a>>,
}

/// One chunk of triangles into one slab.
pub(crate) struct Unit<'a> {
    /// Counts the units of all slabs.
    pub(crate) index: usize,
    pub(crate) chunk: &'a Chunk,
    pub(crate) bind_group: wgpu::BindGroup,
    /// Offset of the parameters of stages that take every column: those of the first share.
    pub(crate) parameters: u32,
    /// Offsets of the parameters of the other shares of the columns.
    pub(crate) later_shares: Vec<u32>,
    /// Offsets of the parameters, one for each window of the raster target.
    pub(crate) windows: Vec<u32>,
}

/// Parameter sets in one buffer, at the stride that the device wants.
struct ParameterSets {
    bytes: Vec<u8>,
    stride: usize,
}

impl ParameterSets {
    /// Appends one and gives its offset.
    fn push(&mut self, params: &Params) -> u32 {
        let offset = self.bytes.len();
        self.bytes.extend_from_slice(bytemuck::bytes_of(params));
        self.bytes.resize(offset + self.stride, 0);
        u32::try_from(offset).unwrap_or(u32::MAX)
    }
}

/// Width and height of the projections that a slab's triangles are rasterized in, and the most columns of one.
fn projection(job: &Job, slab: &Slab) -> ([u32; 2], u64) {
    let [_, ny, nz] = job.grid().dims();
    let nx = slab.nx();
    let area = |a: u32, b: u32| u64::from(a) * u64::from(b);
    if matches!(job.mode(), Mode::Solid | Mode::Sliced) {
        ([nx, ny], area(nx, ny))
    } else {
        ([nx.max(ny).max(nz); 2], area(nx, ny).max(area(ny, nz)).max(area(nz, nx)))
    }
}

/// The most columns of any triangle that the shaders take.
const MOST_COLUMNS: u64 = {
    let side = (MAX_EXTENT >> trixel::lattice::STEP_BITS).cast_unsigned() + 3;
    side * side
};

impl<'a> Layout<'a> {
    pub(crate) fn new(setting: &Setting<'a>, run: u32) -> Result<Self, GpuError> {
        let Setting { gpu, job, cutoff, mesh, volume, ref scratch, .. } = *setting;
        let appends = setting.variant.sink.entry_words() > 0;
        let largest = volume.slabs().iter().flat_map(|slab| projection(job, slab).0).max();
        let target_size = largest.unwrap_or(1).min(gpu.limits().target_size);
        let max_columns = limits::columns_per_invocation(job.mode(), job.overlap_steps(), appends);
        let mut sets = ParameterSets { bytes: vec![], stride: gpu.limits().parameter_stride as usize };
        let mut laid_out = vec![];
        for slab in volume.slabs() {
            let ([width, height], most) = projection(job, slab);
            let most = most.min(mesh.most_columns.unwrap_or(MOST_COLUMNS));
            let base = Params {
                dims: job.grid().dims(),
                column_words: volume.column_words,
                slab_x: slab.x(),
                slab_nx: slab.nx(),
                overlap: job.overlap_steps(),
                triangles: 0,
                first_column: 0,
                max_columns,
                cutoff: cutoff.value,
                first_triangle: 0,
                window: [0; 2],
                #[expect(clippy::cast_precision_loss, reason = "at most 8192")]
                window_size: [target_size as f32; 2],
            };
            let mut chunks = vec![];
            let mut first_triangle = 0;
            for chunk in &mesh.chunks {
                let params = Params { triangles: chunk.triangles, first_triangle, ..base };
                first_triangle += chunk.triangles;
                let parameters = sets.push(&params);
                let later_shares: Vec<u32> = (0..most)
                    .step_by(max_columns as usize)
                    .skip(1)
                    .map(|first| {
                        sets.push(&Params { first_column: u32::try_from(first).unwrap_or(u32::MAX), ..params })
                    })
                    .collect();
                let mut windows = vec![];
                for x in (0..width).step_by(target_size as usize) {
                    for y in (0..height).step_by(target_size as usize) {
                        windows.push(sets.push(&Params { window: [x, y], ..params }));
                    }
                }
                chunks.push((chunk, parameters, later_shares, windows));
            }
            laid_out.push((slab, sets.push(&base), chunks));
        }
        let run_offset = sets.bytes.len() as u64;
        sets.bytes.extend_from_slice(&run.to_le_bytes());
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_SRC;
        let buffer = gpu.buffer_with("trixel parameters", &sets.bytes, usage)?;

        let bind_to = |slab: &Slab, positions: &wgpu::Buffer, indices: &wgpu::Buffer| {
            let parameters = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                buffer: &buffer,
                offset: 0,
                size: wgpu::BufferSize::new(size_of::<Params>() as u64),
            });
            let buffers = [positions, indices, slab.buffer(), &scratch.counters];
            let [positions, indices, voxels, counters] = buffers.map(wgpu::Buffer::as_entire_binding);
            bind(gpu, &gpu.pipelines().layouts().common, &[parameters, positions, indices, voxels, counters])
        };
        let mut next = 0;
        let parts = laid_out.into_iter().map(|(slab, parameters, chunks)| {
            let units = chunks.into_iter().map(|(chunk, parameters, later_shares, windows)| {
                let bind_group = bind_to(slab, &chunk.positions, &chunk.indices);
                next += 1;
                Unit { index: next - 1, chunk, bind_group, parameters, later_shares, windows }
            });
            let units = units.collect();
            Part { slab, bind_group: bind_to(slab, &scratch.nothing, &scratch.nothing), parameters, units }
        });
        let parts = parts.collect();
        let most_triangles = mesh.chunks.iter().map(|chunk| chunk.triangles).max().unwrap_or(0);
        Ok(Self { parts, target_size, most_triangles, parameters: buffer, run_offset })
    }

    /// Units of a mesh and a volume.
    pub(crate) fn units(mesh: &GpuMesh, volume: &GpuVolume) -> usize {
        mesh.chunks.len() * volume.slabs().len()
    }
}
