//! The passes of each strategy, recorded into a command encoder.

mod case_sorted;
mod sums;
mod tiled;

use trixel::{Job, Mode, Strategy, Volume};

use crate::counters;
use crate::cutoff::{Cutoff, Dilation};
use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::layout::{Layout, Part, Unit};
use crate::limits::WORKGROUP;
use crate::mesh::GpuMesh;
use crate::pipelines::bind;
use crate::scratch::{List, Lists, ScanBuffers, Scratch, Status};
use crate::shader::{Drawn, Raster, Sink, Stage, Variant};
use crate::timer::Timer;
use crate::volume::{GpuVolume, Slab};
use crate::voxelizer::Classification;

/// Offset of a dispatch's arguments after those of a draw, in `arguments.wgsl`.
const DISPATCH_OFFSET: u64 = 16;

/// Where voxels go beside the bits.
#[derive(Clone, Copy, Default)]
pub(crate) struct Appending<'a> {
    pub(crate) sink: Sink,
    /// What stages that write voxels are bound to for it.
    pub(crate) buffers: &'a [&'a wgpu::Buffer],
    /// How many pairs of triangle and tile each unit has, where they were counted before.
    pub(crate) pairs: Option<&'a [u32]>,
}

/// All that a recording depends on.
pub(crate) struct Setting<'a> {
    pub(crate) gpu: &'a Gpu,
    pub(crate) job: &'a Job,
    pub(crate) variant: Variant,
    pub(crate) dilation: Dilation,
    pub(crate) cutoff: Cutoff,
    pub(crate) whole_below: u32,
    pub(crate) mesh: &'a GpuMesh,
    pub(crate) volume: &'a GpuVolume,
    pub(crate) appending: Appending<'a>,
    pub(crate) scratch: &'a mut Scratch,
    pub(crate) timer: Option<&'a mut Timer>,
}

/// Records the whole voxelization, by the classification if there is one.
pub(crate) fn record(
    setting: Setting<'_>,
    encoder: &mut wgpu::CommandEncoder,
    strategy: Strategy,
    classification: Option<&Classification>,
    initial: Option<&Volume>,
) -> Result<(), GpuError> {
    let units = Layout::units(setting.mesh, setting.volume);
    if classification.is_some_and(|given| {
        let Classification { units: lists, mode, dilation } = given;
        (lists.len(), *mode, *dilation) != (units, setting.job.mode(), setting.dilation)
    }) {
        return Err(GpuError::OtherClassification);
    }
    let (mut recorder, layout) = Recorder::begin(setting, encoder)?;
    let mut words = initial.map(|volume| bytemuck::cast_slice::<u64, u8>(volume.words()));
    for part in &layout.parts {
        recorder.initialize(part.slab, &mut words)?;
        for unit in &part.units {
            match (strategy, classification.and_then(|given| given.units.get(unit.index))) {
                (_, Some(lists)) => recorder.hybrid_classified(unit, lists)?,
                (Strategy::FragmentParallel, _) => recorder.fragment_parallel(unit, None)?,
                (Strategy::Hybrid, _) => recorder.hybrid(unit)?,
                (Strategy::HybridTwoPass, _) => recorder.hybrid_two_pass(unit)?,
                (Strategy::Balanced, _) => recorder.balanced(unit)?,
                (Strategy::Sliced, _) => recorder.sliced(unit)?,
                (Strategy::SlicePerPass, _) => recorder.slice_per_pass(unit)?,
                (Strategy::CaseSorted, _) => recorder.case_sorted(unit)?,
                (Strategy::Tiled, _) => recorder.tiled(part.slab, unit)?,
                _ => recorder.triangle_parallel(unit)?,
            }
        }
        if recorder.setting.job.mode() == Mode::Solid {
            recorder.fill(part);
        }
    }
    recorder.end(&layout);
    Ok(())
}

/// Records the sorting of all triangles into new lists.
pub(crate) fn record_classification(
    setting: Setting<'_>,
    encoder: &mut wgpu::CommandEncoder,
) -> Result<Classification, GpuError> {
    let (mode, dilation) = (setting.job.mode(), setting.dilation);
    let (mut recorder, layout) = Recorder::begin(setting, encoder)?;
    let mut units = vec![];
    for unit in layout.parts.iter().flat_map(|part| &part.units) {
        let lists = Lists::new(recorder.setting.gpu, unit.chunk.triangles)?;
        recorder.classify(unit, &lists);
        units.push(lists);
    }
    recorder.end(&layout);
    Ok(Classification { units, mode, dilation })
}

/// Records the counting of each unit's pairs of triangle and tile.
pub(crate) fn record_pair_counts(setting: Setting<'_>, encoder: &mut wgpu::CommandEncoder) -> Result<(), GpuError> {
    let (mut recorder, layout) = Recorder::begin(setting, encoder)?;
    for unit in layout.parts.iter().flat_map(|part| &part.units) {
        recorder.count_tiles(unit)?;
    }
    recorder.end(&layout);
    Ok(())
}

struct Recorder<'a> {
    setting: Setting<'a>,
    encoder: &'a mut wgpu::CommandEncoder,
    status: Status,
    target_size: u32,
    /// The most triangles of any unit: what lists must hold.
    capacity: u32,
    /// Group 2 of stages that append.
    append_group: Option<wgpu::BindGroup>,
}

impl<'a> Recorder<'a> {
    fn begin(
        setting: Setting<'a>,
        encoder: &'a mut wgpu::CommandEncoder,
    ) -> Result<(Recorder<'a>, Layout<'a>), GpuError> {
        let Setting { gpu, mesh, volume, appending: Appending { sink, buffers, .. }, .. } = setting;
        let status = setting.scratch.next_status(gpu, Layout::units(mesh, volume) as u64)?;
        let layout = Layout::new(&setting, status.run)?;
        encoder.clear_buffer(&setting.scratch.counters, 0, None);
        encoder.clear_buffer(&status.buffer, 0, None);
        let (target_size, capacity) = (layout.target_size, layout.most_triangles);
        let append_group = gpu.pipelines().layouts().appending(sink).filter(|_| !buffers.is_empty()).map(|layout| {
            let buffers: Vec<_> = buffers.iter().map(|buffer| buffer.as_entire_binding()).collect();
            bind(gpu, layout, &buffers)
        });
        Ok((Self { setting, encoder, status, target_size, capacity, append_group }, layout))
    }

    /// Clears a slab, or fills it with the next of `words`.
    fn initialize(&mut self, slab: &Slab, words: &mut Option<&[u8]>) -> Result<(), GpuError> {
        if !self.setting.variant.sink.has_bits() {
            // The bits are not looked at.
            return Ok(());
        }
        let bytes = self.setting.volume.slab_bytes(slab);
        let Some(rest) = words else {
            self.encoder.clear_buffer(slab.buffer(), 0, Some(bytes));
            return Ok(());
        };
        let (here, others) = rest.split_at(usize::try_from(bytes).unwrap_or(usize::MAX));
        *rest = others;
        let staging = self.setting.gpu.buffer_with("trixel initial voxels", here, wgpu::BufferUsages::COPY_SRC)?;
        self.encoder.copy_buffer_to_buffer(&staging, 0, slab.buffer(), 0, bytes);
        Ok(())
    }

    /// Copies what the host will look at.
    fn end(self, layout: &Layout<'_>) {
        let Status { buffer, .. } = &self.status;
        self.encoder.copy_buffer_to_buffer(&self.setting.scratch.counters, 0, buffer, 0, counters::BYTES);
        self.encoder.copy_buffer_to_buffer(&layout.parameters, layout.run_offset, buffer, self.status.run_offset(), 4);
        if let Some(timer) = self.setting.timer {
            timer.resolve(self.encoder);
        }
    }

    fn triangle_parallel(&mut self, unit: &Unit<'_>) -> Result<(), GpuError> {
        let list = self.lists()?.large;
        self.encoder.clear_buffer(&list.count, 0, None);
        let written = self.list_group(&list, true);
        let read = self.list_group(&list, false);
        let arguments = self.arguments_group(&list.count, &list.arguments);
        let first = self.pipeline(Stage::TriangleParallel { defers: None });
        let count = self.pipeline(Stage::Arguments { vertices: 0 });
        let rest = self.pipeline(Stage::TriangleList { small: false });
        let groups = self.groups(unit.chunk.triangles);
        let mut pass = self.pass("triangle-parallel");
        run(&mut pass, &first, &unit.bind_group, Some(unit.parameters), Some(&written), groups);
        run(&mut pass, &count, &arguments, None, None, [1, 1]);
        for share in [unit.parameters].iter().chain(&unit.later_shares) {
            run_indirect(&mut pass, &rest, &unit.bind_group, *share, &read, &list.arguments);
        }
        Ok(())
    }

    /// The list's length is counted where the draw reads it: a dispatch less than by way of `arguments.wgsl`, which shows on
    /// small meshes.
    fn hybrid(&mut self, unit: &Unit<'_>) -> Result<(), GpuError> {
        let Setting { gpu, cutoff, dilation, whole_below, .. } = self.setting;
        if unit.chunk.triangles < whole_below {
            return self.fragment_parallel(unit, None);
        }
        let list = self.lists()?.large;
        let no_draw = &self.setting.scratch.no_draw;
        self.encoder.copy_buffer_to_buffer(no_draw, 0, &list.arguments, 0, no_draw.size());
        let written = [&list.triangles, &list.arguments].map(wgpu::Buffer::as_entire_binding);
        let written = bind(gpu, &gpu.pipelines().layouts().list_write, &written);
        let defers = Some((cutoff.heuristic, dilation.vertices()));
        let first = self.pipeline(Stage::TriangleParallel { defers });
        let groups = self.groups(unit.chunk.triangles);
        let mut pass = self.pass("triangle-parallel");
        run(&mut pass, &first, &unit.bind_group, Some(unit.parameters), Some(&written), groups);
        drop(pass);
        self.fragment_parallel(unit, Some(&list))
    }

    fn hybrid_two_pass(&mut self, unit: &Unit<'_>) -> Result<(), GpuError> {
        let lists = self.lists()?;
        self.classify(unit, &lists);
        self.hybrid_classified(unit, &lists)
    }

    fn hybrid_classified(&mut self, unit: &Unit<'_>, lists: &Lists) -> Result<(), GpuError> {
        let small = self.pipeline(Stage::TriangleList { small: true });
        let read = self.list_group(&lists.small, false);
        let mut pass = self.pass("triangle-parallel");
        run_indirect(&mut pass, &small, &unit.bind_group, unit.parameters, &read, &lists.small.arguments);
        drop(pass);
        self.fragment_parallel(unit, Some(&lists.large))
    }

    fn classify(&mut self, unit: &Unit<'_>, lists: &Lists) {
        let Lists { small, large } = lists;
        self.encoder.clear_buffer(&small.count, 0, None);
        self.encoder.clear_buffer(&large.count, 0, None);
        let gpu = self.setting.gpu;
        let written = [&small.triangles, &small.count, &large.triangles, &large.count];
        let written = bind(gpu, &gpu.pipelines().layouts().classify, &written.map(wgpu::Buffer::as_entire_binding));
        let classify = self.pipeline(Stage::Classify { heuristic: self.setting.cutoff.heuristic });
        let count = self.pipeline(Stage::Arguments { vertices: self.setting.dilation.vertices() });
        let arguments = [small, large].map(|list| self.arguments_group(&list.count, &list.arguments));
        let groups = self.groups(unit.chunk.triangles);
        let mut pass = self.pass("classify");
        run(&mut pass, &classify, &unit.bind_group, Some(unit.parameters), Some(&written), groups);
        for group in &arguments {
            run(&mut pass, &count, group, None, None, [1, 1]);
        }
    }

    /// Rasterizes the triangles of a list, or all of them.
    fn fragment_parallel(&mut self, unit: &Unit<'_>, list: Option<&List>) -> Result<(), GpuError> {
        let Setting { gpu, dilation, .. } = self.setting;
        let triangles = list.map_or(&self.setting.scratch.nothing, |list| &list.triangles);
        let group = bind(gpu, &gpu.pipelines().layouts().list_draw, &[triangles.as_entire_binding()]);
        let drawn = if list.is_some() { Drawn::Listed } else { Drawn::All };
        let vertices = unit.chunk.triangles * dilation.vertices();
        self.rasterize(unit, drawn, "fragment-parallel", |pass| {
            pass.set_bind_group(1, &group, &[]);
            match list {
                Some(list) => pass.draw_indirect(&list.arguments, 0),
                None => pass.draw(0..vertices, 0..1),
            }
        })
    }

    /// \[CL\] 2.2, with a prefix sum in place of the geometry shader.
    fn sliced(&mut self, unit: &Unit<'_>) -> Result<(), GpuError> {
        let Setting { gpu, dilation, .. } = self.setting;
        let scan = self.count_and_scan(unit, Stage::CountSlices, dilation.vertices())?;
        let group = bind(gpu, &gpu.pipelines().layouts().list_draw, &[scan.counted().as_entire_binding()]);
        self.rasterize(unit, Drawn::Slices, "sliced", |pass| {
            pass.set_bind_group(1, &group, &[]);
            pass.draw_indirect(&scan.arguments, 0);
        })
    }

    /// Llamas 2007. The draws share a render pass, because nothing is rendered into it.
    fn slice_per_pass(&mut self, unit: &Unit<'_>) -> Result<(), GpuError> {
        let Setting { gpu, dilation, job, .. } = self.setting;
        let slices = job.grid().dims()[2];
        let stride = gpu.limits().parameter_stride;
        let bytes: Vec<u8> = (0..slices)
            .flat_map(|slice| {
                let mut slot = slice.to_le_bytes().to_vec();
                slot.resize(stride as usize, 0);
                slot
            })
            .collect();
        let buffer = gpu.buffer_with("trixel slices", &bytes, wgpu::BufferUsages::UNIFORM)?;
        let one = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer: &buffer,
            offset: 0,
            size: wgpu::BufferSize::new(4),
        });
        let group = bind(gpu, &gpu.pipelines().layouts().slice_draw, &[one]);
        let vertices = unit.chunk.triangles * dilation.vertices();
        self.rasterize(unit, Drawn::Slice, "slice-per-pass", |pass| {
            for slice in 0..slices {
                pass.set_bind_group(1, &group, &[slice * stride]);
                pass.draw(0..vertices, 0..1);
            }
        })
    }

    /// A render pass for each window of the raster target, in which `draw` binds group 1 and draws.
    fn rasterize(
        &mut self,
        unit: &Unit<'_>,
        drawn: Drawn,
        name: &'static str,
        draw: impl Fn(&mut wgpu::RenderPass<'_>),
    ) -> Result<(), GpuError> {
        let Setting { gpu, dilation, variant, .. } = self.setting;
        let pipeline = gpu.pipelines().raster(gpu, Raster { drawn, dilation }, variant);
        let target = self.setting.scratch.target(gpu, self.target_size)?;
        for window in &unit.windows {
            let mut pass = self.encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some(name),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &target,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                        store: wgpu::StoreOp::Discard,
                    },
                })],
                timestamp_writes: self.setting.timer.as_mut().and_then(|timer| timer.render(name)),
                ..Default::default()
            });
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &unit.bind_group, &[*window]);
            if let Some(group) = &self.append_group {
                pass.set_bind_group(2, group, &[]);
            }
            draw(&mut pass);
        }
        Ok(())
    }

    fn balanced(&mut self, unit: &Unit<'_>) -> Result<(), GpuError> {
        let scan = self.count_and_scan(unit, Stage::CountColumns, 0)?;
        let layouts = self.setting.gpu.pipelines().layouts();
        let pairs = [scan.counted(), &scan.total].map(wgpu::Buffer::as_entire_binding);
        let pairs = bind(self.setting.gpu, &layouts.list_read, &pairs);
        let main = self.pipeline(Stage::Balanced);
        let mut pass = self.pass("balanced");
        run_indirect(&mut pass, &main, &unit.bind_group, unit.parameters, &pairs, &scan.arguments);
        Ok(())
    }

    /// The prefix sums of what `count` counts for each triangle, and the arguments of a draw of so many vertices for each
    /// and of a dispatch.
    fn count_and_scan(&mut self, unit: &Unit<'_>, count: Stage, vertices: u32) -> Result<ScanBuffers, GpuError> {
        let gpu = self.setting.gpu;
        let layouts = gpu.pipelines().layouts();
        let scan = self.setting.scratch.scan(gpu, self.capacity)?;
        let columns = scan.counted();
        let triangles = unit.chunk.triangles;

        let sums = self.prefix_sums(&scan, triangles)?;
        let counted = bind(gpu, &layouts.columns, &[columns.as_entire_binding()]);
        let arguments = self.arguments_group(&scan.total, &scan.arguments);

        let count = self.pipeline(count);
        let write_arguments = self.pipeline(Stage::Arguments { vertices });
        let groups = self.groups(triangles);

        let mut pass = self.pass("count and scan");
        run(&mut pass, &count, &unit.bind_group, Some(unit.parameters), Some(&counted), groups);
        sums.record(&mut pass);
        run(&mut pass, &write_arguments, &arguments, None, None, [1, 1]);
        drop(pass);
        let total = self.status.total_offset(unit.index);
        self.encoder.copy_buffer_to_buffer(&scan.total, 0, &self.status.buffer, total, 4);
        Ok(scan)
    }

    fn fill(&mut self, part: &Part<'_>) {
        let fill = self.pipeline(Stage::Fill);
        let groups = self.groups(part.slab.nx() * self.setting.job.grid().dims()[1]);
        let mut pass = self.pass("fill");
        run(&mut pass, &fill, &part.bind_group, Some(part.parameters), None, groups);
    }

    fn lists(&mut self) -> Result<Lists, GpuError> {
        self.setting.scratch.lists(self.setting.gpu, self.capacity)
    }

    fn pass(&mut self, name: &'static str) -> wgpu::ComputePass<'_> {
        let mut pass = self.encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some(name),
            timestamp_writes: self.setting.timer.as_mut().and_then(|timer| timer.compute(name)),
        });
        if let Some(group) = &self.append_group {
            pass.set_bind_group(2, group, &[]);
        }
        pass
    }

    fn pipeline(&self, stage: Stage) -> wgpu::ComputePipeline {
        self.setting.gpu.pipelines().compute(self.setting.gpu, stage, self.setting.variant)
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

/// One dispatch; `parameters` is the offset of group 0's uniform, if it has one.
fn run(
    pass: &mut wgpu::ComputePass<'_>,
    pipeline: &wgpu::ComputePipeline,
    group_0: &wgpu::BindGroup,
    parameters: Option<u32>,
    group_1: Option<&wgpu::BindGroup>,
    groups: [u32; 2],
) {
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, group_0, parameters.as_slice());
    if let Some(group) = group_1 {
        pass.set_bind_group(1, group, &[]);
    }
    pass.dispatch_workgroups(groups[0], groups[1], 1);
}

/// One dispatch over as many triangles or pairs as the GPU found itself.
fn run_indirect(
    pass: &mut wgpu::ComputePass<'_>,
    pipeline: &wgpu::ComputePipeline,
    group_0: &wgpu::BindGroup,
    parameters: u32,
    group_1: &wgpu::BindGroup,
    arguments: &wgpu::Buffer,
) {
    run_indirect_at(pass, pipeline, group_0, parameters, group_1, (arguments, DISPATCH_OFFSET));
}

/// The same with the arguments anywhere in a buffer.
fn run_indirect_at(
    pass: &mut wgpu::ComputePass<'_>,
    pipeline: &wgpu::ComputePipeline,
    group_0: &wgpu::BindGroup,
    parameters: u32,
    group_1: &wgpu::BindGroup,
    (arguments, offset): (&wgpu::Buffer, u64),
) {
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, group_0, &[parameters]);
    pass.set_bind_group(1, group_1, &[]);
    pass.dispatch_workgroups_indirect(arguments, offset);
}
