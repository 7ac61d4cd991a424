//! Voxelizes on a device that the program made itself, and reads the voxels in its own compute shader: nothing is copied
//! between CPU and GPU but the mesh on its way in and one number on its way out.
//!
//! ```sh
//! cargo run --release -p trixel-gpu --example own_device
//! ```

#![expect(clippy::print_stdout, reason = "an example")]

use trixel::lattice::LatticeMesh;
use trixel::{Grid, Job, Mode};
use trixel_gpu::{Gpu, GpuMesh, GpuVolume, Options, Voxelizer, wgpu};

/// Counts the set voxels; a real program would shade, simulate or learn from them.
const COUNT: &str = "
@group(0) @binding(0) var<storage, read> voxels: array<u32>;
@group(0) @binding(1) var<storage, read_write> total: atomic<u32>;

@compute @workgroup_size(64)
fn count(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    for (var i = id.x; i < arrayLength(&voxels); i += 64u * groups.x) {
        atomicAdd(&total, countOneBits(voxels[i]));
    }
}
";

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // The program's own device.
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))?;
    let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor::default()))?;

    let mesh = trixel::scene::build("torus")?;
    let grid = Grid::fit(&mesh.bounds().ok_or("the mesh is empty")?, 128)?;
    let gpu = Gpu::from_device(device.clone(), queue.clone());
    let on_gpu = GpuMesh::upload(&gpu, &LatticeMesh::snap(&mesh, &grid)?)?;
    let voxels = GpuVolume::new(&gpu, grid)?;
    let mut voxelizer = Voxelizer::new(&gpu, &Job::new(grid, Mode::Conservative), &Options::default())?;

    // The program's own shader, after the voxelization in the same command buffer.
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(COUNT.into()),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: None,
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });
    let buffer = |usage| {
        device.create_buffer(&wgpu::BufferDescriptor { label: None, size: 4, usage, mapped_at_creation: false })
    };
    let total = buffer(wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC);
    let answer = buffer(wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST);

    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    voxelizer.record(&mut encoder, &on_gpu, &voxels)?;
    for slab in voxels.slabs() {
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: slab.buffer().as_entire_binding() },
                wgpu::BindGroupEntry { binding: 1, resource: total.as_entire_binding() },
            ],
        });
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(256, 1, 1);
    }
    encoder.copy_buffer_to_buffer(&total, 0, &answer, 0, 4);
    queue.submit([encoder.finish()]);

    // Whether the result is whole, and then the answer.
    voxelizer.check()?;
    answer.map_async(wgpu::MapMode::Read, .., |_| {});
    device.poll(wgpu::PollType::wait_indefinitely())?;
    let view = answer.get_mapped_range(..)?;
    let found = u32::from_le_bytes([view[0], view[1], view[2], view[3]]);

    let expected = trixel::voxelize(&mesh, &Job::new(grid, Mode::Conservative))?.count();
    println!("{}: {found} voxels; the CPU says {expected}", gpu.info());
    if u64::from(found) == expected { Ok(()) } else { Err("they differ".into()) }
}
