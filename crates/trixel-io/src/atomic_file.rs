//! Files that appear whole or not at all.
//!
//! An [`AtomicFile`] is written under a temporary name in its target's folder and renamed over the target by
//! [`Staged::commit`]; dropped before that, it leaves nothing. A command that writes several outputs stages them all
//! and then commits all. Data is not forced to the disk, so this guards against errors, not against loss of power.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Large enough that runs of small writes cost few system calls.
const BUFFER_BYTES: usize = 1 << 18;

/// A file being written beside its target.
#[derive(Debug)]
pub struct AtomicFile {
    // Declared before `temporary`, so that the file is closed before it is removed (Windows insists).
    writer: BufWriter<File>,
    temporary: Temporary,
    target: PathBuf,
}

/// Finished files that wait for their names. Dropping it removes them.
#[derive(Debug, Default)]
#[must_use = "staged files vanish unless they are committed"]
pub struct Staged {
    files: Vec<(Temporary, PathBuf)>,
}

/// A finished file that could not be given its name.
#[derive(Debug, thiserror::Error)]
#[error("cannot rename the finished file to {}: {source}", path.display())]
pub struct CommitError {
    /// The name it was to get.
    pub path: PathBuf,
    /// What the system said.
    pub source: io::Error,
}

/// A path that is removed when dropped.
#[derive(Debug)]
struct Temporary(PathBuf);

impl Drop for Temporary {
    fn drop(&mut self) {
        // After a successful rename there is nothing to remove; otherwise nobody is left to tell.
        let _ = fs::remove_file(&self.0);
    }
}

impl AtomicFile {
    /// Opens a temporary file in the folder of `target`.
    ///
    /// # Errors
    /// When the target is a folder, or its own folder is missing or cannot be written.
    pub fn create(target: &Path) -> io::Result<Self> {
        /// Tells apart the files of one process.
        static COUNTER: AtomicU64 = AtomicU64::new(0);
        let name =
            target.file_name().ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "the path names no file"))?;
        // Here, so that no output finds out only when others already have their names.
        let ends_in_separator =
            target.as_os_str().as_encoded_bytes().last().is_some_and(|&b| std::path::is_separator(char::from(b)));
        if ends_in_separator || target.is_dir() {
            return Err(io::Error::new(io::ErrorKind::IsADirectory, "the path names a folder; choose another name"));
        }
        if let Some(folder) = target.parent().filter(|folder| !folder.as_os_str().is_empty() && !folder.is_dir()) {
            let what = format!("there is no folder {}; create it first", folder.display());
            return Err(io::Error::new(io::ErrorKind::NotFound, what));
        }
        loop {
            let mut temporary = OsString::from(".");
            temporary.push(name);
            temporary.push(format!(".{}-{}.tmp", std::process::id(), COUNTER.fetch_add(1, Ordering::Relaxed)));
            let temporary = target.with_file_name(temporary);
            match File::create_new(&temporary) {
                Ok(file) => {
                    return Ok(Self {
                        writer: BufWriter::with_capacity(BUFFER_BYTES, file),
                        temporary: Temporary(temporary),
                        target: target.to_owned(),
                    });
                }
                // Left behind by a killed process of the same id: take the next name.
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        }
    }

    /// Writes out what is buffered and closes the file.
    ///
    /// # Errors
    /// When the last bytes cannot be written; the temporary file is then removed.
    pub fn stage(self) -> io::Result<Staged> {
        let Self { mut writer, temporary, target } = self;
        writer.flush()?;
        Ok(Staged { files: vec![(temporary, target)] })
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.writer.write(bytes)
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.writer.write_all(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer.flush()
    }
}

impl Seek for AtomicFile {
    fn seek(&mut self, position: SeekFrom) -> io::Result<u64> {
        self.writer.seek(position)
    }
}

impl Staged {
    /// Adds the files of `other`, to be committed after those of `self`.
    pub fn join(mut self, mut other: Self) -> Self {
        self.files.append(&mut other.files);
        self
    }

    /// Renames every file to its target, replacing what was there.
    ///
    /// # Errors
    /// When a rename fails; files after that one are removed, files before it stay.
    pub fn commit(self) -> Result<(), CommitError> {
        for (temporary, path) in self.files {
            fs::rename(&temporary.0, &path).map_err(|source| CommitError { path, source })?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<OsString> {
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name()).collect()
    }

    #[test]
    fn nothing_appears_before_commit_and_all_after() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("a.bin");
        fs::write(&target, "old").unwrap();
        let mut first = AtomicFile::create(&target).unwrap();
        first.write_all(b"new").unwrap();
        let mut second = AtomicFile::create(&folder.path().join("b.bin")).unwrap();
        second.write_all(b"more").unwrap();
        let staged = first.stage().unwrap().join(second.stage().unwrap());
        assert_eq!(fs::read(&target).unwrap(), b"old");
        staged.commit().unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"new");
        assert_eq!(fs::read(folder.path().join("b.bin")).unwrap(), b"more");
        assert_eq!(names(folder.path()).len(), 2);
    }

    #[test]
    fn dropped_files_leave_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let mut file = AtomicFile::create(&folder.path().join("a.bin")).unwrap();
        file.write_all(b"half").unwrap();
        drop(file);
        drop(AtomicFile::create(&folder.path().join("a.bin")).unwrap().stage().unwrap());
        assert!(names(folder.path()).is_empty());
    }

    #[test]
    fn a_missing_folder_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        assert!(AtomicFile::create(&folder.path().join("missing/a.bin")).is_err());
        assert!(AtomicFile::create(Path::new("/")).is_err());
    }
}
