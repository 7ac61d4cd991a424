//! `trixel verify`: recompute a volume and compare.

use std::io::Write;
use std::process::ExitCode;

use anyhow::{Result, ensure};
use trixel::lattice::LatticeMesh;
use trixel::{Mode, Topology, Volume};
use trixel_io::volume_read::read_volume;

use crate::args::VerifyArgs;
use crate::engine::{Engine, Task};
use crate::progress::Reporter;
use crate::voxelize::{ContextOf, allocate, check_method, job, set_threads, warn_if_open};
use crate::{memory, mesh};

pub(crate) fn run(args: &VerifyArgs) -> Result<ExitCode> {
    check_method(&args.method);
    set_threads(args.method.threads)?;
    let reporter = Reporter::new(false);
    let (loaded, _) = reporter.stage("reading the volume", || read_volume(&args.volume, memory::available()));
    let loaded = loaded?;
    loaded.warnings.iter().for_each(|warning| reporter.warn(format!("{}: {warning}", args.volume.display())));
    let given = loaded.volume;
    let (mesh, _) = reporter.stage("reading the mesh", || mesh::load(&args.mesh, false, &reporter));
    let mesh = mesh?;
    let job = job(&args.method, *given.grid())?;
    if job.mode() == Mode::Solid {
        warn_if_open(Some(&Topology::of(&mesh)), &reporter);
    }
    let (expected, _) = reporter.stage("voxelizing", || -> Result<Volume> {
        let lattice = LatticeMesh::snap(&mesh, job.grid()).with_context_of(&args.mesh)?;
        let mut volume = allocate(&job)?;
        let task = Task {
            mesh: &mesh,
            lattice: &lattice,
            job: &job,
            fill: args.method.fill.into(),
            repeat: 1,
            attributes: None,
            list_method: None,
        };
        Engine::open(&args.method, &reporter)?.run(&task, &mut volume, &reporter)?;
        Ok(volume)
    });
    let expected = expected?;
    reporter.finish();
    ensure!(given.words().len() == expected.words().len(), "the volumes differ in size");

    let missing = Difference::new(&expected, &given);
    let extra = Difference::new(&given, &expected);
    let mut out = std::io::stdout().lock();
    // A reader that went away is no reason to fail: the exit status says it all.
    let _ = missing.print(&mut out, "missing", args.list);
    let _ = extra.print(&mut out, "extra", args.list);
    let equal = missing.count == 0 && extra.count == 0;
    let _ = writeln!(
        out,
        "{}: {} set, {} expected ({}), {} missing, {} extra: {}",
        args.volume.display(),
        given.count(),
        expected.count(),
        job.mode(),
        missing.count,
        extra.count,
        if equal { "equal" } else { "different" }
    );
    Ok(if equal { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The voxels of one volume that another lacks.
struct Difference<'a> {
    of: &'a Volume,
    without: &'a Volume,
    count: u64,
}

impl<'a> Difference<'a> {
    fn new(of: &'a Volume, without: &'a Volume) -> Self {
        let pairs = of.words().iter().zip(without.words());
        let count = pairs.map(|(a, b)| u64::from((a & !b).count_ones())).sum();
        Self { of, without, count }
    }

    fn print(&self, out: &mut impl Write, name: &str, most: usize) -> std::io::Result<()> {
        if self.count == 0 {
            return Ok(());
        }
        for voxel in self.of.iter().filter(|&voxel| !self.without.get(voxel)).take(most) {
            let [x, y, z] = voxel;
            let [cx, cy, cz] = self.of.grid().center(voxel);
            writeln!(out, "{name} voxel [{x}, {y}, {z}], centre ({cx}, {cy}, {cz})")?;
        }
        let rest = self.count.saturating_sub(most as u64);
        if rest > 0 {
            writeln!(out, "... and {rest} more {name} (--list N shows more)")?;
        }
        Ok(())
    }
}
