//! `trixel bench`: the papers' tables and figures on this machine.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, anyhow, bail};
use trixel::{Mode, Strategy};
use trixel_bench::fills::Fills;
use trixel_bench::measure::Plan;
use trixel_bench::results::SCHEMA;
use trixel_bench::{Results, compare, html, lists, text};
use trixel_gpu::{AdapterChoice, Gpu, GpuError, STRATEGIES, strategies_of};
use trixel_io::atomic_file::{AtomicFile, Staged};

use crate::args::{BackendArg, BenchArgs, FigureArg, TableArg};
use crate::grid::usage;
use crate::progress::Reporter;
use crate::voxelize::set_threads;
use crate::{bench_effects, mesh, volume};

/// Cutoffs of figure 3.14, in square voxels: its steps show at low ones.
const LOW_CUTOFFS: [f32; 14] = [0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 12.0, 16.0];
/// Those that figure 3.13 goes on with.
const HIGH_CUTOFFS: [f32; 7] = [32.0, 64.0, 128.0, 256.0, 512.0, 1024.0, 2048.0];

pub(crate) fn run(args: &BenchArgs) -> Result<ExitCode> {
    match args.table {
        Some(TableArg::Fills) => return fills(args),
        Some(TableArg::Effects) => return bench_effects::run(args),
        Some(TableArg::Hcv | TableArg::Cl) | None => {}
    }
    let mode = mode(args);
    let strategies = strategies(args, mode);
    set_threads(args.threads)?;
    // Found out before the work: what cannot be read or written.
    let before = args.compare.as_deref().map(read_results).transpose()?;
    let inputs = inputs(args)?;
    for path in args.json.iter().chain(&args.html) {
        AtomicFile::create(path).map(drop).map_err(|error| volume::cannot_write(path, &error))?;
    }
    let reporter = Reporter::new(false);
    let gpu = open(args, &reporter)?;
    if args.lists && gpu.is_none() {
        usage("--lists compares what GPUs do, and there is none here; a software one will do");
    }
    let plan = Plan {
        resolutions: args.resolutions.clone(),
        mode,
        strategies,
        cpu: !matches!(args.backend, BackendArg::Gpu),
        runs: args.repeat.get() as usize,
        cutoff: args.cutoff,
        count: args.counters,
        sweep: sweep(&args.figures),
        lists: args.lists,
    };

    let mut results = Results::new(gpu.as_ref(), plan.mode);
    for (name, input) in &inputs {
        let (loaded, _) = reporter.stage(&format!("reading {input}"), || mesh::load(input, false, &reporter));
        let loaded = loaded?;
        let (measured, _) =
            reporter.stage(name, || results.measure(name, &loaded, gpu.as_ref(), &plan, &|what| reporter.now(what)));
        measured.map_err(|error| anyhow!("{input}: {error}"))?;
    }
    let mut staged = Staged::default();
    for (path, contents) in [(&args.json, serde_json::to_string_pretty(&results)?), (&args.html, html::page(&results))]
    {
        if let Some(path) = path {
            staged = staged.join(stage(path, &contents)?);
        }
    }
    staged.commit()?;
    reporter.finish();

    let mut parts = vec![text::table(&results)];
    parts.extend(lists::text(&results));
    parts.extend(text::counters(&results));
    parts.extend(text::sweeps(&results));
    parts.extend(args.table.map(|table| match table {
        TableArg::Cl => text::published_cl(),
        TableArg::Hcv | TableArg::Fills | TableArg::Effects => text::published(),
    }));
    parts.extend(before.map(|before| compare::text(&results, &before)));
    match write!(std::io::stdout().lock(), "{}", parts.join("\n")) {
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => {}
        written => written.context("cannot write to standard output")?,
    }
    for path in args.json.iter().chain(&args.html) {
        reporter.say(&format!("wrote {}", path.display()));
    }
    match results.wrong_voxels() {
        0 => Ok(ExitCode::SUCCESS),
        wrong => bail!("{wrong} voxels differ from the processor's; times of wrong voxels mean nothing"),
    }
}

/// `--table fills`: no times, and all of it on the processor.
fn fills(args: &BenchArgs) -> Result<ExitCode> {
    if args.json.is_some() || args.html.is_some() || args.compare.is_some() {
        usage("--table fills is printed, and has no times to write or compare; leave --json, --html and --compare out");
    }
    set_threads(args.threads)?;
    let reporter = Reporter::new(false);
    let mut table = Fills::default();
    for (name, input) in &inputs(args)? {
        let (loaded, _) = reporter.stage(&format!("reading {input}"), || mesh::load(input, false, &reporter));
        let loaded = loaded?;
        for &resolution in &args.resolutions {
            let (counted, _) =
                reporter.stage(&format!("{name} at {resolution}"), || table.count(name, &loaded, resolution));
            counted.map_err(|error| anyhow!("{input}: {error}"))?;
        }
    }
    reporter.finish();
    match write!(std::io::stdout().lock(), "{}", table.text()) {
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => {}
        written => written.context("cannot write to standard output")?,
    }
    Ok(ExitCode::SUCCESS)
}

/// The mode asked for, or that of the paper's table.
fn mode(args: &BenchArgs) -> Mode {
    let default = match args.table {
        Some(TableArg::Hcv) => Mode::Thin,
        Some(TableArg::Cl) => Mode::Sliced,
        Some(TableArg::Fills | TableArg::Effects) | None => Mode::Conservative,
    };
    args.mode.map_or(default, Mode::from)
}

/// The strategies of the GPU that were asked for, or all.
fn strategies(args: &BenchArgs, mode: Mode) -> Vec<Strategy> {
    let asked: Vec<Strategy> = args.strategy.iter().map(|&strategy| strategy.into()).collect();
    if let Some(other) = asked.iter().find(|strategy| !STRATEGIES.contains(strategy)) {
        usage(&format!(
            "--strategy chooses among the GPU's, and `{other}` is none; --backend cpu measures the processor"
        ));
    }
    if let Some(other) = asked.iter().find(|strategy| !strategy.modes().contains(&mode)) {
        usage(&format!("--strategy {other} has no mode {mode}"));
    }
    match args.table {
        _ if !asked.is_empty() => asked,
        Some(TableArg::Cl) if mode == Mode::Sliced => vec![Strategy::Sliced, Strategy::SlicePerPass],
        _ => strategies_of(mode).collect(),
    }
}

/// Names and meshes.
pub(crate) fn inputs(args: &BenchArgs) -> Result<Vec<(String, String)>> {
    let mut inputs: Vec<_> = args.inputs.iter().map(|input| (mesh::stem(input), input.clone())).collect();
    if let Some(folder) = &args.models {
        inputs.extend(manifest(folder)?);
    }
    if inputs.is_empty() {
        inputs = trixel_bench::SCENES.iter().map(|scene| (mesh::stem(scene), (*scene).to_owned())).collect();
    }
    let mut names: Vec<_> = inputs.iter().map(|(name, _)| name).collect();
    names.sort_unstable();
    if let Some(twice) = names.windows(2).find(|pair| pair[0] == pair[1]) {
        usage(&format!("two inputs are called {}; rename one, or name them in models.json", twice[0]));
    }
    Ok(inputs)
}

fn manifest(folder: &Path) -> Result<Vec<(String, String)>> {
    let path = folder.join("models.json");
    let text = std::fs::read_to_string(&path).map_err(|error| {
        anyhow!(
            "{}: {error}; --models takes a folder with models.json, such as {{\"Stanford Bunny\": \"bunny.ply\"}}",
            path.display()
        )
    })?;
    let models: BTreeMap<String, PathBuf> = serde_json::from_str(&text)
        .map_err(|error| anyhow!("{}: not an object of names and files: {error}", path.display()))?;
    Ok(models.into_iter().map(|(name, file)| (name, folder.join(file).display().to_string())).collect())
}

fn open(args: &BenchArgs, reporter: &Reporter) -> Result<Option<Gpu>> {
    if matches!(args.backend, BackendArg::Cpu) {
        if args.adapter.is_some() {
            usage("--adapter names a GPU, but --backend cpu asks for the processor; leave one of them out");
        }
        return Ok(None);
    }
    let choice = args.adapter.clone().map_or(AdapterChoice::Any, AdapterChoice::Named);
    match Gpu::open(&choice) {
        Ok(gpu) => Ok(Some(gpu)),
        Err(error @ GpuError::NoAdapter) if matches!(args.backend, BackendArg::Auto) && args.adapter.is_none() => {
            reporter.warn(format!("{error}; only the processor is measured"));
            Ok(None)
        }
        Err(error) => Err(error.into()),
    }
}

fn sweep(figures: &[FigureArg]) -> Vec<f32> {
    let high = figures.contains(&FigureArg::Cutoffs);
    let low = high || figures.contains(&FigureArg::LowCutoffs);
    let mut cutoffs = if low { LOW_CUTOFFS.to_vec() } else { vec![] };
    cutoffs.extend(HIGH_CUTOFFS.iter().filter(|_| high));
    cutoffs
}

fn read_results(path: &Path) -> Result<Results> {
    let text = std::fs::read_to_string(path).map_err(|error| anyhow!("{}: {error}", path.display()))?;
    let results: Results = serde_json::from_str(&text)
        .map_err(|error| anyhow!("{}: not what `trixel bench --json` writes: {error}", path.display()))?;
    if results.schema != SCHEMA {
        bail!(
            "{}: it is of version {} and this is {SCHEMA}; measure again with the trixel to compare",
            path.display(),
            results.schema
        );
    }
    Ok(results)
}

fn stage(path: &Path, contents: &str) -> Result<Staged> {
    let mut file = AtomicFile::create(path).map_err(|error| volume::cannot_write(path, &error))?;
    file.write_all(contents.as_bytes()).map_err(|error| volume::cannot_write(path, &error))?;
    file.stage().map_err(|error| volume::cannot_write(path, &error))
}
