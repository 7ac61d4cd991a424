//! Closed-form cases, and every rule against a search through all triangles.

use super::*;
use crate::conformance::oracle;
use crate::conformance::random::{Placement, Random, triangle};
#[cfg(feature = "threads")]
use crate::cpu::CpuBackend;
use crate::grid::Grid;
use crate::lattice::STEPS_PER_VOXEL;
use crate::material::{AlphaMode, Filter, Image, ImageSource, Material, Texture, TextureRef, Wrap};
use crate::mesh::Attribute;
use crate::{scene, voxelize};

const RED: [f32; 4] = [1.0, 0.0, 0.0, 1.0];
const BLUE: [f32; 4] = [0.0, 0.0, 1.0, 1.0];

fn grid(dims: [u32; 3]) -> Grid {
    Grid::new([0.0; 3], [1.0; 3], dims).unwrap()
}

fn describe(mesh: &Mesh, job: &Job, request: &AttributeRequest) -> (Volume, VoxelAttributes) {
    let volume = voxelize(mesh, job).unwrap();
    let lattice = LatticeMesh::snap(mesh, job.grid()).unwrap();
    let attributes = compute(mesh, &lattice, job, &volume, request).unwrap();
    (volume, attributes)
}

fn colors_of(mesh: &Mesh, dims: [u32; 3], combine: Combine) -> (Volume, VoxelAttributes) {
    let job = Job::new(grid(dims), Mode::Conservative);
    describe(mesh, &job, &AttributeRequest::new(&AttributeKind::ALL, combine))
}

fn color(volume: &Volume, attributes: &VoxelAttributes, voxel: [u32; 3]) -> [u8; 4] {
    let rank = Rank::new(volume);
    Described::new(&rank, attributes).unwrap().color(voxel).unwrap()
}

fn u32s(attributes: &VoxelAttributes, kind: AttributeKind) -> &[u32] {
    match attributes.get(kind) {
        Some(Values::U32(values)) => values,
        other => panic!("{other:?}"),
    }
}

fn vectors(attributes: &VoxelAttributes, kind: AttributeKind) -> &[[f32; 3]] {
    match attributes.get(kind) {
        Some(Values::F32x3(values)) => values,
        other => panic!("{other:?}"),
    }
}

fn material(base_color: [f32; 4]) -> Material {
    Material { base_color, ..Material::default() }
}

/// A rectangle in the plane z = `z`, two triangles a cell of `[x0, x1] x [y0, y1]`.
fn rectangle(mesh: &mut Mesh, [x0, x1]: [f64; 2], [y0, y1]: [f64; 2], z: f64, material: u32) {
    let start = u32::try_from(mesh.positions.len()).unwrap();
    mesh.positions.extend([[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]]);
    mesh.triangles.extend([[start, start + 1, start + 2], [start, start + 2, start + 3]]);
    mesh.triangle_materials.extend([material; 2]);
}

/// A rectangle from 0 to 8 in x and y, through the centres of the first layer, textured once.
fn textured(filter: Filter, image: ImageSource, alpha_mode: AlphaMode) -> Mesh {
    let mut mesh = Mesh::default();
    rectangle(&mut mesh, [0.0, 8.0], [0.0, 8.0], 0.5, 0);
    mesh.uvs = vec![Attribute::per_vertex(vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])];
    mesh.images = vec![Image { name: "image".into(), source: image }];
    mesh.textures = vec![Texture { image: 0, wrap: [Wrap::Repeat; 2], filter, mipmaps: false }];
    let texture = Some(TextureRef::new(0));
    mesh.materials = vec![Material { base_color_texture: texture, alpha_mode, ..material([1.0; 4]) }];
    mesh
}

fn pixels(width: u32, height: u32, pixel: impl Fn(u32, u32) -> [u8; 4]) -> ImageSource {
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).flat_map(|(x, y)| pixel(x, y)).collect();
    ImageSource::Rgba8 { width, height, pixels }
}

#[test]
fn a_two_coloured_quad_has_two_colours() {
    let mut mesh = Mesh { materials: vec![material(RED), material(BLUE)], ..Mesh::default() };
    rectangle(&mut mesh, [0.0, 4.0], [0.0, 6.0], 0.5, 0);
    rectangle(&mut mesh, [4.0, 8.0], [0.0, 6.0], 0.5, 1);
    for combine in [Combine::Nearest, Combine::Dominant, Combine::AreaWeighted] {
        let (volume, attributes) = colors_of(&mesh, [8, 6, 1], combine);
        assert_eq!(volume.count(), 48);
        for voxel in volume.iter() {
            let found = color(&volume, &attributes, voxel);
            let expected = if voxel[0] < 4 { [255, 0, 0, 255] } else { [0, 0, 255, 255] };
            assert_eq!(found, expected, "{combine:?} {voxel:?}");
        }
        let expected: Vec<u32> = volume.iter().map(|[x, ..]| u32::from(x >= 4)).collect();
        assert_eq!(u32s(&attributes, AttributeKind::Material), expected);
    }
    // Voxels on the border touch both: two of each, or where a quad's diagonal does not reach, fewer.
    let (volume, attributes) = colors_of(&mesh, [8, 6, 1], Combine::Mean);
    for voxel in volume.iter() {
        let [r, g, b, a] = color(&volume, &attributes, voxel);
        let mixed = voxel[0] == 3 || voxel[0] == 4;
        assert_eq!((r > 0 && b > 0, g, a), (mixed, 0, 255), "{voxel:?}");
    }
}

#[test]
fn colours_between_corners_are_linear_in_light() {
    let mut mesh = Mesh::default();
    rectangle(&mut mesh, [0.0, 8.0], [0.0, 2.0], 0.5, Mesh::NO_MATERIAL);
    let at = |x: f32| [x, 1.0 - x, 0.25, 1.0];
    mesh.colors = Some(Attribute::per_vertex(vec![at(0.0), at(1.0), at(1.0), at(0.0)]));
    for combine in [Combine::Nearest, Combine::First, Combine::Mean] {
        let (volume, attributes) = colors_of(&mesh, [8, 2, 1], combine);
        for [x, y, z] in volume.iter() {
            let share = (f64::from(x) + 0.5) / 8.0;
            let srgb = |v: f64| if v <= 0.003_130_8 { v * 12.92 } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
            let expected = [srgb(share), srgb(1.0 - share), srgb(0.25), 1.0].map(|v| v * 255.0);
            let found = color(&volume, &attributes, [x, y, z]);
            for i in 0..4 {
                // Other triangles of the voxel are met at their nearest points, within the voxel.
                let tolerance = if combine == Combine::Nearest { 0.51 } else { 18.0 };
                assert!((f64::from(found[i]) - expected[i]).abs() < tolerance, "{combine:?} {found:?} {expected:?}");
            }
        }
    }
}

#[test]
fn a_checkerboard_texture_colours_each_cell() {
    let checker = pixels(4, 4, |x, y| if (x + y) % 2 == 0 { [255, 255, 255, 255] } else { [0, 64, 128, 255] });
    for filter in [Filter::Nearest, Filter::Linear] {
        let mesh = textured(filter, checker.clone(), AlphaMode::Opaque);
        let (volume, attributes) = colors_of(&mesh, [8, 8, 1], Combine::Nearest);
        for [x, y, z] in volume.iter() {
            let found = color(&volume, &attributes, [x, y, z]);
            if filter == Filter::Nearest {
                let expected = if (x / 2 + y / 2) % 2 == 0 { [255; 4] } else { [0, 64, 128, 255] };
                assert_eq!(found, expected, "{x} {y}");
            } else {
                // A quarter of a texel from its centre along both axes: 10/16 of it and its likes, 6/16 of the others.
                let own = if (x / 2 + y / 2) % 2 == 0 { 10.0 } else { 6.0 } / 16.0;
                let expected = (1.055 * f64::powf(own, 1.0 / 2.4) - 0.055) * 255.0;
                assert!((f64::from(found[0]) - expected).abs() < 1.0, "{x} {y}: {found:?} {expected}");
            }
        }
    }
}

#[test]
fn a_texture_that_is_missing_leaves_the_materials_colour() {
    let mut mesh = textured(Filter::Linear, ImageSource::File("no/such.png".into()), AlphaMode::Opaque);
    mesh.materials[0].base_color = RED;
    let (volume, attributes) = colors_of(&mesh, [8, 8, 1], Combine::Mean);
    assert_eq!(color(&volume, &attributes, [3, 3, 0]), [255, 0, 0, 255]);
    // And so do texture coordinates that are missing.
    let mut mesh = textured(Filter::Linear, pixels(1, 1, |_, _| [0, 255, 0, 255]), AlphaMode::Opaque);
    mesh.materials[0].base_color = [1.0, 1.0, 1.0, 1.0];
    let (volume, attributes) = colors_of(&mesh, [8, 8, 1], Combine::Mean);
    assert_eq!(color(&volume, &attributes, [3, 3, 0]), [0, 255, 0, 255]);
    mesh.uvs.clear();
    let (volume, attributes) = colors_of(&mesh, [8, 8, 1], Combine::Mean);
    assert_eq!(color(&volume, &attributes, [3, 3, 0]), [255; 4]);
    // Indices that lead nowhere are harmless.
    mesh.materials[0].base_color_texture = Some(TextureRef { texture: 7, uv_set: 9, ..TextureRef::new(0) });
    mesh.textures[0].image = 77;
    mesh.triangle_materials = vec![0];
    colors_of(&mesh, [8, 8, 1], Combine::All);
}

/// Two sheets that face away from each other in the voxel [1, 1, 0]: the upper is blue and faces down.
fn sheets(low: f64, high: f64) -> Mesh {
    let mut mesh = Mesh { materials: vec![material(RED), material(BLUE)], ..Mesh::default() };
    mesh.positions = [low, high].iter().flat_map(|&z| [[-9.0, -9.0, z], [30.0, -9.0, z], [-9.0, 30.0, z]]).collect();
    mesh.triangles = vec![[0, 1, 2], [3, 5, 4]];
    mesh.triangle_materials = vec![0, 1];
    mesh
}

#[test]
fn opposite_facing_sheets_in_one_voxel() {
    let results = |mesh: &Mesh, combine| {
        let (volume, attributes) = colors_of(mesh, [3, 3, 1], combine);
        let place = usize::try_from(Rank::new(&volume).of([1, 1, 0]).unwrap()).unwrap();
        let normal = vectors(&attributes, AttributeKind::Normal)[place];
        (color(&volume, &attributes, [1, 1, 0]), normal, u32s(&attributes, AttributeKind::Triangle)[place])
    };
    let (up, down) = ([0.0, 0.0, 1.0], [0.0, 0.0, -1.0]);
    let (red, blue) = ([255, 0, 0, 255], [0, 0, 255, 255]);
    let even = sheets(0.25, 0.75);
    // Half of the light is 188 in sRGB; the normals cancel out, so the winner's stays: of equals, the first.
    assert_eq!(results(&even, Combine::Mean), ([188, 0, 188, 255], up, 0));
    assert_eq!(results(&even, Combine::AreaWeighted), ([188, 0, 188, 255], up, 0));
    assert_eq!(results(&even, Combine::Nearest), (red, up, 0));
    assert_eq!(results(&even, Combine::Dominant), (red, up, 0));
    assert_eq!(results(&even, Combine::First), (red, up, 0));
    assert_eq!(results(&even, Combine::Max), ([255, 0, 255, 255], up, 1));
    assert_eq!(results(&sheets(0.25, 0.7), Combine::Nearest), (blue, down, 1));
    assert_eq!(results(&sheets(0.25, 0.7), Combine::Mean), ([188, 0, 188, 255], down, 1));
    // The upper sheet's corner covers a part of the voxel only.
    let mut corner = even.clone();
    corner.positions[3..].copy_from_slice(&[[1.5, 1.5, 0.75], [30.0, 1.5, 0.75], [1.5, 30.0, 0.75]]);
    assert_eq!(results(&corner, Combine::Dominant), (red, up, 0));
    let (mixed, normal, _) = results(&corner, Combine::AreaWeighted);
    assert_eq!((mixed, normal), ([231, 0, 124, 255], up), "4 : 1 in light");
}

#[test]
fn all_keeps_every_fragment_in_order() {
    let mesh = sheets(0.25, 0.75);
    let (volume, attributes) = colors_of(&mesh, [3, 3, 1], Combine::All);
    assert_eq!(attributes.offsets().unwrap(), (0..=9).map(|i| 2 * i).collect::<Vec<u64>>());
    assert_eq!(u32s(&attributes, AttributeKind::Triangle), [0, 1].repeat(9));
    assert_eq!(color(&volume, &attributes, [1, 1, 0]), [255, 0, 0, 255], "the first stands for all");
    for row in vectors(&attributes, AttributeKind::Barycentric) {
        assert_eq!(row.iter().sum::<f32>(), 1.0);
    }
}

#[test]
fn priorities_decide_before_anything_else() {
    let mesh = sheets(0.5, 0.9);
    let job = Job::new(grid([3, 3, 1]), Mode::Conservative);
    for combine in [Combine::Mean, Combine::Nearest, Combine::First, Combine::Max] {
        let request = AttributeRequest::new(&AttributeKind::ALL, combine);
        let at = |priorities: Vec<u32>| {
            let (volume, attributes) = describe(&mesh, &job, &request.clone().with_priorities(priorities));
            color(&volume, &attributes, [1, 1, 0])
        };
        assert_eq!(at(vec![0, 5]), [0, 0, 255, 255], "{combine:?}");
        assert_eq!(at(vec![1]), [255, 0, 0, 255], "{combine:?}: what is left out has none");
    }
}

#[test]
fn the_alpha_test_cuts_voxels_out() {
    let half = pixels(2, 1, |x, _| [200, 100, 50, if x == 0 { 127 } else { 128 }]);
    let mesh = textured(Filter::Nearest, half.clone(), AlphaMode::Mask { cutoff: 0.5 });
    for combine in Combine::ALL {
        let (volume, attributes) = colors_of(&mesh, [8, 8, 1], combine);
        assert_eq!(volume.count(), 64, "occupancy is that of the triangles");
        let rank = Rank::new(&volume);
        let described = Described::new(&rank, &attributes).unwrap();
        // Voxels 0 to 3 read the left texel, which is below the cutoff; but one of them touches the other triangle where
        // the right texel begins.
        let shows = |voxel: [u32; 3]| voxel[0] >= 4 || voxel == [3, 4, 0];
        for voxel in volume.iter() {
            assert_eq!(described.color(voxel), shows(voxel).then_some([200, 100, 50, 255]), "{combine:?} {voxel:?}");
        }
        assert_eq!((attributes.covered(), attributes.cuts_out()), (33, true));
        let shown = described.without_cut_out().unwrap().unwrap();
        assert!(shown.iter().eq(volume.iter().filter(|&voxel| shows(voxel))));
    }
    // Blending keeps alpha, and opaque materials have none.
    for (mode, alpha) in [(AlphaMode::Blend, 127), (AlphaMode::Opaque, 255)] {
        let (volume, attributes) = colors_of(&textured(Filter::Nearest, half.clone(), mode), [8, 8, 1], Combine::Mean);
        assert_eq!(color(&volume, &attributes, [1, 2, 0]), [200, 100, 50, alpha]);
        assert!(!attributes.cuts_out());
    }
}

#[test]
fn a_mean_counts_colours_by_their_alpha() {
    let mut mesh = sheets(0.25, 0.75);
    mesh.materials[1] = Material { alpha_mode: AlphaMode::Blend, ..material([0.0, 0.0, 1.0, 0.0]) };
    let (volume, attributes) = colors_of(&mesh, [3, 3, 1], Combine::Mean);
    assert_eq!(color(&volume, &attributes, [1, 1, 0]), [255, 0, 0, 128], "what cannot be seen does not tint");
}

#[test]
fn emission_metalness_and_coordinates() {
    let mut mesh = textured(Filter::Nearest, pixels(1, 1, |_, _| [0, 128, 255, 255]), AlphaMode::Opaque);
    mesh.materials[0] = Material {
        emissive: [8.0, 0.5, 0.0],
        metallic: 0.5,
        roughness: 1.0,
        metallic_roughness_texture: Some(TextureRef::new(0)),
        ..Material::default()
    };
    let (volume, attributes) = colors_of(&mesh, [8, 8, 1], Combine::Nearest);
    assert!(vectors(&attributes, AttributeKind::Emission).iter().all(|e| (e[0] - 8.0).abs() < 1e-4 && e[2] == 0.0));
    let Some(Values::F32x2(rough)) = attributes.get(AttributeKind::MetallicRoughness) else { panic!() };
    assert!(rough.iter().all(|m| (m[0] - 0.5).abs() < 1e-4 && (m[1] - 128.0 / 255.0).abs() < 1e-4), "{:?}", rough[0]);
    let Some(Values::F32x2(coordinates)) = attributes.get(AttributeKind::Texcoord) else { panic!() };
    for ([x, y, _], found) in volume.iter().zip(coordinates) {
        let expected = [x, y].map(|c| (c as f32 + 0.5) / 8.0);
        assert!((0..2).all(|i| (found[i] - expected[i]).abs() < 1e-4), "{found:?} {expected:?}");
    }
}

#[test]
fn normals_are_the_meshs_own() {
    // Voxels twice as long along x: the geometric normal is still the mesh's.
    let mut mesh = Mesh::new(vec![[0.0, 0.0, 0.0], [8.0, 0.0, 4.0], [0.0, 4.0, 0.0]], vec![[0, 1, 2]]);
    let stretched = Grid::new([0.0; 3], [2.0, 1.0, 1.0], [4, 4, 4]).unwrap();
    let job = Job::new(stretched, Mode::Conservative);
    let request = AttributeRequest::new(&AttributeKind::ALL, Combine::Mean);
    let (_, attributes) = describe(&mesh, &job, &request);
    let slope = [-1.0 / 5f32.sqrt(), 0.0, 2.0 / 5f32.sqrt()];
    let close = |found: &[f32; 3], expected: [f32; 3]| (0..3).all(|i| (found[i] - expected[i]).abs() < 1e-3);
    assert!(vectors(&attributes, AttributeKind::Normal).iter().all(|n| close(n, slope)), "none of its own");
    mesh.normals = Some(Attribute::per_vertex(vec![[0.0, 9.0, 0.0], [0.0, 1e-9, 0.0], [0.0, 3.0, 0.0]]));
    let (_, attributes) = describe(&mesh, &job, &request);
    assert!(vectors(&attributes, AttributeKind::Normal).iter().all(|&n| n == [0.0, 1.0, 0.0]));
    assert!(vectors(&attributes, AttributeKind::GeometricNormal).iter().all(|n| close(n, slope)));
}

/// A mesh of random triangles with random colours, normals and coordinates.
fn random_mesh(random: &mut Random, triangles: u32) -> Mesh {
    let mut mesh = Mesh::default();
    for index in 0..triangles {
        let placement = Placement::ALL[index as usize % 5];
        let corners = triangle(random, placement, -1, 20, [1, 3, 12, 80][index as usize / 5 % 4]);
        mesh.positions.extend(corners.map(|v| v.map(|c| c as f64 / f64::from(STEPS_PER_VOXEL))));
        mesh.triangles.push([3 * index, 3 * index + 1, 3 * index + 2]);
        mesh.triangle_materials.push(u32::try_from(random.range(0, 3)).unwrap());
    }
    let mut unit = || random.range(0, 255) as f32 / 255.0;
    let corners = mesh.positions.len();
    mesh.colors = Some(Attribute::per_vertex((0..corners).map(|_| [unit(), unit(), unit(), 1.0]).collect()));
    mesh.normals = Some(Attribute::per_vertex((0..corners).map(|_| [unit(), unit(), unit()]).collect()));
    mesh.uvs = vec![Attribute::per_vertex((0..corners).map(|_| [4.0 * unit(), 4.0 * unit()]).collect())];
    mesh.images = vec![Image {
        name: String::new(),
        source: pixels(5, 3, |x, y| [60, 120, 240, 15].map(|c: u8| c.wrapping_mul(u8::try_from(x + 4 * y).unwrap()))),
    }];
    mesh.textures = vec![Texture { image: 0, wrap: [Wrap::Mirror; 2], filter: Filter::Linear, mipmaps: true }];
    let textured = |alpha_mode| Material {
        base_color_texture: Some(TextureRef::new(0)),
        alpha_mode,
        ..material([0.5, 1.0, 1.0, 0.75])
    };
    mesh.materials = vec![
        material(RED),
        textured(AlphaMode::Opaque),
        textured(AlphaMode::Blend),
        textured(AlphaMode::Mask { cutoff: 0.4 }),
    ];
    mesh
}

#[test]
fn winners_are_those_of_a_search_through_all_triangles() {
    let mut random = Random::new(21);
    let mut mesh = random_mesh(&mut random, 60);
    mesh.materials[3].alpha_mode = AlphaMode::Opaque;
    let job = Job::new(grid([18, 17, 19]), Mode::Conservative);
    let lattice = LatticeMesh::snap(&mesh, job.grid()).unwrap();
    for combine in [Combine::Nearest, Combine::Dominant, Combine::First, Combine::Max, Combine::Mean] {
        let request = AttributeRequest::new(&[AttributeKind::Triangle], combine);
        let (volume, attributes) = describe(&mesh, &job, &request);
        let found = u32s(&attributes, AttributeKind::Triangle);
        for (voxel, &found) in volume.iter().zip(found) {
            let at = voxel.map(i64::from);
            let meets = |index: &u32| {
                let corners = lattice.corners(*index as usize).map(|v| v.map(i128::from));
                oracle::conservative(corners, voxel.map(i128::from))
            };
            let value = |index: u32| {
                let corners = lattice.corners(index as usize);
                let nearest = Nearest::new(&corners, 0);
                match combine {
                    Combine::Nearest | Combine::Mean => i64::from(nearest.distance(at, nearest.weights(at))),
                    Combine::Dominant => -i64::from(overlap::doubled_area(&corners, at)),
                    Combine::Max => -i64::from(index),
                    _ => 0,
                }
            };
            let expected = (0..60).filter(meets).min_by_key(|&index| (value(index), index));
            assert_eq!(Some(found), expected, "{combine:?} {voxel:?}");
        }
    }
}

#[cfg(feature = "threads")]
#[test]
fn results_do_not_depend_on_threads_or_slabs() {
    let mut random = Random::new(22);
    let mesh = random_mesh(&mut random, 500);
    for mode in Mode::ALL {
        let job = Job::new(grid([70, 50, 60]), mode);
        let lattice = LatticeMesh::snap(&mesh, job.grid()).unwrap();
        let volume = voxelize(&mesh, &job).unwrap();
        assert!(volume.count() > 8000, "enough for several slabs");
        for combine in Combine::ALL {
            let request = AttributeRequest::new(&AttributeKind::ALL, combine);
            let run = |threads| {
                let backend = CpuBackend::with_threads(threads).unwrap();
                backend.install(|| compute(&mesh, &lattice, &job, &volume, &request).unwrap())
            };
            let expected = run(1);
            assert!([2, 3, 8].into_iter().all(|threads| run(threads) == expected), "{mode} {combine:?}");
        }
    }
}

#[test]
fn the_order_of_triangles_does_not_change_sums() {
    let mut random = Random::new(23);
    let mesh = random_mesh(&mut random, 80);
    let mut reversed = mesh.clone();
    reversed.triangles.reverse();
    reversed.triangle_materials.reverse();
    let kinds = [AttributeKind::Color, AttributeKind::Emission, AttributeKind::MetallicRoughness];
    for combine in [Combine::Mean, Combine::AreaWeighted, Combine::Max] {
        let job = Job::new(grid([20, 20, 20]), Mode::Thin);
        let request = AttributeRequest::new(&kinds, combine);
        assert_eq!(describe(&mesh, &job, &request).1, describe(&reversed, &job, &request).1, "{combine:?}");
    }
}

#[test]
fn every_outside_voxel_of_a_solid_has_a_triangle() {
    for name in ["sphere:3", "torus:20", "cube"] {
        let mesh = scene::build(name).unwrap();
        let job = Job::new(Grid::fit(&mesh.bounds().unwrap(), 37).unwrap(), Mode::Solid);
        let (volume, attributes) = describe(&mesh, &job, &AttributeRequest::new(&AttributeKind::ALL, Combine::Nearest));
        let [nx, ny, nz] = volume.grid().dims();
        let outside = |[x, y, z]: [u32; 3]| x >= nx || y >= ny || z >= nz || !volume.get([x, y, z]);
        let mut inside = 0;
        for (place, voxel) in volume.iter().enumerate() {
            let exposed = (0..3).any(|i| {
                [1, u32::MAX].into_iter().any(|step| {
                    let mut beside = voxel;
                    beside[i] = voxel[i].wrapping_add(step);
                    outside(beside)
                })
            });
            assert!(!exposed || attributes.is_covered(place), "{name} {voxel:?}");
            inside += u32::from(!attributes.is_covered(place));
        }
        assert!(inside > 500 && !attributes.cuts_out(), "{name} {inside}");
    }
}

#[test]
fn what_does_not_fit_together_is_refused() {
    let mesh = scene::build("cube").unwrap();
    let job = Job::new(Grid::fit(&mesh.bounds().unwrap(), 8).unwrap(), Mode::Thin);
    let lattice = LatticeMesh::snap(&mesh, job.grid()).unwrap();
    let other = Volume::new(grid([8, 8, 8])).unwrap();
    let request = AttributeRequest::new(&[AttributeKind::Color], Combine::Mean);
    assert_eq!(compute(&mesh, &lattice, &job, &other, &request), Err(AttributeError::GridMismatch));
    // An empty volume has no rows.
    let empty = Volume::new(*job.grid()).unwrap();
    let attributes = compute(&mesh, &lattice, &job, &empty, &request).unwrap();
    assert_eq!((attributes.voxels(), attributes.get(AttributeKind::Color).unwrap().len()), (0, 0));
    assert!(Described::new(&Rank::new(&voxelize(&mesh, &job).unwrap()), &attributes).is_none());
}
