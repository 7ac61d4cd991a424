//! An open device, with the pipelines that were built on it.

use std::collections::HashSet;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use crate::adapter::{self, AdapterChoice, AdapterInfo};
use crate::error::GpuError;
use crate::limits::Limits;
use crate::pipelines::Pipelines;
use crate::probe::Checked;

/// A device to voxelize on. Cheap to clone; all clones share the pipelines, which are built once.
#[derive(Clone, Debug)]
pub struct Gpu {
    shared: Arc<Shared>,
}

#[derive(Debug)]
struct Shared {
    device: wgpu::Device,
    queue: wgpu::Queue,
    info: AdapterInfo,
    limits: Limits,
    pipelines: Pipelines,
    /// Why the device was lost, once it was.
    lost: Mutex<Option<String>>,
    /// What computes right voxels on it.
    checked: Mutex<HashSet<Checked>>,
}

impl Gpu {
    /// Opens a device on the chosen adapter.
    ///
    /// # Errors
    /// When there is no such adapter or it gives no device.
    pub fn open(choice: &AdapterChoice) -> Result<Self, GpuError> {
        let (adapter, info) = adapter::choose(choice)?;
        let wanted = info.tier.features() | wgpu::Features::TIMESTAMP_QUERY;
        let features = adapter.features() & wanted;
        let request = adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("trixel"),
            required_features: features,
            required_limits: adapter.limits(),
            memory_hints: wgpu::MemoryHints::Performance,
            ..Default::default()
        });
        let (device, queue) = pollster::block_on(request)
            .map_err(|error| GpuError::Device { adapter: info.to_string(), reason: error.to_string() })?;
        let gpu = Self::with_info(device, queue, info);
        let lost = Arc::downgrade(&gpu.shared);
        gpu.device().set_device_lost_callback(move |_, message| {
            if let Some(shared) = lost.upgrade() {
                *shared.lost.lock().unwrap_or_else(PoisonError::into_inner) = Some(message);
            }
        });
        Ok(gpu)
    }

    /// Voxelizes on a device that the program made itself. The device needs nothing beyond WebGPU's defaults; higher
    /// limits of buffers allow larger grids at once. Its device-lost callback stays the program's: a loss shows as
    /// [`GpuError::Refused`].
    #[must_use]
    pub fn from_device(device: wgpu::Device, queue: wgpu::Queue) -> Self {
        let info = AdapterInfo::new(&device.adapter_info(), device.features());
        Self::with_info(device, queue, info)
    }

    fn with_info(device: wgpu::Device, queue: wgpu::Queue, info: AdapterInfo) -> Self {
        let limits = Limits::new(&device.limits());
        let pipelines = Pipelines::new(&device);
        let (lost, checked) = Default::default();
        Self { shared: Arc::new(Shared { device, queue, info, limits, pipelines, lost, checked }) }
    }

    /// The device.
    #[must_use]
    pub fn device(&self) -> &wgpu::Device {
        &self.shared.device
    }

    /// The device's queue.
    #[must_use]
    pub fn queue(&self) -> &wgpu::Queue {
        &self.shared.queue
    }

    /// The adapter that the device is of.
    #[must_use]
    pub fn info(&self) -> &AdapterInfo {
        &self.shared.info
    }

    pub(crate) fn limits(&self) -> &Limits {
        &self.shared.limits
    }

    pub(crate) fn pipelines(&self) -> &Pipelines {
        &self.shared.pipelines
    }

    pub(crate) fn is_checked(&self, what: &Checked) -> bool {
        self.shared.checked.lock().unwrap_or_else(PoisonError::into_inner).contains(what)
    }

    pub(crate) fn set_checked(&self, what: Checked) {
        self.shared.checked.lock().unwrap_or_else(PoisonError::into_inner).insert(what);
    }

    pub(crate) fn has_timestamps(&self) -> bool {
        self.device().features().contains(wgpu::Features::TIMESTAMP_QUERY)
    }

    /// Runs what may exhaust memory or be refused, and turns that into an error.
    ///
    /// # Errors
    /// What the device said meanwhile.
    pub fn guarded<T>(&self, run: impl FnOnce() -> T) -> Result<T, GpuError> {
        let internal = self.device().push_error_scope(wgpu::ErrorFilter::Internal);
        let validation = self.device().push_error_scope(wgpu::ErrorFilter::Validation);
        let memory = self.device().push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let result = run();
        let errors = [memory, validation, internal].map(|scope| pollster::block_on(scope.pop()));
        self.check_lost()?;
        match errors.into_iter().flatten().next() {
            None => Ok(result),
            Some(wgpu::Error::OutOfMemory { .. }) => Err(GpuError::OutOfMemory { adapter: self.info().to_string() }),
            Some(error) => Err(self.refused(&error)),
        }
    }

    pub(crate) fn refused(&self, error: &dyn std::error::Error) -> GpuError {
        GpuError::Refused { adapter: self.info().to_string(), reason: error.to_string() }
    }

    pub(crate) fn plane_too_large(&self, needed: u64) -> GpuError {
        GpuError::PlaneTooLarge { adapter: self.info().to_string(), needed, limit: self.limits().binding_bytes }
    }

    fn check_lost(&self) -> Result<(), GpuError> {
        let lost = self.shared.lost.lock().unwrap_or_else(PoisonError::into_inner);
        match &*lost {
            Some(reason) => Err(GpuError::Lost { adapter: self.info().to_string(), reason: reason.clone() }),
            None => Ok(()),
        }
    }

    /// Waits until everything submitted has run.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn wait(&self) -> Result<(), GpuError> {
        let polled = self.device().poll(wgpu::PollType::wait_indefinitely());
        self.check_lost()?;
        polled.map(drop).map_err(|error| self.refused(&error))
    }

    /// Waits for everything submitted, and reads the first bytes of a buffer that allows mapping.
    ///
    /// # Errors
    /// When the device was lost, or refuses.
    pub fn read<T>(&self, buffer: &wgpu::Buffer, bytes: u64, take: impl FnOnce(&[u8]) -> T) -> Result<T, GpuError> {
        if bytes == 0 {
            return Ok(take(&[]));
        }
        let slice = buffer.slice(0..bytes);
        let (report, outcome) = mpsc::channel();
        slice.map_async(wgpu::MapMode::Read, move |result| {
            // The receiver waits below, or has left with an error.
            let _ = report.send(result);
        });
        let mapped = loop {
            self.wait()?;
            // Another thread that waits may have taken over the call.
            match outcome.recv_timeout(Duration::from_millis(10)) {
                Ok(mapped) => break mapped,
                Err(RecvTimeoutError::Timeout) => {}
                Err(error @ RecvTimeoutError::Disconnected) => return Err(self.refused(&error)),
            }
        };
        mapped.map_err(|error| self.refused(&error))?;
        let taken = {
            let view = slice.get_mapped_range().map_err(|error| self.refused(&error))?;
            take(&view)
        };
        buffer.unmap();
        Ok(taken)
    }

    /// A buffer, or an error when there is no memory for it.
    ///
    /// # Errors
    /// When memory runs out, or the device refuses.
    pub fn buffer(&self, label: &str, bytes: u64, usage: wgpu::BufferUsages) -> Result<wgpu::Buffer, GpuError> {
        // Zero-sized bindings are refused by wgpu.
        let size = bytes.next_multiple_of(4).max(4);
        self.guarded(|| {
            self.device().create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage,
                mapped_at_creation: false,
            })
        })
    }

    /// A buffer that a shader sees whole, or an error that says what does not fit one.
    pub(crate) fn storage(
        &self,
        label: &'static str,
        bytes: u64,
        usage: wgpu::BufferUsages,
    ) -> Result<wgpu::Buffer, GpuError> {
        self.check_storage(label, bytes)?;
        self.buffer(label, bytes, usage)
    }

    /// An error that says what does not fit one binding, if it does not.
    pub(crate) fn check_storage(&self, what: &'static str, bytes: u64) -> Result<(), GpuError> {
        let limit = self.limits().binding_bytes;
        if bytes > limit {
            return Err(GpuError::BindingTooSmall { adapter: self.info().to_string(), what, needed: bytes, limit });
        }
        Ok(())
    }

    /// A buffer with contents.
    ///
    /// # Errors
    /// When memory runs out, or the device refuses.
    pub fn buffer_with(
        &self,
        label: &str,
        contents: &[u8],
        usage: wgpu::BufferUsages,
    ) -> Result<wgpu::Buffer, GpuError> {
        let size = (contents.len() as u64).next_multiple_of(4).max(4);
        let buffer = self.guarded(|| {
            self.device().create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage,
                mapped_at_creation: true,
            })
        })?;
        if !contents.is_empty() {
            let mut view =
                buffer.slice(0..contents.len() as u64).get_mapped_range_mut().map_err(|error| self.refused(&error))?;
            view.copy_from_slice(contents);
        }
        buffer.unmap();
        Ok(buffer)
    }
}
