use super::*;
use crate::Mesh;
use crate::mesh::Attribute;

fn near(a: [f64; 3], b: [f64; 3]) -> bool {
    a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-9 * (1.0 + b.abs()))
}

fn camera() -> Frame {
    Frame::perspective([1.0, 2.0, 3.0], [1.0, 2.0, 13.0], [0.0, 1.0, 0.0], [0.5, 0.25], [2.0, 10.0], [40, 20, 30])
        .unwrap()
}

#[test]
fn a_grid_is_a_frame() {
    let grid = Grid::new([1.0, -2.0, 0.5], [0.5, 0.25, 2.0], [3, 4, 5]).unwrap();
    let frame = Frame::of_grid(&grid).unwrap();
    for voxel in [[0, 0, 0], [2, 1, 4]] {
        assert!(near(frame.to_voxels(grid.center(voxel)), voxel.map(|c| f64::from(c) + 0.5)));
        assert!((frame.thickness(voxel) - 2.0).abs() < 1e-12);
    }
    assert!(!frame.is_perspective() && frame.grid().dims() == [3, 4, 5]);
}

#[test]
fn a_cameras_corners_are_the_boxs() {
    let frame = camera();
    assert!(frame.is_perspective());
    // Looking along +z with y up, x points to -x (right of the picture) and y down.
    let at = |x: f64, y: f64, w: f64| [1.0 - x * w, 2.0 - y * w, 3.0 + w];
    for (x, y, w, voxel) in
        [(0.0, 0.0, 2.0, [20.0, 10.0, 0.0]), (0.5, 0.25, 2.0, [40.0, 20.0, 0.0]), (-0.5, -0.25, 10.0, [0.0, 0.0, 30.0])]
    {
        assert!(near(frame.to_voxels(at(x, y, w)), voxel), "{:?}", frame.to_voxels(at(x, y, w)));
        assert!(near(frame.to_world(voxel), at(x, y, w)));
    }
    // All thicknesses along the axis are what lies between near and far, the ray's slant included.
    let slant = (1.0f64 + (0.5f64 / 40.0).powi(2) + (0.25f64 / 20.0).powi(2)).sqrt();
    let sum: f64 = (0..30).map(|z| frame.thickness([20, 10, z])).sum();
    assert!((sum - 8.0 * slant).abs() < 1e-9, "{sum}");
    assert!(frame.thickness([20, 10, 29]) > 20.0 * frame.thickness([20, 10, 0]));
}

#[test]
fn what_a_camera_cannot_see_is_cut_off() {
    let frame = camera();
    // A floor below the camera, from far behind it to far in front.
    let floor = [[-900.0, 1.0, -500.0], [900.0, 1.0, -500.0], [0.0, 1.0, 900.0]];
    let mut mesh = Mesh::new(floor.to_vec(), vec![[0, 1, 2]]);
    // A colour that tells where a point is.
    #[expect(clippy::cast_possible_truncation, reason = "a test")]
    let place = floor.map(|p| [p[0] as f32, p[1] as f32, p[2] as f32, 1.0]);
    mesh.colors = Some(Attribute::per_vertex(place.to_vec()));
    let framed = frame.mesh(&mesh).unwrap();
    assert!(!framed.mesh.triangles.is_empty() && framed.sources.iter().all(|source| *source == 0));
    let colors = framed.mesh.colors.as_ref().unwrap();
    let normals = framed.mesh.normals.as_ref().unwrap();
    for (index, corners) in framed.mesh.triangles.iter().enumerate() {
        assert_eq!(normals.on_triangle(index, *corners).unwrap(), [[0.0, -1.0, 0.0]; 3]);
        let colors = colors.on_triangle(index, *corners).unwrap();
        for (corner, color) in corners.iter().zip(colors) {
            let position = framed.mesh.positions[*corner as usize];
            assert!(framed.depths[*corner as usize] > 0.0);
            assert!(position.iter().all(|c| (-3001.0..3041.0).contains(c)), "{position:?}");
            let world = frame.to_world(position);
            for axis in 0..3 {
                assert!((world[axis] - f64::from(color[axis])).abs() < 1e-3, "{world:?} {color:?}");
            }
        }
    }
    // Nothing of a triangle behind the camera.
    let behind = Mesh::new(floor.map(|[x, y, z]| [x, y, z - 1000.0]).to_vec(), vec![[0, 1, 2]]);
    assert!(frame.mesh(&behind).unwrap().mesh.triangles.is_empty());
}

#[test]
fn frames_around_bounds_hold_them() {
    let bounds = Bounds { min: [-1.0, 2.0, 0.0], max: [3.0, 4.0, 7.0] };
    let up = [0.0, 0.0, 1.0];
    let frames = [
        Frame::aligned([1.0, 2.0, -0.5], up, &bounds, 33).unwrap(),
        Frame::perspective_around([20.0, -9.0, 11.0], up, &bounds, 40).unwrap(),
    ];
    for frame in frames {
        for corner in corners(&bounds) {
            let voxel = frame.to_voxels(corner.to_array());
            for axis in 0..3 {
                let end = f64::from(frame.dims()[axis]);
                assert!((-1e-6..end + 1e-6).contains(&voxel[axis]), "{voxel:?} of {:?}", frame.dims());
            }
        }
    }
    // An eye inside.
    let inside = Frame::perspective_around([1.0, 3.0, 1.0], [0.0, 1.0, 0.0], &bounds, 16).unwrap();
    assert!(inside.is_perspective());
}

#[test]
fn impossible_frames_are_refused() {
    let bounds = Bounds { min: [0.0; 3], max: [1.0; 3] };
    let up = [0.0, 1.0, 0.0];
    assert_eq!(Frame::aligned([0.0, 2.0, 0.0], up, &bounds, 8), Err(FrameError::View));
    assert_eq!(Frame::aligned([f64::NAN, 2.0, 0.0], up, &bounds, 8), Err(FrameError::View));
    assert_eq!(Frame::perspective_around([0.5; 3], up, &bounds, 8), Err(FrameError::View));
    let point = Bounds { min: [1.0; 3], max: [1.0; 3] };
    assert!(Frame::aligned([0.0, 0.0, 1.0], up, &point, 8).is_err());
    assert!(Frame::aligned([0.0, 0.0, 1.0], up, &bounds, 0).is_err());
    assert_eq!(Frame::oriented([0.0; 3], [up, up, up], [4; 3]), Err(FrameError::Singular));
    assert_eq!(Frame::new([[f64::NAN; 4]; 4], [4; 3]), Err(FrameError::Singular));
    assert!(matches!(Frame::oriented([0.0; 3], [up; 3], [0, 1, 1]), Err(FrameError::Grid(_) | FrameError::Singular)));
    let refused = Frame::perspective([0.0; 3], [0.0, 0.0, 1.0], up, [1.0, 1.0], [2.0, 1.0], [4; 3]);
    assert!(matches!(refused, Err(FrameError::Frustum { .. })));
}
