//! The same effects by ray tracing the triangles themselves, with exact intersections: what the voxels are measured against.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::bvh::{Bvh, Hit};
use super::camera::{Camera, jitter};
use super::error::LightError;
use super::optics::{reflect, reflectance, refract, transmittance};
use super::options::{Effect, LightOptions, Surfaces};
use super::radiance::Radiance;
use super::scene::OpticalScene;
use super::shadow::{LightFrame, surface_light};

/// Rays start this far from the surface that they leave; the object's longest side is 1.
const OFF: f64 = 1e-7;

/// How a ray leaves an object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExitRay {
    /// The last point at which it was bent, or where it came from if it met nothing.
    pub origin: [f64; 3],
    /// Its direction from there, of unit length.
    pub direction: [f64; 3],
    /// The share of light that the media left of it.
    pub transmittance: [f64; 3],
}

/// Traces the triangles of a scene.
pub struct Reference<'a> {
    scene: &'a OpticalScene,
    options: &'a LightOptions,
    bvh: Bvh,
}

/// Which classes a point is inside of, one bit each.
type Inside = u64;

impl<'a> Reference<'a> {
    /// Makes a scene ready.
    ///
    /// # Errors
    /// When an option is out of range.
    pub fn new(scene: &'a OpticalScene, options: &'a LightOptions) -> Result<Self, LightError> {
        options.check()?;
        scene.check_classes()?;
        Ok(Self { scene, options, bvh: Bvh::new(&scene.mesh) })
    }

    /// Takes the picture, on all threads; their number changes nothing.
    #[must_use]
    pub fn render(&self, effect: Effect) -> Radiance {
        let camera = self.options.orbit.camera(self.scene.half(), self.options.size);
        let [width, height] = self.options.size;
        let light = LightFrame::new(&self.options.sun);
        let start = self.inside_at(camera.origin);
        let pixel = |x: u32, y: u32| {
            let samples = (0..self.options.samples).map(|sample| {
                let [dx, dy] = jitter(sample);
                let direction = DVec3::from_array(camera.direction(f64::from(x) + dx, f64::from(y) + dy));
                match effect {
                    Effect::Refraction(surfaces) => self.through(&camera, direction, start, surfaces, false),
                    Effect::Transmittance(surfaces) => self.through(&camera, direction, start, surfaces, true),
                    Effect::TransparentShadow => self.lit(&camera, direction, &light),
                }
            });
            #[expect(clippy::cast_precision_loss, reason = "at most 256")]
            let mean = samples.sum::<Vec3>() / self.options.samples as f32;
            mean.to_array()
        };
        let row = |y: u32| (0..width).map(move |x| pixel(x, y));
        Radiance { size: [width, height], pixels: (0..height).into_par_iter().flat_map_iter(row).collect() }
    }

    /// How the ray through the middle of each pixel leaves the object, rows from the top.
    #[must_use]
    pub fn exit_rays(&self, surfaces: Surfaces) -> Vec<ExitRay> {
        let camera = self.options.orbit.camera(self.scene.half(), self.options.size);
        let [width, height] = self.options.size;
        let start = self.inside_at(camera.origin);
        let ray = |x: u32, y: u32| {
            let direction = DVec3::from_array(camera.direction(f64::from(x) + 0.5, f64::from(y) + 0.5));
            self.trace(camera.origin, direction, start, surfaces, true).exit
        };
        let row = |y: u32| (0..width).map(move |x| ray(x, y));
        (0..height).into_par_iter().flat_map_iter(row).collect()
    }

    fn through(&self, camera: &Camera, direction: DVec3, start: Inside, surfaces: Surfaces, absorb: bool) -> Vec3 {
        let traced = self.trace(camera.origin, direction, start, surfaces, absorb);
        let [origin, direction, tint] =
            [traced.exit.origin, traced.exit.direction, traced.exit.transmittance].map(DVec3::from_array);
        #[expect(clippy::cast_possible_truncation, reason = "a height of at most 1")]
        let floor = self.scene.floor() as f32;
        let light = |origin, direction| self.options.environment.light(origin, direction, floor);
        let mut sum = tint.as_vec3() * light(origin, direction);
        if let Some(mirror) = traced.mirror.filter(|_| self.options.fresnel) {
            #[expect(clippy::cast_possible_truncation, reason = "at most 1")]
            let share = mirror.share as f32;
            sum = sum * (1.0 - share) + share * light(mirror.origin, mirror.direction);
        }
        sum
    }

    fn trace(&self, origin: DVec3, direction: DVec3, inside: Inside, surfaces: Surfaces, absorb: bool) -> Traced {
        let mut ray = Ray { origin, direction, inside, bent: origin, tint: DVec3::ONE, mirror: None, absorb };
        match surfaces {
            Surfaces::None => while self.advance(&mut ray).is_some() {},
            Surfaces::Two(_) => self.trace_two(&mut ray),
            Surfaces::Many => self.trace_many(&mut ray),
        }
        let Ray { direction, bent, tint, mirror, .. } = ray;
        let exit = ExitRay { origin: bent.to_array(), direction: direction.to_array(), transmittance: tint.to_array() };
        Traced { exit, mirror }
    }

    /// Bends the ray at every surface between media of different index.
    fn trace_many(&self, ray: &mut Ray) {
        let mut count = 0;
        while count < self.options.max_surfaces {
            let from = ray.inside;
            let Some(hit) = self.advance(ray) else { break };
            let [index, behind] = [from, ray.inside].map(|inside| self.index_inside(inside));
            if index == behind {
                continue;
            }
            count += 1;
            if !self.bend(ray, &hit, index, behind) {
                // Reflected: still where it was.
                ray.inside = from;
            }
        }
    }

    /// Bends the ray where it enters and where it leaves the object, which counts as all of the medium entered.
    fn trace_two(&self, ray: &mut Ray) {
        let absorb = std::mem::replace(&mut ray.absorb, false);
        let entry = loop {
            let outside = ray.inside == 0;
            let Some(hit) = self.advance(ray) else { return };
            if outside && ray.inside != 0 {
                break hit;
            }
        };
        let class = self.top(ray.inside).unwrap_or(0);
        let index = self.scene.classes[class].refraction_index;
        let start = ray.origin;
        if index != 1.0 && !self.bend(ray, &entry, 1.0, index) {
            return;
        }
        let exit = loop {
            let Some(hit) = self.advance(ray) else { return };
            if ray.inside == 0 {
                break hit;
            }
        };
        if absorb {
            ray.tint *= transmittance(self.scene.classes[class].absorption, ray.origin.distance(start));
        }
        if index != 1.0 {
            self.bend(ray, &exit, index, 1.0);
        }
    }

    /// Moves a ray to and through the next surface, straight on.
    fn advance(&self, ray: &mut Ray) -> Option<Hit> {
        let hit = self.bvh.nearest(ray.origin, ray.direction, OFF)?;
        if let (Some(class), true) = (self.top(ray.inside), ray.absorb) {
            ray.tint *= transmittance(self.scene.classes[class].absorption, hit.t);
        }
        ray.origin += hit.t * ray.direction;
        ray.inside ^= 1 << self.scene.class_of_triangle(hit.triangle as usize);
        Some(hit)
    }

    /// Turns a ray at the surface that it is at; `false` if all of it is reflected.
    fn bend(&self, ray: &mut Ray, hit: &Hit, index: f64, behind: f64) -> bool {
        let normal = self.normal(hit, ray.direction);
        let mirrored = reflect(ray.direction, normal);
        if ray.mirror.is_none() {
            // Only a ray that comes from outside meets its first surface with something to mirror.
            let share = if index == 1.0 { reflectance(-normal.dot(ray.direction), index, behind) } else { 0.0 };
            ray.mirror = Some(Mirror { origin: ray.origin, direction: mirrored, share });
        }
        ray.bent = ray.origin;
        match refract(ray.direction, normal, index / behind) {
            Some(bent) => {
                ray.direction = Self::forwards(bent, ray.direction, hit, index / behind);
                true
            }
            None => {
                ray.direction = mirrored;
                false
            }
        }
    }

    /// A bent ray must not come out on the side that it came from, as interpolated normals may have it.
    fn forwards(bent: DVec3, direction: DVec3, hit: &Hit, ratio: f64) -> DVec3 {
        let face = hit.face.normalize_or(-direction);
        let face = if face.dot(direction) > 0.0 { -face } else { face };
        if bent.dot(face) < 0.0 { bent } else { refract(direction, face, ratio).unwrap_or(bent) }
    }

    /// The shading normal against the ray.
    fn normal(&self, hit: &Hit, direction: DVec3) -> DVec3 {
        let face = hit.face.normalize_or(-direction);
        let corners = self.scene.normals.get(hit.triangle as usize).copied().unwrap_or([face; 3]);
        let mixed = hit.weights[0] * corners[0] + hit.weights[1] * corners[1] + hit.weights[2] * corners[2];
        let mut normal = mixed.normalize_or(face);
        if normal.dot(face) < 0.0 {
            normal = -normal;
        }
        let against = |n: DVec3| if n.dot(direction) > 0.0 { -n } else { n };
        if (normal.dot(direction) > 0.0) == (face.dot(direction) > 0.0) { against(normal) } else { against(face) }
    }

    /// The class that a point inside of `inside` counts as: the last.
    fn top(&self, inside: Inside) -> Option<usize> {
        inside.checked_ilog2().and_then(|class| usize::try_from(class).ok())
    }

    fn index_inside(&self, inside: Inside) -> f64 {
        self.top(inside).map_or(1.0, |class| self.scene.classes[class].refraction_index)
    }

    fn inside_at(&self, point: DVec3) -> Inside {
        let hits = self.bvh.all(point, DVec3::NEG_Z);
        hits.iter().fold(0, |inside, hit| inside ^ (1 << self.scene.class_of_triangle(hit.triangle as usize)))
    }

    /// The light from an opaque surface or the floor, with the shadow of what is between it and the sun.
    fn lit(&self, camera: &Camera, direction: DVec3, light: &LightFrame) -> Vec3 {
        let environment = &self.options.environment;
        #[expect(clippy::cast_possible_truncation, reason = "a height of at most 1")]
        let floor = self.scene.floor() as f32;
        if let Some(hit) = self.bvh.nearest(camera.origin, direction, OFF) {
            let point = camera.origin + hit.t * direction;
            let medium = usize::from(self.scene.medium_of.get(hit.triangle as usize).copied().unwrap_or(0));
            let normal = self.normal(&hit, direction);
            let color = Vec3::from_array(self.scene.media[medium].color);
            let shadow = self.shadow(point, light);
            return surface_light(color, normal.as_vec3(), self.scene.sheets[medium], shadow, light, &self.options.sun);
        }
        let Some(point) = environment.floor_point(camera.origin.as_vec3(), direction.as_vec3(), floor) else {
            return environment.light(camera.origin, direction, floor);
        };
        let shadow = self.shadow(point.as_dvec3(), light);
        let color = environment.floor_color(point);
        let lit = surface_light(color, Vec3::Z, false, shadow, light, &self.options.sun);
        environment.to_horizon(lit, point, direction.as_vec3())
    }

    /// The share of the sun's light that comes to a point.
    fn shadow(&self, point: DVec3, light: &LightFrame) -> Vec3 {
        let hits = self.bvh.all(point + OFF * light.to_sun, light.to_sun);
        let media = self.scene.media.len();
        let mut depth = DVec3::ZERO;
        // The way inside of each solid medium is between its first and second surface, its third and fourth, and so on,
        // from the sun's end.
        let mut entered: Vec<Option<f64>> = vec![None; media];
        for hit in hits.iter().rev() {
            let medium = usize::from(self.scene.medium_of.get(hit.triangle as usize).copied().unwrap_or(0));
            let absorption = DVec3::from_array(self.scene.media[medium].absorption);
            if self.scene.sheets[medium] {
                depth += absorption * self.options.sheet_thickness;
            } else {
                match entered[medium].take() {
                    None => entered[medium] = Some(hit.t),
                    Some(start) => depth += absorption * (start - hit.t),
                }
            }
        }
        // Still inside where the point is.
        for (medium, start) in entered.iter().enumerate() {
            if let Some(start) = start {
                depth += DVec3::from_array(self.scene.media[medium].absorption) * *start;
            }
        }
        (-depth).exp().as_vec3()
    }
}

struct Traced {
    exit: ExitRay,
    mirror: Option<Mirror>,
}

/// A ray on its way.
struct Ray {
    origin: DVec3,
    direction: DVec3,
    inside: Inside,
    /// The last place where it was bent: the environment is seen from there.
    bent: DVec3,
    tint: DVec3,
    mirror: Option<Mirror>,
    /// Whether media absorb.
    absorb: bool,
}

/// The outermost surface's reflection.
#[derive(Clone, Copy)]
struct Mirror {
    origin: DVec3,
    direction: DVec3,
    share: f64,
}
