//! Volumes by name, and outputs by extension.

use std::path::Path;

use crate::out_of_core::is_zarr;
use anyhow::{Result, anyhow, ensure};
use trixel::{Grid, Volume};
use trixel_io::VolumeFormat;
use trixel_io::atomic_file::{AtomicFile, Staged};
use trixel_io::write::{WriteOptions, check_target, write_volume};
use trixel_render::{PreviewOptions, render_colored_preview, render_preview};

fn is_picture(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png"))
}

/// Refuses an output that nothing here writes, before anything is read.
pub(crate) fn check_extension(path: &Path) -> Result<()> {
    let known = VolumeFormat::ALL.map(|format| format!(".{}", format.extension())).join(", ");
    ensure!(
        is_picture(path) || is_zarr(path) || VolumeFormat::from_path(path).is_some(),
        "{}: unknown volume format; trixel writes {known}, .zarr and .png",
        path.display()
    );
    Ok(())
}

/// Finds out before the work whether the output could be written after it.
pub(crate) fn check_output(path: &Path, grid: &Grid) -> Result<()> {
    if is_picture(path) {
        // Dropped at once, which removes it.
        AtomicFile::create(path).map(drop).map_err(|error| cannot_write(path, &error))
    } else {
        Ok(check_target(path, grid)?)
    }
}

/// Writes one output beside its target.
pub(crate) fn stage_output(path: &Path, volume: &Volume, options: &WriteOptions<'_>) -> Result<Staged> {
    if is_picture(path) { stage_picture(path, volume, options) } else { Ok(write_volume(path, volume, options)?) }
}

fn stage_picture(path: &Path, volume: &Volume, options: &WriteOptions<'_>) -> Result<Staged> {
    let view = PreviewOptions { up: options.up, ..PreviewOptions::default() };
    let picture = match &options.described {
        Some(described) => {
            let shown = described.without_cut_out()?;
            // Deep inside a solid there is no surface to have a colour.
            let color = |voxel| described.color(voxel).map(|[r, g, b, _]| [r, g, b]);
            render_colored_preview(shown.as_ref().unwrap_or(volume), &color, &view)?
        }
        None => render_preview(volume, &view)?,
    };
    let mut file = AtomicFile::create(path).map_err(|error| cannot_write(path, &error))?;
    picture.encode_png(&mut file).map_err(|error| cannot_write(path, &error))?;
    file.stage().map_err(|error| cannot_write(path, &error))
}

/// An output that failed, with the reason in the message.
pub(crate) fn cannot_write(path: &Path, error: &dyn std::fmt::Display) -> anyhow::Error {
    anyhow!("cannot write {}: {error}", path.display())
}

/// The bounding box of the set voxels, as first and last index along each axis; `None` when none is set.
pub(crate) fn occupied(volume: &Volume) -> Option<[[u32; 3]; 2]> {
    let mut occupied: Option<[[u32; 3]; 2]> = None;
    let [nx, ny, _] = volume.grid().dims();
    for x in 0..nx {
        for y in 0..ny {
            let column = volume.column(x, y);
            let (Some(low), Some(high)) = (lowest(column), highest(column)) else { continue };
            let [from, to] = occupied.get_or_insert([[x, y, low], [x, y, high]]);
            *from = [from[0].min(x), from[1].min(y), from[2].min(low)];
            *to = [to[0].max(x), to[1].max(y), to[2].max(high)];
        }
    }
    occupied
}

fn lowest(column: &[u64]) -> Option<u32> {
    (0u32..).zip(column).find(|&(_, &word)| word != 0).map(|(i, word)| i * 64 + word.trailing_zeros())
}

fn highest(column: &[u64]) -> Option<u32> {
    let words = (0u32..).zip(column).filter(|&(_, &word)| word != 0);
    words.last().map(|(i, word)| i * 64 + 63 - word.leading_zeros())
}
