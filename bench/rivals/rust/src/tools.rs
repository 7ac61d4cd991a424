//! The tools that are Rust crates, each told its best settings.

use std::error::Error;
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use dda_voxelize::DdaVoxelizer;
use parry3d_f64::math::Vector;
use parry3d_f64::transformation::voxelization::{FillMode, VoxelSet};
use trixel::{Job, Volume};
use trixel_io::read::{ReadOptions, read_mesh};

use crate::case::{Case, mode};

/// Milliseconds of reading the mesh, by tools that can.
pub fn load(tool: &str, folder: &Path) -> Result<Option<f64>, Box<dyn Error>> {
    if tool != "trixel" {
        return Ok(None);
    }
    let start = Instant::now();
    black_box(read_mesh(&folder.join("mesh.ply"), &ReadOptions { attributes: false })?);
    Ok(Some(start.elapsed().as_secs_f64() * 1e3))
}

/// How long something took, and how long the processors worked on it: on a shared machine the better number.
pub struct Took {
    pub wall_ms: f64,
    pub cpu_ms: f64,
}

struct Clock {
    start: Instant,
    cpu: f64,
}

impl Clock {
    fn start() -> Self {
        Self { start: Instant::now(), cpu: cpu_ms() }
    }

    fn stop(&self) -> Took {
        Took { wall_ms: self.start.elapsed().as_secs_f64() * 1e3, cpu_ms: cpu_ms() - self.cpu }
    }
}

/// What all threads have worked so far.
fn cpu_ms() -> f64 {
    let tasks = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let worked = tasks.filter_map(|task| {
        let text = std::fs::read_to_string(task.path().join("schedstat")).ok()?;
        text.split(' ').next()?.parse::<f64>().ok()
    });
    worked.sum::<f64>() * 1e-6
}

/// The voxels, and how long the tool took from arrays in memory to voxels in its own form.
pub fn voxelize(tool: &str, case: &Case, mode_name: &str) -> Result<(Volume, Took), Box<dyn Error>> {
    match (tool, mode_name) {
        ("trixel", _) => {
            let (mesh, job) = (case.mesh(), Job::new(case.grid, mode(mode_name)?));
            let clock = Clock::start();
            let volume = trixel::voxelize(&mesh, &job)?;
            Ok((volume, clock.stop()))
        }
        ("parry3d", _) => parry(case, mode_name),
        ("dda-voxelize", "conservative") => dda(case),
        _ => Err(format!("{tool} has no mode {mode_name}").into()),
    }
}

/// Voxels have their centres on multiples of the size from the lowest point on: one more point, of no triangle, puts these
/// where the grid has them.
fn parry(case: &Case, mode: &str) -> Result<(Volume, Took), Box<dyn Error>> {
    let mut points: Vec<Vector> = case.vertices.iter().map(|[x, y, z]| Vector::new(*x, *y, *z)).collect();
    points.push(Vector::new(-0.5, -0.5, -0.5));
    let fill = if mode == "solid" { FillMode::FloodFill { detect_cavities: false } } else { FillMode::SurfaceOnly };
    let clock = Clock::start();
    let set = VoxelSet::with_voxel_size(&points, &case.triangles, 1.0, fill, false);
    let took = clock.stop();
    let mut volume = Volume::new(case.grid)?;
    for voxel in set.voxels() {
        let at = [voxel.coords.x, voxel.coords.y, voxel.coords.z];
        set_if_inside(&mut volume, at.map(|c| i64::from(c) - 1));
    }
    Ok((volume, took))
}

/// Voxels have their centres on integers.
fn dda(case: &Case) -> Result<(Volume, Took), Box<dyn Error>> {
    let moved: Vec<[f32; 3]> = case.vertices.iter().map(|vertex| vertex.map(|c| (c - 0.5) as f32)).collect();
    let clock = Clock::start();
    let mut voxelizer = DdaVoxelizer::<()>::new();
    for triangle in &case.triangles {
        voxelizer.add_triangle(&triangle.map(|i| moved[i as usize]), &|_: Option<&()>, _, _| ());
    }
    let found = voxelizer.finalize();
    let took = clock.stop();
    let mut volume = Volume::new(case.grid)?;
    for at in found.keys() {
        set_if_inside(&mut volume, at.map(i64::from));
    }
    Ok((volume, took))
}

fn set_if_inside(volume: &mut Volume, at: [i64; 3]) {
    let dims = volume.grid().dims();
    if let [Ok(x), Ok(y), Ok(z)] = at.map(u32::try_from)
        && x < dims[0]
        && y < dims[1]
        && z < dims[2]
    {
        volume.set([x, y, z]);
    }
}
