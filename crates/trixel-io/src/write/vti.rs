//! VTK XML image data (`.vti`): cell data, appended raw, zlib-compressed blocks.
//!
//! The format: VTK File Formats, "XML File Formats". Voxels are cells, so the extent counts one point more than voxels
//! along each axis, and `Origin` is the grid's minimum corner.

use std::io::{self, Seek, SeekFrom, Write};

use trixel::Volume;
use trixel::attributes::{AttributeKind, Described, Values};

use super::WriteOptions;
use super::deflate::{BLOCK_BYTES, Deflater, Framing};
use super::x_fastest;
use crate::numbers::spaced;

/// Digits that an array's place in the file has room for: it is known only once the arrays before it are compressed.
const OFFSET_DIGITS: usize = 20;

/// Writes the volume as the `UInt8` cell array `occupancy`, and each attribute as an array under its name. Voxels that are
/// not set have zeros, and 2^32 - 1 for ids.
pub(super) fn write(volume: &Volume, options: &WriteOptions<'_>, out: &mut (impl Write + Seek)) -> io::Result<()> {
    let grid = volume.grid();
    let [nx, ny, nz] = grid.dims();
    let extent = format!("0 {nx} 0 {ny} 0 {nz}");
    let columns = options.described.map_or(&[][..], |described| described.attributes().columns());
    let scalars = if columns.iter().any(|(kind, _)| *kind == AttributeKind::Color) { "color" } else { "occupancy" };
    write!(
        out,
        r#"<?xml version="1.0"?>
<VTKFile type="ImageData" version="1.0" byte_order="LittleEndian" header_type="UInt64" compressor="vtkZLibDataCompressor">
  <ImageData WholeExtent="{extent}" Origin="{}" Spacing="{}" Direction="1 0 0 0 1 0 0 0 1">
    <Piece Extent="{extent}">
      <CellData Scalars="{scalars}">
        <DataArray type="UInt8" Name="occupancy" format="appended" RangeMin="0" RangeMax="1" offset="0"/>
"#,
        spaced(grid.origin()),
        spaced(grid.voxel_size()),
    )?;
    let mut offsets = Vec::new();
    for (kind, values) in columns {
        let (dtype, channels) = values.layout();
        let numbers = match dtype {
            "|u1" => "UInt8",
            "<u4" => "UInt32",
            _ => "Float32",
        };
        write!(
            out,
            r#"        <DataArray type="{numbers}" Name="{}" NumberOfComponents="{channels}" format="appended" offset=""#,
            kind.name()
        )?;
        offsets.push(out.stream_position()?);
        writeln!(out, r#"{}"/>"#, "0".repeat(OFFSET_DIGITS))?;
    }
    write!(
        out,
        r#"      </CellData>
    </Piece>
  </ImageData>
  <AppendedData encoding="raw">
    _"#
    )?;
    let start = out.stream_position()?;
    let rows = u64::from(ny) * u64::from(nz);
    let block_rows = x_fastest::rows_per_block(volume, BLOCK_BYTES);
    let layout = Layout { rows, row_bytes: u64::from(nx), block_rows: block_rows as u64 };
    layout.write(out, |deflater, out, sizes| {
        x_fastest::for_each_batch(volume, block_rows, |count, fill| {
            deflater.run(count, fill, |_, block| {
                sizes.push(block.compressed.len() as u64);
                options.report(sizes.len() as u64, layout.blocks());
                out.write_all(&block.compressed)
            })
        })
    })?;
    for (described, ((_, values), offset)) in options.described.iter().cycle().zip(columns.iter().zip(offsets)) {
        let at = out.stream_position()?;
        out.seek(SeekFrom::Start(offset))?;
        write!(out, "{:0OFFSET_DIGITS$}", at - start)?;
        out.seek(SeekFrom::Start(at))?;
        write_attribute(described, values, out)?;
    }
    out.write_all(b"\n  </AppendedData>\n</VTKFile>\n")
}

/// Writes the values of one attribute, x fastest.
fn write_attribute(described: &Described<'_>, values: &Values, out: &mut (impl Write + Seek)) -> io::Result<()> {
    let volume = described.rank().volume();
    let [nx, ny, nz] = volume.grid().dims();
    let (rows, row_bytes) = (ny as usize * nz as usize, nx as usize * values.row_bytes());
    let block_rows = (BLOCK_BYTES / row_bytes).max(1);
    let layout = Layout { rows: rows as u64, row_bytes: row_bytes as u64, block_rows: block_rows as u64 };
    let fill = |block: usize, out: &mut Vec<u8>| {
        out.reserve(block_rows * row_bytes);
        for row in block * block_rows..rows.min((block + 1) * block_rows) {
            // Both are below 2^15.
            let [y, z] = [row % ny as usize, row / ny as usize].map(|i| u32::try_from(i).unwrap_or(u32::MAX));
            for x in 0..nx {
                match described.row([x, y, z]) {
                    Some(row) => values.append_row(row, out),
                    None => values.append_nothing(out),
                }
            }
        }
    };
    layout.write(out, |deflater, out, sizes| {
        deflater.run(rows.div_ceil(block_rows), &fill, |_, block| {
            sizes.push(block.compressed.len() as u64);
            out.write_all(&block.compressed)
        })
    })
}

/// An array as VTK cuts it into compressed blocks.
#[derive(Clone, Copy)]
struct Layout {
    rows: u64,
    row_bytes: u64,
    /// Rows of every block but the last.
    block_rows: u64,
}

impl Layout {
    fn blocks(self) -> u64 {
        self.rows.div_ceil(self.block_rows)
    }

    /// Writes the array: a header, filled in at the end, and the blocks that `body` writes and whose sizes it collects.
    fn write<W: Write + Seek>(
        self,
        out: &mut W,
        body: impl FnOnce(&Deflater, &mut W, &mut Vec<u64>) -> io::Result<()>,
    ) -> io::Result<()> {
        let header_at = out.stream_position()?;
        io::copy(&mut io::Read::take(io::repeat(0), (3 + self.blocks()) * 8), out)?;
        let mut sizes = Vec::new();
        body(&Deflater::new(Framing::Zlib), out, &mut sizes)?;
        let end = out.stream_position()?;
        out.seek(SeekFrom::Start(header_at))?;
        // Number of blocks, their size, the last one's size if it is smaller, then each one's compressed size.
        let header = [self.blocks(), self.block_rows * self.row_bytes, self.rows % self.block_rows * self.row_bytes];
        for word in header.iter().chain(&sizes) {
            out.write_all(&word.to_le_bytes())?;
        }
        out.seek(SeekFrom::Start(end)).map(drop)
    }
}
