//! The measuring itself: every strategy by turns on one mesh and grid, so that a disturbance meets all of them.

use std::time::Instant;

use trixel::lattice::{LatticeError, LatticeMesh};
use trixel::{Backend, CpuBackend, Grid, GridError, Job, Mesh, Mode, Strategy, Volume};
use trixel_gpu::{Cutoff, Gpu, GpuError, GpuMesh, GpuVolume, Heuristic, Options, Voxelizer};

use crate::cpu_name::cpu_name;
use crate::lists;
use crate::results::{Adapter, Cell, Machine, Results, SCHEMA, Sweep};
use crate::timing::median;

/// What to measure on every mesh.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Voxels along the longest side.
    pub resolutions: Vec<u32>,
    /// Which voxels are set.
    pub mode: Mode,
    /// Strategies of the GPU.
    pub strategies: Vec<Strategy>,
    /// Whether the CPU is measured too; it computes the right answer in any case.
    pub cpu: bool,
    /// Timed runs of each cell.
    pub runs: usize,
    /// The hybrids' cutoff in square voxels of projected area; searched for each cell where not given.
    pub cutoff: Option<f32>,
    /// Whether to let the shaders count, in a run of its own.
    pub count: bool,
    /// Cutoffs at which to time the hybrid, at the last resolution.
    pub sweep: Vec<f32>,
    /// Whether to measure the methods of listing voxels instead of the strategies.
    pub lists: bool,
}

/// Why nothing was measured.
#[derive(Debug, thiserror::Error)]
pub enum MeasureError {
    /// The GPU failed.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The CPU failed.
    #[error(transparent)]
    Cpu(#[from] trixel::Error),
    /// The mesh has no triangles.
    #[error("the mesh has no triangles")]
    Empty,
}

impl From<GridError> for MeasureError {
    fn from(error: GridError) -> Self {
        Self::Cpu(error.into())
    }
}

impl From<LatticeError> for MeasureError {
    fn from(error: LatticeError) -> Self {
        Self::Cpu(error.into())
    }
}

impl Results {
    /// Results of this machine and adapter, without any yet.
    #[must_use]
    pub fn new(gpu: Option<&Gpu>, mode: Mode) -> Self {
        let adapter = gpu.map(|gpu| {
            let info = gpu.info();
            Adapter {
                name: info.name.clone(),
                driver: info.driver.clone(),
                software: info.software,
                tier: info.tier.name().to_owned(),
            }
        });
        let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
        Self {
            schema: SCHEMA,
            trixel: env!("CARGO_PKG_VERSION").to_owned(),
            unix_time: now.map_or(0, |now| now.as_secs()),
            machine: Machine {
                cpu: cpu_name(),
                threads: rayon::current_num_threads(),
                system: std::env::consts::OS.to_owned(),
            },
            adapter,
            mode: mode.name().to_owned(),
            cells: vec![],
            sweeps: vec![],
            lists: vec![],
        }
    }

    /// Measures a mesh by a plan; `progress` is told what comes next.
    ///
    /// # Errors
    /// When a backend fails or the mesh is empty.
    pub fn measure(
        &mut self,
        name: &str,
        mesh: &Mesh,
        gpu: Option<&Gpu>,
        plan: &Plan,
        progress: &dyn Fn(&str),
    ) -> Result<(), MeasureError> {
        let bounds = mesh.bounds().ok_or(MeasureError::Empty)?;
        for &resolution in &plan.resolutions {
            let grid = Grid::fit(&bounds, resolution)?;
            let lattice = LatticeMesh::snap(mesh, &grid)?;
            if let (true, Some(gpu)) = (plan.lists, gpu) {
                progress(&format!("{name} at {resolution}: lists"));
                let job = Job::new(grid, plan.mode);
                self.lists.extend(lists::measure((name, resolution), &lattice, &job, gpu, plan.runs)?);
                continue;
            }
            let bench = Bench { name, resolution, lattice: &lattice, job: Job::new(grid, plan.mode), plan, progress };
            let sweep = if plan.resolutions.last() == Some(&resolution) { plan.sweep.as_slice() } else { &[] };
            bench.run(self, gpu, sweep)?;
        }
        Ok(())
    }
}

/// One mesh on one grid.
struct Bench<'a> {
    name: &'a str,
    resolution: u32,
    lattice: &'a LatticeMesh<'a>,
    job: Job,
    plan: &'a Plan,
    progress: &'a dyn Fn(&str),
}

/// One strategy of the GPU, ready to run.
struct Contestant {
    strategy: Strategy,
    voxelizer: Voxelizer,
    times: Vec<f64>,
    wrong_voxels: u64,
}

impl Bench<'_> {
    fn run(&self, results: &mut Results, gpu: Option<&Gpu>, sweep: &[f32]) -> Result<(), MeasureError> {
        self.tell("cpu");
        let mut right = Volume::new(*self.job.grid()).map_err(trixel::Error::from)?;
        let mut times = vec![];
        // The first run warms up.
        for run in 0..=if self.plan.cpu { self.plan.runs } else { 0 } {
            let start = Instant::now();
            CpuBackend::default().voxelize(self.lattice, &self.job, &mut right)?;
            if run > 0 {
                times.push(start.elapsed().as_secs_f64() * 1e3);
            }
        }
        let voxels = right.count();
        if self.plan.cpu {
            results.cells.push(self.cell("cpu", Strategy::ColumnRuns, &mut times, voxels));
        }
        let Some(gpu) = gpu else { return Ok(()) };
        let mesh = GpuMesh::upload(gpu, self.lattice)?;
        let volume = GpuVolume::new(gpu, *self.job.grid())?;
        let cutoff = self.cutoff(gpu, &mesh)?;
        let mut contestants = vec![];
        for &strategy in &self.plan.strategies {
            self.tell(strategy.name());
            let options = Options { cutoff, ..Options::default() };
            let mut voxelizer = Voxelizer::new(gpu, &self.job.with_strategy(strategy), &options)?;
            voxelizer.run(&mesh, &volume)?;
            let wrong_voxels = wrong_voxels(gpu, &volume, &right)?;
            contestants.push(Contestant { strategy, voxelizer, times: vec![], wrong_voxels });
        }
        for _ in 0..self.plan.runs {
            for contestant in &mut contestants {
                contestant.times.push(time(&mut contestant.voxelizer, &mesh, &volume)?);
            }
        }
        for Contestant { strategy, voxelizer, mut times, wrong_voxels } in contestants {
            let mut cell = self.cell("gpu", strategy, &mut times, voxels);
            cell.cutoff = cutoff.filter(|_| is_hybrid(strategy)).map(|cutoff| cutoff.value);
            cell.passes_ms = voxelizer.pass_times()?.iter().map(|pass| (pass.name.to_owned(), pass.ms)).collect();
            cell.wrong_voxels = wrong_voxels;
            if self.plan.count {
                self.tell(&format!("{strategy}, counting"));
                let options = Options { cutoff, count: true, ..Options::default() };
                let mut counting = Voxelizer::new(gpu, &self.job.with_strategy(strategy), &options)?;
                counting.run(&mesh, &volume)?;
                cell.counters = Some(counting.check()?);
            }
            results.cells.push(cell);
        }
        if !sweep.is_empty() {
            results.sweeps.push(self.sweep(gpu, &mesh, &volume, sweep)?);
        }
        Ok(())
    }

    fn tell(&self, what: &str) {
        (self.progress)(&format!("{} at {}: {what}", self.name, self.resolution));
    }

    /// The plan's cutoff, or the best that a search finds; none for meshes so small that the hybrid does without.
    fn cutoff(&self, gpu: &Gpu, mesh: &GpuMesh) -> Result<Option<Cutoff>, GpuError> {
        const TINY: u64 = 64;
        let heuristic = Heuristic::ProjectedArea;
        if let Some(value) = self.plan.cutoff {
            return Ok(Some(Cutoff { heuristic, value }));
        }
        if mesh.triangles() < TINY || !self.plan.strategies.iter().any(|strategy| is_hybrid(*strategy)) {
            return Ok(None);
        }
        self.tell("searching the cutoff");
        let options = Options::default();
        let tuning = trixel_gpu::tune(gpu, mesh, &self.job, &options, heuristic, self.plan.runs, |_| {})?;
        Ok(Some(tuning.best))
    }

    fn sweep(&self, gpu: &Gpu, mesh: &GpuMesh, volume: &GpuVolume, cutoffs: &[f32]) -> Result<Sweep, GpuError> {
        let mut hybrid = Voxelizer::new(gpu, &self.job.with_strategy(Strategy::Hybrid), &Options::default())?;
        let mut samples = vec![];
        for &cutoff in cutoffs {
            self.tell(&format!("hybrid, cutoff {cutoff}"));
            hybrid.set_cutoff(cutoff);
            let mut times = vec![];
            for _ in 0..self.plan.runs.max(1) {
                times.push(time(&mut hybrid, mesh, volume)?);
            }
            samples.push((cutoff, median(&mut times)));
        }
        Ok(Sweep { mesh: self.name.to_owned(), resolution: self.resolution, samples })
    }

    fn cell(&self, backend: &str, strategy: Strategy, times: &mut [f64], voxels: u64) -> Cell {
        let median_ms = median(times);
        Cell {
            mesh: self.name.to_owned(),
            triangles: self.lattice.triangles.len() as u64,
            resolution: self.resolution,
            backend: backend.to_owned(),
            strategy: strategy.name().to_owned(),
            cutoff: None,
            runs: times.len(),
            median_ms,
            min_ms: times.first().copied().unwrap_or(0.0),
            max_ms: times.last().copied().unwrap_or(0.0),
            passes_ms: vec![],
            counters: None,
            voxels,
            wrong_voxels: 0,
        }
    }
}

fn is_hybrid(strategy: Strategy) -> bool {
    matches!(strategy, Strategy::Hybrid | Strategy::HybridTwoPass)
}

fn time(voxelizer: &mut Voxelizer, mesh: &GpuMesh, volume: &GpuVolume) -> Result<f64, GpuError> {
    let start = Instant::now();
    voxelizer.run(mesh, volume)?;
    Ok(start.elapsed().as_secs_f64() * 1e3)
}

fn wrong_voxels(gpu: &Gpu, volume: &GpuVolume, right: &Volume) -> Result<u64, MeasureError> {
    let mut found = Volume::new(*right.grid()).map_err(trixel::Error::from)?;
    volume.download(gpu, &mut found)?;
    let pairs = right.words().iter().zip(found.words());
    Ok(pairs.map(|(right, found)| u64::from((right ^ found).count_ones())).sum())
}
