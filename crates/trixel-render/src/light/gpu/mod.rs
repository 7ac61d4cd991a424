//! The effects on a GPU, without a window.

mod march;
mod shadow;
mod sums;
mod textures;
mod view;

use std::time::Instant;

use trixel_gpu::Gpu;

use super::camera::Orbit;
use super::error::LightError;
use super::options::{Effect, LightOptions, Surfaces};
use super::radiance::Radiance;
use super::reference::ExitRay;
use super::scene::OpticalScene;
use super::shadow::{LightFrame, ShadowVolume};
use super::volume::OpticalVolume;
use march::{March, Output};
use shadow::Shadow;

/// Renders scenes with one effect, on a GPU: the shaders are built once and used for every frame.
pub struct LightRenderer {
    gpu: Gpu,
    options: LightOptions,
    shaders: Shaders,
}

enum Shaders {
    March(Box<March>),
    Shadow(Box<Shadow>),
}

/// A picture, and how long its steps took in milliseconds.
#[derive(Clone, Debug)]
pub struct Lit {
    /// The picture.
    pub radiance: Radiance,
    /// Voxels of the surface and their normals; for shadows all voxels.
    pub voxelize_ms: f64,
    /// Voxels of the inside.
    pub fill_ms: f64,
    /// Uploading, marching or drawing, and reading the picture back.
    pub light_ms: f64,
}

impl LightRenderer {
    /// Builds the shaders of an effect.
    ///
    /// # Errors
    /// When an option is out of range, or the GPU refuses.
    pub fn new(gpu: &Gpu, effect: Effect, options: &LightOptions) -> Result<Self, LightError> {
        options.check()?;
        let march = |surfaces, absorb| March::new(gpu, surfaces, absorb, Output::Light, options).map(Box::new);
        let shaders = match effect {
            Effect::Refraction(surfaces) => Shaders::March(march(surfaces, false)?),
            Effect::Transmittance(surfaces) => Shaders::March(march(surfaces, true)?),
            Effect::TransparentShadow => Shaders::Shadow(Box::new(Shadow::new(gpu, options)?)),
        };
        Ok(Self { gpu: gpu.clone(), options: options.clone(), shaders })
    }

    /// Moves the camera.
    ///
    /// # Errors
    /// When it is out of range; then it stays where it was.
    pub fn set_orbit(&mut self, orbit: Orbit) -> Result<(), LightError> {
        let options = LightOptions { orbit, ..self.options.clone() };
        options.check()?;
        self.options = options;
        Ok(())
    }

    /// Voxelizes a scene and takes its picture.
    ///
    /// # Errors
    /// When the scene has too many media, memory runs out, or the GPU fails.
    pub fn render(&self, scene: &OpticalScene) -> Result<Lit, LightError> {
        let (gpu, options) = (&self.gpu, &self.options);
        let (sums, voxelize_ms, fill_ms, start) = match &self.shaders {
            Shaders::March(march) => {
                let volume = OpticalVolume::new(scene, options)?;
                let start = Instant::now();
                (march.run(gpu, scene, &volume, options)?, volume.voxelize_ms, volume.fill_ms, start)
            }
            Shaders::Shadow(shadow) => {
                let start = Instant::now();
                let volume = ShadowVolume::new(scene, &LightFrame::new(&options.sun), options)?;
                let voxelize_ms = start.elapsed().as_secs_f64() * 1e3;
                let start = Instant::now();
                (shadow.run(gpu, scene, &volume, options)?, voxelize_ms, 0.0, start)
            }
        };
        #[expect(clippy::cast_precision_loss, reason = "at most 256")]
        let share = 1.0 / options.samples as f32;
        let pixels = sums.iter().map(|[r, g, b, _]| [r * share, g * share, b * share]).collect();
        let light_ms = start.elapsed().as_secs_f64() * 1e3;
        Ok(Lit { radiance: Radiance { size: options.size, pixels }, voxelize_ms, fill_ms, light_ms })
    }
}

/// How the ray through the middle of each pixel leaves the voxels of a scene, rows from the top.
///
/// # Errors
/// When an option is out of range, the scene has too many media, memory runs out, or the GPU fails.
pub fn exit_rays(
    gpu: &Gpu,
    scene: &OpticalScene,
    surfaces: Surfaces,
    options: &LightOptions,
) -> Result<Vec<ExitRay>, LightError> {
    options.check()?;
    let march = March::new(gpu, surfaces, true, Output::ExitRays, options)?;
    let volume = OpticalVolume::new(scene, options)?;
    // The first sample lies in the middle of its pixel.
    let sums = march.run(gpu, scene, &volume, options)?;
    let vector = |[x, y, z, _]: [f32; 4]| [x, y, z].map(f64::from);
    let (rays, _) = sums.as_chunks::<3>();
    Ok(rays
        .iter()
        .map(|&[origin, direction, transmittance]| ExitRay {
            origin: vector(origin),
            direction: vector(direction),
            transmittance: vector(transmittance),
        })
        .collect())
}
