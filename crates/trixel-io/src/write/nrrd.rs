//! NRRD (`.nrrd`), gzip-compressed: <https://teem.sourceforge.net/nrrd/format.html>.
//!
//! By the format, and as 3D Slicer and pynrrd users expect, `space origin` is the *centre* of the first voxel, whatever
//! the centering. The grid's corner is half a voxel from it, which rounds; the key/value pair `trixel origin` keeps it
//! to the last bit, for readers that know it.

use std::io::{self, Write};

use trixel::Volume;

use super::WriteOptions;
use super::deflate::{BLOCK_BYTES, Stream};
use super::x_fastest;
use crate::numbers::spaced;

/// A gzip header without name or time.
const GZIP_HEADER: [u8; 10] = [0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 255];

/// Writes the volume as unsigned bytes 0 and 1, x fastest.
pub(super) fn write(volume: &Volume, options: &WriteOptions<'_>, out: &mut impl Write) -> io::Result<()> {
    let grid = volume.grid();
    let [nx, ny, nz] = grid.dims();
    let [hx, hy, hz] = grid.voxel_size();
    let center = grid.center([0; 3]);
    write!(
        out,
        "NRRD0005\n\
         # voxel occupancy: 1 is set\n\
         type: uint8\n\
         dimension: 3\n\
         space: 3D-right-handed\n\
         sizes: {nx} {ny} {nz}\n\
         space directions: ({hx:?},0,0) (0,{hy:?},0) (0,0,{hz:?})\n\
         centers: cell cell cell\n\
         kinds: space space space\n\
         encoding: gzip\n\
         space origin: ({:?},{:?},{:?})\n\
         trixel origin:={}\n\
         \n",
        center[0],
        center[1],
        center[2],
        spaced(grid.origin()),
    )?;
    out.write_all(&GZIP_HEADER)?;
    let mut stream = Stream::new();
    let block_rows = x_fastest::rows_per_block(volume, BLOCK_BYTES);
    x_fastest::for_each_batch(volume, block_rows, |count, fill| {
        stream.append(out, count, fill, |_| {})?;
        options.report(stream.bytes, grid.voxel_count());
        Ok(())
    })?;
    let crc = stream.finish(out)?;
    out.write_all(&crc.to_le_bytes())?;
    // The length modulo 2^32, as gzip has it.
    out.write_all(&stream.bytes.to_le_bytes()[..4])
}
