//! What is round the object: a sky or a panorama, and a floor. `shaders/environment.wgsl` is the same for the GPU, so
//! everything is in f32.

use glam::{DVec3, Vec3};

use super::error::LightError;
use crate::picture::{decode, linear_from_srgb};

/// What is round the object.
#[derive(Clone, Debug, Default)]
pub struct Environment {
    /// What is far away.
    pub background: Background,
    /// What the object stands on.
    pub floor: Floor,
}

/// What is far away.
#[derive(Clone, Debug, Default)]
pub enum Background {
    /// A clear sky with a sun, and a horizon.
    #[default]
    Sky,
    /// The same linear light from everywhere.
    Plain([f32; 3]),
    /// A picture of everything round.
    Panorama(Panorama),
}

/// What the object stands on. It is seen from above only.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Floor {
    /// Nothing.
    None,
    /// Tiles of two colours, each a fifth of the object's longest side wide.
    #[default]
    Checker,
    /// One light colour.
    Plain,
}

/// An equirectangular picture of everything round: the middle lies behind the object as seen from its front, the top row is
/// straight up.
#[derive(Clone, Debug)]
pub struct Panorama {
    pub(super) size: [u32; 2],
    /// Linear red, green and blue, rows from the top.
    pub(super) pixels: Vec<[f32; 3]>,
}

impl Panorama {
    /// The most pixels along a side.
    pub const MAX_SIDE: u32 = 8192;
    /// The most light that a pixel gives; more of it is cut off.
    pub const MAX_LIGHT: f32 = 60_000.0;

    /// A panorama of linear light, rows from the top.
    ///
    /// # Errors
    /// When a side is 0 or larger than [`Panorama::MAX_SIDE`], or there is not one pixel for each place.
    pub fn new(size: [u32; 2], pixels: Vec<[f32; 3]>) -> Result<Self, LightError> {
        let sides = size.iter().all(|side| (1..=Self::MAX_SIDE).contains(side));
        if !sides || pixels.len() as u64 != u64::from(size[0]) * u64::from(size[1]) {
            return Err(LightError::Panorama { size, pixels: pixels.len() });
        }
        // Written so that NaN becomes 0.
        let tame = |c: f32| if c > 0.0 { c.min(Self::MAX_LIGHT) } else { 0.0 };
        Ok(Self { size, pixels: pixels.into_iter().map(|p| p.map(tame)).collect() })
    }

    /// Reads an image file: `.hdr` (Radiance) holds linear light, `.png` and `.jpg` sRGB, whose white is light of 1.
    ///
    /// # Errors
    /// When the file is damaged, of another format or too large.
    pub fn decode(bytes: &[u8]) -> Result<Self, LightError> {
        let image = decode(bytes, None)?;
        let size = [image.width(), image.height()];
        let linear = matches!(image, image::DynamicImage::ImageRgb32F(_) | image::DynamicImage::ImageRgba32F(_));
        let pixels = if linear {
            image.into_rgb32f().pixels().map(|p| p.0).collect()
        } else {
            image.into_rgb8().pixels().map(|p| p.0.map(linear_from_srgb)).collect()
        };
        Self::new(size, pixels)
    }

    /// The light from a direction of unit length.
    fn light(&self, direction: Vec3) -> Vec3 {
        let u = direction.x.atan2(direction.y) / std::f32::consts::TAU + 0.5;
        let v = direction.z.clamp(-1.0, 1.0).acos() / std::f32::consts::PI;
        #[expect(clippy::cast_precision_loss, reason = "at most 8192")]
        let [x, y] = [u * self.size[0] as f32 - 0.5, v * self.size[1] as f32 - 0.5];
        let [fx, fy] = [x - x.floor(), y - y.floor()];
        let at = |dx: f32, dy: f32| {
            #[expect(clippy::cast_possible_truncation, reason = "at most 8192")]
            let [column, row] = [(x.floor() + dx) as i64, (y.floor() + dy) as i64];
            let [width, height] = self.size.map(i64::from);
            let index = row.clamp(0, height - 1) * width + column.rem_euclid(width);
            usize::try_from(index).ok().and_then(|i| self.pixels.get(i)).map_or(Vec3::ZERO, |&p| p.into())
        };
        let row = |dy| at(0.0, dy).lerp(at(1.0, dy), fx);
        row(0.0).lerp(row(1.0), fy)
    }
}

/// Towards the sky's sun.
pub(super) const SUN: Vec3 = Vec3::new(-6.0 / 11.0, -6.0 / 11.0, 7.0 / 11.0);

impl Environment {
    /// The light that comes to `origin` from `direction`, with the floor at height `floor`.
    pub(super) fn light(&self, origin: DVec3, direction: DVec3, floor: f32) -> Vec3 {
        let (origin, direction) = (origin.as_vec3(), direction.as_vec3());
        match self.floor_point(origin, direction, floor) {
            Some(point) => self.to_horizon(self.floor_color(point) * FLOOR_LIGHT, point, direction),
            None => self.far(direction),
        }
    }

    /// The floor's light at a point, which fades into the horizon's far away.
    pub(super) fn to_horizon(&self, light: Vec3, point: Vec3, direction: Vec3) -> Vec3 {
        let horizon = self.far(Vec3::new(direction.x, direction.y, 0.0).normalize_or(direction));
        light.lerp(horizon, smoothstep(4.0, 11.0, point.truncate().length()))
    }

    /// Where a ray meets the floor from above.
    pub(super) fn floor_point(&self, origin: Vec3, direction: Vec3, floor: f32) -> Option<Vec3> {
        if self.floor == Floor::None || direction.z > -1e-5 || origin.z <= floor - FLOOR_SLACK {
            return None;
        }
        Some(origin + ((floor - origin.z) / direction.z).max(0.0) * direction)
    }

    /// The floor's own colour at a point of it.
    pub(super) fn floor_color(&self, point: Vec3) -> Vec3 {
        if self.floor == Floor::Plain {
            return PLAIN_TILE;
        }
        let tile = (point.x / TILE).floor() + (point.y / TILE).floor();
        let odd = tile - 2.0 * (tile * 0.5).floor();
        DARK_TILE.lerp(LIGHT_TILE, odd)
    }

    fn far(&self, direction: Vec3) -> Vec3 {
        match &self.background {
            Background::Sky => sky(direction),
            Background::Plain(color) => Vec3::from_array(*color),
            Background::Panorama(panorama) => panorama.light(direction),
        }
    }
}

/// Width of a tile.
const TILE: f32 = 0.2;
const LIGHT_TILE: Vec3 = Vec3::new(0.80, 0.79, 0.76);
const DARK_TILE: Vec3 = Vec3::new(0.13, 0.20, 0.30);
const PLAIN_TILE: Vec3 = Vec3::new(0.74, 0.73, 0.70);
/// Light that falls on the floor where nothing is in the way.
const FLOOR_LIGHT: f32 = 0.92;
/// Rays that leave an object's lowest point start a hair below the floor.
const FLOOR_SLACK: f32 = 0.02;

fn sky(d: Vec3) -> Vec3 {
    let horizon = Vec3::new(0.80, 0.87, 0.94);
    let zenith = Vec3::new(0.13, 0.30, 0.62);
    let ground = Vec3::new(0.34, 0.33, 0.32);
    let above = horizon.lerp(zenith, d.z.max(0.0).sqrt());
    let below = horizon.lerp(ground, (-d.z * 5.0).clamp(0.0, 1.0));
    let sun = d.dot(SUN).max(0.0);
    // Powers by repeated squaring are the same on every device.
    let glow = square(square(square(sun)));
    let disk = square(square(square(square(square(square(square(glow)))))));
    let shine = Vec3::new(1.0, 0.9, 0.75) * (0.25 * glow + 14.0 * disk);
    (if d.z >= 0.0 { above } else { below }) + shine
}

fn square(x: f32) -> f32 {
    x * x
}

fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panorama_is_seen_where_it_should_be() {
        // 4 x 2 pixels: the upper row tells the quarter of the sky, the lower row is dark.
        let upper = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 0.0]];
        let pixels = upper.into_iter().chain([[0.0; 3]; 4]).collect();
        let panorama = Panorama::new([4, 2], pixels).unwrap();
        let up = 45.0_f32.to_radians().sin();
        let quarter = |x: f32, y: f32| panorama.light(Vec3::new(x, y, up * 2.0_f32.sqrt()).normalize());
        assert_eq!(quarter(-1.0, -1.0).round(), Vec3::X, "left of the front");
        assert_eq!(quarter(-1.0, 1.0).round(), Vec3::Y);
        assert_eq!(quarter(1.0, 1.0).round(), Vec3::Z);
        assert_eq!(quarter(1.0, -1.0).round(), Vec3::new(1.0, 1.0, 0.0));
        assert!(panorama.light(Vec3::NEG_Z).max_element() < 1e-6);
    }

    #[test]
    fn panoramas_of_odd_sizes_and_wild_light_are_tamed() {
        assert!(Panorama::new([0, 2], vec![]).is_err());
        assert!(Panorama::new([2, 2], vec![[0.0; 3]; 3]).is_err());
        let wild = Panorama::new([1, 1], vec![[f32::NAN, -1.0, f32::INFINITY]]).unwrap();
        assert_eq!(wild.light(Vec3::Y), Vec3::new(0.0, 0.0, Panorama::MAX_LIGHT));
    }

    #[test]
    fn the_floor_has_tiles_and_is_seen_from_above_only() {
        let world = Environment::default();
        let down = DVec3::NEG_Z;
        let at = |x: f64| world.light(DVec3::new(x, 0.1, 1.0), down, -0.5);
        assert!(at(0.1) != at(0.3) && at(0.1) == at(0.5));
        let below = world.light(DVec3::new(0.1, 0.1, -1.0), down, -0.5);
        assert_eq!(below, sky(Vec3::NEG_Z));
        assert_eq!(world.light(DVec3::ZERO, DVec3::Z, -0.5), sky(Vec3::Z));
    }

    #[test]
    fn the_sun_is_a_direction() {
        assert!((SUN.length() - 1.0).abs() < 1e-6);
    }
}
