//! Attributes on the GPU against the CPU's, and cases whose values are known.

#![expect(clippy::unwrap_used, clippy::panic, reason = "a failure here is a failed test")]
#![expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "made-up numbers that fit")]

use std::sync::Mutex;

use trixel::attributes::{AttributeKind, AttributeRequest, Combine, Values, VoxelAttributes, compute};
use trixel::conformance::random::{Placement, Random, triangle};
use trixel::conformance::zoo;
use trixel::lattice::LatticeMesh;
use trixel::{
    AlphaMode, Attribute, Filter, Grid, Image, ImageSource, Job, Material, Mesh, Mode, Rank, Strategy, Texture,
    TextureRef, Volume, Wrap,
};
use trixel_gpu::{
    AdapterChoice, Gpu, GpuAttributes, GpuError, GpuMesh, GpuSurface, GpuVolume, Options, Voxelizer, strategies_of,
    wgpu,
};

const DRIVERS: [&str; 2] = ["llvmpipe", "SwiftShader"];

/// One device for all tests: its pipelines take longer to build than the tests to run.
fn open(name: &'static str) -> Gpu {
    static OPEN: Mutex<Vec<(&str, Gpu)>> = Mutex::new(vec![]);
    let mut open = OPEN.lock().unwrap();
    if let Some((_, gpu)) = open.iter().find(|(there, _)| *there == name) {
        return gpu.clone();
    }
    let gpu = Gpu::open(&AdapterChoice::Named(name.to_owned())).unwrap_or_else(|error| panic!("{name}: {error}"));
    open.push((name, gpu.clone()));
    gpu
}

fn on_gpu(gpu: &Gpu, mesh: &Mesh, job: &Job, request: &AttributeRequest) -> (GpuAttributes, VoxelAttributes) {
    let lattice = LatticeMesh::snap(mesh, job.grid()).unwrap();
    let voxels = GpuVolume::new(gpu, *job.grid()).unwrap();
    let mut voxelizer = Voxelizer::new(gpu, job, &Options::default()).unwrap();
    voxelizer.run(&GpuMesh::upload(gpu, &lattice).unwrap(), &voxels).unwrap();
    let surface = GpuSurface::upload(gpu, mesh, &lattice, job.grid(), request).unwrap();
    let attributes = voxelizer.attributes(&surface, &voxels).unwrap();
    let downloaded = attributes.download(gpu, mesh).unwrap();
    (attributes, downloaded)
}

fn on_cpu(mesh: &Mesh, job: &Job, request: &AttributeRequest) -> (Volume, VoxelAttributes) {
    let job = job.with_strategy(Strategy::Auto);
    let volume = trixel::voxelize(mesh, &job).unwrap();
    let lattice = LatticeMesh::snap(mesh, job.grid()).unwrap();
    let attributes = compute(mesh, &lattice, &job, &volume, request).unwrap();
    (volume, attributes)
}

/// Every bit the same.
fn compare(gpu: &Gpu, what: &str, mesh: &Mesh, job: &Job, request: &AttributeRequest) {
    let (_, expected) = on_cpu(mesh, job, request);
    let (_, found) = on_gpu(gpu, mesh, job, request);
    let what = format!("{what} {} {} {}", job.mode(), request.combine().name(), gpu.info());
    assert_eq!(found.voxels(), expected.voxels(), "{what}");
    assert_eq!(found.offsets(), expected.offsets(), "{what}");
    for ((kind, found), (_, expected)) in found.columns().iter().zip(expected.columns()) {
        assert_eq!(found.len(), expected.len(), "{what} {}", kind.name());
        let differs = |row: &usize| {
            let [mut a, mut b] = [vec![], vec![]];
            found.append_row(*row, &mut a);
            expected.append_row(*row, &mut b);
            a != b
        };
        let wrong: Vec<usize> = (0..found.len()).filter(differs).collect();
        if let Some(&first) = wrong.first() {
            let (name, rows, wrong) = (kind.name(), found.len(), wrong.len());
            panic!("{what}: {wrong} of {rows} rows of {name}, row {first}: {}", shown(found, expected, first));
        }
    }
    assert!(found == expected, "{what}: which voxels have triangles");
}

fn shown(found: &Values, expected: &Values, row: usize) -> String {
    match (found, expected) {
        (Values::U8x4(a), Values::U8x4(b)) => format!("{:?}, not {:?}", a[row], b[row]),
        (Values::F32x2(a), Values::F32x2(b)) => format!("{:?}, not {:?}", a[row], b[row]),
        (Values::F32x3(a), Values::F32x3(b)) => format!("{:?}, not {:?}", a[row], b[row]),
        (Values::U32(a), Values::U32(b)) => format!("{:?}, not {:?}", a[row], b[row]),
        _ => "another type".to_owned(),
    }
}

fn everything(combine: Combine) -> AttributeRequest {
    AttributeRequest::new(&AttributeKind::ALL, combine)
}

/// A picture of noise.
fn noise(random: &mut Random, width: u32, height: u32) -> Image {
    let pixels = (0..width * height * 4).map(|_| (random.bits() >> 40) as u8).collect();
    Image { name: String::new(), source: ImageSource::Rgba8 { width, height, pixels } }
}

/// Gives a mesh all that a surface can have: vertex colours, normals with some missing, two sets of texture coordinates far
/// out and upside down, and materials of every kind on textures of odd sizes.
fn dressed(mesh: &mut Mesh, seed: u64) {
    let mut random = Random::new(seed);
    let vertices = mesh.positions.len();
    let mut three = |low: i64, high: i64| [0; 3].map(|_| random.range(low, high) as f32 / 100.0);
    let normals: Vec<[f32; 3]> = (0..vertices).map(|_| three(-100, 100)).collect();
    let colors = (0..vertices).map(|_| three(0, 100)).map(|[r, g, b]| [r, g, b, 0.25 + 0.75 * g]).collect();
    let uvs: Vec<Vec<[f32; 2]>> =
        (0..2).map(|_| (0..vertices).map(|_| three(-400, 400)).map(|[u, v, _]| [u, v]).collect()).collect();
    let corners = mesh.triangles.iter().enumerate();
    let corners = corners.map(|(i, corners)| if i % 7 == 3 { [Attribute::<[f32; 3]>::NONE; 3] } else { *corners });
    mesh.normals = Some(Attribute { values: normals, corners: Some(corners.collect()) });
    mesh.colors = Some(Attribute::per_vertex(colors));
    mesh.uvs = uvs.into_iter().map(Attribute::per_vertex).collect();
    mesh.images = vec![noise(&mut random, 5, 3), noise(&mut random, 64, 48), noise(&mut random, 1, 9)];
    let texture = |image, wrap, filter, mipmaps| Texture { image, wrap, filter, mipmaps };
    mesh.textures = vec![
        texture(0, [Wrap::Mirror, Wrap::Clamp], Filter::Linear, false),
        texture(1, [Wrap::Repeat, Wrap::Mirror], Filter::Linear, true),
        texture(2, [Wrap::Clamp, Wrap::Repeat], Filter::Nearest, false),
        texture(1, [Wrap::Repeat; 2], Filter::Nearest, true),
        // An image that is not there.
        texture(9, [Wrap::Repeat; 2], Filter::Linear, true),
    ];
    let used = |texture, uv_set| {
        let transform = [[0.7, -0.4, 0.1], [0.2, 1.3, -2.5]];
        Some(TextureRef { uv_set, transform, ..TextureRef::new(texture) })
    };
    let plain = Material { base_color: [0.9, 0.5, 0.7, 0.6], emissive: [0.1, 3.0, 70_000.0], ..Material::default() };
    mesh.materials = vec![
        Material { base_color_texture: used(0, 1), emissive_texture: used(3, 0), ..plain.clone() },
        Material {
            base_color_texture: used(1, 0),
            alpha_mode: AlphaMode::Mask { cutoff: 0.25 },
            metallic_roughness_texture: used(2, 1),
            ..plain.clone()
        },
        Material {
            alpha_mode: AlphaMode::Blend,
            opacity_texture: used(1, 1),
            base_color_texture: used(3, 0),
            metallic: 0.3,
            roughness: 0.8,
            ..plain.clone()
        },
        Material { base_color_texture: used(4, 0), emissive_texture: used(1, 5), ..plain },
    ];
    mesh.triangle_materials = (0..mesh.triangles.len()).map(|_| random.range(0, 4) as u32).collect();
}

/// Triangles of all sizes that tie with everything.
fn tangle(seed: u64, count: usize) -> Mesh {
    let mut random = Random::new(seed);
    let triangles: Vec<[[f64; 3]; 3]> = (0..count)
        .map(|i| {
            let extent = [1, 3, 9, 40][i / 5 % 4];
            let corners = triangle(&mut random, Placement::ALL[i % 5], -2, 18, extent);
            corners.map(|corner| corner.map(|c| c as f64 / 65536.0))
        })
        .collect();
    let mut mesh = zoo::soup(&triangles);
    dressed(&mut mesh, seed + 1);
    mesh
}

fn grid(dims: [u32; 3]) -> Grid {
    Grid::new([0.0; 3], [1.0; 3], dims).unwrap()
}

#[test]
fn every_rule_and_channel_is_the_cpus() {
    let mesh = tangle(1, 90);
    let gpu = open("llvmpipe");
    for combine in Combine::ALL {
        compare(&gpu, "tangle", &mesh, &Job::new(grid([18, 17, 40]), Mode::Conservative), &everything(combine));
    }
    let few = AttributeRequest::new(&[AttributeKind::Color, AttributeKind::Normal], Combine::Mean);
    let more = tangle(7, 700);
    compare(&gpu, "larger tangle", &more, &Job::new(grid([18, 17, 70]), Mode::Thin), &few);
    compare(&gpu, "larger tangle", &more, &Job::new(grid([18, 17, 70]), Mode::Conservative), &few);
}

#[test]
fn the_other_driver_agrees() {
    let mesh = tangle(3, 30);
    let gpu = open("SwiftShader");
    for combine in [Combine::AreaWeighted, Combine::All] {
        compare(&gpu, "tangle", &mesh, &Job::new(grid([12, 11, 14]), Mode::Conservative), &everything(combine));
    }
}

#[test]
fn every_mode_and_strategy_has_the_same_fragments() {
    let mut mesh = tangle(5, 60);
    let gpu = open("llvmpipe");
    let request = AttributeRequest::new(&[AttributeKind::Color, AttributeKind::Triangle], Combine::All);
    let dims = grid([16, 15, 20]);
    for mode in [Mode::Thin, Mode::Sliced] {
        compare(&gpu, "tangle", &mesh, &Job::new(dims, mode), &request);
    }
    let sliced = Job::new(dims, Mode::Sliced).with_overlap(3.7).unwrap();
    compare(&gpu, "overlapping slices", &mesh, &sliced, &everything(Combine::Nearest));
    for mode in [Mode::Conservative, Mode::Sliced] {
        for strategy in strategies_of(mode) {
            compare(&gpu, strategy.name(), &mesh, &Job::new(dims, mode).with_strategy(strategy), &request);
        }
    }
    // A solid's inside is whatever parity says; its shell must be the CPU's, degenerate triangles and all.
    compare(&gpu, "tangle", &mesh, &Job::new(dims, Mode::Solid), &request);
    mesh = zoo::merged(&[zoo::octahedron([9.0, 8.0, 10.0], 6.7), zoo::cube([1.0, 1.0, 1.0], 3.0)]);
    dressed(&mut mesh, 9);
    for combine in [Combine::Mean, Combine::All] {
        compare(&gpu, "solids", &mesh, &Job::new(dims, Mode::Solid), &everything(combine));
    }
}

#[test]
fn materials_with_priorities_are_alone_in_their_voxels() {
    let mesh = tangle(11, 80);
    let gpu = open("llvmpipe");
    for combine in [Combine::Mean, Combine::First] {
        let request = everything(combine).with_priorities(vec![1, 5, 0, 5]);
        compare(&gpu, "priorities", &mesh, &Job::new(grid([12, 13, 14]), Mode::Conservative), &request);
    }
}

#[test]
fn triangles_of_any_size_are_exact() {
    // Up to 7000 voxels long, with the grid a window on them; and one of a few steps.
    let mut mesh = zoo::soup(&[
        [[-3000.3, -20.0, 1.5], [3999.7, 40.25, 22.0], [-100.0, 3500.5, -700.0]],
        [[0.0, 0.0, 0.0], [24.0, 0.0, 24.0], [0.0, 24.0, 24.0]],
        [[5.5, 5.5, 5.5], [5.50002, 5.5, 5.5], [5.5, 5.50004, 5.5]],
        [[-70.0, 9.1, 9.0], [90.0, 9.1, 9.0], [8.0, 9.1, 9.0]],
        [[3.0, 3.0, 3.0], [3.0, 3.0, 3.0], [3.0, 3.0, 3.0]],
    ]);
    dressed(&mut mesh, 13);
    let gpu = open("llvmpipe");
    for combine in [Combine::AreaWeighted, Combine::All] {
        compare(&gpu, "sizes", &mesh, &Job::new(grid([24; 3]), Mode::Conservative), &everything(combine));
    }
    let far = zoo::soup(&[[[-9000.0, 0.0, 1.0], [9000.0, 0.0, 1.0], [0.0, 9000.0, 1.0]]]);
    let lattice = LatticeMesh::snap(&far, &grid([4; 3])).unwrap();
    let refused = GpuSurface::upload(&gpu, &far, &lattice, &grid([4; 3]), &everything(Combine::First));
    assert!(matches!(refused, Err(GpuError::TrianglesTooLarge(1))), "{refused:?}");
}

#[test]
fn nothing_gives_nothing() {
    let gpu = open("llvmpipe");
    let job = Job::new(grid([4; 3]), Mode::Conservative);
    compare(&gpu, "empty", &Mesh::new(vec![], vec![]), &job, &everything(Combine::Mean));
    compare(&gpu, "outside", &zoo::octahedron([90.0; 3], 2.0), &job, &everything(Combine::All));
    // Bare of everything that a mesh may leave out.
    compare(&gpu, "bare", &zoo::octahedron([2.0; 3], 1.7), &job, &everything(Combine::Mean));
}

#[test]
fn small_bindings_cut_the_work() {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN));
    let adapter = adapters.into_iter().find(|adapter| adapter.get_info().name.contains("llvmpipe")).unwrap();
    // What WebGPU has everywhere, but for the size: slabs of the grid, chunks of triangles, batches of voxels.
    let required_limits = wgpu::Limits { max_storage_buffer_binding_size: 100_000, ..wgpu::Limits::default() };
    let descriptor = wgpu::DeviceDescriptor { required_limits, ..Default::default() };
    let (device, queue) = pollster::block_on(adapter.request_device(&descriptor)).unwrap();
    let gpu = Gpu::from_device(device, queue);
    let mesh = tangle(17, 900);
    let few = |combine| AttributeRequest::new(&[AttributeKind::Color], combine);
    let job = Job::new(grid([17, 16, 90]), Mode::Conservative);
    for combine in [Combine::Mean, Combine::All] {
        compare(&gpu, "small bindings", &mesh, &job, &few(combine));
    }
}

/// A quad in the plane z = 2.5, from (0, 0) to (8, 8), of two triangles.
fn quad() -> Mesh {
    let mut mesh = zoo::quad([[0.0, 0.0, 2.5], [8.0, 0.0, 2.5], [8.0, 8.0, 2.5], [0.0, 8.0, 2.5]]);
    mesh.triangle_materials = vec![0, 1];
    mesh
}

fn colors(attributes: &VoxelAttributes) -> &[[u8; 4]] {
    match attributes.get(AttributeKind::Color) {
        Some(Values::U8x4(colors)) => colors,
        other => panic!("{other:?}"),
    }
}

#[test]
fn closed_forms() {
    let job = Job::new(grid([8, 8, 5]), Mode::Thin);
    let request = |combine| AttributeRequest::new(&[AttributeKind::Color, AttributeKind::Normal], combine);
    let material = |base_color| Material { base_color, ..Material::default() };
    let mut two = quad();
    two.materials = vec![material([1.0, 0.0, 0.0, 1.0]), material([0.0, 0.0, 1.0, 1.0])];
    // A texel a voxel.
    let mut checkered = quad();
    let texel = |x: u32, y: u32| if (x + y).is_multiple_of(2) { [255, 255, 255, 255] } else { [0, 0, 0, 255] };
    let pixels = (0..8).flat_map(|y| (0..8).flat_map(move |x| texel(x, y))).collect();
    checkered.images = vec![Image { name: String::new(), source: ImageSource::Rgba8 { width: 8, height: 8, pixels } }];
    checkered.textures = vec![Texture { image: 0, wrap: [Wrap::Repeat; 2], filter: Filter::Linear, mipmaps: true }];
    checkered.materials = vec![Material { base_color_texture: Some(TextureRef::new(0)), ..Material::default() }; 2];
    checkered.uvs =
        vec![Attribute::per_vertex(checkered.positions.iter().map(|p| [p[0], p[1]].map(|c| c as f32 / 8.0)).collect())];
    // Two sheets of opposite normals.
    let mut sheets = zoo::merged(&[quad(), zoo::inverted(quad())]);
    sheets.triangle_materials = vec![0; 4];
    for driver in DRIVERS {
        let gpu = open(driver);
        let (volume, _) = on_cpu(&two, &job, &request(Combine::Mean));
        let rank = Rank::new(&volume);
        let at = |x, y| usize::try_from(rank.of([x, y, 2]).unwrap()).unwrap();
        let (_, found) = on_gpu(&gpu, &two, &job, &request(Combine::First));
        assert_eq!([colors(&found)[at(6, 1)], colors(&found)[at(1, 6)]], [[255, 0, 0, 255], [0, 0, 255, 255]]);
        // On the diagonal both meet: half of the light of each, 188 in sRGB.
        let (_, found) = on_gpu(&gpu, &two, &job, &request(Combine::Mean));
        assert_eq!(colors(&found)[at(3, 3)], [188, 0, 188, 255]);
        let (_, found) = on_gpu(&gpu, &checkered, &job, &request(Combine::Nearest));
        for (x, y) in (0..8).flat_map(|x| (0..8).map(move |y| (x, y))) {
            assert_eq!(colors(&found)[at(x, y)], texel(x, y), "{x} {y}");
        }
        // Opposite normals cancel: the winner's stays, which is the lowest triangle's.
        let (_, found) = on_gpu(&gpu, &sheets, &job, &request(Combine::Mean));
        let Some(Values::F32x3(normals)) = found.get(AttributeKind::Normal) else { panic!() };
        assert_eq!(normals[at(6, 1)], [0.0, 0.0, 1.0]);
    }
}

#[test]
fn memory_follows_the_voxels() {
    let gpu = open("llvmpipe");
    let mut mesh = trixel::scene::build("torus:24").unwrap();
    dressed(&mut mesh, 19);
    let request = AttributeRequest::new(&[AttributeKind::Color, AttributeKind::Normal], Combine::Mean);
    let mut each = vec![];
    for resolution in [64, 128] {
        let job = Job::new(Grid::fit(&mesh.bounds().unwrap(), resolution).unwrap(), Mode::Conservative);
        let (attributes, found) = on_gpu(&gpu, &mesh, &job, &request);
        assert_eq!(attributes.bytes(), 16 * found.voxels() as u64);
        each.push(attributes.scratch_bytes() as f64 / found.voxels() as f64);
    }
    assert!(each[1] < 1.1 * each[0] && each[1] < 250.0, "{each:?} bytes a voxel");
}
