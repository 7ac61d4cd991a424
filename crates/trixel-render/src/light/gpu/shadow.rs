//! Transparent shadow: [`ShadowVolume`] in textures, its sums along the light, and the object rasterized.

use bytemuck::{Pod, Zeroable};
use trixel_gpu::{Gpu, wgpu};

use super::super::error::LightError;
use super::super::options::LightOptions;
use super::super::scene::OpticalScene;
use super::super::shadow::ShadowVolume;
use super::sums::Sums;
use super::textures;
use super::view::{Slot, Surroundings, View, bind, compute, constants, layout, module, pipeline_layout};

const SOURCE: &str = concat!(
    include_str!("../shaders/view.wgsl"),
    include_str!("../shaders/environment.wgsl"),
    include_str!("../shaders/shadow.wgsl")
);
/// Of what a sample is drawn in.
const COLOR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
/// Triangles of one vertex buffer.
const CHUNK: usize = 1 << 18;

/// `object_vertex`'s input.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Vertex {
    point: [f32; 3],
    normal: [f32; 3],
    /// Linear colour, and 1 for a sheet.
    color: [f32; 4],
}

/// The shaders of the transparent shadow, ready to run.
pub(super) struct Shadow {
    surroundings: Surroundings,
    depths: wgpu::BindGroupLayout,
    summing: wgpu::BindGroupLayout,
    adding: wgpu::BindGroupLayout,
    sum: wgpu::ComputePipeline,
    add: wgpu::ComputePipeline,
    far: wgpu::RenderPipeline,
    object: wgpu::RenderPipeline,
}

impl Shadow {
    pub(super) fn new(gpu: &Gpu, options: &LightOptions) -> Result<Self, LightError> {
        let surroundings = Surroundings::new(gpu, &options.environment)?;
        let constants = constants(&options.environment);
        Ok(gpu.guarded(|| {
            let depths = layout(gpu, &[Slot::Voxels, Slot::Sampler]);
            let summing = layout(gpu, &[Slot::Voxels, Slot::NewVoxels]);
            let adding = layout(gpu, &[Slot::Picture, Slot::Sums]);
            let sum = compute(gpu, "sum_slices", include_str!("../shaders/shadow_sum.wgsl"), &[&summing], &[]);
            let add = compute(gpu, "accumulate", include_str!("../shaders/accumulate.wgsl"), &[&adding], &[]);
            let groups = [&surroundings.layout, &depths];
            let far = raster(gpu, ["far_vertex", "far_fragment"], &groups, &[], &constants);
            let attributes = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32x4];
            let corners = wgpu::VertexBufferLayout {
                array_stride: size_of::<Vertex>() as u64,
                step_mode: wgpu::VertexStepMode::Vertex,
                attributes: &attributes,
            };
            let object = raster(gpu, ["object_vertex", "object_fragment"], &groups, &[Some(corners)], &constants);
            Self { surroundings, depths, summing, adding, sum, add, far, object }
        })?)
    }

    /// The sums over all samples of each pixel.
    pub(super) fn run(
        &self,
        gpu: &Gpu,
        scene: &OpticalScene,
        volume: &ShadowVolume,
        options: &LightOptions,
    ) -> Result<Vec<[f32; 4]>, LightError> {
        let most = gpu.device().limits().max_texture_dimension_2d;
        if options.size.iter().any(|&side| side > most) {
            let adapter = gpu.info().to_string();
            return Err(LightError::TextureTooLarge { adapter, most, what: "pixels", option: "--size" });
        }
        let optical_depth = self.sum_depths(gpu, volume)?;
        let sums = Sums::new(gpu, options.size, 1)?;
        let chunks = vertices(gpu, scene)?;
        let [color, depth] = gpu.guarded(|| {
            [(COLOR, wgpu::TextureUsages::TEXTURE_BINDING), (DEPTH, wgpu::TextureUsages::empty())]
                .map(|(format, usage)| target(gpu, options.size, format, usage))
        })?;
        let shadows = bind(
            gpu,
            &self.depths,
            &[
                wgpu::BindingResource::TextureView(&textures::whole(&optical_depth)),
                wgpu::BindingResource::Sampler(&textures::sampler(gpu, wgpu::AddressMode::ClampToEdge)),
            ],
        );
        let (color, depth) = (textures::whole(&color), textures::whole(&depth));
        let adding =
            bind(gpu, &self.adding, &[wgpu::BindingResource::TextureView(&color), sums.buffer().as_entire_binding()]);
        let view = View::new(scene, options, volume.origin, volume.voxel);
        for sample in 0..options.samples {
            self.surroundings.set(gpu, &view.with_sample(sample));
            gpu.guarded(|| {
                let mut encoder = gpu.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
                self.draw(&mut encoder, [&color, &depth], &shadows, &chunks);
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
                pass.set_pipeline(&self.add);
                pass.set_bind_group(0, &adding, &[]);
                let [across, down] = options.size.map(|side| side.div_ceil(8));
                pass.dispatch_workgroups(across, down, 1);
                drop(pass);
                gpu.queue().submit([encoder.finish()]);
            })?;
        }
        sums.read(gpu)
    }

    fn sum_depths(&self, gpu: &Gpu, volume: &ShadowVolume) -> Result<wgpu::Texture, LightError> {
        let depths = textures::voxels(gpu, volume.dims, COLOR, bytemuck::cast_slice(&volume.texels))?;
        Ok(gpu.guarded(|| {
            let sums = gpu.device().create_texture(&wgpu::TextureDescriptor {
                label: Some("trixel optical depth"),
                size: depths.size(),
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D3,
                format: COLOR,
                usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::STORAGE_BINDING,
                view_formats: &[],
            });
            let [from, to] = [&depths, &sums].map(textures::whole);
            let views = [&from, &to].map(wgpu::BindingResource::TextureView);
            let group = bind(gpu, &self.summing, &views);
            let mut encoder = gpu.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&self.sum);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(volume.dims[0].div_ceil(8), volume.dims[1].div_ceil(8), 1);
            drop(pass);
            gpu.queue().submit([encoder.finish()]);
            sums
        })?)
    }

    fn draw(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        [color, depth]: [&wgpu::TextureView; 2],
        shadows: &wgpu::BindGroup,
        chunks: &[(wgpu::Buffer, u32)],
    ) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("trixel shadow"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: color,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::BLACK), store: wgpu::StoreOp::Store },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: depth,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(1.0), store: wgpu::StoreOp::Discard }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.set_bind_group(0, self.surroundings.group(), &[]);
        pass.set_bind_group(1, shadows, &[]);
        pass.set_pipeline(&self.far);
        pass.draw(0..3, 0..1);
        pass.set_pipeline(&self.object);
        for (buffer, vertices) in chunks {
            pass.set_vertex_buffer(0, buffer.slice(..));
            pass.draw(0..*vertices, 0..1);
        }
    }
}

/// The corners of all triangles, cut into buffers that every device allows.
fn vertices(gpu: &Gpu, scene: &OpticalScene) -> Result<Vec<(wgpu::Buffer, u32)>, LightError> {
    let triangles: Vec<usize> = (0..scene.mesh.triangles.len()).collect();
    let corners = |&triangle: &usize| {
        let medium = usize::from(scene.medium_of[triangle]);
        let [r, g, b] = scene.media[medium].color;
        let color = [r, g, b, if scene.sheets[medium] { 1.0 } else { 0.0 }];
        let corner = move |i: usize| {
            #[expect(clippy::cast_possible_truncation, reason = "coordinates of at most 1/2")]
            let point = scene.mesh.positions[scene.mesh.triangles[triangle][i] as usize].map(|c| c as f32);
            Vertex { point, normal: scene.normals[triangle][i].as_vec3().to_array(), color }
        };
        [0, 1, 2].map(corner)
    };
    let chunk = |triangles: &[usize]| {
        let corners: Vec<Vertex> = triangles.iter().flat_map(corners).collect();
        let buffer = gpu.buffer_with("trixel corners", bytemuck::cast_slice(&corners), wgpu::BufferUsages::VERTEX)?;
        Ok((buffer, u32::try_from(corners.len()).unwrap_or(0)))
    };
    triangles.chunks(CHUNK).map(chunk).collect()
}

fn target(
    gpu: &Gpu,
    [width, height]: [u32; 2],
    format: wgpu::TextureFormat,
    usage: wgpu::TextureUsages,
) -> wgpu::Texture {
    gpu.device().create_texture(&wgpu::TextureDescriptor {
        label: Some("trixel sample"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: usage | wgpu::TextureUsages::RENDER_ATTACHMENT,
        view_formats: &[],
    })
}

fn raster(
    gpu: &Gpu,
    [vertex, fragment]: [&str; 2],
    groups: &[&wgpu::BindGroupLayout],
    buffers: &[Option<wgpu::VertexBufferLayout<'_>>],
    constants: &[(&str, f64)],
) -> wgpu::RenderPipeline {
    let module = module(gpu, SOURCE);
    let options = || wgpu::PipelineCompilationOptions { constants, ..Default::default() };
    gpu.device().create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(fragment),
        layout: Some(&pipeline_layout(gpu, groups)),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some(vertex),
            compilation_options: options(),
            buffers,
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Less),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some(fragment),
            compilation_options: options(),
            targets: &[Some(COLOR.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}
