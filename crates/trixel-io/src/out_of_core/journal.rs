//! What is done already: a file beside the unfinished result, a line for each row of shards.
//!
//! A line is appended after its row's files are written, so a killed process loses at most the rows it was at. A line
//! that was cut by the kill has no end and does not count.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// Rows that are done, and how many voxels each has.
pub(super) type Done = BTreeMap<[u32; 2], u64>;

/// The journal of a run.
pub(super) struct Journal {
    file: Mutex<File>,
}

impl Journal {
    /// Starts the journal of `job`, which describes the work in one line.
    pub(super) fn create(path: &Path, job: &str) -> io::Result<Self> {
        let mut file = File::create(path)?;
        file.write_all(format!("{job}\n").as_bytes())?;
        Ok(Self { file: Mutex::new(file) })
    }

    /// Goes on with a journal; gives the job that it is of, and what is done. `None` if there is none, or not even its
    /// first line.
    pub(super) fn resume(path: &Path) -> io::Result<Option<(Self, String, Done)>> {
        let text = match std::fs::read_to_string(path) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(error),
        };
        let whole = text.rfind('\n').map_or(0, |end| end + 1);
        let mut lines = text[..whole].lines();
        let Some(job) = lines.next() else { return Ok(None) };
        let done = lines.filter_map(parse).collect();
        let file = OpenOptions::new().write(true).open(path)?;
        // What a kill has cut goes away, so that the next line starts on its own.
        file.set_len(whole as u64)?;
        drop(file);
        let file = OpenOptions::new().append(true).open(path)?;
        Ok(Some((Self { file: Mutex::new(file) }, job.to_owned(), done)))
    }

    /// Notes that a row is done.
    pub(super) fn note(&self, [x, y]: [u32; 2], voxels: u64) -> io::Result<()> {
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.write_all(format!("{x} {y} {voxels}\n").as_bytes())
    }
}

fn parse(line: &str) -> Option<([u32; 2], u64)> {
    let mut words = line.split(' ');
    let (x, y, voxels) = (words.next()?, words.next()?, words.next()?);
    Some(([x.parse().ok()?, y.parse().ok()?], voxels.parse().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_a_kill_has_cut_does_not_count() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        assert!(Journal::resume(&path).unwrap().is_none());
        let journal = Journal::create(&path, "a job").unwrap();
        journal.note([3, 4], 50).unwrap();
        journal.note([3, 5], 0).unwrap();
        drop(journal);
        let mut file = OpenOptions::new().append(true).open(&path).unwrap();
        file.write_all(b"3 6 12").unwrap();
        let (journal, job, done) = Journal::resume(&path).unwrap().unwrap();
        assert_eq!((job.as_str(), done), ("a job", Done::from([([3, 4], 50), ([3, 5], 0)])));
        journal.note([7, 8], 9).unwrap();
        drop(journal);
        let (_, _, done) = Journal::resume(&path).unwrap().unwrap();
        assert_eq!(done, Done::from([([3, 4], 50), ([3, 5], 0), ([7, 8], 9)]));
    }
}
