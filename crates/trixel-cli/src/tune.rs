//! `trixel tune`: the best cutoff of this machine's GPU.

use std::io::Write;
use std::process::ExitCode;

use anyhow::Result;
use trixel::lattice::LatticeMesh;
use trixel::{Job, Strategy};
use trixel_gpu::{AdapterChoice, Gpu, GpuMesh, Options};

use crate::args::TuneArgs;
use crate::grid::{GridRequest, usage};
use crate::mesh;
use crate::progress::Reporter;
use crate::tuned;
use crate::voxelize::ContextOf;

/// Characters of the longest bar.
const BAR: f64 = 40.0;

pub(crate) fn run(args: TuneArgs) -> Result<ExitCode> {
    let mut inputs = Vec::from_iter(args.input);
    let request = GridRequest::from_args(&args.grid, &mut inputs);
    let Ok([input]) = <[String; 1]>::try_from(inputs) else { usage("INPUT is missing: one mesh file, or scene:NAME") };
    let reporter = Reporter::new(false);
    let choice = args.adapter.map_or(AdapterChoice::Any, AdapterChoice::Named);
    let (gpu, _) = reporter.stage("opening the GPU", || Gpu::open(&choice));
    let gpu = gpu?;
    let (loaded, _) = reporter.stage(&format!("reading {input}"), || mesh::load(&input, false, &reporter));
    let loaded = loaded?;
    let job = Job::new(request.resolve(&loaded, &reporter)?, args.mode.into());
    let lattice = LatticeMesh::snap(&loaded, job.grid()).with_context_of(&input)?;
    let on_gpu = GpuMesh::upload(&gpu, &lattice)?;
    let options = Options { dilation: args.dilation.into(), ..Options::default() };
    let runs = args.repeat.get() as usize;

    let (tuning, _) = reporter.stage("searching the cutoff", || {
        trixel_gpu::tune(&gpu, &on_gpu, &job, &options, args.heuristic.into(), runs, |_| {})
    });
    let tuning = tuning?;
    let pure = [Strategy::TriangleParallel, Strategy::FragmentParallel].map(|strategy| -> Result<_> {
        Ok((strategy.name(), trixel_gpu::measure(&gpu, &on_gpu, &job.with_strategy(strategy), &options, runs)?))
    });
    reporter.finish();

    let mut out = std::io::stdout().lock();
    let [nx, ny, nz] = job.grid().dims();
    // A reader that went away is no reason not to store the result.
    let _ = writeln!(out, "{}\n{input}, {nx} x {ny} x {nz}, {}, median of {runs}", gpu.info(), job.mode());
    let slowest = tuning.curve.iter().map(|sample| sample.ms).fold(f64::MIN_POSITIVE, f64::max);
    let _ = writeln!(out, "{:>14} {:>11}", tuning.best.heuristic.name(), "hybrid, ms");
    for sample in &tuning.curve {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 40")]
        let bar = "#".repeat((sample.ms / slowest * BAR).round() as usize);
        let mark = if sample.cutoff == tuning.best.value { " best" } else { "" };
        let _ = writeln!(out, "{:>14.3} {:>11.3} {bar}{mark}", sample.cutoff, sample.ms);
    }
    for measured in pure {
        let (name, ms) = measured?;
        let _ = writeln!(out, "{name:>26} {ms:.3} ms");
    }
    if !args.dry_run {
        let path = tuned::store(gpu.info(), tuning.best)?;
        let _ = writeln!(out, "stored cutoff {} in {}", tuning.best.value, path.display());
    }
    Ok(ExitCode::SUCCESS)
}
