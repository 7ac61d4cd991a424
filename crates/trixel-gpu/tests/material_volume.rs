//! Materials of voxels as 3D textures: written, read back, and the same from every maker.

#![expect(clippy::unwrap_used, clippy::panic, reason = "a failure here is a failed test")]

use trixel::attributes::{AttributeKind, AttributeRequest, Combine, compute};
use trixel::lattice::LatticeMesh;
use trixel::{Frame, Grid, Job, Material, Mode};
use trixel_gpu::{AdapterChoice, Gpu, GpuError, MaterialVolume, Media, Medium, Precision, VoxelMaterial};

const DRIVERS: [&str; 2] = ["llvmpipe", "SwiftShader"];

fn open(name: &str) -> Gpu {
    Gpu::open(&AdapterChoice::Named(name.to_owned())).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn frame(dims: [u32; 3]) -> Frame {
    Frame::of_grid(&Grid::new([0.0; 3], [1.0; 3], dims).unwrap()).unwrap()
}

/// The largest error that a precision may make in a number of this size.
fn tolerance(precision: Precision, size: f32) -> f32 {
    match precision {
        Precision::Eight => size / 255.0,
        Precision::Half => size / 1024.0,
        Precision::Full => size * 1e-6,
    }
}

fn glass() -> Medium {
    Medium { absorption: 3.5, refraction_index: 1.5 }
}

#[test]
fn texels_come_back() {
    let media = Media { of_materials: vec![glass()], other: Medium { absorption: 0.25, refraction_index: 2.5 } };
    // Sides that are no multiples of anything.
    let dims = [5, 3, 7];
    let voxel = |[x, y, z]: [u32; 3]| {
        let at = x + 5 * y + 15 * z;
        #[expect(clippy::cast_precision_loss, reason = "a small number")]
        let angle = at as f32;
        VoxelMaterial {
            exists: at % 3 == 0,
            normal: if at % 3 == 0 { [angle.cos() * 0.6, angle.sin() * 0.6, -0.8] } else { [0.0; 3] },
            color: if at % 3 == 0 { [0.0, 0.25, 1.0, angle.cos().abs()] } else { [0.0; 4] },
            medium: (at % 3 != 1).then(|| media.get(at % 2)),
            inside: at % 3 == 2,
        }
    };
    for driver in DRIVERS {
        let gpu = open(driver);
        for precision in Precision::ALL {
            let volume = MaterialVolume::from_voxels(&gpu, frame(dims), precision, &media, voxel).unwrap();
            let texels = volume.download(&gpu).unwrap();
            assert_eq!(texels.dims(), dims);
            let near = |a: f32, b: f32, size: f32| (a - b).abs() <= tolerance(precision, size);
            for x in 0..dims[0] {
                for y in 0..dims[1] {
                    for z in 0..dims[2] {
                        let (found, expected) = (texels.get([x, y, z]), voxel([x, y, z]));
                        assert_eq!((found.exists, found.inside), (expected.exists, expected.inside));
                        assert!((0..3).all(|i| near(found.normal[i], expected.normal[i], 2.0)), "{found:?}");
                        assert!((0..4).all(|i| near(found.color[i], expected.color[i], 1.0)), "{found:?}");
                        assert_eq!(found.medium.is_some(), expected.medium.is_some());
                        if let (Some(found), Some(expected)) = (found.medium, expected.medium) {
                            assert!(near(found.absorption, expected.absorption, 3.5), "{found:?}");
                            assert!(near(found.refraction_index, expected.refraction_index, 1.5), "{found:?}");
                        }
                    }
                }
            }
            assert_eq!(texels.get([5, 0, 0]), VoxelMaterial::default());
        }
    }
}

#[test]
fn any_voxels_with_attributes() {
    let mut mesh = trixel::scene::build("sphere").unwrap();
    let green = Material { base_color: [0.0, 1.0, 0.0, 1.0], ..Material::default() };
    mesh.materials = vec![Material::default(), green];
    mesh.triangle_materials = vec![1; mesh.triangles.len()];
    let grid = Grid::fit(&mesh.bounds().unwrap(), 20).unwrap();
    let lattice = LatticeMesh::snap(&mesh, &grid).unwrap();
    let media = Media { of_materials: vec![Medium::AIR, glass()], other: Medium::AIR };
    let request =
        AttributeRequest::new(&[AttributeKind::Color, AttributeKind::Normal, AttributeKind::Material], Combine::Mean);
    let gpu = open("llvmpipe");
    for mode in Mode::ALL {
        let job = Job::new(grid, mode);
        let voxels = trixel::voxelize(&mesh, &job).unwrap();
        let attributes = compute(&mesh, &lattice, &job, &voxels, &request).unwrap();
        let frame = Frame::of_grid(&grid).unwrap();
        let make = |frame| MaterialVolume::from_attributes(&gpu, frame, Precision::Half, &voxels, &attributes, &media);
        let texels = make(frame).unwrap().download(&gpu).unwrap();
        let centre = grid.bounds();
        for voxel in voxels.iter() {
            let found = texels.get(voxel);
            if !found.exists {
                // Deep inside.
                assert!(mode == Mode::Solid && found.inside && found.medium == Some(Medium::AIR));
                continue;
            }
            assert_eq!((found.color, found.medium), ([0.0, 1.0, 0.0, 1.0], Some(glass())));
            // The normal points away from the sphere's centre.
            let at = grid.center(voxel);
            let outwards: f64 =
                (0..3).map(|i| (at[i] - (centre.min[i] + centre.max[i]) / 2.0) * f64::from(found.normal[i])).sum();
            assert!(outwards > 0.0, "{mode} {voxel:?} {found:?}");
        }
        let there: u64 = all(grid.dims()).map(|voxel| u64::from(texels.get(voxel).medium.is_some())).sum();
        assert_eq!(there, voxels.count(), "{mode}");
        let other = Frame::of_grid(&Grid::new([0.0; 3], [1.0; 3], [20, 20, 19]).unwrap()).unwrap();
        assert!(matches!(make(other), Err(GpuError::GridMismatch)));
    }
}

fn all([nx, ny, nz]: [u32; 3]) -> impl Iterator<Item = [u32; 3]> {
    (0..nx).flat_map(move |x| (0..ny).flat_map(move |y| (0..nz).map(move |z| [x, y, z])))
}

#[test]
fn volumes_longer_than_textures_are_refused() {
    let gpu = open("llvmpipe");
    let most = gpu.device().limits().max_texture_dimension_3d;
    let made = MaterialVolume::new(&gpu, frame([2, most + 1, 1]), Precision::Eight, &Media::uniform(Medium::AIR));
    assert!(matches!(made, Err(GpuError::TextureTooLarge { .. })));
}
