//! The shaders' sources: files under `shaders/`, put together per stage with their constants in front.

use trixel::Mode;

use crate::cutoff::{Dilation, Heuristic};
use crate::limits::{MAX_EXTENT, MAX_PAIRS, TARGET_SHARE, TILE_SHARE, TILE_SHIFT};
use crate::targets::Plan;
use crate::tier::Tier;

macro_rules! shader {
    ($($file:literal)*) => { &[$(include_str!(concat!("shaders/", $file, ".wgsl"))),*] };
}
pub(crate) use shader;

/// A step of a voxelization that has its own compute pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Stage {
    /// All triangles, one invocation each; the hybrid defers those that are large by a heuristic to a draw of so many
    /// vertices each.
    TriangleParallel { defers: Option<(Heuristic, u32)> },
    /// Triangles of a list, one invocation each; all small, or a share of the columns of each.
    TriangleList { small: bool },
    /// Small and large triangles to two lists.
    Classify { heuristic: Heuristic },
    /// The number of columns of each triangle.
    CountColumns,
    /// One invocation a pair of triangle and column.
    Balanced,
    /// The number of slices that each triangle may meet.
    CountSlices,
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
    /// The case of each triangle's box, and how many a workgroup has of each.
    ClassifyCases,
    /// Triangles to their places by case.
    SortCases,
    /// The cases' sizes as the arguments of dispatches.
    CaseSizes,
    /// Triangles of a case, one invocation each.
    CaseSorted(BoxCase),
    /// The number of tiles that each triangle's box meets.
    CountTiles,
    /// One invocation a pair of triangle and tile.
    PairTiles,
    /// How many pairs have each digit.
    CountDigits,
    /// Pairs to their places by a digit.
    MoveEntries,
    /// Where in the sorted pairs each workgroup's share begins.
    FindTiles,
    /// One workgroup a share of a tile.
    Tiled,
}

/// What a triangle's box of voxels extends along: `classify_cases.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum BoxCase {
    /// One axis, or none.
    Line,
    /// Two.
    Flat,
    /// Three.
    Deep,
    /// Whatever is too much for one invocation.
    Long,
}

impl BoxCase {
    pub(crate) const ALL: [Self; 4] = [Self::Line, Self::Flat, Self::Deep, Self::Long];

    pub(crate) fn code(self) -> u32 {
        match self {
            Self::Line => 0,
            Self::Flat => 1,
            Self::Deep => 2,
            Self::Long => 3,
        }
    }

    /// The code for it; only conservative voxels know less than columns need.
    fn files(self, mode: Mode) -> &'static [&'static str] {
        match (self, mode) {
            (Self::Line, Mode::Conservative) => shader!("case_line"),
            (Self::Flat, Mode::Conservative) => shader!("case_flat"),
            _ => shader!("case_columns"),
        }
    }
}

impl Stage {
    /// The function in the shader.
    pub(crate) fn entry_point(self) -> &'static str {
        match self {
            Self::TriangleParallel { .. } => "triangle_parallel",
            Self::TriangleList { .. } => "triangle_list",
            Self::Classify { .. } => "classify",
            Self::CountColumns => "count_columns",
            Self::Balanced => "balanced",
            Self::CountSlices => "count_slices",
            Self::Fill => "fill",
            Self::Expand => "expand",
            Self::ScanBlocks => "scan_blocks",
            Self::AddTotals => "add_totals",
            Self::Arguments { .. } => "write_arguments",
            Self::ClassifyCases => "classify_cases",
            Self::SortCases => "sort_cases",
            Self::CaseSizes => "case_sizes",
            Self::CaseSorted(_) => "case_sorted",
            Self::CountTiles => "count_tiles",
            Self::PairTiles => "pair_tiles",
            Self::CountDigits => "count_digits",
            Self::MoveEntries => "move_entries",
            Self::FindTiles => "find_tiles",
            Self::Tiled => "tiled",
        }
    }

    /// Whether voxels are written, and so may be appended to a list.
    pub(crate) fn writes_voxels(self) -> bool {
        match self {
            Self::TriangleParallel { .. }
            | Self::TriangleList { .. }
            | Self::Balanced
            | Self::Fill
            | Self::CaseSorted(_)
            | Self::Tiled => true,
            Self::Classify { .. }
            | Self::CountColumns
            | Self::CountSlices
            | Self::Expand
            | Self::ScanBlocks
            | Self::AddTotals
            | Self::Arguments { .. }
            | Self::ClassifyCases
            | Self::SortCases
            | Self::CaseSizes
            | Self::CountTiles
            | Self::PairTiles
            | Self::CountDigits
            | Self::MoveEntries
            | Self::FindTiles => false,
        }
    }

    fn files(self) -> &'static [&'static str] {
        match self {
            Self::TriangleParallel { .. } => shader!(
                "wide" "common" "triangle" "size" "look" "column" "columns" "voxels" "runs" "direct" "counters" "lanes"
                "triangle_parallel"
            ),
            Self::TriangleList { .. } => {
                shader!(
                    "wide" "common" "triangle" "column" "columns" "voxels" "runs" "direct" "counters" "lanes" "triangle_list"
                )
            }
            Self::Classify { .. } => shader!("wide" "common" "triangle" "size" "look" "counters" "classify"),
            Self::CountColumns => shader!("wide" "common" "triangle" "look" "counters" "count_columns"),
            Self::Balanced => shader!(
                "wide" "common" "triangle" "column" "voxels" "runs" "direct" "counters" "lanes" "pairs" "balanced"
            ),
            Self::CountSlices => {
                shader!("wide" "common" "triangle" "look" "counters" "slices_of" "count_slices")
            }
            Self::Fill => shader!("common" "fill"),
            Self::Expand => shader!("expand"),
            Self::ScanBlocks | Self::AddTotals => shader!("scan"),
            Self::Arguments { .. } => shader!("arguments"),
            Self::ClassifyCases => shader!("wide" "common" "triangle" "look" "counters" "classify_cases"),
            Self::SortCases => shader!("common" "sort_cases"),
            Self::CaseSizes => shader!("common" "case_sizes"),
            Self::CaseSorted(_) => shader!(
                "wide" "common" "triangle" "column" "columns" "voxels" "runs" "direct" "counters" "lanes" "case_sorted"
            ),
            Self::CountTiles => {
                shader!("wide" "common" "triangle" "look" "counters" "tiles" "triangle_tiles" "count_tiles")
            }
            Self::PairTiles => {
                shader!("wide" "common" "triangle" "counters" "tiles" "triangle_tiles" "pairs" "pair_tiles")
            }
            Self::CountDigits | Self::MoveEntries => shader!("numbering" "tile_key" "radix_sort"),
            Self::FindTiles => shader!("numbering" "find_tiles"),
            Self::Tiled => shader!(
                "wide" "common" "triangle" "column" "voxels" "runs" "tiles" "tile_memory" "counters" "lanes" "tiled"
            ),
        }
    }
}

/// The rasterizer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Raster {
    pub(crate) drawn: Drawn,
    pub(crate) dilation: Dilation,
}

/// What the rasterizer draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Drawn {
    /// All triangles.
    All,
    /// Those of a list.
    Listed,
    /// Each triangle once for each slice that it may meet.
    Slices,
    /// All triangles, in one slice.
    Slice,
}

impl Raster {
    /// The functions of the vertex and the fragment stage.
    pub(crate) fn entry_points(self) -> [&'static str; 2] {
        match self.drawn {
            Drawn::All | Drawn::Listed => ["dilate", "fragment_parallel"],
            Drawn::Slices => ["sliced", "slice"],
            Drawn::Slice => ["slice_per_pass", "slice"],
        }
    }

    fn files(self) -> &'static [&'static str] {
        match self.drawn {
            Drawn::All | Drawn::Listed => shader!(
                "wide" "common" "triangle" "column" "voxels" "runs" "direct" "counters" "dilate" "fragment_parallel"
            ),
            Drawn::Slices => shader!(
                "wide" "common" "triangle" "column" "voxels" "runs" "direct" "counters" "dilate" "slices_of" "slice" "pairs"
                "sliced"
            ),
            Drawn::Slice => shader!(
                "wide" "common" "triangle" "column" "voxels" "runs" "direct" "counters" "dilate" "slices_of" "slice"
                "slice_per_pass"
            ),
        }
    }
}

/// What a pipeline is specialized for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Variant {
    pub(crate) mode: Mode,
    pub(crate) counting: bool,
    pub(crate) sink: Sink,
}

/// Where voxels go: `SINK` of `voxels.wgsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(crate) enum Sink {
    #[default]
    Bits,
    /// To the bits, and to a list by whoever sets one.
    List,
    /// To a list alone, once for every triangle.
    Fragments,
    /// To the bits, and to a buffer that knows the lowest triangle of each voxel; strategies of slices alone do that.
    Claims,
    /// To a list alone, with the triangle.
    Pairs,
    /// Likewise the voxels whose doubled cubes a triangle meets, whatever the mode.
    Shell,
    /// To the bits, and to a list with the values that their triangles blend: only tiles do that.
    Targets(Plan),
}

impl Sink {
    fn code(self) -> u32 {
        match self {
            Self::Bits | Self::Claims | Self::Targets(_) => 0,
            Self::List => 1,
            Self::Fragments => 2,
            Self::Pairs | Self::Shell => 3,
        }
    }

    /// Whether the bits are looked at.
    pub(crate) fn has_bits(self) -> bool {
        matches!(self, Self::Bits | Self::List | Self::Claims | Self::Targets(_))
    }

    /// Words of an entry of the list.
    pub(crate) fn entry_words(self) -> usize {
        match self {
            Self::Bits | Self::Claims => 0,
            Self::List | Self::Fragments => 2,
            Self::Pairs | Self::Shell => 3,
            Self::Targets(plan) => 2 + plan.len(),
        }
    }

    /// Voxels along each axis of a tile, as logarithms.
    pub(crate) fn tile(self) -> [u32; 3] {
        if let Self::Targets(plan) = self { plan.tile() } else { TILE_SHIFT }
    }

    /// Pairs of triangle and tile that a workgroup takes.
    pub(crate) fn tile_share(self) -> u32 {
        if let Self::Targets(_) = self { TARGET_SHARE } else { TILE_SHARE }
    }

    fn files(self) -> &'static [&'static str] {
        match self {
            Self::Bits | Self::Claims | Self::Targets(_) => shader!("entry" "no_append"),
            Self::List | Self::Fragments => shader!("entry" "append"),
            Self::Pairs | Self::Shell => shader!("entry" "append_pairs"),
        }
    }

    fn claiming_files(self) -> &'static [&'static str] {
        if self == Self::Claims { shader!("claim") } else { shader!("no_claim") }
    }
}

impl Variant {
    /// Of stages that are the same in every mode.
    pub(crate) const ANY: Self = Self { mode: Mode::Conservative, counting: false, sink: Sink::Bits };
}

/// The WGSL of a compute stage.
pub(crate) fn source(stage: Stage, variant: Variant, tier: Tier, max_groups: u32) -> String {
    let small = match stage {
        Stage::TriangleParallel { .. } | Stage::TriangleList { small: true } => true,
        Stage::CaseSorted(case) => case != BoxCase::Long,
        _ => false,
    };
    let flat = stage == Stage::CaseSorted(BoxCase::Flat) && variant.mode == Mode::Conservative;
    let mut constants = front(small, flat, stage == Stage::Tiled);
    let mut files = stage.files().to_vec();
    match stage {
        Stage::CaseSorted(case) => {
            constants += &format!("const CASE: u32 = {}u;\n", case.code());
            files.extend(case.files(variant.mode));
        }
        Stage::CaseSizes => constants += &format!("const MAX_GROUPS: u32 = {max_groups}u;\n"),
        Stage::CountTiles | Stage::PairTiles | Stage::FindTiles | Stage::Tiled => {
            let [x, y, z] = variant.sink.tile();
            let share = variant.sink.tile_share();
            let words = 1u32 << (x + y);
            constants += &format!("const TILE_SHIFT: vec3<u32> = vec3<u32>({x}u, {y}u, {z}u);\n");
            constants += &format!("const TILE_WORDS: u32 = {words}u;\nconst SHARE: u32 = {share}u;\n");
            match (stage, variant.sink) {
                (Stage::Tiled, Sink::Targets(plan)) => {
                    constants += &plan.blending();
                    constants += &plan.painting();
                    files.extend(shader!("targets"));
                }
                (Stage::Tiled, _) => files.extend(shader!("no_targets")),
                _ => {}
            }
        }
        Stage::TriangleParallel { defers } => {
            let (heuristic, vertices) = defers.unwrap_or((Heuristic::default(), 1));
            let (hybrid, heuristic) = (defers.is_some(), heuristic.code());
            constants += &format!("const VERTICES: u32 = {vertices}u;\n");
            constants += &format!("const HYBRID: bool = {hybrid};\nconst HEURISTIC: u32 = {heuristic}u;\n");
        }
        Stage::Classify { heuristic } => constants += &format!("const HEURISTIC: u32 = {}u;\n", heuristic.code()),
        Stage::Arguments { vertices } => {
            constants += &format!("const VERTICES: u32 = {vertices}u;\nconst MAX_GROUPS: u32 = {max_groups}u;\n");
            constants += &format!("const MAX_PAIRS: u32 = {}u;\n", MAX_PAIRS / vertices.max(1));
        }
        _ => {}
    }
    assemble(variant, tier, &constants, &files, stage.writes_voxels())
}

/// The constants that every stage knows.
fn front(small: bool, flat: bool, tiled: bool) -> String {
    format!("const SMALL: bool = {small};\nconst FLAT: bool = {flat};\nconst TILED: bool = {tiled};\n")
}

/// The WGSL of a vertex and a fragment stage.
pub(crate) fn raster_source(raster: Raster, variant: Variant, tier: Tier) -> String {
    let (listed, dilation) = (raster.drawn == Drawn::Listed, raster.dilation.code());
    let constants =
        front(false, false, false) + &format!("const LISTED: bool = {listed};\nconst DILATION: u32 = {dilation}u;\n");
    let claiming = match raster.drawn {
        Drawn::All | Drawn::Listed => &[],
        Drawn::Slices | Drawn::Slice => variant.sink.claiming_files(),
    };
    assemble(variant, tier, &constants, &[raster.files(), claiming].concat(), true)
}

/// `writes` says whether voxels are written.
fn assemble(variant: Variant, tier: Tier, constants: &str, files: &[&str], writes: bool) -> String {
    let shell = variant.sink == Sink::Shell;
    // Its thresholds reach twice as far.
    let max_extent = if shell { MAX_EXTENT / 2 } else { MAX_EXTENT };
    let mode = match variant.mode {
        _ if shell => 4,
        Mode::Conservative => 0,
        Mode::Thin => 1,
        Mode::Solid => 2,
        Mode::Sliced => 3,
    };
    let counting = variant.counting;
    let shared = format!(
        "const MODE: u32 = {mode}u;\nconst COUNTING: bool = {counting};\nconst MAX_EXTENT: u32 = {max_extent}u;\n"
    );
    let product = match tier {
        Tier::Portable => include_str!("shaders/product_portable.wgsl"),
        Tier::Int64 => include_str!("shaders/product_int64.wgsl"),
    };
    let sink = variant.sink;
    let (code, listing) = (sink.code(), sink == Sink::List);
    let sinks = format!("const SINK: u32 = {code}u;\nconst LISTING: bool = {listing};\n");
    let constants: &[&str] = &[shared.as_str(), sinks.as_str(), constants, product];
    [constants, files, if writes { sink.files() } else { &[] }].concat().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::Kernel;

    const SINKS: [Sink; 6] = [Sink::Bits, Sink::List, Sink::Fragments, Sink::Pairs, Sink::Shell, Sink::Claims];

    /// Every mode with every sink, half of them counting.
    const VARIANTS: [Variant; 24] = {
        let mut variants = [Variant::ANY; 24];
        let mut i = 0;
        while i < variants.len() {
            variants[i] = Variant { mode: Mode::ALL[i / 6], counting: (i / 6 + i) % 2 == 1, sink: SINKS[i % 6] };
            i += 1;
        }
        variants
    };

    /// naga accepts it, with nothing but what the tier has beyond WebGPU.
    fn assert_valid(source: &str, tier: Tier, entry_points: &[&str]) {
        let capabilities = match tier {
            Tier::Portable => naga::valid::Capabilities::empty(),
            Tier::Int64 => naga::valid::Capabilities::SHADER_INT64,
        };
        let module = naga::front::wgsl::parse_str(source)
            .unwrap_or_else(|error| panic!("{entry_points:?}: {}", error.emit_to_string(source)));
        naga::valid::Validator::new(naga::valid::ValidationFlags::all(), capabilities)
            .validate(&module)
            .unwrap_or_else(|error| panic!("{entry_points:?}: {}", error.emit_to_string(source)));
        for name in entry_points {
            assert!(module.entry_points.iter().any(|entry| entry.name == *name), "{name}");
        }
    }

    #[test]
    fn every_compute_stage_is_valid() {
        let mut stages = vec![
            Stage::TriangleParallel { defers: None },
            Stage::TriangleList { small: false },
            Stage::TriangleList { small: true },
            Stage::CountColumns,
            Stage::Balanced,
            Stage::CountSlices,
            Stage::Fill,
            Stage::Expand,
            Stage::ScanBlocks,
            Stage::AddTotals,
            Stage::Arguments { vertices: 3 },
            Stage::ClassifyCases,
            Stage::SortCases,
            Stage::CaseSizes,
            Stage::CountTiles,
            Stage::PairTiles,
            Stage::CountDigits,
            Stage::MoveEntries,
            Stage::FindTiles,
            Stage::Tiled,
        ];
        stages.extend(BoxCase::ALL.map(Stage::CaseSorted));
        for heuristic in Heuristic::ALL {
            stages.push(Stage::TriangleParallel { defers: Some((heuristic, 15)) });
            stages.push(Stage::Classify { heuristic });
        }
        for stage in stages {
            for variant in VARIANTS {
                for tier in Tier::ALL {
                    assert_valid(&source(stage, variant, tier, 65_535), tier, &[stage.entry_point()]);
                }
            }
        }
    }

    #[test]
    fn every_blend_of_targets_is_valid() {
        for plan in Plan::samples() {
            for mode in Mode::ALL {
                for stage in [Stage::CountTiles, Stage::PairTiles, Stage::FindTiles, Stage::Tiled] {
                    let variant = Variant { mode, counting: mode == Mode::Thin, sink: Sink::Targets(plan) };
                    for tier in Tier::ALL {
                        assert_valid(&source(stage, variant, tier, 65_535), tier, &[stage.entry_point()]);
                    }
                }
            }
        }
    }

    #[test]
    fn every_kernel_is_valid() {
        for kernel in Kernel::all() {
            assert_valid(&kernel.source(), Tier::Portable, &[kernel.entry_point()]);
        }
    }

    #[test]
    fn every_raster_stage_is_valid() {
        for dilation in Dilation::ALL {
            for drawn in [Drawn::All, Drawn::Listed, Drawn::Slices, Drawn::Slice] {
                for variant in VARIANTS {
                    for tier in Tier::ALL {
                        let raster = Raster { drawn, dilation };
                        assert_valid(&raster_source(raster, variant, tier), tier, &raster.entry_points());
                    }
                }
            }
        }
    }
}
