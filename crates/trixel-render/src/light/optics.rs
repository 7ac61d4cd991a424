//! What light does at a surface and in a medium. `shaders/optics.wgsl` is the same for the GPU.

use glam::DVec3;

/// The direction behind a surface, by Snell's law; `None` where all light is reflected.
///
/// `direction` and `normal` have unit length, and the normal points against the direction. `ratio` is the refraction index
/// of the medium that the light leaves over that of the one it enters.
#[must_use]
pub fn refract(direction: DVec3, normal: DVec3, ratio: f64) -> Option<DVec3> {
    let cos = -direction.dot(normal);
    let rest = 1.0 - ratio * ratio * (1.0 - cos * cos);
    (rest >= 0.0).then(|| (ratio * direction + (ratio * cos - rest.sqrt()) * normal).normalize_or(direction))
}

/// The direction of a mirror's reflection.
#[must_use]
pub fn reflect(direction: DVec3, normal: DVec3) -> DVec3 {
    direction - 2.0 * direction.dot(normal) * normal
}

/// The share of unpolarized light that a surface between two media reflects, by Fresnel's equations. `cos` is that of the
/// angle to the normal in the first medium.
#[must_use]
pub fn reflectance(cos: f64, from: f64, to: f64) -> f64 {
    let sin2 = (from / to).powi(2) * (1.0 - cos * cos);
    if sin2 >= 1.0 {
        return 1.0;
    }
    let cos_behind = (1.0 - sin2).sqrt();
    let across = (from * cos - to * cos_behind) / (from * cos + to * cos_behind);
    let along = (to * cos - from * cos_behind) / (to * cos + from * cos_behind);
    f64::midpoint(across * across, along * along)
}

/// The share of light that is left after a way of `length` through a medium, by Beer and Lambert: \[CL\], equation 5.
#[must_use]
pub fn transmittance(absorption: [f64; 3], length: f64) -> DVec3 {
    DVec3::from_array(absorption.map(|a| (-a * length).exp()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn snells_law_holds_and_its_limit_reflects() {
        let normal = DVec3::Z;
        for degrees in [0.0_f64, 20.0, 41.0, 60.0, 89.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            for ratio in [1.0 / 1.5, 1.0, 1.5] {
                let behind = refract(DVec3::new(sin, 0.0, -cos), normal, ratio);
                match behind {
                    Some(d) => assert!((d.x - ratio * sin).abs() < 1e-12 && d.z < 0.0, "{degrees} {ratio}"),
                    None => assert!(ratio * sin > 1.0),
                }
            }
        }
    }

    #[test]
    fn glass_reflects_four_hundredths_head_on_and_everything_at_grazing_angles() {
        assert!((reflectance(1.0, 1.0, 1.5) - 0.04).abs() < 1e-12);
        assert!(reflectance(1e-6, 1.0, 1.5) > 0.9999);
        assert_eq!(reflectance(0.1, 1.5, 1.0), 1.0);
    }

    #[test]
    fn absorption_multiplies_over_lengths() {
        let a = [0.5, 1.0, 2.0];
        let twice = transmittance(a, 0.3) * transmittance(a, 0.7);
        assert!((twice - transmittance(a, 1.0)).abs().max_element() < 1e-12);
    }
}
