//! The passes of each strategy, recorded into a command encoder.

use bytemuck::{Pod, Zeroable};
use trixel::{Job, Mode, Strategy, Volume};

use crate::counters;
use crate::cutoff::{Cutoff, Dilation};
use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::limits::{self, SCAN_BLOCK, WORKGROUP};
use crate::mesh::{Chunk, GpuMesh};
use crate::pipelines::{Pipeline, TARGET_FORMAT, bind};
use crate::shader::{Stage, Variant};
use crate::timer::Timer;
use crate::volume::{GpuVolume, Slab};
use crate::voxelizer::Classification;

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
    unused: u32,
    window: [u32; 2],
    window_size: [f32; 2],
}

/// Offset of a dispatch's arguments after those of a draw, in `arguments.wgsl`.
const DISPATCH_OFFSET: u64 = 16;

/// Buffers kept between runs, as large as any run needed so far.
#[derive(Debug)]
pub(crate) struct Scratch {
    counters: wgpu::Buffer,
    status: wgpu::Buffer,
    status_bytes: u64,
    lists: Option<Lists>,
    scan: Option<ScanBuffers>,
    target: Option<(u32, wgpu::TextureView)>,
    nothing: wgpu::Buffer,
}

/// Small and large triangles, their numbers, and the arguments of the dispatch and the draw over them.
#[derive(Debug)]
pub(crate) struct Lists {
    small: List,
    large: List,
}

#[derive(Debug)]
struct List {
    triangles: wgpu::Buffer,
    count: wgpu::Buffer,
    arguments: wgpu::Buffer,
}

/// The prefix sum's levels: each holds the totals of the blocks of the one before; the last is the sum of all.
#[derive(Debug)]
struct ScanBuffers {
    levels: Vec<wgpu::Buffer>,
    arguments: wgpu::Buffer,
}

impl List {
    fn new(gpu: &Gpu, capacity: u32) -> Result<Self, GpuError> {
        let storage = wgpu::BufferUsages::STORAGE;
        Ok(Self {
            triangles: gpu.buffer("trixel list", u64::from(capacity) * 4, storage)?,
            count: gpu.buffer("trixel list length", 4, storage | wgpu::BufferUsages::COPY_DST)?,
            arguments: gpu.buffer("trixel arguments", 28, storage | wgpu::BufferUsages::INDIRECT)?,
        })
    }

    fn holds(&self, capacity: u32) -> bool {
        self.triangles.size() >= u64::from(capacity) * 4
    }
}

impl Lists {
    fn new(gpu: &Gpu, capacity: u32) -> Result<Self, GpuError> {
        Ok(Self { small: List::new(gpu, capacity)?, large: List::new(gpu, capacity)? })
    }
}

impl Scratch {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let counters = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        Ok(Self {
            counters: gpu.buffer("trixel counters", counters::BYTES, counters)?,
            status: status_buffer(gpu, counters::BYTES)?,
            status_bytes: counters::BYTES,
            lists: None,
            scan: None,
            target: None,
            nothing: gpu.buffer("trixel nothing", 4, wgpu::BufferUsages::STORAGE)?,
        })
    }

    /// Where the counters and totals of the last run end up, and how many bytes they are.
    pub(crate) fn status(&self) -> (&wgpu::Buffer, u64) {
        (&self.status, self.status_bytes)
    }
}

fn status_buffer(gpu: &Gpu, bytes: u64) -> Result<wgpu::Buffer, GpuError> {
    gpu.buffer("trixel status", bytes, wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST)
}

/// All that a recording depends on.
pub(crate) struct Setting<'a> {
    pub(crate) gpu: &'a Gpu,
    pub(crate) job: &'a Job,
    pub(crate) variant: Variant,
    pub(crate) dilation: Dilation,
    pub(crate) cutoff: Cutoff,
    pub(crate) mesh: &'a GpuMesh,
    pub(crate) volume: &'a GpuVolume,
    pub(crate) scratch: &'a mut Scratch,
    pub(crate) timer: Option<&'a mut Timer>,
}

/// One slab of voxels, and what goes into it.
struct Part<'a> {
    slab: &'a Slab,
    /// Bound for stages that look at no triangles, with `parameters`.
    bind_group: wgpu::BindGroup,
    parameters: u32,
    units: Vec<Unit<'a>>,
}

/// One chunk of triangles into one slab.
struct Unit<'a> {
    /// Counts the units of all slabs.
    index: usize,
    chunk: &'a Chunk,
    bind_group: wgpu::BindGroup,
    /// Offsets of the parameters, one for each share of the columns.
    shares: Vec<u32>,
    /// Offsets of the parameters, one for each window of the raster target.
    windows: Vec<u32>,
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

pub(crate) struct Recorder<'a> {
    setting: Setting<'a>,
    parts: Vec<Part<'a>>,
    target_size: u32,
}

impl<'a> Recorder<'a> {
    pub(crate) fn new(setting: Setting<'a>) -> Result<Self, GpuError> {
        let largest = setting.volume.slabs().iter().map(|slab| projection(setting.job, slab).0.into_iter().max());
        let target_size = largest.flatten().max().unwrap_or(1).min(setting.gpu.limits().target_size);
        let parts = lay_out(&setting, target_size)?;
        let units: usize = parts.iter().map(|part| part.units.len()).sum();
        let status_bytes = counters::BYTES + 4 * units as u64;
        if setting.scratch.status_bytes != status_bytes {
            setting.scratch.status = status_buffer(setting.gpu, status_bytes)?;
            setting.scratch.status_bytes = status_bytes;
        }
        Ok(Self { setting, parts, target_size })
    }

    /// Records the whole voxelization.
    pub(crate) fn record(
        mut self,
        encoder: &mut wgpu::CommandEncoder,
        strategy: Strategy,
        classification: Option<&Classification>,
        initial: Option<&Volume>,
    ) -> Result<(), GpuError> {
        let units: usize = self.parts.iter().map(|part| part.units.len()).sum();
        if classification.is_some_and(|given| {
            let Classification { units: lists, mode, dilation } = given;
            (lists.len(), *mode, *dilation) != (units, self.setting.job.mode(), self.setting.dilation)
        }) {
            return Err(GpuError::OtherClassification);
        }
        encoder.clear_buffer(&self.setting.scratch.counters, 0, None);
        encoder.clear_buffer(&self.setting.scratch.status, 0, None);
        self.prepare(strategy, classification.is_some())?;
        let mut words = initial.map(|volume| bytemuck::cast_slice::<u64, u8>(volume.words()));
        for part in std::mem::take(&mut self.parts) {
            let bytes = self.setting.volume.slab_bytes(part.slab);
            match &mut words {
                None => encoder.clear_buffer(part.slab.buffer(), 0, Some(bytes)),
                Some(rest) => {
                    let (here, others) = rest.split_at(usize::try_from(bytes).unwrap_or(usize::MAX));
                    *rest = others;
                    let staging =
                        self.setting.gpu.buffer_with("trixel initial voxels", here, wgpu::BufferUsages::COPY_SRC)?;
                    encoder.copy_buffer_to_buffer(&staging, 0, part.slab.buffer(), 0, bytes);
                }
            }
            for unit in &part.units {
                match strategy {
                    Strategy::FragmentParallel => self.fragment_parallel(encoder, unit, None),
                    Strategy::Hybrid => self.hybrid(encoder, unit),
                    Strategy::HybridTwoPass => self.hybrid_two_pass(encoder, unit, classification),
                    Strategy::Balanced => self.balanced(encoder, unit)?,
                    _ => self.triangle_parallel(encoder, unit),
                }
            }
            if self.setting.job.mode() == Mode::Solid {
                self.fill(encoder, &part);
            }
        }
        encoder.copy_buffer_to_buffer(
            &self.setting.scratch.counters,
            0,
            &self.setting.scratch.status,
            0,
            counters::BYTES,
        );
        if let Some(timer) = &self.setting.timer {
            timer.resolve(encoder);
        }
        Ok(())
    }

    /// Records the sorting of all triangles into new lists.
    pub(crate) fn classify_all(&mut self, encoder: &mut wgpu::CommandEncoder) -> Result<Classification, GpuError> {
        encoder.clear_buffer(&self.setting.scratch.counters, 0, None);
        encoder.clear_buffer(&self.setting.scratch.status, 0, None);
        let parts = std::mem::take(&mut self.parts);
        let mut units = vec![];
        for unit in parts.iter().flat_map(|part| &part.units) {
            let lists = Lists::new(self.setting.gpu, unit.chunk.triangles)?;
            self.classify(encoder, unit, &lists);
            units.push(lists);
        }
        let scratch = &*self.setting.scratch;
        encoder.copy_buffer_to_buffer(&scratch.counters, 0, &scratch.status, 0, counters::BYTES);
        Ok(Classification { units, mode: self.setting.job.mode(), dilation: self.setting.dilation })
    }

    /// Makes sure of the buffers that a strategy needs.
    fn prepare(&mut self, strategy: Strategy, classified: bool) -> Result<(), GpuError> {
        let gpu = self.setting.gpu;
        let capacity = self.setting.mesh.chunks.iter().map(|chunk| chunk.triangles).max().unwrap_or(0);
        let scratch = &mut *self.setting.scratch;
        let fits = |lists: &Lists| lists.small.holds(capacity) && lists.large.holds(capacity);
        let wants_lists = !matches!(strategy, Strategy::FragmentParallel | Strategy::Balanced) && !classified;
        if wants_lists && !scratch.lists.as_ref().is_some_and(fits) {
            scratch.lists = Some(Lists::new(gpu, capacity)?);
        }
        let fits =
            |scan: &ScanBuffers| scan.levels.first().is_some_and(|level| level.size() >= u64::from(capacity) * 4);
        if strategy == Strategy::Balanced && !scratch.scan.as_ref().is_some_and(fits) {
            scratch.scan = Some(ScanBuffers::new(gpu, capacity)?);
        }
        let rasters = matches!(strategy, Strategy::FragmentParallel | Strategy::Hybrid | Strategy::HybridTwoPass);
        if rasters && scratch.target.as_ref().is_none_or(|(size, _)| *size != self.target_size) {
            scratch.target = Some((self.target_size, target(gpu, self.target_size)?));
        }
        Ok(())
    }

    fn triangle_parallel(&mut self, encoder: &mut wgpu::CommandEncoder, unit: &Unit<'_>) {
        let Some(lists) = self.setting.scratch.lists.take() else { return };
        let list = &lists.large;
        encoder.clear_buffer(&list.count, 0, None);
        let written = self.list_group(list, true);
        let read = self.list_group(list, false);
        let arguments = self.arguments_group(&list.count, &list.arguments);
        let first = self.compute_pipeline(Stage::TriangleParallel { defers: None });
        let rest = self.compute_pipeline(Stage::TriangleList { small: false });
        let count = self.compute_pipeline(Stage::Arguments { vertices: 3 });
        let groups = self.groups(unit.chunk.triangles);
        let mut pass = self.begin(encoder, "triangle-parallel");
        run(&mut pass, &first, &unit.bind_group, unit.shares.first(), Some(&written), groups);
        run(&mut pass, &count, &arguments, None, None, [1, 1]);
        for share in &unit.shares {
            run_indirect(&mut pass, &rest, &unit.bind_group, *share, &read, &list.arguments);
        }
        drop(pass);
        self.setting.scratch.lists = Some(lists);
    }

    fn hybrid(&mut self, encoder: &mut wgpu::CommandEncoder, unit: &Unit<'_>) {
        let Some(lists) = self.setting.scratch.lists.take() else { return };
        let list = &lists.large;
        encoder.clear_buffer(&list.count, 0, None);
        let written = self.list_group(list, true);
        let arguments = self.arguments_group(&list.count, &list.arguments);
        let first = self.compute_pipeline(Stage::TriangleParallel { defers: Some(self.setting.cutoff.heuristic) });
        let count = self.compute_pipeline(Stage::Arguments { vertices: self.setting.dilation.vertices() });
        let groups = self.groups(unit.chunk.triangles);
        let mut pass = self.begin(encoder, "triangle-parallel");
        run(&mut pass, &first, &unit.bind_group, unit.shares.first(), Some(&written), groups);
        run(&mut pass, &count, &arguments, None, None, [1, 1]);
        drop(pass);
        self.fragment_parallel(encoder, unit, Some(list));
        self.setting.scratch.lists = Some(lists);
    }

    fn hybrid_two_pass(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        unit: &Unit<'_>,
        classification: Option<&Classification>,
    ) {
        let own = self.setting.scratch.lists.take();
        let kept = classification.and_then(|classification| classification.units.get(unit.index));
        if let Some(lists) = kept.or(own.as_ref()) {
            if kept.is_none() {
                self.classify(encoder, unit, lists);
            }
            let read = self.list_group(&lists.small, false);
            let small = self.compute_pipeline(Stage::TriangleList { small: true });
            let mut pass = self.begin(encoder, "triangle-parallel");
            if let Some(share) = unit.shares.first() {
                run_indirect(&mut pass, &small, &unit.bind_group, *share, &read, &lists.small.arguments);
            }
            drop(pass);
            self.fragment_parallel(encoder, unit, Some(&lists.large));
        }
        self.setting.scratch.lists = own;
    }

    fn classify(&mut self, encoder: &mut wgpu::CommandEncoder, unit: &Unit<'_>, lists: &Lists) {
        encoder.clear_buffer(&lists.small.count, 0, None);
        encoder.clear_buffer(&lists.large.count, 0, None);
        let gpu = self.setting.gpu;
        let group = bind(
            gpu,
            &gpu.pipelines().layouts().classify,
            &[&lists.small.triangles, &lists.small.count, &lists.large.triangles, &lists.large.count]
                .map(wgpu::Buffer::as_entire_binding),
        );
        let classify = self.compute_pipeline(Stage::Classify { heuristic: self.setting.cutoff.heuristic });
        let vertices = self.setting.dilation.vertices();
        let count = self.compute_pipeline(Stage::Arguments { vertices });
        let small = self.arguments_group(&lists.small.count, &lists.small.arguments);
        let large = self.arguments_group(&lists.large.count, &lists.large.arguments);
        let groups = self.groups(unit.chunk.triangles);
        let mut pass = self.begin(encoder, "classify");
        run(&mut pass, &classify, &unit.bind_group, unit.shares.first(), Some(&group), groups);
        run(&mut pass, &count, &small, None, None, [1, 1]);
        run(&mut pass, &count, &large, None, None, [1, 1]);
    }

    /// Rasterizes the triangles of a list, or all of them.
    fn fragment_parallel(&mut self, encoder: &mut wgpu::CommandEncoder, unit: &Unit<'_>, list: Option<&List>) {
        let stage = Stage::FragmentParallel { listed: list.is_some(), dilation: self.setting.dilation };
        let gpu = self.setting.gpu;
        let Pipeline::Raster(pipeline) = self.pipeline(stage) else { return };
        let Some((_, target)) = &self.setting.scratch.target else { return };
        let triangles = list.map_or(&self.setting.scratch.nothing, |list| &list.triangles);
        let group = bind(gpu, &gpu.pipelines().layouts().list_draw, &[triangles.as_entire_binding()]);
        for window in &unit.windows {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("fragment-parallel"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: target,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                        store: wgpu::StoreOp::Discard,
                    },
                })],
                timestamp_writes: self.setting.timer.as_mut().and_then(|timer| timer.render("fragment-parallel")),
                ..Default::default()
            });
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &unit.bind_group, &[*window]);
            pass.set_bind_group(1, &group, &[]);
            match list {
                Some(list) => pass.draw_indirect(&list.arguments, 0),
                None => pass.draw(0..unit.chunk.triangles * self.setting.dilation.vertices(), 0..1),
            }
        }
    }

    fn balanced(&mut self, encoder: &mut wgpu::CommandEncoder, unit: &Unit<'_>) -> Result<(), GpuError> {
        let gpu = self.setting.gpu;
        let layouts = gpu.pipelines().layouts();
        let Some(scan) = self.setting.scratch.scan.take() else { return Ok(()) };
        let levels = &scan.levels;
        let counted = bind(gpu, &layouts.columns, &[levels[0].as_entire_binding()]);
        let triangles = unit.chunk.triangles;

        let stride = gpu.limits().parameter_stride;
        let mut lengths: Vec<u32> = vec![triangles];
        while let Some(&length) = lengths.last()
            && lengths.len() + 1 < levels.len()
        {
            lengths.push(length.div_ceil(SCAN_BLOCK));
        }
        let mut bytes = vec![0u8; lengths.len() * stride as usize];
        for (slot, length) in bytes.chunks_exact_mut(stride as usize).zip(&lengths) {
            slot[..4].copy_from_slice(&length.to_le_bytes());
        }
        let length_buffer = gpu.buffer_with("trixel scan lengths", &bytes, wgpu::BufferUsages::UNIFORM)?;
        let scan_groups: Vec<_> = levels
            .iter()
            .zip(levels.iter().skip(1))
            .map(|(data, totals)| {
                let length = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                    buffer: &length_buffer,
                    offset: 0,
                    size: wgpu::BufferSize::new(4),
                });
                bind(gpu, &layouts.scan, &[length, data.as_entire_binding(), totals.as_entire_binding()])
            })
            .collect();
        let total = &levels[levels.len() - 1];
        let arguments = self.arguments_group(total, &scan.arguments);
        let pairs = bind(gpu, &layouts.list_read, &[&levels[0], total].map(wgpu::Buffer::as_entire_binding));

        let count = self.compute_pipeline(Stage::CountColumns);
        let scan_blocks = self.compute_pipeline(Stage::ScanBlocks);
        let add_totals = self.compute_pipeline(Stage::AddTotals);
        let write_arguments = self.compute_pipeline(Stage::Arguments { vertices: 0 });
        let main = self.compute_pipeline(Stage::Balanced);
        let groups = self.groups(triangles);

        let mut pass = self.begin(encoder, "count and scan");
        run(&mut pass, &count, &unit.bind_group, unit.shares.first(), Some(&counted), groups);
        let offsets: Vec<u32> = (0u32..).zip(&lengths).map(|(level, _)| level * stride).collect();
        for ((group, length), offset) in scan_groups.iter().zip(&lengths).zip(&offsets) {
            run(&mut pass, &scan_blocks, group, Some(offset), None, [length.div_ceil(SCAN_BLOCK), 1]);
        }
        for ((group, length), offset) in scan_groups.iter().zip(&lengths).zip(&offsets).rev().skip(1) {
            run(&mut pass, &add_totals, group, Some(offset), None, [length.div_ceil(SCAN_BLOCK), 1]);
        }
        run(&mut pass, &write_arguments, &arguments, None, None, [1, 1]);
        drop(pass);
        let mut pass = self.begin(encoder, "balanced");
        if let Some(share) = unit.shares.first() {
            run_indirect(&mut pass, &main, &unit.bind_group, *share, &pairs, &scan.arguments);
        }
        drop(pass);
        encoder.copy_buffer_to_buffer(
            total,
            0,
            &self.setting.scratch.status,
            counters::BYTES + 4 * unit.index as u64,
            4,
        );
        self.setting.scratch.scan = Some(scan);
        Ok(())
    }

    fn fill(&mut self, encoder: &mut wgpu::CommandEncoder, part: &Part<'_>) {
        let fill = self.compute_pipeline(Stage::Fill);
        let groups = self.groups(part.slab.nx() * self.setting.job.grid().dims()[1]);
        let mut pass = self.begin(encoder, "fill");
        run(&mut pass, &fill, &part.bind_group, Some(&part.parameters), None, groups);
    }

    fn begin<'e>(&mut self, encoder: &'e mut wgpu::CommandEncoder, name: &'static str) -> wgpu::ComputePass<'e> {
        encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some(name),
            timestamp_writes: self.setting.timer.as_mut().and_then(|timer| timer.compute(name)),
        })
    }

    fn pipeline(&self, stage: Stage) -> Pipeline {
        let gpu = self.setting.gpu;
        gpu.pipelines().get(gpu.device(), stage, self.setting.variant, gpu.limits().groups)
    }

    fn compute_pipeline(&self, stage: Stage) -> Option<std::sync::Arc<wgpu::ComputePipeline>> {
        match self.pipeline(stage) {
            Pipeline::Compute(pipeline) => Some(pipeline),
            Pipeline::Raster(_) => None,
        }
    }

    /// The dispatch of one invocation each.
    fn groups(&self, invocations: u32) -> [u32; 2] {
        self.setting.gpu.limits().dispatch(invocations.div_ceil(WORKGROUP))
    }

    fn list_group(&self, list: &List, written: bool) -> wgpu::BindGroup {
        let layouts = self.setting.gpu.pipelines().layouts();
        let layout = if written { &layouts.list_write } else { &layouts.list_read };
        bind(self.setting.gpu, layout, &[&list.triangles, &list.count].map(wgpu::Buffer::as_entire_binding))
    }

    fn arguments_group(&self, count: &wgpu::Buffer, arguments: &wgpu::Buffer) -> wgpu::BindGroup {
        let gpu = self.setting.gpu;
        bind(gpu, &gpu.pipelines().layouts().arguments, &[count, arguments].map(wgpu::Buffer::as_entire_binding))
    }
}

impl ScanBuffers {
    fn new(gpu: &Gpu, capacity: u32) -> Result<Self, GpuError> {
        let storage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let mut levels = vec![];
        let mut length = capacity.max(1);
        loop {
            levels.push(gpu.buffer("trixel prefix sums", u64::from(length) * 4, storage)?);
            if length == 1 && levels.len() > 1 {
                break;
            }
            length = length.div_ceil(SCAN_BLOCK);
        }
        let indirect = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::INDIRECT;
        Ok(Self { levels, arguments: gpu.buffer("trixel arguments", 28, indirect)? })
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

/// Lays out all parameters in one buffer, and binds the units to it.
fn lay_out<'a>(setting: &Setting<'a>, target_size: u32) -> Result<Vec<Part<'a>>, GpuError> {
    let Setting { gpu, job, mesh, volume, cutoff, .. } = *setting;
    let max_columns = limits::columns_per_invocation(job.mode(), job.overlap_steps());
    let mut sets = ParameterSets { bytes: vec![], stride: gpu.limits().parameter_stride as usize };
    let mut laid_out = vec![];
    for slab in volume.slabs() {
        let ([width, height], most) = projection(job, slab);
        let most = mesh.most_columns.map_or(most, |mesh| mesh.min(most)).max(1);
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
            unused: 0,
            window: [0; 2],
            #[expect(clippy::cast_precision_loss, reason = "at most 8192")]
            window_size: [target_size as f32; 2],
        };
        let mut chunks = vec![];
        for chunk in &mesh.chunks {
            let params = Params { triangles: chunk.triangles, ..base };
            let shares: Vec<u32> = (0..most)
                .step_by(max_columns as usize)
                .map(|first| sets.push(&Params { first_column: u32::try_from(first).unwrap_or(u32::MAX), ..params }))
                .collect();
            let mut windows = vec![];
            for x in (0..width).step_by(target_size as usize) {
                for y in (0..height).step_by(target_size as usize) {
                    windows.push(sets.push(&Params { window: [x, y], ..params }));
                }
            }
            chunks.push((chunk, shares, windows));
        }
        laid_out.push((slab, sets.push(&base), chunks));
    }
    let buffer = gpu.buffer_with("trixel parameters", &sets.bytes, wgpu::BufferUsages::UNIFORM)?;
    let bind_to = |slab: &Slab, positions: &wgpu::Buffer, indices: &wgpu::Buffer| {
        let parameters = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &buffer,
            offset: 0,
            size: wgpu::BufferSize::new(size_of::<Params>() as u64),
        });
        let buffers = [positions, indices, slab.buffer(), &setting.scratch.counters];
        let [positions, indices, voxels, counters] = buffers.map(wgpu::Buffer::as_entire_binding);
        bind(gpu, &gpu.pipelines().layouts().common, &[parameters, positions, indices, voxels, counters])
    };
    let mut next = 0;
    let parts = laid_out.into_iter().map(|(slab, parameters, chunks)| {
        let units = chunks.into_iter().map(|(chunk, shares, windows)| {
            let bind_group = bind_to(slab, &chunk.positions, &chunk.indices);
            next += 1;
            Unit { index: next - 1, chunk, bind_group, shares, windows }
        });
        let units = units.collect();
        let nothing = &setting.scratch.nothing;
        Part { slab, bind_group: bind_to(slab, nothing, nothing), parameters, units }
    });
    Ok(parts.collect())
}

fn target(gpu: &Gpu, size: u32) -> Result<wgpu::TextureView, GpuError> {
    let texture = gpu.guarded(|| {
        gpu.device().create_texture(&wgpu::TextureDescriptor {
            label: Some("trixel raster target"),
            size: wgpu::Extent3d { width: size, height: size, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: TARGET_FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
            view_formats: &[],
        })
    })?;
    Ok(texture.create_view(&wgpu::TextureViewDescriptor::default()))
}

type ComputePipeline = Option<std::sync::Arc<wgpu::ComputePipeline>>;

/// One dispatch; `parameters` is the offset of group 0's uniform, if it has one.
fn run(
    pass: &mut wgpu::ComputePass<'_>,
    pipeline: &ComputePipeline,
    group_0: &wgpu::BindGroup,
    parameters: Option<&u32>,
    group_1: Option<&wgpu::BindGroup>,
    groups: [u32; 2],
) {
    let Some(pipeline) = pipeline else { return };
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, group_0, parameters.map_or(&[], std::slice::from_ref));
    if let Some(group) = group_1 {
        pass.set_bind_group(1, group, &[]);
    }
    pass.dispatch_workgroups(groups[0], groups[1], 1);
}

/// One dispatch over as many triangles or pairs as the GPU found itself.
fn run_indirect(
    pass: &mut wgpu::ComputePass<'_>,
    pipeline: &ComputePipeline,
    group_0: &wgpu::BindGroup,
    parameters: u32,
    group_1: &wgpu::BindGroup,
    arguments: &wgpu::Buffer,
) {
    let Some(pipeline) = pipeline else { return };
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, group_0, &[parameters]);
    pass.set_bind_group(1, group_1, &[]);
    pass.dispatch_workgroups_indirect(arguments, DISPATCH_OFFSET);
}
