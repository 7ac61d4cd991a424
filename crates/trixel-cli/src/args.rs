//! The command line: what can be said and how it reads in `--help`.

use std::num::NonZeroU32;
use std::path::PathBuf;

use clap::builder::styling::{AnsiColor, Styles};
use clap::{Args, Parser, Subcommand, ValueEnum};
use trixel::{Grid, Job, Mode, Strategy, UpAxis};

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
    /// Print a completion script for a shell.
    ///
    /// For example: trixel completions bash > ~/.local/share/bash-completion/completions/trixel
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
}

const VOXELIZE_USAGE: &str = "trixel voxelize <INPUT> -o <OUT> [-o <OUT>...] [OPTIONS]";

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

Exit status: 0 done, 1 failed (one message on standard error says what, where, and what to do), 2 wrong usage.";

#[derive(Debug, Args)]
pub(crate) struct VoxelizeArgs {
    /// A mesh file, or scene:NAME or scene:NAME:N.
    #[arg(value_name = "INPUT")]
    pub(crate) input: Option<String>,

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

    /// Who computes: `auto` takes the best there is.
    #[arg(long, value_enum, default_value_t)]
    pub(crate) backend: BackendArg,

    /// The way to compute; every one gives the same voxels.
    #[arg(long, value_enum, default_value_t)]
    pub(crate) strategy: StrategyArg,

    /// Number of threads; the result is the same for any. By default one a core.
    #[arg(short, long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub(crate) threads: Option<u32>,
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
    #[arg(value_name = "FILE")]
    pub(crate) file: String,

    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
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

/// The backends of this build.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(crate) enum BackendArg {
    /// The best there is.
    #[default]
    Auto,
    /// The processor.
    Cpu,
}

/// [`Strategy`] on the command line.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(crate) enum StrategyArg {
    /// The backend's choice.
    #[default]
    Auto,
    /// CPU: one run of voxels per triangle and grid column.
    ColumnRuns,
}

impl From<StrategyArg> for Strategy {
    fn from(strategy: StrategyArg) -> Self {
        match strategy {
            StrategyArg::Auto => Self::Auto,
            StrategyArg::ColumnRuns => Self::ColumnRuns,
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
