//! Voxels on the GPU.

use std::ops::Range;

use trixel::{Grid, Volume, WORD_BITS};

use crate::error::GpuError;
use crate::gpu::Gpu;

/// The voxels of a grid in buffers of a [`Gpu`], one bit each, laid out as in [`Volume`]: bits along z in `u32` words
/// (an even number a column), columns with y fastest, then x. Grids larger than a binding are cut into slabs along x.
#[derive(Debug)]
pub struct GpuVolume {
    grid: Grid,
    /// `u32` words of one column.
    pub(crate) column_words: u32,
    slabs: Vec<Slab>,
}

/// The voxels with `x` to `x + nx` of a [`GpuVolume`].
#[derive(Debug)]
pub struct Slab {
    buffer: wgpu::Buffer,
    x: u32,
    nx: u32,
}

impl Slab {
    fn new(gpu: &Gpu, grid: &Grid, x: u32, nx: u32) -> Result<Self, GpuError> {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let buffer = gpu.buffer("trixel voxels", u64::from(nx) * GpuVolume::plane_bytes(grid), usage)?;
        Ok(Self { buffer, x, nx })
    }

    /// The buffer: storage, and source and target of copies.
    #[must_use]
    pub fn buffer(&self) -> &wgpu::Buffer {
        &self.buffer
    }

    /// The first x.
    #[must_use]
    pub fn x(&self) -> u32 {
        self.x
    }

    /// How many x.
    #[must_use]
    pub fn nx(&self) -> u32 {
        self.nx
    }
}

impl GpuVolume {
    /// Room for the voxels of `grid`; its contents are whatever the device gives until something is voxelized.
    ///
    /// # Errors
    /// When GPU memory runs out, or a single plane of the grid exceeds what the adapter binds.
    pub fn new(gpu: &Gpu, grid: Grid) -> Result<Self, GpuError> {
        let nx = grid.dims()[0];
        let plane_bytes = Self::plane_bytes(&grid);
        let planes = gpu.limits().slab_planes(plane_bytes);
        let Some(step) = u32::try_from(planes.min(u64::from(nx))).ok().filter(|step| *step > 0) else {
            return Err(gpu.plane_too_large(plane_bytes));
        };
        let slabs = (0..nx)
            .step_by(step as usize)
            .map(|x| Slab::new(gpu, &grid, x, step.min(nx - x)))
            .collect::<Result<_, GpuError>>()?;
        Ok(Self { grid, column_words: Self::column_words_of(&grid), slabs })
    }

    /// The slab of a volume that has only one.
    ///
    /// # Errors
    /// Says `what` does not fit one binding, when there are more.
    pub(crate) fn whole(&self, gpu: &Gpu, what: &'static str) -> Result<&Slab, GpuError> {
        gpu.check_storage(what, self.slabs.iter().map(|slab| self.slab_bytes(slab)).sum())?;
        self.slabs.first().ok_or_else(|| gpu.plane_too_large(0))
    }

    /// The grid in volumes of one slab each, so small that a buffer of `voxel_bytes` a voxel fits a binding too. They are
    /// made one by one, so that only one takes memory at a time.
    pub(crate) fn parts(
        gpu: &Gpu,
        grid: Grid,
        voxel_bytes: u64,
    ) -> Result<impl Iterator<Item = Result<Self, GpuError>> + use<'_>, GpuError> {
        let [nx, ny, nz] = grid.dims();
        let plane_bytes = u64::from(ny) * u64::from(nz) * voxel_bytes;
        let planes = gpu.limits().slab_planes(plane_bytes.max(Self::plane_bytes(&grid))).min(u64::from(nx));
        let Some(step) = u32::try_from(planes).ok().filter(|step| *step > 0) else {
            return Err(gpu.plane_too_large(plane_bytes));
        };
        Ok((0..nx).step_by(step as usize).map(move |x| {
            let slab = Slab::new(gpu, &grid, x, step.min(nx - x))?;
            Ok(Self { grid, column_words: Self::column_words_of(&grid), slabs: vec![slab] })
        }))
    }

    /// A word for each voxel of a volume of one slab: `claims` of `claim.wgsl`, none made yet.
    pub(crate) fn claims(&self, gpu: &Gpu) -> Result<wgpu::Buffer, GpuError> {
        let [_, ny, nz] = self.grid.dims();
        let planes: u64 = self.slabs.iter().map(|slab| u64::from(slab.nx)).sum();
        // New buffers are zeroed.
        gpu.storage("the claims of voxels", planes * u64::from(ny) * u64::from(nz) * 4, wgpu::BufferUsages::STORAGE)
    }

    fn column_words_of(grid: &Grid) -> u32 {
        grid.dims()[2].div_ceil(WORD_BITS) * 2
    }

    fn plane_bytes(grid: &Grid) -> u64 {
        u64::from(grid.dims()[1]) * u64::from(Self::column_words_of(grid)) * 4
    }

    /// One slab without room for its voxels, for what writes none.
    pub(crate) fn without_voxels(gpu: &Gpu, grid: Grid) -> Result<Self, GpuError> {
        Self::window(gpu, grid, 0..grid.dims()[0])
    }

    /// Likewise, of a part of the grid alone.
    pub(crate) fn window(gpu: &Gpu, grid: Grid, x: Range<u32>) -> Result<Self, GpuError> {
        let buffer = gpu.buffer("trixel no voxels", 4, wgpu::BufferUsages::STORAGE)?;
        let slab = Slab { buffer, x: x.start, nx: x.end - x.start };
        Ok(Self { grid, column_words: Self::column_words_of(&grid), slabs: vec![slab] })
    }

    /// The grid.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The buffers, in the order of x.
    #[must_use]
    pub fn slabs(&self) -> &[Slab] {
        &self.slabs
    }

    pub(crate) fn slab_bytes(&self, slab: &Slab) -> u64 {
        u64::from(slab.nx) * u64::from(self.grid.dims()[1]) * u64::from(self.column_words) * 4
    }

    /// Copies the voxels into `volume`, after everything submitted so far.
    ///
    /// # Errors
    /// When the grids differ, memory runs out or the device is lost.
    pub fn download(&self, gpu: &Gpu, volume: &mut Volume) -> Result<(), GpuError> {
        if *volume.grid() != self.grid {
            return Err(GpuError::GridMismatch);
        }
        let largest = self.slabs.iter().map(|slab| self.slab_bytes(slab)).max().unwrap_or(0);
        let usage = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ;
        let staging = gpu.buffer("trixel download", largest, usage)?;
        let mut rest = bytemuck::cast_slice_mut::<u64, u8>(volume.words_mut());
        for slab in &self.slabs {
            let bytes = self.slab_bytes(slab);
            gpu.guarded(|| {
                let mut encoder = gpu.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
                encoder.copy_buffer_to_buffer(&slab.buffer, 0, &staging, 0, bytes);
                gpu.queue().submit([encoder.finish()]);
            })?;
            let (part, others) = rest.split_at_mut(usize::try_from(bytes).unwrap_or(usize::MAX));
            gpu.read(&staging, bytes, |voxels| part.copy_from_slice(voxels))?;
            rest = others;
        }
        Ok(())
    }
}
