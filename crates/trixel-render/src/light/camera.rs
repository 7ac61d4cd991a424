//! A camera on an orbit round the object. The world is a [`super::OpticalScene`]'s: z up, the object's longest side 1.

use glam::DVec3;

/// Where the camera is on its orbit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    /// Degrees that the camera walks round the object, from its front towards its right side, -360 to 360.
    pub azimuth: f64,
    /// Degrees above the horizon, -90 to 90.
    pub elevation: f64,
    /// Degrees across the picture's shorter side, 1 to 120.
    pub field_of_view: f64,
    /// From the object's centre, in longest sides of its box, 0.01 to 10,000; `None` for as near as shows all of it.
    pub distance: Option<f64>,
}

impl Default for Orbit {
    fn default() -> Self {
        Self { azimuth: 32.0, elevation: 22.0, field_of_view: 32.0, distance: None }
    }
}

/// A pinhole camera.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    pub(super) origin: DVec3,
    pub(super) right: DVec3,
    pub(super) up: DVec3,
    pub(super) forward: DVec3,
    /// Width of a pixel at distance 1.
    pub(super) pixel: f64,
    pub(super) size: [u32; 2],
}

impl Orbit {
    /// The camera, for a picture of so many pixels and an object whose box reaches `half` from its centre at the origin.
    #[must_use]
    pub fn camera(&self, half: [f64; 3], size: [u32; 2]) -> Camera {
        /// Space round an object that is just seen whole.
        const MARGIN: f64 = 1.08;
        let (sin_azimuth, cos_azimuth) = self.azimuth.to_radians().sin_cos();
        let (sin_elevation, cos_elevation) = self.elevation.to_radians().sin_cos();
        let out = DVec3::new(sin_azimuth * cos_elevation, -cos_azimuth * cos_elevation, sin_elevation);
        let right = DVec3::new(cos_azimuth, sin_azimuth, 0.0);
        let forward = -out;
        let up = right.cross(forward);
        let half_angle = (self.field_of_view / 2.0).to_radians();
        let shorter = f64::from(size[0].min(size[1]));
        // How far pictures reach to the side, and upwards, at distance 1.
        let reach = size.map(|side| half_angle.tan() * f64::from(side) / shorter / MARGIN);
        let fits = |corner: usize| {
            let signs = DVec3::from_array([0, 1, 2].map(|axis| if corner >> axis & 1 == 1 { 1.0 } else { -1.0 }));
            let corner = signs * DVec3::from_array(half);
            corner.dot(out) + (corner.dot(right).abs() / reach[0]).max(corner.dot(up).abs() / reach[1])
        };
        let distance = self.distance.unwrap_or_else(|| (0..8).map(fits).fold(0.0, f64::max));
        let pixel = 2.0 * half_angle.tan() / shorter;
        Camera { origin: out * distance, right, up, forward, pixel, size }
    }
}

impl Camera {
    /// Where the camera is.
    #[must_use]
    pub fn origin(&self) -> [f64; 3] {
        self.origin.to_array()
    }

    /// The unit direction of the ray through a point of the picture, in pixels from its top left corner.
    #[must_use]
    pub fn direction(&self, x: f64, y: f64) -> [f64; 3] {
        let [width, height] = self.size.map(f64::from);
        let across = (x - width / 2.0) * self.pixel;
        let upwards = (height / 2.0 - y) * self.pixel;
        (self.forward + across * self.right + upwards * self.up).normalize().to_array()
    }
}

/// Where in the pixel sample `index` lies: the first in the middle, the others spread evenly.
pub(super) fn jitter(index: u32) -> [f64; 2] {
    // Multiples of the plastic number's powers: M. Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences", 2018.
    [0.754_877_666_246_693, 0.569_840_290_998_053].map(|step| (f64::from(index) * step + 0.5).fract())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_camera_looks_at_the_object_with_up_upwards() {
        for azimuth in [-90.0, 0.0, 32.0, 200.0] {
            for elevation in [-80.0, 0.0, 22.0, 90.0] {
                let orbit = Orbit { azimuth, elevation, ..Orbit::default() };
                let camera = orbit.camera([0.5, 0.3, 0.2], [64, 48]);
                let center = DVec3::from_array(camera.direction(32.0, 24.0));
                assert!((camera.origin + center * camera.origin.length()).length() < 1e-9);
                assert!(camera.up.z > -1e-9 && (camera.right.cross(camera.forward) - camera.up).length() < 1e-9);
                // Up in the picture is up in the world, and right is right.
                assert!(DVec3::from_array(camera.direction(32.0, 0.0)).dot(camera.up) > 0.0);
                assert!(DVec3::from_array(camera.direction(64.0, 24.0)).dot(camera.right) > 0.0);
            }
        }
        let front = Orbit { azimuth: 0.0, elevation: 0.0, ..Orbit::default() }.camera([0.5; 3], [8, 8]);
        assert!(front.origin.y < 0.0 && front.right.x == 1.0);
    }

    #[test]
    fn samples_lie_in_the_pixel() {
        assert_eq!(jitter(0), [0.5, 0.5]);
        assert!((0..64).flat_map(jitter).all(|c| (0.0..1.0).contains(&c)));
    }
}
