//! How fast mesh files are read: `cargo run --release -p trixel-io --example read_speed FILE...`
//!
//! Prints, for each file, the median of eleven readings with attributes and without, from the system's file cache.

#![allow(clippy::print_stdout, reason = "an example that prints its result")]

use std::path::Path;
use std::time::Instant;

use trixel_io::read::{ReadError, ReadOptions, read_mesh};

fn median_ms(path: &Path, options: &ReadOptions) -> Result<f64, ReadError> {
    let mut times = Vec::new();
    for _ in 0..11 {
        let start = Instant::now();
        let loaded = read_mesh(path, options)?;
        times.push(start.elapsed().as_secs_f64() * 1e3);
        drop(loaded);
    }
    times.sort_by(f64::total_cmp);
    Ok(times[times.len() / 2])
}

fn main() -> Result<(), ReadError> {
    for path in std::env::args_os().skip(1) {
        let path = Path::new(&path);
        let loaded = read_mesh(path, &ReadOptions::default())?;
        let all = median_ms(path, &ReadOptions::default())?;
        let bare = median_ms(path, &ReadOptions { attributes: false })?;
        let (vertices, triangles) = (loaded.mesh.positions.len(), loaded.mesh.triangles.len());
        println!(
            "{}: {vertices} vertices, {triangles} triangles, {all:.1} ms, {bare:.1} ms without attributes",
            path.display()
        );
        for warning in loaded.warnings {
            println!("    {warning}");
        }
    }
    Ok(())
}
