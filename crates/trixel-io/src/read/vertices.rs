//! Vertices of the formats that list what a vertex has in one row.

use trixel::{Attribute, Mesh};

use super::color::{Scale, VertexColors};
use super::pieces::Part;

/// Vertices as they are read; lists that are not empty are as long as that of the positions.
#[derive(Default)]
pub(super) struct Vertices {
    pub(super) positions: Vec<[f64; 3]>,
    pub(super) normals: Vec<[f32; 3]>,
    pub(super) uvs: Vec<[f32; 2]>,
    pub(super) colors: VertexColors,
}

impl Vertices {
    /// With room for the positions of `count`.
    pub(super) fn with_capacity(count: usize) -> Self {
        Self { positions: Vec::with_capacity(count), ..Self::default() }
    }

    /// A mesh without triangles.
    pub(super) fn finish(self, scale: Scale) -> Mesh {
        let mut mesh = Mesh::new(self.positions, Vec::new());
        mesh.colors = self.colors.finish(mesh.positions.len(), scale);
        mesh.normals = (!self.normals.is_empty()).then(|| Attribute::per_vertex(self.normals));
        mesh.uvs = if self.uvs.is_empty() { Vec::new() } else { vec![Attribute::per_vertex(self.uvs)] };
        mesh
    }
}

impl Part for Vertices {
    fn append(&mut self, more: Self) {
        self.colors.append(self.positions.len(), more.colors);
        self.positions.extend(more.positions);
        self.normals.extend(more.normals);
        self.uvs.extend(more.uvs);
    }
}
