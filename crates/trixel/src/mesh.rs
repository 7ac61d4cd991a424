//! Triangle meshes: positions, triangles and what lies on their corners.

use crate::material::{Image, Material, Texture};

/// An indexed triangle mesh.
///
/// `positions` and `triangles` are all that occupancy needs; everything else is optional and only read when voxel
/// attributes are asked for. Coordinates are kept in the file's own units and axes, in `f64`, so that a mesh read from
/// decimal text is snapped to the voxel lattice without a detour through `f32`.
///
/// ```
/// use trixel::Mesh;
/// let mesh = Mesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]]);
/// assert_eq!(mesh.bounds().unwrap().size(), [1.0, 1.0, 0.0]);
/// ```
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Vertex positions `[x, y, z]`.
    pub positions: Vec<[f64; 3]>,
    /// Indices into `positions`, three a triangle. Readers guarantee that they are in range; code that builds a mesh by
    /// hand can call [`Mesh::check`].
    pub triangles: Vec<[u32; 3]>,
    /// Shading normals, not necessarily of unit length.
    pub normals: Option<Attribute<[f32; 3]>>,
    /// Texture coordinates, one entry a set; `v` points down as in glTF (row 0 of the image is `v = 0`).
    pub uvs: Vec<Attribute<[f32; 2]>>,
    /// Vertex colours, linear RGBA.
    pub colors: Option<Attribute<[f32; 4]>>,
    /// Materials that `triangle_materials` names.
    pub materials: Vec<Material>,
    /// Material of each triangle, or empty when the mesh has none; [`Mesh::NO_MATERIAL`] marks a triangle without.
    pub triangle_materials: Vec<u32>,
    /// Textures that materials name.
    pub textures: Vec<Texture>,
    /// Images that textures name.
    pub images: Vec<Image>,
    /// The axis that points up, where the file or its format says so.
    pub up: Option<UpAxis>,
}

/// The axis of a mesh that points up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UpAxis {
    /// x points up (rare; COLLADA can say so).
    X,
    /// y points up (glTF, most OBJ files).
    Y,
    /// z points up (3MF, most STL files).
    Z,
}

/// Values on the corners of triangles.
///
/// With `corners: None` there is one value a vertex and `Mesh::triangles` indexes `values` too. Otherwise `corners` has
/// one entry a triangle, so that seams need no copies of positions; [`Attribute::NONE`] marks a corner without a value.
#[derive(Clone, Debug, PartialEq)]
pub struct Attribute<T> {
    /// The values.
    pub values: Vec<T>,
    /// Index into `values` of each triangle's corners, or `None` for one value a vertex.
    pub corners: Option<Vec<[u32; 3]>>,
}

impl<T: Copy> Attribute<T> {
    /// The index of a corner that has no value.
    pub const NONE: u32 = u32::MAX;

    /// One value a vertex.
    #[must_use]
    pub fn per_vertex(values: Vec<T>) -> Self {
        Self { values, corners: None }
    }

    /// The values on the corners of triangle `triangle`, whose vertices are `vertices`; `None` where one is missing.
    #[must_use]
    pub fn on_triangle(&self, triangle: usize, vertices: [u32; 3]) -> Option<[T; 3]> {
        let corners = match &self.corners {
            None => vertices,
            Some(corners) => *corners.get(triangle)?,
        };
        let value = |corner: u32| self.values.get(corner as usize).copied();
        Some([value(corners[0])?, value(corners[1])?, value(corners[2])?])
    }
}

/// An axis-aligned box, both corners included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Smallest coordinates.
    pub min: [f64; 3],
    /// Largest coordinates.
    pub max: [f64; 3],
}

impl Bounds {
    /// `max - min`.
    #[must_use]
    pub fn size(&self) -> [f64; 3] {
        std::array::from_fn(|i| self.max[i] - self.min[i])
    }
}

/// What is wrong with a mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// A triangle names a vertex that does not exist.
    #[error(
        "triangle {triangle} names vertex {vertex}, but the mesh has only {vertices} vertices; the file is damaged"
    )]
    IndexOutOfRange {
        /// Index of the triangle.
        triangle: usize,
        /// The vertex it names.
        vertex: u32,
        /// How many vertices there are.
        vertices: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("vertex {vertex} is not finite: ({}, {}, {}); repair or remove it", position[0], position[1], position[2])]
    NotFinite {
        /// Index of the vertex.
        vertex: usize,
        /// Its position.
        position: [f64; 3],
    },
    /// There are more vertices than 32-bit indices can name.
    #[error("the mesh has {0} vertices; trixel indexes vertices with 32 bits (at most 4,294,967,295): split the mesh")]
    TooManyVertices(usize),
    /// There are more triangles than 32-bit indices can name, where they have to be sorted.
    #[error("the mesh has {0} triangles; bricks are made of at most 4,294,967,295: split the mesh")]
    TooManyTriangles(usize),
}

impl Mesh {
    /// Marks a triangle without a material in [`Mesh::triangle_materials`].
    pub const NO_MATERIAL: u32 = u32::MAX;

    /// A mesh of positions and triangles alone.
    #[must_use]
    pub fn new(positions: Vec<[f64; 3]>, triangles: Vec<[u32; 3]>) -> Self {
        Self { positions, triangles, ..Self::default() }
    }

    /// Checks that every index is in range and every position that a triangle uses is finite.
    ///
    /// # Errors
    /// The first triangle or vertex that fails.
    pub fn check(&self) -> Result<(), MeshError> {
        if u32::try_from(self.positions.len()).is_err() {
            return Err(MeshError::TooManyVertices(self.positions.len()));
        }
        let vertices = self.positions.len();
        for (triangle, corners) in self.triangles.iter().enumerate() {
            for &vertex in corners {
                let Some(position) = self.positions.get(vertex as usize) else {
                    return Err(MeshError::IndexOutOfRange { triangle, vertex, vertices });
                };
                if !position.iter().all(|c| c.is_finite()) {
                    return Err(MeshError::NotFinite { vertex: vertex as usize, position: *position });
                }
            }
        }
        Ok(())
    }

    /// The box around every vertex that a triangle uses, or `None` when there is no triangle.
    #[must_use]
    pub fn bounds(&self) -> Option<Bounds> {
        let mut bounds = Bounds { min: [f64::INFINITY; 3], max: [f64::NEG_INFINITY; 3] };
        for &vertex in self.triangles.iter().flatten() {
            let position = self.positions.get(vertex as usize)?;
            for axis in 0..3 {
                bounds.min[axis] = bounds.min[axis].min(position[axis]);
                bounds.max[axis] = bounds.max[axis].max(position[axis]);
            }
        }
        (!self.triangles.is_empty()).then_some(bounds)
    }
}
