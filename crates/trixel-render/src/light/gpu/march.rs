//! Refraction and transmittance: [`OpticalVolume`] in textures, and `march.wgsl` on them.

use glam::DVec3;
use trixel_gpu::{Gpu, wgpu};

use super::super::error::LightError;
use super::super::options::{LightOptions, Surfaces, Thickness};
use super::super::scene::OpticalScene;
use super::super::volume::OpticalVolume;
use super::sums::Sums;
use super::textures;
use super::view::{Slot, Surroundings, View, bind, compute, constants, layout};

const SOURCE: &str = concat!(
    include_str!("../shaders/view.wgsl"),
    include_str!("../shaders/environment.wgsl"),
    include_str!("../shaders/march.wgsl")
);

/// What a marching shader writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Output {
    Light,
    ExitRays,
}

/// A marching shader, ready to run.
pub(super) struct March {
    surroundings: Surroundings,
    voxels: wgpu::BindGroupLayout,
    pipeline: wgpu::ComputePipeline,
    output: Output,
}

impl March {
    pub(super) fn new(
        gpu: &Gpu,
        surfaces: Surfaces,
        absorb: bool,
        output: Output,
        options: &LightOptions,
    ) -> Result<Self, LightError> {
        let surroundings = Surroundings::new(gpu, &options.environment)?;
        let number = |flag: bool| f64::from(u8::from(flag));
        let kind = match surfaces {
            Surfaces::None => 0.0,
            Surfaces::Two(_) => 1.0,
            Surfaces::Many => 2.0,
        };
        let mut constants = constants(&options.environment);
        constants.extend([
            ("SURFACES", kind),
            ("ABSORB", number(absorb)),
            ("FRESNEL", number(options.fresnel)),
            ("INCIDENT", number(surfaces == Surfaces::Two(Thickness::Incident))),
            ("MAX_SURFACES", f64::from(options.max_surfaces)),
            ("OUTPUT", number(output == Output::ExitRays)),
        ]);
        let (voxels, pipeline) = gpu.guarded(|| {
            let voxels = layout(gpu, &[Slot::Voxels, Slot::Voxels, Slot::Sampler, Slot::Sums]);
            let pipeline = compute(gpu, "march", SOURCE, &[&surroundings.layout, &voxels], &constants);
            (voxels, pipeline)
        })?;
        Ok(Self { surroundings, voxels, pipeline, output })
    }

    /// The sums over `samples` of each pixel.
    pub(super) fn run(
        &self,
        gpu: &Gpu,
        scene: &OpticalScene,
        volume: &OpticalVolume,
        options: &LightOptions,
    ) -> Result<Vec<[f32; 4]>, LightError> {
        let shares = bytemuck::cast_slice(&volume.shares);
        let shares = textures::voxels(gpu, volume.dims, wgpu::TextureFormat::Rgba8Unorm, shares)?;
        let surface = bytemuck::cast_slice(&volume.surface);
        let surface = textures::voxels(gpu, volume.dims, wgpu::TextureFormat::Rgba16Float, surface)?;
        let (values, samples) = match self.output {
            Output::Light => (1, options.samples),
            Output::ExitRays => (3, 1),
        };
        let sums = Sums::new(gpu, options.size, values)?;
        let group = bind(
            gpu,
            &self.voxels,
            &[
                wgpu::BindingResource::TextureView(&textures::whole(&shares)),
                wgpu::BindingResource::TextureView(&textures::whole(&surface)),
                wgpu::BindingResource::Sampler(&textures::sampler(gpu, wgpu::AddressMode::ClampToEdge)),
                sums.buffer().as_entire_binding(),
            ],
        );
        let view = View::new(scene, options, DVec3::from_array(volume.origin), volume.voxel);
        for sample in 0..samples {
            self.surroundings.set(gpu, &view.with_sample(sample));
            gpu.guarded(|| {
                let mut encoder = gpu.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
                pass.set_pipeline(&self.pipeline);
                pass.set_bind_group(0, self.surroundings.group(), &[]);
                pass.set_bind_group(1, &group, &[]);
                let [across, down] = options.size.map(|side| side.div_ceil(8));
                pass.dispatch_workgroups(across, down, 1);
                drop(pass);
                gpu.queue().submit([encoder.finish()]);
            })?;
        }
        sums.read(gpu)
    }
}
