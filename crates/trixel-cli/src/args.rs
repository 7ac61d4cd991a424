//! The command line: what can be said and how it reads in `--help`.

use std::num::NonZeroU32;
use std::path::PathBuf;

use clap::builder::styling::{AnsiColor, Styles};
use clap::{Args, Parser, Subcommand, ValueEnum};
use trixel::attributes::{AttributeKind, Combine};
use trixel::fill::Fill;
use trixel::{Grid, Job, Mode, Strategy, UpAxis};
use trixel_gpu::{Dilation, Heuristic, ListMethod};

use crate::render_args::{ANIMATE_EXAMPLES, AnimateArgs, RENDER_EXAMPLES, RenderArgs};

const STYLES: Styles = Styles::styled()
    .header(AnsiColor::Yellow.on_default().bold())
    .usage(AnsiColor::Yellow.on_default().bold())
    .literal(AnsiColor::Cyan.on_default().bold())
    .placeholder(AnsiColor::Cyan.on_default());

/// Turn triangle meshes into voxels, exactly.
///
/// Every mode has one definition and therefore one right answer; trixel gives precisely that set of voxels, for any
/// number of threads.
#[derive(Debug, Parser)]
#[command(name = "trixel", version, styles = STYLES, max_term_width = 100, arg_required_else_help = true)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Voxelize a mesh and write the voxels.
    #[command(long_about = voxelize_about(), after_help = VOXELIZE_EXAMPLES, override_usage = VOXELIZE_USAGE)]
    Voxelize(Box<VoxelizeArgs>),
    /// Describe a mesh, a volume, or a built-in scene.
    Info(InfoArgs),
    /// Check a volume against a mesh: voxelize again and list what is missing and what is extra.
    ///
    /// Exits with status 1 if any voxel differs.
    Verify(VerifyArgs),
    /// Take a picture of light that passes through a mesh: refraction, transmittance, transparent shadow.
    ///
    /// The effects of Chang and Lai 2011, section 3, computed from voxels on a GPU; or traced, with --reference.
    #[command(after_help = RENDER_EXAMPLES)]
    Render(Box<RenderArgs>),
    /// Make a film of light through a mesh that deforms, voxelized anew for every frame.
    ///
    /// Skinned and morphed glTF plays its animation; other meshes are walked round. Takes the effects of `render`.
    #[command(after_help = ANIMATE_EXAMPLES)]
    Animate(Box<AnimateArgs>),
    /// Find the cutoff at which the hybrid strategy is fastest on this machine's GPU, and store it for later runs.
    ///
    /// Searches by golden section on the mesh and grid given, prints what it measured beside the two pure strategies, and
    /// keeps the best cutoff in the user's configuration folder.
    Tune(TuneArgs),
    /// Measure every strategy on this machine, with the wrong voxels counted: the papers' tables and plots.
    ///
    /// Prints a table in the manner of Rauwendaal's table 4.1, and his own numbers with `--table hcv`. Software adapters are
    /// labelled as such.
    #[command(after_help = BENCH_EXAMPLES)]
    Bench(BenchArgs),
    /// Print a completion script for a shell.
    ///
    /// For example: trixel completions bash > ~/.local/share/bash-completion/completions/trixel
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
}

const VOXELIZE_USAGE: &str = "trixel voxelize <INPUT>... -o <OUT> [-o <OUT>...] [OPTIONS]";

fn voxelize_about() -> String {
    format!(
        "Voxelize a mesh and write the voxels.\n\nINPUT is a mesh file (.obj, .stl, .ply, .off, .gltf, .glb, .3mf, .dae) \
         or a built-in scene, `scene:NAME` or `scene:NAME:N`. The voxels go to every OUT, whose extension picks the \
         format. Outputs appear whole or not at all.\n\nScenes, with what N is:\n{}",
        crate::mesh::scene_list()
    )
}

const VOXELIZE_EXAMPLES: &str = "\
Examples:
  trixel voxelize scene:torus --resolution 128 -o torus.npz -o torus.png
  trixel voxelize part.stl --voxel-size 0.25 --mode solid -o part.vti
  trixel voxelize city.glb --dims 512 512 128 --origin 0 0 0 --voxel-size 1 -o city.vox
  trixel voxelize moved.obj --like before.npz -o after.npz
  trixel voxelize hull.stl cargo.stl -r 256 --attributes material --priority cargo,hull -o ship.npz
  trixel voxelize spot.obj -r 256 --attributes color,normal --sparse -o spot.npz -o spot.vox

Exit status: 0 done, 1 failed (one message on standard error says what, where, and what to do), 2 wrong usage.";

#[derive(Debug, Args)]
pub(crate) struct VoxelizeArgs {
    /// A mesh file, or scene:NAME or scene:NAME:N; several share one grid.
    ///
    /// Of several, a material is called STEM/MATERIAL after its file (scene.glb's `glass` is `scene/glass`), or STEM if it
    /// has no name; triangles without a material get one of that name.
    #[arg(value_name = "INPUT")]
    pub(crate) inputs: Vec<String>,

    /// Write the voxels here; may be given several times.
    ///
    /// .npz and .npy (NumPy), .binvox, .vox (MagicaVoxel), .vti (VTK), .nrrd, .raw with .json; .obj, .ply, .stl and
    /// .glb (the exposed faces); .png (a shaded picture); .zarr (a Zarr v3 folder, alone).
    #[arg(short, long = "output", value_name = "OUT")]
    pub(crate) outputs: Vec<PathBuf>,

    #[command(flatten)]
    pub(crate) grid: GridArgs,

    #[command(flatten)]
    pub(crate) method: MethodArgs,

    /// Write a JSON report: grid, counts, milliseconds per stage, memory, warnings.
    #[arg(long, value_name = "FILE.json", help_heading = "Output")]
    pub(crate) report: Option<PathBuf>,

    /// Voxelize N times on the same grid and report the medians and every sample.
    #[arg(long, value_name = "N", default_value = "1", help_heading = "Output")]
    pub(crate) repeat: NonZeroU32,

    #[command(flatten)]
    pub(crate) attributes: AttributeArgs,

    /// Also list the set voxels on the GPU by this method, and report its time and memory; all give the same list.
    #[arg(long, value_enum, value_name = "NAME", help_heading = "GPU")]
    pub(crate) list_method: Option<ListMethodArg>,

    /// Write .npz as a list of set voxels (`indices`) instead of a dense array, and .ply as a cloud of their centres
    /// instead of faces.
    ///
    /// With .npz, .ply and .vox alone, memory then follows the surface instead of the grid; a grid that would not fit the
    /// memory is written so without asking.
    #[arg(long, help_heading = "Output")]
    pub(crate) sparse: bool,

    /// Take at most this much memory, such as 2GiB; for a single .zarr output, which is written tile by tile.
    ///
    /// The plan (tiles, memory, time) is printed first. Binary STL and PLY files of triangles that do not fit are read in
    /// passes. By default what is available.
    #[arg(long, value_name = "SIZE", value_parser = crate::out_of_core::parse_size, help_heading = "Output")]
    pub(crate) memory_limit: Option<u64>,

    /// Go on where a run that was killed stopped; its tiles are in NAME.zarr.partial. Give the same options again.
    #[arg(long, help_heading = "Output")]
    pub(crate) resume: bool,

    /// The axis of the mesh that points up, for formats with a notion of up (.vox, .glb, .png).
    ///
    /// `auto` follows the file: glTF is y up, 3MF z up, COLLADA says so itself; otherwise z for .stl and y for the rest.
    #[arg(long, value_enum, default_value_t, value_name = "AXIS", help_heading = "Output")]
    pub(crate) up: UpArg,

    /// Say nothing but errors.
    #[arg(short, long, help_heading = "Output")]
    pub(crate) quiet: bool,
}

/// What is in the voxels.
#[derive(Debug, Args)]
#[command(next_help_heading = "Attributes")]
pub(crate) struct AttributeArgs {
    /// What to find out about every voxel, separated by commas; .npz and .vti hold all of it, .vox, .ply, .obj, .glb and
    /// .png show the colours.
    ///
    /// Values are those at the point of the mesh nearest to the voxel's centre. Textures are PNG and JPEG; one that is
    /// missing is a warning. What an alpha test cuts out stays set, with colour 0 and alpha 0, and is left out of .vox,
    /// meshes and pictures.
    #[arg(long, value_enum, value_delimiter = ',', value_name = "NAME,...")]
    pub(crate) attributes: Vec<AttributeArg>,

    /// How the triangles that meet in a voxel become one value.
    #[arg(long, value_enum, default_value_t, value_name = "NAME", requires = "attributes")]
    pub(crate) combine: CombineArg,

    /// Materials from the one that matters most to the one that matters least; those not named come last. Only the
    /// triangles of the first that a voxel has count in it. Of several INPUTs, STEM stands for all materials of one.
    #[arg(long, value_delimiter = ',', value_name = "MATERIAL,...", requires = "attributes")]
    pub(crate) priority: Vec<String>,
}

/// [`AttributeKind`] on the command line.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum AttributeArg {
    /// sRGB colour and alpha: vertex colour x material x texture (u8 x 4).
    Color,
    /// Shading normal (f32 x 3).
    Normal,
    /// Normal of the triangle's plane (f32 x 3).
    #[value(alias = "geometric_normal")]
    GeometricNormal,
    /// First set of texture coordinates (f32 x 2).
    Texcoord,
    /// Number of the material (u32).
    #[value(alias = "material_id")]
    Material,
    /// Number of the triangle (u32).
    #[value(alias = "triangle_id")]
    Triangle,
    /// Barycentric coordinates on that triangle (f32 x 3).
    Barycentric,
    /// Emitted light, linear (f32 x 3).
    Emission,
    /// Metalness and roughness (f32 x 2).
    #[value(alias = "metallic_roughness")]
    MetallicRoughness,
}

impl From<AttributeArg> for AttributeKind {
    fn from(kind: AttributeArg) -> Self {
        match kind {
            AttributeArg::Color => Self::Color,
            AttributeArg::Normal => Self::Normal,
            AttributeArg::GeometricNormal => Self::GeometricNormal,
            AttributeArg::Texcoord => Self::Texcoord,
            AttributeArg::Material => Self::Material,
            AttributeArg::Triangle => Self::Triangle,
            AttributeArg::Barycentric => Self::Barycentric,
            AttributeArg::Emission => Self::Emission,
            AttributeArg::MetallicRoughness => Self::MetallicRoughness,
        }
    }
}

/// [`Combine`] on the command line.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(crate) enum CombineArg {
    /// The mean; ids are the nearest triangle's.
    #[default]
    Mean,
    /// The mean by area inside the voxel; ids are the dominant triangle's.
    AreaWeighted,
    /// The triangle nearest to the voxel's centre.
    Nearest,
    /// The triangle with the largest area inside the voxel.
    Dominant,
    /// The largest of each component; ids are those of the triangle with the highest number.
    Max,
    /// The triangle with the lowest number.
    First,
    /// All of them: .npz keeps a row for each, and `offsets`; other formats show the first.
    All,
}

impl From<CombineArg> for Combine {
    fn from(combine: CombineArg) -> Self {
        match combine {
            CombineArg::Mean => Self::Mean,
            CombineArg::AreaWeighted => Self::AreaWeighted,
            CombineArg::Nearest => Self::Nearest,
            CombineArg::Dominant => Self::Dominant,
            CombineArg::Max => Self::Max,
            CombineArg::First => Self::First,
            CombineArg::All => Self::All,
        }
    }
}

/// Where the voxels are. Without any of these, `--resolution 128`.
#[derive(Debug, Args)]
#[command(next_help_heading = "Grid")]
pub(crate) struct GridArgs {
    /// Exactly N cubic voxels along the mesh's longest side, as few as cover it along the others; 128 when no grid
    /// option is given.
    #[arg(short, long, value_name = "N", conflicts_with_all = ["voxel_size", "dims", "origin", "like"],
        value_parser = clap::value_parser!(u32).range(1..=i64::from(Grid::MAX_DIM)))]
    pub(crate) resolution: Option<u32>,

    /// Edge length of a voxel in the mesh's units: H for cubes, or HX HY HZ.
    #[arg(long, value_name = "H", num_args = 1..=3, value_delimiter = ',', allow_negative_numbers = true,
        conflicts_with = "like")]
    pub(crate) voxel_size: Vec<String>,

    /// Number of voxels along each axis. Without --voxel-size, the smallest cubes with which the grid covers the mesh.
    #[arg(long, value_names = ["X", "Y", "Z"], num_args = 3, conflicts_with = "like",
        value_parser = clap::value_parser!(u32).range(1..=i64::from(Grid::MAX_DIM)))]
    pub(crate) dims: Option<Vec<u32>>,

    /// Minimum corner of the grid; by default that of the mesh's bounding box.
    #[arg(long, value_names = ["X", "Y", "Z"], num_args = 3, allow_hyphen_values = true, conflicts_with = "like")]
    pub(crate) origin: Option<Vec<f64>>,

    /// The grid of an existing volume (.npz, .npy, .binvox, .vti, .nrrd, .raw).
    #[arg(long, value_name = "VOLUME")]
    pub(crate) like: Option<PathBuf>,
}

/// Which voxels are set, and who computes them.
#[derive(Debug, Args)]
#[command(next_help_heading = "Method")]
pub(crate) struct MethodArgs {
    /// Which voxels are set.
    #[arg(short, long, value_enum, default_value_t)]
    pub(crate) mode: ModeArg,

    /// Extend every slice of mode `sliced` by this many voxels on both sides.
    #[arg(long, value_name = "VOXELS", default_value = "0", allow_negative_numbers = true,
        value_parser = parse_overlap)]
    pub(crate) overlap: f64,

    /// How mode `solid` finds the inside; all but `parity` from the voxels of mode `sliced`, which is not exact.
    #[arg(long, value_enum, default_value_t)]
    pub(crate) fill: FillArg,

    /// Who computes: `auto` takes the best there is.
    #[arg(long, value_enum, default_value_t)]
    pub(crate) backend: BackendArg,

    /// The way to compute; every one gives the same voxels.
    #[arg(long, value_enum, default_value_t)]
    pub(crate) strategy: StrategyArg,

    #[command(flatten)]
    pub(crate) gpu: GpuArgs,

    /// Number of threads; the result is the same for any. By default one a core.
    #[arg(short, long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub(crate) threads: Option<u32>,
}

/// What only the GPU backend looks at.
#[derive(Debug, Args)]
#[command(next_help_heading = "GPU")]
pub(crate) struct GpuArgs {
    /// Compute on the adapter whose name or driver contains NAME, in any case; `trixel info --adapters` lists them.
    #[arg(long, value_name = "NAME")]
    pub(crate) adapter: Option<String>,

    /// The hybrids leave triangles of this size and above to the rasterizer, in voxels squared of --heuristic; 0 leaves it
    /// all of them, inf none. By default what `trixel tune` stored, or a value for the kind of adapter.
    #[arg(long, value_name = "SIZE", value_parser = parse_cutoff, allow_negative_numbers = true)]
    pub(crate) cutoff: Option<f32>,

    /// What a triangle's size is.
    #[arg(long, value_enum, default_value_t)]
    pub(crate) heuristic: HeuristicArg,

    /// How triangles are enlarged for the rasterizer.
    #[arg(long, value_enum, default_value_t)]
    pub(crate) dilation: DilationArg,

    /// Count invocations, fragments, tests, writes and atomics for the report. Costs time.
    #[arg(long)]
    pub(crate) counters: bool,
}

fn parse_cutoff(text: &str) -> Result<f32, String> {
    let size: f32 = text.parse().map_err(|_| "not a number".to_owned())?;
    if size >= 0.0 { Ok(size) } else { Err("a cutoff takes 0 or more, or inf".to_owned()) }
}

/// [`Heuristic`] on the command line.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(crate) enum HeuristicArg {
    /// The area projected along the dominant axis.
    #[default]
    ProjectedArea,
    /// The area of the projection's bounding rectangle.
    BoxArea,
    /// The area of the projection, enlarged by half a voxel.
    DilatedArea,
    /// The projected area over the dilated one, 0 to 1.
    AreaRatio,
    /// The voxels of the bounding box.
    Extent,
}

impl From<HeuristicArg> for Heuristic {
    fn from(heuristic: HeuristicArg) -> Self {
        match heuristic {
            HeuristicArg::ProjectedArea => Self::ProjectedArea,
            HeuristicArg::BoxArea => Self::BoxArea,
            HeuristicArg::DilatedArea => Self::DilatedArea,
            HeuristicArg::AreaRatio => Self::AreaRatio,
            HeuristicArg::Extent => Self::Extent,
        }
    }
}

/// [`Dilation`] on the command line.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(crate) enum DilationArg {
    /// The convex hull of pixel-sized squares at the corners.
    HasselgrenHull,
    /// Edges moved out by half a pixel's reach.
    #[default]
    HasselgrenTriangle,
    /// Edges moved out by half a pixel's diagonal.
    Hertel,
}

impl From<DilationArg> for Dilation {
    fn from(dilation: DilationArg) -> Self {
        match dilation {
            DilationArg::HasselgrenHull => Self::HasselgrenHull,
            DilationArg::HasselgrenTriangle => Self::HasselgrenTriangle,
            DilationArg::Hertel => Self::Hertel,
        }
    }
}

fn parse_overlap(text: &str) -> Result<f64, String> {
    let voxels: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if (0.0..=f64::from(Job::MAX_OVERLAP)).contains(&voxels) {
        Ok(voxels)
    } else {
        Err(format!("an overlap takes 0 to {} voxels", Job::MAX_OVERLAP))
    }
}

#[derive(Debug, Args)]
pub(crate) struct InfoArgs {
    /// A mesh file, a volume (.npz, .npy, .binvox, .vti, .nrrd, .raw), or scene:NAME or scene:NAME:N.
    #[arg(value_name = "FILE", required_unless_present = "adapters")]
    pub(crate) file: Option<String>,

    /// List the GPU adapters of this machine instead.
    #[arg(long, conflicts_with = "file")]
    pub(crate) adapters: bool,

    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct TuneArgs {
    /// A mesh file, or scene:NAME or scene:NAME:N.
    #[arg(value_name = "INPUT")]
    pub(crate) input: Option<String>,

    #[command(flatten)]
    pub(crate) grid: GridArgs,

    /// Which voxels are set.
    #[arg(short, long, value_enum, default_value_t)]
    pub(crate) mode: ModeArg,

    /// Tune for the adapter whose name or driver contains NAME; by default the first, real ones before software.
    #[arg(long, value_name = "NAME")]
    pub(crate) adapter: Option<String>,

    /// What a triangle's size is.
    #[arg(long, value_enum, default_value_t)]
    pub(crate) heuristic: HeuristicArg,

    /// How triangles are enlarged for the rasterizer.
    #[arg(long, value_enum, default_value_t)]
    pub(crate) dilation: DilationArg,

    /// Runs per cutoff; their median counts.
    #[arg(long, value_name = "N", default_value = "5")]
    pub(crate) repeat: NonZeroU32,

    /// Print the curve, but store nothing.
    #[arg(long)]
    pub(crate) dry_run: bool,
}

const BENCH_EXAMPLES: &str = "\
Examples:
  trixel bench --table hcv --html report.html --json results.json
  trixel bench bunny.ply scene:room -r 256 --counters
  trixel bench --table cl torus.obj horse.ply dragon.ply
  trixel bench --table fills bunny.ply -r 64,128,256
  trixel bench --table effects scene:torus horse.ply -r 128,256
  trixel bench --figure 3.13 --figure 3.14 scene:room --html sweep.html
  trixel bench --lists bunny.ply scene:room
  trixel bench --compare results.json";

#[derive(Debug, Args)]
pub(crate) struct BenchArgs {
    /// Mesh files and scenes; by default the built-in scenes that stand for the kinds of mesh there are.
    #[arg(value_name = "INPUT")]
    pub(crate) inputs: Vec<String>,

    /// The papers' models: a folder with `models.json`, an object of a name for each file, such as
    /// {"Stanford Bunny": "bunny.ply"}.
    #[arg(long, value_name = "DIR")]
    pub(crate) models: Option<PathBuf>,

    /// Print this table of a paper below ours, as it was published; and measure in its mode unless --mode says otherwise.
    #[arg(long, value_enum, value_name = "NAME")]
    pub(crate) table: Option<TableArg>,

    /// Measure what this figure of Rauwendaal 2012 needs; 3.13 and 3.14 sweep the hybrid's cutoff. --html shows it.
    #[arg(long = "figure", value_enum, value_name = "NUMBER")]
    pub(crate) figures: Vec<FigureArg>,

    /// Compare the methods of listing voxels on the GPU instead of the strategies: time, memory, wrong entries.
    #[arg(long, conflicts_with_all = ["table", "figures", "strategy", "cutoff", "counters"])]
    pub(crate) lists: bool,

    /// Voxels along the longest side of the grid.
    #[arg(short, long = "resolution", value_delimiter = ',', value_name = "N,...", default_value = "128,256,512",
        value_parser = clap::value_parser!(u32).range(1..=16384))]
    pub(crate) resolutions: Vec<u32>,

    /// Which voxels are set.
    #[arg(short, long, value_enum)]
    pub(crate) mode: Option<ModeArg>,

    /// Strategies of the GPU to measure; by default all of them.
    #[arg(long, value_enum, value_delimiter = ',', value_name = "NAME,...")]
    pub(crate) strategy: Vec<StrategyArg>,

    /// Measure the processor, the GPU, or (auto) both.
    #[arg(long, value_enum, default_value_t)]
    pub(crate) backend: BackendArg,

    /// Measure the adapter whose name or driver contains NAME; by default the first, real ones before software.
    #[arg(long, value_name = "NAME")]
    pub(crate) adapter: Option<String>,

    /// From which projected area on, in square voxels, the hybrids call a triangle large; by default the best found for each
    /// mesh and resolution.
    #[arg(long, value_name = "AREA")]
    pub(crate) cutoff: Option<f32>,

    /// Let the shaders count, in a run that is not timed.
    #[arg(long)]
    pub(crate) counters: bool,

    /// Timed runs of each cell; all strategies take turns.
    #[arg(long, value_name = "N", default_value = "5")]
    pub(crate) repeat: NonZeroU32,

    /// Use N threads on the CPU [default: all].
    #[arg(short, long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub(crate) threads: Option<u32>,

    /// Write everything that was measured.
    #[arg(long, value_name = "FILE.json", help_heading = "Output")]
    pub(crate) json: Option<PathBuf>,

    /// Write a page with tables and plots that needs no other file.
    #[arg(long, value_name = "FILE.html", help_heading = "Output")]
    pub(crate) html: Option<PathBuf>,

    /// Say what got faster or slower since FILE.json was written.
    #[arg(long, value_name = "FILE.json", help_heading = "Output")]
    pub(crate) compare: Option<PathBuf>,
}

/// A table of a paper, or of how far its methods are off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum TableArg {
    /// Rauwendaal 2012, table 4.1.
    Hcv,
    /// Chang and Lai 2011, table 1: `sliced` against `slice-per-pass`.
    Cl,
    /// No times, but how many voxels the fills of Chang and Lai 2011 get wrong.
    Fills,
    /// What a frame of each lighting effect of Chang and Lai 2011 takes.
    Effects,
}

/// A figure of Rauwendaal 2012.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FigureArg {
    /// Triangle-parallel over the resolution.
    #[value(name = "3.3")]
    TriangleParallel,
    /// Fragment-parallel over the resolution.
    #[value(name = "3.4")]
    FragmentParallel,
    /// Both beside each other.
    #[value(name = "3.10")]
    Both,
    /// The hybrid over its cutoff.
    #[value(name = "3.13")]
    Cutoffs,
    /// The hybrid over low cutoffs.
    #[value(name = "3.14")]
    LowCutoffs,
}

#[derive(Debug, Args)]
pub(crate) struct VerifyArgs {
    /// The volume to check (.npz, .npy, .binvox, .vti, .nrrd, .raw).
    #[arg(value_name = "VOLUME")]
    pub(crate) volume: PathBuf,

    /// The mesh that it should be the voxels of, or scene:NAME or scene:NAME:N.
    #[arg(value_name = "MESH")]
    pub(crate) mesh: String,

    #[command(flatten)]
    pub(crate) method: MethodArgs,

    /// List at most N missing and N extra voxels.
    #[arg(long, value_name = "N", default_value = "10")]
    pub(crate) list: usize,
}

/// [`Mode`] on the command line.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(crate) enum ModeArg {
    /// Every voxel that touches the surface (26-separating).
    #[default]
    Conservative,
    /// A thin surface without holes to face neighbours (6-separating).
    Thin,
    /// The inside of a closed mesh, by parity along -z.
    Solid,
    /// One line along z through each voxel's centre; misses walls parallel to z.
    Sliced,
}

impl From<ModeArg> for Mode {
    fn from(mode: ModeArg) -> Self {
        match mode {
            ModeArg::Conservative => Self::Conservative,
            ModeArg::Thin => Self::Thin,
            ModeArg::Solid => Self::Solid,
            ModeArg::Sliced => Self::Sliced,
        }
    }
}

/// [`Fill`] on the command line.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(crate) enum FillArg {
    /// Exact: the triangles below each voxel's centre are counted.
    #[default]
    Parity,
    /// Boundary voxels switch between outside and inside, slice after slice; odd columns take what most neighbours have.
    Xor,
    /// Columns are marched along; odd ones get the mean thickness of their neighbours.
    March,
}

impl From<FillArg> for Fill {
    fn from(fill: FillArg) -> Self {
        match fill {
            FillArg::Parity => Self::Parity,
            FillArg::Xor => Self::Xor,
            FillArg::March => Self::March,
        }
    }
}

/// The backends of this build.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(crate) enum BackendArg {
    /// A real GPU if there is one, else the processor.
    #[default]
    Auto,
    /// The processor.
    Cpu,
    /// A GPU, through Vulkan, Metal or Direct3D 12; a software one if there is no other.
    Gpu,
}

/// [`ListMethod`] on the command line.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum ListMethodArg {
    /// Prefix sums over the finished bits.
    Scan,
    /// A pyramid of sums over the finished bits, which every entry descends alone.
    Histopyramid,
    /// While voxelizing: whoever sets a bit first appends the voxel; then sorted.
    Atomic,
    /// While voxelizing, without bits: every triangle appends all its voxels; sorted and merged. Not for solids.
    FragmentList,
}

impl From<ListMethodArg> for ListMethod {
    fn from(method: ListMethodArg) -> Self {
        match method {
            ListMethodArg::Scan => Self::Scan,
            ListMethodArg::Histopyramid => Self::Histopyramid,
            ListMethodArg::Atomic => Self::Atomic,
            ListMethodArg::FragmentList => Self::FragmentList,
        }
    }
}

/// [`Strategy`] on the command line.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(crate) enum StrategyArg {
    /// The backend's choice.
    #[default]
    Auto,
    /// CPU: one run of voxels per triangle and grid column.
    ColumnRuns,
    /// GPU: one invocation a triangle.
    TriangleParallel,
    /// GPU: one fragment a column of a triangle.
    FragmentParallel,
    /// GPU: small triangles by invocation, large ones by the rasterizer, in one go.
    Hybrid,
    /// GPU: the same, with the triangles sorted first.
    HybridTwoPass,
    /// GPU: one invocation a pair of triangle and column.
    Balanced,
    /// GPU, mode sliced: each triangle once for each slice that it may meet, in one draw.
    Sliced,
    /// GPU, mode sliced: the whole mesh once for each slice.
    SlicePerPass,
    /// GPU: triangles sorted by the axes their boxes extend along, code for each case (Schwarz and Seidel 2010).
    CaseSorted,
    /// GPU: triangles binned to tiles and sorted, one workgroup a tile (VoxelPipe, 2011).
    Tiled,
}

impl From<StrategyArg> for Strategy {
    fn from(strategy: StrategyArg) -> Self {
        match strategy {
            StrategyArg::Auto => Self::Auto,
            StrategyArg::ColumnRuns => Self::ColumnRuns,
            StrategyArg::TriangleParallel => Self::TriangleParallel,
            StrategyArg::FragmentParallel => Self::FragmentParallel,
            StrategyArg::Hybrid => Self::Hybrid,
            StrategyArg::HybridTwoPass => Self::HybridTwoPass,
            StrategyArg::Balanced => Self::Balanced,
            StrategyArg::Sliced => Self::Sliced,
            StrategyArg::SlicePerPass => Self::SlicePerPass,
            StrategyArg::CaseSorted => Self::CaseSorted,
            StrategyArg::Tiled => Self::Tiled,
        }
    }
}

/// [`UpAxis`] on the command line.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(crate) enum UpArg {
    /// What the file or its format says.
    #[default]
    Auto,
    /// x points up.
    X,
    /// y points up.
    Y,
    /// z points up.
    Z,
}

impl UpArg {
    /// The axis given, if one was.
    pub(crate) fn axis(self) -> Option<UpAxis> {
        match self {
            Self::Auto => None,
            Self::X => Some(UpAxis::X),
            Self::Y => Some(UpAxis::Y),
            Self::Z => Some(UpAxis::Z),
        }
    }
}
