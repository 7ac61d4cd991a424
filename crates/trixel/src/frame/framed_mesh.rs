//! A mesh in a frame's voxel space.

use glam::{DVec3, DVec4};

use super::{Frame, clip};
use crate::mesh::{Attribute, Mesh, MeshError};

/// Voxels around the frame within which triangles are kept whole. The farther, the fewer are cut; beside the 2048 voxels of
/// a 3D texture it keeps every triangle shorter than the 8192 voxels that GPUs can do.
const GUARD: f64 = 3000.0;

/// A mesh as a [`Frame`] sees it: positions in voxels of [`Frame::grid`], normals still in the world's space.
///
/// Triangles that reach behind a perspective camera, or further than 3000 voxels from the box, are cut there; those wholly
/// outside are gone.
#[derive(Clone, Debug)]
pub struct FramedMesh {
    /// The mesh. It always has normals: where the source had none, those of its triangles' planes, turned by the right-hand
    /// rule.
    pub mesh: Mesh,
    /// The fourth homogeneous coordinate of each vertex: 1 but for perspective. Values between corners of a triangle are
    /// the means of the corners' values, weighted by barycentric weight / this.
    pub depths: Vec<f64>,
    /// The source's triangle of each triangle.
    pub sources: Vec<u32>,
}

/// One of the attributes of a mesh, on its way to the framed one.
struct Carried<'a, T> {
    source: &'a Attribute<T>,
    corners: Vec<[u32; 3]>,
    values: Vec<T>,
}

impl<'a, T: Copy> Carried<'a, T> {
    fn new(source: &'a Attribute<T>) -> Self {
        Self { source, corners: vec![], values: source.values.clone() }
    }

    fn whole(&mut self, triangle: usize, vertices: [u32; 3]) {
        self.corners.push(self.source.corners_of(triangle, vertices).unwrap_or([Attribute::<T>::NONE; 3]));
    }

    /// A piece of a triangle, by the weights of its corners.
    fn piece(&mut self, triangle: usize, vertices: [u32; 3], piece: [DVec3; 3], mix: impl Fn([T; 3], DVec3) -> T) {
        let corners = match self.source.on_triangle(triangle, vertices) {
            None => [Attribute::<T>::NONE; 3],
            Some(values) => piece.map(|weights| {
                self.values.push(mix(values, weights));
                u32::try_from(self.values.len() - 1).unwrap_or(Attribute::<T>::NONE)
            }),
        };
        self.corners.push(corners);
    }

    fn finish(self) -> Attribute<T> {
        Attribute { values: self.values, corners: Some(self.corners) }
    }
}

#[expect(clippy::cast_possible_truncation, reason = "attributes are f32")]
fn mix<const N: usize>(values: [[f32; N]; 3], weights: DVec3) -> [f32; N] {
    std::array::from_fn(|i| {
        let [a, b, c] = values.map(|value| f64::from(value[i]));
        (a * weights.x + b * weights.y + c * weights.z) as f32
    })
}

/// The unit normals of the triangles' planes; zero where there is none.
#[expect(clippy::cast_possible_truncation, reason = "normals are f32")]
fn flat_normals(mesh: &Mesh) -> Attribute<[f32; 3]> {
    let normal = |corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|v| mesh.positions.get(v as usize).map_or(DVec3::ZERO, |p| DVec3::from_array(*p)));
        // Divided first, so that the product of tiny or huge edges stays in range.
        let [u, v] = [b - a, c - a];
        let longest = u.abs().max_element().max(v.abs().max_element()).max(f64::MIN_POSITIVE);
        (u / longest).cross(v / longest).normalize_or_zero().to_array().map(|c| c as f32)
    };
    let values = mesh.triangles.iter().map(normal).collect();
    let corners = (0..mesh.triangles.len()).map(|t| [u32::try_from(t).unwrap_or(u32::MAX); 3]).collect();
    Attribute { values, corners: Some(corners) }
}

impl Frame {
    /// The mesh in this frame's voxel space.
    ///
    /// # Errors
    /// When the mesh is broken, or there would be more vertices than 32 bits can name.
    pub fn mesh(&self, mesh: &Mesh) -> Result<FramedMesh, MeshError> {
        mesh.check()?;
        let seen: Vec<DVec4> =
            mesh.positions.iter().map(|p| self.to_voxels * DVec3::from_array(*p).extend(1.0)).collect();
        let planes = self.guard_planes(&seen);
        // A bit for each plane that a vertex is behind of.
        let outside = |at: &DVec4| {
            planes.iter().enumerate().fold(0u8, |bits, (i, plane)| bits | u8::from(plane.dot(*at) < 0.0) << i)
        };
        let codes: Vec<u8> = seen.iter().map(outside).collect();
        let mut positions: Vec<[f64; 3]> = seen
            .iter()
            .zip(&codes)
            // Vertices that are cut away are used by nobody; they must not look far away.
            .map(|(at, code)| if *code == 0 { (at.truncate() / at.w).to_array() } else { [0.0; 3] })
            .collect();
        let mut depths: Vec<f64> = seen.iter().map(|at| at.w).collect();
        let flat;
        let normals = match &mesh.normals {
            Some(normals) => normals,
            None => {
                flat = flat_normals(mesh);
                &flat
            }
        };
        let mut normals = Carried::new(normals);
        let mut colors = mesh.colors.as_ref().map(Carried::new);
        let mut uvs: Vec<_> = mesh.uvs.iter().map(Carried::new).collect();
        let (mut triangles, mut sources, mut materials) = (vec![], vec![], vec![]);
        for (index, &vertices) in mesh.triangles.iter().enumerate() {
            let [a, b, c] = vertices.map(|vertex| codes[vertex as usize]);
            if a & b & c != 0 {
                continue;
            }
            let material = mesh.triangle_materials.get(index).copied();
            let source = u32::try_from(index).unwrap_or(u32::MAX);
            if a | b | c == 0 {
                triangles.push(vertices);
                sources.push(source);
                materials.extend(material);
                normals.whole(index, vertices);
                colors.iter_mut().for_each(|colors| colors.whole(index, vertices));
                uvs.iter_mut().for_each(|uvs| uvs.whole(index, vertices));
                continue;
            }
            let polygon = clip::clip(vertices.map(|vertex| seen[vertex as usize]), &planes);
            let first = u32::try_from(positions.len()).map_err(|_| MeshError::TooManyVertices(positions.len()))?;
            positions.extend(polygon.iter().map(|corner| (corner.at.truncate() / corner.at.w).to_array()));
            depths.extend(polygon.iter().map(|corner| corner.at.w));
            for (offset, pair) in (1u32..).zip(polygon.windows(2).skip(1)) {
                triangles.push([first, first + offset, first + offset + 1]);
                sources.push(source);
                materials.extend(material);
                let weights = [polygon[0].weights, pair[0].weights, pair[1].weights];
                normals.piece(index, vertices, weights, mix);
                colors.iter_mut().for_each(|colors| colors.piece(index, vertices, weights, mix));
                uvs.iter_mut().for_each(|uvs| uvs.piece(index, vertices, weights, mix));
            }
        }
        if u32::try_from(positions.len()).is_err() {
            return Err(MeshError::TooManyVertices(positions.len()));
        }
        let mesh = Mesh {
            positions,
            triangles,
            normals: Some(normals.finish()),
            uvs: uvs.into_iter().map(Carried::finish).collect(),
            colors: colors.map(Carried::finish),
            materials: mesh.materials.clone(),
            triangle_materials: materials,
            textures: mesh.textures.clone(),
            images: mesh.images.clone(),
            up: None,
        };
        Ok(FramedMesh { mesh, depths, sources })
    }

    /// What is kept: the side of each plane where its dot product is not negative.
    fn guard_planes(&self, seen: &[DVec4]) -> Vec<DVec4> {
        let [nx, ny, nz] = self.dims.map(|n| f64::from(n) + GUARD);
        let mut planes = vec![
            DVec4::X + DVec4::W * GUARD,
            DVec4::W * nx - DVec4::X,
            DVec4::Y + DVec4::W * GUARD,
            DVec4::W * ny - DVec4::Y,
            DVec4::Z + DVec4::W * GUARD,
            DVec4::W * nz - DVec4::Z,
        ];
        if self.is_perspective() {
            // In front of the eye by more than rounding.
            let farthest = seen.iter().map(|at| at.w.abs()).filter(|w| w.is_finite()).fold(f64::MIN_POSITIVE, f64::max);
            planes.push(DVec4::W - self.unit() * (farthest * 1e-9));
        }
        planes
    }

    /// The row vector whose dot product with a mapped point is 1, whatever the map.
    fn unit(&self) -> DVec4 {
        self.to_world.row(3)
    }
}
