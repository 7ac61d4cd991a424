use super::*;
use trixel::Grid;

/// A volume of cubic voxels with those set for which `inside` holds.
fn fill(dims: [u32; 3], inside: impl Fn([u32; 3]) -> bool) -> Volume {
    fill_grid(Grid::new([3.0, -5.0, 1e6], [0.25; 3], dims).unwrap(), inside)
}

fn fill_grid(grid: Grid, inside: impl Fn([u32; 3]) -> bool) -> Volume {
    let [nx, ny, nz] = grid.dims();
    let mut volume = Volume::new(grid).unwrap();
    for x in 0..nx {
        for y in 0..ny {
            for z in (0..nz).filter(|&z| inside([x, y, z])) {
                volume.set([x, y, z]);
            }
        }
    }
    volume
}

fn ball(n: u32) -> Volume {
    let inside = |v: [u32; 3]| {
        let squares = v.map(|c| (f64::from(2 * c + 1) - f64::from(n)).powi(2));
        squares.iter().sum::<f64>() < f64::from(n * n)
    };
    fill([n; 3], inside)
}

/// Only the object: nothing behind it and no ground.
fn cut_out(size: [u32; 2]) -> PreviewOptions {
    PreviewOptions { size, background: Background::Transparent, ground: false, ..PreviewOptions::default() }
}

/// The sum of alpha, in pixels, within columns and rows given as shares of the picture.
fn coverage(picture: &Picture, columns: [f64; 2], rows: [f64; 2]) -> f64 {
    let within = |i: u32, size: u32, [low, high]: [f64; 2]| {
        let share = (f64::from(i) + 0.5) / f64::from(size);
        share >= low && share < high
    };
    let mut sum = 0.0;
    for y in (0..picture.height).filter(|&y| within(y, picture.height, rows)) {
        for x in (0..picture.width).filter(|&x| within(x, picture.width, columns)) {
            sum += f64::from(picture.pixel(x, y).unwrap()[3]) / 255.0;
        }
    }
    sum
}

const ALL: [f64; 2] = [0.0, 1.0];

#[test]
fn a_ball_covers_the_disk_that_geometry_gives() {
    let volume = ball(120);
    for elevation in [0.0, 26.0, 90.0, -40.0] {
        let options = PreviewOptions { field_of_view: 0.0, elevation, ..cut_out([300, 200]) };
        let picture = render_preview(&volume, &options).unwrap();
        // The tightest side, 200 pixels, keeps 12 % free.
        let radius = 100.0 * 0.88;
        let expected = std::f64::consts::PI * radius * radius;
        let found = coverage(&picture, ALL, ALL);
        assert!((found / expected - 1.0).abs() < 0.04, "{found} pixels are not {expected} at {elevation}");
    }
}

#[test]
fn pixels_beside_the_object_are_background() {
    let options = PreviewOptions {
        background: Background::Plain([10, 200, 30]),
        ground: false,
        size: [200, 200],
        ..PreviewOptions::default()
    };
    let picture = render_preview(&ball(30), &options).unwrap();
    for (x, y) in [(0, 0), (199, 0), (0, 199), (199, 199), (5, 100), (100, 5)] {
        assert_eq!(picture.pixel(x, y), Some([10, 200, 30, 255]));
    }
    assert_ne!(picture.pixel(100, 100), Some([10, 200, 30, 255]));
    assert_eq!(picture.pixel(200, 0), None);
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let volume = ball(40);
    let options = PreviewOptions { size: [161, 290], ..PreviewOptions::default() };
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| render_preview(&volume, &options).unwrap())
    };
    let one = with(1);
    assert_eq!(one, with(2));
    assert_eq!(one, with(7));
}

/// Somebody in front of the object sees its parts where the up axis says they are: a part far to the right, one on top,
/// and one in front that hides the middle.
#[test]
fn the_object_stands_upright_and_is_not_mirrored() {
    // Right, away and up, as (axis, whether the axis points that way).
    let frames = [
        (UpAxis::Z, [(0, true), (1, true), (2, true)]),
        (UpAxis::Y, [(0, true), (2, false), (1, true)]),
        (UpAxis::X, [(1, false), (2, false), (0, true)]),
    ];
    for (up, frame) in frames {
        let part = |at: [u32; 3]| {
            let mut voxel = [0; 3];
            for (coordinate, (axis, along)) in at.into_iter().zip(frame) {
                voxel[axis] = if along { coordinate } else { 20 - coordinate };
            }
            voxel
        };
        // Seen from the front: an L whose foot points right, on a base line.
        let l_shape = |[r, b, u]: [u32; 3]| b == 10 && (r < 4 || u < 4);
        let volume = |shape: &dyn Fn([u32; 3]) -> bool| {
            let mut volume = fill([21; 3], |_| false);
            for r in 0..21 {
                for b in 0..21 {
                    (0..21).filter(|&u| shape([r, b, u])).for_each(|u| volume.set(part([r, b, u])));
                }
            }
            volume
        };
        let front = PreviewOptions { up, azimuth: 0.0, elevation: 0.0, ..cut_out([100, 100]) };
        let picture = render_preview(&volume(&l_shape), &front).unwrap();
        let (left, right, high, low) = ([0.1, 0.4], [0.6, 0.9], [0.1, 0.4], [0.6, 0.9]);
        assert!(coverage(&picture, left, high) > 200.0, "{up:?}: the stem stands on the left");
        assert!(coverage(&picture, right, low) > 200.0, "{up:?}: the foot points to the right");
        assert_eq!(coverage(&picture, right, high), 0.0, "{up:?}");

        // Seen from the right side, what is in front is on the left.
        let l_shape = |[r, b, u]: [u32; 3]| r == 10 && (b < 4 || u < 4);
        let side = PreviewOptions { azimuth: 90.0, ..front };
        let picture = render_preview(&volume(&l_shape), &side).unwrap();
        assert!(coverage(&picture, left, high) > 200.0, "{up:?}: the stem stands in front");
        assert_eq!(coverage(&picture, right, high), 0.0, "{up:?}");
    }
}

#[test]
fn light_comes_from_above_and_the_shadow_falls_to_the_right() {
    let volume = ball(60);
    let options = PreviewOptions { size: [200, 200], elevation: 10.0, ..cut_out([200, 200]) };
    let picture = render_preview(&volume, &options).unwrap();
    let brightness = |x, y| picture.pixel(x, y).unwrap()[..3].iter().map(|&c| u32::from(c)).sum::<u32>();
    assert!(brightness(80, 50) > brightness(110, 160) + 60);

    let grounded = PreviewOptions { ground: true, elevation: 25.0, ..options };
    let picture = render_preview(&volume, &grounded).unwrap();
    let shadow = |columns| coverage(&picture, columns, [0.55, 0.9]);
    assert!(shadow([0.5, 1.0]) > shadow([0.0, 0.5]) + 100.0);
    assert!(picture.pixel(0, 199).unwrap()[3] < 16, "far from the object there is hardly a shadow");
}

#[test]
fn an_empty_volume_gives_the_backdrop() {
    let mut volume = fill([4, 5, 6], |_| false);
    for _ in 0..2 {
        let picture = render_preview(&volume, &PreviewOptions { size: [64, 48], ..PreviewOptions::default() }).unwrap();
        assert!(picture.rgba.chunks_exact(4).all(|p| p[3] == 255 && p.iter().all(|&c| c > 200)));
        // Empty though no longer pristine.
        volume.words_mut();
    }
    let picture = render_preview(&volume, &cut_out([3, 2])).unwrap();
    assert_eq!(picture.rgba, [0; 24]);
}

#[test]
fn extreme_volumes_and_pictures_work() {
    let volumes = [
        fill([1, 1, 1], |_| true),
        fill([1, 1, 200], |_| true),
        fill([90, 80, 1], |_| true),
        fill([1, 70, 70], |[_, y, z]| y % 3 == z % 2),
        fill([64, 64, 64], |v| v == [63, 63, 63]),
        fill_grid(Grid::new([0.0; 3], [1e-300, 1.0, 1e300], [3, 3, 3]).unwrap(), |_| true),
    ];
    for volume in &volumes {
        for size in [[1, 1], [40, 30], [1, 300], [700, 2]] {
            for up in [UpAxis::X, UpAxis::Y, UpAxis::Z] {
                for (samples_per_pixel, elevation, field_of_view) in
                    [(1, -90.0, 0.0), (5, 26.0, 24.0), (4, 90.0, 120.0)]
                {
                    let options = PreviewOptions {
                        size,
                        up,
                        samples_per_pixel,
                        elevation,
                        field_of_view,
                        ..PreviewOptions::default()
                    };
                    let picture = render_preview(volume, &options).unwrap();
                    assert_eq!(picture.rgba.len() as u64, u64::from(size[0]) * u64::from(size[1]) * 4);
                }
            }
        }
    }
}

#[test]
fn proportions_of_voxels_are_kept() {
    // Four by one by one voxels that are a quarter as long as wide: a cube.
    let grid = Grid::new([0.0; 3], [0.25, 1.0, 1.0], [4, 1, 1]).unwrap();
    let options = PreviewOptions { voxel_edges: false, ..cut_out([90, 90]) };
    let stretched = render_preview(&fill_grid(grid, |_| true), &options).unwrap();
    let cube = render_preview(&fill([4; 3], |_| true), &options).unwrap();
    let [a, b] = [&stretched, &cube].map(|picture| coverage(picture, ALL, ALL));
    assert!((a / b - 1.0).abs() < 0.02, "{a} {b}");
}

#[test]
fn the_camera_looks_at_set_voxels_not_at_the_grid() {
    let small = render_preview(&fill([3; 3], |_| true), &cut_out([80, 60])).unwrap();
    let corner = |v: [u32; 3]| v.iter().all(|c| (150..153).contains(c));
    let in_large = render_preview(&fill([160; 3], corner), &cut_out([80, 60])).unwrap();
    let [a, b] = [&small, &in_large].map(|picture| coverage(picture, ALL, ALL));
    assert!((a / b - 1.0).abs() < 1e-3, "{a} {b}");
}

#[test]
fn options_out_of_range_are_refused_by_name() {
    let volume = fill([1; 3], |_| true);
    let default = PreviewOptions::default();
    let message = |options: PreviewOptions| render_preview(&volume, &options).unwrap_err().to_string();
    assert_eq!(
        message(PreviewOptions { size: [0, 9], ..default.clone() }),
        "a picture of 0 x 9 pixels is out of range: each side takes 1 to 16384"
    );
    assert_eq!(
        message(PreviewOptions { elevation: f64::NAN, ..default.clone() }),
        "preview option elevation = NaN is out of range: it takes -90 to 90"
    );
    assert_eq!(
        message(PreviewOptions { samples_per_pixel: 65, ..default }),
        "preview option samples_per_pixel = 65 is out of range: it takes 1 to 64"
    );
}
