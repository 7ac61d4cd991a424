//! Voxelizing what does not fit the memory: meshes read in passes, grids computed tile by tile and written as they are
//! done, as Zarr v3; a run that was killed goes on where it was.
//!
//! The grid is cut along x into *slabs*, as thick as the memory allows for the triangles that meet one; a slab into rows
//! of shards, one task each. Which voxels are set depends on none of this.
//!
//! The result grows in a folder `NAME.partial` beside its target, with a journal of what is done, and gets its name when
//! it is complete.
//!
//! ```
//! use trixel::{CpuBackend, Grid, Job, Mode};
//! use trixel_io::out_of_core::{OutOfCore, Plan, Source};
//! # let folder = tempfile::tempdir()?;
//! # let folder = folder.path();
//! let mesh = trixel::scene::build("sphere:32")?;
//! let job = Job::new(Grid::fit(&mesh.bounds().ok_or("empty")?, 500)?, Mode::Solid);
//! let backend = CpuBackend::default();
//! let plan = Plan::new(Source::Mesh(&mesh), &job, backend.threads(), 0, 1 << 30)?;
//! println!("{plan}");
//! let run = OutOfCore { source: Source::Mesh(&mesh), job: &job, plan: &plan, backend: &backend, input: "sphere" };
//! let done = run.write(&folder.join("sphere.zarr"), false, &|_| {})?;
//! assert!(done.voxels > 60_000_000);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod journal;
mod plan;
mod source;
mod zarr;

use std::io;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde_json::json;
use trixel::lattice::LatticeMesh;
use trixel::{BrickMap, Bytes, CpuBackend, Job, Mode, Occupancy};

use crate::read::ReadError;
use journal::{Done, Journal};
use plan::Slab;
use source::Soup;
use zarr::ZarrWriter;

pub use plan::Plan;
pub use source::Source;

/// The journal in the folder of an unfinished result.
const JOURNAL: &str = "trixel-journal";

/// Why an out-of-core voxelization failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OutOfCoreError {
    /// The mesh's file.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The mesh or the job.
    #[error(transparent)]
    Voxelize(#[from] trixel::Error),
    /// A vertex cannot be placed on the lattice.
    #[error(
        "triangle {triangle} has a corner at ({}, {}, {}), which is not finite or more than 16,777,216 voxels away from \
         the grid's origin; remove it, or use larger voxels",
        position[0], position[1], position[2]
    )]
    Position {
        /// Index of the triangle.
        triangle: u64,
        /// The corner.
        position: [f64; 3],
    },
    /// Nothing fits the limit.
    #[error(
        "a memory limit of {} is too small: this mesh and grid take {} before the first triangle; raise it, or use \
         fewer threads",
        Bytes(*limit), Bytes(*needed)
    )]
    Limit {
        /// The limit.
        limit: u64,
        /// Bytes needed.
        needed: u64,
    },
    /// One layer of the grid does not fit.
    #[error(
        "64 layers of voxels along x, the least that is in memory at a time, meet {triangles} triangles, which takes {}; \
         raise the memory limit, or choose a finer grid",
        Bytes(*bytes)
    )]
    Layer {
        /// Triangles that meet the layers.
        triangles: u64,
        /// Bytes needed.
        bytes: u64,
    },
    /// The mesh's file is not what it was.
    #[error("the mesh's file changed while it was read; run the command again")]
    Changed,
    /// There is something where the result is to be.
    #[error("{} exists already; remove it first, or choose another name", path.display())]
    Exists {
        /// The result's folder.
        path: PathBuf,
    },
    /// There is nothing to go on with.
    #[error("there is no unfinished result {}; run without --resume", path.display())]
    NothingToResume {
        /// Where it was looked for.
        path: PathBuf,
    },
    /// The unfinished result is of another job.
    #[error(
        "{} is the unfinished result of another job or of a mesh that has changed since; repeat the first command with \
         --resume, or run without it to start again",
        path.display()
    )]
    AnotherJob {
        /// The unfinished result.
        path: PathBuf,
    },
    /// The result could not be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// What the system or the storage library said.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}

/// One out-of-core voxelization.
#[derive(Clone, Copy, Debug)]
pub struct OutOfCore<'a> {
    /// The triangles.
    pub source: Source<'a>,
    /// What to voxelize into and how.
    pub job: &'a Job,
    /// How the work is cut.
    pub plan: &'a Plan,
    /// Who computes.
    pub backend: &'a CpuBackend,
    /// Names the mesh and its state, such as path, size and date, so that nothing is resumed with another.
    pub input: &'a str,
}

/// What was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Written {
    /// Voxels that are set.
    pub voxels: u64,
    /// Tiles that an earlier run had done.
    pub resumed: u64,
}

/// Where an unfinished result of `target` is: `NAME.partial` beside it.
#[must_use]
pub fn partial_path(target: &Path) -> PathBuf {
    let mut name = target.file_name().unwrap_or_default().to_owned();
    name.push(".partial");
    target.with_file_name(name)
}

impl OutOfCore<'_> {
    /// Voxelizes and writes the folder `target`; with `resume`, goes on with what an earlier run has left. `progress` gets
    /// the fraction that is done, from any thread.
    ///
    /// # Errors
    /// When the mesh cannot be read, the result cannot be written or exists, or there is nothing to resume. What is done
    /// stays for `resume`.
    pub fn write(
        &self,
        target: &Path,
        resume: bool,
        progress: &(dyn Fn(f32) + Sync),
    ) -> Result<Written, OutOfCoreError> {
        check_target(target)?;
        let partial = partial_path(target);
        let (journal, mut done) = if resume { self.resume(&partial)? } else { (self.start(&partial)?, Done::new()) };
        let resumed = done.len() as u64;
        let grid = self.job.grid();
        let failed = |source| OutOfCoreError::Write { path: partial.clone(), source };
        let writer = ZarrWriter::create(&partial, grid, Some(self.job.mode())).map_err(failed)?;
        let total = u64::from(self.plan.rows[0]) * u64::from(self.plan.rows[1]);
        let report = |done: usize| {
            #[expect(clippy::cast_precision_loss, reason = "a fraction for people")]
            progress(done as f32 / total.max(1) as f32);
        };
        report(done.len());
        let whole = match self.source {
            Source::Mesh(mesh) => Some(LatticeMesh::snap(mesh, grid).map_err(trixel::Error::from)?),
            Source::Stream(_) => None,
        };
        for slab in &self.plan.slabs {
            let rows = slab.layers.clone().flat_map(|x| (0..self.plan.rows[1]).map(move |y| [x, y]));
            let rows: Vec<[u32; 2]> = rows.filter(|row| !done.contains_key(row)).collect();
            if rows.is_empty() {
                continue;
            }
            let mut indices = Vec::new();
            let of_slab;
            let lattice = match (self.source, &whole) {
                (Source::Stream(stream), _) => {
                    let soup = Soup::read(stream, grid, &slab.layers, slab.triangles, self.plan.wide)?;
                    of_slab = soup.into_lattice(&mut indices);
                    &of_slab
                }
                (Source::Mesh(_), Some(whole)) => whole,
                (Source::Mesh(_), None) => continue,
            };
            let counts = self.write_slab(slab, &rows, lattice, &writer, &journal, &|more| report(done.len() + more));
            done.extend(rows.into_iter().zip(counts.map_err(failed)?));
        }
        let voxels = done.values().sum();
        let failed =
            |path: &Path, source: io::Error| OutOfCoreError::Write { path: path.to_owned(), source: source.into() };
        let journal = partial.join(JOURNAL);
        std::fs::remove_file(&journal).map_err(|error| failed(&journal, error))?;
        std::fs::rename(&partial, target).map_err(|error| failed(target, error))?;
        Ok(Written { voxels, resumed })
    }

    /// Voxelizes and writes rows of a slab; gives the number of voxels of each.
    fn write_slab(
        &self,
        slab: &Slab,
        rows: &[[u32; 2]],
        lattice: &LatticeMesh<'_>,
        writer: &ZarrWriter,
        journal: &Journal,
        progress: &(dyn Fn(usize) + Sync),
    ) -> Result<Vec<u64>, Box<dyn std::error::Error + Send + Sync>> {
        let binned = self.backend.bin(lattice, self.job, slab.layers.clone())?;
        let written = std::sync::atomic::AtomicUsize::new(0);
        self.backend.install(|| {
            let work = |buffer: &mut Vec<u8>, &[x, y]: &[u32; 2]| {
                // Pillar by pillar: the rows are what keeps the threads busy.
                let ys = ZarrWriter::pillars_of_row(self.job.grid(), y);
                let bricks: BrickMap = binned.voxelize(x..x + 1, ys);
                writer.write_row([x, y], &bricks, buffer)?;
                let voxels = bricks.count();
                journal.note([x, y], voxels)?;
                progress(written.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1);
                Ok(voxels)
            };
            rows.par_iter().with_max_len(1).map_init(Vec::new, work).collect()
        })
    }

    /// One line that names all that the result depends on.
    fn fingerprint(&self) -> String {
        let grid = self.job.grid();
        json!({
            "trixel": env!("CARGO_PKG_VERSION"),
            "input": self.input,
            "triangles": self.source.triangle_count(),
            "origin": grid.origin(),
            "voxel_size": grid.voxel_size(),
            "dims": grid.dims(),
            "mode": self.job.mode().name(),
            "overlap_steps": self.job.overlap_steps(),
        })
        .to_string()
    }

    fn start(&self, partial: &Path) -> Result<Journal, OutOfCoreError> {
        let failed = |source: io::Error| OutOfCoreError::Write { path: partial.to_owned(), source: source.into() };
        if partial.join(JOURNAL).is_file() {
            // Ours, as the journal shows.
            std::fs::remove_dir_all(partial).map_err(failed)?;
        }
        std::fs::create_dir(partial).map_err(failed)?;
        Journal::create(&partial.join(JOURNAL), &self.fingerprint()).map_err(failed)
    }

    fn resume(&self, partial: &Path) -> Result<(Journal, Done), OutOfCoreError> {
        let failed = |source: io::Error| OutOfCoreError::Write { path: partial.to_owned(), source: source.into() };
        match Journal::resume(&partial.join(JOURNAL)).map_err(failed)? {
            None => Err(OutOfCoreError::NothingToResume { path: partial.to_owned() }),
            Some((_, job, _)) if job != self.fingerprint() => {
                Err(OutOfCoreError::AnotherJob { path: partial.to_owned() })
            }
            Some((journal, _, done)) => Ok((journal, done)),
        }
    }
}

/// Refuses a target that exists, or whose folder does not.
///
/// # Errors
/// As [`OutOfCore::write`] would.
pub fn check_target(target: &Path) -> Result<(), OutOfCoreError> {
    if target.exists() {
        return Err(OutOfCoreError::Exists { path: target.to_owned() });
    }
    let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if !folder.is_dir() {
        let what = format!("there is no folder {}; create it first", folder.display());
        return Err(OutOfCoreError::Write { path: target.to_owned(), source: what.into() });
    }
    Ok(())
}

/// Writes voxels that are in memory as the folder `target`, as [`OutOfCore::write`] would.
///
/// # Errors
/// When the target exists or cannot be written.
pub fn write_voxels(target: &Path, voxels: &impl Occupancy, mode: Option<Mode>) -> Result<(), OutOfCoreError> {
    check_target(target)?;
    let partial = partial_path(target);
    let failed = |source| OutOfCoreError::Write { path: partial.clone(), source };
    let writer = ZarrWriter::create(&partial, voxels.grid(), mode).map_err(failed)?;
    let [rows_x, rows_y] = ZarrWriter::rows(voxels.grid());
    let rows: Vec<[u32; 2]> = (0..rows_x).flat_map(|x| (0..rows_y).map(move |y| [x, y])).collect();
    rows.par_iter()
        .map_init(Vec::new, |buffer, &row| writer.write_row(row, voxels, buffer))
        .collect::<Result<(), _>>()
        .map_err(failed)?;
    std::fs::rename(&partial, target).map_err(|error| failed(error.into()))
}
