//! Measures the list methods side by side:
//! `cargo run --release -p trixel-gpu --example list_methods -- ADAPTER RESOLUTION[,RESOLUTION...] MESH...`
//!
//! Each cell voxelizes and lists in x-y-z order; medians of five runs, by turns. Memory is what is in use at most beside the
//! mesh: the bits where there are any, the list, and what making it takes.

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use trixel::lattice::LatticeMesh;
use trixel::{Bytes, Grid, Job, Mode, Volume, VoxelOrder, voxel_list};
use trixel_gpu::{AdapterChoice, Gpu, GpuMesh, ListMethod, Options, Voxelizer};
use trixel_io::read::{ReadOptions, read_mesh};

const RUNS: usize = 5;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let adapter = arguments.next().ok_or("which adapter?")?;
    let resolutions = arguments.next().ok_or("which resolutions?")?;
    let resolutions = resolutions.split(',').map(str::parse).collect::<Result<Vec<u32>, _>>()?;
    let gpu = Gpu::open(&AdapterChoice::Named(adapter))?;
    let mut out = std::io::stdout().lock();
    use std::io::Write as _;
    writeln!(out, "{}", gpu.info())?;
    for path in arguments {
        let mesh = match path.strip_prefix("scene:") {
            Some(scene) => trixel::scene::build(scene)?,
            None => read_mesh(Path::new(&path), &ReadOptions { attributes: false })?.mesh,
        };
        for &resolution in &resolutions {
            let grid = Grid::fit(&mesh.bounds().ok_or("an empty mesh")?, resolution)?;
            let on_gpu = GpuMesh::upload(&gpu, &LatticeMesh::snap(&mesh, &grid)?)?;
            let job = Job::new(grid, Mode::Conservative);
            let mut voxelizer = Voxelizer::new(&gpu, &job, &Options::default())?;
            let expected = voxel_list(&trixel::voxelize(&mesh, &job)?, VoxelOrder::Xyz);
            let mut wrong = [0; ListMethod::ALL.len()];
            let mut times = [[0.0; RUNS]; ListMethod::ALL.len()];
            let mut sizes = [[0; 2]; ListMethod::ALL.len()];
            // Once before, for the pipelines.
            for run in 0..=RUNS {
                for (i, method) in ListMethod::ALL.into_iter().enumerate() {
                    let start = Instant::now();
                    let list = voxelizer.list(&on_gpu, method, VoxelOrder::Xyz)?;
                    gpu.wait()?;
                    times[i][run.saturating_sub(1)] = start.elapsed().as_secs_f64() * 1e3;
                    if run == 0 {
                        let found = list.download(&gpu)?;
                        let differ = found.iter().zip(&expected).filter(|(a, b)| a != b).count();
                        wrong[i] = differ + found.len().abs_diff(expected.len());
                    }
                    let bits = if method == ListMethod::FragmentList { 0 } else { Volume::required_bytes(&grid) };
                    sizes[i] = [u64::from(list.len()), bits + list.bytes() + list.scratch_bytes()];
                }
            }
            writeln!(out, "{path}, {} triangles, at {resolution}: {} voxels", on_gpu.triangles(), sizes[0][0])?;
            for (((method, mut times), [_, bytes]), wrong) in
                ListMethod::ALL.into_iter().zip(times).zip(sizes).zip(wrong)
            {
                times.sort_by(f64::total_cmp);
                writeln!(
                    out,
                    "  {:14} {:8.1} ms  {}, {wrong} wrong entries",
                    method.name(),
                    times[RUNS / 2],
                    Bytes(bytes)
                )?;
            }
        }
    }
    Ok(())
}
