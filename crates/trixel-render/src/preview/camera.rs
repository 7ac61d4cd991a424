//! The camera: a three-quarter view fitted to what is there.
//!
//! Lengths are in the picture's own unit, the longest edge of a voxel, measured from the grid's origin.

use glam::DVec3;
use trixel::UpAxis;

/// Directions that an up axis gives a name to; right-handed (`right x back = up`), so nothing is ever mirrored.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    /// To the right of somebody who looks at the object's front.
    pub right: DVec3,
    /// Away from them.
    pub back: DVec3,
    /// Up.
    pub up: DVec3,
}

impl Frame {
    /// The front is where modelling tools put it: -y when z is up, +z when x or y is.
    pub(super) fn new(up: UpAxis) -> Self {
        match up {
            UpAxis::X => Self { right: DVec3::NEG_Y, back: DVec3::NEG_Z, up: DVec3::X },
            UpAxis::Y => Self { right: DVec3::X, back: DVec3::NEG_Z, up: DVec3::Y },
            UpAxis::Z => Self { right: DVec3::X, back: DVec3::Y, up: DVec3::Z },
        }
    }

    /// The frame of somebody who walked round the object by `azimuth` degrees, to their right.
    pub(super) fn turned(self, azimuth: f64) -> Self {
        let (sin, cos) = azimuth.to_radians().sin_cos();
        Self { right: cos * self.right + sin * self.back, back: cos * self.back - sin * self.right, up: self.up }
    }
}

/// Where a view looks from.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    /// The frame turned towards the camera.
    pub frame: Frame,
    /// Degrees above the horizon.
    pub elevation: f64,
    /// Degrees across the picture's shorter side; 0 for an orthographic picture.
    pub field_of_view: f64,
    /// Width and height in pixels.
    pub size: [u32; 2],
}

/// A placed camera.
#[derive(Clone, Copy, Debug)]
pub(super) struct Camera {
    origin: DVec3,
    forward: DVec3,
    /// Half the picture's width and height: at distance 1 in perspective, anywhere in an orthographic picture.
    half_right: DVec3,
    half_up: DVec3,
    size: [u32; 2],
    orthographic: bool,
    /// The edge of a pixel: at distance 1 in perspective, anywhere in an orthographic picture.
    pixel: f64,
}

impl Camera {
    /// A camera from which all `points` are within the picture, with `margin` (a share of its half size) left on the
    /// tightest sides and the rest centred.
    pub(super) fn fit(view: View, points: &[DVec3], margin: f64) -> Self {
        let (sin, cos) = view.elevation.to_radians().sin_cos();
        let towards = -cos * view.frame.back + sin * view.frame.up;
        let (forward, right) = (-towards, view.frame.right);
        let up = cos * view.frame.up + sin * view.frame.back;
        let [width, height] = view.size.map(f64::from);
        let shorter = width.min(height);
        let aspect = [width / shorter, height / shorter];
        let tangent = (view.field_of_view.to_radians() / 2.0).tan();
        let room = 1.0 - margin;

        // For each side of the picture, the tightest position of a plane through it; depth tilts the plane.
        let mut tight = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        let mut depths = [f64::INFINITY, f64::NEG_INFINITY];
        for point in points {
            let depth = point.dot(forward);
            depths = [depths[0].min(depth), depths[1].max(depth)];
            for (side, (axis, aspect)) in tight.iter_mut().zip([right, up].into_iter().zip(aspect)) {
                let tilt = depth * tangent * aspect * room;
                side[0] = side[0].min(point.dot(axis) + tilt);
                side[1] = side[1].max(point.dot(axis) - tilt);
            }
        }
        let middle = tight.map(|[low, high]| (low + high) / 2.0);
        let half = |i: usize| (tight[i][1] - tight[i][0]) / 2.0 / (aspect[i] * room);
        let wanted = half(0).max(half(1));
        let sideways = middle[0] * right + middle[1] * up;
        if tangent > 0.0 {
            // The camera stays clear of the nearest point even where the fit would let it touch.
            let depth = (-wanted / tangent).min(depths[0] - 1.0);
            let (half_right, half_up) = (right * tangent * aspect[0], up * tangent * aspect[1]);
            let pixel = 2.0 * tangent / shorter;
            let origin = sideways + depth * forward;
            Self { origin, forward, half_right, half_up, size: view.size, orthographic: false, pixel }
        } else {
            let wanted = wanted.max(f64::MIN_POSITIVE);
            let (half_right, half_up) = (right * wanted * aspect[0], up * wanted * aspect[1]);
            let pixel = 2.0 * wanted / shorter;
            let origin = sideways + (depths[0] - 1.0 - (depths[1] - depths[0])) * forward;
            Self { origin, forward, half_right, half_up, size: view.size, orthographic: true, pixel }
        }
    }

    /// Origin and unit direction of the ray through (`x`, `y`), in pixels from the picture's top left corner.
    pub(super) fn ray(&self, x: f64, y: f64) -> (DVec3, DVec3) {
        let [width, height] = self.size.map(f64::from);
        let across = (2.0 * x / width - 1.0) * self.half_right + (1.0 - 2.0 * y / height) * self.half_up;
        if self.orthographic {
            (self.origin + across, self.forward)
        } else {
            (self.origin, (self.forward + across).normalize())
        }
    }

    /// The edge of a pixel as seen at distance `t` along a ray.
    pub(super) fn pixel_at(&self, t: f64) -> f64 {
        if self.orthographic { self.pixel } else { self.pixel * t }
    }

    /// Where the camera is; for an orthographic one, a point on its central ray.
    pub(super) fn origin(&self) -> DVec3 {
        self.origin
    }

    /// The direction of the central ray.
    pub(super) fn forward(&self) -> DVec3 {
        self.forward
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UPS: [UpAxis; 3] = [UpAxis::X, UpAxis::Y, UpAxis::Z];

    #[test]
    fn frames_are_right_handed() {
        for up in UPS {
            for azimuth in [0.0, 30.0, 200.0] {
                let f = Frame::new(up).turned(azimuth);
                assert!((f.right.cross(f.back) - f.up).length() < 1e-12, "{f:?}");
            }
        }
        // Walking round to the right by 90 degrees shows the right side: what was right now comes towards the viewer.
        let turned = Frame::new(UpAxis::Z).turned(90.0);
        assert!((turned.back - DVec3::NEG_X).length() < 1e-12, "{turned:?}");
    }

    #[test]
    fn a_fitted_camera_sees_all_points_and_touches_the_margin() {
        let points: Vec<DVec3> = (0..8_u8)
            .map(|i| DVec3::new(f64::from(i & 1) * 7.0, f64::from(i >> 1 & 1) * 30.0 + 100.0, f64::from(i >> 2) * 2.0))
            .collect();
        for up in UPS {
            for field_of_view in [0.0, 20.0, 70.0] {
                for size in [[640, 480], [10, 900], [3000, 2]] {
                    let frame = Frame::new(up).turned(33.0);
                    let view = View { frame, elevation: 25.0, field_of_view, size };
                    let camera = Camera::fit(view, &points, 0.1);
                    let mut most: f64 = 0.0;
                    for &point in &points {
                        let [x, y] = project(&camera, point);
                        most = most.max(x.abs()).max(y.abs());
                    }
                    assert!((most - 0.9).abs() < 1e-6, "{most} at {up:?} {field_of_view} {size:?}");
                }
            }
        }
    }

    /// Where a point lands in the picture, both axes from -1 to 1.
    fn project(camera: &Camera, point: DVec3) -> [f64; 2] {
        let offset = point - camera.origin;
        let depth = if camera.orthographic { 1.0 } else { offset.dot(camera.forward) };
        [camera.half_right, camera.half_up].map(|h| offset.dot(h) / h.length_squared() / depth)
    }
}
