//! NumPy archives: a ZIP file of deflated `.npy` files.
//!
//! Own code, because the archive crates compress one entry on one thread and cannot take a stream that was deflated in
//! parallel. The container needed here is small: deflated entries, no encryption, no data descriptors, ZIP64 where
//! sizes ask for it (PKWARE's APPNOTE 6.3, sections 4.3.7 to 4.3.16).

use std::io::{self, Seek, SeekFrom, Write};

use trixel::{Grid, Occupancy, Volume};

use super::deflate::{Fill, Stream};
use super::dense::DenseBlocks;
use super::little_endian::{put16, put32, put64};
use super::npy_header::npy_header;
use super::sparse_blocks::SparseBlocks;
use super::{WriteOptions, columns};

/// The time stamp of every entry, the earliest there is (1980-01-01), so that equal volumes give equal files.
const DOS_DATE: u16 = 1 << 5 | 1;
/// Entries at least this large get 64-bit sizes. Below 2^32 by more than deflate can add to data that does not compress.
const ZIP64_FROM: u64 = 0xf000_0000;
const FITS_32: u64 = u32::MAX as u64;
const DEFLATED: u16 = 8;

/// Writes an `.npz` file array by array.
///
/// Arrays are produced in chunks that are filled and compressed in parallel, so none has to exist as a whole. Attributes
/// of voxels are further arrays.
///
/// ```
/// use trixel_io::write::NpzWriter;
/// let mut npz = NpzWriter::new(std::io::Cursor::new(Vec::new()));
/// npz.array("origin", "<f8", &[3], 1, &|_, out| out.extend([1.0f64; 3].iter().flat_map(|v| v.to_le_bytes())), &mut |_| {})?;
/// let bytes = npz.finish()?.into_inner();
/// assert_eq!(&bytes[..2], b"PK");
/// # Ok::<(), std::io::Error>(())
/// ```
pub struct NpzWriter<W> {
    out: W,
    position: u64,
    entries: Vec<Entry>,
}

struct Entry {
    name: String,
    offset: u64,
    crc: u32,
    compressed: u64,
    bytes: u64,
    zip64: bool,
}

impl<W: Write + Seek> NpzWriter<W> {
    /// An archive that starts at the beginning of `out`.
    #[must_use]
    pub fn new(out: W) -> Self {
        Self { out, position: 0, entries: Vec::new() }
    }

    /// Adds the array `name` of NumPy type `dtype` (as in `descr`: `|b1`, `<i4`, `<f8`, `<U16`), in C order. `fill` is called
    /// once for each of the `chunks` in any order, on several threads, and appends that chunk's bytes; the chunks in
    /// order must make up the array. `progress` gets the number of chunks that are written.
    ///
    /// # Errors
    /// When `out` fails, or the chunks do not add up to the shape.
    pub fn array(
        &mut self,
        name: &str,
        dtype: &str,
        shape: &[u64],
        chunks: usize,
        fill: &(dyn Fn(usize, &mut Vec<u8>) + Sync),
        progress: &mut dyn FnMut(usize),
    ) -> io::Result<()> {
        let header = npy_header(dtype, shape);
        let item: u64 = dtype.trim_start_matches(|c: char| !c.is_ascii_digit()).parse().unwrap_or(0);
        // The characters of a text take four bytes each.
        let item = if dtype.contains('U') { 4 * item } else { item };
        let bytes =
            shape.iter().fold(item, |product, &n| product.saturating_mul(n)).saturating_add(header.len() as u64);
        let mut entry = Entry {
            name: format!("{name}.npy"),
            offset: self.position,
            crc: 0,
            compressed: 0,
            bytes,
            zip64: bytes >= ZIP64_FROM,
        };
        let local = entry.local_header();
        self.out.write_all(&local)?;
        let mut stream = Stream::new();
        stream.append(&mut self.out, 1, &|_, out| out.extend(&header), |_| {})?;
        let fill: &Fill<'_> = fill;
        stream.append(&mut self.out, chunks, fill, progress)?;
        entry.crc = stream.finish(&mut self.out)?;
        entry.compressed = stream.compressed;
        if stream.bytes != bytes {
            let message = format!("array {name}: {} bytes were produced for a shape that takes {bytes}", stream.bytes);
            return Err(io::Error::new(io::ErrorKind::InvalidInput, message));
        }
        // The checksum and compressed size are known only now.
        self.position += local.len() as u64 + stream.compressed;
        self.out.seek(SeekFrom::Start(entry.offset))?;
        self.out.write_all(&entry.local_header())?;
        self.out.seek(SeekFrom::Start(self.position))?;
        self.entries.push(entry);
        Ok(())
    }

    /// Adds a small array of `f64`.
    fn floats(&mut self, name: &str, values: &[f64]) -> io::Result<()> {
        let fill = |_, out: &mut Vec<u8>| out.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        self.array(name, "<f8", &[values.len() as u64], 1, &fill, &mut |_| {})
    }

    /// Writes the directory and gives the output back.
    ///
    /// # Errors
    /// When the output fails.
    pub fn finish(mut self) -> io::Result<W> {
        let mut directory = Vec::new();
        for entry in &self.entries {
            entry.directory_record(&mut directory);
        }
        let (count, size, offset) = (self.entries.len() as u64, directory.len() as u64, self.position);
        if offset > FITS_32 {
            let end = offset + size;
            put32(&mut directory, 0x0606_4b50);
            put64(&mut directory, 44); // what follows of this record
            put16(&mut directory, 45); // made by
            put16(&mut directory, 45); // needed to read
            put32(&mut directory, 0); // this disk
            put32(&mut directory, 0); // the directory's disk
            put64(&mut directory, count); // entries on this disk
            put64(&mut directory, count); // entries
            put64(&mut directory, size);
            put64(&mut directory, offset);
            put32(&mut directory, 0x0706_4b50);
            put32(&mut directory, 0); // disk of the record above
            put64(&mut directory, end); // its place
            put32(&mut directory, 1); // disks
        }
        put32(&mut directory, 0x0605_4b50);
        put16(&mut directory, 0); // this disk
        put16(&mut directory, 0); // the directory's disk
        put16(&mut directory, u16::try_from(count).unwrap_or(u16::MAX)); // entries on this disk
        put16(&mut directory, u16::try_from(count).unwrap_or(u16::MAX)); // entries
        put32(&mut directory, saturate(size));
        put32(&mut directory, saturate(offset));
        put16(&mut directory, 0); // comment
        self.out.write_all(&directory)?;
        self.out.flush()?;
        Ok(self.out)
    }
}

impl Entry {
    fn needed_version(&self) -> u16 {
        if self.zip64 || self.offset > FITS_32 { 45 } else { 20 }
    }

    fn local_header(&self) -> Vec<u8> {
        let mut out = Vec::new();
        put32(&mut out, 0x0403_4b50);
        put16(&mut out, self.needed_version());
        self.common_fields(&mut out);
        put16(&mut out, if self.zip64 { 20 } else { 0 }); // extra field
        out.extend(self.name.as_bytes());
        if self.zip64 {
            put16(&mut out, 1);
            put16(&mut out, 16);
            put64(&mut out, self.bytes);
            put64(&mut out, self.compressed);
        }
        out
    }

    fn directory_record(&self, out: &mut Vec<u8>) {
        let far = self.offset > FITS_32;
        put32(out, 0x0201_4b50);
        put16(out, self.needed_version()); // made by
        put16(out, self.needed_version());
        self.common_fields(out);
        let extra = if self.zip64 { 16 } else { 0 } + if far { 8 } else { 0 };
        put16(out, if extra > 0 { extra + 4 } else { 0 });
        put16(out, 0); // comment
        put16(out, 0); // disk
        put16(out, 0); // internal attributes
        put32(out, 0); // external attributes
        put32(out, saturate(self.offset));
        out.extend(self.name.as_bytes());
        if extra > 0 {
            put16(out, 1);
            put16(out, extra);
        }
        if self.zip64 {
            put64(out, self.bytes);
            put64(out, self.compressed);
        }
        if far {
            put64(out, self.offset);
        }
    }

    /// From the flags to the length of the name.
    fn common_fields(&self, out: &mut Vec<u8>) {
        put16(out, 0); // flags
        put16(out, DEFLATED);
        put16(out, 0); // time
        put16(out, DOS_DATE);
        put32(out, self.crc);
        put32(out, if self.zip64 { u32::MAX } else { saturate(self.compressed) });
        put32(out, if self.zip64 { u32::MAX } else { saturate(self.bytes) });
        put16(out, u16::try_from(self.name.len()).unwrap_or(u16::MAX));
    }
}

/// The 32-bit field of a value; the largest stands for "see the 64-bit field".
fn saturate(value: u64) -> u32 {
    u32::try_from(value).unwrap_or(u32::MAX)
}

/// Writes `occupancy` (bool, `[x, y, z]`), `origin` and `voxel_size` (f64[3]). Attributes follow under their names.
pub(super) fn write(volume: &Volume, options: &WriteOptions<'_>, out: &mut (impl Write + Seek)) -> io::Result<()> {
    let mut npz = NpzWriter::new(out);
    let blocks = DenseBlocks::new(volume);
    let mut progress = |done| options.report(done as u64, blocks.count() as u64);
    let fill = |index, out: &mut Vec<u8>| blocks.fill(index, out);
    npz.array("occupancy", "|b1", &volume.grid().dims().map(u64::from), blocks.count(), &fill, &mut progress)?;
    finish(npz, volume.grid(), options, false)
}

/// Writes `indices` (i32, N x 3, sorted by x, y, z), `dims` (i32[3]), `origin` and `voxel_size` (f64[3]). Attributes follow
/// under their names.
pub(super) fn write_sparse(
    voxels: &impl Occupancy,
    options: &WriteOptions<'_>,
    out: &mut (impl Write + Seek),
) -> io::Result<()> {
    let grid = voxels.grid();
    let mut npz = NpzWriter::new(out);
    let blocks = SparseBlocks::new(voxels);
    let mut progress = |done| options.report(done as u64, blocks.count() as u64);
    let fill = |index, out: &mut Vec<u8>| {
        blocks.for_each(index, |voxel| out.extend_from_slice(voxel.map(u32::to_le_bytes).as_flattened()));
    };
    npz.array("indices", "<i4", &[blocks.voxel_count(), 3], blocks.count(), &fill, &mut progress)?;
    let dims = |_, out: &mut Vec<u8>| out.extend(grid.dims().iter().flat_map(|n| n.to_le_bytes()));
    npz.array("dims", "<i4", &[3], 1, &dims, &mut |_| {})?;
    finish(npz, grid, options, true)
}

fn finish(
    mut npz: NpzWriter<impl Write + Seek>,
    grid: &Grid,
    options: &WriteOptions<'_>,
    sparse: bool,
) -> io::Result<()> {
    if let Some(described) = options.described {
        columns::write(&described, sparse, &mut npz)?;
    }
    npz.floats("origin", &grid.origin())?;
    npz.floats("voxel_size", &grid.voxel_size())?;
    npz.finish().map(drop)
}

#[cfg(test)]
mod tests {
    use std::io::{Cursor, Read};

    use super::*;

    #[test]
    fn zip64_fields_are_understood() {
        // Entries marked as huge, though they are small: what differs is only the layout of sizes.
        let mut entry = Entry { name: "a.npy".into(), offset: 0, crc: 0, compressed: 0, bytes: 0, zip64: true };
        let mut npz = NpzWriter::new(Cursor::new(Vec::new()));
        let data = b"some bytes";
        let mut stream = Stream::new();
        let mut body = Vec::new();
        stream.append(&mut body, 1, &|_, out| out.extend(data), |_| {}).unwrap();
        entry.crc = stream.finish(&mut body).unwrap();
        (entry.compressed, entry.bytes) = (stream.compressed, stream.bytes);
        npz.out.write_all(&entry.local_header()).unwrap();
        npz.out.write_all(&body).unwrap();
        npz.position = npz.out.position();
        npz.entries.push(entry);
        let bytes = npz.finish().unwrap();
        let mut archive = zip::ZipArchive::new(bytes).unwrap();
        let mut read = Vec::new();
        archive.by_name("a.npy").unwrap().read_to_end(&mut read).unwrap();
        assert_eq!(read, data);
    }

    #[test]
    fn a_wrong_amount_of_data_is_an_error() {
        let mut npz = NpzWriter::new(Cursor::new(Vec::new()));
        assert!(npz.array("a", "<i4", &[2], 1, &|_, out| out.extend([0; 7]), &mut |_| {}).is_err());
    }
}
