//! The `.json` file beside a `.raw` file, which says what its bytes are.

use std::io::{self, Write};
use std::path::Path;

use serde_json::json;
use trixel::Volume;

/// Writes `NAME.json` for `NAME.raw` (whose bytes [`super::dense::write_raw`] writes).
pub(super) fn write_sidecar(volume: &Volume, raw: &Path, out: &mut impl Write) -> io::Result<()> {
    let grid = volume.grid();
    let sidecar = json!({
        "file": raw.file_name().map(|name| name.to_string_lossy()),
        "dims": grid.dims(),
        "origin": grid.origin(),
        "voxel_size": grid.voxel_size(),
        "dtype": "uint8",
        "order": "C",
        "axes": "x,y,z",
        "count": volume.count(),
    });
    serde_json::to_writer_pretty(&mut *out, &sidecar)?;
    out.write_all(b"\n")
}
