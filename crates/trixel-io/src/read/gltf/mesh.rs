//! Meshes of a glTF document as parts: one for all primitives that share their vertices (glTF 2.0, section 3.7.2).

use std::collections::HashMap;

use trixel::Attribute;

use super::accessor::Accessors;
use super::json::{Attributes, Primitive, Target};
use crate::numbers::narrow;
use crate::read::Problem;
use crate::read::assemble::{Budget, Part};

/// What deforms the vertices of a part.
#[derive(Debug, Default)]
pub(super) struct Deformers {
    pub(super) targets: Vec<MorphTarget>,
    /// Joints of the skin that move each vertex, with their weights; empty if none does.
    pub(super) influences: Vec<Vec<(u16, f64)>>,
}

/// How far a morph target moves each vertex; empty where it does not.
#[derive(Debug)]
pub(super) struct MorphTarget {
    pub(super) positions: Vec<[f64; 3]>,
    pub(super) normals: Vec<[f64; 3]>,
}

/// Decodes meshes, and counts what it leaves out.
pub(super) struct Meshes<'a> {
    pub(super) accessors: Accessors<'a>,
    /// Whether normals, colours, texture coordinates and materials are wanted.
    pub(super) attributes: bool,
    pub(super) budget: Budget,
    points_and_lines: usize,
    without_positions: usize,
    incomplete: usize,
}

impl<'a> Meshes<'a> {
    pub(super) fn new(accessors: Accessors<'a>, attributes: bool, budget: Budget) -> Self {
        Self { accessors, attributes, budget, points_and_lines: 0, without_positions: 0, incomplete: 0 }
    }

    /// The parts of mesh `index`, deformed by its morph targets as far as `weights` (or else the mesh's own) say.
    pub(super) fn parts(&mut self, index: usize, weights: &[f64]) -> Result<Vec<Part>, Problem> {
        let own = self.accessors.document.meshes.get(index).map_or(&[][..], |mesh| &mesh.weights);
        let weights = if weights.is_empty() { own } else { weights };
        Ok(self.primitives(index, weights)?.into_iter().map(|(part, _)| part).collect())
    }

    /// The parts of mesh `index` as no morph target deforms them, and what deforms each.
    pub(super) fn deformable_parts(&mut self, index: usize) -> Result<Vec<(Part, Deformers)>, Problem> {
        let parts = self.primitives(index, &[])?;
        parts
            .into_iter()
            .map(|(part, primitive)| {
                let deformers = self.deformers(primitive, &part)?;
                Ok((part, deformers))
            })
            .collect()
    }

    /// The parts of mesh `index`, each with the first primitive that it is made of.
    fn primitives(&mut self, index: usize, weights: &[f64]) -> Result<Vec<(Part, &'a Primitive)>, Problem> {
        let Some(mesh) = self.accessors.document.meshes.get(index) else {
            return Err(Problem::new(format!("mesh {index}"), "does not exist, but a node names it"));
        };
        let at = if mesh.name.is_empty() { format!("mesh {index}") } else { format!("mesh {index} ({})", mesh.name) };
        let mut parts: Vec<(Part, &Primitive)> = Vec::new();
        let mut by_vertices: HashMap<(&Attributes, &[Target]), usize> = HashMap::new();
        for (i, primitive) in mesh.primitives.iter().enumerate() {
            let at = format!("{at}, primitive {i}");
            match primitive.mode {
                0..=3 => {
                    self.points_and_lines += 1;
                    continue;
                }
                4..=6 => {}
                mode => return Err(Problem::new(at, format!("has mode {mode}, which glTF does not define"))),
            }
            let Some(position) = primitive.attributes.position else {
                self.without_positions += 1;
                continue;
            };
            if primitive.extensions.draco.is_some() && !self.accessors.has_view(position)? {
                return Err(Problem::new(
                    at,
                    "is compressed with KHR_draco_mesh_compression, which is not supported; export without Draco \
                     compression",
                ));
            }
            let key = (&primitive.attributes, primitive.targets.as_slice());
            let part = match by_vertices.get(&key) {
                Some(&part) => part,
                None => {
                    by_vertices.insert(key, parts.len());
                    parts.push((self.vertices(primitive, position, weights, &at)?, primitive));
                    parts.len() - 1
                }
            };
            if let Some((part, _)) = parts.get_mut(part) {
                self.triangles(primitive, part, &at)?;
            }
        }
        parts.retain(|(part, _)| !part.triangles.is_empty());
        Ok(parts)
    }

    /// What was left out, one sentence each.
    pub(super) fn warnings(&self) -> Vec<String> {
        let primitives = |count: usize| if count == 1 { "1 primitive".into() } else { format!("{count} primitives") };
        let mut warnings = Vec::new();
        if self.points_and_lines > 0 {
            warnings.push(format!("{} of points or lines skipped", primitives(self.points_and_lines)));
        }
        if self.without_positions > 0 {
            warnings.push(format!("{} without positions skipped", primitives(self.without_positions)));
        }
        if self.incomplete > 0 {
            warnings.push(format!(
                "{} with one or two indices left over after the last triangle",
                primitives(self.incomplete)
            ));
        }
        warnings
    }

    fn vertices(&mut self, primitive: &Primitive, position: usize, weights: &[f64], at: &str) -> Result<Part, Problem> {
        let names = &primitive.attributes;
        let mut positions = self.accessors.vectors::<3>(position, &mut self.budget)?;
        let vertices = positions.len();
        for (target, &weight) in primitive.targets.iter().zip(weights) {
            if let (Some(offsets), true) = (target.position, weight != 0.0) {
                let offsets = self.attribute::<3>(offsets, "a morph target", vertices, at)?;
                add_weighted(&mut positions, &offsets, weight);
            }
        }
        let mut part = Part { name: at.to_owned(), positions, ..Part::default() };
        if !self.attributes {
            return Ok(part);
        }
        if let Some(normal) = names.normal {
            let mut normals = self.attribute::<3>(normal, "NORMAL", vertices, at)?;
            for (target, &weight) in primitive.targets.iter().zip(weights) {
                if let (Some(offsets), true) = (target.normal, weight != 0.0) {
                    let offsets = self.attribute::<3>(offsets, "a morph target", vertices, at)?;
                    add_weighted(&mut normals, &offsets, weight);
                }
            }
            part.normals = Some(Attribute::per_vertex(normals.into_iter().map(|n| n.map(narrow)).collect()));
        }
        if let Some(color) = names.color_0 {
            let colors: Vec<[f32; 4]> = if self.accessors.kind(color)? == "VEC3" {
                let colors = self.attribute::<3>(color, "COLOR_0", vertices, at)?;
                colors.into_iter().map(|[r, g, b]| [narrow(r), narrow(g), narrow(b), 1.0]).collect()
            } else {
                let colors = self.attribute::<4>(color, "COLOR_0", vertices, at)?;
                colors.into_iter().map(|c| c.map(narrow)).collect()
            };
            part.colors = Some(Attribute::per_vertex(colors));
        }
        for (set, uv) in
            [names.texcoord_0, names.texcoord_1, names.texcoord_2, names.texcoord_3].into_iter().enumerate()
        {
            let Some(uv) = uv else { continue };
            let values = self.attribute::<2>(uv, &format!("TEXCOORD_{set}"), vertices, at)?;
            part.uvs.resize(set, None);
            part.uvs.push(Some(Attribute::per_vertex(values.into_iter().map(|uv| uv.map(narrow)).collect())));
        }
        Ok(part)
    }

    fn deformers(&mut self, primitive: &Primitive, part: &Part) -> Result<Deformers, Problem> {
        let (at, vertices) = (part.name.as_str(), part.positions.len());
        let mut deformers = Deformers::default();
        for target in &primitive.targets {
            let mut offsets = |accessor: Option<usize>| {
                accessor
                    .map_or(Ok(Vec::new()), |accessor| self.attribute::<3>(accessor, "a morph target", vertices, at))
            };
            let positions = offsets(target.position)?;
            let normals = if part.normals.is_some() { offsets(target.normal)? } else { Vec::new() };
            deformers.targets.push(MorphTarget { positions, normals });
        }
        let names = &primitive.attributes;
        for (joints, weights) in [(names.joints_0, names.weights_0), (names.joints_1, names.weights_1)] {
            let (Some(joints), Some(weights)) = (joints, weights) else { continue };
            let joints = self.attribute::<4>(joints, "JOINTS", vertices, at)?;
            let weights = self.attribute::<4>(weights, "WEIGHTS", vertices, at)?;
            deformers.influences.resize(vertices, Vec::new());
            for ((influences, joints), weights) in deformers.influences.iter_mut().zip(joints).zip(weights) {
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 16 bits")]
                let pairs = joints.into_iter().zip(weights).map(|(joint, weight)| (joint as u16, weight));
                influences.extend(pairs.filter(|(_, weight)| *weight > 0.0));
            }
        }
        Ok(deformers)
    }

    /// An attribute that must have one value a vertex.
    fn attribute<const N: usize>(
        &mut self,
        accessor: usize,
        name: &str,
        vertices: usize,
        at: &str,
    ) -> Result<Vec<[f64; N]>, Problem> {
        let values = self.accessors.vectors::<N>(accessor, &mut self.budget)?;
        if values.len() != vertices {
            return Err(Problem::new(
                at,
                format!(
                    "{name} (accessor {accessor}) has {} values for {vertices} vertices; the file is damaged",
                    values.len()
                ),
            ));
        }
        Ok(values)
    }

    fn triangles(&mut self, primitive: &Primitive, part: &mut Part, at: &str) -> Result<(), Problem> {
        let vertices = u32::try_from(part.positions.len()).unwrap_or(u32::MAX);
        let indices = match primitive.indices {
            Some(accessor) => {
                let indices = self.accessors.indices(accessor, &mut self.budget)?;
                if let Some(place) = indices.iter().position(|&i| i >= vertices) {
                    return Err(Problem::new(
                        at,
                        format!(
                            "index {} (entry {place} of accessor {accessor}) is out of range: there are {vertices} \
                             vertices; the file is damaged, or uses primitive restart, which glTF does not allow",
                            indices[place]
                        ),
                    ));
                }
                indices
            }
            None => (0..vertices).collect(),
        };
        let first = part.triangles.len();
        let triangles = if primitive.mode == 4 { indices.len() / 3 } else { indices.len().saturating_sub(2) };
        self.budget.take(at, triangles)?;
        append_triangles(primitive.mode, &indices, &mut part.triangles);
        if primitive.mode == 4 && !indices.len().is_multiple_of(3) {
            self.incomplete += 1;
        }
        if let (Some(material), true) = (primitive.material, self.attributes) {
            if material >= self.accessors.document.materials.len() {
                return Err(Problem::new(at, format!("names material {material}, which does not exist")));
            }
            let material = u32::try_from(material).unwrap_or(trixel::Mesh::NO_MATERIAL);
            part.materials.resize(first, trixel::Mesh::NO_MATERIAL);
            part.materials.resize(part.triangles.len(), material);
        } else if !part.materials.is_empty() {
            part.materials.resize(part.triangles.len(), trixel::Mesh::NO_MATERIAL);
        }
        Ok(())
    }
}

pub(super) fn add_weighted(values: &mut [[f64; 3]], offsets: &[[f64; 3]], weight: f64) {
    for (value, offset) in values.iter_mut().zip(offsets) {
        for (v, o) in value.iter_mut().zip(offset) {
            *v += weight * o;
        }
    }
}

/// Appends the triangles of a list (4), strip (5) or fan (6). Triangles of a strip or fan that repeat an index only
/// stitch pieces together and are no part of the surface: left in, they would be voxelized as segments across gaps.
fn append_triangles(mode: u32, indices: &[u32], out: &mut Vec<[u32; 3]>) {
    let stitch = |t: &[u32; 3]| t[0] == t[1] || t[1] == t[2] || t[2] == t[0];
    match mode {
        5 => {
            let strip = indices.array_windows().enumerate().map(
                |(i, &[a, b, c])| {
                    if i % 2 == 0 { [a, b, c] } else { [a, c, b] }
                },
            );
            out.extend(strip.filter(|t| !stitch(t)));
        }
        6 => {
            let Some((&hub, rim)) = indices.split_first() else { return };
            out.extend(rim.array_windows().map(|&[b, c]| [b, c, hub]).filter(|t| !stitch(t)));
        }
        _ => out.extend_from_slice(indices.as_chunks().0),
    }
}

#[cfg(test)]
mod tests {
    use super::append_triangles;

    fn triangles(mode: u32, indices: &[u32]) -> Vec<[u32; 3]> {
        let mut out = Vec::new();
        append_triangles(mode, indices, &mut out);
        out
    }

    #[test]
    fn lists_strips_and_fans() {
        assert_eq!(triangles(4, &[0, 1, 2, 2, 1, 3, 9]), [[0, 1, 2], [2, 1, 3]]);
        assert_eq!(triangles(5, &[0, 1, 2, 3]), [[0, 1, 2], [1, 3, 2]]);
        assert_eq!(triangles(6, &[0, 1, 2, 3]), [[1, 2, 0], [2, 3, 0]]);
        for mode in 4..=6 {
            assert!(triangles(mode, &[]).is_empty());
            assert!(triangles(mode, &[0, 1]).is_empty());
        }
    }

    #[test]
    fn stitches_of_strips_are_no_surface_and_degenerate_lists_are() {
        assert_eq!(triangles(5, &[0, 1, 2, 2, 5, 5, 6, 7]), [[0, 1, 2], [5, 7, 6]]);
        assert_eq!(triangles(4, &[0, 0, 1]), [[0, 0, 1]]);
    }
}
