//! Every strategy on real meshes and built-in scenes, against the CPU.
//!
//! By default a few at 64, on both drivers. `TRIXEL_GPU_PROOF=1` runs all sizes, modes and strategies, for more than an hour.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a failure here is a failed test")]

use std::path::PathBuf;

use trixel::lattice::LatticeMesh;
use trixel::{Backend, CpuBackend, Grid, Job, Mesh, Mode, Volume};
use trixel_gpu::{AdapterChoice, Gpu, GpuMesh, GpuVolume, Options, Voxelizer, strategies_of};

const DRIVERS: [&str; 2] = ["llvmpipe", "SwiftShader"];
const MESHES: [&str; 8] = [
    "bunny/bun_zipper.ply",
    "stanford-dragon/dragon_vrip.ply",
    "sponza/Sponza.gltf",
    "happy-buddha/buddha_100k.obj",
    "hand/hand_76k.obj",
    "venus/venus_43k.obj",
    "horse/horse.ply",
    "engine/2CylinderEngine.glb",
];
const SCENES: [&str; 6] = ["cube", "torus", "room", "room-rotated", "triangle", "hairball"];

fn models() -> Option<PathBuf> {
    let beside = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/models");
    let folder = std::env::var_os("TRIXEL_MODELS").map_or(beside, PathBuf::from);
    folder.is_dir().then_some(folder)
}

fn compare(name: &str, mesh: &Mesh, resolution: u32, modes: &[Mode], gpus: &[Gpu]) {
    let grid = Grid::fit(&mesh.bounds().unwrap(), resolution).unwrap();
    let lattice = LatticeMesh::snap(mesh, &grid).unwrap();
    let mut expected = Volume::new(grid).unwrap();
    let mut found = Volume::new(grid).unwrap();
    for &mode in modes {
        CpuBackend::default().voxelize(&lattice, &Job::new(grid, mode), &mut expected).unwrap();
        for gpu in gpus {
            let on_gpu = GpuMesh::upload(gpu, &lattice).unwrap();
            let voxels = GpuVolume::new(gpu, grid).unwrap();
            for strategy in strategies_of(mode) {
                let job = Job::new(grid, mode).with_strategy(strategy);
                Voxelizer::new(gpu, &job, &Options::default()).unwrap().run(&on_gpu, &voxels).unwrap();
                voxels.download(gpu, &mut found).unwrap();
                assert!(found == expected, "{name} at {resolution}, {mode}, {strategy}, {}", gpu.info());
            }
        }
    }
    println!("{name} at {resolution}: {} voxels, no difference", expected.count());
}

#[test]
fn no_voxel_differs_from_the_cpu() {
    let proof = std::env::var_os("TRIXEL_GPU_PROOF").is_some();
    let (resolutions, modes, scenes, meshes): (&[u32], &[Mode], _, _) = if proof {
        (&[128, 256, 512], &Mode::ALL, &SCENES[..], &MESHES[..])
    } else {
        (&[64], &[Mode::Conservative, Mode::Solid], &SCENES[..3], &MESHES[..1])
    };
    let gpus = DRIVERS.map(|name| Gpu::open(&AdapterChoice::Named(name.to_owned())).unwrap());
    for scene in scenes {
        let mesh = trixel::scene::build(scene).unwrap();
        resolutions.iter().for_each(|&resolution| compare(scene, &mesh, resolution, modes, &gpus));
    }
    let Some(folder) = models() else {
        println!("no folder of real meshes: built-in scenes only");
        return;
    };
    for name in meshes {
        let mesh = trixel_io::read::read_mesh(&folder.join(name), &Default::default()).unwrap().mesh;
        resolutions.iter().for_each(|&resolution| compare(name, &mesh, resolution, modes, &gpus));
    }
}
