//! Meshes on the GPU, as lattice positions and indices.

use std::collections::HashMap;

use trixel::lattice::{LatticeMesh, LatticePositions};

use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::limits::MAX_EXTENT;
use crate::tiles::TileCounts;

/// A mesh in buffers of a [`Gpu`].
#[derive(Debug)]
pub struct GpuMesh {
    pub(crate) chunks: Vec<Chunk>,
    /// Triangles that only the CPU can do: beyond 32-bit positions, or longer than the shaders' arithmetic allows.
    pub(crate) leftover: Option<Leftover>,
    /// The most columns that the box of one triangle has, where known.
    pub(crate) most_columns: Option<u64>,
}

/// Triangles whose positions and indices fit one binding each.
#[derive(Debug)]
pub(crate) struct Chunk {
    /// Three i32 a vertex, in lattice steps.
    pub(crate) positions: wgpu::Buffer,
    /// Three u32 a triangle.
    pub(crate) indices: wgpu::Buffer,
    pub(crate) triangles: u32,
    /// How many tiles the triangles meet, where known.
    pub(crate) tiles: Option<TileCounts>,
}

/// Few triangles of many: the mesh's other vertices are not kept for them.
#[derive(Debug)]
pub(crate) struct Leftover {
    positions: Vec<[i64; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl Leftover {
    fn new(mesh: &LatticeMesh<'_>, triangles: &[[u32; 3]]) -> Self {
        let mut places = HashMap::new();
        let mut positions = vec![];
        let mut place_of = |vertex: u32| {
            *places.entry(vertex).or_insert_with(|| {
                positions.push(mesh.positions.get(vertex));
                u32::try_from(positions.len() - 1).unwrap_or(u32::MAX)
            })
        };
        let triangles = triangles.iter().map(|triangle| triangle.map(&mut place_of)).collect();
        Self { positions, triangles }
    }

    pub(crate) fn mesh(&self) -> LatticeMesh<'_> {
        LatticeMesh { positions: LatticePositions::Wide(self.positions.clone()), triangles: &self.triangles }
    }
}

impl GpuMesh {
    /// Uploads a snapped mesh, in as many pieces as the adapter's bindings need.
    ///
    /// # Errors
    /// When GPU memory runs out.
    pub fn upload(gpu: &Gpu, mesh: &LatticeMesh<'_>) -> Result<Self, GpuError> {
        let limit = gpu.limits().chunk_elements();
        let sizes = Sizes::of(mesh);
        if let LatticePositions::Narrow(positions) = &mesh.positions
            && !sizes.some_too_large
            && positions.len() <= limit
            && mesh.triangles.len() <= limit
        {
            let chunks = if mesh.triangles.is_empty() {
                vec![]
            } else {
                vec![Chunk::new(gpu, positions.as_flattened(), mesh.triangles.as_flattened())?]
            };
            return Ok(Self { chunks, leftover: None, most_columns: Some(sizes.most_columns) });
        }
        Self::upload_in_pieces(gpu, mesh, limit, sizes.most_columns)
    }

    fn upload_in_pieces(gpu: &Gpu, mesh: &LatticeMesh<'_>, limit: usize, most_columns: u64) -> Result<Self, GpuError> {
        const ABSENT: u32 = u32::MAX;
        let mut chunks = vec![];
        let mut leftover = vec![];
        let mut places = vec![ABSENT; mesh.positions.len()];
        let mut vertices: Vec<u32> = vec![];
        let mut positions: Vec<[i32; 3]> = vec![];
        let mut triangles: Vec<[u32; 3]> = vec![];
        for (i, triangle) in mesh.triangles.iter().enumerate() {
            let Some(corners) = for_gpu(&mesh.corners(i)) else {
                leftover.push(*triangle);
                continue;
            };
            if triangles.len() == limit || positions.len() + 3 > limit {
                chunks.push(Chunk::new(gpu, positions.as_flattened(), triangles.as_flattened())?);
                vertices.drain(..).for_each(|vertex| places[vertex as usize] = ABSENT);
                positions.clear();
                triangles.clear();
            }
            let mut moved = [0; 3];
            for corner in 0..3 {
                let place = &mut places[triangle[corner] as usize];
                if *place == ABSENT {
                    *place = u32::try_from(positions.len()).unwrap_or(ABSENT);
                    positions.push(corners[corner]);
                    vertices.push(triangle[corner]);
                }
                moved[corner] = *place;
            }
            triangles.push(moved);
        }
        if !triangles.is_empty() {
            chunks.push(Chunk::new(gpu, positions.as_flattened(), triangles.as_flattened())?);
        }
        let leftover = (!leftover.is_empty()).then(|| Leftover::new(mesh, &leftover));
        Ok(Self { chunks, leftover, most_columns: Some(most_columns) })
    }

    /// A mesh that is on the GPU already.
    ///
    /// `positions` holds three `i32` a vertex: lattice steps, 65,536 a voxel, from the grid's origin. `indices` holds
    /// three `u32` a triangle. Both need [`wgpu::BufferUsages::STORAGE`] and must fit one binding. No triangle may be
    /// 8192 voxels or longer along an axis; that is found out when the result is read.
    #[must_use]
    pub fn from_buffers(positions: wgpu::Buffer, indices: wgpu::Buffer, triangles: u32) -> Self {
        let chunks = if triangles == 0 { vec![] } else { vec![Chunk { positions, indices, triangles, tiles: None }] };
        Self { chunks, leftover: None, most_columns: None }
    }

    /// How many triangles are on the GPU.
    #[must_use]
    pub fn triangles(&self) -> u64 {
        self.chunks.iter().map(|chunk| u64::from(chunk.triangles)).sum()
    }

    /// How many triangles only the CPU can do: those that are 8192 voxels or longer along an axis, or that far outside.
    #[must_use]
    pub fn cpu_triangles(&self) -> usize {
        self.leftover.as_ref().map_or(0, |leftover| leftover.triangles.len())
    }
}

impl Chunk {
    fn new(gpu: &Gpu, positions: &[i32], indices: &[u32]) -> Result<Self, GpuError> {
        let triangles = u32::try_from(indices.len() / 3).unwrap_or(u32::MAX);
        Ok(Self {
            positions: gpu.buffer_with(
                "trixel positions",
                bytemuck::cast_slice(positions),
                wgpu::BufferUsages::STORAGE,
            )?,
            indices: gpu.buffer_with("trixel indices", bytemuck::cast_slice(indices), wgpu::BufferUsages::STORAGE)?,
            triangles,
            tiles: Some(TileCounts::of(positions, indices)),
        })
    }
}

/// The corners as the shaders take them, if they can.
fn for_gpu(corners: &[[i64; 3]; 3]) -> Option<[[i32; 3]; 3]> {
    let mut narrow = [[0; 3]; 3];
    for axis in 0..3 {
        let along = corners.map(|corner| corner[axis]);
        let low = along.iter().min()?;
        let high = along.iter().max()?;
        // One voxel of room below: boxes are closed.
        if high - low >= MAX_EXTENT || *low < i64::from(i32::MIN) + (1 << 17) {
            return None;
        }
        for corner in 0..3 {
            narrow[corner][axis] = i32::try_from(along[corner]).ok()?;
        }
    }
    Some(narrow)
}

struct Sizes {
    some_too_large: bool,
    most_columns: u64,
}

impl Sizes {
    fn of(mesh: &LatticeMesh<'_>) -> Self {
        let mut sizes = Self { some_too_large: false, most_columns: 0 };
        for triangle in 0..mesh.triangles.len() {
            let corners = mesh.corners(triangle);
            sizes.some_too_large |= for_gpu(&corners).is_none();
            let voxels: [u64; 3] = std::array::from_fn(|axis| {
                let along = corners.map(|corner| corner[axis]);
                let extent = along.iter().max().unwrap_or(&0) - along.iter().min().unwrap_or(&0);
                (extent.unsigned_abs() >> trixel::lattice::STEP_BITS) + 3
            });
            let columns = (voxels[0] * voxels[1]).max(voxels[1] * voxels[2]).max(voxels[2] * voxels[0]);
            sizes.most_columns = sizes.most_columns.max(columns);
        }
        sizes
    }
}
