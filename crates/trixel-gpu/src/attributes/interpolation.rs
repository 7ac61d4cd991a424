//! \[HCV\] 3.5: the rasterizer's interpolation across a dilated triangle, against barycentrics that are computed.
//!
//! The barycentrics of the dilated corners lie outside the triangle; interpolated to a pixel's centre, they are those of the
//! triangle's own plane there.

use trixel::Mode;

use crate::adapter::AdapterChoice;
use crate::cutoff::Dilation;
use crate::gpu::Gpu;
use crate::shader::{Drawn, Raster, Sink, Variant, raster_source};

/// Pixels along a side: one row of the copy is 256 bytes times four.
const SIZE: u32 = 64;

const STAGES: &str = "
struct Weighted {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(linear) weights: vec2<f32>,
}

fn turn(u: vec2<f32>, v: vec2<f32>) -> f32 {
    return u.x * v.y - u.y * v.x;
}

@vertex
fn dilate_weights(@builtin(vertex_index) index: u32) -> Weighted {
    let t = triangle_of(shape_of(corners(0u)));
    let at = dilated(t, index % VERTICES);
    let p = at - vec2<f32>(t.w0.xy) / f32(STEPS);
    let u = vec2<f32>(vec2<i32>(t.ea.x, t.eb.x)) / f32(STEPS);
    let v = -vec2<f32>(vec2<i32>(t.ea.z, t.eb.z)) / f32(STEPS);
    var w: Weighted;
    w.weights = vec2<f32>(turn(p, v), turn(u, p)) / turn(u, v);
    let pixel = at + vec2<f32>(t.base.xy);
    w.position = vec4<f32>(2.0 * pixel.x / 64.0 - 1.0, 1.0 - 2.0 * pixel.y / 64.0, 0.5, 1.0);
    return w;
}

@fragment
fn show_weights(w: Weighted) -> @location(0) vec4<f32> {
    return vec4<f32>(w.weights, 0.0, 1.0);
}
";

/// Draws a triangle in voxels of the plane z = 3, and gives red, green and alpha of every pixel.
fn drawn(gpu: &Gpu, triangle: [[f32; 2]; 3], dilation: Dilation) -> Vec<[f32; 4]> {
    let variant = Variant { mode: Mode::Conservative, counting: false, sink: Sink::Bits };
    let raster = Raster { drawn: Drawn::All, dilation };
    let source = raster_source(raster, variant, gpu.info().tier) + STAGES;
    let device = gpu.device();
    let source = wgpu::ShaderSource::Wgsl(source.into());
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source });
    let format = wgpu::TextureFormat::Rgba32Float;
    let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: None,
        layout: None,
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("dilate_weights"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: None,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("show_weights"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[Some(format.into())],
        }),
        multiview_mask: None,
        cache: None,
    });
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::UNIFORM;
    // `Params` of `common.wgsl`: a grid of 64 x 64 x 8.
    let params = [SIZE, SIZE, 8, 2, 0, SIZE, 0, 1, 0, 1000, 0, 0, 0, 0, 64f32.to_bits(), 64f32.to_bits()];
    #[expect(clippy::cast_possible_truncation, reason = "within the grid")]
    let steps = |c: f32| (c * 65_536.0).round() as i32;
    let positions: Vec<i32> = triangle.iter().flat_map(|[x, y]| [steps(*x), steps(*y), 3 * 65_536 + 7]).collect();
    let buffers =
        [bytemuck::cast_slice(&params), bytemuck::cast_slice(&positions), bytemuck::cast_slice(&[0u32, 1, 2])]
            .map(|bytes: &[u8]| gpu.buffer_with("trixel test", bytes, usage).unwrap());
    let entries: Vec<_> = (0u32..)
        .zip(&buffers)
        .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
        .collect();
    let layout = pipeline.get_bind_group_layout(0);
    let group =
        device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout: &layout, entries: &entries });
    let size = wgpu::Extent3d { width: SIZE, height: SIZE, depth_or_array_layers: 1 };
    let target = device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let view = target.create_view(&wgpu::TextureViewDescriptor::default());
    let bytes = u64::from(SIZE * SIZE * 16);
    let usage = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ;
    let staging = gpu.buffer("trixel test", bytes, usage).unwrap();
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                    store: wgpu::StoreOp::Store,
                },
            })],
            ..Default::default()
        });
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.draw(0..dilation.vertices(), 0..1);
    }
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(SIZE * 16), rows_per_image: None };
    encoder.copy_texture_to_buffer(
        target.as_image_copy(),
        wgpu::TexelCopyBufferInfo { buffer: &staging, layout },
        size,
    );
    gpu.queue().submit([encoder.finish()]);
    gpu.read(&staging, bytes, bytemuck::pod_collect_to_vec::<u8, [f32; 4]>).unwrap()
}

#[test]
fn interpolated_barycentrics_are_the_computed_ones() {
    for driver in ["llvmpipe", "SwiftShader"] {
        let gpu = Gpu::open(&AdapterChoice::Named(driver.to_owned())).unwrap();
        for dilation in Dilation::ALL {
            // Turning left, so that the shader keeps the order of the corners.
            for triangle in [
                [[5.25, 7.5], [57.75, 11.125], [21.5, 50.0625]],
                [[30.5, 30.5], [36.0, 31.25], [31.0, 38.875]],
                [[2.0, 60.0], [4.5, 12.0], [9.75, 59.0]],
            ] {
                let [a, b, c] = triangle.map(|p| p.map(f64::from));
                let turn = |u: [f64; 2], v: [f64; 2]| u[0] * v[1] - u[1] * v[0];
                let sub = |p: [f64; 2], q: [f64; 2]| [p[0] - q[0], p[1] - q[1]];
                let (u, v) = (sub(b, a), sub(c, a));
                // A vertex is rounded to 1/16 pixel at worst, which moves a weight by that over the triangle's height; the
                // interpolation itself may lose as much again.
                let longest = [u, v, sub(c, b)].map(|e| e[0].hypot(e[1])).into_iter().fold(0.0, f64::max);
                let bound = 0.125 * longest / turn(u, v).abs();
                let mut pixels = 0;
                for (i, shown) in (0u32..).zip(drawn(&gpu, triangle, dilation)) {
                    if shown[3] == 0.0 {
                        continue;
                    }
                    pixels += 1;
                    let (x, y) = (i % SIZE, i / SIZE);
                    let p = sub([f64::from(x) + 0.5, f64::from(y) + 0.5], a);
                    let computed = [turn(p, v) / turn(u, v), turn(u, p) / turn(u, v)];
                    for k in 0..2 {
                        let off = (f64::from(shown[k]) - computed[k]).abs();
                        assert!(off <= bound, "{driver} {dilation:?} {triangle:?} ({x}, {y}): {off}, at most {bound}");
                    }
                }
                // All that the triangle itself covers and more.
                assert!(f64::from(pixels) > turn(u, v) / 2.0, "{driver} {dilation:?} {pixels}");
            }
        }
    }
}
