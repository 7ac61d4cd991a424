//! A mesh with all that its surface is like, in buffers.

use std::collections::HashMap;
use std::ops::Range;

use trixel::attributes::AttributeRequest;
use trixel::attributes::device::{DeviceLevel, DeviceSurface, NOTHING, light_tables};
use trixel::lattice::{LatticeMesh, LatticePositions};
use trixel::{Grid, Mesh};

use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::kernel::Bound;
use crate::mesh::GpuMesh;

/// Buffers that hold textures: what `surface.wgsl` binds.
const PAGES: usize = 3;
/// Texels along a side of an image whose products fit the shaders' arithmetic.
const MOST_TEXELS: u32 = 1 << 16;

/// A mesh and its surface on a [`Gpu`], as far as a request for attributes needs it.
///
/// Images that are not decoded count as missing, as on the CPU. Everything that the definition computes in f64 is computed
/// here, once a triangle or vertex; the shaders then work on integers.
#[derive(Debug)]
pub struct GpuSurface {
    pub(super) chunks: Vec<Chunk>,
    pub(super) request: AttributeRequest,
    pub(super) grid: Grid,
}

/// Triangles whose patches fit one binding.
#[derive(Debug)]
pub(super) struct Chunk {
    pub(super) mesh: GpuMesh,
    pub(super) triangles: Range<u32>,
    patches: wgpu::Buffer,
    tables: wgpu::Buffer,
    pages: [wgpu::Buffer; PAGES],
    /// The words of `Work` in `surface.wgsl` that are the chunk's own.
    layout: [u32; 13],
}

impl Chunk {
    fn new(
        gpu: &Gpu,
        (mesh, lattice, grid): (&Mesh, &LatticeMesh<'_>, &Grid),
        triangles: Range<u32>,
        request: &AttributeRequest,
    ) -> Result<Self, GpuError> {
        let surface = DeviceSurface::new(mesh, lattice, triangles.clone(), grid, request);
        let (pages, places) = pages(gpu, &surface.levels)?;
        let mut tables = surface.materials;
        let place = |words: &Vec<u32>| u32::try_from(words.len()).unwrap_or(u32::MAX);
        let levels_at = place(&tables);
        for (level, [page, at]) in surface.levels.iter().zip(places) {
            let ([width, height], [base_width, base_height]) = (level.size, level.base);
            tables.extend([page, at, width, height, base_width, base_height, level.flags, 0]);
        }
        let [linear, srgb] = light_tables();
        let linear_at = place(&tables);
        tables.extend(linear);
        let srgb_at = place(&tables);
        tables.extend(srgb);
        let of = surface.layout;
        let [color, opacity, emission, metallic] = of.placements;
        let count = triangles.end - triangles.start;
        Ok(Self {
            mesh: mesh_of(gpu, lattice, triangles.clone())?,
            patches: filled(gpu, "the triangles' surfaces", &surface.patches)?,
            tables: filled(gpu, "the mesh's materials", &tables)?,
            pages,
            layout: [
                triangles.start,
                count,
                of.stride,
                of.colors,
                of.normals,
                of.coordinates,
                color,
                opacity,
                emission,
                metallic,
                levels_at,
                linear_at,
                srgb_at,
            ],
            triangles,
        })
    }

    /// `Work` of `surface.wgsl`.
    pub(super) fn work(&self, items: u32, first_voxel: u32, voxels: u32) -> Vec<u32> {
        [&[items, first_voxel, voxels], self.layout.as_slice()].concat()
    }

    /// The bindings that every kernel on patches has, after its parameters.
    pub(super) fn bound(&self) -> [(u32, Bound<'_>); 5] {
        let [first, second, third] = &self.pages;
        let buffers = [&self.patches, &self.tables, first, second, third];
        let mut binding = 3;
        buffers.map(|buffer| {
            binding += 1;
            (binding, Bound::Buffer(buffer))
        })
    }
}

impl GpuSurface {
    /// Uploads a mesh, snapped to `grid`, and what of its surface a request asks for.
    ///
    /// # Errors
    /// When triangles are too large for the shaders, textures exceed what three bindings hold or images are longer than
    /// 65536 texels, or GPU memory runs out. The CPU can do all of these.
    pub fn upload(
        gpu: &Gpu,
        mesh: &Mesh,
        lattice: &LatticeMesh<'_>,
        grid: &Grid,
        request: &AttributeRequest,
    ) -> Result<Self, GpuError> {
        let all = u32::try_from(lattice.triangles.len()).unwrap_or(NOTHING);
        let patch_bytes = u64::from(DeviceSurface::most_patch_words(mesh, request)) * 4;
        let most = u32::try_from(gpu.limits().binding_bytes / patch_bytes.max(1)).unwrap_or(NOTHING).max(1);
        let chunks = (0..all)
            .step_by(most as usize)
            .map(|first| Chunk::new(gpu, (mesh, lattice, grid), first..first.saturating_add(most).min(all), request))
            .collect::<Result<_, _>>()?;
        Ok(Self { chunks, request: request.clone(), grid: *grid })
    }

    /// The request that it answers.
    #[must_use]
    pub fn request(&self) -> &AttributeRequest {
        &self.request
    }

    /// The grid that the mesh is snapped to.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Bytes of its buffers, without the triangles' positions.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let buffers = |chunk: &Chunk| {
            chunk.patches.size() + chunk.tables.size() + chunk.pages.iter().map(wgpu::Buffer::size).sum::<u64>()
        };
        self.chunks.iter().map(buffers).sum()
    }
}

fn filled(gpu: &Gpu, what: &'static str, words: &[u32]) -> Result<wgpu::Buffer, GpuError> {
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
    let buffer = gpu.storage(what, words.len() as u64 * 4, usage)?;
    gpu.guarded(|| gpu.queue().write_buffer(&buffer, 0, bytemuck::cast_slice(words)))?;
    Ok(buffer)
}

/// The levels' texels in a few buffers, and where each begins: page and word.
fn pages(gpu: &Gpu, levels: &[DeviceLevel]) -> Result<([wgpu::Buffer; PAGES], Vec<[u32; 2]>), GpuError> {
    let limit = gpu.limits().binding_bytes / 4;
    let mut pages: [Vec<u32>; PAGES] = Default::default();
    let mut places = vec![];
    for level in levels {
        let [width, height] = level.base;
        if width.max(height) > MOST_TEXELS {
            return Err(GpuError::ImageTooLarge { side: width.max(height), limit: MOST_TEXELS });
        }
        let needed = level.texels.len();
        let Some((i, page)) = pages.iter_mut().enumerate().find(|(_, page)| (page.len() + needed) as u64 <= limit)
        else {
            let all: usize = levels.iter().map(|level| level.texels.len()).sum();
            return Err(GpuError::BindingTooSmall {
                adapter: gpu.info().to_string(),
                what: "the mesh's textures, which lie in three pieces,",
                needed: all as u64 * 4,
                limit: limit * 4 * PAGES as u64,
            });
        };
        places.push([i, page.len()].map(|number| u32::try_from(number).unwrap_or(u32::MAX)));
        page.extend(&level.texels);
    }
    let [first, second, third] = pages;
    let upload = |page: Vec<u32>| filled(gpu, "the mesh's textures", &page);
    Ok(([upload(first)?, upload(second)?, upload(third)?], places))
}

/// A range of triangles in one piece, so that their order is theirs.
fn mesh_of(gpu: &Gpu, lattice: &LatticeMesh<'_>, range: Range<u32>) -> Result<GpuMesh, GpuError> {
    let triangles = lattice.triangles.get(range.start as usize..range.end as usize).unwrap_or(&[]);
    let mesh = if triangles.len() == lattice.triangles.len() && matches!(lattice.positions, LatticePositions::Narrow(_))
    {
        GpuMesh::upload(gpu, lattice)?
    } else {
        let mut places = HashMap::new();
        let mut positions = vec![];
        let mut place_of = |vertex: u32| {
            *places.entry(vertex).or_insert_with(|| {
                positions.push(lattice.positions.get(vertex));
                u32::try_from(positions.len() - 1).unwrap_or(u32::MAX)
            })
        };
        let triangles: Vec<[u32; 3]> = triangles.iter().map(|triangle| triangle.map(&mut place_of)).collect();
        let narrow =
            |p: &[i64; 3]| Some([i32::try_from(p[0]).ok()?, i32::try_from(p[1]).ok()?, i32::try_from(p[2]).ok()?]);
        let positions = match positions.iter().map(narrow).collect::<Option<Vec<_>>>() {
            Some(narrow) => LatticePositions::Narrow(narrow),
            None => LatticePositions::Wide(positions),
        };
        GpuMesh::upload(gpu, &LatticeMesh { positions, triangles: &triangles })?
    };
    if mesh.cpu_triangles() > 0 {
        return Err(GpuError::TrianglesTooLarge(mesh.cpu_triangles() as u64));
    }
    if mesh.chunks.len() > 1 {
        return Err(GpuError::BindingTooSmall {
            adapter: gpu.info().to_string(),
            what: "the mesh's vertices",
            needed: lattice.positions.len() as u64 * 12,
            limit: gpu.limits().binding_bytes,
        });
    }
    Ok(mesh)
}
