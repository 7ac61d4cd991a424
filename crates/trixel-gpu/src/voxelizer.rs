//! Voxelizing meshes that are on the GPU, into voxels that stay there.

use trixel::lattice::LatticeMesh;
use trixel::{Backend, CpuBackend, Job, Mode, Strategy, Volume, VoxelOrder, WORD_BITS};

use crate::attributes::{self, GpuAttributes, GpuSurface};
use crate::counters::{self, Counters};
use crate::cutoff::{Cutoff, Dilation};
use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::limits::{MAX_PAIRS, WORKGROUP};
use crate::lists::{self, GpuVoxelList, ListMethod};
use crate::mesh::GpuMesh;
use crate::passes::{self, Appending};
use crate::probe;
use crate::scratch::{Lists, Scratch};
use crate::shader::{Sink, Variant};
use crate::targets::{self, GpuTargets, Target};
use crate::timer::{PassTime, Timer};
use crate::volume::GpuVolume;

/// The strategies of this backend.
pub const STRATEGIES: [Strategy; 9] = [
    Strategy::TriangleParallel,
    Strategy::FragmentParallel,
    Strategy::Hybrid,
    Strategy::HybridTwoPass,
    Strategy::Balanced,
    Strategy::Sliced,
    Strategy::SlicePerPass,
    Strategy::CaseSorted,
    Strategy::Tiled,
];

/// The strategies of this backend that have a mode.
pub fn strategies_of(mode: Mode) -> impl Iterator<Item = Strategy> {
    STRATEGIES.into_iter().filter(move |strategy| strategy.modes().contains(&mode))
}

/// How to voxelize; nothing here changes which voxels are set.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Options {
    /// From which size on the hybrids call a triangle large. By default [`Cutoff::default_for`] the adapter; the one-pass
    /// hybrid then also gives meshes of fewer triangles than a workgroup has invocations to the rasterizer whole, because a
    /// compute pass costs more than it could spare.
    pub cutoff: Option<Cutoff>,
    /// How triangles are dilated for the rasterizer.
    pub dilation: Dilation,
    /// Whether to count what [`Counters`] holds. Costs time.
    pub count: bool,
}

/// Voxelizes meshes by one job, keeping its buffers between runs.
///
/// ```no_run
/// use trixel::lattice::LatticeMesh;
/// use trixel::{Grid, Job, Mode, Volume};
/// use trixel_gpu::{AdapterChoice, Gpu, GpuMesh, GpuVolume, Options, Voxelizer};
///
/// let mesh = trixel::scene::build("torus")?;
/// let grid = Grid::fit(&mesh.bounds().expect("a torus has triangles"), 256)?;
/// let job = Job::new(grid, Mode::Conservative);
///
/// let gpu = Gpu::open(&AdapterChoice::Any)?;
/// let on_gpu = GpuMesh::upload(&gpu, &LatticeMesh::snap(&mesh, &grid)?)?;
/// let voxels = GpuVolume::new(&gpu, grid)?;
/// let mut voxelizer = Voxelizer::new(&gpu, &job, &Options::default())?;
/// voxelizer.run(&on_gpu, &voxels)?;
///
/// let mut volume = Volume::new(grid)?;
/// voxels.download(&gpu, &mut volume)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Voxelizer {
    gpu: Gpu,
    job: Job,
    strategy: Strategy,
    dilation: Dilation,
    cutoff: Cutoff,
    /// Chunks of fewer triangles are not worth a pass of their own.
    whole_below: u32,
    variant: Variant,
    scratch: Scratch,
    timer: Option<Timer>,
}

/// A sorting of a mesh's triangles into small and large that [`Voxelizer::record_classified`] uses again and again:
/// \[HCV\] chapter 5's pre-classified form for static meshes.
#[derive(Debug)]
pub struct Classification {
    pub(crate) units: Vec<Lists>,
    pub(crate) mode: Mode,
    pub(crate) dilation: Dilation,
}

impl Voxelizer {
    /// A voxelizer for a job. The first one of its mode, strategy and options on a device builds their pipelines, voxelizes a
    /// small nasty scene and compares with the CPU.
    ///
    /// # Errors
    /// When the job's strategy is not the GPU's, the device computes wrong voxels, or memory runs out.
    pub fn new(gpu: &Gpu, job: &Job, options: &Options) -> Result<Self, GpuError> {
        let voxelizer = Self::unchecked(gpu, job, options)?;
        let Self { strategy, cutoff, dilation, variant, .. } = voxelizer;
        probe::check(gpu, probe::Checked { variant, strategy, heuristic: cutoff.heuristic, dilation })?;
        Ok(voxelizer)
    }

    /// A voxelizer without the check.
    pub(crate) fn unchecked(gpu: &Gpu, job: &Job, options: &Options) -> Result<Self, GpuError> {
        let strategy = match job.strategy() {
            Strategy::Auto => Strategy::Hybrid,
            strategy if STRATEGIES.contains(&strategy) => strategy,
            other => return Err(GpuError::Strategy(other)),
        };
        if !strategy.modes().contains(&job.mode()) {
            return Err(GpuError::StrategyOfOtherModes { strategy, mode: job.mode() });
        }
        Ok(Self {
            gpu: gpu.clone(),
            job: *job,
            strategy,
            dilation: options.dilation,
            cutoff: options.cutoff.unwrap_or_else(|| Cutoff::default_for(gpu.info(), Default::default())),
            whole_below: if options.cutoff.is_none() { WORKGROUP } else { 0 },
            variant: Variant { mode: job.mode(), counting: options.count, sink: Sink::Bits },
            scratch: Scratch::new(gpu)?,
            timer: Timer::new(gpu)?,
        })
    }

    /// The strategy in use.
    #[must_use]
    pub fn strategy(&self) -> Strategy {
        self.strategy
    }

    /// The cutoff in use.
    #[must_use]
    pub fn cutoff(&self) -> Cutoff {
        self.cutoff
    }

    /// Changes the cutoff's value for the runs that follow.
    pub fn set_cutoff(&mut self, value: f32) {
        self.cutoff.value = value;
    }

    /// Records everything that overwrites `volume` with the voxels of `mesh`. Nothing runs before the encoder's commands
    /// are submitted; call [`Voxelizer::check`] after that, and before the next recording, which counts anew.
    ///
    /// # Errors
    /// When the volume's grid is not the job's, a shader is refused, or memory runs out.
    pub fn record(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        mesh: &GpuMesh,
        volume: &GpuVolume,
    ) -> Result<(), GpuError> {
        self.record_with(encoder, mesh, volume, None, Appending::default())
    }

    /// Sorts the triangles of `mesh` into small and large, for [`Voxelizer::record_classified`]. Runs at once.
    ///
    /// # Errors
    /// As for [`Voxelizer::record`].
    pub fn classify(&mut self, mesh: &GpuMesh, volume: &GpuVolume) -> Result<Classification, GpuError> {
        self.submit(|voxelizer, encoder| {
            let gpu = voxelizer.gpu.clone();
            gpu.guarded(|| {
                passes::record_classification(voxelizer.setting(mesh, volume, Appending::default())?, encoder)
            })?
        })
    }

    /// [`Voxelizer::record`] with the classification made before: the second half of [`Strategy::HybridTwoPass`].
    ///
    /// # Errors
    /// As for [`Voxelizer::record`], and when the classification is of another mode, dilation or number of pieces. It must be
    /// of this mesh and volume.
    pub fn record_classified(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        mesh: &GpuMesh,
        volume: &GpuVolume,
        classification: &Classification,
    ) -> Result<(), GpuError> {
        self.record_with(encoder, mesh, volume, Some(classification), Appending::default())
    }

    fn record_with(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        mesh: &GpuMesh,
        volume: &GpuVolume,
        classification: Option<&Classification>,
        appending: Appending<'_>,
    ) -> Result<(), GpuError> {
        let strategy = if classification.is_some() { Strategy::HybridTwoPass } else { self.strategy };
        let initial = self.cpu_part(mesh)?;
        if strategy == Strategy::Hybrid && mesh.chunks.iter().any(|chunk| chunk.triangles < self.whole_below) {
            // These do as that strategy does.
            let Self { variant, dilation, cutoff, .. } = *self;
            let strategy = Strategy::FragmentParallel;
            probe::check(&self.gpu, probe::Checked { variant, strategy, heuristic: cutoff.heuristic, dilation })?;
        }
        let gpu = self.gpu.clone();
        // One guard around everything: most of what is recorded is only checked by the driver much later.
        gpu.guarded(|| {
            let setting = self.setting(mesh, volume, appending)?;
            passes::record(setting, encoder, strategy, classification, initial.as_ref())
        })?
    }

    fn setting<'a>(
        &'a mut self,
        mesh: &'a GpuMesh,
        volume: &'a GpuVolume,
        appending: Appending<'a>,
    ) -> Result<passes::Setting<'a>, GpuError> {
        if volume.grid() != self.job.grid() {
            return Err(GpuError::GridMismatch);
        }
        if let Some(timer) = &mut self.timer {
            timer.restart();
        }
        Ok(passes::Setting {
            gpu: &self.gpu,
            job: &self.job,
            variant: Variant { sink: appending.sink, ..self.variant },
            dilation: self.dilation,
            cutoff: self.cutoff,
            whole_below: self.whole_below,
            mesh,
            volume,
            appending,
            scratch: &mut self.scratch,
            timer: self.timer.as_mut(),
        })
    }

    /// What the triangles too large for the shaders set; in mode solid as toggles.
    pub(crate) fn cpu_part(&self, mesh: &GpuMesh) -> Result<Option<Volume>, GpuError> {
        let Some(leftover) = &mesh.leftover else { return Ok(None) };
        let mesh: LatticeMesh<'_> = leftover.mesh();
        let mut volume = Volume::new(*self.job.grid()).map_err(trixel::Error::from)?;
        CpuBackend::default().voxelize(&mesh, &self.job.with_strategy(Strategy::Auto), &mut volume)?;
        if self.job.mode() == Mode::Solid {
            let column_words = volume.column_words();
            let nz = self.job.grid().dims()[2];
            for column in volume.words_mut().chunks_exact_mut(column_words) {
                let mut below = 0;
                for word in column.iter_mut() {
                    let inside = *word;
                    *word ^= inside << 1 | below;
                    below = inside >> 63;
                }
                // The last toggle may have left the grid.
                if let (Some(last), used @ 1..) = (column.last_mut(), nz % WORD_BITS) {
                    *last &= u64::MAX >> (WORD_BITS - used);
                }
            }
        }
        Ok(Some(volume))
    }

    /// Records, submits, waits and checks.
    ///
    /// # Errors
    /// As for [`Voxelizer::record`] and [`Voxelizer::check`].
    pub fn run(&mut self, mesh: &GpuMesh, volume: &GpuVolume) -> Result<(), GpuError> {
        self.submit(|voxelizer, encoder| voxelizer.record(encoder, mesh, volume))
    }

    /// [`Voxelizer::run`] that also appends the voxels to a list. In mode solid only [`Sink::List`] can.
    pub(crate) fn run_appending(
        &mut self,
        mesh: &GpuMesh,
        volume: &GpuVolume,
        (sink, list): (Sink, &wgpu::Buffer),
    ) -> Result<(), GpuError> {
        self.run_into(mesh, volume, Appending { sink, buffers: &[list], pairs: None })
    }

    /// [`Voxelizer::run`] that also writes to what stages are bound to for a sink.
    pub(crate) fn run_into(
        &mut self,
        mesh: &GpuMesh,
        volume: &GpuVolume,
        appending: Appending<'_>,
    ) -> Result<(), GpuError> {
        self.submit(|voxelizer, encoder| voxelizer.record_with(encoder, mesh, volume, None, appending))
    }

    /// How many pairs of triangle and tile there are, for each unit of the layout.
    pub(crate) fn count_pairs(&mut self, mesh: &GpuMesh, volume: &GpuVolume, sink: Sink) -> Result<Vec<u32>, GpuError> {
        self.submit(|voxelizer, encoder| {
            let gpu = voxelizer.gpu.clone();
            let counting = Appending { sink, ..Appending::default() };
            gpu.guarded(|| passes::record_pair_counts(voxelizer.setting(mesh, volume, counting)?, encoder))?
        })?;
        Ok(self.results()?.1)
    }

    /// Voxelizes into `volume` as [`Voxelizer::run`] does, and blends render targets in the same pass: values of each set
    /// voxel, in the memory of the workgroup that has its tile. After J. Pantaleoni, *VoxelPipe*, 2011. For strategy
    /// [`Strategy::Tiled`] and every mode but solid, whose insides no triangle meets.
    ///
    /// How many targets there can be follows from the memory of a workgroup: 7 with WebGPU's 16 KiB, 15 with 32 KiB. Use
    /// [`Voxelizer::attributes`] for what is not an integer of a triangle, such as colours of textures.
    ///
    /// ```no_run
    /// use trixel::lattice::LatticeMesh;
    /// use trixel::{Grid, Job, Mode, Strategy};
    /// use trixel_gpu::{AdapterChoice, Gpu, GpuMesh, GpuVolume, Options, Target, Voxelizer};
    ///
    /// let mesh = trixel::scene::build("torus")?;
    /// let grid = Grid::fit(&mesh.bounds().expect("a torus has triangles"), 256)?;
    /// let job = Job::new(grid, Mode::Conservative).with_strategy(Strategy::Tiled);
    /// let gpu = Gpu::open(&AdapterChoice::Any)?;
    /// let on_gpu = GpuMesh::upload(&gpu, &LatticeMesh::snap(&mesh, &grid)?)?;
    /// let voxels = GpuVolume::new(&gpu, grid)?;
    /// let mut voxelizer = Voxelizer::new(&gpu, &job, &Options::default())?;
    ///
    /// let priorities: Vec<u32> = (0..mesh.triangles.len() as u32).map(|triangle| triangle % 5).collect();
    /// let targets = [Target::ID, Target::COUNT, Target::max(&priorities)];
    /// let blended = voxelizer.tiled_targets(&on_gpu, &voxels, &targets)?;
    /// let voxels = blended.list().download(&gpu)?;
    /// let values = blended.download(&gpu)?;
    /// println!("{} triangles meet in voxel {:?}, the first is {}", values[1][0], voxels[0], values[0][0]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// As for [`Voxelizer::run`], and when the job is of another strategy or solid, there are no targets or too many, values
    /// are not one a triangle, a triangle is 8192 voxels or longer along an axis, or a list exceeds what the adapter binds.
    pub fn tiled_targets(
        &mut self,
        mesh: &GpuMesh,
        volume: &GpuVolume,
        targets: &[Target<'_>],
    ) -> Result<GpuTargets, GpuError> {
        targets::blend(self, mesh, volume, targets)
    }

    /// The sorted list of the voxels of `mesh`, made by `method`; its bits, where it needs them, are its own. Use
    /// [`GpuVoxelList::of`] for voxels that are there already.
    ///
    /// # Errors
    /// As for [`Voxelizer::run`], and when the list exceeds what the adapter binds or the method has no list for the mode.
    pub fn list(&mut self, mesh: &GpuMesh, method: ListMethod, order: VoxelOrder) -> Result<GpuVoxelList, GpuError> {
        match method {
            ListMethod::Atomic | ListMethod::FragmentList => lists::append(self, mesh, method, order),
            ListMethod::Scan | ListMethod::Histopyramid => {
                let volume = GpuVolume::new(&self.gpu, *self.job.grid())?;
                self.run(mesh, &volume)?;
                GpuVoxelList::of(&self.gpu, &volume, method, order)
            }
        }
    }

    /// The attributes of the voxels of `volume`, which this voxelizer's job made of the mesh of `surface`, equal to what
    /// [`trixel::attributes::compute`] finds.
    ///
    /// ```no_run
    /// use trixel::attributes::{AttributeKind, AttributeRequest, Combine};
    /// use trixel::lattice::LatticeMesh;
    /// use trixel::{Grid, Job, Mode};
    /// use trixel_gpu::{AdapterChoice, Gpu, GpuMesh, GpuSurface, GpuVolume, Options, Voxelizer};
    ///
    /// let mesh = trixel::scene::build("torus")?;
    /// let grid = Grid::fit(&mesh.bounds().expect("a torus has triangles"), 256)?;
    /// let job = Job::new(grid, Mode::Conservative);
    /// let gpu = Gpu::open(&AdapterChoice::Any)?;
    /// let lattice = LatticeMesh::snap(&mesh, &grid)?;
    /// let voxels = GpuVolume::new(&gpu, grid)?;
    /// let mut voxelizer = Voxelizer::new(&gpu, &job, &Options::default())?;
    /// voxelizer.run(&GpuMesh::upload(&gpu, &lattice)?, &voxels)?;
    /// let request = AttributeRequest::new(&[AttributeKind::Normal], Combine::Mean);
    /// let surface = GpuSurface::upload(&gpu, &mesh, &lattice, &grid, &request)?;
    /// let attributes = voxelizer.attributes(&surface, &voxels)?.download(&gpu, &mesh)?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// When the grids differ, a triangle is too large for the shaders (8192 voxels along an axis, for a solid 4096), the rows
    /// exceed what the adapter binds, memory runs out or the device is lost.
    pub fn attributes(&self, surface: &GpuSurface, volume: &GpuVolume) -> Result<GpuAttributes, GpuError> {
        attributes::compute(self, surface, volume)
    }

    /// The device.
    pub(crate) fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// The job.
    #[must_use]
    pub fn job(&self) -> &Job {
        &self.job
    }

    /// [`Voxelizer::run`] with a classification made before.
    ///
    /// # Errors
    /// As for [`Voxelizer::record_classified`] and [`Voxelizer::check`].
    pub fn run_classified(
        &mut self,
        mesh: &GpuMesh,
        volume: &GpuVolume,
        classification: &Classification,
    ) -> Result<(), GpuError> {
        self.submit(|voxelizer, encoder| voxelizer.record_classified(encoder, mesh, volume, classification))
    }

    /// Submits what `record` records, waits and checks.
    fn submit<T>(
        &mut self,
        record: impl FnOnce(&mut Self, &mut wgpu::CommandEncoder) -> Result<T, GpuError>,
    ) -> Result<T, GpuError> {
        let mut encoder = self.gpu.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let recorded = record(self, &mut encoder)?;
        self.gpu.guarded(|| self.gpu.queue().submit([encoder.finish()]))?;
        self.check()?;
        Ok(recorded)
    }

    /// Waits for what was recorded last, once it is submitted, and says whether its result is whole; gives the counters,
    /// which are 0 unless asked for.
    ///
    /// # Errors
    /// When triangles were too large or columns too many, so that the result must not be used, nothing was submitted, or the
    /// device is lost.
    pub fn check(&self) -> Result<Counters, GpuError> {
        Ok(self.results()?.0)
    }

    /// [`Voxelizer::check`], with the pairs of each unit where any were counted.
    fn results(&self) -> Result<(Counters, Vec<u32>), GpuError> {
        let status = self.scratch.status();
        let (counters, too_large, words) = self.gpu.read(&status.buffer, status.bytes(), |bytes| {
            let (counters, too_large) = counters::parse(bytes);
            let after = bytes.get(usize::try_from(counters::BYTES).unwrap_or(usize::MAX)..).unwrap_or(&[]);
            let words: Vec<u32> = after.as_chunks::<4>().0.iter().map(|word| u32::from_le_bytes(*word)).collect();
            (counters, too_large, words)
        })?;
        let Some((_, totals)) = words.split_last().filter(|(run, _)| **run != 0 && **run == status.run) else {
            return Err(GpuError::NotSubmitted);
        };
        if too_large > 0 {
            return Err(GpuError::TrianglesTooLarge(too_large));
        }
        let (most, error) = match self.strategy {
            Strategy::Sliced => (MAX_PAIRS / self.dilation.vertices(), GpuError::TooManySlices),
            _ => (MAX_PAIRS, GpuError::TooManyColumns),
        };
        match totals.iter().max() {
            Some(needed) if *needed > most => return Err(error),
            Some(&needed) if needed > status.room => {
                return Err(GpuError::TooManyTiles { needed, room: status.room });
            }
            _ => {}
        }
        Ok((counters, totals.to_vec()))
    }

    /// How long each pass of the last run took on the device; empty where the adapter has no timestamps.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn pass_times(&self) -> Result<Vec<PassTime>, GpuError> {
        self.timer.as_ref().map_or(Ok(vec![]), |timer| timer.read(&self.gpu))
    }
}
