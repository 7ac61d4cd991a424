//! Compute kernels that work on a few buffers and one set of parameters: all that follows the voxelization.
//!
//! Their bind group layouts follow from their sources, and a dispatch names bindings by number.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use trixel::VoxelOrder;

use crate::attributes::Recipe;
use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::limits::WORKGROUP;
use crate::lists::SortKey;
use crate::material_volume::Precision;
use crate::shader::shader;
use crate::sparse::Below;
use crate::targets::Plan;

/// A function of a shader, with the constants in front of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Kernel {
    ScanBlocks,
    AddTotals,
    CountBits,
    WriteList,
    SumWords,
    SumCells,
    Traverse,
    CountDigits(SortKey),
    MoveEntries(SortKey),
    CountDistinct,
    WriteDistinct,
    MarkCubes,
    GatherOctants(Below),
    FindLeaves(Recipe),
    /// Of voxels with attributes, or of the cubes of a level.
    SumOctants {
        leaves: bool,
    },
    WriteNodes {
        leaves: bool,
    },
    WriteNodeLooks,
    WriteVoxelLooks,
    WriteBricks,
    Answer,
    MarchOctree,
    MarchBricks,
    CountBeforePlanes,
    LocateFragments,
    Prioritize(Recipe),
    Weigh(Recipe),
    ChooseWinners(Recipe),
    WriteVoxelRows(Recipe),
    GatherPairs(Recipe),
    WriteFragmentRows(Recipe),
    CopyCounts(Recipe),
    BeginTargets(Plan),
    JoinTargets(Plan),
    /// Whether columns with an odd number of boundary voxels are filled as well.
    SwitchColumns {
        uncorrected: bool,
    },
    CorrectXor,
    CorrectMarch,
    /// To texels of a precision, with what is inside if it was filled.
    ResolveClaims {
        precision: Precision,
        filled: bool,
    },
}

impl Kernel {
    /// Every kernel.
    #[cfg(test)]
    pub(crate) fn all() -> Vec<Self> {
        let sorting = SortKey::ALL.into_iter().flat_map(|key| [Self::CountDigits(key), Self::MoveEntries(key)]);
        let attributes = Recipe::samples().into_iter().flat_map(|recipe| {
            [
                Self::Prioritize(recipe),
                Self::Weigh(recipe),
                Self::ChooseWinners(recipe),
                Self::WriteVoxelRows(recipe),
                Self::GatherPairs(recipe),
                Self::WriteFragmentRows(recipe),
                Self::CopyCounts(recipe),
                Self::FindLeaves(recipe),
            ]
        });
        let blending = Plan::samples().into_iter().flat_map(|plan| [Self::BeginTargets(plan), Self::JoinTargets(plan)]);
        let others = [
            Self::ScanBlocks,
            Self::AddTotals,
            Self::CountBits,
            Self::WriteList,
            Self::SumWords,
            Self::SumCells,
            Self::Traverse,
            Self::CountDistinct,
            Self::WriteDistinct,
            Self::MarkCubes,
            Self::GatherOctants(Below::Voxels),
            Self::GatherOctants(Below::Leaves),
            Self::GatherOctants(Below::Cubes),
            Self::SumOctants { leaves: false },
            Self::SumOctants { leaves: true },
            Self::WriteNodes { leaves: false },
            Self::WriteNodes { leaves: true },
            Self::WriteNodeLooks,
            Self::WriteVoxelLooks,
            Self::WriteBricks,
            Self::Answer,
            Self::MarchOctree,
            Self::MarchBricks,
            Self::CountBeforePlanes,
            Self::LocateFragments,
            Self::SwitchColumns { uncorrected: false },
            Self::SwitchColumns { uncorrected: true },
            Self::CorrectXor,
            Self::CorrectMarch,
        ];
        let resolving = Precision::ALL
            .into_iter()
            .flat_map(|precision| [false, true].map(|filled| Self::ResolveClaims { precision, filled }));
        others.into_iter().chain(sorting).chain(attributes).chain(blending).chain(resolving).collect()
    }

    pub(crate) fn entry_point(self) -> &'static str {
        match self {
            Self::ScanBlocks => "scan_blocks",
            Self::AddTotals => "add_totals",
            Self::CountBits => "count_bits",
            Self::WriteList => "write_list",
            Self::SumWords => "sum_words",
            Self::SumCells => "sum_cells",
            Self::Traverse => "traverse",
            Self::CountDigits(_) => "count_digits",
            Self::MoveEntries(_) => "move_entries",
            Self::CountDistinct => "count_distinct",
            Self::WriteDistinct => "write_distinct",
            Self::MarkCubes => "mark_cubes",
            Self::GatherOctants(_) => "gather_octants",
            Self::FindLeaves(_) => "find_leaves",
            Self::SumOctants { .. } => "sum_octants",
            Self::WriteNodes { .. } => "write_nodes",
            Self::WriteNodeLooks => "write_node_looks",
            Self::WriteVoxelLooks => "write_voxel_looks",
            Self::WriteBricks => "write_bricks",
            Self::Answer => "answer",
            Self::MarchOctree | Self::MarchBricks => "march_rays",
            Self::CountBeforePlanes => "count_before_planes",
            Self::LocateFragments => "locate_fragments",
            Self::Prioritize(_) => "prioritize",
            Self::Weigh(_) => "weigh",
            Self::ChooseWinners(_) => "choose_winners",
            Self::WriteVoxelRows(_) => "write_voxel_rows",
            Self::GatherPairs(_) => "gather_pairs",
            Self::WriteFragmentRows(_) => "write_fragment_rows",
            Self::CopyCounts(_) => "copy_counts",
            Self::BeginTargets(_) => "begin_targets",
            Self::JoinTargets(_) => "join_targets",
            Self::SwitchColumns { .. } => "switch_columns",
            Self::CorrectXor => "correct_xor",
            Self::CorrectMarch => "correct_march",
            Self::ResolveClaims { .. } => "resolve_claims",
        }
    }

    fn files(self) -> &'static [&'static str] {
        match self {
            Self::ScanBlocks | Self::AddTotals => shader!("scan"),
            Self::CountBits | Self::WriteList => shader!("numbering" "entry" "slab" "list_scan"),
            Self::SumWords | Self::SumCells | Self::Traverse => shader!("numbering" "entry" "slab" "histopyramid"),
            Self::CountDigits(_) | Self::MoveEntries(_) => shader!("numbering" "entry" "sort_key" "radix_sort"),
            Self::CountDistinct | Self::WriteDistinct => shader!("numbering" "merge"),
            Self::MarkCubes => shader!("numbering" "entry" "sparse"),
            Self::GatherOctants(Below::Voxels) => {
                shader!("numbering" "entry" "sparse" "octree_on_voxels" "octree")
            }
            Self::GatherOctants(Below::Leaves) => {
                shader!("numbering" "entry" "sparse" "octree_leaf" "octree_on_leaves" "octree")
            }
            Self::GatherOctants(Below::Cubes) => {
                shader!("numbering" "entry" "sparse" "octree_on_cubes" "octree")
            }
            Self::FindLeaves(_) => shader!("numbering" "octree_leaf" "octree_leaves"),
            Self::SumOctants { leaves: true } => shader!(
                "product_portable" "wide" "division" "numbering" "entry" "sparse" "octree_light" "light" "octree_leaf"
                "octree_sum" "octree_sums_of_leaves" "octree_sums"
            ),
            Self::SumOctants { leaves: false } => shader!(
                "product_portable" "wide" "division" "numbering" "entry" "sparse" "octree_light" "light" "octree_leaf"
                "octree_sum" "octree_sums_of_cubes" "octree_sums"
            ),
            Self::WriteNodes { .. } => shader!("numbering" "octree_level" "octree_nodes"),
            Self::WriteNodeLooks | Self::WriteVoxelLooks => shader!(
                "product_portable" "wide" "division" "numbering" "octree_light" "light" "octree_leaf" "octree_sum"
                "octree_level" "octree_looks"
            ),
            Self::WriteBricks => shader!("numbering" "entry" "sparse" "bricks"),
            Self::Answer => shader!("numbering" "entry" "octree_query" "octree_descent"),
            Self::MarchOctree => shader!(
                "product_portable" "wide" "division" "numbering" "entry" "march" "octree_descent" "octree_cell"
            ),
            Self::MarchBricks => {
                shader!("product_portable" "wide" "division" "numbering" "entry" "sort_key" "march" "brick_cell")
            }
            Self::CountBeforePlanes | Self::LocateFragments => shader!("numbering" "entry" "place" "locate"),
            Self::Prioritize(_) | Self::Weigh(_) => shader!(
                "product_portable" "wide" "division" "numbering" "entry" "light" "surface" "nearest" "overlap" "combine"
                "weigh"
            ),
            Self::ChooseWinners(_) => shader!("numbering" "win"),
            Self::WriteVoxelRows(_) => shader!(
                "product_portable" "wide" "division" "numbering" "entry" "light" "surface" "nearest" "combine" "put_row"
                "voxel_rows"
            ),
            Self::GatherPairs(_) | Self::CopyCounts(_) => shader!("numbering" "gather"),
            Self::WriteFragmentRows(_) => shader!(
                "product_portable" "wide" "division" "numbering" "entry" "light" "surface" "nearest" "combine" "put_row"
                "fragment_rows"
            ),
            Self::BeginTargets(_) => shader!("numbering" "begin_targets"),
            Self::JoinTargets(_) => shader!("numbering" "entry" "place" "join_targets"),
            Self::SwitchColumns { .. } | Self::CorrectXor | Self::CorrectMarch => shader!("numbering" "fill_slices"),
            Self::ResolveClaims { .. } => shader!("numbering" "resolve_claims"),
        }
    }

    /// The WGSL.
    pub(crate) fn source(self) -> String {
        let constants = match self {
            Self::SwitchColumns { uncorrected } => format!("const UNCORRECTED: bool = {uncorrected};\n"),
            Self::CorrectXor | Self::CorrectMarch => "const UNCORRECTED: bool = false;\n".to_owned(),
            Self::ResolveClaims { precision, filled } => format!(
                "alias Texels = texture_storage_3d<{}, write>;\nconst FILLED: bool = {filled};\n",
                precision.wgsl_format()
            ),
            Self::CountDigits(key) | Self::MoveEntries(key) => format!("const ORDER: u32 = {}u;\n", key.code()),
            Self::MarchBricks => format!("const ORDER: u32 = {}u;\n", SortKey::Voxels(VoxelOrder::Morton).code()),
            Self::Prioritize(recipe)
            | Self::Weigh(recipe)
            | Self::ChooseWinners(recipe)
            | Self::WriteVoxelRows(recipe)
            | Self::GatherPairs(recipe)
            | Self::WriteFragmentRows(recipe)
            | Self::CopyCounts(recipe)
            | Self::FindLeaves(recipe) => recipe.constants(),
            Self::BeginTargets(plan) | Self::JoinTargets(plan) => plan.blending(),
            Self::WriteNodes { leaves } => format!("const LEAVES: bool = {leaves};\n"),
            _ => String::new(),
        };
        [&[constants.as_str()], self.files()].concat().join("\n")
    }
}

/// Kernels' pipelines, built when first needed and kept.
#[derive(Debug, Default)]
pub(crate) struct Kernels(Mutex<HashMap<Kernel, wgpu::ComputePipeline>>);

impl Kernels {
    fn pipeline(&self, gpu: &Gpu, kernel: Kernel) -> wgpu::ComputePipeline {
        let build = || {
            let label = Some(kernel.entry_point());
            let source = wgpu::ShaderSource::Wgsl(kernel.source().into());
            let module = gpu.device().create_shader_module(wgpu::ShaderModuleDescriptor { label, source });
            gpu.device().create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label,
                layout: None,
                module: &module,
                entry_point: label,
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: None,
            })
        };
        self.0.lock().unwrap_or_else(PoisonError::into_inner).entry(kernel).or_insert_with(build).clone()
    }
}

/// Something that a kernel is bound to.
#[derive(Clone, Copy)]
pub(crate) enum Bound<'a> {
    /// Words of a uniform.
    Words(&'a [u32]),
    Buffer(&'a wgpu::Buffer),
    Texture(&'a wgpu::TextureView),
}

/// Records dispatches, one pass each, and submits them.
pub(crate) struct Dispatcher<'a> {
    pub(crate) gpu: &'a Gpu,
    encoder: wgpu::CommandEncoder,
}

impl<'a> Dispatcher<'a> {
    pub(crate) fn new(gpu: &'a Gpu) -> Self {
        Self { gpu, encoder: gpu.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default()) }
    }

    /// One invocation of `kernel` for each of so many items.
    pub(crate) fn dispatch(&mut self, kernel: Kernel, bound: &[(u32, Bound<'_>)], items: u32) -> Result<(), GpuError> {
        self.dispatch_groups(kernel, bound, items.div_ceil(WORKGROUP))
    }

    /// At least so many workgroups of `kernel`.
    pub(crate) fn dispatch_groups(
        &mut self,
        kernel: Kernel,
        bound: &[(u32, Bound<'_>)],
        groups: u32,
    ) -> Result<(), GpuError> {
        let [x, y] = self.gpu.limits().dispatch(groups);
        let uniforms = bound
            .iter()
            .map(|(_, bound)| match bound {
                Bound::Words(words) => {
                    // A multiple of 16 bytes, as uniforms are laid out.
                    let mut bytes = bytemuck::cast_slice::<u32, u8>(words).to_vec();
                    bytes.resize(bytes.len().next_multiple_of(16), 0);
                    self.gpu.buffer_with("trixel kernel parameters", &bytes, wgpu::BufferUsages::UNIFORM).map(Some)
                }
                Bound::Buffer(_) | Bound::Texture(_) => Ok(None),
            })
            .collect::<Result<Vec<_>, GpuError>>()?;
        let gpu = self.gpu;
        gpu.guarded(|| {
            let pipeline = gpu.pipelines().kernels().pipeline(gpu, kernel);
            let entries: Vec<_> = bound
                .iter()
                .zip(&uniforms)
                .filter_map(|((binding, bound), uniform)| {
                    let resource = match bound {
                        Bound::Words(_) => uniform.as_ref()?.as_entire_binding(),
                        Bound::Buffer(buffer) => buffer.as_entire_binding(),
                        Bound::Texture(view) => wgpu::BindingResource::TextureView(view),
                    };
                    Some(wgpu::BindGroupEntry { binding: *binding, resource })
                })
                .collect();
            let layout = pipeline.get_bind_group_layout(0);
            let descriptor = wgpu::BindGroupDescriptor { label: None, layout: &layout, entries: &entries };
            let group = gpu.device().create_bind_group(&descriptor);
            let label = Some(kernel.entry_point());
            let mut pass =
                self.encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label, timestamp_writes: None });
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(x, y, 1);
        })
    }

    pub(crate) fn copy(&mut self, from: (&wgpu::Buffer, u64), to: (&wgpu::Buffer, u64), bytes: u64) {
        self.encoder.copy_buffer_to_buffer(from.0, from.1, to.0, to.1, bytes);
    }

    /// Submits what was recorded.
    pub(crate) fn submit(self) -> Result<(), GpuError> {
        let Self { gpu, encoder } = self;
        gpu.guarded(|| gpu.queue().submit([encoder.finish()])).map(drop)
    }

    /// Submits what was recorded and reads the first words of some buffers.
    pub(crate) fn read_words(mut self, buffers: &[(&wgpu::Buffer, usize)]) -> Result<Vec<Vec<u32>>, GpuError> {
        let words: usize = buffers.iter().map(|(_, words)| words).sum();
        let usage = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ;
        let bytes = words as u64 * 4;
        let staging = self.gpu.buffer("trixel numbers read", bytes, usage)?;
        let mut offset = 0;
        for &(buffer, words) in buffers {
            self.copy((buffer, 0), (&staging, offset), words as u64 * 4);
            offset += words as u64 * 4;
        }
        let gpu = self.gpu;
        self.submit()?;
        gpu.read(&staging, bytes, |bytes| {
            let mut all = bytes.as_chunks::<4>().0.iter().map(|word| u32::from_le_bytes(*word));
            buffers.iter().map(|(_, words)| all.by_ref().take(*words).collect()).collect()
        })
    }
}
