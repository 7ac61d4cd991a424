//! Fills on two drivers, bit for bit as the library defines them.

#![expect(clippy::unwrap_used, clippy::panic, reason = "a failure here is a failed test")]

use trixel::conformance::random::Random;
use trixel::fill::{Fill, fill};
use trixel::lattice::LatticeMesh;
use trixel::{Grid, Job, Mesh, Mode, Strategy, Volume};
use trixel_gpu::{AdapterChoice, Gpu, GpuMesh, GpuVolume, Options, Voxelizer};

const DRIVERS: [&str; 2] = ["llvmpipe", "SwiftShader"];

/// Voxelizes in slices on the GPU, fills there, and compares with the CPU.
fn compare(gpu: &Gpu, what: &str, mesh: &Mesh, grid: Grid) {
    let job = Job::new(grid, Mode::Sliced);
    let boundary = trixel::voxelize(mesh, &job).unwrap();
    let lattice = LatticeMesh::snap(mesh, &grid).unwrap();
    let on_gpu = GpuVolume::new(gpu, grid).unwrap();
    let mut voxelizer = Voxelizer::new(gpu, &job.with_strategy(Strategy::Sliced), &Options::default()).unwrap();
    voxelizer.run(&GpuMesh::upload(gpu, &lattice).unwrap(), &on_gpu).unwrap();
    for way in Fill::ALL {
        let (expected, report) = fill(&boundary, way).unwrap();
        let (filled, found_report) = on_gpu.filled(gpu, way).unwrap();
        let mut found = Volume::new(grid).unwrap();
        filled.download(gpu, &mut found).unwrap();
        assert!(found == expected, "{what}, {way}, {}", gpu.info());
        assert_eq!(found_report, report, "{what}, {way}");
        assert!(way == Fill::Parity || report.questionable > 0, "{what}: nothing to correct");
    }
}

/// A mesh without some of its triangles.
fn with_holes(mut mesh: Mesh, one_in: i64) -> Mesh {
    let mut random = Random::new(11);
    mesh.triangles.retain(|_| random.range(0, one_in) != 0);
    mesh
}

#[test]
fn fills_are_those_of_the_cpu() {
    for driver in DRIVERS {
        let gpu = Gpu::open(&AdapterChoice::Named(driver.to_owned())).unwrap_or_else(|error| panic!("{error}"));
        for (name, one_in, resolution) in [("torus", 12, 70), ("sphere", 30, 33), ("room:8", 9, 40)] {
            let mesh = with_holes(trixel::scene::build(name).unwrap(), one_in);
            compare(&gpu, name, &mesh, Grid::fit(&mesh.bounds().unwrap(), resolution).unwrap());
        }
        // Columns of one word and of several, narrow grids.
        let mesh = with_holes(trixel::scene::build("sphere").unwrap(), 20);
        let bounds = mesh.bounds().unwrap();
        let size = |axis: usize| bounds.max[axis] - bounds.min[axis];
        for dims in [[2, 41, 31], [37, 1, 32], [20, 23, 129]] {
            let voxel_size = std::array::from_fn(|axis| size(axis) / f64::from(dims[axis]));
            compare(&gpu, "narrow", &mesh, Grid::new(bounds.min, voxel_size, dims).unwrap());
        }
    }
}
