//! How much memory there is, and how much was used.

/// Bytes that can still be had without swapping: the machine's, or the container's if that is less.
pub(crate) fn available() -> Option<u64> {
    let mut system = sysinfo::System::new().ok()?;
    system.refresh_memory();
    let machine = system.available_memory();
    let container = system.cgroup_limits().map_or(u64::MAX, |limits| limits.free_memory);
    Some(machine.min(container)).filter(|&bytes| bytes > 0)
}

/// Bytes that voxels may take.
pub(crate) fn available_for_voxels() -> Option<u64> {
    /// Left free for the mesh, the writers and everybody else.
    const RESERVE_BYTES: u64 = 256 << 20;
    available().map(|bytes| bytes.saturating_sub(RESERVE_BYTES))
}

/// The most bytes that this process had resident at once, where the system tells.
pub(crate) fn peak() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024)
}
