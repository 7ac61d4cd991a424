//! The parts of the comparison that are in Rust: `rivals prepare MESH RESOLUTION FOLDER` writes a mesh in voxel units with
//! every vertex on trixel's lattice, and the exact voxels; `rivals measure TOOL FOLDER MODE SECONDS` prints one JSON object.

mod case;
mod tools;

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use case::Case;
use serde_json::json;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["prepare", mesh, resolution, folder] => case::prepare(mesh, resolution.parse()?, Path::new(folder)),
        ["measure", tool, folder, mode, seconds] => measure(tool, Path::new(folder), mode, seconds.parse()?),
        _ => Err("usage: rivals prepare MESH RESOLUTION FOLDER | measure TOOL FOLDER MODE SECONDS".into()),
    }
}

/// Runs a tool until the time is used up, at least once and at most eleven times.
fn measure(tool: &str, folder: &Path, mode: &str, seconds: f64) -> Result<(), Box<dyn Error>> {
    let load_ms = tools::load(tool, folder)?;
    let case = Case::read(folder)?;
    // From here on the peak counts anew.
    std::fs::write("/proc/self/clear_refs", "5")?;
    let before = status_bytes("VmRSS:");
    let (mut times, mut cpu_times) = (vec![], vec![]);
    let start = Instant::now();
    let found = loop {
        let (found, took) = tools::voxelize(tool, &case, mode)?;
        times.push(took.wall_ms);
        cpu_times.push(took.cpu_ms);
        if times.len() == 11 || start.elapsed().as_secs_f64() > seconds {
            break found;
        }
    };
    let peak = status_bytes("VmHWM:");
    let [missing, extra] = case.compare(mode, &found)?;
    let result = json!({
        "load_ms": load_ms, "times_ms": times, "cpu_ms": cpu_times, "before_bytes": before, "peak_bytes": peak, "missing": missing, "extra": extra,
    });
    println!("{result}");
    Ok(())
}

/// A number of bytes that the system keeps of this process; 0 where it does not.
fn status_bytes(name: &str) -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix(name));
    line.and_then(|line| line.trim().trim_end_matches(" kB").parse::<u64>().ok()).unwrap_or(0) * 1024
}
