//! Octrees of the GPU with attributes against those of the CPU, bit for bit, and averages that are known.

#![expect(clippy::unwrap_used, clippy::panic, reason = "a failure here is a failed test")]
#![expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "made-up numbers that fit")]

use std::path::PathBuf;
use std::sync::Mutex;

use trixel::attributes::{AttributeKind, AttributeRequest, Combine, Described, compute};
use trixel::conformance::random::{Placement, Random, triangle};
use trixel::conformance::zoo;
use trixel::lattice::LatticeMesh;
use trixel::octree::{Look, Octree};
use trixel::{
    AlphaMode, Attribute, Filter, Grid, Image, ImageSource, Job, Material, Mesh, Mode, Rank, Texture, TextureRef,
    Volume, VoxelOrder, Wrap,
};
use trixel_gpu::{
    AdapterChoice, Gpu, GpuAttributes, GpuError, GpuOctree, GpuSurface, GpuVolume, GpuVoxelList, GridRay, ListMethod,
    Options, Voxelizer, wgpu,
};
use trixel_io::textures::decode_textures;

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

fn grid(dims: [u32; 3]) -> Grid {
    Grid::new([0.0; 3], [1.0; 3], dims).unwrap()
}

fn colors_and_normals() -> AttributeRequest {
    AttributeRequest::new(&[AttributeKind::Color, AttributeKind::Normal], Combine::Mean)
}

fn built(
    gpu: &Gpu,
    mesh: &Mesh,
    job: &Job,
    volume: &Volume,
    request: &AttributeRequest,
) -> (GpuAttributes, GpuVoxelList, GpuOctree) {
    let lattice = LatticeMesh::snap(mesh, job.grid()).unwrap();
    let on_gpu = GpuVolume::new(gpu, *volume.grid()).unwrap();
    let bytes: Vec<u8> = volume.words().iter().flat_map(|word| word.to_le_bytes()).collect();
    let planes: usize = on_gpu.slabs().iter().map(|slab| slab.nx() as usize).sum();
    let mut rest = &bytes[..];
    for slab in on_gpu.slabs() {
        let (own, after) = rest.split_at(slab.nx() as usize * (bytes.len() / planes));
        gpu.queue().write_buffer(slab.buffer(), 0, own);
        rest = after;
    }
    let surface = GpuSurface::upload(gpu, mesh, &lattice, job.grid(), request).unwrap();
    let attributes = Voxelizer::new(gpu, job, &Options::default()).unwrap().attributes(&surface, &on_gpu).unwrap();
    let list = GpuVoxelList::of(gpu, &on_gpu, ListMethod::Scan, VoxelOrder::Morton).unwrap();
    let tree = GpuOctree::with_attributes(gpu, &list, &attributes).unwrap();
    (attributes, list, tree)
}

/// Nodes, looks and answers are the CPU's, for a volume that need not be the mesh's: voxels without triangles have no
/// attributes. The CPU's tree.
fn compare(gpu: &Gpu, mesh: &Mesh, job: &Job, volume: &Volume, request: &AttributeRequest) -> Octree {
    let what = format!("{} {} {:?} {}", job.mode(), request.combine().name(), volume.grid().dims(), gpu.info());
    let (_, _, tree) = built(gpu, mesh, job, volume, request);
    let lattice = LatticeMesh::snap(mesh, job.grid()).unwrap();
    let attributes = compute(mesh, &lattice, job, volume, request).unwrap();
    let rank = Rank::new(volume);
    let expected = Octree::new(volume, Some(&Described::new(&rank, &attributes).unwrap())).unwrap();
    let found = tree.download(gpu).unwrap();
    assert_eq!(found.nodes(), expected.nodes(), "{what}");
    for (name, found, expected) in
        [("nodes", found.node_looks(), expected.node_looks()), ("voxels", found.voxel_looks(), expected.voxel_looks())]
    {
        assert_eq!(found.len(), expected.len(), "{what}: looks of {name}");
        let wrong = (0..found.len()).find(|&i| found[i] != expected[i]);
        assert_eq!(wrong.map(|i| (i, found[i], expected[i])), None, "{what}: looks of {name}");
    }
    assert!(found == expected, "{what}");
    assert_eq!((tree.height(), tree.bytes() / 4), (expected.height(), expected.bytes() / 4), "{what}");
    let mut random = Random::new(71);
    let far = [[1 << 16, 0, 0], [0, u32::MAX, 0], [0, 0, 1 << 15]];
    let near = |_| volume.grid().dims().map(|d| random.range(0, i64::from(d) + 1) as u32);
    let asked: Vec<[u32; 3]> = (0..400).map(near).chain(volume.iter().step_by(7)).chain(far).collect();
    for level in (0..=expected.height() + 1).chain([40]) {
        let cells = tree.find(gpu, &asked, level).unwrap();
        for (voxel, cell) in asked.iter().zip(cells) {
            assert_eq!(cell, expected.find(*voxel, level), "{what}: {voxel:?} at level {level}");
        }
    }
    let looks: Vec<_> = asked.iter().map(|voxel| expected.look(*voxel)).collect();
    assert_eq!(tree.look(gpu, &asked).unwrap(), looks, "{what}");
    expected
}

/// Triangles of all sizes with vertex colours, normals of which some are missing, and materials: plain, transparent, cut out
/// and textured.
fn tangle(seed: u64, count: usize) -> Mesh {
    let mut random = Random::new(seed);
    let corners = |i: usize| {
        let extent = [1, 3, 9, 30][i / 5 % 4];
        triangle(&mut random, Placement::ALL[i % 5], -2, 18, extent).map(|corner| corner.map(|c| c as f64 / 65536.0))
    };
    let triangles: Vec<_> = (0..count).map(corners).collect();
    let mut mesh = zoo::soup(&triangles);
    let mut three = |low: i64| [0; 3].map(|_| random.range(low, 100) as f32 / 100.0);
    let vertices = mesh.positions.len();
    let colors = (0..vertices).map(|_| three(0)).map(|[r, g, b]| [r, g, b, 0.2 + 0.8 * g]).collect();
    let normals = (0..vertices).map(|_| three(-100)).collect();
    let uvs = (0..vertices).map(|_| three(-100)).map(|[u, v, _]| [u, v]).collect();
    let missing =
        |(i, corners): (usize, &[u32; 3])| if i % 7 == 3 { [Attribute::<[f32; 3]>::NONE; 3] } else { *corners };
    mesh.normals =
        Some(Attribute { values: normals, corners: Some(mesh.triangles.iter().enumerate().map(missing).collect()) });
    mesh.colors = Some(Attribute::per_vertex(colors));
    mesh.uvs = vec![Attribute::per_vertex(uvs)];
    let pixels = (0..5 * 3 * 4).map(|_| (random.bits() >> 40) as u8).collect();
    mesh.images = vec![Image { name: String::new(), source: ImageSource::Rgba8 { width: 5, height: 3, pixels } }];
    mesh.textures = vec![Texture { image: 0, wrap: [Wrap::Mirror; 2], filter: Filter::Linear, mipmaps: true }];
    let base_color_texture = Some(TextureRef::new(0));
    mesh.materials = vec![
        Material { base_color: [0.9, 0.5, 0.7, 0.6], ..Material::default() },
        Material { alpha_mode: AlphaMode::Blend, base_color_texture, ..Material::default() },
        Material { alpha_mode: AlphaMode::Mask { cutoff: 0.5 }, ..Material::default() },
        Material { base_color: [0.3, 0.2, 0.1, 0.0], alpha_mode: AlphaMode::Blend, ..Material::default() },
    ];
    mesh.triangle_materials = (0..mesh.triangles.len()).map(|_| random.range(0, 3) as u32).collect();
    mesh
}

/// A mesh's voxels, boxes so that there are full cubes of all sizes, and single voxels.
fn cluttered(random: &mut Random, mesh: &Mesh, job: &Job) -> Volume {
    let mut volume = trixel::voxelize(mesh, job).unwrap();
    let dims = job.grid().dims();
    for round in 0..12 {
        let size = if round < 4 { 17 } else { 1 };
        let low: [u32; 3] = dims.map(|d| random.range(0, i64::from(d) - 1) as u32);
        let high: [u32; 3] = std::array::from_fn(|i| (low[i] + size).min(dims[i]));
        for x in low[0]..high[0] {
            for y in low[1]..high[1] {
                (low[2]..high[2]).for_each(|z| volume.set([x, y, z]));
            }
        }
    }
    volume
}

#[test]
fn random_sets_give_the_trees_of_the_cpu() {
    let mut random = Random::new(61);
    let gpu = open("llvmpipe");
    let mesh = tangle(1, 60);
    for (dims, combine) in [
        ([40, 33, 70], Combine::Mean),
        ([40, 33, 70], Combine::All),
        ([64; 3], Combine::Mean),
        ([2, 130, 5], Combine::All),
        ([1, 1, 1], Combine::Mean),
    ] {
        let job = Job::new(grid(dims), Mode::Conservative);
        let volume = cluttered(&mut random, &mesh, &job);
        compare(&gpu, &mesh, &job, &volume, &AttributeRequest::new(&AttributeKind::ALL, combine));
    }
    // What is not asked for is white, or has no direction.
    let job = Job::new(grid([20, 17, 18]), Mode::Thin);
    let volume = cluttered(&mut random, &mesh, &job);
    use AttributeKind as Kind;
    for kinds in [&[Kind::Color][..], &[Kind::Normal, Kind::Emission], &[Kind::Triangle], &[]] {
        compare(&gpu, &mesh, &job, &volume, &AttributeRequest::new(kinds, Combine::Mean));
    }
}

#[test]
fn the_other_driver_agrees() {
    let mut random = Random::new(67);
    let gpu = open("SwiftShader");
    let mesh = tangle(5, 30);
    let job = Job::new(grid([12, 21, 34]), Mode::Conservative);
    let volume = cluttered(&mut random, &mesh, &job);
    compare(&gpu, &mesh, &job, &volume, &colors_and_normals());
}

#[test]
fn nothing_and_everything_have_no_looks() {
    let gpu = open("llvmpipe");
    let job = Job::new(grid([16; 3]), Mode::Conservative);
    let nothing = Volume::new(*job.grid()).unwrap();
    let mesh = zoo::octahedron([90.0; 3], 2.0);
    let mut full = nothing.clone();
    full.words_mut().fill(0xffff);
    for volume in [&nothing, &full] {
        let tree = compare(&gpu, &mesh, &job, volume, &colors_and_normals());
        assert_eq!((tree.nodes().len(), tree.voxel_looks().len()), (0, 0));
    }
    // Full of voxels with attributes, nothing is pruned.
    let mesh = zoo::soup(&[[[-40.0, -40.0, 1.0], [80.0, -40.0, 1.0], [0.0, 80.0, 1.0]]]);
    let job = Job::new(grid([4, 4, 2]), Mode::Conservative);
    let volume = trixel::voxelize(&mesh, &job).unwrap();
    assert_eq!(volume.count(), 32);
    let tree = compare(&gpu, &mesh, &job, &volume, &colors_and_normals());
    assert_eq!((tree.nodes().len(), tree.voxel_looks().len()), (5, 32));
}

#[test]
fn a_solid_keeps_its_shell_and_its_inside_collapses() {
    let mut mesh = zoo::octahedron([32.0; 3], 30.0);
    mesh.materials = [[1.0, 0.0, 0.0, 1.0], [0.0, 0.25, 1.0, 1.0]]
        .map(|base_color| Material { base_color, ..Material::default() })
        .to_vec();
    mesh.triangle_materials = (0..mesh.triangles.len() as u32).map(|i| i % 2).collect();
    let job = Job::new(grid([64; 3]), Mode::Solid);
    let volume = trixel::voxelize(&mesh, &job).unwrap();
    for driver in DRIVERS {
        let tree = compare(&open(driver), &mesh, &job, &volume, &colors_and_normals());
        let voxels = tree.voxel_looks().len() as u64;
        assert!(2 * voxels < volume.count(), "{voxels} of {} voxels", volume.count());
        let inside = tree.find([32; 3], 2).unwrap();
        assert!(inside.full && inside.look.is_none(), "{inside:?}");
        // Rays meet the shell, whose looks can be asked for at any level.
        let gpu = open(driver);
        let (_, _, on_gpu) = built(&gpu, &mesh, &job, &volume, &colors_and_normals());
        let rays: Vec<_> = (0..64).map(|i| GridRay::new([-999, 256 * i + 77, 8200], [9, 1, 0]).unwrap()).collect();
        let hits: Vec<_> = on_gpu.march(&gpu, &rays).unwrap().into_iter().flatten().map(|hit| hit.voxel).collect();
        assert!(hits.len() > 40, "{} hits", hits.len());
        for level in 0..4 {
            let cells = on_gpu.find(&gpu, &hits, level).unwrap();
            assert!(cells.iter().all(|cell| cell.is_some_and(|cell| cell.look.is_some())));
            assert!(cells.iter().zip(&hits).all(|(cell, voxel)| *cell == tree.find(*voxel, level)));
        }
    }
}

#[test]
fn a_textured_model_has_the_tree_of_the_cpu() {
    let beside = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/models");
    let folder = std::env::var_os("TRIXEL_MODELS").map_or(beside, PathBuf::from);
    if !folder.is_dir() {
        println!("no folder of real meshes: nothing to compare");
        return;
    }
    let mut loaded = trixel_io::read::read_mesh(&folder.join("duck/Duck.glb"), &Default::default()).unwrap();
    assert!(decode_textures(&mut loaded.mesh).is_empty());
    let job = Job::new(Grid::fit(&loaded.mesh.bounds().unwrap(), 80).unwrap(), Mode::Conservative);
    let volume = trixel::voxelize(&loaded.mesh, &job).unwrap();
    let tree = compare(&open("llvmpipe"), &loaded.mesh, &job, &volume, &colors_and_normals());
    // A yellow duck, also from afar.
    let [red, green, blue, alpha] = tree.node_looks()[0].color;
    assert!(red > 200 && green > 150 && blue < 100 && alpha == 255, "{:?}", tree.node_looks()[0]);
}

/// Two quads in the plane z = 2.5 that share no voxel, in x from 0 to 3 and from 4 to 7, of these materials.
fn halves(left: Material, right: Material) -> Mesh {
    let quad = |x: f64| zoo::quad([[x, 0.5, 2.5], [x + 3.0, 0.5, 2.5], [x + 3.0, 7.5, 2.5], [x, 7.5, 2.5]]);
    let mut mesh = zoo::merged(&[quad(0.5), quad(4.5)]);
    mesh.materials = vec![left, right];
    mesh.triangle_materials = vec![0, 0, 1, 1];
    mesh
}

#[test]
fn averages_are_those_of_light() {
    let opaque = |r, g, b| Material { base_color: [r, g, b, 1.0], ..Material::default() };
    let blended = Material { base_color: [0.0, 0.0, 1.0, 0.5], alpha_mode: AlphaMode::Blend, ..Material::default() };
    let transparent = Material { base_color: [1.0, 1.0, 1.0, 0.0], ..blended.clone() };
    let job = Job::new(grid([8; 3]), Mode::Conservative);
    let (up, red) = ([0.0, 0.0, 1.0], [255, 0, 0, 255]);
    for driver in DRIVERS {
        let gpu = open(driver);
        // At each level, the left half and the right; then both.
        for (right, right_color, both) in [
            // Half of the light of each, 188 in sRGB.
            (opaque(0.0, 0.0, 1.0), [0, 0, 255, 255], [188, 0, 188, 255]),
            // 2/3 and 1/3 of it, and 3/4 of the alpha.
            (blended.clone(), [0, 0, 255, 128], [213, 0, 156, 192]),
            // What cannot be seen has no part in the colour.
            (transparent.clone(), [0; 4], [255, 0, 0, 128]),
        ] {
            let mesh = halves(opaque(1.0, 0.0, 0.0), right);
            let volume = trixel::voxelize(&mesh, &job).unwrap();
            assert_eq!(volume.count(), 64);
            let (_, _, tree) = built(&gpu, &mesh, &job, &volume, &colors_and_normals());
            for level in 0..=3 {
                let cells = tree.find(&gpu, &[[3, 3, 2], [4, 6, 2]], level).unwrap();
                let looks: Vec<Look> = cells.iter().map(|cell| cell.unwrap().look.unwrap()).collect();
                let colors = if level == 3 { [both; 2] } else { [red, right_color] };
                assert_eq!(looks, colors.map(|color| Look { color, normal: up }), "{driver} {level}");
            }
            compare(&gpu, &mesh, &job, &volume, &colors_and_normals());
        }
        // Opposite normals cancel out, in the root only.
        let mut turned = halves(opaque(1.0, 0.0, 0.0), transparent.clone());
        turned.triangles.iter_mut().skip(2).for_each(|corners| corners.reverse());
        let volume = trixel::voxelize(&turned, &job).unwrap();
        let (_, _, tree) = built(&gpu, &turned, &job, &volume, &colors_and_normals());
        for (level, normal) in [(0, [0.0, 0.0, -1.0]), (2, [0.0, 0.0, -1.0]), (3, [0.0; 3])] {
            let cell = tree.find(&gpu, &[[4, 6, 2]], level).unwrap()[0].unwrap();
            assert_eq!(cell.look.unwrap().normal, normal, "{driver} {level}");
        }
    }
}

#[test]
fn attributes_in_several_pieces_are_put_together() {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN));
    let adapter = adapters.into_iter().find(|adapter| adapter.get_info().name.contains("llvmpipe")).unwrap();
    let required_limits = wgpu::Limits { max_storage_buffer_binding_size: 100_000, ..wgpu::Limits::default() };
    let descriptor = wgpu::DeviceDescriptor { required_limits, ..Default::default() };
    let (device, queue) = pollster::block_on(adapter.request_device(&descriptor)).unwrap();
    let gpu = Gpu::from_device(device, queue);
    // Six sheets in each layer of voxels, more fragments than one binding takes.
    let sheets: Vec<Mesh> = (0..48)
        .map(|i| 0.1 + f64::from(i) / 6.0)
        .map(|z| zoo::quad([[0.0, 0.0, z], [16.0, 0.0, z], [16.0, 16.0, z], [0.0, 16.0, z]]))
        .collect();
    let mut mesh = zoo::merged(&sheets);
    let mut random = Random::new(73);
    let mut color = || [0; 4].map(|_| random.range(0, 100) as f32 / 100.0);
    mesh.colors = Some(Attribute::per_vertex(mesh.positions.iter().map(|_| color()).collect()));
    let job = Job::new(grid([16, 16, 9]), Mode::Conservative);
    let volume = trixel::voxelize(&mesh, &job).unwrap();
    let request = AttributeRequest::new(&[AttributeKind::Color], Combine::All);
    let (attributes, _, _) = built(&gpu, &mesh, &job, &volume, &request);
    assert!(attributes.rows().len() > 1, "{} voxels", volume.count());
    compare(&gpu, &mesh, &job, &volume, &request);
}

#[test]
fn attributes_of_others_are_refused() {
    let gpu = open("llvmpipe");
    let mesh = zoo::octahedron([4.0; 3], 3.0);
    let job = Job::new(grid([8; 3]), Mode::Conservative);
    let volume = trixel::voxelize(&mesh, &job).unwrap();
    let (attributes, list, _) = built(&gpu, &mesh, &job, &volume, &colors_and_normals());
    let elsewhere = Job::new(grid([9; 3]), Mode::Conservative);
    let larger = trixel::voxelize(&mesh, &elsewhere).unwrap();
    assert_eq!(larger.count(), volume.count());
    let (other_grid, _, _) = built(&gpu, &mesh, &elsewhere, &larger, &colors_and_normals());
    let thin = Job::new(grid([8; 3]), Mode::Thin);
    let fewer = trixel::voxelize(&mesh, &thin).unwrap();
    let (other_voxels, _, _) = built(&gpu, &mesh, &thin, &fewer, &colors_and_normals());
    for other in [other_grid, other_voxels] {
        let refused = GpuOctree::with_attributes(&gpu, &list, &other);
        assert!(matches!(refused, Err(GpuError::AttributesOfOthers { .. })), "{refused:?}");
    }
    let on_gpu = GpuVolume::new(&gpu, *job.grid()).unwrap();
    let empty = GpuVoxelList::of(&gpu, &on_gpu, ListMethod::Scan, VoxelOrder::Morton).unwrap();
    let refused = GpuOctree::with_attributes(&gpu, &empty, &attributes);
    let text = refused.map(|_| ()).unwrap_err().to_string();
    assert!(text.contains(&format!("{} voxels", volume.count())), "{text}");
    // A tree without attributes has no looks to show.
    let bare = GpuOctree::of(&gpu, &list).unwrap();
    let voxel = volume.iter().next().unwrap();
    assert_eq!(bare.look(&gpu, &[voxel]).unwrap(), [None]);
    let cell = bare.find(&gpu, &[voxel], 2).unwrap()[0].unwrap();
    assert_eq!((cell.full, cell.look), (false, None));
    assert!(bare.node_looks().is_none() && bare.voxel_looks().is_none());
}
