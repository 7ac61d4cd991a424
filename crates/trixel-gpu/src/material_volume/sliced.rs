//! A material volume in one go: \[CL\] section 2.
//!
//! The paper renders into slices of a 3D texture, where the last fragment of a voxel wins, and which that is depends on the
//! device. WebGPU has no atomic textures, and orders neither fragments nor texture writes. So fragments claim their voxel in
//! a buffer, by an atomic maximum that the lowest triangle number wins, and a compute pass then writes every texel once.

use trixel::fill::Fill;
use trixel::lattice::LatticeMesh;
use trixel::{Frame, Job, Mesh, Mode, Strategy};

use super::MaterialVolume;
use super::encoding::Precision;
use super::faces::{Face, faces};
use super::medium::Media;
use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::kernel::{Bound, Dispatcher, Kernel};
use crate::mesh::GpuMesh;
use crate::shader::Sink;
use crate::volume::GpuVolume;
use crate::voxelizer::{Options, Voxelizer};

/// How [`MaterialVolume::sliced`] voxelizes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slicing {
    /// [`Strategy::Sliced`] or [`Strategy::SlicePerPass`].
    pub strategy: Strategy,
    /// By how many voxels each slice is extended on both sides, against missing voxels (\[CL\] 3.2.2).
    pub overlap: f64,
    /// How the inside is found, if it is wanted.
    pub fill: Option<Fill>,
}

impl Default for Slicing {
    fn default() -> Self {
        Self { strategy: Strategy::Sliced, overlap: 0.0, fill: None }
    }
}

impl MaterialVolume {
    /// Slices a mesh of the world along the z of any frame, and writes what it is made of.
    ///
    /// The voxels that exist are those of [`Mode::Sliced`] of [`Frame::mesh`]'s mesh, exactly. Of the triangles in a voxel the
    /// first of that mesh counts: its normal, vertex colour and base colour, interpolated in the world to where it crosses
    /// the line along z through the voxel's centre, and its medium. Textures are not sampled; use
    /// [`MaterialVolume::from_attributes`] where they matter. Voxels inside have the medium of the next surface before them
    /// along z.
    ///
    /// # Errors
    /// When the mesh is broken, the strategy is none of slices, the overlap is out of range, something does not fit the
    /// device, or memory runs out.
    pub fn sliced(
        gpu: &Gpu,
        frame: Frame,
        precision: Precision,
        mesh: &Mesh,
        media: &Media,
        slicing: &Slicing,
    ) -> Result<Self, GpuError> {
        let grid = frame.grid();
        let volume = Self::new(gpu, frame, precision, media)?;
        let framed = volume.frame.mesh(mesh).map_err(trixel::Error::from)?;
        let lattice = LatticeMesh::snap(&framed.mesh, &grid).map_err(trixel::Error::from)?;
        let on_gpu = GpuMesh::upload(gpu, &lattice)?;
        if on_gpu.cpu_triangles() > 0 {
            return Err(GpuError::TrianglesTooLarge(on_gpu.cpu_triangles() as u64));
        }
        let job = Job::new(grid, Mode::Sliced).with_strategy(slicing.strategy);
        let job = job.with_overlap(slicing.overlap).map_err(trixel::Error::from)?;
        if slicing.strategy.modes() != [Mode::Sliced] {
            return Err(GpuError::NoClaims(slicing.strategy));
        }
        let inside = slicing.fill.map(|fill| inside(gpu, &on_gpu, &job, fill)).transpose()?;

        let faces = faces(&framed, media);
        let bytes = faces.len().max(1) * size_of::<Face>();
        // Said in the words of what does not fit, before it is uploaded.
        gpu.check_storage("the triangles' corners", bytes as u64)?;
        let mut contents = bytemuck::cast_slice(&faces).to_vec();
        contents.resize(bytes, 0);
        let faces = gpu.buffer_with("trixel faces", &contents, wgpu::BufferUsages::STORAGE)?;
        let media: Vec<[f32; 2]> = media.iter().map(|medium| [medium.absorption, medium.refraction_index]).collect();
        let media_buffer =
            gpu.buffer_with("trixel media", bytemuck::cast_slice(&media), wgpu::BufferUsages::STORAGE)?;
        let other = u32::try_from(media.len() - 1).unwrap_or(u32::MAX);

        let resolving = Resolving { volume: &volume, faces, media: media_buffer, other, inside };
        let mut voxelizer = Voxelizer::new(gpu, &job, &Options::default())?;
        for part in GpuVolume::parts(gpu, grid, size_of::<u32>() as u64)? {
            let part = part?;
            let claims = part.claims(gpu)?;
            voxelizer.run_appending(&on_gpu, &part, (Sink::Claims, &claims))?;
            resolving.run(gpu, &part, &claims)?;
        }
        Ok(volume)
    }
}

/// The bits of a solid's inside.
fn inside(gpu: &Gpu, mesh: &GpuMesh, slices: &Job, fill: Fill) -> Result<GpuVolume, GpuError> {
    let volume = GpuVolume::new(gpu, *slices.grid())?;
    if fill == Fill::Parity {
        let job = Job::new(*slices.grid(), Mode::Solid);
        Voxelizer::new(gpu, &job, &Options::default())?.run(mesh, &volume)?;
        return Ok(volume);
    }
    Voxelizer::new(gpu, slices, &Options::default())?.run(mesh, &volume)?;
    Ok(volume.filled(gpu, fill)?.0)
}

/// What claims are resolved with.
struct Resolving<'a> {
    volume: &'a MaterialVolume,
    faces: wgpu::Buffer,
    media: wgpu::Buffer,
    other: u32,
    inside: Option<GpuVolume>,
}

impl Resolving<'_> {
    fn run(&self, gpu: &Gpu, part: &GpuVolume, claims: &wgpu::Buffer) -> Result<(), GpuError> {
        let [_, ny, nz] = part.grid().dims();
        let views = self.volume.textures().map(|texture| texture.create_view(&wgpu::TextureViewDescriptor::default()));
        let inside = match &self.inside {
            None => &self.media,
            Some(inside) => inside.whole(gpu, "the voxels inside")?.buffer(),
        };
        let decoding = self.volume.decoding();
        let mut dispatcher = Dispatcher::new(gpu);
        for slab in part.slabs() {
            let words = [
                slab.nx(),
                ny,
                nz,
                slab.x(),
                part.column_words,
                self.other,
                decoding.normal_scale.to_bits(),
                decoding.normal_offset.to_bits(),
                decoding.absorption_scale.to_bits(),
                decoding.index_scale.to_bits(),
            ];
            let [surface, color, medium] = &views;
            let bound = [
                (0, Bound::Words(&words)),
                (1, Bound::Buffer(claims)),
                (2, Bound::Buffer(&self.faces)),
                (3, Bound::Buffer(&self.media)),
                (4, Bound::Buffer(inside)),
                (5, Bound::Texture(surface)),
                (6, Bound::Texture(color)),
                (7, Bound::Texture(medium)),
            ];
            let kernel = Kernel::ResolveClaims { precision: self.volume.precision(), filled: self.inside.is_some() };
            dispatcher.dispatch(kernel, &bound, slab.nx() * ny)?;
        }
        dispatcher.submit()
    }
}
