//! Which GPU: finding, naming and choosing adapters.

use crate::error::GpuError;
use crate::tier::Tier;

/// What is known about an adapter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdapterInfo {
    /// The device's name.
    pub name: String,
    /// The driver and its version.
    pub driver: String,
    /// The graphics interface: `vulkan`, `metal`, `dx12` or `webgpu`.
    pub backend: String,
    /// Whether the "GPU" is a program on the CPU.
    pub software: bool,
    /// The best tier of shaders that it allows; of an open device, the one in use.
    pub tier: Tier,
}

impl AdapterInfo {
    pub(crate) fn new(info: &wgpu::AdapterInfo, features: wgpu::Features) -> Self {
        let driver = format!("{} {}", info.driver, info.driver_info);
        Self {
            name: info.name.clone(),
            driver: driver.trim().to_owned(),
            backend: info.backend.to_str().to_owned(),
            software: info.device_type == wgpu::DeviceType::Cpu,
            tier: Tier::best(features),
        }
    }

    fn matches(&self, wanted: &str) -> bool {
        let wanted = wanted.to_lowercase();
        [&self.name, &self.driver].iter().any(|text| text.to_lowercase().contains(&wanted))
    }
}

impl std::fmt::Display for AdapterInfo {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} ({}, {}, {}", self.name, self.driver, self.backend, self.tier.name())?;
        f.write_str(if self.software { ", software)" } else { ")" })
    }
}

/// Which adapter to take.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum AdapterChoice {
    /// The first real GPU, discrete before integrated; never a software adapter.
    #[default]
    Hardware,
    /// The first real GPU, or else a software adapter.
    Any,
    /// The first adapter whose name or driver contains this, in any case.
    Named(String),
}

fn instance() -> wgpu::Instance {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::PRIMARY;
    // Arguments of indirect calls are written by trixel's own shaders, within the limits; a tenth of a millisecond for each
    // to be looked at again is much on a small mesh. Direct3D needs the look, or it gives no number of workgroups.
    if !cfg!(windows) {
        descriptor.flags.remove(wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL);
    }
    wgpu::Instance::new(descriptor)
}

fn enumerate(instance: &wgpu::Instance) -> Vec<(wgpu::Adapter, AdapterInfo)> {
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
    let rank = |adapter: &wgpu::Adapter| match adapter.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    };
    let mut adapters: Vec<_> = adapters.into_iter().map(|adapter| (rank(&adapter), adapter)).collect();
    adapters.sort_by_key(|(rank, _)| *rank);
    adapters
        .into_iter()
        .map(|(_, adapter)| {
            let info = AdapterInfo::new(&adapter.get_info(), adapter.features());
            (adapter, info)
        })
        .collect()
}

/// Every adapter of this machine, in the order in which [`AdapterChoice::Any`] considers them.
#[must_use]
pub fn adapters() -> Vec<AdapterInfo> {
    enumerate(&instance()).into_iter().map(|(_, info)| info).collect()
}

/// Whether this machine may have a real GPU, without asking any driver, which takes a good part of a second. Linux has a
/// device file for each.
#[must_use]
pub fn hardware_is_possible() -> bool {
    !cfg!(target_os = "linux")
        || ["/dev/dri/renderD128", "/dev/nvidiactl", "/dev/dxg", "/dev/kfd", "/dev/mali0"]
            .iter()
            .any(|file| std::path::Path::new(file).exists())
}

/// The adapter of choice.
pub(crate) fn choose(choice: &AdapterChoice) -> Result<(wgpu::Adapter, AdapterInfo), GpuError> {
    let there = enumerate(&instance());
    let names = || there.iter().map(|(_, info)| info.to_string()).collect::<Vec<_>>();
    if there.is_empty() {
        return Err(GpuError::NoAdapter);
    }
    let found = match choice {
        AdapterChoice::Hardware => there.iter().find(|(_, info)| !info.software),
        AdapterChoice::Any => there.first(),
        AdapterChoice::Named(wanted) => there.iter().find(|(_, info)| info.matches(wanted)),
    };
    found.cloned().ok_or_else(|| match choice {
        AdapterChoice::Named(wanted) => GpuError::NoSuchAdapter { wanted: wanted.clone(), there: names() },
        _ => GpuError::OnlySoftware(names()),
    })
}
