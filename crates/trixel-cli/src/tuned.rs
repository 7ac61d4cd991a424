//! What `trixel tune` found out, kept in the user's configuration folder.

use std::path::PathBuf;

use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};
use trixel_gpu::{AdapterInfo, Cutoff, Heuristic};
use trixel_io::atomic_file::AtomicFile;

use crate::progress::Reporter;

/// A cutoff for one adapter and driver.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Entry {
    adapter: String,
    driver: String,
    heuristic: String,
    cutoff: f32,
}

impl Entry {
    fn is_for(&self, adapter: &AdapterInfo, heuristic: Heuristic) -> bool {
        self.adapter == adapter.name && self.driver == adapter.driver && self.heuristic == heuristic.name()
    }
}

/// The file, if the system says where configuration goes.
pub(crate) fn path() -> Option<PathBuf> {
    dirs::config_dir().map(|folder| folder.join("trixel").join("cutoffs.json"))
}

fn read() -> Result<Vec<Entry>> {
    let Some(path) = path() else { return Ok(vec![]) };
    match std::fs::read_to_string(&path) {
        Ok(text) => serde_json::from_str(&text)
            .with_context(|| format!("{} is damaged; delete it and run `trixel tune` again", path.display())),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(vec![]),
        Err(error) => Err(error).with_context(|| format!("cannot read {}", path.display())),
    }
}

/// The cutoff stored for an adapter; a file that cannot be read is a warning.
pub(crate) fn load(adapter: &AdapterInfo, heuristic: Heuristic, reporter: &Reporter) -> Option<Cutoff> {
    match read() {
        Ok(entries) => entries
            .iter()
            .find(|entry| entry.is_for(adapter, heuristic))
            .map(|entry| Cutoff { heuristic, value: entry.cutoff }),
        Err(error) => {
            reporter.warn(format!("{error:#}; using the default cutoff"));
            None
        }
    }
}

/// Stores the cutoff of an adapter, and says where.
pub(crate) fn store(adapter: &AdapterInfo, cutoff: Cutoff) -> Result<PathBuf> {
    let path = path().context("this system has no configuration folder to store the cutoff in")?;
    let mut entries = read()?;
    entries.retain(|entry| !entry.is_for(adapter, cutoff.heuristic));
    entries.push(Entry {
        adapter: adapter.name.clone(),
        driver: adapter.driver.clone(),
        heuristic: cutoff.heuristic.name().to_owned(),
        cutoff: cutoff.value,
    });
    let write = || -> Result<()> {
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)?;
        }
        let mut file = AtomicFile::create(&path)?;
        serde_json::to_writer_pretty(&mut file, &entries)?;
        file.stage()?.commit()?;
        Ok(())
    };
    write().with_context(|| format!("cannot write {}", path.display()))?;
    Ok(path)
}
