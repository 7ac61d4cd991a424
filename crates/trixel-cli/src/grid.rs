//! The grid that the arguments ask for.

use anyhow::{Context, Result, ensure};
use clap::CommandFactory;
use clap::error::ErrorKind;
use trixel::{Bounds, Grid, Mesh};
use trixel_io::volume_read::read_grid;

use crate::args::{Cli, GridArgs};
use crate::progress::Reporter;

/// What `--resolution` is when nothing is given.
const DEFAULT_RESOLUTION: u32 = 128;

/// A validated wish for a grid; the mesh's box fills in what it leaves open.
#[derive(Debug)]
pub(crate) enum GridRequest {
    Fit(u32),
    Like(std::path::PathBuf),
    Explicit { voxel_size: Option<[f64; 3]>, dims: Option<[u32; 3]>, origin: Option<[f64; 3]> },
}

impl GridRequest {
    /// Reads the arguments. Input paths that `--voxel-size` swallowed, since it takes one to three values, are handed
    /// back in `inputs`.
    pub(crate) fn from_args(args: &GridArgs, inputs: &mut Vec<String>) -> Self {
        let mut sizes = args.voxel_size.clone();
        let numbers = sizes.iter().rposition(|text| text.parse::<f64>().is_ok()).map_or(0, |last| last + 1);
        if numbers > 0 && numbers < sizes.len() {
            if !inputs.is_empty() {
                usage(&format!(
                    "--voxel-size: `{}` is not a positive number; inputs go before the options, or after `--`",
                    sizes[numbers]
                ));
            }
            *inputs = sizes.split_off(numbers);
        }
        let voxel_size = match *sizes.iter().map(|text| positive(text)).collect::<Vec<_>>() {
            [] => None,
            [h] => Some([h; 3]),
            [x, y, z] => Some([x, y, z]),
            _ => usage("--voxel-size takes one number, or three: HX HY HZ"),
        };
        let three = |values: &Option<Vec<f64>>| values.as_ref().map(|v| [v[0], v[1], v[2]]);
        let origin = three(&args.origin);
        if origin.is_some_and(|origin| origin.iter().any(|c| !c.is_finite())) {
            usage("--origin takes three finite numbers");
        }
        if let Some(path) = &args.like {
            Self::Like(path.clone())
        } else if voxel_size.is_some() || args.dims.is_some() {
            let dims = args.dims.as_ref().map(|d| [d[0], d[1], d[2]]);
            Self::Explicit { voxel_size, dims, origin }
        } else if origin.is_some() {
            usage("--origin needs --voxel-size or --dims beside it")
        } else {
            Self::Fit(args.resolution.unwrap_or(DEFAULT_RESOLUTION))
        }
    }

    /// The grid for a mesh.
    pub(crate) fn resolve(&self, mesh: &Mesh, reporter: &Reporter) -> Result<Grid> {
        self.resolve_in(mesh.bounds().context("the mesh has no triangles")?, reporter)
    }

    /// The grid for a mesh with this box.
    pub(crate) fn resolve_in(&self, bounds: Bounds, reporter: &Reporter) -> Result<Grid> {
        match self {
            Self::Fit(resolution) => Ok(Grid::fit(&bounds, *resolution)?),
            Self::Like(path) => {
                let loaded = read_grid(path)?;
                loaded.warnings.iter().for_each(|warning| reporter.warn(format!("{}: {warning}", path.display())));
                Ok(loaded.grid)
            }
            Self::Explicit { voxel_size, dims, origin } => {
                let bounds = Bounds { min: origin.unwrap_or(bounds.min), max: bounds.max };
                explicit(&bounds, *voxel_size, *dims)
            }
        }
    }
}

/// A grid from the minimum corner of `bounds` on, reaching its maximum corner where that decides something.
fn explicit(bounds: &Bounds, voxel_size: Option<[f64; 3]>, dims: Option<[u32; 3]>) -> Result<Grid> {
    match (voxel_size, dims) {
        (Some(voxel_size), Some(dims)) => Ok(Grid::new(bounds.min, voxel_size, dims)?),
        (Some(voxel_size), None) => {
            ensure!(
                bounds.size().iter().all(|&extent| extent >= 0.0),
                "the mesh lies wholly below --origin, so the grid's size is open: give --dims too"
            );
            Ok(Grid::cover(bounds, voxel_size)?)
        }
        (None, dims) => {
            let dims = dims.unwrap_or([DEFAULT_RESOLUTION; 3]);
            let size = bounds.size();
            let edge = (0..3).map(|axis| size[axis] / f64::from(dims[axis])).fold(0.0, f64::max);
            ensure!(edge > 0.0, "the mesh does not reach above the grid's origin: give --voxel-size too");
            Ok(Grid::new(bounds.min, [edge; 3], dims)?)
        }
    }
}

fn positive(text: &str) -> f64 {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => value,
        _ => usage(&format!("--voxel-size: `{text}` is not a positive number")),
    }
}

/// Ends the program with clap's kind of message, for the subcommand that runs, and exit status 2.
pub(crate) fn usage(message: &str) -> ! {
    let mut command = Cli::command();
    command.build();
    let running = std::env::args().nth(1).unwrap_or_default();
    match command.find_subcommand_mut(&running) {
        Some(subcommand) => subcommand.error(ErrorKind::ValueValidation, message).exit(),
        None => command.error(ErrorKind::ValueValidation, message).exit(),
    }
}
