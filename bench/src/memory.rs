//! Memory of this process, as Linux counts it.

/// Physical memory that the process occupies now [MB, 10^6 bytes]; none where `/proc` does not say.
pub fn resident_mb() -> Option<f64> {
    status_mb("VmRSS:")
}

/// The most that it has occupied so far [MB].
pub fn peak_resident_mb() -> Option<f64> {
    status_mb("VmHWM:")
}

/// A line of `/proc/self/status`, which counts in KiB [MB].
fn status_mb(key: &str) -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(key))?;
    let kib: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024.0 / 1e6)
}
