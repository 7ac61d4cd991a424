//! Sizes at which GPU code goes wrong, and what the library promises beside the voxels.

#![expect(clippy::unwrap_used, clippy::panic, reason = "a failure here is a failed test")]

use trixel::conformance::zoo;
use trixel::lattice::LatticeMesh;
use trixel::{Backend, CpuBackend, Grid, Job, Mesh, Mode, Strategy, Volume};
use trixel_gpu::{
    AdapterChoice, Cutoff, Dilation, Gpu, GpuError, GpuMesh, GpuVolume, Heuristic, Options, Tier, Voxelizer,
    strategies_of, wgpu,
};

const DRIVERS: [&str; 2] = ["llvmpipe", "SwiftShader"];

fn open(name: &str) -> Gpu {
    Gpu::open(&AdapterChoice::Named(name.to_owned())).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn unit_grid(dims: [u32; 3]) -> Grid {
    Grid::new([0.0; 3], [1.0; 3], dims).unwrap()
}

fn on_cpu(lattice: &LatticeMesh<'_>, job: &Job) -> Volume {
    let mut volume = Volume::new(*job.grid()).unwrap();
    CpuBackend::default().voxelize(lattice, &job.with_strategy(Strategy::Auto), &mut volume).unwrap();
    volume
}

fn on_gpu(gpu: &Gpu, lattice: &LatticeMesh<'_>, job: &Job, options: &Options) -> (Volume, Voxelizer) {
    let mesh = GpuMesh::upload(gpu, lattice).unwrap();
    let voxels = GpuVolume::new(gpu, *job.grid()).unwrap();
    let mut voxelizer = Voxelizer::new(gpu, job, options).unwrap();
    voxelizer.run(&mesh, &voxels).unwrap();
    let mut volume = Volume::new(*job.grid()).unwrap();
    voxels.download(gpu, &mut volume).unwrap();
    (volume, voxelizer)
}

/// Compares every strategy in some modes with the CPU.
fn compare(gpu: &Gpu, what: &str, mesh: &Mesh, grid: Grid, modes: &[Mode]) {
    let lattice = LatticeMesh::snap(mesh, &grid).unwrap();
    for &mode in modes {
        let expected = on_cpu(&lattice, &Job::new(grid, mode));
        for strategy in strategies_of(mode) {
            let job = Job::new(grid, mode).with_strategy(strategy);
            let (found, _) = on_gpu(gpu, &lattice, &job, &Options::default());
            assert!(found == expected, "{what}, {mode}, {strategy}, {}: wrong voxels", gpu.info());
        }
    }
}

fn crumbs(count: u32, side: f64) -> Mesh {
    let mut positions = vec![];
    let mut triangles = vec![];
    let mut state = 1u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / f64::from(1 << 24)
    };
    for i in 0..count {
        let at = [next() * side, next() * side, next() * side];
        positions.extend([at, [at[0] + 0.3, at[1] + next() * 0.5, at[2]], [at[0], at[1] + 0.2, at[2] + 0.4]]);
        triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    Mesh::new(positions, triangles)
}

#[test]
fn one_triangle_across_the_grid() {
    // More columns than one invocation may loop over on lavapipe, which would end the loop without an error.
    let mesh = zoo::soup(&[[[0.3, 0.2, 0.1], [511.7, 3.3, 500.2], [2.5, 511.9, 255.5]]]);
    for driver in DRIVERS {
        // Slice by slice takes SwiftShader long, and no driver loops there.
        let modes = if driver == "llvmpipe" { &Mode::ALL[..] } else { &Mode::ALL[..3] };
        compare(&open(driver), "spanning triangle", &mesh, unit_grid([512; 3]), modes);
    }
}

#[test]
fn a_million_crumbs() {
    let mesh = crumbs(1_000_000, 64.0);
    let grid = unit_grid([63, 65, 67]);
    compare(&open("llvmpipe"), "crumbs", &mesh, grid, &[Mode::Conservative, Mode::Solid]);
    // Slower by far.
    compare(&open("SwiftShader"), "crumbs", &mesh, grid, &[Mode::Conservative]);
}

#[test]
fn more_workgroups_than_one_dimension_holds() {
    let mesh = crumbs(65_535 * 64 + 77, 100.0);
    let grid = unit_grid([100; 3]);
    let lattice = LatticeMesh::snap(&mesh, &grid).unwrap();
    let job = Job::new(grid, Mode::Thin);
    let expected = on_cpu(&lattice, &job);
    let gpu = open("llvmpipe");
    for strategy in
        [Strategy::TriangleParallel, Strategy::Hybrid, Strategy::Balanced, Strategy::CaseSorted, Strategy::Tiled]
    {
        let (found, _) = on_gpu(&gpu, &lattice, &job.with_strategy(strategy), &Options::default());
        assert!(found == expected, "{strategy}");
    }
}

#[test]
fn triangles_outside() {
    let mut outside = zoo::octahedron([-100.0, 5.0, 5.0], 20.0);
    for centre in [[5.0, 200.0, 5.0], [5.0, 5.0, -70.0], [5.0, 5.0, 90.0], [20_000.0, 5.0, 5.0]] {
        outside = zoo::merged(&[outside, zoo::octahedron(centre, 30.0)]);
    }
    for driver in DRIVERS {
        compare(&open(driver), "outside", &outside, unit_grid([11, 12, 13]), &Mode::ALL);
    }
}

#[test]
fn triangles_beyond_the_shaders_arithmetic_go_to_the_cpu() {
    let mesh = zoo::merged(&[
        zoo::soup(&[[[-9000.0, -5000.5, 3.25], [9000.0, -4000.0, 7.75], [20.0, 9000.0, 2.5]]]),
        zoo::octahedron([20.0, 20.0, 10.0], 8.0),
    ]);
    let gpu = open("llvmpipe");
    // At 32 voxels along z, a toggle above the grid would land in the unused half of a word.
    for nz in [32, 42] {
        let grid = unit_grid([40, 41, nz]);
        let lattice = LatticeMesh::snap(&mesh, &grid).unwrap();
        assert_eq!(GpuMesh::upload(&gpu, &lattice).unwrap().cpu_triangles(), 1);
        compare(&gpu, "huge and small", &mesh, grid, &Mode::ALL);
    }
}

#[test]
fn dilated_triangles_may_reach_far_outside() {
    // Needles and fans whose corners lie up to 8000 pixels beyond a small target, where drivers clip.
    let mut state = 7u64;
    let mut next = |low: f64, high: f64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (state >> 40) as f64 / f64::from(1 << 24)
    };
    let soup: Vec<[[f64; 3]; 3]> = (0..60)
        .map(|_| {
            // Through a point of the grid, and away from it.
            let through: [f64; 3] = std::array::from_fn(|_| next(2.0, 18.0));
            let u: [f64; 3] = std::array::from_fn(|_| next(-3900.0, 3900.0));
            let v: [f64; 3] = std::array::from_fn(|_| next(-900.0, 900.0));
            let at = |a: f64, b: f64| std::array::from_fn(|axis| through[axis] + a * u[axis] + b * v[axis]);
            [at(1.0, 0.5), at(-1.0, 0.4), at(0.1, -1.0)]
        })
        .collect();
    let grid = unit_grid([20, 21, 22]);
    let mesh = zoo::soup(&soup);
    let lattice = LatticeMesh::snap(&mesh, &grid).unwrap();
    for driver in DRIVERS {
        let gpu = open(driver);
        assert_eq!(GpuMesh::upload(&gpu, &lattice).unwrap().cpu_triangles(), 0);
        for mode in Mode::ALL {
            let job = Job::new(grid, mode).with_strategy(Strategy::FragmentParallel);
            let expected = on_cpu(&lattice, &job);
            assert!(expected.count() > 1000);
            for dilation in Dilation::ALL {
                let (found, _) = on_gpu(&gpu, &lattice, &job, &Options { dilation, ..Options::default() });
                assert!(found == expected, "{driver} {mode} {}", dilation.name());
            }
        }
    }
}

#[test]
fn a_check_before_the_submission_is_refused() {
    let gpu = open("llvmpipe");
    let mesh = zoo::octahedron([4.0; 3], 3.0);
    let grid = unit_grid([8; 3]);
    let on_gpu = GpuMesh::upload(&gpu, &LatticeMesh::snap(&mesh, &grid).unwrap()).unwrap();
    let voxels = GpuVolume::new(&gpu, grid).unwrap();
    let mut voxelizer = Voxelizer::new(&gpu, &Job::new(grid, Mode::Solid), &Options::default()).unwrap();
    assert!(matches!(voxelizer.check(), Err(GpuError::NotSubmitted)), "nothing recorded");
    voxelizer.run(&on_gpu, &voxels).unwrap();
    let mut encoder = gpu.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    voxelizer.record(&mut encoder, &on_gpu, &voxels).unwrap();
    assert!(matches!(voxelizer.check(), Err(GpuError::NotSubmitted)), "only the run before was submitted");
    gpu.queue().submit([encoder.finish()]);
    voxelizer.check().unwrap();
}

/// A device whose bindings hold little, so that meshes and grids are cut.
fn small_device(binding_bytes: u64, target: u32) -> Gpu {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN));
    let adapter = adapters.into_iter().find(|adapter| adapter.get_info().name.contains("llvmpipe")).unwrap();
    let required_limits = wgpu::Limits {
        max_storage_buffer_binding_size: binding_bytes,
        max_texture_dimension_2d: target,
        ..wgpu::Limits::default()
    };
    let descriptor = wgpu::DeviceDescriptor { required_limits, ..Default::default() };
    let (device, queue) = pollster::block_on(adapter.request_device(&descriptor)).unwrap();
    Gpu::from_device(device, queue)
}

#[test]
fn every_tier_gives_the_same() {
    // What `Gpu::open` finds on lavapipe is more than a device of the default limits and features has.
    let best = open("llvmpipe");
    let portable = small_device(1 << 27, 8192);
    assert_eq!((best.info().tier, portable.info().tier), (Tier::Int64, Tier::Portable));
    let mesh = trixel::scene::build("room:8").unwrap();
    let grid = Grid::fit(&mesh.bounds().unwrap(), 150).unwrap();
    for gpu in [best, portable] {
        compare(&gpu, "room", &mesh, grid, &Mode::ALL);
    }
}

#[test]
fn meshes_and_grids_larger_than_a_binding_are_cut() {
    let gpu = small_device(6_000, 256);
    let mesh = zoo::merged(&[trixel::scene::build("torus:24").unwrap(), zoo::octahedron([0.0; 3], 1.3)]);
    let grid = Grid::fit(&mesh.bounds().unwrap(), 61).unwrap();
    let voxels = GpuVolume::new(&gpu, grid).unwrap();
    assert!(voxels.slabs().len() > 3, "{}", voxels.slabs().len());
    compare(&gpu, "cut", &mesh, grid, &Mode::ALL);
}

#[test]
fn grids_wider_than_the_raster_target_are_drawn_in_windows() {
    let mesh = zoo::octahedron([20.0, 25.0, 30.0], 24.0);
    compare(&small_device(1 << 26, 16), "windows", &mesh, unit_grid([41, 53, 67]), &Mode::ALL);
    // Slabs that begin beyond the first window.
    let mesh = zoo::octahedron([60.0, 25.0, 30.0], 59.0);
    compare(&small_device(6_000, 48), "windows of slabs", &mesh, unit_grid([121, 53, 67]), &Mode::ALL);
}

#[test]
fn every_dilation_and_heuristic_gives_the_same() {
    let mesh = trixel::scene::build("room:8").unwrap();
    let grid = Grid::fit(&mesh.bounds().unwrap(), 90).unwrap();
    let lattice = LatticeMesh::snap(&mesh, &grid).unwrap();
    for driver in DRIVERS {
        let gpu = open(driver);
        for mode in [Mode::Conservative, Mode::Thin] {
            let expected = on_cpu(&lattice, &Job::new(grid, mode));
            // Every dilation and every heuristic; they have nothing to do with each other.
            for (heuristic, dilation) in Heuristic::ALL.into_iter().zip(Dilation::ALL.into_iter().cycle()) {
                let value = if heuristic == Heuristic::AreaRatio { 0.3 } else { 20.0 };
                let cutoff = Some(Cutoff { heuristic, value });
                let options = Options { cutoff, dilation, count: false };
                let job = Job::new(grid, mode).with_strategy(Strategy::Hybrid);
                let (found, _) = on_gpu(&gpu, &lattice, &job, &options);
                assert!(found == expected, "{driver} {mode} {} {}", dilation.name(), heuristic.name());
            }
        }
    }
}

#[test]
fn counters_agree() {
    let mesh = trixel::scene::build("room:8").unwrap();
    let grid = Grid::fit(&mesh.bounds().unwrap(), 70).unwrap();
    let lattice = LatticeMesh::snap(&mesh, &grid).unwrap();
    let triangles = mesh.triangles.len() as u64;
    let mut tests = vec![];
    for driver in DRIVERS {
        let gpu = open(driver);
        for strategy in strategies_of(Mode::Conservative) {
            let job = Job::new(grid, Mode::Conservative).with_strategy(strategy);
            let cutoff = Some(Cutoff { heuristic: Heuristic::ProjectedArea, value: 30.0 });
            let options = Options { cutoff, count: true, ..Options::default() };
            let (volume, voxelizer) = on_gpu(&gpu, &lattice, &job, &options);
            let counters = voxelizer.check().unwrap();
            // Each voxel is written by exactly one atomic that finds it unset.
            assert_eq!(counters.voxels_written, volume.count(), "{strategy}");
            assert!(counters.atomics <= counters.voxels_written + counters.voxel_tests);
            match strategy {
                Strategy::TriangleParallel => {
                    // Those across 64 voxels or more take a second one.
                    assert!((triangles..2 * triangles).contains(&counters.invocations));
                    assert_eq!(counters.fragments, 0);
                }
                Strategy::FragmentParallel => {
                    assert_eq!(counters.invocations, 0);
                    assert!(counters.fragments_discarded < counters.fragments);
                }
                Strategy::Hybrid => assert!(counters.fragments > 0 && counters.invocations == triangles),
                Strategy::Balanced => assert_eq!(counters.invocations, triangles + counters.columns),
                Strategy::CaseSorted | Strategy::Tiled => {
                    assert!(counters.invocations >= 2 * triangles && counters.fragments == 0);
                }
                _ => assert!(counters.fragments > 0),
            }
            let lane_use = counters.lane_use();
            assert_eq!(lane_use.is_some(), counters.invocations > 0, "{strategy}");
            assert!(lane_use.is_none_or(|share| share > 0.0 && share <= 1.0), "{strategy}: {lane_use:?}");
            // The same voxels are tested, whoever tests them; but where the box's case decides, none need be.
            if strategy == Strategy::CaseSorted {
                assert!(tests.iter().all(|count| *count > counters.voxel_tests));
            } else {
                tests.push(counters.voxel_tests);
            }
        }
    }
    assert!(tests.iter().all(|count| *count == tests[0]), "{tests:?}");
}

#[test]
fn a_classification_serves_again() {
    let mesh = trixel::scene::build("room:8").unwrap();
    let grid = Grid::fit(&mesh.bounds().unwrap(), 50).unwrap();
    let lattice = LatticeMesh::snap(&mesh, &grid).unwrap();
    let job = Job::new(grid, Mode::Conservative).with_strategy(Strategy::HybridTwoPass);
    let expected = on_cpu(&lattice, &job);
    let gpu = open("llvmpipe");
    let mesh = GpuMesh::upload(&gpu, &lattice).unwrap();
    let voxels = GpuVolume::new(&gpu, grid).unwrap();
    let mut voxelizer = Voxelizer::new(&gpu, &job, &Options::default()).unwrap();
    let classification = voxelizer.classify(&mesh, &voxels).unwrap();
    for _ in 0..2 {
        voxelizer.run_classified(&mesh, &voxels, &classification).unwrap();
        let mut found = Volume::new(grid).unwrap();
        voxels.download(&gpu, &mut found).unwrap();
        assert!(found == expected);
    }
}

fn callers_buffer(gpu: &Gpu, words: &[i32]) -> wgpu::Buffer {
    let buffer = gpu.device().create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: words.len() as u64 * 4,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    gpu.queue().write_buffer(&buffer, 0, &bytes);
    buffer
}

#[test]
fn tiles_of_unknown_meshes_have_bounded_room() {
    // Each copy's box meets 16 x 16 x 8 tiles; what is known of uploaded meshes makes room for them.
    const COPIES: i32 = 600;
    const S: i32 = 65_536;
    let gpu = open("llvmpipe");
    let grid = unit_grid([256; 3]);
    let job = Job::new(grid, Mode::Conservative).with_strategy(Strategy::Tiled);
    let corners = [[1, 1, 1], [255, 2, 250], [3, 254, 9]];
    let positions: Vec<i32> = corners.as_flattened().iter().map(|c| c * S).collect();
    let indices: Vec<i32> = (0..3 * COPIES).map(|i| i % 3).collect();
    let voxels = GpuVolume::new(&gpu, grid).unwrap();
    let mut voxelizer = Voxelizer::new(&gpu, &job, &Options::default()).unwrap();
    let [positions, indices] = [positions, indices].map(|words| callers_buffer(&gpu, &words));
    let run = voxelizer.run(&GpuMesh::from_buffers(positions, indices, COPIES.cast_unsigned()), &voxels);
    let most = 8 * COPIES.cast_unsigned() + (1 << 20);
    assert!(
        matches!(run, Err(GpuError::TooManyTiles { needed, room }) if needed == 2048 * COPIES.cast_unsigned() && room == most),
        "{run:?}"
    );
    let mesh = zoo::soup(&vec![corners.map(|corner| corner.map(f64::from)); 600]);
    let lattice = LatticeMesh::snap(&mesh, &grid).unwrap();
    assert!(on_gpu(&gpu, &lattice, &job, &Options::default()).0 == on_cpu(&lattice, &job));
}

#[test]
fn a_callers_buffers_are_used_as_they_are_and_checked() {
    let gpu = open("llvmpipe");
    let buffer = |words: &[i32]| callers_buffer(&gpu, words);
    const S: i32 = 65_536;
    let grid = unit_grid([8; 3]);
    let run = |strategy: Strategy, far: i32| {
        let positions = buffer(&[S / 2, S / 2, S / 2, far, S / 2, S / 2, S / 2, 5 * S, S / 2]);
        let mesh = GpuMesh::from_buffers(positions, buffer(&[0, 1, 2]), 1);
        let voxels = GpuVolume::new(&gpu, grid).unwrap();
        Voxelizer::new(&gpu, &Job::new(grid, Mode::Conservative).with_strategy(strategy), &Options::default())
            .unwrap()
            .run(&mesh, &voxels)
            .map(|()| {
                let mut volume = Volume::new(grid).unwrap();
                voxels.download(&gpu, &mut volume).unwrap();
                volume.count()
            })
    };
    let mesh = zoo::soup(&[[[0.5; 3], [5.0, 0.5, 0.5], [0.5, 5.0, 0.5]]]);
    let expected = trixel::voxelize(&mesh, &Job::new(grid, Mode::Conservative)).unwrap().count();
    for strategy in strategies_of(Mode::Conservative) {
        assert_eq!(run(strategy, 5 * S).unwrap(), expected);
        assert!(matches!(run(strategy, 9000 * S), Err(GpuError::TrianglesTooLarge(1))), "{strategy}");
    }
}

#[test]
fn an_empty_mesh_sets_nothing() {
    let grid = unit_grid([5; 3]);
    for mode in Mode::ALL {
        let mesh = Mesh::new(vec![], vec![]);
        compare(&open("llvmpipe"), "empty", &mesh, grid, &[mode]);
    }
}

#[test]
fn unknown_adapters_are_named_with_those_there_are() {
    let error = Gpu::open(&AdapterChoice::Named("no such thing".to_owned())).unwrap_err().to_string();
    assert!(error.contains("no such thing") && error.contains("llvmpipe"), "{error}");
}

#[test]
fn a_texture_holds_the_voxels() {
    // The small device cuts the grid into slabs and the texture into batches of planes.
    let mesh = zoo::octahedron([20.0, 15.0, 33.0], 14.5);
    let grid = unit_grid([41, 30, 67]);
    let lattice = LatticeMesh::snap(&mesh, &grid).unwrap();
    let job = Job::new(grid, Mode::Conservative);
    let expected = on_cpu(&lattice, &job);
    for gpu in [open("llvmpipe"), open("SwiftShader"), small_device(20_000, 256)] {
        let on_gpu = GpuMesh::upload(&gpu, &lattice).unwrap();
        let voxels = GpuVolume::new(&gpu, grid).unwrap();
        let mut voxelizer = Voxelizer::new(&gpu, &job, &Options::default()).unwrap();
        let mut encoder = gpu.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        voxelizer.record(&mut encoder, &on_gpu, &voxels).unwrap();
        let texture = voxels.record_texture(&gpu, &mut encoder).unwrap();
        let row = 256;
        let answer = gpu.device().create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: row * 30 * 67,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        encoder.copy_texture_to_buffer(
            texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &answer,
                layout: wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(256), rows_per_image: Some(30) },
            },
            texture.size(),
        );
        gpu.queue().submit([encoder.finish()]);
        voxelizer.check().unwrap();
        answer.map_async(wgpu::MapMode::Read, .., |_| {});
        gpu.wait().unwrap();
        let texels = answer.get_mapped_range(..).unwrap();
        for z in 0..67u32 {
            for y in 0..30u32 {
                for x in 0..41u32 {
                    let texel = texels[((z * 30 + y) * 256 + x) as usize];
                    assert_eq!(
                        texel,
                        if expected.get([x, y, z]) { 255 } else { 0 },
                        "[{x}, {y}, {z}] on {}",
                        gpu.info()
                    );
                }
            }
        }
    }
}
