//! VTK XML image data (`.vti`): cell data, appended raw, zlib-compressed blocks.
//!
//! The format: VTK File Formats, "XML File Formats". Voxels are cells, so the extent counts one point more than voxels
//! along each axis, and `Origin` is the grid's minimum corner.

use std::io::{self, Seek, SeekFrom, Write};

use trixel::Volume;

use super::WriteOptions;
use super::deflate::{BLOCK_BYTES, Deflater, Framing};
use super::x_fastest;
use crate::numbers::spaced;

/// Writes the volume as the `UInt8` cell array `occupancy`.
pub(super) fn write(volume: &Volume, options: &WriteOptions<'_>, out: &mut (impl Write + Seek)) -> io::Result<()> {
    let grid = volume.grid();
    let [nx, ny, nz] = grid.dims();
    let extent = format!("0 {nx} 0 {ny} 0 {nz}");
    write!(
        out,
        r#"<?xml version="1.0"?>
<VTKFile type="ImageData" version="1.0" byte_order="LittleEndian" header_type="UInt64" compressor="vtkZLibDataCompressor">
  <ImageData WholeExtent="{extent}" Origin="{}" Spacing="{}" Direction="1 0 0 0 1 0 0 0 1">
    <Piece Extent="{extent}">
      <CellData Scalars="occupancy">
        <DataArray type="UInt8" Name="occupancy" format="appended" RangeMin="0" RangeMax="1" offset="0"/>
      </CellData>
    </Piece>
  </ImageData>
  <AppendedData encoding="raw">
    _"#,
        spaced(grid.origin()),
        spaced(grid.voxel_size()),
    )?;
    let block_rows = x_fastest::rows_per_block(volume, BLOCK_BYTES) as u64;
    let rows = u64::from(ny) * u64::from(nz);
    let row_bytes = u64::from(nx);
    let blocks = rows.div_ceil(block_rows);
    // Number of blocks, their size, the last one's size if it is smaller, then each one's compressed size, which is
    // filled in at the end.
    let mut header = vec![blocks, block_rows * row_bytes, rows % block_rows * row_bytes];
    let header_at = out.stream_position()?;
    let header_words = header.len() as u64 + blocks;
    io::copy(&mut io::Read::take(io::repeat(0), header_words * 8), out)?;
    let deflater = Deflater::new(Framing::Zlib);
    x_fastest::for_each_batch(volume, usize::try_from(block_rows).unwrap_or(usize::MAX), |count, fill| {
        deflater.run(count, fill, |_, block| {
            header.push(block.compressed.len() as u64);
            options.report(header.len() as u64, header_words);
            out.write_all(&block.compressed)
        })
    })?;
    out.write_all(b"\n  </AppendedData>\n</VTKFile>\n")?;
    out.seek(SeekFrom::Start(header_at))?;
    for word in &header {
        out.write_all(&word.to_le_bytes())?;
    }
    out.seek(SeekFrom::End(0)).map(drop)
}
