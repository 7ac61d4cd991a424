//! What every shader of light knows, and how its resources are bound.

use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use trixel_gpu::{Gpu, GpuError, wgpu};

use super::super::camera::{Camera, jitter};
use super::super::environment::{Background, Environment, Floor};
use super::super::options::LightOptions;
use super::super::scene::OpticalScene;
use super::super::shadow::LightFrame;
use super::textures::{self, Texels};

/// `View` of `view.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(super) struct View {
    camera: [f32; 3],
    pixel: f32,
    right: [f32; 3],
    floor_height: f32,
    up: [f32; 3],
    double_hit: f32,
    forward: [f32; 3],
    ambient: f32,
    corner: [f32; 3],
    voxel: f32,
    across: [f32; 3],
    width: f32,
    across_too: [f32; 3],
    height: f32,
    to_sun: [f32; 3],
    unused: f32,
    plain: [f32; 3],
    unused_too: f32,
    jitter: [f32; 2],
    unused_at_last: [f32; 2],
    media: [[f32; 4]; 5],
}

impl View {
    /// The view of a scene, whose voxels begin at `corner` and have edges of length `voxel`.
    pub(super) fn new(scene: &OpticalScene, options: &LightOptions, corner: DVec3, voxel: f64) -> Self {
        let camera: Camera = options.orbit.camera(scene.half(), options.size);
        let frame = LightFrame::new(&options.sun);
        let vector = |v: DVec3| v.as_vec3().to_array();
        #[expect(clippy::cast_possible_truncation, reason = "precise enough for pictures")]
        let number = |x: f64| x as f32;
        let mut media = [[0.0, 0.0, 0.0, 1.0]; 5];
        for (medium, class) in media.iter_mut().zip(&scene.classes) {
            let [r, g, b] = class.absorption.map(number);
            *medium = [r, g, b, number(class.refraction_index)];
        }
        let [width, height] = options.size.map(|n| number(f64::from(n)));
        Self {
            camera: vector(camera.origin),
            pixel: number(camera.pixel),
            right: vector(camera.right),
            floor_height: number(scene.floor()),
            up: vector(camera.up),
            double_hit: number(options.double_hit_angle.to_radians().cos()),
            forward: vector(camera.forward),
            ambient: number(options.sun.ambient),
            corner: vector(corner),
            voxel: number(voxel),
            across: vector(frame.across[0]),
            width,
            across_too: vector(frame.across[1]),
            height,
            to_sun: vector(frame.to_sun),
            plain: match options.environment.background {
                Background::Plain(color) => color,
                Background::Sky | Background::Panorama(_) => [0.0; 3],
            },
            media,
            ..Self::default()
        }
    }

    /// The same for another sample of each pixel.
    pub(super) fn with_sample(mut self, sample: u32) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "0 to 1")]
        let place = jitter(sample).map(|c| c as f32);
        self.jitter = place;
        self
    }
}

/// The constants of `environment.wgsl`.
pub(super) fn constants(environment: &Environment) -> Vec<(&'static str, f64)> {
    let background = match environment.background {
        Background::Sky => 0.0,
        Background::Plain(_) => 1.0,
        Background::Panorama(_) => 2.0,
    };
    let floor = match environment.floor {
        Floor::None => 0.0,
        Floor::Checker => 1.0,
        Floor::Plain => 2.0,
    };
    vec![("BACKGROUND", background), ("FLOOR", floor)]
}

/// Group 0 of the shaders that see the environment.
pub(super) struct Surroundings {
    pub(super) layout: wgpu::BindGroupLayout,
    group: wgpu::BindGroup,
    view: wgpu::Buffer,
}

impl Surroundings {
    pub(super) fn new(gpu: &Gpu, environment: &Environment) -> Result<Self, GpuError> {
        let layout = layout(gpu, &[Slot::Uniform, Slot::Picture, Slot::Sampler]);
        let view = gpu.buffer(
            "trixel view",
            size_of::<View>() as u64,
            wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        )?;
        let panorama = match &environment.background {
            Background::Panorama(panorama) => textures::panorama(gpu, panorama)?,
            Background::Sky | Background::Plain(_) => textures::upload(gpu, &Texels::dark())?,
        };
        let group = bind(
            gpu,
            &layout,
            &[
                view.as_entire_binding(),
                wgpu::BindingResource::TextureView(&textures::whole(&panorama)),
                // Round the horizon it starts again.
                wgpu::BindingResource::Sampler(&textures::sampler(gpu, wgpu::AddressMode::Repeat)),
            ],
        );
        Ok(Self { layout, group, view })
    }

    pub(super) fn set(&self, gpu: &Gpu, view: &View) {
        gpu.queue().write_buffer(&self.view, 0, bytemuck::bytes_of(view));
    }

    pub(super) fn group(&self) -> &wgpu::BindGroup {
        &self.group
    }
}

/// A kind of binding.
#[derive(Clone, Copy)]
pub(super) enum Slot {
    Uniform,
    /// A 2D texture that may be filtered.
    Picture,
    /// A 3D texture that may be filtered.
    Voxels,
    Sampler,
    /// A storage buffer to write.
    Sums,
    /// A 3D texture of `Rgba16Float` to write.
    NewVoxels,
}

/// A layout of bindings that count from 0.
pub(super) fn layout(gpu: &Gpu, slots: &[Slot]) -> wgpu::BindGroupLayout {
    use wgpu::{BindingType, BufferBindingType, ShaderStages, TextureSampleType, TextureViewDimension};
    let buffer = |ty| BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    let texture = |view_dimension| BindingType::Texture {
        sample_type: TextureSampleType::Float { filterable: true },
        view_dimension,
        multisampled: false,
    };
    let entry = |(binding, slot): (u32, &Slot)| {
        let (visibility, ty) = match slot {
            Slot::Uniform => (ShaderStages::all(), buffer(BufferBindingType::Uniform)),
            Slot::Picture => (ShaderStages::all(), texture(TextureViewDimension::D2)),
            Slot::Voxels => (ShaderStages::all(), texture(TextureViewDimension::D3)),
            Slot::Sampler => (ShaderStages::all(), BindingType::Sampler(wgpu::SamplerBindingType::Filtering)),
            Slot::Sums => (ShaderStages::COMPUTE, buffer(BufferBindingType::Storage { read_only: false })),
            Slot::NewVoxels => (
                ShaderStages::COMPUTE,
                BindingType::StorageTexture {
                    access: wgpu::StorageTextureAccess::WriteOnly,
                    format: wgpu::TextureFormat::Rgba16Float,
                    view_dimension: TextureViewDimension::D3,
                },
            ),
        };
        wgpu::BindGroupLayoutEntry { binding, visibility, ty, count: None }
    };
    let entries: Vec<_> = (0u32..).zip(slots).map(entry).collect();
    gpu.device()
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("trixel light"), entries: &entries })
}

/// Resources in the order of their bindings.
pub(super) fn bind(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    resources: &[wgpu::BindingResource<'_>],
) -> wgpu::BindGroup {
    let entries: Vec<_> = (0u32..)
        .zip(resources)
        .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource: resource.clone() })
        .collect();
    gpu.device().create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("trixel light"),
        layout,
        entries: &entries,
    })
}

/// A compute pipeline. Errors go to the device's error scopes.
pub(super) fn compute(
    gpu: &Gpu,
    entry_point: &str,
    source: &str,
    groups: &[&wgpu::BindGroupLayout],
    constants: &[(&str, f64)],
) -> wgpu::ComputePipeline {
    let module = module(gpu, source);
    gpu.device().create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(entry_point),
        layout: Some(&pipeline_layout(gpu, groups)),
        module: &module,
        entry_point: Some(entry_point),
        compilation_options: wgpu::PipelineCompilationOptions { constants, ..Default::default() },
        cache: None,
    })
}

pub(super) fn module(gpu: &Gpu, source: &str) -> wgpu::ShaderModule {
    gpu.device().create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("trixel light"),
        source: wgpu::ShaderSource::Wgsl(source.into()),
    })
}

pub(super) fn pipeline_layout(gpu: &Gpu, groups: &[&wgpu::BindGroupLayout]) -> wgpu::PipelineLayout {
    let groups: Vec<_> = groups.iter().map(|group| Some(*group)).collect();
    gpu.device().create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("trixel light"),
        bind_group_layouts: &groups,
        ..Default::default()
    })
}
