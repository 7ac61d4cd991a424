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

    /// The values of two meshes one after the other, each mesh given by its number of vertices and its triangles. A mesh
    /// without values has corners without.
    fn joined(both: [Option<Self>; 2], [first, second]: [(usize, &[[u32; 3]]); 2]) -> Option<Self> {
        let [a, b] = match both {
            [None, None] => return None,
            [a, b] => [a, b].map(|part| part.unwrap_or(Self { values: Vec::new(), corners: Some(Vec::new()) })),
        };
        let mut values = a.values;
        let offset = values.len();
        if a.corners.is_none() && b.corners.is_none() && offset == first.0 {
            values.extend(b.values);
            return Some(Self::per_vertex(values));
        }
        // Corners that lead nowhere must not come to lead into the other mesh's values.
        let explicit = |part: Option<Vec<[u32; 3]>>, triangles: &[[u32; 3]], count: usize, offset: usize| {
            let mut corners = part.unwrap_or_else(|| triangles.to_vec());
            corners.resize(triangles.len(), [Self::NONE; 3]);
            let shifted = |corner: u32| {
                let inside = usize::try_from(corner).ok().filter(|&corner| corner < count);
                inside.and_then(|corner| u32::try_from(corner + offset).ok()).unwrap_or(Self::NONE)
            };
            corners.into_iter().map(move |corners| corners.map(shifted)).collect::<Vec<_>>()
        };
        let mut corners = explicit(a.corners, first.1, offset, 0);
        corners.extend(explicit(b.corners, second.1, b.values.len(), offset));
        values.extend(b.values);
        Some(Self { values, corners: Some(corners) })
    }

    /// The values on the corners of triangle `triangle`, whose vertices are `vertices`; `None` where one is missing.
    #[must_use]
    pub fn on_triangle(&self, triangle: usize, vertices: [u32; 3]) -> Option<[T; 3]> {
        let corners = self.corners_of(triangle, vertices)?;
        let value = |corner: u32| self.values.get(corner as usize).copied();
        Some([value(corners[0])?, value(corners[1])?, value(corners[2])?])
    }

    /// The indices into `values` of the corners of triangle `triangle`, whose vertices are `vertices`; they may be
    /// [`Attribute::NONE`] or out of range.
    #[must_use]
    pub fn corners_of(&self, triangle: usize, vertices: [u32; 3]) -> Option<[u32; 3]> {
        match &self.corners {
            None => Some(vertices),
            Some(corners) => corners.get(triangle).copied(),
        }
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

    /// Adds the triangles of another mesh, with all that lies on them and their materials, which keep their order behind
    /// those that are there: so several meshes share one grid. Give each mesh materials of its own to tell them apart, and
    /// [`crate::attributes::AttributeRequest::with_priorities`] to say which wins where they overlap.
    ///
    /// # Errors
    /// When there would be more vertices than 32 bits can name; the mesh is then as it was.
    ///
    /// ```
    /// use trixel::{Material, Mesh};
    /// let mut scene = trixel::scene::build("cube")?;
    /// let mut other = scene.clone();
    /// other.materials = vec![Material::default()];
    /// other.triangle_materials = vec![0; other.triangles.len()];
    /// scene.append(other)?;
    /// assert_eq!(scene.triangle_materials[0], Mesh::NO_MATERIAL);
    /// assert_eq!(scene.triangle_materials[scene.triangles.len() - 1], 0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn append(&mut self, other: Self) -> Result<(), MeshError> {
        let vertices = self.positions.len() + other.positions.len();
        let (Ok(offset), Ok(_)) = (u32::try_from(self.positions.len()), u32::try_from(vertices)) else {
            return Err(MeshError::TooManyVertices(vertices));
        };
        let parts = [(self.positions.len(), self.triangles.as_slice()), (other.positions.len(), &other.triangles)];
        self.normals = Attribute::joined([self.normals.take(), other.normals], parts);
        self.colors = Attribute::joined([self.colors.take(), other.colors], parts);
        let mut sets = other.uvs.into_iter();
        let count = self.uvs.len().max(sets.len());
        let mut own = std::mem::take(&mut self.uvs).into_iter();
        self.uvs = (0..count).filter_map(|_| Attribute::joined([own.next(), sets.next()], parts)).collect();

        // Counts of materials, textures and images are far below 2^32: each has a place in memory of many bytes.
        let narrow = |count: usize| u32::try_from(count).unwrap_or(u32::MAX);
        let (materials, textures, images) =
            (narrow(self.materials.len()), narrow(self.textures.len()), narrow(self.images.len()));
        if !self.triangle_materials.is_empty() || !other.triangle_materials.is_empty() {
            self.triangle_materials.resize(self.triangles.len(), Self::NO_MATERIAL);
            let shifted = |material: u32| {
                if material == Self::NO_MATERIAL { material } else { material.saturating_add(materials) }
            };
            self.triangle_materials.extend(other.triangle_materials.into_iter().map(shifted));
            self.triangle_materials.resize(self.triangles.len() + other.triangles.len(), Self::NO_MATERIAL);
        }
        self.materials.extend(other.materials.into_iter().map(|mut material| {
            for used in [
                &mut material.base_color_texture,
                &mut material.metallic_roughness_texture,
                &mut material.emissive_texture,
                &mut material.opacity_texture,
            ] {
                used.iter_mut().for_each(|used| used.texture = used.texture.saturating_add(textures));
            }
            material
        }));
        self.textures.extend(
            other
                .textures
                .into_iter()
                .map(|texture| Texture { image: texture.image.saturating_add(images), ..texture }),
        );
        self.images.extend(other.images);
        self.positions.extend(other.positions);
        self.triangles.extend(other.triangles.into_iter().map(|corners| corners.map(|v| v.saturating_add(offset))));
        Ok(())
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
        // First which vertices are used, a bit each, then every vertex once and in order: corner by corner, large meshes
        // would be fetched from memory several times.
        const BITS: usize = u64::BITS as usize;
        let mut used = vec![0u64; self.positions.len().div_ceil(BITS)];
        let mut highest = 0;
        for &vertex in self.triangles.as_flattened() {
            *used.get_mut(vertex as usize / BITS)? |= 1 << (vertex as usize % BITS);
            highest = highest.max(vertex);
        }
        if highest as usize >= self.positions.len() {
            return None;
        }
        let mut bounds = Bounds { min: [f64::INFINITY; 3], max: [f64::NEG_INFINITY; 3] };
        for (positions, used) in self.positions.chunks(BITS).zip(used) {
            for (i, position) in positions.iter().enumerate() {
                if used >> i & 1 != 0 {
                    for axis in 0..3 {
                        bounds.min[axis] = bounds.min[axis].min(position[axis]);
                        bounds.max[axis] = bounds.max[axis].max(position[axis]);
                    }
                }
            }
        }
        (!self.triangles.is_empty()).then_some(bounds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::TextureRef;

    fn triangle(shift: f32) -> Mesh {
        let x = f64::from(shift);
        Mesh::new(vec![[x, 0.0, 0.0], [x, 1.0, 0.0], [x, 0.0, 1.0], [x, 9.0, 9.0]], vec![[0, 1, 2]])
    }

    #[test]
    fn what_lies_on_triangles_follows_them() {
        let values = |shift: f32| [0.0, 1.0, 2.0, 3.0].map(|v| [v + shift, 0.0]).to_vec();
        let per_vertex = |shift| Attribute::per_vertex(values(shift));
        let corners = |shift| Attribute { values: values(shift), corners: Some(vec![[3, 2, u32::MAX - 7]]) };
        let with_corners = |shift| Attribute { values: values(shift), corners: Some(vec![[3, 2, 1]]) };
        let kinds = |shift| [None, Some(per_vertex(shift)), Some(with_corners(shift))];
        for a in kinds(0.0) {
            for b in kinds(10.0) {
                let (mut mesh, mut other) = (triangle(0.0), triangle(5.0));
                (mesh.uvs, other.uvs) = (a.clone().into_iter().collect(), b.into_iter().collect());
                let expected =
                    [&mesh, &other].map(|mesh| mesh.uvs.first().and_then(|uvs| uvs.on_triangle(0, [0, 1, 2])));
                mesh.append(other).unwrap();
                assert_eq!(mesh.triangles, [[0, 1, 2], [4, 5, 6]]);
                let found = [0, 1].map(|i| mesh.uvs.first().and_then(|uvs| uvs.on_triangle(i, mesh.triangles[i])));
                assert_eq!(found, expected);
            }
        }
        // Corners that lead nowhere still do.
        let (mut mesh, mut other) = (triangle(0.0), triangle(5.0));
        (mesh.uvs, other.uvs) = (vec![per_vertex(0.0)], vec![corners(10.0)]);
        mesh.append(other).unwrap();
        assert_eq!(mesh.uvs[0].on_triangle(1, [4, 5, 6]), None);
    }

    #[test]
    fn materials_keep_their_textures() {
        let with = |name: &str| {
            let mut mesh = triangle(0.0);
            let texture = Some(TextureRef::new(0));
            mesh.materials = vec![Material { name: name.into(), emissive_texture: texture, ..Material::default() }];
            mesh.triangle_materials = vec![0];
            let source = crate::material::ImageSource::File(name.into());
            mesh.images = vec![Image { name: name.into(), source }];
            let (wrap, filter) = Default::default();
            mesh.textures = vec![Texture { image: 0, wrap, filter, mipmaps: true }];
            mesh
        };
        let mut mesh = triangle(1.0);
        mesh.append(with("a")).unwrap();
        mesh.append(with("b")).unwrap();
        mesh.append(triangle(2.0)).unwrap();
        assert_eq!(mesh.triangle_materials, [Mesh::NO_MATERIAL, 0, 1, Mesh::NO_MATERIAL]);
        for (material, name) in mesh.materials.iter().zip(["a", "b"]) {
            let texture = mesh.textures[material.emissive_texture.unwrap().texture as usize];
            assert_eq!(mesh.images[texture.image as usize].name, name);
        }
    }
}
