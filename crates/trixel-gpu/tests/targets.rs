//! Render targets of `tiled` against one triangle after the other on the CPU.

#![expect(clippy::unwrap_used, clippy::panic, reason = "a failure here is a failed test")]
#![expect(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "made-up numbers that fit")]

use std::collections::BTreeMap;

use trixel::conformance::random::{Placement, Random, triangle};
use trixel::conformance::zoo;
use trixel::lattice::LatticeMesh;
use trixel::{Grid, Job, Mesh, Mode, Strategy, Volume, VoxelOrder, voxel_list};
use trixel_gpu::{
    AdapterChoice, Blend, Gpu, GpuError, GpuMesh, GpuTargets, GpuVolume, Options, Source, Target, Voxelizer, wgpu,
};

const DRIVERS: [&str; 2] = ["llvmpipe", "SwiftShader"];

fn open(name: &str) -> Gpu {
    Gpu::open(&AdapterChoice::Named(name.to_owned())).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// A device with no more than WebGPU promises, and bindings of so many bytes.
fn least(binding_bytes: u64) -> Gpu {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN));
    let adapter = adapters.into_iter().find(|adapter| adapter.get_info().name.contains("llvmpipe")).unwrap();
    let required_limits = wgpu::Limits { max_storage_buffer_binding_size: binding_bytes, ..wgpu::Limits::default() };
    let descriptor = wgpu::DeviceDescriptor { required_limits, ..Default::default() };
    let (device, queue) = pollster::block_on(adapter.request_device(&descriptor)).unwrap();
    Gpu::from_device(device, queue)
}

fn grid(dims: [u32; 3]) -> Grid {
    Grid::new([0.0; 3], [1.0; 3], dims).unwrap()
}

fn tiled(grid: Grid, mode: Mode) -> Job {
    Job::new(grid, mode).with_strategy(Strategy::Tiled)
}

/// Triangles of all sizes that tie with everything, in and around a box of so many voxels.
fn tangle(seed: u64, count: usize, most: i64) -> Mesh {
    let mut random = Random::new(seed);
    let triangles: Vec<[[f64; 3]; 3]> = (0..count)
        .map(|i| {
            let extent = [1, 3, 9, 40][i / 5 % 4];
            let corners = triangle(&mut random, Placement::ALL[i % 5], -2, most, extent);
            corners.map(|corner| corner.map(|c| c as f64 / 65536.0))
        })
        .collect();
    zoo::soup(&triangles)
}

/// Arbitrary values, some of which overflow when added up.
fn values(seed: u64, mesh: &Mesh) -> Vec<u32> {
    let mut random = Random::new(seed);
    mesh.triangles.iter().map(|_| random.bits() as u32).collect()
}

/// The triangles of each voxel: each triangle voxelized alone.
fn triangles_of(mesh: &Mesh, job: &Job) -> BTreeMap<[u32; 3], Vec<usize>> {
    let job = job.with_strategy(Strategy::Auto);
    let mut voxels: BTreeMap<_, Vec<usize>> = BTreeMap::new();
    let mut last = ([[0.0; 3]; 3], vec![]);
    for (number, triangle) in mesh.triangles.iter().enumerate() {
        let corners = triangle.map(|vertex| mesh.positions[vertex as usize]);
        // Copies follow each other.
        if number == 0 || corners != last.0 {
            let alone = trixel::voxelize(&zoo::soup(&[corners]), &job).unwrap();
            last = (corners, voxel_list(&alone, VoxelOrder::Xyz));
        }
        for voxel in &last.1 {
            voxels.entry(*voxel).or_default().push(number);
        }
    }
    voxels
}

fn blended(target: &Target<'_>, triangles: &[usize]) -> u32 {
    let painted = triangles.iter().map(|&triangle| match target.source {
        Source::Triangle => triangle as u32,
        Source::One => 1,
        Source::Values(values) => values[triangle],
    });
    match target.blend {
        Blend::Min => painted.min().unwrap(),
        Blend::Max => painted.max().unwrap(),
        Blend::Add => painted.fold(0, u32::wrapping_add),
    }
}

fn run(gpu: &Gpu, mesh: &Mesh, job: &Job, targets: &[Target<'_>]) -> Result<(GpuTargets, Volume), GpuError> {
    let lattice = LatticeMesh::snap(mesh, job.grid()).unwrap();
    let on_gpu = GpuMesh::upload(gpu, &lattice).unwrap();
    let voxels = GpuVolume::new(gpu, *job.grid()).unwrap();
    let mut voxelizer = Voxelizer::new(gpu, job, &Options::default()).unwrap();
    let found = voxelizer.tiled_targets(&on_gpu, &voxels, targets)?;
    let mut volume = Volume::new(*job.grid()).unwrap();
    voxels.download(gpu, &mut volume).unwrap();
    Ok((found, volume))
}

/// Every voxel, bit and value.
fn compare(gpu: &Gpu, what: &str, mesh: &Mesh, job: &Job, targets: &[Target<'_>]) -> GpuTargets {
    let what = format!("{what} {} {}", job.mode(), gpu.info());
    let expected = triangles_of(mesh, job);
    let (found, volume) = run(gpu, mesh, job, targets).unwrap();
    let voxels = found.list().download(gpu).unwrap();
    assert!(voxels.iter().eq(expected.keys()), "{what}: {} voxels of {}", voxels.len(), expected.len());
    assert!(voxel_list(&volume, VoxelOrder::Xyz) == voxels, "{what}: the bits");
    let read = found.download(gpu).unwrap();
    assert_eq!(read.len(), targets.len(), "{what}");
    for (target, values) in targets.iter().zip(&read) {
        let shown = (target.blend, std::mem::discriminant(&target.source));
        let expected: Vec<u32> = expected.values().map(|triangles| blended(target, triangles)).collect();
        assert_eq!(values.len(), expected.len(), "{what}");
        if let Some(i) = values.iter().zip(&expected).position(|(a, b)| a != b) {
            panic!("{what} {shown:?}: {:?} has {}, not {}", voxels[i], values[i], expected[i]);
        }
    }
    found
}

#[test]
fn every_blend_is_that_of_the_triangles_one_by_one() {
    for driver in DRIVERS {
        let gpu = open(driver);
        let slow = driver == "SwiftShader";
        let mesh = tangle(1, if slow { 60 } else { 300 }, 37);
        let values = [values(2, &mesh), values(3, &mesh)];
        let all = [
            Target::ID,
            Target::COUNT,
            Target::max(&values[0]),
            Target::min(&values[1]),
            Target::add(&values[0]),
            Target { blend: Blend::Max, source: Source::Triangle },
            Target { blend: Blend::Add, source: Source::Triangle },
        ];
        // Tiles that end beyond the grid on all sides.
        let dims = grid([37, 21, 75]);
        for mode in [Mode::Conservative, Mode::Thin] {
            compare(&gpu, "all", &mesh, &tiled(dims, mode), &all[..if slow { 5 } else { 7 }]);
        }
        compare(&gpu, "one", &mesh, &tiled(dims, Mode::Thin), &[Target::ID]);
        if !slow {
            compare(&gpu, "three", &mesh, &tiled(dims, Mode::Conservative), &all[..3]);
            // As many as 32 KiB hold.
            let most: Vec<_> = all.iter().copied().cycle().take(15).collect();
            compare(&gpu, "fifteen", &mesh, &tiled(dims, Mode::Conservative), &most);
            let overlapping = tiled(dims, Mode::Sliced).with_overlap(1.6).unwrap();
            compare(&gpu, "slices", &mesh, &overlapping, &all[..2]);
        }
    }
}

#[test]
fn tiles_that_workgroups_share_blend_the_same() {
    // 2600 triangles in each voxel, more than two workgroups take, and some that leave the tile.
    let crumb = [[3.1, 3.2, 3.3], [3.9, 3.4, 3.5], [3.2, 3.8, 3.7]];
    let mesh = zoo::merged(&[zoo::soup(&vec![crumb; 2600]), tangle(5, 500, 12)]);
    let values = values(6, &mesh);
    let targets = [Target::ID, Target::COUNT, Target::add(&values), Target::max(&values)];
    for driver in DRIVERS {
        let gpu = open(driver);
        let found = compare(&gpu, "crumbs", &mesh, &tiled(grid([12, 11, 10]), Mode::Conservative), &targets);
        assert!(found.appended() > found.list().len(), "{driver}: no tile was shared");
    }
}

#[test]
fn loops_stay_short_in_the_worst_tile() {
    // Every invocation takes as many pairs as it ever does, each with as many voxels of the tile as a triangle can have.
    let steep = [[-30.0, 4.0, -20.0], [40.0, 4.0, -90.0], [5.0, 4.3, 130.0]];
    let slanted = [[-30.0, -30.0, 0.5], [40.0, -29.0, 24.0], [4.0, 60.0, 31.0]];
    let mesh = zoo::soup(&[vec![steep; 2048], vec![slanted; 2048]].concat());
    // Every axis by turns, so that lanes which run in step take every branch.
    let turned = |k: usize| slanted.map(|corner: [f64; 3]| std::array::from_fn(|axis| corner[(axis + k) % 3]));
    let mixed = zoo::soup(&(0..4096).map(turned).collect::<Vec<_>>());
    let gpu = open("llvmpipe");
    compare(&gpu, "mixed walls", &mixed, &tiled(grid([8, 8, 32]), Mode::Conservative), &[Target::COUNT]);
    for mode in [Mode::Conservative, Mode::Sliced] {
        compare(&gpu, "walls", &mesh, &tiled(grid([8, 8, 32]), mode), &[Target::COUNT]);
    }
    let overlapping = tiled(grid([8, 8, 32]), Mode::Sliced).with_overlap(40.0).unwrap();
    compare(&gpu, "full", &mesh, &overlapping, &[Target::COUNT]);
}

#[test]
fn chunks_and_slabs_of_small_bindings_blend_the_same() {
    // A limit that cuts mesh and grid: 16,666 vertices a chunk.
    let gpu = least(200_000);
    let copies = zoo::soup(&vec![[[0.5; 3], [1.5, 0.5, 0.6], [0.7, 1.4, 0.5]]; 6000]);
    let across = zoo::soup(&[[[0.5, 3.5, 4.5], [333.5, 3.6, 60.5], [333.5, 8.5, 4.5]]]);
    let mesh = zoo::merged(&[tangle(7, 40, 30), across, copies]);
    let dims = grid([334, 40, 66]);
    assert!(GpuVolume::new(&gpu, dims).unwrap().slabs().len() > 1);
    let values = (0..mesh.triangles.len() as u32).collect::<Vec<_>>();
    let job = tiled(dims, Mode::Thin);
    let found = compare(&gpu, "small bindings", &mesh, &job, &[Target::ID, Target::add(&values)]);
    assert!(found.appended() > found.list().len(), "one chunk");
}

#[test]
fn more_rows_than_guessed_take_another_run() {
    // Every voxel of the grid.
    let plates: Vec<_> = (0..40)
        .flat_map(|z| {
            let z = f64::from(z) + 0.5;
            [[[0.0, 0.0, z], [40.0, 0.0, z], [0.0, 40.0, z]], [[40.0, 40.0, z], [40.0, 0.0, z], [0.0, 40.0, z]]]
        })
        .collect();
    let mesh = zoo::soup(&plates);
    let found = compare(&open("llvmpipe"), "plates", &mesh, &tiled(grid([40; 3]), Mode::Thin), &[Target::COUNT]);
    assert_eq!(found.list().len(), 64_000);
    assert_eq!(found.bytes(), 4 * 64_000);
}

#[test]
fn a_mesh_of_nothing_blends_nothing() {
    for driver in DRIVERS {
        let gpu = open(driver);
        let job = tiled(grid([5, 6, 7]), Mode::Conservative);
        let nothing = compare(&gpu, "empty", &Mesh::new(vec![], vec![]), &job, &[Target::ID, Target::max(&[])]);
        assert!(nothing.list().is_empty() && nothing.appended() == 0);
        // Outside the grid, and so degenerate that thin has nothing of it.
        let outside = zoo::soup(&[[[20.0; 3], [21.0; 3], [22.0, 20.0, 20.0]]]);
        assert!(compare(&gpu, "outside", &outside, &job, &[Target::COUNT]).list().is_empty());
    }
}

#[test]
fn a_programs_own_buffers_are_counted() {
    // Nothing is known of the triangles before they are counted.
    let gpu = open("llvmpipe");
    let (mesh, dims) = (tangle(9, 120, 20), grid([20, 21, 40]));
    let lattice = LatticeMesh::snap(&mesh, &dims).unwrap();
    let positions: Vec<i32> =
        (0..lattice.positions.len() as u32).flat_map(|i| lattice.positions.get(i)).map(|c| c as i32).collect();
    let buffer = |bytes: &[u8]| gpu.buffer_with("test", bytes, wgpu::BufferUsages::STORAGE).unwrap();
    let indices: Vec<u8> = lattice.triangles.as_flattened().iter().flat_map(|i| i.to_le_bytes()).collect();
    let positions: Vec<u8> = positions.iter().flat_map(|c| c.to_le_bytes()).collect();
    let own = GpuMesh::from_buffers(buffer(&positions), buffer(&indices), mesh.triangles.len() as u32);
    let job = tiled(dims, Mode::Conservative);
    let voxels = GpuVolume::new(&gpu, dims).unwrap();
    let found = Voxelizer::new(&gpu, &job, &Options { count: true, ..Options::default() })
        .unwrap()
        .tiled_targets(&own, &voxels, &[Target::COUNT, Target::ID])
        .unwrap();
    let expected = compare(&gpu, "uploaded", &mesh, &job, &[Target::COUNT, Target::ID]);
    assert_eq!(found.download(&gpu).unwrap(), expected.download(&gpu).unwrap());
}

#[test]
fn what_cannot_be_blended_says_why() {
    let gpu = least(1 << 27);
    let mesh = tangle(11, 10, 8);
    let job = tiled(grid([8; 3]), Mode::Thin);
    let refused = |job: &Job, targets: &[Target<'_>]| run(&gpu, &mesh, job, targets).map(drop).unwrap_err();

    // WebGPU's least memory holds seven.
    run(&gpu, &mesh, &job, &[Target::ID; 7]).unwrap();
    for count in [0, 8, 100] {
        let error = refused(&job, &vec![Target::COUNT; count]);
        assert!(matches!(error, GpuError::TargetCount { most: 7, given, .. } if given == count), "{error}");
        assert!(error.to_string().contains("1 to 7"), "{error}");
    }
    let error = refused(&job, &[Target::ID, Target::max(&[1, 2, 3])]);
    assert!(matches!(error, GpuError::TargetValues { target: 1, given: 3, triangles: 10 }), "{error}");

    let hybrid = job.with_strategy(Strategy::Hybrid);
    assert!(matches!(refused(&hybrid, &[Target::ID]), GpuError::NoTargets { strategy: Strategy::Hybrid, .. }));
    let solid = tiled(*job.grid(), Mode::Solid);
    assert!(matches!(refused(&solid, &[Target::ID]), GpuError::NoTargets { mode: Mode::Solid, .. }));

    let huge = zoo::soup(&[[[-9000.0, 1.0, 1.0], [9000.0, 2.0, 2.0], [1.0, 3.0, 9000.0]]]);
    let error = run(&gpu, &huge, &job, &[Target::ID]).map(drop).unwrap_err();
    assert!(matches!(error, GpuError::TrianglesTooLarge(1)), "{error}");
}
