//! Several values of each voxel in the pass that finds the voxels, and what they cost: strategy `tiled` without render
//! targets, with one and with three, beside the first one's values by way of attributes, which must be the same.
//!
//! ```sh
//! cargo run --release -p trixel-gpu --example targets -- MESH RESOLUTION [ADAPTER]
//! ```

#![expect(clippy::print_stdout, reason = "an example")]

use std::path::Path;
use std::time::Instant;

use trixel::attributes::{AttributeKind, AttributeRequest, Combine, Values};
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
    let (mut rows, mut ids, mut same) = (0, vec![], false);
    // The first round builds pipelines and buffers.
    for round in 0..=RUNS {
        for (i, (whole, pass)) in times.iter_mut().enumerate() {
            let start = Instant::now();
            let (mut blended, mut attributes) = (None, None);
            if let 2 | 3 = i {
                blended = Some(voxelizer.tiled_targets(&on_gpu, &voxels, &three[..2 * i - 3])?);
            } else {
                voxelizer.run(&on_gpu, &voxels)?;
            }
            match i {
                1 => drop(GpuVoxelList::of(&gpu, &voxels, ListMethod::Scan, VoxelOrder::Xyz)?),
                4 => attributes = Some(voxelizer.attributes(&surface, &voxels)?),
                _ => {}
            }
            gpu.wait()?;
            if round > 0 {
                whole.push(start.elapsed().as_secs_f64() * 1e3);
                pass.push(tile_pass(&voxelizer.pass_times()?));
            }
            if let (Some(blended), RUNS) = (blended, round) {
                rows = blended.appended();
                ids = blended.download(&gpu)?.into_iter().next().unwrap_or_default();
            }
            if let (Some(attributes), RUNS) = (attributes, round) {
                same =
                    attributes.download(&gpu, &mesh)?.get(AttributeKind::Triangle) == Some(&Values::U32(ids.clone()));
            }
        }
    }
    let (triangles, count) = (mesh.triangles.len(), ids.len());
    println!("{}: {triangles} triangles, {count} voxels, {rows} rows written by workgroups", gpu.info());
    for (name, (whole, pass)) in names.iter().zip(times) {
        println!("{name:>20}: {:8.2} ms, of which the tiles {:8.2} ms", median(whole), median(pass));
    }
    if same { Ok(()) } else { Err("the lowest triangles are not the attribute's".into()) }
}
