//! Solids from the boundary voxels of slices: \[CL\] section 2.3, the twin of [`trixel::fill`].

use trixel::fill::{Fill, FillReport, XOR_PASSES};

use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::kernel::{Bound, Dispatcher, Kernel};
use crate::volume::GpuVolume;

/// What a column's word says that is questionable: `QUESTIONABLE` of `fill_slices.wgsl`.
const QUESTIONABLE: u32 = u32::MAX;

impl GpuVolume {
    /// Fills between the boundary voxels of [`trixel::Mode::Sliced`], along z, after everything submitted so far:
    /// [`trixel::fill::fill`], with the same result bit for bit.
    ///
    /// # Errors
    /// When the volume is larger than one binding, memory runs out or the device is lost.
    pub fn filled(&self, gpu: &Gpu, fill: Fill) -> Result<(Self, FillReport), GpuError> {
        let [nx, ny, nz] = self.grid().dims();
        let filled = Self::new(gpu, *self.grid())?;
        let [boundary, into] = [self, &filled].map(|volume| volume.whole(gpu, "the voxels to fill"));
        let (boundary, into) = (boundary?, into?);
        let columns = nx * ny;
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let states = gpu.storage("the columns to fill", u64::from(columns) * 4, usage)?;
        let mut dispatcher = Dispatcher::new(gpu);
        let mut dispatch = |kernel, pass: u32| {
            let words = [nx, ny, nz, self.column_words, pass];
            let buffers = [boundary.buffer(), into.buffer(), &states].map(Bound::Buffer);
            let bound = [(0, Bound::Words(&words)), (1, buffers[0]), (2, buffers[1]), (3, buffers[2])];
            dispatcher.dispatch(kernel, &bound, columns)
        };
        dispatch(Kernel::SwitchColumns { uncorrected: fill == Fill::Parity }, 0)?;
        match fill {
            Fill::Parity => {}
            Fill::Xor => (1..=XOR_PASSES).try_for_each(|pass| dispatch(Kernel::CorrectXor, pass))?,
            Fill::March => dispatch(Kernel::CorrectMarch, 1)?,
        }
        let states = dispatcher.read_words(&[(&states, columns as usize)])?;
        let count = |is: fn(u32) -> bool| states.iter().flatten().filter(|state| is(**state)).count() as u64;
        let report =
            FillReport { questionable: count(|state| state != 0), uncorrected: count(|state| state == QUESTIONABLE) };
        Ok((filled, report))
    }
}
