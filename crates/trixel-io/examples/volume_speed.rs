//! How fast volumes are written and read back: `cargo run --release -p trixel-io --example volume_speed [SIDE [EXTENSION...]]`
//!
//! The volume is a solid ball that fills a cube of SIDE voxels (512 unless given). Prints for each format, or for the
//! given ones (`sparse` is a sparse `.npz`), the file's size and the median time of three writings and readings. Files go
//! to the system's folder for temporary files.

#![allow(clippy::print_stdout, reason = "an example that prints its result")]

use std::error::Error;
use std::time::Instant;

use trixel::{Grid, Volume};
use trixel_io::VolumeFormat;
use trixel_io::volume_read::read_volume;
use trixel_io::write::{WriteOptions, write_volume};

fn ball(side: u32) -> Result<Volume, Box<dyn Error>> {
    let mut volume = Volume::new(Grid::new([0.0; 3], [1.0; 3], [side; 3])?)?;
    let column_words = volume.column_words();
    let center = |i: u32| (f64::from(i) + 0.5) / f64::from(side) * 2.0 - 1.0;
    let columns = volume.words_mut().chunks_mut(column_words);
    for (column, [x, y]) in columns.zip((0..side).flat_map(|x| (0..side).map(move |y| [x, y]))) {
        let room = 1.0 - center(x).powi(2) - center(y).powi(2);
        for z in (0..side).filter(|&z| center(z).powi(2) <= room) {
            column[z as usize / 64] |= 1 << (z % 64);
        }
    }
    Ok(volume)
}

fn median_seconds<T>(mut run: impl FnMut() -> Result<T, Box<dyn Error>>) -> Result<(f64, T), Box<dyn Error>> {
    let mut times = Vec::new();
    loop {
        let start = Instant::now();
        let result = run()?;
        times.push(start.elapsed().as_secs_f64());
        if times.len() == 3 {
            times.sort_by(f64::total_cmp);
            return Ok((times[1], result));
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let side = arguments.first().map_or(Ok(512), |side| side.parse())?;
    let volume = ball(side)?;
    println!("{side}^3, {} voxels set, {} threads", volume.count(), std::thread::available_parallelism()?);
    let dense = VolumeFormat::ALL.map(|format| (format.extension(), format, false));
    for (name, format, sparse) in dense.into_iter().chain([("sparse", VolumeFormat::Npz, true)]) {
        if arguments.len() > 1 && !arguments[1..].iter().any(|wanted| wanted == name) {
            continue;
        }
        let file = format!("trixel-speed-{}.{}", std::process::id(), format.extension());
        let path = std::env::temp_dir().join(file);
        let options = WriteOptions { sparse, ..WriteOptions::default() };
        let (write, ()) = median_seconds(|| Ok(write_volume(&path, &volume, &options)?.commit()?))?;
        let megabytes = f64::from(u32::try_from(std::fs::metadata(&path)?.len() >> 10)?) / 1024.0;
        print!("{name:>7}: {megabytes:8.2} MiB, written in {write:.3} s");
        if format.is_readable() {
            let (read, loaded) = median_seconds(|| Ok(read_volume(&path, None)?))?;
            assert!(loaded.volume.words() == volume.words(), "{name} gave other voxels back");
            print!(", read in {read:.3} s");
        }
        println!();
        std::fs::remove_file(&path)?;
        if format == VolumeFormat::Raw {
            std::fs::remove_file(path.with_extension("json"))?;
        }
    }
    Ok(())
}
