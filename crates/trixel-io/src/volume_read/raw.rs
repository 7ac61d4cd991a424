//! One byte a voxel, described by a `.json` file beside it.

use std::io;

use serde_json::Value;
use trixel::{Grid, Volume};

use super::elements::{Element, read_z_fastest};
use super::{Failure, Input, LoadedGrid, LoadedVolume, to_dims};

/// A sidecar is a few lines.
const MAX_SIDECAR: u64 = 1 << 16;

/// The file that describes a `.raw` file, or why it cannot be opened.
pub(super) struct Sidecar<'a> {
    /// Its name, for messages.
    pub(super) name: String,
    pub(super) input: io::Result<Input<'a>>,
}

/// Reads the description of `raw_bytes` bytes.
fn read_sidecar(sidecar: Sidecar<'_>, raw_bytes: u64) -> Result<Grid, Failure> {
    let at = format!("sidecar {}", sidecar.name);
    let damaged = |what: String| Failure::damaged(at.clone(), what);
    let input = sidecar
        .input
        .map_err(|error| damaged(format!("{error}; a .raw file needs it, as it holds dims, origin and voxel_size")))?;
    if input.bytes > MAX_SIDECAR {
        return Err(damaged(format!("{} bytes are too many for a description", input.bytes)));
    }
    let value: Value =
        serde_json::from_reader(input.reader).map_err(|error| damaged(format!("{error}; it should be JSON")))?;
    let text = |key: &str, expected: &str| match value.get(key) {
        None => Ok(()),
        Some(found) if found == expected => Ok(()),
        Some(found) => Err(damaged(format!("{key} is {found}, and only \"{expected}\" is read"))),
    };
    text("dtype", "uint8")?;
    text("order", "C")?;
    text("axes", "x,y,z")?;
    let triple = |key: &str| -> Option<[&Value; 3]> {
        <[Value; 3]>::each_ref(value.get(key)?.as_array()?.as_slice().try_into().ok()?).into()
    };
    let floats = |key: &str| -> Result<[f64; 3], Failure> {
        let numbers = triple(key).and_then(|[x, y, z]| Some([x.as_f64()?, y.as_f64()?, z.as_f64()?]));
        numbers.ok_or_else(|| damaged(format!("{key} should be three numbers")))
    };
    let dims = triple("dims")
        .and_then(|[x, y, z]| Some([x.as_u64()?, y.as_u64()?, z.as_u64()?]))
        .ok_or_else(|| damaged("dims should be three whole numbers".to_owned()))?;
    let grid = Grid::new(floats("origin")?, floats("voxel_size")?, to_dims(dims)?)?;
    if raw_bytes != grid.voxel_count() {
        let what = format!("it describes {} voxels, but the .raw file has {raw_bytes} bytes", grid.voxel_count());
        return Err(damaged(what));
    }
    Ok(grid)
}

pub(super) fn grid(input: &Input<'_>, sidecar: Sidecar<'_>) -> Result<LoadedGrid, Failure> {
    Ok(LoadedGrid { grid: read_sidecar(sidecar, input.bytes)?, warnings: Vec::new() })
}

pub(super) fn volume(
    input: Input<'_>,
    sidecar: Sidecar<'_>,
    memory_limit: Option<u64>,
) -> Result<LoadedVolume, Failure> {
    let grid = read_sidecar(sidecar, input.bytes)?;
    let mut volume = Volume::with_memory_limit(grid, memory_limit)?;
    read_z_fastest(input.reader, Element::BYTE, &mut volume)?;
    Ok(LoadedVolume { volume, warnings: Vec::new() })
}
