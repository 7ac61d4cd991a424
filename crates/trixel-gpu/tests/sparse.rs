//! Octrees and brick maps of the GPU against those of the CPU, bit for bit.

#![expect(clippy::unwrap_used, clippy::panic, reason = "a failure here is a failed test")]

use trixel::conformance::random::Random;
use trixel::conformance::zoo;
use trixel::lattice::LatticeMesh;
use trixel::octree::Octree;
use trixel::{CpuBackend, Grid, Job, Mode, Occupancy, Volume, VoxelOrder};
use trixel_gpu::{
    AdapterChoice, Gpu, GpuBrickMap, GpuError, GpuMesh, GpuOctree, GpuVolume, GpuVoxelList, GridRay, ListMethod,
    Options, Voxelizer,
};

const DRIVERS: [&str; 2] = ["llvmpipe", "SwiftShader"];

fn open(name: &str) -> Gpu {
    Gpu::open(&AdapterChoice::Named(name.to_owned())).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// A volume on the GPU that no mesh made.
fn uploaded(gpu: &Gpu, volume: &Volume) -> GpuVolume {
    let on_gpu = GpuVolume::new(gpu, *volume.grid()).unwrap();
    let bytes: Vec<u8> = volume.words().iter().flat_map(|word| word.to_le_bytes()).collect();
    gpu.queue().write_buffer(on_gpu.slabs()[0].buffer(), 0, &bytes);
    on_gpu
}

fn compare(gpu: &Gpu, what: &str, volume: &Volume) {
    let list = GpuVoxelList::of(gpu, &uploaded(gpu, volume), ListMethod::Histopyramid, VoxelOrder::Morton).unwrap();
    let octree = GpuOctree::of(gpu, &list).unwrap();
    assert!(octree.download(gpu).unwrap() == Octree::new(volume, None).unwrap(), "{what}: octree");
    // Every voxel, and some around the grid and far away.
    let [nx, ny, nz] = volume.grid().dims().map(|d| d + 2);
    let all = (0..nx).flat_map(|x| (0..ny).flat_map(move |y| (0..nz).map(move |z| [x, y, z])));
    let asked: Vec<[u32; 3]> = all.chain([[1 << 16, 0, 0], [0, u32::MAX, 0], [0, 0, 1 << 15]]).collect();
    let answers = octree.contains(gpu, &asked).unwrap();
    assert!(
        answers.iter().eq(asked.iter().map(|voxel| volume.get(*voxel)).collect::<Vec<_>>().iter()),
        "{what}: asked"
    );
    let bricks = GpuBrickMap::of(gpu, &list).unwrap().download(gpu).unwrap();
    assert_eq!(bricks.count(), volume.count(), "{what}: bricks");
    assert!(bricks.to_volume(None).unwrap() == *volume, "{what}: bricks");
}

/// Rays from everywhere, many of them through edges and corners.
fn rays(random: &mut Random, dims: [u32; 3], count: usize) -> Vec<GridRay> {
    let ray = |i: usize| {
        let steps = if i.is_multiple_of(3) { 128 } else { 1 };
        let origin = dims.map(|d| {
            let d = i64::from(d);
            i32::try_from(random.range(-d, 2 * d) * 256 + random.range(0, 255) / steps * steps).unwrap()
        });
        let most = [1, 3, 700, 32_768][i % 4];
        let direction = [0; 3].map(|_| i32::try_from(random.range(-most, most)).unwrap());
        GridRay::new(origin, direction)
    };
    (0..count).map(ray).collect::<Vec<_>>().into_iter().flatten().collect()
}

fn compare_rays(gpu: &Gpu, what: &str, volume: &Volume, rays: &[GridRay]) {
    let list = GpuVoxelList::of(gpu, &uploaded(gpu, volume), ListMethod::Scan, VoxelOrder::Morton).unwrap();
    let tree = Octree::new(volume, None).unwrap();
    let by_octree = GpuOctree::of(gpu, &list).unwrap().march(gpu, rays).unwrap();
    let by_bricks = GpuBrickMap::of(gpu, &list).unwrap().march(gpu, rays).unwrap();
    assert_eq!([by_octree.len(), by_bricks.len()], [rays.len(); 2]);
    for ((ray, octree), bricks) in rays.iter().zip(by_octree).zip(by_bricks) {
        let (origin, direction) = ray.floats();
        let expected = tree.march(origin, direction);
        assert_eq!(octree, expected, "{what}: octree {ray:?}");
        assert_eq!(bricks, expected, "{what}: bricks {ray:?}");
    }
}

#[test]
fn rays_hit_what_they_hit_on_the_cpu() {
    let mut random = Random::new(43);
    for driver in DRIVERS {
        let gpu = open(driver);
        for (dims, filled) in [([40, 33, 70], 300), ([64, 64, 64], 4000), ([3, 2, 5], 6), ([8; 3], 0)] {
            let mut volume = Volume::new(Grid::new([0.0; 3], [1.0; 3], dims).unwrap()).unwrap();
            for _ in 0..filled {
                volume.set(dims.map(|d| u32::try_from(random.range(0, i64::from(d) - 1)).unwrap()));
            }
            // A full cube, so that the octree has full octants.
            let side = |d: u32| if filled > 100 { 16..d.min(32) } else { 0..0 };
            for x in side(dims[0]) {
                for y in side(dims[1]) {
                    side(dims[2]).for_each(|z| volume.set([x, y, z]));
                }
            }
            compare_rays(&gpu, driver, &volume, &rays(&mut random, dims, 3000));
        }
        let full = Volume::new(Grid::new([0.0; 3], [1.0; 3], [16; 3]).unwrap()).map(|mut volume| {
            volume.words_mut().fill(0xffff);
            volume
        });
        compare_rays(&gpu, "full", &full.unwrap(), &rays(&mut random, [16; 3], 500));
    }
    // A floor of posts, and a ray that passes thousands of small cubes close above it.
    let mut volume = Volume::new(Grid::new([0.0; 3], [1.0; 3], [4096, 2, 2]).unwrap()).unwrap();
    (0..4096).for_each(|x| volume.set([x, 0, x % 2]));
    volume.set([4095, 1, 1]);
    let along = GridRay::new([-700, 300, 400], [1, 0, 0]).unwrap();
    compare_rays(&open("llvmpipe"), "posts", &volume, &[along]);
    assert_eq!(
        GridRay::rounded([0.5, 1.0, 2.0], [0.0, -3.0, 1.5]),
        GridRay::new([128, 256, 512], [0, -32_768, 16_384])
    );
    assert!(GridRay::rounded([0.0; 3], [0.0; 3]).is_none() && GridRay::rounded([1e9; 3], [1.0; 3]).is_none());
}

#[test]
fn random_sets_give_the_structures_of_the_cpu() {
    let mut random = Random::new(41);
    for driver in DRIVERS {
        let gpu = open(driver);
        for dims in [[40, 33, 70], [1, 1, 1], [64, 64, 64], [2, 130, 5], [16, 16, 16]] {
            let mut volume = Volume::new(Grid::new([0.0; 3], [1.0; 3], dims).unwrap()).unwrap();
            compare(&gpu, "nothing", &volume);
            // Boxes, so that there are full cubes of all sizes, and single voxels.
            for round in 0..10 {
                let size = if round < 3 { 24 } else { 1 };
                let low: [u32; 3] = dims.map(|d| u32::try_from(random.range(0, i64::from(d) - 1)).unwrap());
                let high: [u32; 3] = std::array::from_fn(|i| (low[i] + size).min(dims[i]));
                for x in low[0]..high[0] {
                    for y in low[1]..high[1] {
                        (low[2]..high[2]).for_each(|z| volume.set([x, y, z]));
                    }
                }
            }
            compare(&gpu, &format!("{driver} {dims:?}"), &volume);
        }
        let mut full = Volume::new(Grid::new([0.0; 3], [1.0; 3], [16; 3]).unwrap()).unwrap();
        for x in 0..16 {
            for y in 0..16 {
                (0..16).for_each(|z| full.set([x, y, z]));
            }
        }
        compare(&gpu, "full", &full);
    }
}

#[test]
fn a_solid_is_pruned_and_its_bricks_are_those_of_the_cpu() {
    let gpu = open("llvmpipe");
    let mesh = zoo::octahedron([64.0; 3], 60.0);
    let grid = Grid::new([0.0; 3], [1.0; 3], [128; 3]).unwrap();
    let lattice = LatticeMesh::snap(&mesh, &grid).unwrap();
    let on_gpu = GpuMesh::upload(&gpu, &lattice).unwrap();
    for mode in [Mode::Conservative, Mode::Solid] {
        let job = Job::new(grid, mode);
        let mut voxelizer = Voxelizer::new(&gpu, &job, &Options::default()).unwrap();
        let list = voxelizer.list(&on_gpu, ListMethod::Atomic, VoxelOrder::Morton).unwrap();
        let octree = GpuOctree::of(&gpu, &list).unwrap();
        assert!(octree.len() < list.len() / 2, "{mode}: {} nodes, {} voxels", octree.len(), list.len());
        let volume = trixel::voxelize(&mesh, &job).unwrap();
        assert!(octree.download(&gpu).unwrap() == Octree::new(&volume, None).unwrap());
        let bricks = GpuBrickMap::of(&gpu, &list).unwrap().download(&gpu).unwrap();
        let expected = CpuBackend::default().voxelize_bricks(&lattice, &job, None).unwrap();
        assert!(bricks == expected, "{mode}");
    }
}

#[test]
fn lists_by_coordinates_are_refused() {
    let gpu = open("llvmpipe");
    let volume = Volume::new(Grid::new([0.0; 3], [1.0; 3], [5; 3]).unwrap()).unwrap();
    let list = GpuVoxelList::of(&gpu, &uploaded(&gpu, &volume), ListMethod::Scan, VoxelOrder::Xyz).unwrap();
    assert!(matches!(GpuOctree::of(&gpu, &list), Err(GpuError::ListOrder)));
    assert!(matches!(GpuBrickMap::of(&gpu, &list), Err(GpuError::ListOrder)));
}
