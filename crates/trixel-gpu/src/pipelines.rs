//! Pipelines, built when first needed and kept.

use std::collections::HashMap;
use std::hash::Hash;
use std::sync::{Mutex, PoisonError};

use crate::gpu::Gpu;
use crate::kernel::Kernels;
use crate::shader::{self, Drawn, Raster, Sink, Stage, Variant};

/// Which shader stages see a binding, and how.
#[derive(Clone, Copy)]
enum Slot {
    Parameters,
    Read(wgpu::ShaderStages),
    Write(wgpu::ShaderStages),
}

const COMPUTE: wgpu::ShaderStages = wgpu::ShaderStages::COMPUTE;
const VERTEX: wgpu::ShaderStages = wgpu::ShaderStages::VERTEX;

/// The format of the raster target, which nothing is ever written to: WebGPU wants one.
pub(crate) const TARGET_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::R8Unorm;

#[derive(Debug)]
pub(crate) struct Pipelines {
    layouts: Layouts,
    compute: Kept<Stage, wgpu::ComputePipeline>,
    raster: Kept<Raster, wgpu::RenderPipeline>,
    kernels: Kernels,
}

/// Pipelines by what they are for.
type Kept<Key, Pipeline> = Mutex<HashMap<(Key, Variant), Pipeline>>;

fn keep<Key: Eq + Hash, Pipeline: Clone>(
    kept: &Kept<Key, Pipeline>,
    key: (Key, Variant),
    build: impl FnOnce() -> Pipeline,
) -> Pipeline {
    kept.lock().unwrap_or_else(PoisonError::into_inner).entry(key).or_insert_with(build).clone()
}

/// The layouts of bind groups. `common` is group 0 of all stages that know the parameters.
#[derive(Debug)]
pub(crate) struct Layouts {
    pub(crate) common: wgpu::BindGroupLayout,
    pub(crate) list_write: wgpu::BindGroupLayout,
    pub(crate) list_read: wgpu::BindGroupLayout,
    pub(crate) list_draw: wgpu::BindGroupLayout,
    pub(crate) slice_draw: wgpu::BindGroupLayout,
    pub(crate) classify: wgpu::BindGroupLayout,
    pub(crate) columns: wgpu::BindGroupLayout,
    pub(crate) expand: wgpu::BindGroupLayout,
    pub(crate) scan: wgpu::BindGroupLayout,
    pub(crate) arguments: wgpu::BindGroupLayout,
    /// Numbers and their sum into places or sizes.
    pub(crate) cases: wgpu::BindGroupLayout,
    pub(crate) case_sorted: wgpu::BindGroupLayout,
    pub(crate) pair_tiles: wgpu::BindGroupLayout,
    pub(crate) find_tiles: wgpu::BindGroupLayout,
    pub(crate) sort: wgpu::BindGroupLayout,
    /// Group 2 of stages that append voxels to a list.
    pub(crate) append: wgpu::BindGroupLayout,
    /// Group 2 of those that blend what triangles paint.
    pub(crate) targets: wgpu::BindGroupLayout,
}

impl Layouts {
    fn new(device: &wgpu::Device) -> Self {
        let all = VERTEX | wgpu::ShaderStages::FRAGMENT | COMPUTE;
        let writers = wgpu::ShaderStages::FRAGMENT | COMPUTE;
        let write = Slot::Write(COMPUTE);
        let read = Slot::Read(COMPUTE);
        Self {
            common: layout(
                device,
                &[Slot::Parameters, Slot::Read(all), Slot::Read(all), Slot::Write(writers), Slot::Write(writers)],
            ),
            list_write: layout(device, &[write, write]),
            list_read: layout(device, &[read, read]),
            list_draw: layout(device, &[Slot::Read(VERTEX)]),
            slice_draw: layout(device, &[Slot::Parameters]),
            classify: layout(device, &[write, write, write, write]),
            columns: layout(device, &[write]),
            expand: layout(device, &[Slot::Parameters, read, write]),
            scan: layout(device, &[Slot::Parameters, write, write]),
            arguments: layout(device, &[read, write]),
            cases: layout(device, &[read, read, write]),
            case_sorted: layout(device, &[read, read, read]),
            pair_tiles: layout(device, &[read, read, read, write]),
            find_tiles: layout(device, &[read, read, write]),
            sort: layout(device, &[Slot::Parameters, read, write, write]),
            append: layout(device, &[Slot::Write(writers)]),
            targets: layout(device, &[write, read]),
        }
    }

    /// Group 2 of stages that write voxels.
    pub(crate) fn appending(&self, sink: Sink) -> Option<&wgpu::BindGroupLayout> {
        match sink {
            Sink::Bits => None,
            Sink::Targets(_) => Some(&self.targets),
            Sink::List | Sink::Fragments | Sink::Claims | Sink::Pairs | Sink::Shell => Some(&self.append),
        }
    }

    fn of(&self, stage: Stage, sink: Sink) -> Vec<Option<&wgpu::BindGroupLayout>> {
        let second = match stage {
            Stage::TriangleParallel { .. } | Stage::ClassifyCases => Some(&self.list_write),
            Stage::TriangleList { .. } | Stage::Balanced | Stage::Tiled => Some(&self.list_read),
            Stage::Classify { .. } => Some(&self.classify),
            Stage::CountColumns | Stage::CountSlices | Stage::CountTiles => Some(&self.columns),
            Stage::SortCases | Stage::CaseSizes => Some(&self.cases),
            Stage::CaseSorted(_) => Some(&self.case_sorted),
            Stage::PairTiles => Some(&self.pair_tiles),
            Stage::Fill
            | Stage::Expand
            | Stage::ScanBlocks
            | Stage::AddTotals
            | Stage::Arguments { .. }
            | Stage::FindTiles
            | Stage::CountDigits
            | Stage::MoveEntries => None,
        };
        let first = match stage {
            Stage::Expand => &self.expand,
            Stage::ScanBlocks | Stage::AddTotals => &self.scan,
            Stage::Arguments { .. } => &self.arguments,
            Stage::FindTiles => &self.find_tiles,
            Stage::CountDigits | Stage::MoveEntries => &self.sort,
            _ => &self.common,
        };
        let third = if stage.writes_voxels() { self.appending(sink) } else { None };
        let groups = if third.is_some() { 3 } else { 1 + usize::from(second.is_some()) };
        [Some(first), second, third].into_iter().take(groups).collect()
    }
}

fn layout(device: &wgpu::Device, slots: &[Slot]) -> wgpu::BindGroupLayout {
    let entries: Vec<_> = (0u32..)
        .zip(slots)
        .map(|(binding, slot)| {
            let storage = |read_only| wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Storage { read_only },
                has_dynamic_offset: false,
                min_binding_size: None,
            };
            let (visibility, ty) = match slot {
                Slot::Parameters => (
                    VERTEX | wgpu::ShaderStages::FRAGMENT | COMPUTE,
                    wgpu::BindingType::Buffer {
                        ty: wgpu::BufferBindingType::Uniform,
                        has_dynamic_offset: true,
                        min_binding_size: None,
                    },
                ),
                Slot::Read(visibility) => (*visibility, storage(true)),
                Slot::Write(visibility) => (*visibility, storage(false)),
            };
            wgpu::BindGroupLayoutEntry { binding, visibility, ty, count: None }
        })
        .collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries })
}

/// The resources in the order of their bindings.
pub(crate) fn bind(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    resources: &[wgpu::BindingResource<'_>],
) -> wgpu::BindGroup {
    let entries: Vec<_> = (0u32..)
        .zip(resources)
        .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource: resource.clone() })
        .collect();
    gpu.device().create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
}

impl Pipelines {
    pub(crate) fn new(device: &wgpu::Device) -> Self {
        Self {
            layouts: Layouts::new(device),
            compute: Kept::default(),
            raster: Kept::default(),
            kernels: Kernels::default(),
        }
    }

    pub(crate) fn layouts(&self) -> &Layouts {
        &self.layouts
    }

    pub(crate) fn kernels(&self) -> &Kernels {
        &self.kernels
    }

    /// The pipeline of a compute stage. Errors go to the device's error scopes.
    pub(crate) fn compute(&self, gpu: &Gpu, stage: Stage, variant: Variant) -> wgpu::ComputePipeline {
        keep(&self.compute, (stage, variant), || {
            let label = Some(stage.entry_point());
            let source = shader::source(stage, variant, gpu.info().tier, gpu.limits().groups);
            let (module, layout) =
                module_and_layout(gpu.device(), label, source, &self.layouts.of(stage, variant.sink));
            gpu.device().create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label,
                layout: Some(&layout),
                module: &module,
                entry_point: label,
                compilation_options: wgpu::PipelineCompilationOptions {
                    // A tile clears its memory itself, and with values that is a good deal.
                    zero_initialize_workgroup_memory: stage != Stage::Tiled,
                    ..Default::default()
                },
                cache: None,
            })
        })
    }

    /// The pipeline of the rasterizer. Errors go to the device's error scopes.
    pub(crate) fn raster(&self, gpu: &Gpu, raster: Raster, variant: Variant) -> wgpu::RenderPipeline {
        keep(&self.raster, (raster, variant), || {
            let [vertex, fragment] = raster.entry_points();
            let label = Some(fragment);
            let source = shader::raster_source(raster, variant, gpu.info().tier);
            let drawn = match raster.drawn {
                Drawn::All | Drawn::Listed | Drawn::Slices => &self.layouts.list_draw,
                Drawn::Slice => &self.layouts.slice_draw,
            };
            let layouts = [&self.layouts.common, drawn, &self.layouts.append].map(Some);
            let groups = if variant.sink == Sink::Bits { &layouts[..2] } else { &layouts };
            let (module, layout) = module_and_layout(gpu.device(), label, source, groups);
            gpu.device().create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label,
                layout: Some(&layout),
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some(vertex),
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    buffers: &[],
                },
                primitive: wgpu::PrimitiveState::default(),
                depth_stencil: None,
                multisample: wgpu::MultisampleState::default(),
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: label,
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    targets: &[Some(wgpu::ColorTargetState {
                        format: TARGET_FORMAT,
                        blend: None,
                        write_mask: wgpu::ColorWrites::empty(),
                    })],
                }),
                multiview_mask: None,
                cache: None,
            })
        })
    }
}

fn module_and_layout(
    device: &wgpu::Device,
    label: Option<&str>,
    source: String,
    groups: &[Option<&wgpu::BindGroupLayout>],
) -> (wgpu::ShaderModule, wgpu::PipelineLayout) {
    let source = wgpu::ShaderSource::Wgsl(source.into());
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label, source });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label,
        bind_group_layouts: groups,
        immediate_size: 0,
    });
    (module, layout)
}
