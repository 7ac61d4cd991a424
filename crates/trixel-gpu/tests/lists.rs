//! Every list method against the plain scan of the CPU.

#![expect(clippy::unwrap_used, clippy::panic, reason = "a failure here is a failed test")]

use trixel::conformance::zoo;
use trixel::lattice::LatticeMesh;
use trixel::{Grid, Job, Mesh, Mode, Strategy, VoxelOrder, voxel_list};
use trixel_gpu::{
    AdapterChoice, Gpu, GpuError, GpuMesh, GpuVolume, GpuVoxelList, ListMethod, Options, Voxelizer, strategies_of, wgpu,
};

const DRIVERS: [&str; 2] = ["llvmpipe", "SwiftShader"];

fn open(name: &str) -> Gpu {
    Gpu::open(&AdapterChoice::Named(name.to_owned())).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// All methods and orders with one strategy.
fn compare(gpu: &Gpu, what: &str, mesh: &Mesh, grid: Grid, strategy: Strategy, modes: &[Mode]) {
    let lattice = LatticeMesh::snap(mesh, &grid).unwrap();
    let on_gpu = GpuMesh::upload(gpu, &lattice).unwrap();
    for &mode in modes {
        let job = Job::new(grid, mode).with_strategy(strategy);
        let volume = trixel::voxelize(mesh, &job.with_strategy(Strategy::Auto)).unwrap();
        let mut voxelizer = Voxelizer::new(gpu, &job, &Options::default()).unwrap();
        for order in [VoxelOrder::Xyz, VoxelOrder::Morton] {
            let expected = voxel_list(&volume, order);
            for method in ListMethod::ALL {
                let list = voxelizer.list(&on_gpu, method, order);
                if mode == Mode::Solid && method == ListMethod::FragmentList {
                    assert!(matches!(list, Err(GpuError::ListMethod { .. })));
                    continue;
                }
                let list = list.unwrap();
                assert_eq!(list.len() as usize, expected.len(), "{what} {mode} {method} {order:?} {}", gpu.info());
                assert!(list.download(gpu).unwrap() == expected, "{what} {mode} {method} {order:?} {}", gpu.info());
            }
        }
    }
}

#[test]
fn every_method_gives_the_list_of_the_cpu() {
    let mesh = zoo::merged(&[trixel::scene::build("torus:24").unwrap(), zoo::octahedron([0.0; 3], 1.3)]);
    let grid = Grid::fit(&mesh.bounds().unwrap(), 70).unwrap();
    for driver in DRIVERS {
        let gpu = open(driver);
        let modes: &[Mode] = if driver == "llvmpipe" { &Mode::ALL } else { &[Mode::Thin, Mode::Solid] };
        compare(&gpu, "torus", &mesh, grid, Strategy::Hybrid, modes);
        // Nothing, a single voxel, and a grid of one column.
        compare(&gpu, "empty", &Mesh::new(vec![], vec![]), grid, Strategy::Hybrid, &[Mode::Thin]);
        let speck = zoo::octahedron([0.5; 3], 0.4);
        for dims in [[1, 1, 1], [1, 1, 300]] {
            let grid = Grid::new([0.0; 3], [1.0; 3], dims).unwrap();
            compare(&gpu, "speck", &speck, grid, Strategy::Hybrid, &[Mode::Thin, Mode::Solid]);
        }
    }
}

#[test]
fn every_strategy_appends_the_same() {
    let mesh = trixel::scene::build("room:8").unwrap();
    let grid = Grid::fit(&mesh.bounds().unwrap(), 60).unwrap();
    let gpu = open("llvmpipe");
    for mode in [Mode::Conservative, Mode::Sliced] {
        for strategy in strategies_of(mode) {
            compare(&gpu, "room", &mesh, grid, strategy, &[mode]);
        }
    }
}

#[test]
fn long_grids_have_keys_of_two_words() {
    // 13 + 12 + 13 bits by x, y, z, and 39 along the Morton curve.
    let mesh = zoo::soup(&[[[1.5, 2.5, 0.5], [7000.2, 3999.1, 8000.7], [7001.0, 3990.0, 8000.0]]]);
    let grid = Grid::new([0.0; 3], [1.0; 3], [7002, 4000, 8001]).unwrap();
    let lattice = LatticeMesh::snap(&mesh, &grid).unwrap();
    let gpu = open("llvmpipe");
    let on_gpu = GpuMesh::upload(&gpu, &lattice).unwrap();
    let job = Job::new(grid, Mode::Conservative).with_strategy(Strategy::FragmentParallel);
    let mut voxelizer = Voxelizer::new(&gpu, &job, &Options::default()).unwrap();
    // 28 GiB of bits: only the method without them can.
    let mut lists = [VoxelOrder::Xyz, VoxelOrder::Morton].map(|order| {
        let list = voxelizer.list(&on_gpu, ListMethod::FragmentList, order).unwrap();
        assert!(list.len() > 10_000, "{}", list.len());
        list.download(&gpu).unwrap()
    });
    assert!(lists[0].is_sorted_by(|a, b| a < b));
    assert!(lists[1].is_sorted_by(|a, b| trixel::morton(*a) < trixel::morton(*b)));
    lists[1].sort_unstable();
    assert!(lists[0] == lists[1]);
}

#[test]
fn many_fragments_of_few_voxels_are_merged() {
    // More fragments than the first guess has room for, almost all of them duplicates.
    let triangle = [[0.5, 0.5, 0.5], [15.5, 0.7, 0.5], [0.5, 15.5, 0.9]];
    let mesh = zoo::soup(&vec![triangle; 400]);
    let grid = Grid::new([0.0; 3], [1.0; 3], [16; 3]).unwrap();
    compare(&open("llvmpipe"), "copies", &mesh, grid, Strategy::Hybrid, &[Mode::Conservative, Mode::Sliced]);
}

#[test]
fn loops_that_append_stay_short() {
    // As many columns as one invocation takes where nothing is appended, along every axis in lanes that run in step.
    let walls: Vec<[[f64; 3]; 3]> = (0..16)
        .map(|k| {
            let high = 2.5 + k as f64;
            let wall = [[1.0, 1.0, high], [126.0, 1.5, high + 50.0], [1.5, 126.0, high + 50.0]];
            wall.map(|corner| std::array::from_fn(|axis| corner[(axis + k) % 3]))
        })
        .collect();
    let mesh = zoo::soup(&walls);
    let gpu = open("llvmpipe");
    let grid = Grid::new([0.0; 3], [1.0; 3], [127; 3]).unwrap();
    compare(&gpu, "walls", &mesh, grid, Strategy::TriangleParallel, &[Mode::Conservative, Mode::Sliced]);
}

#[test]
fn triangles_of_the_cpu_are_in_the_list() {
    let mesh = zoo::merged(&[
        zoo::soup(&[[[-9000.0, -5000.5, 3.25], [9000.0, -4000.0, 7.75], [20.0, 9000.0, 2.5]]]),
        zoo::octahedron([20.0, 20.0, 10.0], 8.0),
    ]);
    let grid = Grid::new([0.0; 3], [1.0; 3], [40, 41, 42]).unwrap();
    compare(&open("llvmpipe"), "huge and small", &mesh, grid, Strategy::Hybrid, &[Mode::Conservative, Mode::Solid]);
}

#[test]
fn slabs_follow_each_other_in_the_list() {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN));
    let adapter = adapters.into_iter().find(|adapter| adapter.get_info().name.contains("llvmpipe")).unwrap();
    let required_limits = wgpu::Limits { max_storage_buffer_binding_size: 200_000, ..wgpu::Limits::default() };
    let descriptor = wgpu::DeviceDescriptor { required_limits, ..Default::default() };
    let (device, queue) = pollster::block_on(adapter.request_device(&descriptor)).unwrap();
    let gpu = Gpu::from_device(device, queue);
    let mesh = zoo::octahedron([80.0, 60.0, 50.0], 45.0);
    let grid = Grid::new([0.0; 3], [1.0; 3], [150, 110, 100]).unwrap();
    assert!(GpuVolume::new(&gpu, grid).unwrap().slabs().len() > 1);
    let lattice = LatticeMesh::snap(&mesh, &grid).unwrap();
    let on_gpu = GpuMesh::upload(&gpu, &lattice).unwrap();
    let job = Job::new(grid, Mode::Thin);
    let expected = voxel_list(&trixel::voxelize(&mesh, &job).unwrap(), VoxelOrder::Xyz);
    let mut voxelizer = Voxelizer::new(&gpu, &job, &Options::default()).unwrap();
    for method in [ListMethod::Scan, ListMethod::Histopyramid] {
        let list = voxelizer.list(&on_gpu, method, VoxelOrder::Xyz).unwrap();
        assert!(list.download(&gpu).unwrap() == expected, "{method}");
    }
    // A list that does not fit one binding is refused, with the numbers.
    let solid = Job::new(grid, Mode::Solid);
    let refused = Voxelizer::new(&gpu, &solid, &Options::default())
        .unwrap()
        .list(&on_gpu, ListMethod::Scan, VoxelOrder::Xyz)
        .map(drop);
    assert!(matches!(refused, Err(GpuError::BindingTooSmall { .. })), "{refused:?}");
}

#[test]
fn lists_of_finished_bits_need_a_method_for_them() {
    let gpu = open("llvmpipe");
    let grid = Grid::new([0.0; 3], [1.0; 3], [5, 6, 7]).unwrap();
    let voxels = GpuVolume::new(&gpu, grid).unwrap();
    for method in [ListMethod::Atomic, ListMethod::FragmentList] {
        let refused = GpuVoxelList::of(&gpu, &voxels, method, VoxelOrder::Xyz).map(drop);
        assert!(matches!(refused, Err(GpuError::ListMethod { .. })));
    }
    let empty = GpuVoxelList::of(&gpu, &voxels, ListMethod::Scan, VoxelOrder::Morton).unwrap();
    assert!(empty.is_empty() && empty.download(&gpu).unwrap().is_empty());
}

#[test]
fn names_are_parsed() {
    for method in ListMethod::ALL {
        assert_eq!(method.to_string().parse(), Ok(method));
    }
    assert!("quick".parse::<ListMethod>().unwrap_err().to_string().contains("histopyramid"));
}
