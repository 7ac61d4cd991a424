//! Puts the parts of a scene together into one [`Mesh`], each part as often as it is placed.

use trixel::{Attribute, Mesh};

use super::Problem;
use super::transform::Affine;
use crate::numbers::narrow;

/// How large a mesh a file may stand for: instances let a few bytes ask for any number of vertices.
#[derive(Clone, Copy, Debug)]
pub(super) struct Budget {
    limit: u64,
    used: u64,
}

impl Budget {
    /// What any file may use, however small.
    const BASE: u64 = 1 << 22;
    /// What each byte adds: a scene that places one mesh spends about 40 bytes on each of its instances.
    const PER_BYTE: u64 = 64;
    /// What no file may exceed.
    const MAX: u64 = 1 << 28;

    /// The budget of a file that is `bytes` long with all that it refers to.
    pub(super) fn for_bytes(bytes: usize) -> Self {
        let bytes = u64::try_from(bytes).unwrap_or(u64::MAX);
        let limit = Self::BASE.saturating_add(bytes.saturating_mul(Self::PER_BYTE)).min(Self::MAX);
        Self { limit, used: 0 }
    }

    /// The largest number of vertices, of triangles, and of placements.
    pub(super) fn limit(&self) -> u64 {
        self.limit
    }

    /// Takes `amount` vertices, values or triangles from the budget, before they are allocated.
    pub(super) fn take(&mut self, at: &str, amount: usize) -> Result<(), Problem> {
        self.used = self.used.saturating_add(u64::try_from(amount).unwrap_or(u64::MAX));
        if self.used > self.limit {
            return Err(Problem::new(
                at,
                format!(
                    "the scene expands to more than {} vertices or triangles, the most that a file of this size may \
                     stand for; split it, or export it with fewer instances",
                    self.limit
                ),
            ));
        }
        Ok(())
    }
}

/// A mesh in its own space, placed once or more in the scene.
#[derive(Clone, Debug, Default)]
pub(super) struct Part {
    /// Where it comes from, for messages: "mesh 3 (wheel)".
    pub(super) name: String,
    /// Vertex positions.
    pub(super) positions: Vec<[f64; 3]>,
    /// Indices into `positions`, in range.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Shading normals.
    pub(super) normals: Option<Attribute<[f32; 3]>>,
    /// Texture coordinates; a set may be missing.
    pub(super) uvs: Vec<Option<Attribute<[f32; 2]>>>,
    /// Linear RGBA.
    pub(super) colors: Option<Attribute<[f32; 4]>>,
    /// Material of each triangle, or empty.
    pub(super) materials: Vec<u32>,
}

/// Where a placed part begins in the mesh.
#[derive(Clone, Copy, Debug)]
pub(super) struct Start {
    /// Its first vertex.
    pub(super) vertex: usize,
    /// Its first value of the normals.
    pub(super) normal: usize,
}

/// Collects placed parts.
#[derive(Debug)]
pub(super) struct Assembly {
    mesh: Mesh,
    normals: Gathered<[f32; 3]>,
    uvs: Vec<Gathered<[f32; 2]>>,
    colors: Gathered<[f32; 4]>,
    vertices: Budget,
    triangles: Budget,
    values: Budget,
}

impl Assembly {
    /// An empty mesh that may grow as large as `budget` allows.
    pub(super) fn new(budget: Budget) -> Self {
        Self {
            mesh: Mesh::default(),
            normals: Gathered::default(),
            uvs: Vec::new(),
            colors: Gathered::default(),
            vertices: budget,
            triangles: budget,
            values: budget,
        }
    }

    /// Adds `part`, moved by `transform`, and says where its vertices and values begin. Mirrored triangles are turned round,
    /// so that outward stays outward. `material` translates the part's materials to those of the mesh.
    pub(super) fn place(
        &mut self,
        part: &Part,
        transform: &Affine,
        material: impl Fn(u32) -> u32,
    ) -> Result<Start, Problem> {
        self.vertices.take(&part.name, part.positions.len())?;
        self.triangles.take(&part.name, part.triangles.len())?;
        for values in [
            part.normals.as_ref().map(|a| a.values.len()),
            part.uvs.iter().flatten().map(|a| a.values.len()).max(),
            part.colors.as_ref().map(|a| a.values.len()),
        ] {
            self.values.take(&part.name, values.unwrap_or(0).div_ceil(3))?;
        }
        let first_vertex = self.mesh.positions.len();
        let first_triangle = self.mesh.triangles.len();
        let start = Start { vertex: first_vertex, normal: self.normals.values.len() };
        let flip = transform.determinant() < 0.0;

        self.mesh.positions.extend(part.positions.iter().map(|&p| transform.point(p)));
        let base = index(first_vertex);
        self.mesh.triangles.extend(part.triangles.iter().map(|&t| turned(t, flip).map(|v| v + base)));
        self.check_finite(part, first_vertex, first_triangle)?;

        let placed = Placed { part, mesh: &self.mesh, first_vertex, first_triangle, flip };
        let matrix = (!transform.is_translation()).then(|| transform.normals());
        self.normals.add(&placed, part.normals.as_ref(), |n| matrix.map_or(n, |m| unit_normal(&m, n)));
        let sets = self.uvs.len().max(part.uvs.len());
        self.uvs.resize_with(sets, Gathered::default);
        for (set, gathered) in self.uvs.iter_mut().enumerate() {
            gathered.add(&placed, part.uvs.get(set).and_then(Option::as_ref), |uv| uv);
        }
        self.colors.add(&placed, part.colors.as_ref(), |c| c);

        if !part.materials.is_empty() {
            self.mesh.triangle_materials.resize(first_triangle, Mesh::NO_MATERIAL);
            self.mesh.triangle_materials.extend(part.materials.iter().map(|&m| material(m)));
        }
        Ok(start)
    }

    /// The mesh of all that was placed.
    pub(super) fn finish(self) -> Mesh {
        let mut mesh = self.mesh;
        if !mesh.triangle_materials.is_empty() {
            mesh.triangle_materials.resize(mesh.triangles.len(), Mesh::NO_MATERIAL);
        }
        mesh.normals = self.normals.finish();
        // A set keeps its number, so one that no part has is kept empty.
        mesh.uvs = self
            .uvs
            .into_iter()
            .map(|set| {
                let corners = vec![[Attribute::<[f32; 2]>::NONE; 3]; mesh.triangles.len()];
                set.finish().unwrap_or(Attribute { values: Vec::new(), corners: Some(corners) })
            })
            .collect();
        mesh.colors = self.colors.finish();
        mesh
    }

    fn check_finite(&self, part: &Part, first_vertex: usize, first_triangle: usize) -> Result<(), Problem> {
        let finite = |p: &[f64; 3]| p.iter().all(|c| c.is_finite());
        let new = self.mesh.positions.get(first_vertex..).unwrap_or_default();
        if new.iter().all(finite) {
            return Ok(());
        }
        // Vertices that no triangle uses may be anything.
        for &vertex in self.mesh.triangles.get(first_triangle..).unwrap_or_default().iter().flatten() {
            let Some(p) = self.mesh.positions.get(vertex as usize) else { continue };
            if !finite(p) {
                return Err(Problem::new(
                    part.name.clone(),
                    format!(
                        "vertex {} is not finite where the scene places it: ({}, {}, {}); repair or remove it",
                        vertex as usize - first_vertex,
                        p[0],
                        p[1],
                        p[2]
                    ),
                ));
            }
        }
        Ok(())
    }
}

/// A part that has just been added to the mesh.
struct Placed<'a> {
    part: &'a Part,
    mesh: &'a Mesh,
    first_vertex: usize,
    first_triangle: usize,
    flip: bool,
}

/// An attribute with values of its own on corners, whose triangles are added in order; some may have none.
pub(super) struct CornerAttribute<T> {
    pub(super) values: Vec<T>,
    corners: Vec<[u32; 3]>,
}

impl<T> Default for CornerAttribute<T> {
    fn default() -> Self {
        Self { values: Vec::new(), corners: Vec::new() }
    }
}

impl<T: Copy> CornerAttribute<T> {
    /// Sets the corners of `triangle`, which is later than those before.
    pub(super) fn push(&mut self, triangle: usize, corners: [u32; 3]) {
        if corners != [Attribute::<T>::NONE; 3] {
            self.corners.resize(triangle, [Attribute::<T>::NONE; 3]);
            self.corners.push(corners);
        }
    }

    /// The attribute of `triangles` triangles, if any of them has it.
    pub(super) fn finish(mut self, triangles: usize) -> Option<Attribute<T>> {
        if self.corners.is_empty() {
            return None;
        }
        self.corners.resize(triangles, [Attribute::<T>::NONE; 3]);
        Some(Attribute { values: self.values, corners: Some(self.corners) })
    }
}

/// One attribute of all parts. It stays one value a vertex for as long as every part has it so.
#[derive(Debug)]
struct Gathered<T> {
    values: Vec<T>,
    corners: Option<Vec<[u32; 3]>>,
}

impl<T> Default for Gathered<T> {
    fn default() -> Self {
        Self { values: Vec::new(), corners: None }
    }
}

impl<T: Copy> Gathered<T> {
    fn add(&mut self, placed: &Placed<'_>, attribute: Option<&Attribute<T>>, map: impl Fn(T) -> T) {
        let Some(attribute) = attribute else {
            if !self.values.is_empty() && !placed.part.triangles.is_empty() {
                let corners = self.corners.get_or_insert_with(|| earlier_triangles(placed));
                corners.resize(placed.mesh.triangles.len(), [Attribute::<T>::NONE; 3]);
            }
            return;
        };
        let per_vertex = attribute.corners.is_none() && self.corners.is_none();
        let first_value = self.values.len();
        if !(per_vertex && first_value == placed.first_vertex) {
            let corners = self.corners.get_or_insert_with(|| match first_value {
                0 => Vec::new(),
                _ => earlier_triangles(placed),
            });
            corners.resize(placed.first_triangle, [Attribute::<T>::NONE; 3]);
            let base = index(first_value);
            let shift = |corner: u32| if corner == Attribute::<T>::NONE { corner } else { corner + base };
            let new = attribute.corners.as_ref().unwrap_or(&placed.part.triangles);
            corners.extend(new.iter().map(|&c| turned(c, placed.flip).map(shift)));
        }
        self.values.extend(attribute.values.iter().map(|&value| map(value)));
    }

    fn finish(self) -> Option<Attribute<T>> {
        (!self.values.is_empty()).then_some(Attribute { values: self.values, corners: self.corners })
    }
}

/// The triangles before the part, which are also the corners of an attribute that had one value a vertex until now.
fn earlier_triangles(placed: &Placed<'_>) -> Vec<[u32; 3]> {
    placed.mesh.triangles.get(..placed.first_triangle).unwrap_or_default().to_vec()
}

fn turned(corners: [u32; 3], flip: bool) -> [u32; 3] {
    if flip { [corners[0], corners[2], corners[1]] } else { corners }
}

/// An index below [`Budget::MAX`].
fn index(i: usize) -> u32 {
    u32::try_from(i).unwrap_or(u32::MAX)
}

pub(super) fn unit_normal(matrix: &[[f64; 3]; 3], normal: [f32; 3]) -> [f32; 3] {
    let n = normal.map(f64::from);
    let mapped = matrix.map(|row| row[0] * n[0] + row[1] * n[1] + row[2] * n[2]);
    // Divided by the largest first, so that squares of tiny or huge scales stay in range.
    let largest = mapped.iter().fold(0.0f64, |largest, c| largest.max(c.abs()));
    if !(largest > 0.0 && largest.is_finite()) {
        return [0.0; 3];
    }
    let scaled = mapped.map(|c| c / largest);
    let length = scaled.iter().map(|c| c * c).sum::<f64>().sqrt();
    scaled.map(|c| narrow(c / length))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(color: Option<[f32; 4]>) -> Part {
        Part {
            name: "part".into(),
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            triangles: vec![[0, 1, 2]],
            colors: color.map(|c| Attribute::per_vertex(vec![c; 3])),
            ..Part::default()
        }
    }

    fn assembled(parts: &[(Part, Affine)]) -> Mesh {
        let mut assembly = Assembly::new(Budget::for_bytes(0));
        for (part, transform) in parts {
            assembly.place(part, transform, |m| m).unwrap();
        }
        let mesh = assembly.finish();
        mesh.check().unwrap();
        mesh
    }

    const RED: [f32; 4] = [1.0, 0.0, 0.0, 1.0];
    const BLUE: [f32; 4] = [0.0, 0.0, 1.0, 1.0];

    #[test]
    fn attribute_on_every_part_stays_per_vertex() {
        let mesh = assembled(&[(triangle(Some(RED)), Affine::IDENTITY), (triangle(Some(BLUE)), Affine::IDENTITY)]);
        let colors = mesh.colors.unwrap();
        assert_eq!(colors.corners, None);
        assert_eq!(colors.on_triangle(1, mesh.triangles[1]), Some([BLUE; 3]));
    }

    #[test]
    fn attribute_on_some_parts_has_corners_in_any_order() {
        let sets = [[Some(RED), None, Some(BLUE)], [None, Some(RED), None], [None, None, Some(BLUE)]];
        for set in sets {
            let parts: Vec<_> = set.map(|color| (triangle(color), Affine::IDENTITY)).into();
            let mesh = assembled(&parts);
            let colors = mesh.colors.as_ref().unwrap();
            assert_eq!(colors.corners.as_ref().unwrap().len(), 3);
            for (i, color) in set.into_iter().enumerate() {
                assert_eq!(colors.on_triangle(i, mesh.triangles[i]), color.map(|c| [c; 3]), "{set:?}");
            }
        }
        assert_eq!(assembled(&[(triangle(None), Affine::IDENTITY)]).colors, None);
    }

    #[test]
    fn corners_and_per_vertex_mix() {
        let mut seam = triangle(None);
        seam.colors = Some(Attribute { values: vec![RED], corners: Some(vec![[0, 0, 0]]) });
        for parts in [[seam.clone(), triangle(Some(BLUE))], [triangle(Some(BLUE)), seam]] {
            let expected: Vec<_> = parts.iter().map(|p| p.colors.as_ref().unwrap().values[0]).collect();
            let mesh = assembled(&parts.map(|p| (p, Affine::IDENTITY)));
            let colors = mesh.colors.as_ref().unwrap();
            for (i, color) in expected.into_iter().enumerate() {
                assert_eq!(colors.on_triangle(i, mesh.triangles[i]), Some([color; 3]));
            }
        }
    }

    #[test]
    fn mirrored_triangle_is_turned_with_its_corners() {
        let mut part = triangle(None);
        part.colors = Some(Attribute { values: vec![RED, BLUE, RED], corners: Some(vec![[0, 1, 2]]) });
        part.normals = Some(Attribute::per_vertex(vec![[0.0, 0.0, 1.0]; 3]));
        let mesh = assembled(&[(part, Affine::scale([-1.0, 1.0, 1.0]))]);
        assert_eq!(mesh.triangles, [[0, 2, 1]]);
        assert_eq!(mesh.colors.unwrap().corners.unwrap(), [[0, 2, 1]]);
        assert_eq!(mesh.normals.unwrap().values[0], [0.0, 0.0, 1.0]);
    }

    #[test]
    fn materials_are_filled_where_parts_have_none() {
        let mut with = triangle(None);
        with.materials = vec![4];
        let parts = [triangle(None), with, triangle(None)].map(|p| (p, Affine::IDENTITY));
        assert_eq!(assembled(&parts).triangle_materials, [Mesh::NO_MATERIAL, 4, Mesh::NO_MATERIAL]);
        assert!(assembled(&parts[..1]).triangle_materials.is_empty());
    }

    #[test]
    fn only_used_vertices_must_be_finite() {
        let mut part = triangle(None);
        part.positions.push([f64::NAN; 3]);
        assert_eq!(assembled(&[(part.clone(), Affine::IDENTITY)]).positions.len(), 4);
        part.triangles = vec![[1, 2, 3]];
        let problem = Assembly::new(Budget::for_bytes(0)).place(&part, &Affine::IDENTITY, |m| m).unwrap_err();
        assert!(problem.what.contains("vertex 3 is not finite"), "{problem}");
    }

    #[test]
    fn budget_is_taken_before_memory() {
        let mut assembly = Assembly::new(Budget { limit: 5, used: 0 });
        assembly.place(&triangle(None), &Affine::IDENTITY, |m| m).unwrap();
        let problem = assembly.place(&triangle(None), &Affine::IDENTITY, |m| m).unwrap_err();
        assert!(problem.what.contains("more than 5 vertices"), "{problem}");
        assert_eq!(Budget::for_bytes(usize::MAX).limit(), 1 << 28);
    }
}
