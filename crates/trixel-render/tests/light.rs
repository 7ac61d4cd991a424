//! Light through voxels against physics in closed form, and against the triangles traced.
//!
//! `TRIXEL_GOLDEN=1` writes the golden pictures anew.

#![expect(clippy::unwrap_used, clippy::panic, clippy::cast_precision_loss, reason = "a failure here is a failed test")]

use std::path::{Path, PathBuf};

use trixel::{Mesh, UpAxis};
use trixel_gpu::{AdapterChoice, Gpu};
use trixel_io::read::{ReadOptions, read_mesh};
use trixel_render::Picture;
use trixel_render::light::{
    Effect, Environment, ExitRay, Floor, LightOptions, LightRenderer, Medium, OpticalScene, Orbit, Placement,
    Reference, Sun, Surfaces, Thickness, exit_rays, psnr,
};

const DRIVERS: [&str; 2] = ["llvmpipe", "SwiftShader"];

fn open(name: &str) -> Gpu {
    Gpu::open(&AdapterChoice::Named(name.to_owned())).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// A closed box of the given sides round the origin.
fn block(sides: [f64; 3]) -> Mesh {
    let mut mesh = trixel::scene::build("cube:1").unwrap();
    mesh.positions.iter_mut().for_each(|p| *p = std::array::from_fn(|axis| (p[axis] - 0.5) * sides[axis]));
    mesh
}

fn scene(mesh: &Mesh, refraction_index: f64, absorption: f64) -> OpticalScene {
    let placement = Placement::new(&mesh.bounds().unwrap(), UpAxis::Z).unwrap();
    let media: Vec<Medium> = Medium::of_mesh(mesh)
        .into_iter()
        .map(|medium| Medium { refraction_index, absorption: [absorption; 3], ..medium })
        .collect();
    OpticalScene::new(mesh, &placement, &media).unwrap()
}

/// A camera so far away that all rays are nearly parallel: only the middle of the picture is looked at.
fn from_afar(elevation: f64, size: u32, field_of_view: f64, resolution: u32) -> LightOptions {
    LightOptions {
        size: [size; 2],
        resolution,
        orbit: Orbit { azimuth: 0.0, elevation, field_of_view, distance: Some(50.0) },
        ..LightOptions::default()
    }
}

type V = [f64; 3];

fn minus(a: V, b: V) -> V {
    std::array::from_fn(|i| a[i] - b[i])
}

fn dot(a: V, b: V) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

fn cross(a: V, b: V) -> V {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn length(a: V) -> f64 {
    dot(a, a).sqrt()
}

/// Degrees between two directions.
fn apart(a: V, b: V) -> f64 {
    length(cross(a, b)).atan2(dot(a, b)).to_degrees()
}

#[test]
fn a_slab_shifts_rays_by_snell_and_darkens_them_by_beer_and_lambert() {
    const THICK: f64 = 0.25;
    const ABSORPTION: f64 = 3.0;
    let resolution = 64;
    let voxel = 1.0 / f64::from(resolution);
    let mesh = block([1.0, THICK, 1.0]);
    for name in DRIVERS {
        let gpu = open(name);
        for index in [1.0, 1.33, 1.5, 2.4] {
            let scene = scene(&mesh, index, ABSORPTION);
            for degrees in [0.0_f64, 20.0, 45.0, 60.0] {
                let options = from_afar(degrees, 1, 1.0, resolution);
                let camera = options.orbit.camera(scene.half(), options.size);
                let (from, incident) = (camera.origin(), camera.direction(0.5, 0.5));
                let sin = degrees.to_radians().sin();
                let inside = (sin / index).asin();
                let shift = THICK * (degrees.to_radians() - inside).sin() / inside.cos();
                let left = (-ABSORPTION * THICK / inside.cos()).exp();
                for surfaces in [Surfaces::Two(Thickness::Refracted), Surfaces::Many] {
                    let [ray] = exit_rays(&gpu, &scene, surfaces, &options).unwrap()[..] else { panic!("one pixel") };
                    let found = if index == 1.0 { 0.0 } else { length(cross(minus(ray.origin, from), incident)) };
                    let what = format!("{name}, {surfaces:?}, index {index}, {degrees} degrees");
                    assert!(apart(ray.direction, incident) < 0.1, "{what}: leaves along {:?}", ray.direction);
                    assert!((found - shift).abs() < 0.25 * voxel, "{what}: shifted {found}, not {shift}");
                    let [red, ..] = ray.transmittance;
                    assert!((red / left - 1.0).abs() < 0.01, "{what}: {red} left, not {left}");
                }
            }
        }
    }
}

#[test]
fn a_ball_darkens_rays_by_their_chord() {
    let mesh = trixel::scene::build("sphere:48").unwrap();
    const ABSORPTION: f64 = 2.0;
    let scene = scene(&mesh, 1.0, ABSORPTION);
    let options = from_afar(0.0, 33, 1.4, 96);
    let camera = options.orbit.camera(scene.half(), options.size);
    for name in DRIVERS {
        let rays = exit_rays(&open(name), &scene, Surfaces::None, &options).unwrap();
        let mut most = 0.0_f64;
        for (i, ray) in (0..).zip(&rays) {
            let direction = camera.direction(f64::from(i % 33) + 0.5, f64::from(i / 33) + 0.5);
            let away = length(cross(camera.origin(), direction));
            let chord = 2.0 * (0.25 - away * away).max(0.0).sqrt();
            most = most.max((ray.transmittance[0] - (-ABSORPTION * chord).exp()).abs());
        }
        assert!(most < 0.03, "{name}: the worst ray is off by {most}");
    }
}

#[test]
fn a_ball_lens_has_its_focal_length() {
    const RADIUS: f64 = 0.5;
    let mesh = trixel::scene::build("sphere:96").unwrap();
    for name in DRIVERS {
        let gpu = open(name);
        for index in [1.3, 1.5, 1.8] {
            let scene = scene(&mesh, index, 0.0);
            let options = from_afar(0.0, 65, 1.0, 128);
            let camera = options.orbit.camera(scene.half(), options.size);
            for surfaces in [Surfaces::Two(Thickness::Refracted), Surfaces::Many] {
                let rays = exit_rays(&gpu, &scene, surfaces, &options).unwrap();
                let mut ratios: Vec<f64> = (0..)
                    .zip(&rays)
                    .filter_map(|(i, ray)| {
                        let direction = camera.direction(f64::from(i % 65) + 0.5, f64::from(i / 65) + 0.5);
                        let height = length(cross(camera.origin(), direction));
                        // Nearer to the axis the crossing is too uncertain, and further out aberration hides the focus.
                        (0.05..0.2)
                            .contains(&height)
                            .then(|| focus(ray, direction) / expected_focus(height, RADIUS, index))
                    })
                    .collect();
                ratios.sort_by(f64::total_cmp);
                let [low, middle, high] = [10, 50, 90].map(|percent| ratios[ratios.len() * percent / 100]);
                let what = format!("{name}, {surfaces:?}, index {index}: {low} {middle} {high} of the focal length");
                assert!((middle - 1.0).abs() < 0.02 && low > 0.9 && high < 1.1, "{what}");
            }
        }
    }
}

/// How far behind the ball's centre a ray comes nearest to the line through the centre along `axis`.
fn focus(ray: &ExitRay, axis: V) -> f64 {
    let across: V = std::array::from_fn(|i| ray.origin[i] - dot(ray.origin, axis) * axis[i]);
    let sideways: V = std::array::from_fn(|i| ray.direction[i] - dot(ray.direction, axis) * axis[i]);
    let t = -dot(across, sideways) / dot(sideways, sideways);
    dot(ray.origin, axis) + t * dot(ray.direction, axis)
}

/// The same by Snell's law, for a ray at a height above the axis: near the axis `n R / (2 (n - 1))`.
fn expected_focus(height: f64, radius: f64, index: f64) -> f64 {
    let outside = (height / radius).asin();
    let inside = (height / radius / index).asin();
    height / (2.0 * (outside - inside)).sin()
}

#[test]
fn a_block_throws_the_shadow_of_the_way_through_it() {
    const ABSORPTION: f64 = 1.5;
    let mesh = block([0.5, 0.5, 1.0]);
    let options = LightOptions {
        size: [64, 48],
        samples: 1,
        resolution: 64,
        orbit: Orbit { azimuth: 0.0, elevation: 40.0, field_of_view: 40.0, distance: Some(3.0) },
        environment: Environment { floor: Floor::Plain, ..Environment::default() },
        sun: Sun { azimuth: -90.0, elevation: 50.0, ambient: 0.2 },
        ..LightOptions::default()
    };
    let elevation = options.sun.elevation.to_radians();
    let to_sun = [-elevation.cos(), 0.0, elevation.sin()];
    for name in DRIVERS {
        let gpu = open(name);
        let renderer = LightRenderer::new(&gpu, Effect::TransparentShadow, &options).unwrap();
        let light = |absorption: f64| renderer.render(&scene(&mesh, 1.0, absorption)).unwrap().radiance.pixels;
        let [none, some, all] = [0.0, ABSORPTION, 1e5].map(light);
        let camera = options.orbit.camera([0.25, 0.25, 0.5], options.size);
        let mut shadowed = 0;
        let mut errors: Vec<f64> = vec![];
        for (i, pixel) in some.iter().enumerate() {
            let [x, y] = [i % 64, i / 64].map(|at| at as f64 + 0.5);
            let direction = camera.direction(x, y);
            let t = (-0.5 - camera.origin()[2]) / direction[2];
            let point: V = std::array::from_fn(|axis| camera.origin()[axis] + t * direction[axis]);
            let seen = through_block([0.25, 0.25, 0.5], camera.origin(), direction) == 0.0;
            if direction[2] >= 0.0 || !seen || none[i][0] - all[i][0] < 0.05 {
                continue;
            }
            let way = through_block([0.25, 0.25, 0.5], point, to_sun);
            let expected = (-ABSORPTION * way).exp();
            let found = f64::from((pixel[0] - all[i][0]) / (none[i][0] - all[i][0]));
            shadowed += usize::from(way > 0.05);
            errors.push((found - expected).abs());
        }
        errors.sort_by(f64::total_cmp);
        let [middle, high] = [50, 95].map(|percent| errors[errors.len() * percent / 100]);
        assert!(shadowed > 100, "{name}: {shadowed} pixels of shadow");
        assert!(middle < 0.01 && high < 0.05, "{name}: shadows are off by {middle}, {high}");
    }
}

/// How long a ray is inside of a block round the origin.
fn through_block(half: V, from: V, direction: V) -> f64 {
    let ends: Vec<[f64; 2]> = (0..3)
        .map(|axis| {
            let [a, b] = [-half[axis], half[axis]].map(|side| (side - from[axis]) / direction[axis]);
            [a.min(b), a.max(b)]
        })
        .filter(|ends| ends.iter().all(|end| !end.is_nan()))
        .collect();
    let outside = (0..3).any(|axis| direction[axis] == 0.0 && from[axis].abs() > half[axis]);
    let enter = ends.iter().map(|end| end[0]).fold(0.0, f64::max);
    let leave = ends.iter().map(|end| end[1]).fold(f64::INFINITY, f64::min);
    if outside { 0.0 } else { (leave - enter).max(0.0) }
}

/// How alike the picture from voxels is to that from triangles.
fn likeness(gpu: &Gpu, mesh: &Mesh, up: UpAxis, effect: Effect, resolution: u32) -> f64 {
    let options = LightOptions { size: [160, 120], resolution, ..LightOptions::default() };
    let placement = Placement::new(&mesh.bounds().unwrap(), up).unwrap();
    let media: Vec<Medium> =
        Medium::of_mesh(mesh).into_iter().map(|medium| Medium { absorption: [3.0, 1.0, 2.0], ..medium }).collect();
    let scene = OpticalScene::new(mesh, &placement, &media).unwrap();
    let found = LightRenderer::new(gpu, effect, &options).unwrap().render(&scene).unwrap().radiance;
    assert!(found.pixels.iter().flatten().all(|c| c.is_finite()));
    let traced = Reference::new(&scene, &options).unwrap().render(effect);
    psnr(&found.to_picture(), &traced.to_picture()).unwrap()
}

const TWO: Surfaces = Surfaces::Two(Thickness::Refracted);

#[test]
fn pictures_are_like_those_that_are_traced() {
    let gpu = open(DRIVERS[0]);
    let check = |name: &str, mesh: &Mesh, up: UpAxis, least: [f64; 3]| {
        let effects =
            [Effect::Refraction(TWO), Effect::Refraction(Surfaces::Many), Effect::Transmittance(Surfaces::Many)];
        let found = effects.map(|effect| likeness(&gpu, mesh, up, effect, 128));
        println!("{name}: {found:.1?} dB");
        assert!(found.iter().zip(least).all(|(found, least)| *found >= least), "{name}: {found:?} dB, not {least:?}");
    };
    for (name, least) in [("sphere:96", [38.0, 38.0, 38.0]), ("torus:256", [36.0, 35.0, 35.0])] {
        check(name, &trixel::scene::build(name).unwrap(), UpAxis::Z, least);
    }
    for (file, up, least) in
        [("bunny/bun_zipper.ply", UpAxis::Y, [22.0, 24.0, 24.0]), ("horse/horse.ply", UpAxis::Y, [29.0, 28.0, 28.0])]
    {
        match model(file) {
            Some(path) => check(file, &read_mesh(&path, &ReadOptions::default()).unwrap().mesh, up, least),
            None => println!("{file} is not there: left out"),
        }
    }
}

/// A real mesh, where there are any.
fn model(file: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("TRIXEL_MODELS")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/models"), PathBuf::from);
    Some(folder.join(file)).filter(|path| path.is_file())
}

/// Every effect.
const EFFECTS: [Effect; 6] = [
    Effect::Refraction(Surfaces::None),
    Effect::Refraction(TWO),
    Effect::Refraction(Surfaces::Two(Thickness::Incident)),
    Effect::Refraction(Surfaces::Many),
    Effect::Transmittance(Surfaces::Many),
    Effect::TransparentShadow,
];

#[test]
fn meshes_with_holes_give_numbers() {
    let mut torus = trixel::scene::build("torus:48").unwrap();
    torus.triangles = torus.triangles.iter().copied().enumerate().filter(|(i, _)| i % 7 != 0).map(|(_, t)| t).collect();
    let triangle = trixel::scene::build("triangle").unwrap();
    let mut flat = block([1.0, 1.0, 1.0]);
    flat.positions.iter_mut().for_each(|p| p[2] = 0.0);
    for (name, mesh) in [("torn torus", torus), ("triangle", triangle), ("flat block", flat)] {
        for driver in DRIVERS {
            let gpu = open(driver);
            for effect in EFFECTS {
                let options = LightOptions { size: [40, 30], resolution: 32, samples: 2, ..LightOptions::default() };
                let scene = scene(&mesh, 1.5, 4.0);
                let lit = LightRenderer::new(&gpu, effect, &options).unwrap().render(&scene).unwrap();
                let traced = Reference::new(&scene, &options).unwrap().render(effect);
                for pixels in [&lit.radiance.pixels, &traced.pixels] {
                    let sound = pixels.iter().flatten().all(|c| c.is_finite() && *c >= 0.0);
                    assert!(sound, "{name}, {driver}, {effect:?}");
                }
            }
        }
    }
}

/// Drivers rasterize the edges of leaves differently, which is all that the bound leaves room for.
#[test]
fn pictures_are_like_the_golden_ones() {
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden");
    for (name, spec, effect) in [
        ("tree-shadow", "tree:5", Effect::TransparentShadow),
        ("knot-refraction", "knot:192", Effect::Refraction(Surfaces::Many)),
        ("glass-ball", "glass-ball:16", Effect::Transmittance(Surfaces::Many)),
    ] {
        let mesh = trixel::scene::build(spec).unwrap();
        let options = LightOptions { size: [96, 72], resolution: 96, ..LightOptions::default() };
        let placement = Placement::new(&mesh.bounds().unwrap(), UpAxis::Z).unwrap();
        let scene = OpticalScene::new(&mesh, &placement, &Medium::of_mesh(&mesh)).unwrap();
        let path = golden.join(format!("{name}.png"));
        for (number, driver) in DRIVERS.into_iter().enumerate() {
            let renderer = LightRenderer::new(&open(driver), effect, &options).unwrap();
            let picture = renderer.render(&scene).unwrap().radiance.to_picture();
            if number == 0 && std::env::var_os("TRIXEL_GOLDEN").is_some() {
                std::fs::create_dir_all(&golden).unwrap();
                picture.encode_png(std::fs::File::create(&path).unwrap()).unwrap();
            }
            let kept = Picture::decode_png(&std::fs::read(&path).unwrap()).unwrap();
            let likeness = psnr(&picture, &kept).unwrap();
            println!("{name}, {driver}: {likeness:.1} dB");
            assert!(likeness > 35.0, "{name}, {driver}: {likeness} dB from the golden picture");
        }
    }
}
