//! Slicing straight into 3D textures, in frames of every kind, against the mesh transformed and sliced on the CPU.

#![expect(clippy::unwrap_used, clippy::panic, reason = "a failure here is a failed test")]

use trixel::fill::Fill;
use trixel::{Attribute, Frame, Grid, Job, Material, Mesh, Mode, Strategy, Volume};
use trixel_gpu::{
    AdapterChoice, Gpu, GpuError, MaterialTexels, MaterialVolume, Media, Medium, Precision, Slicing, VoxelMaterial,
};

const BOTH: [Strategy; 2] = [Strategy::Sliced, Strategy::SlicePerPass];

fn open(name: &str) -> Gpu {
    Gpu::open(&AdapterChoice::Named(name.to_owned())).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// A scene between 0 and 1 along every axis, whose colour at each point is the point itself.
fn colored_by_place(scene: &str) -> Mesh {
    let mut mesh = trixel::scene::build(scene).unwrap();
    let bounds = mesh.bounds().unwrap();
    let longest = (0..3).map(|i| bounds.max[i] - bounds.min[i]).fold(0.0, f64::max);
    for position in &mut mesh.positions {
        *position = std::array::from_fn(|i| (position[i] - bounds.min[i]) / longest);
    }
    #[expect(clippy::cast_possible_truncation, reason = "colours are f32")]
    let colors = mesh.positions.iter().map(|p| [p[0] as f32, p[1] as f32, p[2] as f32, 1.0]).collect();
    mesh.colors = Some(Attribute::per_vertex(colors));
    mesh.materials.clear();
    mesh
}

/// A grid, a box aligned to nothing, a light's box and a camera's pyramid.
fn frames(mesh: &Mesh, resolution: u32) -> Vec<(&'static str, Frame)> {
    let bounds = mesh.bounds().unwrap();
    let up = [0.1, 1.0, 0.2];
    let edge = 0.7 / f64::from(resolution);
    let axes = [[edge, 0.3 * edge, 0.0], [-0.2 * edge, edge, 0.1 * edge], [0.1 * edge, -0.2 * edge, 1.3 * edge]];
    vec![
        ("grid", Frame::of_grid(&Grid::fit(&bounds, resolution).unwrap()).unwrap()),
        ("box", Frame::oriented([0.1, -0.1, 0.05], axes, [resolution, resolution + 3, resolution - 2]).unwrap()),
        ("light", Frame::aligned([1.0, -2.0, 0.5], up, &bounds, resolution).unwrap()),
        ("camera", Frame::perspective_around([2.0, 1.5, 2.5], up, &bounds, resolution).unwrap()),
    ]
}

fn sliced_on_the_cpu(frame: &Frame, mesh: &Mesh, overlap: f64) -> Volume {
    let job = Job::new(frame.grid(), Mode::Sliced).with_overlap(overlap).unwrap();
    trixel::voxelize(&frame.mesh(mesh).unwrap().mesh, &job).unwrap()
}

fn all([nx, ny, nz]: [u32; 3]) -> impl Iterator<Item = [u32; 3]> {
    (0..nx).flat_map(move |x| (0..ny).flat_map(move |y| (0..nz).map(move |z| [x, y, z])))
}

fn assert_exists(what: &str, texels: &MaterialTexels, expected: &Volume) {
    for voxel in all(texels.dims()) {
        let found = texels.get(voxel);
        assert_eq!(found.exists, expected.get(voxel), "{what}: {voxel:?}");
        if !found.exists {
            assert_eq!(found, VoxelMaterial::default(), "{what}: {voxel:?}");
        }
    }
}

fn glass() -> Media {
    Media::uniform(Medium { absorption: 2.0, refraction_index: 1.5 })
}

#[test]
fn colors_are_those_of_the_point_on_the_ray() {
    for (driver, scenes, resolution) in
        [("llvmpipe", &["torus:24", "room:8"][..], 44), ("SwiftShader", &["torus:24"], 21)]
    {
        let gpu = open(driver);
        for scene in scenes {
            let mesh = colored_by_place(scene);
            for (name, frame) in frames(&mesh, resolution) {
                let what = format!("{scene}, {name}, {driver}");
                for (strategy, overlap) in [(Strategy::Sliced, 0.0), (Strategy::SlicePerPass, 0.3)] {
                    let slicing = Slicing { strategy, overlap, fill: None };
                    let volume = MaterialVolume::sliced(&gpu, frame, Precision::Full, &mesh, &glass(), &slicing);
                    let texels = volume.unwrap().download(&gpu).unwrap();
                    let expected = sliced_on_the_cpu(&frame, &mesh, overlap);
                    assert!(expected.count() > 100, "{what}");
                    assert_exists(&what, &texels, &expected);
                    for voxel in expected.iter() {
                        let found = texels.get(voxel);
                        // The place that the colour tells lies on the voxel's line and in its slice.
                        let place = frame.to_voxels([0, 1, 2].map(|i| f64::from(found.color[i])));
                        for axis in 0..3 {
                            let (centre, reach) =
                                (f64::from(voxel[axis]) + 0.5, if axis < 2 { 0.0 } else { 0.5 + overlap });
                            let off = (place[axis] - centre).abs() - reach;
                            assert!(off < 0.02, "{what} {strategy} {voxel:?}: {off} off along {axis}, {found:?}");
                        }
                        let length: f32 = found.normal.iter().map(|c| c * c).sum();
                        assert!((length - 1.0).abs() < 1e-4, "{what} {voxel:?}");
                        assert_eq!(found.medium, Some(glass().other));
                    }
                }
            }
        }
    }
}

#[test]
fn every_precision_holds_the_same() {
    let gpu = open("llvmpipe");
    let mesh = colored_by_place("torus:16");
    let [_, _, (_, frame), _] = &frames(&mesh, 30)[..] else { panic!("four frames") };
    let media = Media::uniform(Medium { absorption: 7.5, refraction_index: 1.33 });
    let made = |precision| {
        let volume = MaterialVolume::sliced(&gpu, *frame, precision, &mesh, &media, &Slicing::default()).unwrap();
        assert_eq!(volume.surface().format(), precision.format());
        volume.download(&gpu).unwrap()
    };
    let exact = made(Precision::Full);
    for (precision, error) in [(Precision::Half, 1e-3), (Precision::Eight, 1.1 / 255.0)] {
        let rounded = made(precision);
        for voxel in all(frame.dims()) {
            let (found, expected) = (rounded.get(voxel), exact.get(voxel));
            assert_eq!(found.exists, expected.exists);
            assert!((0..4).all(|i| (found.color[i] - expected.color[i]).abs() < error), "{found:?} {expected:?}");
            assert!((0..3).all(|i| (found.normal[i] - expected.normal[i]).abs() < 2.0 * error), "{found:?}");
            if let (Some(found), Some(expected)) = (found.medium, expected.medium) {
                assert!((found.absorption - expected.absorption).abs() < 0.01);
                assert!((found.refraction_index - expected.refraction_index).abs() < 0.001);
            } else {
                assert_eq!(found.medium, expected.medium);
            }
        }
    }
}

#[test]
fn the_first_triangle_wins_in_every_run() {
    let square = |z: f64| [[0.0, 0.0, z], [8.0, 0.0, z], [8.0, 8.0, z], [0.0, 8.0, z]];
    // Ten squares in the same slice, each of its own material; forwards and backwards.
    let squares: Vec<_> = (0..10u32).map(|i| square(2.0 + f64::from(i % 7) * 0.1)).collect();
    let mut mesh = Mesh::new(
        squares.concat(),
        (0..10).flat_map(|i| [[4 * i, 4 * i + 1, 4 * i + 2], [4 * i, 4 * i + 2, 4 * i + 3]]).collect(),
    );
    let frame = Frame::of_grid(&Grid::new([0.0; 3], [1.0; 3], [8, 8, 4]).unwrap()).unwrap();
    #[expect(clippy::cast_precision_loss, reason = "a small number")]
    let medium = |i: usize| Medium { absorption: i as f32, refraction_index: 1.0 + i as f32 / 10.0 };
    let media = Media { of_materials: (0..10).map(medium).collect(), other: Medium::AIR };
    #[expect(clippy::cast_precision_loss, reason = "a small number")]
    let material = |i: usize| Material { base_color: [i as f32 / 10.0, 0.0, 0.0, 0.5], ..Material::default() };
    mesh.materials = (0..10).map(material).collect();
    for first in [0, 9] {
        mesh.triangle_materials = (0..20u32).map(|t| first.max(t / 2) - first.min(t / 2)).collect();
        for driver in ["llvmpipe", "SwiftShader"] {
            let gpu = open(driver);
            for strategy in BOTH {
                let slicing = Slicing { strategy, ..Slicing::default() };
                let volume = MaterialVolume::sliced(&gpu, frame, Precision::Full, &mesh, &media, &slicing).unwrap();
                let texels = volume.download(&gpu).unwrap();
                for [x, y] in [[0, 0], [3, 5], [7, 7]] {
                    let found = texels.get([x, y, 2]);
                    assert_eq!(found.medium, Some(medium(first as usize)), "{driver} {strategy}");
                    assert!((found.color[0] - if first == 0 { 0.0 } else { 0.9 }).abs() < 1e-4, "{found:?}");
                    // An opaque material's alpha says nothing.
                    assert_eq!((found.color[3], found.normal), (1.0, [0.0, 0.0, 1.0]));
                }
            }
        }
    }
}

#[test]
fn insides_are_the_fills_and_have_the_medium_of_the_surface_before() {
    let gpu = open("llvmpipe");
    let mut mesh = colored_by_place("sphere");
    // The lower half is of one material, the upper of none.
    mesh.materials = vec![Material::default()];
    let low = |corners: &[u32; 3]| corners.iter().all(|corner| mesh.positions[*corner as usize][2] <= 0.5 + 1e-9);
    mesh.triangle_materials = mesh.triangles.iter().map(|t| if low(t) { 0 } else { Mesh::NO_MATERIAL }).collect();
    let wax = Medium { absorption: 9.0, refraction_index: 1.25 };
    let media = Media { of_materials: vec![wax], other: Medium { absorption: 1.0, refraction_index: 1.5 } };
    let frame = Frame::of_grid(&Grid::new([-0.1; 3], [1.0 / 40.0; 3], [48, 48, 48]).unwrap()).unwrap();
    let boundary = sliced_on_the_cpu(&frame, &mesh, 0.0);
    let framed = frame.mesh(&mesh).unwrap().mesh;
    for fill in Fill::ALL {
        let slicing = Slicing { fill: Some(fill), ..Slicing::default() };
        let volume = MaterialVolume::sliced(&gpu, frame, Precision::Half, &mesh, &media, &slicing).unwrap();
        let texels = volume.download(&gpu).unwrap();
        let expected = match fill {
            Fill::Parity => trixel::voxelize(&framed, &Job::new(frame.grid(), Mode::Solid)).unwrap(),
            _ => trixel::fill::fill(&boundary, fill).unwrap().0,
        };
        let mut filled = 0;
        for voxel in all(frame.dims()) {
            let found = texels.get(voxel);
            assert_eq!((found.exists, found.inside), (boundary.get(voxel), expected.get(voxel)), "{fill} {voxel:?}");
            assert_eq!(found.medium.is_some(), found.exists || found.inside);
            if found.inside && !found.exists {
                // Beside the equator, where a voxel that leaks lies above the upper half.
                filled += u32::from(found.medium == Some(wax));
            }
        }
        // The ball's volume in voxels, but for its boundary.
        assert!(filled > 25_000, "{fill}: {filled}");
    }
}

#[test]
fn what_cannot_be_is_refused() {
    let gpu = open("llvmpipe");
    let mesh = colored_by_place("cube");
    let frame = Frame::of_grid(&Grid::new([0.0; 3], [0.1; 3], [10; 3]).unwrap()).unwrap();
    let make = |slicing| MaterialVolume::sliced(&gpu, frame, Precision::Eight, &mesh, &glass(), &slicing);
    let hybrid = make(Slicing { strategy: Strategy::Hybrid, ..Slicing::default() });
    assert!(matches!(hybrid, Err(GpuError::NoClaims(Strategy::Hybrid))));
    assert!(matches!(make(Slicing { overlap: -1.0, ..Slicing::default() }), Err(GpuError::Cpu(_))));
    let empty = Mesh::new(vec![], vec![]);
    let volume = MaterialVolume::sliced(&gpu, frame, Precision::Eight, &empty, &glass(), &Slicing::default());
    let texels = volume.unwrap().download(&gpu).unwrap();
    assert!(all([10; 3]).all(|voxel| texels.get(voxel) == VoxelMaterial::default()));
}
