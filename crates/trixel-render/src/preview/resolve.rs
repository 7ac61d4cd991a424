//! From samples to bytes: light and sky averaged over neighbours on the same surface, the backdrop, and sRGB.

use glam::Vec3;

use super::shade::{Pixel, TILE, Visibility};
use super::{Background, PreviewOptions};
use crate::picture::{byte, linear_from_srgb, srgb_from_linear};

/// How much of the ground's brightness the sky and the key light account for; the rest never darkens.
const GROUND_SKY: f32 = 0.42;
const GROUND_KEY: f32 = 0.34;
/// Neighbours before a pixel in its averaging window, one tile wide; the rest come after it.
const BEFORE: u32 = 1;
const AFTER: u32 = TILE - 1 - BEFORE;

/// The rows that resolving rows `top..bottom` looks at.
pub(super) fn rows_needed(top: u32, bottom: u32, height: u32) -> (u32, u32) {
    (top.saturating_sub(BEFORE), (bottom + AFTER).min(height))
}

/// Shaded rows `first..last` of a picture.
pub(super) struct Band<'a> {
    /// Row after row.
    pub pixels: &'a [Pixel],
    /// Pixels in a row.
    pub width: u32,
    /// The first row.
    pub first: u32,
    /// One past the last row.
    pub last: u32,
}

impl Band<'_> {
    /// The pixel at column `x` of row `y`.
    pub(super) fn at(&self, x: u32, y: u32) -> &Pixel {
        &self.pixels[(y - self.first) as usize * self.width as usize + x as usize]
    }

    /// The positions from `before` to `after` pixels around one, itself included, as far as they are in the band.
    pub(super) fn around(&self, x: u32, y: u32, before: u32, after: u32) -> impl Iterator<Item = (u32, u32)> + use<> {
        let columns = x.saturating_sub(before)..(x + after + 1).min(self.width);
        let rows = y.saturating_sub(before).max(self.first)..(y + after + 1).min(self.last);
        rows.flat_map(move |y| columns.clone().map(move |x| (x, y)))
    }
}

/// The background.
pub(super) struct Backdrop {
    color: Option<Vec3>,
    /// How much the corners are darker.
    falloff: f32,
    size: [u32; 2],
}

impl Backdrop {
    pub(super) fn new(options: &PreviewOptions) -> Self {
        let linear = |color: [u8; 3]| Some(Vec3::from_array(color.map(linear_from_srgb)));
        let (color, falloff) = match options.background {
            Background::Backdrop(color) => (linear(color), 0.16),
            Background::Plain(color) => (linear(color), 0.0),
            Background::Transparent => (None, 0.0),
        };
        Self { color, falloff, size: options.size }
    }

    /// The colour behind a pixel, or `None` when nothing is there.
    #[expect(clippy::cast_precision_loss, reason = "pixel positions are below 2^24")]
    fn at(&self, x: u32, y: u32) -> Option<Vec3> {
        let across = (x as f32 + 0.5) / self.size[0] as f32 - 0.5;
        let down = (y as f32 + 0.5) / self.size[1] as f32 - 0.46;
        let distance = (across * across + down * down) / 0.5;
        self.color.map(|color| color * (1.0 - self.falloff * distance))
    }
}

/// The bytes of one pixel.
pub(super) fn resolve(band: &Band<'_>, backdrop: &Backdrop, tolerance: f32, x: u32, y: u32) -> [u8; 4] {
    let pixel = band.at(x, y);
    let mut object = Visibility::default();
    let mut ground = Visibility::default();
    for (nx, ny) in band.around(x, y, BEFORE, AFTER) {
        let other = band.at(nx, ny);
        if pixel.ground.coverage > 0.0 {
            accumulate(&mut ground, &other.ground, 1.0);
        }
        if pixel.object.coverage > 0.0 && other.object.rays > 0.0 {
            // Next to nothing rather than nothing, for pixels that sent no rays and have no like.
            accumulate(&mut object, &other.object, same_surface(pixel, other, tolerance).max(1e-4));
        }
    }
    let (object_sky, object_key) = mean(&object);
    let (ground_sky, ground_key) = mean(&ground);
    let color = pixel.sky * object_sky + pixel.key * object_key;
    let covered = pixel.object.coverage;
    let shadow = pixel.ground.coverage * (GROUND_SKY * (1.0 - ground_sky) + GROUND_KEY * (1.0 - ground_key));

    let (color, alpha) = match backdrop.at(x, y) {
        Some(behind) => (color + behind * (1.0 - covered - shadow).max(0.0), 1.0),
        None => {
            let alpha = (covered + shadow).min(1.0);
            (if alpha > 0.0 { color / alpha } else { Vec3::ZERO }, alpha)
        }
    };
    let [r, g, b] = color.to_array().map(srgb_from_linear);
    [r, g, b, byte(alpha)]
}

fn accumulate(sum: &mut Visibility, other: &Visibility, weight: f32) {
    sum.rays += weight * other.rays;
    sum.sky += weight * other.sky;
    sum.key += weight * other.key;
}

fn mean(sum: &Visibility) -> (f32, f32) {
    if sum.rays > 0.0 { (sum.sky / sum.rays, sum.key / sum.rays) } else { (1.0, 1.0) }
}

/// 1 where two pixels lie on one smooth surface, towards 0 where they do not.
fn same_surface(a: &Pixel, b: &Pixel, tolerance: f32) -> f32 {
    let facing = a.normal.dot(b.normal).max(0.0);
    let apart = (b.position - a.position).dot(a.normal).abs() / tolerance;
    facing.powi(8) * (1.0 - apart).max(0.0)
}
