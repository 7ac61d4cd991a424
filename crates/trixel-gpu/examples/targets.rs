//! Several values of each voxel in the pass that finds the voxels, and what they cost: strategy `tiled` without render
//! targets, with one and with three, beside the same value by way of attributes.
//!
//! ```sh
//! cargo run --release -p trixel-gpu --example targets -- MESH RESOLUTION [ADAPTER]
//! ```

#![expect(clippy::print_stdout, reason = "an example")]

use std::path::Path;
use std::time::Instant;

use trixel::attributes::{AttributeKind, AttributeRequest, Combine};
use trixel::lattice::LatticeMesh;
use trixel::{Grid, Job, Mesh, Mode, Strategy, VoxelOrder};
use trixel_gpu::{
    AdapterChoice, Gpu, GpuMesh, GpuSurface, GpuVolume, GpuVoxelList, ListMethod, Options, PassTime, Target, Voxelizer,
};

const RUNS: usize = 9;

fn load(name: &str) -> Result<Mesh, Box<dyn std::error::Error>> {
    match name.strip_prefix("scene:") {
        Some(scene) => Ok(trixel::scene::build(scene)?),
        None => Ok(trixel_io::read::read_mesh(Path::new(name), &Default::default())?.mesh),
    }
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times.get(times.len() / 2).copied().unwrap_or(0.0)
}

/// Milliseconds of the passes of the last run that find and blend voxels.
fn tile_pass(passes: &[PassTime]) -> f64 {
    passes.iter().filter(|pass| pass.name == "tiled").map(|pass| pass.ms).sum()
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let mesh = load(&arguments.next().unwrap_or_else(|| "scene:torus".to_owned()))?;
    let resolution = arguments.next().map_or(Ok(256), |number| number.parse())?;
    let gpu = Gpu::open(&arguments.next().map_or(AdapterChoice::Any, AdapterChoice::Named))?;

    let grid = Grid::fit(&mesh.bounds().ok_or("the mesh is empty")?, resolution)?;
    let job = Job::new(grid, Mode::Conservative).with_strategy(Strategy::Tiled);
    let lattice = LatticeMesh::snap(&mesh, &grid)?;
    let on_gpu = GpuMesh::upload(&gpu, &lattice)?;
    let request = AttributeRequest::new(&[AttributeKind::Triangle], Combine::First);
    let surface = GpuSurface::upload(&gpu, &mesh, &lattice, &grid, &request)?;
    let voxels = GpuVolume::new(&gpu, grid)?;
    let mut voxelizer = Voxelizer::new(&gpu, &job, &Options::default())?;

    // Anything that a program knows of its triangles.
    let priorities: Vec<u32> = mesh.triangles.iter().map(|triangle| triangle[0] % 100).collect();
    let three = [Target::ID, Target::COUNT, Target::max(&priorities)];

    let names = ["bits", "bits and list", "1 target", "3 targets", "attribute `triangle`"];
    let mut times = names.map(|_| (vec![], vec![]));
    let mut shown = String::new();
    // The first round builds pipelines and buffers.
    for round in 0..=RUNS {
        for (i, (whole, pass)) in times.iter_mut().enumerate() {
            let start = Instant::now();
            match i {
                2 | 3 => {
                    let found = voxelizer.tiled_targets(&on_gpu, &voxels, &three[..2 * i - 3])?;
                    gpu.wait()?;
                    let (list, rows) = (found.list().len(), found.appended());
                    shown = format!("{list} voxels, {rows} rows written by workgroups");
                }
                _ => {
                    voxelizer.run(&on_gpu, &voxels)?;
                    if i == 1 {
                        GpuVoxelList::of(&gpu, &voxels, ListMethod::Scan, VoxelOrder::Xyz)?;
                    } else if i == 4 {
                        voxelizer.attributes(&surface, &voxels)?;
                    }
                    gpu.wait()?;
                }
            }
            if round > 0 {
                whole.push(start.elapsed().as_secs_f64() * 1e3);
                pass.push(tile_pass(&voxelizer.pass_times()?));
            }
        }
    }
    println!("{}: {} triangles, {shown}", gpu.info(), mesh.triangles.len());
    for (name, (whole, pass)) in names.iter().zip(times) {
        println!("{name:>20}: {:8.2} ms, of which the tiles {:8.2} ms", median(whole), median(pass));
    }
    Ok(())
}
