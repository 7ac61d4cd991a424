//! What is rendered, and how.

use trixel::fill::Fill;

use super::camera::Orbit;
use super::environment::Environment;
use super::error::LightError;
use super::scene::range;

/// An effect of \[CL\], section 3.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// Light bent by the object's surfaces (section 3.2).
    Refraction(Surfaces),
    /// The same, with what the media absorb on the way (section 3.3, equation 5).
    Transmittance(Surfaces),
    /// An opaque object lit by the sun through itself, with a shadow as dark as what the light went through (section 3.1).
    TransparentShadow,
}

/// The surfaces that bend a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Surfaces {
    /// None: rays stay straight.
    None,
    /// Where a ray enters and where it leaves the object (section 3.2.1).
    Two(Thickness),
    /// All, with total internal reflection (section 3.2.2).
    Many,
}

/// Along which direction the way between two surfaces is measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Thickness {
    /// Along the bent ray, where it will go; exact for convex objects.
    #[default]
    Refracted,
    /// Along the ray as it came, as figure 5 has it. Only voxels know what is near the estimated point, so the reference
    /// measures along the bent ray.
    Incident,
}

/// Where the sun of [`Effect::TransparentShadow`] stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    /// Degrees round the object, as for [`Orbit::azimuth`].
    pub azimuth: f64,
    /// Degrees above the horizon, 5 to 90.
    pub elevation: f64,
    /// Light from everywhere, as a share of the sun's, 0 to 1.
    pub ambient: f64,
}

impl Default for Sun {
    fn default() -> Self {
        Self { azimuth: -60.0, elevation: 48.0, ambient: 0.22 }
    }
}

/// How a picture of light is taken. Start from the default and change what matters.
///
/// ```
/// use trixel_render::light::LightOptions;
/// let options = LightOptions { size: [320, 240], ..LightOptions::default() };
/// assert_eq!(options.resolution, 128);
/// ```
#[derive(Clone, Debug)]
pub struct LightOptions {
    /// Width and height in pixels, each 1 to 8192.
    pub size: [u32; 2],
    /// Rays a pixel, 1 to 256.
    pub samples: u32,
    /// Voxels along the object's longest side, 8 to 1024. The reference has none.
    pub resolution: u32,
    /// The camera.
    pub orbit: Orbit,
    /// What is round the object.
    pub environment: Environment,
    /// The sun, for shadows.
    pub sun: Sun,
    /// Whether the outermost surface mirrors the environment by Fresnel's equations. \[CL\] leaves that out.
    pub fresnel: bool,
    /// Surfaces after which a ray is followed no further, 1 to 64.
    pub max_surfaces: u32,
    /// Degrees between the normals of two surfaces below which the second, where it is within two voxels of the first, is
    /// taken for the first one hit again, 0 to 90 (section 3.2.2).
    pub double_hit_angle: f64,
    /// How often normals are filtered with their neighbours, 0 to 4.
    pub normal_filter: u32,
    /// How insides are found; `None` for exact parity where a material's surface is closed, and [`Fill::Xor`], which repairs
    /// holes (\[CL\] 2.3), where it is not. The reference has none.
    pub fill: Option<Fill>,
    /// Thickness of materials that consist of sheets, such as leaves, in longest sides of the object, 0 to 1.
    pub sheet_thickness: f64,
}

impl Default for LightOptions {
    fn default() -> Self {
        Self {
            size: [800, 600],
            samples: 4,
            resolution: 128,
            orbit: Orbit::default(),
            environment: Environment::default(),
            sun: Sun::default(),
            fresnel: true,
            max_surfaces: 12,
            double_hit_angle: 30.0,
            normal_filter: 2,
            fill: None,
            sheet_thickness: 0.01,
        }
    }
}

impl LightOptions {
    /// Checks every range.
    ///
    /// # Errors
    /// Names the first option that is out of range.
    pub fn check(&self) -> Result<(), LightError> {
        for (option, value, min, max) in [
            ("width", f64::from(self.size[0]), 1.0, 8192.0),
            ("height", f64::from(self.size[1]), 1.0, 8192.0),
            ("samples", f64::from(self.samples), 1.0, 256.0),
            ("resolution", f64::from(self.resolution), 8.0, 1024.0),
            ("azimuth", self.orbit.azimuth, -360.0, 360.0),
            ("elevation", self.orbit.elevation, -90.0, 90.0),
            ("field of view", self.orbit.field_of_view, 1.0, 120.0),
            ("distance", self.orbit.distance.unwrap_or(1.0), 0.01, 10_000.0),
            ("sun's azimuth", self.sun.azimuth, -360.0, 360.0),
            ("sun's elevation", self.sun.elevation, 5.0, 90.0),
            ("ambient light", self.sun.ambient, 0.0, 1.0),
            ("most surfaces", f64::from(self.max_surfaces), 1.0, 64.0),
            ("double-hit angle", self.double_hit_angle, 0.0, 90.0),
            ("normal filter", f64::from(self.normal_filter), 0.0, 4.0),
            ("sheet thickness", self.sheet_thickness, 0.0, 1.0),
        ] {
            range(option, value, min, max)?;
        }
        Ok(())
    }
}
