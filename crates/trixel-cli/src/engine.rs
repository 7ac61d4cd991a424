//! Who computes: the CPU, or a GPU with its own steps.

use std::time::Instant;

use anyhow::Result;
use trixel::attributes::{AttributeRequest, VoxelAttributes};
use trixel::fill::{Fill, FillReport};
use trixel::lattice::LatticeMesh;
use trixel::{Backend, Bytes, CpuBackend, Job, Mesh, Mode, Strategy, Volume, VoxelOrder};
use trixel_gpu::{
    AdapterChoice, Counters, Cutoff, Gpu, GpuError, GpuMesh, GpuSurface, GpuVolume, Heuristic, ListMethod, Options,
    STRATEGIES, Voxelizer,
};

use crate::args::{BackendArg, MethodArgs, VoxelizeArgs};
use crate::grid::usage;
use crate::progress::Reporter;
use crate::report::{AdapterReport, CutoffReport, ListReport};
use crate::tuned;

/// An open backend.
pub(crate) enum Engine {
    Cpu,
    Gpu {
        gpu: Box<Gpu>,
        options: Options,
        /// Whether the CPU takes over, with a warning, when the GPU fails.
        cpu_may_help: bool,
    },
}

/// What to do with a mesh.
pub(crate) struct Task<'a> {
    pub(crate) mesh: &'a Mesh,
    pub(crate) lattice: &'a LatticeMesh<'a>,
    pub(crate) job: &'a Job,
    /// How a solid's inside is found.
    pub(crate) fill: Fill,
    pub(crate) repeat: u32,
    pub(crate) attributes: Option<&'a AttributeRequest>,
    /// How a GPU is to list the voxels.
    pub(crate) list_method: Option<ListMethod>,
}

impl Task<'_> {
    /// The job of the voxels that are filled; none where a solid's own job finds the inside.
    fn boundary(&self) -> Option<Job> {
        (self.fill != Fill::Parity).then(|| Job::new(*self.job.grid(), Mode::Sliced).with_strategy(self.job.strategy()))
    }
}

/// What a run did.
pub(crate) struct Ran {
    pub(crate) backend: &'static str,
    pub(crate) strategy: Strategy,
    pub(crate) adapter: Option<AdapterReport>,
    pub(crate) counters: Option<Counters>,
    pub(crate) cutoff: Option<CutoffReport>,
    pub(crate) passes_ms: Vec<(&'static str, f64)>,
    pub(crate) check_ms: Option<f64>,
    pub(crate) upload_ms: Option<f64>,
    pub(crate) samples_ms: Vec<f64>,
    pub(crate) download_ms: Option<f64>,
    /// What became of the columns that were filled.
    pub(crate) fill: Option<FillReport>,
    pub(crate) list: Option<ListReport>,
    /// Attributes, where the device found them, and how long it took.
    pub(crate) attributes: Option<(VoxelAttributes, f64)>,
}

impl Engine {
    /// The mode that is voxelized before anything is filled.
    fn voxelized_mode(method: &MethodArgs) -> Mode {
        match method.fill.into() {
            Fill::Parity => method.mode.into(),
            Fill::Xor | Fill::March => Mode::Sliced,
        }
    }

    /// Whether the arguments ask for a GPU by name.
    fn is_gpu_named(method: &MethodArgs) -> bool {
        matches!(method.backend, BackendArg::Gpu) || method.gpu.adapter.is_some()
    }

    /// Whether the arguments can only mean a GPU.
    pub(crate) fn wants_gpu(method: &MethodArgs) -> bool {
        Self::is_gpu_named(method) || STRATEGIES.contains(&method.strategy.into())
    }

    /// Refuses arguments that contradict each other, before anything is read.
    pub(crate) fn check(method: &MethodArgs) {
        let strategy = Strategy::from(method.strategy);
        let of_gpu = STRATEGIES.contains(&strategy);
        let mode = Self::voxelized_mode(method);
        if !strategy.modes().contains(&mode) {
            let modes: Vec<&str> = strategy.modes().iter().map(|mode| mode.name()).collect();
            usage(&format!("--strategy {strategy} is for --mode {}, not for {mode}", modes.join(" or ")));
        }
        if matches!(method.backend, BackendArg::Cpu) {
            if method.gpu.adapter.is_some() {
                usage("--adapter names a GPU, but --backend cpu asks for the processor; leave one of them out");
            }
            if of_gpu {
                usage(&format!("--strategy {strategy} is one of the GPU's; use --backend gpu"));
            }
        }
        if Self::is_gpu_named(method) && strategy == Strategy::ColumnRuns {
            usage("--strategy column-runs is the processor's; leave it out, or use --backend cpu");
        }
    }

    /// Refuses a list method where no GPU is asked for.
    pub(crate) fn check_list_method(args: &VoxelizeArgs) {
        if args.list_method.is_some() && !Self::is_gpu_named(&args.method) {
            usage("--list-method is about lists on a GPU; add --backend gpu, or leave it out");
        }
    }

    /// Opens what the arguments ask for.
    pub(crate) fn open(method: &MethodArgs, reporter: &Reporter) -> Result<Self> {
        let strategy = Strategy::from(method.strategy);
        let asked = Self::is_gpu_named(method);
        let of_gpu = STRATEGIES.contains(&strategy);
        let cpu = matches!(method.backend, BackendArg::Cpu) || strategy == Strategy::ColumnRuns;
        if cpu || !asked && !of_gpu && !trixel_gpu::hardware_is_possible() {
            return Ok(Self::Cpu);
        }
        let choice = match &method.gpu.adapter {
            Some(name) => AdapterChoice::Named(name.clone()),
            None if asked => AdapterChoice::Any,
            None => AdapterChoice::Hardware,
        };
        let gpu = match Gpu::open(&choice) {
            Ok(gpu) => gpu,
            Err(GpuError::NoAdapter | GpuError::OnlySoftware(_)) if !asked && !of_gpu => return Ok(Self::Cpu),
            Err(error @ GpuError::OnlySoftware(_)) if !asked => {
                anyhow::bail!("--strategy {strategy} needs a GPU: {error} (--backend gpu takes it)")
            }
            Err(error) if !asked && !of_gpu => {
                reporter.warn(format!("{error}; the processor computes instead"));
                return Ok(Self::Cpu);
            }
            Err(error) => return Err(error.into()),
        };
        let heuristic: Heuristic = method.gpu.heuristic.into();
        let cutoff = method.gpu.cutoff.map(|value| Cutoff { heuristic, value });
        let cutoff = cutoff.or_else(|| tuned::load(gpu.info(), heuristic, reporter));
        let default = heuristic == Heuristic::default();
        let options = Options {
            cutoff: cutoff.or_else(|| (!default).then(|| Cutoff::default_for(gpu.info(), heuristic))),
            dilation: method.gpu.dilation.into(),
            count: method.gpu.counters,
        };
        Ok(Self::Gpu { gpu: Box::new(gpu), options, cpu_may_help: !asked && !of_gpu })
    }

    /// Whether the CPU may do the work: no GPU was asked for, though `auto` may have found one.
    pub(crate) fn cpu_may_compute(&self) -> bool {
        matches!(self, Self::Cpu | Self::Gpu { cpu_may_help: true, .. })
    }

    /// Voxelizes as often as the task says.
    pub(crate) fn run(&self, task: &Task<'_>, volume: &mut Volume, reporter: &Reporter) -> Result<Ran> {
        match self {
            Self::Cpu => run_on_cpu(task, volume, reporter),
            Self::Gpu { gpu, options, cpu_may_help } => match run_on_gpu(gpu, options, task, volume, reporter) {
                Err(error) if *cpu_may_help => {
                    reporter.warn(format!("{error}; the processor computes instead"));
                    run_on_cpu(task, volume, reporter)
                }
                ran => Ok(ran?),
            },
        }
    }
}

fn run_on_cpu(task: &Task<'_>, volume: &mut Volume, reporter: &Reporter) -> Result<Ran> {
    let mut report = None;
    let ran = on_cpu(task.repeat, reporter, || {
        let Some(boundary) = task.boundary() else {
            return CpuBackend::default().voxelize(task.lattice, task.job, volume);
        };
        let strategy = CpuBackend::default().voxelize(task.lattice, &boundary, volume)?;
        let (filled, filling) = trixel::fill::fill(volume, task.fill)?;
        *volume = filled;
        report = Some(filling);
        Ok(strategy)
    })?;
    Ok(Ran { fill: report, ..ran })
}

/// Runs a voxelization on the CPU `repeat` times.
pub(crate) fn on_cpu(
    repeat: u32,
    reporter: &Reporter,
    mut voxelize: impl FnMut() -> Result<Strategy, trixel::Error>,
) -> Result<Ran> {
    let mut samples_ms = vec![];
    let mut strategy = Strategy::Auto;
    for _ in 0..repeat {
        let (used, ms) = reporter.stage("voxelizing", &mut voxelize);
        strategy = used?;
        samples_ms.push(ms);
    }
    Ok(Ran {
        backend: CpuBackend::default().name(),
        strategy,
        adapter: None,
        counters: None,
        cutoff: None,
        passes_ms: vec![],
        check_ms: None,
        upload_ms: None,
        samples_ms,
        download_ms: None,
        fill: None,
        list: None,
        attributes: None,
    })
}

fn run_on_gpu(
    gpu: &Gpu,
    options: &Options,
    task: &Task<'_>,
    volume: &mut Volume,
    reporter: &Reporter,
) -> Result<Ran, GpuError> {
    let boundary = task.boundary();
    let (mesh, job) = (task.lattice, boundary.as_ref().unwrap_or(task.job));
    let (voxelizer, check_ms) =
        reporter.stage("checking the GPU and building its pipelines", || Voxelizer::new(gpu, job, options));
    let mut voxelizer = voxelizer?;
    let (on_gpu, upload_ms) = reporter.stage("uploading", || GpuMesh::upload(gpu, mesh));
    let on_gpu = on_gpu?;
    let mut voxels = GpuVolume::new(gpu, *job.grid())?;
    let mut report = None;
    let mut samples_ms = vec![];
    for _ in 0..task.repeat {
        let (ran, ms) = reporter.stage("voxelizing", || -> Result<(), GpuError> {
            voxelizer.run(&on_gpu, &voxels)?;
            if boundary.is_some() {
                let (filled, filling) = voxels.filled(gpu, task.fill)?;
                voxels = filled;
                report = Some(filling);
            }
            Ok(())
        });
        ran?;
        samples_ms.push(ms);
    }
    let counters = if options.count { Some(voxelizer.check()?) } else { None };
    let passes_ms = voxelizer.pass_times()?.iter().map(|pass| (pass.name, pass.ms)).collect();
    let start = Instant::now();
    voxels.download(gpu, volume)?;
    let download_ms = start.elapsed().as_secs_f64() * 1e3;
    let list =
        task.list_method.map(|method| list(&mut voxelizer, &on_gpu, method, task.repeat, reporter)).transpose()?;
    // Of filled voxels the processor finds them: the voxelizer's own are the slices.
    let request = task.attributes.filter(|_| boundary.is_none());
    let attributes = request.and_then(|request| {
        let (found, ms) = reporter.stage("finding attributes", || {
            let surface = GpuSurface::upload(gpu, task.mesh, mesh, job.grid(), request)?;
            let found = voxelizer.attributes(&surface, &voxels)?;
            let [rows, scratch, uploaded] = [found.bytes(), found.scratch_bytes(), surface.bytes()].map(Bytes);
            reporter.say(&format!("attributes: {rows}, {scratch} to find them, {uploaded} of surfaces and textures"));
            found.download(gpu, task.mesh)
        });
        match found {
            Ok(attributes) => Some((attributes, ms)),
            Err(error) => {
                reporter.warn(format!("{error}; the processor finds the attributes instead"));
                None
            }
        }
    });
    let strategy = voxelizer.strategy();
    let hybrid = matches!(strategy, Strategy::Hybrid | Strategy::HybridTwoPass);
    Ok(Ran {
        backend: "gpu",
        strategy,
        adapter: Some(AdapterReport::from(gpu.info())),
        counters,
        cutoff: hybrid.then(|| voxelizer.cutoff().into()),
        passes_ms,
        check_ms: Some(check_ms),
        upload_ms: Some(upload_ms),
        samples_ms,
        download_ms: Some(download_ms),
        list,
        attributes,
        fill: report,
    })
}

/// Lists the voxels by a method, as often as voxelizing is repeated.
fn list(
    voxelizer: &mut Voxelizer,
    mesh: &GpuMesh,
    method: ListMethod,
    repeat: u32,
    reporter: &Reporter,
) -> Result<ListReport, GpuError> {
    let mut report = ListReport::new(method);
    for _ in 0..repeat {
        let (list, ms) = reporter.stage("listing", || voxelizer.list(mesh, method, VoxelOrder::Xyz));
        report.add(&list?, ms);
    }
    reporter.say(&report.to_string());
    Ok(report)
}
