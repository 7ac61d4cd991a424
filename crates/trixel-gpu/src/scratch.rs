//! Buffers that a voxelizer keeps between its runs, as large as any run needed so far.

use crate::counters;
use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::limits::{MAX_PAIRS, SCAN_BLOCK, WORKGROUP};
use crate::pipelines::TARGET_FORMAT;

/// What a [`crate::Voxelizer`] keeps. Handles of buffers are cheap to clone, and a recording that holds one keeps it alive
/// when a later one needs a larger.
#[derive(Debug)]
pub(crate) struct Scratch {
    pub(crate) counters: wgpu::Buffer,
    /// Bound where a shader declares a buffer that it does not look at.
    pub(crate) nothing: wgpu::Buffer,
    /// Arguments of a draw of one instance without vertices.
    pub(crate) no_draw: wgpu::Buffer,
    status: Status,
    lists: Option<Lists>,
    scan: Option<ScanBuffers>,
    cases: Option<CaseBuffers>,
    tiles: Option<TileBuffers>,
    target: Option<(u32, wgpu::TextureView)>,
}

/// Where a run's counters and totals end up, and the run's number after them: proof that it ran.
#[derive(Clone, Debug)]
pub(crate) struct Status {
    pub(crate) buffer: wgpu::Buffer,
    /// How many totals lie between the counters and the number.
    units: u64,
    pub(crate) run: u32,
    /// Totals above this are of pairs that were left out.
    pub(crate) room: u32,
}

impl Status {
    fn new(gpu: &Gpu, units: u64, run: u32) -> Result<Self, GpuError> {
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let bytes = counters::BYTES + 4 * units + 4;
        Ok(Self { buffer: gpu.buffer("trixel status", bytes, usage)?, units, run, room: MAX_PAIRS })
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.run_offset() + 4
    }

    pub(crate) fn total_offset(&self, unit: usize) -> u64 {
        counters::BYTES + 4 * unit as u64
    }

    pub(crate) fn run_offset(&self) -> u64 {
        counters::BYTES + 4 * self.units
    }
}

/// Small and large triangles.
#[derive(Clone, Debug)]
pub(crate) struct Lists {
    pub(crate) small: List,
    pub(crate) large: List,
}

/// Triangles, their number, and the arguments of the draw and the dispatch over them.
#[derive(Clone, Debug)]
pub(crate) struct List {
    pub(crate) triangles: wgpu::Buffer,
    pub(crate) count: wgpu::Buffer,
    pub(crate) arguments: wgpu::Buffer,
}

/// The prefix sum's levels: each holds the totals of the blocks of the one before.
#[derive(Clone, Debug)]
pub(crate) struct ScanBuffers {
    pub(crate) levels: Vec<wgpu::Buffer>,
    /// The sum of all.
    pub(crate) total: wgpu::Buffer,
    pub(crate) arguments: wgpu::Buffer,
}

/// Triangles by the case of their boxes.
#[derive(Clone, Debug)]
pub(crate) struct CaseBuffers {
    /// One word a triangle, both.
    pub(crate) cases: wgpu::Buffer,
    pub(crate) sorted: wgpu::Buffer,
    /// Of the four cases' dispatches, three words each.
    pub(crate) arguments: wgpu::Buffer,
}

/// Pairs of tile and triangle.
#[derive(Clone, Debug)]
pub(crate) struct TileBuffers {
    /// Two words a pair, before and after each pass of the sort.
    pub(crate) pairs: [wgpu::Buffer; 2],
    /// Of the digits of each 64 pairs.
    pub(crate) digits: ScanBuffers,
    /// `Shares` of `find_tiles.wgsl`.
    pub(crate) shares: wgpu::Buffer,
    pub(crate) arguments: wgpu::Buffer,
}

/// Counts that the sort of so many pairs sums up.
pub(crate) fn digit_counts(pairs: u32) -> u32 {
    pairs.div_ceil(WORKGROUP) * 16
}

/// Whether a buffer of one word an element has room for so many.
fn holds(buffer: &wgpu::Buffer, elements: u32) -> bool {
    buffer.size() >= u64::from(elements) * 4
}

/// Arguments of a draw, then of a dispatch: `arguments.wgsl`.
fn arguments(gpu: &Gpu) -> Result<wgpu::Buffer, GpuError> {
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::INDIRECT | wgpu::BufferUsages::COPY_DST;
    gpu.buffer("trixel arguments", 28, usage)
}

impl List {
    fn new(gpu: &Gpu, capacity: u32) -> Result<Self, GpuError> {
        let storage = wgpu::BufferUsages::STORAGE;
        Ok(Self {
            triangles: gpu.buffer("trixel list", u64::from(capacity) * 4, storage)?,
            count: gpu.buffer("trixel list length", 4, storage | wgpu::BufferUsages::COPY_DST)?,
            arguments: arguments(gpu)?,
        })
    }
}

impl Lists {
    /// Lists of up to `capacity` triangles each.
    pub(crate) fn new(gpu: &Gpu, capacity: u32) -> Result<Self, GpuError> {
        Ok(Self { small: List::new(gpu, capacity)?, large: List::new(gpu, capacity)? })
    }
}

impl ScanBuffers {
    fn new(gpu: &Gpu, capacity: u32) -> Result<Self, GpuError> {
        let storage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let level = |length: u32| gpu.buffer("trixel prefix sums", u64::from(length) * 4, storage);
        let mut length = capacity.max(1);
        let mut levels = vec![level(length)?];
        while length > SCAN_BLOCK {
            length = length.div_ceil(SCAN_BLOCK);
            levels.push(level(length)?);
        }
        Ok(Self { levels, total: level(1)?, arguments: arguments(gpu)? })
    }

    /// The first level: what is counted, then its prefix sums.
    pub(crate) fn counted(&self) -> &wgpu::Buffer {
        // There is always one; the total is only named for the type's sake.
        self.levels.first().unwrap_or(&self.total)
    }
}

impl CaseBuffers {
    fn new(gpu: &Gpu, triangles: u32) -> Result<Self, GpuError> {
        let storage = wgpu::BufferUsages::STORAGE;
        let list = |label| gpu.buffer(label, u64::from(triangles) * 4, storage);
        Ok(Self {
            cases: list("trixel cases")?,
            sorted: list("trixel triangles by case")?,
            arguments: gpu.buffer("trixel arguments", 48, storage | wgpu::BufferUsages::INDIRECT)?,
        })
    }
}

impl TileBuffers {
    fn new(gpu: &Gpu, pairs: u32, shares: u32) -> Result<Self, GpuError> {
        let storage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let list = || gpu.buffer("trixel pairs of tile and triangle", u64::from(pairs) * 8, storage);
        Ok(Self {
            pairs: [list()?, list()?],
            digits: ScanBuffers::new(gpu, digit_counts(pairs))?,
            shares: gpu.buffer("trixel shares of tiles", 8 + 4 * u64::from(shares), storage)?,
            arguments: arguments(gpu)?,
        })
    }
}

impl Scratch {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let counters = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        Ok(Self {
            counters: gpu.buffer("trixel counters", counters::BYTES, counters)?,
            nothing: gpu.buffer("trixel nothing", 4, wgpu::BufferUsages::STORAGE)?,
            no_draw: gpu.buffer_with(
                "trixel no draw",
                bytemuck::cast_slice(&[0u32, 1, 0, 0]),
                wgpu::BufferUsages::COPY_SRC,
            )?,
            status: Status::new(gpu, 0, 0)?,
            lists: None,
            scan: None,
            cases: None,
            tiles: None,
            target: None,
        })
    }

    /// The status of the last run.
    pub(crate) fn status(&self) -> &Status {
        &self.status
    }

    /// The status of a new run with so many units.
    pub(crate) fn next_status(&mut self, gpu: &Gpu, units: u64) -> Result<Status, GpuError> {
        let run = self.status.run.wrapping_add(1).max(1);
        if self.status.units != units {
            self.status = Status::new(gpu, units, run)?;
        }
        self.status.run = run;
        self.status.room = MAX_PAIRS;
        Ok(self.status.clone())
    }

    /// Says that this run has room for so many pairs a unit.
    pub(crate) fn limit_pairs(&mut self, room: u32) {
        self.status.room = self.status.room.min(room);
    }

    /// Buffers for the cases of so many triangles.
    pub(crate) fn cases(&mut self, gpu: &Gpu, triangles: u32) -> Result<CaseBuffers, GpuError> {
        match &self.cases {
            Some(cases) if holds(&cases.cases, triangles) => Ok(cases.clone()),
            _ => Ok(self.cases.insert(CaseBuffers::new(gpu, triangles)?).clone()),
        }
    }

    /// Buffers for so many pairs of a triangle and one of so many tiles, in shares of so many.
    pub(crate) fn tiles(&mut self, gpu: &Gpu, pairs: u32, tiles: u32, share: u32) -> Result<TileBuffers, GpuError> {
        let shares = pairs.min(tiles.saturating_add(pairs.div_ceil(share)));
        match &self.tiles {
            Some(kept) if holds(&kept.pairs[0], 2 * pairs) && kept.shares.size() >= 8 + 4 * u64::from(shares) => {
                Ok(kept.clone())
            }
            _ => Ok(self.tiles.insert(TileBuffers::new(gpu, pairs, shares)?).clone()),
        }
    }

    /// Lists with room for so many triangles each.
    pub(crate) fn lists(&mut self, gpu: &Gpu, capacity: u32) -> Result<Lists, GpuError> {
        match &self.lists {
            Some(lists) if holds(&lists.large.triangles, capacity) => Ok(lists.clone()),
            _ => Ok(self.lists.insert(Lists::new(gpu, capacity)?).clone()),
        }
    }

    /// Buffers for the prefix sums of so many numbers.
    pub(crate) fn scan(&mut self, gpu: &Gpu, capacity: u32) -> Result<ScanBuffers, GpuError> {
        match &self.scan {
            Some(scan) if scan.levels.first().is_some_and(|level| holds(level, capacity)) => Ok(scan.clone()),
            _ => Ok(self.scan.insert(ScanBuffers::new(gpu, capacity)?).clone()),
        }
    }

    /// A raster target, `size` pixels a side.
    pub(crate) fn target(&mut self, gpu: &Gpu, size: u32) -> Result<wgpu::TextureView, GpuError> {
        match &self.target {
            Some((kept, target)) if *kept == size => Ok(target.clone()),
            _ => Ok(self.target.insert((size, new_target(gpu, size)?)).1.clone()),
        }
    }
}

fn new_target(gpu: &Gpu, size: u32) -> Result<wgpu::TextureView, GpuError> {
    let texture = gpu.guarded(|| {
        gpu.device().create_texture(&wgpu::TextureDescriptor {
            label: Some("trixel raster target"),
            size: wgpu::Extent3d { width: size, height: size, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: TARGET_FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
            view_formats: &[],
        })
    })?;
    Ok(texture.create_view(&wgpu::TextureViewDescriptor::default()))
}
