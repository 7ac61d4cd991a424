//! `trixel voxelize`: read, snap, voxelize, write.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Result, bail};
use trixel::attributes::{Described, compute};
use trixel::fill::{Fill, FillReport};
use trixel::lattice::LatticeMesh;
use trixel::{Bytes, Job, Mode, Rank, Topology, Volume};
use trixel_io::VolumeFormat;
use trixel_io::atomic_file::{AtomicFile, Staged};
use trixel_io::textures::decode_textures;
use trixel_io::write::WriteOptions;

use crate::args::{MethodArgs, VoxelizeArgs};
use crate::engine::{Engine, Task};
use crate::grid::{GridRequest, usage};
use crate::progress::Reporter;
use crate::report::{AttributesReport, FillRecord, GridReport, MeshReport, Report, Samples, Stages, median};
use crate::voxels::Voxels;
use crate::{attributes, memory, mesh, out_of_core, volume};

pub(crate) fn run(mut args: VoxelizeArgs) -> Result<ExitCode> {
    let start = Instant::now();
    let request = GridRequest::from_args(&args.grid, &mut args.inputs);
    let Some(first) = args.inputs.first() else { usage("INPUT is missing: a mesh file, or scene:NAME") };
    // For messages.
    let input = args.inputs.join(", ");
    if args.outputs.is_empty() && args.report.is_none() {
        usage("nothing to write: give -o OUT (for example -o voxels.npz) or --report FILE.json");
    }
    check_method(&args.method);
    if args.list_method.is_some() && Fill::from(args.method.fill) != Fill::Parity {
        usage(
            "--list-method lists voxels while they are voxelized, and --fill finds them later; leave one of them out",
        );
    }
    Engine::check_list_method(&args);
    args.outputs.iter().try_for_each(|output| volume::check_extension(output))?;
    check_paths(&args.inputs, &args.outputs, args.report.as_deref())?;
    if let Some(report) = &args.report {
        // Dropped at once, which removes it: a report that cannot be written is known before the work.
        AtomicFile::create(report).map(drop).map_err(|error| volume::cannot_write(report, &error))?;
    }
    set_threads(args.method.threads)?;
    if let Some(target) = out_of_core::target(&args) {
        return out_of_core::run(&args, &target, &request, start);
    }
    let reporter = Reporter::new(args.quiet);
    let mut stages = Stages::default();

    let wants_attributes = !args.attributes.attributes.is_empty();
    let (loaded, read_ms) =
        reporter.stage(&format!("reading {input}"), || mesh::load_all(&args.inputs, wants_attributes, &reporter));
    let mut loaded = loaded?;
    stages.read = read_ms;
    let up = args.up.axis().unwrap_or_else(|| mesh::up(first, &loaded));

    let job = job(&args.method, request.resolve(&loaded, &reporter)?)?;
    for output in &args.outputs {
        volume::check_output(output, job.grid())?;
    }

    if let Some(warning) = attributes::unheld(&args.attributes, &args.outputs) {
        reporter.warn(warning);
    }
    let wanted = attributes::request(&args.attributes, &loaded)?;
    if wanted.is_some() {
        let (warnings, ms) = reporter.stage("decoding textures", || decode_textures(&mut loaded));
        warnings.into_iter().for_each(|warning| reporter.warn(format!("{input}: {warning}")));
        stages.textures = Some(ms);
    }

    let topology = (job.mode() == Mode::Solid || args.report.is_some()).then(|| {
        let (topology, ms) = reporter.stage("counting edges", || Topology::of(&loaded));
        stages.topology = Some(ms);
        topology
    });
    if job.mode() == Mode::Solid {
        warn_if_open(topology.as_ref(), &reporter);
    }

    let (lattice, snap_ms) = reporter.stage("snapping to the lattice", || LatticeMesh::snap(&loaded, job.grid()));
    let lattice = lattice.with_context_of(&input)?;
    stages.snap = snap_ms;

    let (engine, open_ms) = reporter.stage("choosing a backend", || Engine::open(&args.method, &reporter));
    let engine = engine?;
    let (voxels, allocate_ms) = reporter.stage("allocating", || Voxels::allocate(&args, &engine, &job));
    let mut voxels = voxels?;
    stages.allocate = allocate_ms;

    let fill = Fill::from(args.method.fill);
    let task = Task {
        mesh: &loaded,
        lattice: &lattice,
        job: &job,
        fill,
        repeat: args.repeat.get(),
        attributes: wanted.as_ref(),
        list_method: args.list_method.map(Into::into),
    };
    let mut ran = voxels.fill(&engine, &task, &reporter)?;
    stages.open = ran.check_ms.map(|check_ms| open_ms + check_ms);
    stages.upload = ran.upload_ms;
    stages.download = ran.download_ms;
    let samples = Samples { voxelize: ran.samples_ms };
    stages.voxelize = median(&samples.voxelize);
    // Bricks are only chosen where no attributes were asked for.
    let dense = voxels.dense();
    let rank = dense.filter(|_| wanted.is_some()).map(|dense| {
        let (rank, ms) = reporter.stage("ranking", || Rank::new(dense));
        stages.rank = Some(ms);
        rank
    });
    let described = match (&wanted, dense, ran.attributes.take()) {
        (Some(_), _, Some((found, ms))) => {
            stages.attributes = Some(ms);
            Some(found)
        }
        (Some(wanted), Some(dense), None) => {
            let (described, ms) =
                reporter.stage("finding attributes", || compute(&loaded, &lattice, &job, dense, wanted));
            stages.attributes = Some(ms);
            Some(described?)
        }
        _ => None,
    };
    let described_voxels = rank.as_ref().zip(described.as_ref()).and_then(|(rank, d)| Described::new(rank, d));
    drop(lattice);
    let mesh_report = topology.map(|topology| MeshReport::new(&loaded, &topology));
    let triangles = loaded.triangles.len();
    drop(loaded);

    if let Some(FillReport { questionable, uncorrected }) = ran.fill {
        reporter.say(&format!(
            "filled between slices ({fill}): {questionable} columns were questionable, {uncorrected} of them past correction; \
             `trixel verify --mode solid` lists what differs from the exact solid"
        ));
    }
    let count = voxels.count();
    if count == 0 {
        reporter.warn(empty_hint(job.mode()));
    }
    if let Some(described) = described.as_ref().filter(|described| described.cuts_out()) {
        let cut = described.voxels() as u64 - described.covered();
        reporter.say(&format!("{cut} voxels lie only where an alpha test cuts the surface out; their alpha is 0"));
    }
    let mut staged = Staged::default();
    if !args.outputs.is_empty() {
        let (written, ms) = reporter.stage("writing", || -> Result<()> {
            for output in &args.outputs {
                let options = WriteOptions {
                    up,
                    sparse: args.sparse,
                    described: described_voxels,
                    progress: Some(&|f| reporter.fraction(f)),
                };
                staged = std::mem::take(&mut staged).join(voxels.stage_output(output, &options)?);
            }
            Ok(())
        });
        written?;
        stages.write = Some(ms);
    }
    stages.total = start.elapsed().as_secs_f64() * 1e3;

    let total = stages.total;
    let voxelize_ms = stages.voxelize;
    if let (Some(path), Some(mesh)) = (&args.report, mesh_report) {
        let report = Report {
            command: std::env::args().collect(),
            version: env!("CARGO_PKG_VERSION"),
            mesh,
            grid: GridReport::from(job.grid()),
            mode: job.mode().name(),
            overlap: args.method.overlap,
            fill: FillRecord::new(&job, fill, ran.fill),
            backend: ran.backend,
            strategy: ran.strategy.name(),
            threads: rayon::current_num_threads(),
            adapter: ran.adapter,
            voxels: count,
            attributes: described.as_ref().map(AttributesReport::from),
            stages_ms: stages,
            samples_ms: samples,
            counters: ran.counters,
            cutoff: ran.cutoff,
            list: ran.list,
            passes_ms: ran.passes_ms,
            peak_memory_bytes: memory::peak(),
            outputs: args.outputs.iter().map(|path| path.display().to_string()).collect(),
            warnings: reporter.warnings(),
        };
        staged = staged.join(stage_report(path, &report)?);
    }
    staged.commit()?;

    reporter.finish();
    let [nx, ny, nz] = job.grid().dims();
    reporter.say(&format!(
        "{count} of {nx} x {ny} x {nz} voxels set ({}, {triangles} triangles); voxelized in {voxelize_ms:.1} ms, \
         {total:.0} ms in all",
        job.mode(),
    ));
    for output in args.outputs.iter().chain(&args.report) {
        reporter.say(&format!("wrote {}", output.display()));
    }
    Ok(ExitCode::SUCCESS)
}

/// Names the input in errors about its vertices.
pub(crate) trait ContextOf<T> {
    fn with_context_of(self, input: &str) -> Result<T>;
}

impl<T, E: std::error::Error + Send + Sync + 'static> ContextOf<T> for std::result::Result<T, E> {
    fn with_context_of(self, input: &str) -> Result<T> {
        self.map_err(|error| anyhow::anyhow!("{input}: {error}"))
    }
}

/// Refuses to write two outputs to one file, or over an input.
fn check_paths(inputs: &[String], outputs: &[PathBuf], report: Option<&Path>) -> Result<()> {
    let mut seen = BTreeSet::new();
    for path in outputs.iter().map(PathBuf::as_path).chain(report) {
        // However it is spelled; links are followed only where the folder exists, as it must for writing.
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
        let full = folder.join(path.file_name().unwrap_or_default());
        let sidecar = (VolumeFormat::from_path(path) == Some(VolumeFormat::Raw)).then(|| full.with_extension("json"));
        for file in std::iter::once(full).chain(sidecar) {
            if !seen.insert(file) {
                usage(&format!("{} would be written twice; give each output its own name", path.display()));
            }
        }
        let full = path.canonicalize().ok();
        if full.is_some() && inputs.iter().any(|input| Path::new(input).canonicalize().ok() == full) {
            bail!("{} is an input; choose another output", path.display());
        }
    }
    Ok(())
}

/// Gives rayon the number of threads that was asked for.
pub(crate) fn set_threads(threads: Option<u32>) -> Result<()> {
    if let Some(threads) = threads {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads as usize);
        pool.build_global()
            .map_err(|error| anyhow::anyhow!("cannot start {threads} threads: {error}; ask for fewer"))?;
    }
    Ok(())
}

/// Refuses what makes no sense together, before anything is read.
pub(crate) fn check_method(method: &MethodArgs) {
    if method.overlap != 0.0 && Mode::from(method.mode) != Mode::Sliced {
        usage("--overlap only means something with --mode sliced");
    }
    if Fill::from(method.fill) != Fill::Parity && Mode::from(method.mode) != Mode::Solid {
        usage("--fill only means something with --mode solid");
    }
    Engine::check(method);
}

/// The job that the arguments describe.
pub(crate) fn job(method: &MethodArgs, grid: trixel::Grid) -> Result<Job> {
    let job = Job::new(grid, method.mode.into()).with_strategy(method.strategy.into());
    Ok(job.with_overlap(method.overlap)?)
}

/// An empty volume, if there is memory for it.
pub(crate) fn allocate(job: &Job) -> Result<Volume> {
    Ok(Volume::with_memory_limit(*job.grid(), memory::available_for_voxels())?)
}

/// Tells that a solid of an open mesh is not what its user may think.
pub(crate) fn warn_if_open(topology: Option<&Topology>, reporter: &Reporter) {
    if let Some(topology) = topology.filter(|topology| !topology.is_closed()) {
        reporter.warn(format!(
            "the mesh is not closed: {} open and {} non-manifold edges; inside is still decided by counting crossings \
             towards -z, so columns may leak through holes",
            topology.open_edges, topology.non_manifold_edges
        ));
    }
}

fn empty_hint(mode: Mode) -> String {
    match mode {
        Mode::Solid => "no voxel is set: no voxel's centre is inside the mesh, or the mesh lies outside the grid",
        Mode::Sliced => "no voxel is set: no line through voxel centres along z meets the mesh inside the grid",
        Mode::Thin => {
            "no voxel is set: the mesh lies outside the grid, or is so small that it passes no voxel's centre closely"
        }
        Mode::Conservative => "no voxel is set: the mesh lies outside the grid",
    }
    .to_owned()
}

fn stage_report(path: &Path, report: &Report) -> Result<Staged> {
    let mut file = AtomicFile::create(path).map_err(|error| volume::cannot_write(path, &error))?;
    serde_json::to_writer_pretty(&mut file, report).map_err(|error| volume::cannot_write(path, &error))?;
    file.stage().map_err(|error| volume::cannot_write(path, &error))
}

/// Bytes of a volume, for messages.
pub(crate) fn volume_bytes(grid: &trixel::Grid) -> Bytes {
    Bytes(Volume::required_bytes(grid))
}
