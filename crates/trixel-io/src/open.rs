//! Opens files to read.

use std::fs::File;
use std::io::{self, Error, ErrorKind};
use std::path::Path;

/// Opens the file at `path`; gives its length, too.
pub(crate) fn open(path: &Path) -> io::Result<(File, u64)> {
    let file = File::open(path)?;
    let metadata = file.metadata()?;
    if metadata.is_dir() {
        // Otherwise only reading fails, and where folders cannot be opened, the system calls it a lack of rights.
        return Err(Error::new(ErrorKind::IsADirectory, "this is a folder; name a file in it"));
    }
    Ok((file, metadata.len()))
}
