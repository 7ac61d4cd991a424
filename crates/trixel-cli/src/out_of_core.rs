//! `trixel voxelize -o NAME.zarr`: tile by tile within a memory limit, resumable.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Instant, UNIX_EPOCH};

use anyhow::{Context, Result, anyhow};
use serde_json::json;
use trixel::fill::Fill;
use trixel::{Bytes, CpuBackend, Job, Mesh, Mode, Topology};
use trixel_io::atomic_file::AtomicFile;
use trixel_io::out_of_core::{OutOfCore, Plan, Source, check_target, partial_path};
use trixel_io::read::MeshStream;

use crate::args::VoxelizeArgs;
use crate::engine::Engine;
use crate::grid::{GridRequest, usage};
use crate::progress::Reporter;
use crate::report::GridReport;
use crate::voxelize::{job, warn_if_open};
use crate::{memory, mesh, volume};

/// Whether an output is a Zarr folder.
pub(crate) fn is_zarr(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("zarr"))
}

/// The output, if the arguments ask for this way to work.
pub(crate) fn target(args: &VoxelizeArgs) -> Option<PathBuf> {
    let limited = args.memory_limit.is_some() || args.resume;
    match args.outputs.as_slice() {
        [only] if is_zarr(only) => {
            if args.repeat.get() > 1 {
                usage("--repeat measures voxelizing alone, and a .zarr output is written while it is voxelized");
            }
            if Engine::wants_gpu(&args.method) {
                usage(
                    "a .zarr output is written tile by tile by the processor; leave --backend, --adapter and --strategy out",
                );
            }
            if Fill::from(args.method.fill) != Fill::Parity {
                usage("a .zarr output is written tile by tile, and --fill looks at whole columns; leave it out");
            }
            if !args.attributes.attributes.is_empty() {
                usage("a .zarr output has no attributes; write .npz or .vti for them");
            }
            Some(only.clone())
        }
        outputs if outputs.iter().any(|path| is_zarr(path)) => {
            usage("a .zarr output is written tile by tile, so it must be the only one")
        }
        _ if limited => usage("--memory-limit and --resume need a single output -o NAME.zarr"),
        _ => None,
    }
}

/// The triangles, in memory or not.
enum Input {
    Mesh(Mesh),
    Stream(MeshStream),
}

impl Input {
    /// Reads the meshes; a single one that would take more than half the limit in passes, if it can be.
    fn open(inputs: &[String], limit: u64, reporter: &Reporter) -> Result<Self> {
        /// Bytes in memory of a byte of a binary file: the file, the mesh and its lattice.
        const GROWTH: u64 = 4;
        let large =
            |input: &str| std::fs::metadata(input).is_ok_and(|file| file.len().saturating_mul(GROWTH) > limit / 2);
        if let [input] = inputs
            && large(input)
            && let Some(stream) = MeshStream::open(Path::new(input))?
        {
            return Ok(Self::Stream(stream));
        }
        Ok(Self::Mesh(mesh::load_all(inputs, false, reporter)?))
    }

    fn source(&self) -> Source<'_> {
        match self {
            Self::Mesh(mesh) => Source::Mesh(mesh),
            Self::Stream(stream) => Source::Stream(stream),
        }
    }

    /// Bytes that are held all the time, lattice and stream aside.
    fn bytes(&self) -> u64 {
        match self {
            Self::Mesh(mesh) => (size_of_val(&*mesh.positions) + size_of_val(&*mesh.triangles)) as u64,
            Self::Stream(_) => 0,
        }
    }
}

/// Names the inputs and their state, so that nothing is resumed with others.
fn identity(inputs: &[String]) -> String {
    inputs.iter().map(|input| identity_of(input)).collect::<Vec<_>>().join("; ")
}

fn identity_of(input: &str) -> String {
    let state = std::fs::metadata(input).ok().map(|file| {
        let modified = file.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
        format!("{} bytes, modified {:?}", file.len(), modified.unwrap_or_default())
    });
    let path = Path::new(input).canonicalize().map_or_else(|_| input.to_owned(), |path| path.display().to_string());
    format!("{path}, {}", state.unwrap_or_default())
}

pub(crate) fn run(args: &VoxelizeArgs, target: &Path, request: &GridRequest, start: Instant) -> Result<ExitCode> {
    let reporter = Reporter::new(args.quiet);
    check_target(target)?;
    let limit = args.memory_limit.or_else(memory::available_for_voxels).unwrap_or(u64::MAX);
    let reading = format!("reading {}", args.inputs.join(", "));
    let (opened, read_ms) = reporter.stage(&reading, || Input::open(&args.inputs, limit, &reporter));
    let opened = opened?;
    let source = opened.source();
    let (bounds, bounds_ms) = reporter.stage("measuring the mesh", || source.bounds());
    let bounds = bounds?.context("the mesh has no triangles")?;
    let job: Job = job(&args.method, request.resolve_in(bounds, &reporter)?)?;
    if job.mode() == Mode::Solid {
        match &opened {
            Input::Mesh(mesh) => warn_if_open(Some(&Topology::of(mesh)), &reporter),
            Input::Stream(_) => {
                reporter.warn("the mesh does not fit the memory, so nobody looks whether it is closed".into());
            }
        }
    }
    let backend = CpuBackend::default();
    let (plan, plan_ms) =
        reporter.stage("planning", || Plan::new(source, &job, backend.threads(), opened.bytes(), limit));
    let plan = plan?;
    reporter.say(&format!("{plan} (limit {})", Bytes(limit)));

    let work = OutOfCore { source, job: &job, plan: &plan, backend: &backend, input: &identity(&args.inputs) };
    let fraction = reporter.fractions();
    let (written, ms) = reporter.stage("voxelizing and writing", || work.write(target, args.resume, &fraction));
    let written = written.map_err(|error| match partial_path(target).is_dir() {
        true if !args.resume => {
            anyhow!("{error} (what is done stays in {}: see --resume)", partial_path(target).display())
        }
        _ => error.into(),
    })?;
    let total = start.elapsed().as_secs_f64() * 1e3;
    if let Some(path) = &args.report {
        let report = json!({
            "command": std::env::args().collect::<Vec<_>>(),
            "version": env!("CARGO_PKG_VERSION"),
            "mesh": { "triangles": source.triangle_count(), "bounds": [bounds.min, bounds.max] },
            "grid": GridReport::from(job.grid()),
            "mode": job.mode().name(),
            "overlap": args.method.overlap,
            "backend": "cpu",
            "threads": backend.threads(),
            "adapter": null,
            "voxels": written.voxels,
            "plan": plan.to_string(),
            "resumed_tiles": written.resumed,
            "stages_ms": { "read": read_ms + bounds_ms, "plan": plan_ms, "voxelize": ms, "total": total },
            "peak_memory_bytes": memory::peak(),
            "outputs": [target.display().to_string()],
            "warnings": reporter.warnings(),
        });
        let failed = |error: &dyn std::fmt::Display| volume::cannot_write(path, error);
        let mut file = AtomicFile::create(path).map_err(|error| failed(&error))?;
        serde_json::to_writer_pretty(&mut file, &report).map_err(|error| failed(&error))?;
        file.stage().map_err(|error| failed(&error))?.commit()?;
    }
    reporter.finish();
    let [nx, ny, nz] = job.grid().dims();
    reporter.say(&format!(
        "{} of {nx} x {ny} x {nz} voxels set ({}, {} triangles); {total:.0} ms in all",
        written.voxels,
        job.mode(),
        source.triangle_count(),
    ));
    for output in std::iter::once(target).chain(args.report.as_deref()) {
        reporter.say(&format!("wrote {}", output.display()));
    }
    Ok(ExitCode::SUCCESS)
}

/// Reads `--memory-limit`: a number of bytes with a unit.
pub(crate) fn parse_size(text: &str) -> Result<u64, String> {
    const UNITS: [(&str, u64); 9] = [
        ("kib", 1 << 10),
        ("mib", 1 << 20),
        ("gib", 1 << 30),
        ("tib", 1 << 40),
        ("kb", 1000),
        ("mb", 1_000_000),
        ("gb", 1_000_000_000),
        ("tb", 1_000_000_000_000),
        ("b", 1),
    ];
    let lower = text.trim().to_ascii_lowercase();
    let unit = UNITS.iter().find_map(|&(name, bytes)| lower.strip_suffix(name).map(|number| (number, bytes)));
    let (number, bytes) = unit.unwrap_or((&lower, 1));
    let value: f64 =
        number.trim().parse().map_err(|_| "give a number with a unit, such as 2GiB or 500MB".to_owned())?;
    #[expect(clippy::cast_precision_loss, reason = "a limit need not be exact to the byte")]
    let size = value * bytes as f64;
    if !(1.0..9e18).contains(&size) {
        return Err("give a size above 0, such as 2GiB".to_owned());
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked just above")]
    Ok(size as u64)
}

#[cfg(test)]
mod tests {
    use super::parse_size;

    #[test]
    fn sizes() {
        assert_eq!(parse_size("2GiB"), Ok(2 << 30));
        assert_eq!(parse_size("500 MB"), Ok(500_000_000));
        assert_eq!(parse_size("1.5kib"), Ok(1536));
        assert_eq!(parse_size("4096"), Ok(4096));
        for wrong in ["", "GiB", "2 potatoes", "-1GB", "0", "nan"] {
            assert!(parse_size(wrong).is_err(), "{wrong}");
        }
    }
}
