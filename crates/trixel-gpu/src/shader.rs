//! The shaders' sources: files under `shaders/`, put together per stage with their constants in front.

use trixel::Mode;

use crate::cutoff::{Dilation, Heuristic};
use crate::limits::{MAX_EXTENT, MAX_PAIRS};

macro_rules! shader {
    ($($file:literal)*) => { &[$(include_str!(concat!("shaders/", $file, ".wgsl"))),*] };
}

/// A step of a voxelization that has its own pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Stage {
    /// All triangles, one invocation each; the hybrid defers those that are large by a heuristic.
    TriangleParallel { defers: Option<Heuristic> },
    /// Triangles of a list, one invocation each; all small, or a share of the columns of each.
    TriangleList { small: bool },
    /// Small and large triangles to two lists.
    Classify { heuristic: Heuristic },
    /// The rasterizer, over all triangles or a list of them.
    FragmentParallel { listed: bool, dilation: Dilation },
    /// The number of columns of each triangle.
    CountColumns,
    /// One invocation a pair of triangle and column.
    Balanced,
    /// Parity upwards.
    Fill,
    /// Bits to bytes.
    Expand,
    /// Prefix sums within blocks.
    ScanBlocks,
    /// The second half of a prefix sum.
    AddTotals,
    /// A count turned into a draw's and a dispatch's arguments.
    Arguments { vertices: u32 },
}

impl Stage {
    /// The function in the shader; that of the fragment stage for a raster pipeline.
    pub(crate) fn entry_point(self) -> &'static str {
        match self {
            Self::TriangleParallel { .. } => "triangle_parallel",
            Self::TriangleList { .. } => "triangle_list",
            Self::Classify { .. } => "classify",
            Self::FragmentParallel { .. } => "fragment_parallel",
            Self::CountColumns => "count_columns",
            Self::Balanced => "balanced",
            Self::Fill => "fill",
            Self::Expand => "expand",
            Self::ScanBlocks => "scan_blocks",
            Self::AddTotals => "add_totals",
            Self::Arguments { .. } => "write_arguments",
        }
    }

    fn files(self) -> &'static [&'static str] {
        match self {
            Self::TriangleParallel { .. } => shader!(
                "wide" "common" "triangle" "size" "column" "columns" "voxels" "counters" "triangle_parallel"
            ),
            Self::TriangleList { .. } => {
                shader!("wide" "common" "triangle" "column" "columns" "voxels" "counters" "triangle_list")
            }
            Self::Classify { .. } => shader!("wide" "common" "triangle" "size" "counters" "classify"),
            Self::FragmentParallel { .. } => {
                shader!("wide" "common" "triangle" "column" "voxels" "counters" "fragment_parallel")
            }
            Self::CountColumns => shader!("wide" "common" "triangle" "counters" "count_columns"),
            Self::Balanced => shader!("wide" "common" "triangle" "column" "voxels" "counters" "balanced"),
            Self::Fill => shader!("common" "fill"),
            Self::Expand => shader!("expand"),
            Self::ScanBlocks | Self::AddTotals => shader!("scan"),
            Self::Arguments { .. } => shader!("arguments"),
        }
    }
}

/// What a stage is specialized for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Variant {
    pub(crate) mode: Mode,
    pub(crate) counting: bool,
}

/// The WGSL of a stage.
pub(crate) fn source(stage: Stage, variant: Variant, max_groups: u32) -> String {
    let mode = match variant.mode {
        Mode::Conservative => 0,
        Mode::Thin => 1,
        Mode::Solid => 2,
        Mode::Sliced => 3,
    };
    let counting = variant.counting;
    let mut source = format!(
        "const MODE: u32 = {mode}u;\nconst COUNTING: bool = {counting};\nconst MAX_EXTENT: u32 = {MAX_EXTENT}u;\n"
    );
    let small = matches!(stage, Stage::TriangleParallel { .. } | Stage::TriangleList { small: true });
    source += &format!("const SMALL: bool = {small};\n");
    match stage {
        Stage::TriangleParallel { defers } => {
            let (hybrid, heuristic) = (defers.is_some(), defers.unwrap_or_default().code());
            source += &format!("const HYBRID: bool = {hybrid};\nconst HEURISTIC: u32 = {heuristic}u;\n");
        }
        Stage::Classify { heuristic } => source += &format!("const HEURISTIC: u32 = {}u;\n", heuristic.code()),
        Stage::FragmentParallel { listed, dilation } => {
            source += &format!("const LISTED: bool = {listed};\nconst DILATION: u32 = {}u;\n", dilation.code());
        }
        Stage::Arguments { vertices } => {
            source += &format!("const VERTICES: u32 = {vertices}u;\nconst MAX_GROUPS: u32 = {max_groups}u;\n");
            source += &format!("const MAX_PAIRS: u32 = {MAX_PAIRS}u;\n");
        }
        _ => {}
    }
    for file in stage.files() {
        source += file;
        source += "\n";
    }
    source
}

#[cfg(test)]
mod tests {
    use super::*;

    /// naga accepts every stage in every variant, with nothing but what WebGPU has everywhere.
    #[test]
    fn every_shader_is_valid() {
        let mut stages = vec![
            Stage::TriangleParallel { defers: None },
            Stage::TriangleList { small: false },
            Stage::TriangleList { small: true },
            Stage::CountColumns,
            Stage::Balanced,
            Stage::Fill,
            Stage::Expand,
            Stage::ScanBlocks,
            Stage::AddTotals,
            Stage::Arguments { vertices: 3 },
        ];
        for heuristic in Heuristic::ALL {
            stages.push(Stage::TriangleParallel { defers: Some(heuristic) });
            stages.push(Stage::Classify { heuristic });
        }
        for listed in [false, true] {
            stages.extend(Dilation::ALL.map(|dilation| Stage::FragmentParallel { listed, dilation }));
        }
        for stage in stages {
            for mode in Mode::ALL {
                for counting in [false, true] {
                    let source = source(stage, Variant { mode, counting }, 65_535);
                    let module = naga::front::wgsl::parse_str(&source)
                        .unwrap_or_else(|error| panic!("{stage:?}: {}", error.emit_to_string(&source)));
                    let mut validator = naga::valid::Validator::new(
                        naga::valid::ValidationFlags::all(),
                        naga::valid::Capabilities::empty(),
                    );
                    validator
                        .validate(&module)
                        .unwrap_or_else(|error| panic!("{stage:?} {mode}: {}", error.emit_to_string(&source)));
                    assert!(module.entry_points.iter().any(|entry| entry.name == stage.entry_point()));
                }
            }
        }
    }
}
