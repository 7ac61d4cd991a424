//! What was measured, as it is stored.

use serde::{Deserialize, Serialize};
use trixel_gpu::Counters;

/// The version of the stored form; a change that old readers would misread raises it.
pub const SCHEMA: u32 = 1;

/// The columns that \[CL\] table 1 compares.
pub(crate) const SLICED: (&str, &str) = ("gpu", "sliced");
pub(crate) const SLICE_PER_PASS: (&str, &str) = ("gpu", "slice-per-pass");

/// Everything that one run of the benchmark measured.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Results {
    /// [`SCHEMA`].
    pub schema: u32,
    /// The version of trixel.
    pub trixel: String,
    /// When, in seconds since 1970.
    pub unix_time: u64,
    /// On what.
    pub machine: Machine,
    /// The GPU adapter, if there was one.
    pub adapter: Option<Adapter>,
    /// The mode of all cells.
    pub mode: String,
    /// One for each mesh, resolution and strategy.
    pub cells: Vec<Cell>,
    /// Times over the hybrid's cutoff.
    pub sweeps: Vec<Sweep>,
    /// The methods of listing voxels, if they were measured.
    #[serde(default)]
    pub lists: Vec<ListCell>,
}

/// The machine.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Machine {
    /// The processor's name.
    pub cpu: String,
    /// Threads that the CPU backend used.
    pub threads: usize,
    /// The operating system.
    pub system: String,
}

/// A GPU adapter.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Adapter {
    /// Its name.
    pub name: String,
    /// Its driver and version.
    pub driver: String,
    /// Whether it is a program on the CPU.
    pub software: bool,
    /// The tier of shaders.
    pub tier: String,
}

/// One mesh, resolution and strategy.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Cell {
    /// The mesh.
    pub mesh: String,
    /// Its triangles.
    pub triangles: u64,
    /// Voxels along the grid's longest side.
    pub resolution: u32,
    /// `cpu` or `gpu`.
    pub backend: String,
    /// The strategy.
    pub strategy: String,
    /// Of the hybrids: from which projected area on, in square voxels, a triangle is large.
    pub cutoff: Option<f32>,
    /// Runs that were timed.
    pub runs: usize,
    /// The median time, in milliseconds, without upload and download.
    pub median_ms: f64,
    /// The shortest.
    pub min_ms: f64,
    /// The longest.
    pub max_ms: f64,
    /// Time of each pass on the device in the last run, where the adapter has timestamps.
    pub passes_ms: Vec<(String, f64)>,
    /// What the shaders counted, if that was asked for.
    pub counters: Option<Counters>,
    /// Set voxels.
    pub voxels: u64,
    /// Voxels that differ from the CPU's.
    pub wrong_voxels: u64,
}

/// One mesh, resolution and method of listing its voxels.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ListCell {
    /// The mesh.
    pub mesh: String,
    /// Its triangles.
    pub triangles: u64,
    /// Voxels along the grid's longest side.
    pub resolution: u32,
    /// The method.
    pub method: String,
    /// Runs that were timed.
    pub runs: usize,
    /// The median time of voxelizing and listing together, in milliseconds.
    pub median_ms: f64,
    /// The shortest.
    pub min_ms: f64,
    /// The longest.
    pub max_ms: f64,
    /// Voxels in the list.
    pub voxels: u64,
    /// The most bytes in use at any time beside the mesh: bits where there are any, the list, and what making it takes.
    pub memory_bytes: u64,
    /// Entries that differ from the CPU's.
    pub wrong_entries: u64,
}

/// The hybrid's time over its cutoff.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Sweep {
    /// The mesh.
    pub mesh: String,
    /// Voxels along the grid's longest side.
    pub resolution: u32,
    /// Cutoff in square voxels of projected area, and the median time in milliseconds.
    pub samples: Vec<(f32, f64)>,
}

impl Results {
    /// The meshes, in the order in which they were measured.
    #[must_use]
    pub fn meshes(&self) -> Vec<&str> {
        in_order(self.cells.iter().map(|cell| cell.mesh.as_str()))
    }

    /// The columns of the table: backends with their strategies.
    #[must_use]
    pub fn columns(&self) -> Vec<(&str, &str)> {
        in_order(self.cells.iter().map(|cell| (cell.backend.as_str(), cell.strategy.as_str())))
    }

    /// The resolutions of a mesh.
    #[must_use]
    pub fn resolutions(&self, mesh: &str) -> Vec<u32> {
        in_order(self.cells.iter().filter(|cell| cell.mesh == mesh).map(|cell| cell.resolution))
    }

    /// One cell.
    #[must_use]
    pub fn cell(&self, mesh: &str, resolution: u32, (backend, strategy): (&str, &str)) -> Option<&Cell> {
        self.cells.iter().find(|cell| {
            cell.mesh == mesh && cell.resolution == resolution && cell.backend == backend && cell.strategy == strategy
        })
    }

    /// How many times as long the whole mesh once per slice takes as each triangle in its own slices: \[CL\] table 1.
    #[must_use]
    pub fn slicing_ratio(&self, mesh: &str, resolution: u32) -> Option<f64> {
        let time = |column| self.cell(mesh, resolution, column).map(|cell| cell.median_ms);
        time(SLICED).zip(time(SLICE_PER_PASS)).map(|(sliced, per_pass)| per_pass / sliced)
    }

    /// Voxels that differ from the CPU's, over all cells and lists.
    #[must_use]
    pub fn wrong_voxels(&self) -> u64 {
        let lists: u64 = self.lists.iter().map(|cell| cell.wrong_entries).sum();
        self.cells.iter().map(|cell| cell.wrong_voxels).sum::<u64>() + lists
    }

    /// The adapter in words, and that it is no GPU where it is none.
    #[must_use]
    pub fn adapter_line(&self) -> String {
        match &self.adapter {
            None => "no GPU adapter".to_owned(),
            Some(Adapter { name, driver, software, tier }) => {
                let kind = if *software { "SOFTWARE adapter: its times say nothing of GPUs; " } else { "" };
                format!("{kind}{name} ({driver}; tier {tier})")
            }
        }
    }
}

/// Each value once, where it came first.
fn in_order<T: PartialEq>(values: impl Iterator<Item = T>) -> Vec<T> {
    let mut seen = vec![];
    for value in values {
        if !seen.contains(&value) {
            seen.push(value);
        }
    }
    seen
}
