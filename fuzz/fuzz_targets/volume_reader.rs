//! What every target of a volume format does: reads the bytes as a volume and holds the reader to its promises.

use trixel_io::VolumeFormat;
use trixel_io::volume_read::read_volume_bytes;

/// Far below the fuzzer's own limit, so that a reader that does not keep it is noticed.
const MEMORY_LIMIT: u64 = 64 << 20;

pub fn read(format: VolumeFormat, bytes: &[u8], sidecar: Option<&[u8]>) {
    let Ok(loaded) = read_volume_bytes(format, bytes, sidecar, Some(MEMORY_LIMIT)) else { return };
    let volume = loaded.volume;
    assert!(volume.words().len() as u64 * 8 <= MEMORY_LIMIT, "the memory limit is kept");
    let tail = volume.grid().dims()[2] % 64;
    if tail != 0 {
        for column in volume.words().chunks(volume.column_words()) {
            assert_eq!(column.last().expect("columns have words") >> tail, 0, "no bit is set above the grid");
        }
    }
}
