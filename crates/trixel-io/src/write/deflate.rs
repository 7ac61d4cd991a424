//! Parallel, deterministic deflate.
//!
//! Data comes in blocks that are compressed independently: as pieces of one deflate stream, each ended by a sync flush
//! so that it ends on a byte, or as zlib streams of their own. Where blocks begin never depends on the number of
//! threads, so neither do the bytes.

use std::io::{self, Write};
use std::sync::OnceLock;

use flate2::{Compress, Compression, FlushCompress};
use rayon::prelude::*;

/// Occupancy is long runs of equal bytes: higher levels take several times longer to save little.
const LEVEL: Compression = Compression::new(1);

/// Blocks of about this many bytes are large enough that the dictionary lost between them does not matter and small
/// enough to keep a batch of them in memory.
pub(super) const BLOCK_BYTES: usize = 1 << 20;

/// The end of a deflate stream: an empty last block.
pub(super) const STREAM_END: [u8; 2] = [3, 0];

/// Appends the bytes of a block, by its number.
pub(super) type Fill<'a> = dyn Fn(usize, &mut Vec<u8>) + Sync + 'a;

/// What each block becomes.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Framing {
    /// A piece of one raw deflate stream, which [`STREAM_END`] must end.
    Piece,
    /// A zlib stream of its own.
    Zlib,
}

/// A compressed block.
#[derive(Clone)]
pub(super) struct Block {
    pub(super) compressed: Vec<u8>,
    /// CRC-32 and length of what was compressed; the CRC only of pieces (zlib streams hold their own checksum).
    pub(super) crc: crc32fast::Hasher,
    pub(super) bytes: usize,
}

/// Compresses blocks.
pub(super) struct Deflater {
    framing: Framing,
    /// The first all-zero block: in sparse grids most blocks equal it.
    zeros: OnceLock<Block>,
}

impl Deflater {
    pub(super) fn new(framing: Framing) -> Self {
        Self { framing, zeros: OnceLock::new() }
    }

    /// Compresses the blocks `0..count` in parallel and hands them to `emit` in order, a bounded number at a time.
    pub(super) fn run(
        &self,
        count: usize,
        fill: &Fill<'_>,
        mut emit: impl FnMut(usize, &Block) -> io::Result<()>,
    ) -> io::Result<()> {
        let batch = rayon::current_num_threads() * 8;
        for start in (0..count).step_by(batch) {
            let blocks: Vec<io::Result<Block>> = (start..count.min(start + batch))
                .into_par_iter()
                .map_init(
                    || (Vec::new(), Compress::new(LEVEL, self.framing == Framing::Zlib)),
                    |(bytes, compress), index| {
                        bytes.clear();
                        fill(index, bytes);
                        self.block(bytes, compress)
                    },
                )
                .collect();
            for (index, block) in (start..).zip(blocks) {
                emit(index, &block?)?;
            }
        }
        Ok(())
    }

    fn block(&self, bytes: &[u8], compress: &mut Compress) -> io::Result<Block> {
        let zero = bytes.iter().all(|&byte| byte == 0);
        if zero
            && let Some(block) = self.zeros.get()
            && block.bytes == bytes.len()
        {
            return Ok(block.clone());
        }
        let mut crc = crc32fast::Hasher::new();
        if self.framing == Framing::Piece {
            crc.update(bytes);
        }
        let block = Block { compressed: deflate(bytes, compress, self.framing)?, crc, bytes: bytes.len() };
        if zero {
            // Another thread may have been first, with the same bytes.
            let _ = self.zeros.set(block.clone());
        }
        Ok(block)
    }
}

fn deflate(bytes: &[u8], compress: &mut Compress, framing: Framing) -> io::Result<Vec<u8>> {
    let flush = match framing {
        Framing::Piece => FlushCompress::Sync,
        Framing::Zlib => FlushCompress::Finish,
    };
    compress.reset();
    let mut out = Vec::with_capacity(bytes.len() / 16 + 64);
    loop {
        let consumed = usize::try_from(compress.total_in()).unwrap_or(usize::MAX);
        compress.compress_vec(bytes.get(consumed..).unwrap_or_default(), &mut out, flush).map_err(io::Error::other)?;
        // Room left over means that everything was written.
        if out.len() < out.capacity() {
            return Ok(out);
        }
        out.reserve(out.capacity());
    }
}

/// A deflate stream in the making: writes pieces and keeps their checksum and lengths.
pub(super) struct Stream {
    deflater: Deflater,
    crc: crc32fast::Hasher,
    /// Bytes before compression.
    pub(super) bytes: u64,
    /// Bytes after compression.
    pub(super) compressed: u64,
}

impl Stream {
    pub(super) fn new() -> Self {
        Self { deflater: Deflater::new(Framing::Piece), crc: crc32fast::Hasher::new(), bytes: 0, compressed: 0 }
    }

    /// Compresses the blocks `0..count` and appends them to `out`.
    pub(super) fn append(
        &mut self,
        out: &mut impl Write,
        count: usize,
        fill: &Fill<'_>,
        mut progress: impl FnMut(usize),
    ) -> io::Result<()> {
        let Self { deflater, crc, bytes, compressed } = self;
        deflater.run(count, fill, |index, block| {
            crc.combine(&block.crc);
            *bytes += block.bytes as u64;
            *compressed += block.compressed.len() as u64;
            out.write_all(&block.compressed)?;
            progress(index + 1);
            Ok(())
        })
    }

    /// Ends the stream; gives the CRC-32 of all bytes.
    pub(super) fn finish(&mut self, out: &mut impl Write) -> io::Result<u32> {
        out.write_all(&STREAM_END)?;
        self.compressed += STREAM_END.len() as u64;
        Ok(self.crc.clone().finalize())
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use super::*;

    fn sample(index: usize, out: &mut Vec<u8>) {
        // Zero blocks, runs, and noise that does not compress, of several lengths.
        match index % 3 {
            0 => out.resize(out.len() + 1000, 0),
            1 => out.extend((0..3000).map(|i| u8::from(i % (index + 7) < 3))),
            _ => {
                let mut state = u32::try_from(index).unwrap();
                out.extend((0..70_000).map(|_| {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    state.to_be_bytes()[0]
                }));
            }
        }
    }

    fn expected(count: usize) -> Vec<u8> {
        let mut bytes = Vec::new();
        (0..count).for_each(|index| sample(index, &mut bytes));
        bytes
    }

    #[test]
    fn pieces_make_one_stream_the_same_for_any_number_of_threads() {
        let compress = |threads| {
            rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
                let (mut out, mut stream) = (Vec::new(), Stream::new());
                stream.append(&mut out, 40, &sample, |_| {}).unwrap();
                let crc = stream.finish(&mut out).unwrap();
                assert_eq!((stream.bytes, stream.compressed), (expected(40).len() as u64, out.len() as u64));
                (out, crc)
            })
        };
        let (out, crc) = compress(1);
        assert_eq!((out.clone(), crc), compress(3));
        let mut bytes = Vec::new();
        flate2::read::DeflateDecoder::new(&out[..]).read_to_end(&mut bytes).unwrap();
        assert_eq!(bytes, expected(40));
        assert_eq!(crc, crc32fast::hash(&bytes));
    }

    #[test]
    fn zlib_blocks_stand_alone() {
        let mut bytes = Vec::new();
        Deflater::new(Framing::Zlib)
            .run(9, &sample, |_, block| {
                flate2::read::ZlibDecoder::new(&block.compressed[..]).read_to_end(&mut bytes).map(drop)
            })
            .unwrap();
        assert_eq!(bytes, expected(9));
    }
}
