//! What moves a glTF document's meshes: nodes, skins, morph targets, and the animations that drive them (glTF 2.0,
//! sections 3.7.3 and 3.11, appendix C).

use std::rc::Rc;

use trixel::Mesh;

use super::accessor::Accessors;
use super::animation::{Clip, Motion};
use super::json::{Document, Node};
use super::mesh::{Deformers, add_weighted};
use crate::numbers::narrow;
use crate::read::Problem;
use crate::read::assemble::{Budget, Part, Start, unit_normal};
use crate::read::transform::Affine;

/// Where a node is in its parent's space.
#[derive(Clone, Copy, Debug)]
pub(super) enum Local {
    Matrix(Affine),
    Parts { translation: [f64; 3], rotation: [f64; 4], scale: [f64; 3] },
}

impl Local {
    pub(super) fn of(node: &Node<'_>) -> Self {
        match node.matrix {
            // Column by column in the file; its last row is 0 0 0 1.
            Some(m) => Self::Matrix(affine(&m)),
            None => Self::Parts {
                translation: node.translation.unwrap_or_default(),
                rotation: node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]),
                scale: node.scale.unwrap_or([1.0; 3]),
            },
        }
    }

    pub(super) fn transform(&self) -> Affine {
        match self {
            Self::Matrix(matrix) => *matrix,
            Self::Parts { translation, rotation, scale } => {
                Affine::translation(*translation).after(&Affine::rotation(*rotation).after(&Affine::scale(*scale)))
            }
        }
    }
}

fn affine(columns: &[f64; 16]) -> Affine {
    Affine(std::array::from_fn(|row| std::array::from_fn(|column| columns[4 * column + row])))
}

/// A part that deforms, and what deforms it.
pub(super) type Deformable = Rc<[(Part, Deformers)]>;

/// A part where a node places it.
struct Placement {
    node: usize,
    parts: Deformable,
    part: usize,
    instance: Affine,
    start: Start,
}

struct Skin {
    joints: Vec<usize>,
    /// From the space of the mesh to each joint's; the identity where there is none.
    inverse_bind: Vec<Affine>,
}

/// A node as it rests.
struct Rest {
    local: Local,
    skin: Option<usize>,
    weights: Vec<f64>,
}

/// All that moves a document's meshes.
pub(crate) struct Rig {
    nodes: Vec<Rest>,
    /// Nodes of the scene with their parents, parents first.
    order: Vec<(usize, Option<usize>)>,
    skins: Vec<Skin>,
    placements: Vec<Placement>,
    pub(crate) clips: Vec<Clip>,
}

impl Rig {
    /// Reads nodes, skins and animations; what is placed comes later.
    pub(super) fn read(
        document: &Document<'_>,
        accessors: &Accessors<'_>,
        budget: &mut Budget,
        warnings: &mut Vec<String>,
    ) -> Result<Self, Problem> {
        let skins = document.skins.iter().enumerate().map(|(i, skin)| {
            let at = format!("skin {i}");
            if let Some(joint) = skin.joints.iter().find(|joint| **joint >= document.nodes.len()) {
                return Err(Problem::new(at, format!("names node {joint} as a joint, which does not exist")));
            }
            let inverse_bind = match skin.inverse_bind_matrices {
                Some(accessor) => accessors.vectors::<16>(accessor, budget)?.iter().map(affine).collect(),
                None => Vec::new(),
            };
            Ok(Skin { joints: skin.joints.clone(), inverse_bind })
        });
        let skins = skins.collect::<Result<Vec<_>, _>>()?;
        let nodes = document.nodes.iter().enumerate().map(|(i, node)| {
            if node.skin.is_some_and(|skin| skin >= skins.len()) {
                return Err(Problem::new(format!("node {i}"), "names a skin that does not exist"));
            }
            let mesh = node.mesh.and_then(|mesh| document.meshes.get(mesh));
            let own = mesh.map_or(&[][..], |mesh| &mesh.weights);
            let weights = if node.weights.is_empty() { own } else { &node.weights };
            Ok(Rest { local: Local::of(node), skin: node.skin, weights: weights.to_vec() })
        });
        let nodes = nodes.collect::<Result<Vec<_>, _>>()?;
        let clips = super::animation::read(document, accessors, budget, warnings)?;
        Ok(Self { nodes, order: Vec::new(), skins, placements: Vec::new(), clips })
    }

    /// Tells of a node of the scene, after its parent.
    pub(super) fn visit(&mut self, document: &Document<'_>, node: usize, parents: &mut [Option<usize>]) {
        self.order.push((node, parents.get(node).copied().flatten()));
        for &child in document.nodes.get(node).into_iter().flat_map(|node| &node.children) {
            if let Some(parent) = parents.get_mut(child) {
                *parent = Some(node);
            }
        }
    }

    /// Tells of a part that a node placed.
    pub(super) fn place(&mut self, node: usize, parts: &Deformable, part: usize, instance: Affine, start: Start) {
        self.placements.push(Placement { node, parts: Rc::clone(parts), part, instance, start });
    }

    /// Whether the part's vertices are moved by joints alone.
    pub(super) fn is_skinned(&self, node: usize) -> bool {
        self.nodes.get(node).is_some_and(|node| node.skin.is_some())
    }

    /// Moves the vertices and normals of `mesh`, which was assembled with this rig, to where they are `seconds` into a
    /// clip; without one to where they rest.
    pub(crate) fn pose(&self, clip: Option<&Clip>, seconds: f64, mesh: &mut Mesh) {
        let mut locals: Vec<Local> = self.nodes.iter().map(|node| node.local).collect();
        let mut weights: Vec<Option<Vec<f64>>> = vec![None; self.nodes.len()];
        for (node, motion) in clip.into_iter().flat_map(|clip| clip.at(seconds)) {
            let (Some(local), Some(weights)) = (locals.get_mut(node), weights.get_mut(node)) else { continue };
            match (motion, local) {
                (Motion::Translation(value), Local::Parts { translation, .. }) => *translation = value,
                (Motion::Rotation(value), Local::Parts { rotation, .. }) => *rotation = value,
                (Motion::Scale(value), Local::Parts { scale, .. }) => *scale = value,
                (Motion::Weights(values), _) => *weights = Some(values),
                // Animated nodes have no matrix.
                (_, Local::Matrix(_)) => {}
            }
        }
        let mut world = vec![Affine::IDENTITY; self.nodes.len()];
        for &(node, parent) in &self.order {
            let local = locals.get(node).map_or(Affine::IDENTITY, Local::transform);
            let placed = match parent.and_then(|parent| world.get(parent)) {
                Some(parent) => parent.after(&local),
                None => local,
            };
            if let Some(slot) = world.get_mut(node) {
                *slot = placed;
            }
        }
        for placement in &self.placements {
            let Some((part, deformers)) = placement.parts.get(placement.part) else { continue };
            let Some(node) = self.nodes.get(placement.node) else { continue };
            let weights = weights.get(placement.node).and_then(Option::as_deref).unwrap_or(&node.weights);
            let own = world.get(placement.node).map_or(Affine::IDENTITY, |node| node.after(&placement.instance));
            let joints = node.skin.and_then(|skin| self.skins.get(skin)).map(|skin| skin.joints(&world));
            let place = Place { own, joints, influences: &deformers.influences };
            deform(part, deformers, weights, &place, placement.start, mesh);
        }
    }
}

impl Skin {
    /// From the space of the mesh to where each joint takes it.
    fn joints(&self, world: &[Affine]) -> Vec<Affine> {
        let joint = |(i, &node): (usize, &usize)| {
            let joint = world.get(node).copied().unwrap_or(Affine::IDENTITY);
            self.inverse_bind.get(i).map_or(joint, |inverse| joint.after(inverse))
        };
        self.joints.iter().enumerate().map(joint).collect()
    }
}

/// Where vertices of a part go.
struct Place<'a> {
    own: Affine,
    joints: Option<Vec<Affine>>,
    influences: &'a [Vec<(u16, f64)>],
}

impl Place<'_> {
    /// The map of a vertex: that of its joints, mixed by their weights, or that of the node.
    fn of(&self, vertex: usize) -> Affine {
        let (Some(joints), Some(influences)) = (&self.joints, self.influences.get(vertex)) else { return self.own };
        let mut sum = [[0.0; 4]; 3];
        let mut total = 0.0;
        for &(joint, weight) in influences {
            let Some(Affine(rows)) = joints.get(usize::from(joint)) else { continue };
            total += weight;
            for (sum, row) in sum.iter_mut().flatten().zip(rows.iter().flatten()) {
                *sum += weight * row;
            }
        }
        if total > 0.0 { Affine(sum.map(|row| row.map(|c| c / total))) } else { self.own }
    }
}

fn deform(part: &Part, deformers: &Deformers, weights: &[f64], place: &Place<'_>, start: Start, mesh: &mut Mesh) {
    let driven = || deformers.targets.iter().zip(weights).filter(|(_, weight)| **weight != 0.0);
    let mut positions = part.positions.clone();
    for (target, &weight) in driven() {
        add_weighted(&mut positions, &target.positions, weight);
    }
    let places: Vec<Affine> = (0..positions.len()).map(|vertex| place.of(vertex)).collect();
    let new = mesh.positions.iter_mut().skip(start.vertex).zip(&positions);
    new.zip(&places).for_each(|((slot, &position), place)| *slot = place.point(position));

    let (Some(rest), Some(all)) = (&part.normals, &mut mesh.normals) else { return };
    let mut normals: Vec<[f64; 3]> = rest.values.iter().map(|n| n.map(f64::from)).collect();
    for (target, &weight) in driven() {
        add_weighted(&mut normals, &target.normals, weight);
    }
    let new = all.values.iter_mut().skip(start.normal).zip(&normals);
    new.zip(&places).for_each(|((slot, normal), place)| *slot = unit_normal(&place.normals(), normal.map(narrow)));
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::tests::{add_accessor, floats, square_document};
    use super::super::{Rig, read_animated};
    use crate::read::testing::Memory;
    use crate::read::{Loaded, Problem, ReadOptions};

    fn load(document: &serde_json::Value) -> Result<(Loaded, Rig), Problem> {
        read_animated(document.to_string().as_bytes(), &ReadOptions::default(), &Memory::default())
    }

    /// The square with its upper edge on a second joint, which turns by a quarter about z in one second, one above the
    /// origin.
    fn bending() -> serde_json::Value {
        let mut document = square_document();
        let joints = add_accessor(&mut document, &[0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0], 5121, 4, "VEC4");
        let weights = add_accessor(&mut document, &floats(&[1.0, 0.0, 0.0, 0.0].repeat(4)), 5126, 4, "VEC4");
        let mut bind = vec![1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0].repeat(2);
        bind[16 + 13] = -1.0;
        let bind = add_accessor(&mut document, &floats(&bind), 5126, 2, "MAT4");
        let half = 0.5_f32.sqrt();
        let times = add_accessor(&mut document, &floats(&[0.0, 1.0]), 5126, 2, "SCALAR");
        let turns = add_accessor(&mut document, &floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, half, half]), 5126, 2, "VEC4");
        document["meshes"][0]["primitives"][0]["attributes"]["JOINTS_0"] = joints.into();
        document["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = weights.into();
        document["skins"] = json!([{"joints": [1, 2], "inverseBindMatrices": bind}]);
        // The mesh's own node does not move what is skinned.
        document["nodes"] = json!([
            {"mesh": 0, "skin": 0, "translation": [50, 0, 0]},
            {"children": [2]},
            {"translation": [0, 1, 0]}
        ]);
        document["scenes"] = json!([{"nodes": [0, 1]}]);
        document["animations"] = json!([{
            "name": "bend",
            "channels": [{"sampler": 0, "target": {"node": 2, "path": "rotation"}}],
            "samplers": [{"input": times, "output": turns}]
        }]);
        document
    }

    #[test]
    fn joints_move_the_vertices_that_they_own() {
        let (Loaded { mut mesh, .. }, rig) = load(&bending()).unwrap();
        let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
        assert_eq!(mesh.positions, square);
        let clip = &rig.clips[0];
        assert_eq!((clip.name.as_str(), clip.seconds), ("bend", 1.0));
        for (seconds, corner) in [(1.0, [0.0, 2.0]), (1.0 / 3.0, [0.75_f64.sqrt(), 1.5]), (0.0, [1.0, 1.0])] {
            rig.pose(Some(clip), seconds, &mut mesh);
            assert_eq!(mesh.positions[..3], square[..3]);
            let [x, y, _] = mesh.positions[3];
            assert!((x - corner[0]).abs() < 1e-6 && (y - corner[1]).abs() < 1e-6, "{seconds}: {x} {y}");
        }
    }

    #[test]
    fn nodes_and_morph_weights_are_animated() {
        let mut document = square_document();
        let offsets = add_accessor(&mut document, &floats(&[0.0, 0.0, 2.0].repeat(4)), 5126, 4, "VEC3");
        let times = add_accessor(&mut document, &floats(&[0.0, 2.0]), 5126, 2, "SCALAR");
        let weights = add_accessor(&mut document, &floats(&[0.0, 1.0]), 5126, 2, "SCALAR");
        let moves = add_accessor(&mut document, &floats(&[0.0, 0.0, 0.0, 8.0, 0.0, 0.0]), 5126, 2, "VEC3");
        document["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": offsets}]);
        document["animations"] = json!([{
            "channels": [
                {"sampler": 0, "target": {"node": 0, "path": "weights"}},
                {"sampler": 1, "target": {"node": 0, "path": "translation"}},
                {"sampler": 1, "target": {"node": 0, "path": "pointer"}}
            ],
            "samplers": [{"input": times, "output": weights}, {"input": times, "output": moves, "interpolation": "STEP"}]
        }]);
        let (Loaded { mut mesh, warnings }, rig) = load(&document).unwrap();
        assert!(warnings[0].starts_with("1 channels of animations skipped"), "{warnings:?}");
        rig.pose(Some(&rig.clips[0]), 1.0, &mut mesh);
        assert_eq!(mesh.positions[0], [0.0, 0.0, 1.0]);
        rig.pose(Some(&rig.clips[0]), 2.5, &mut mesh);
        assert_eq!(mesh.positions[0], [8.0, 0.0, 2.0]);
    }

    /// Wrong joints or weights would tear the figure apart.
    #[test]
    fn a_real_figure_walks_without_tearing() {
        let folder = std::env::var_os("TRIXEL_MODELS").map_or_else(
            || std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/models"),
            Into::into,
        );
        let path = folder.join("cesium-man/CesiumMan.glb");
        if !path.is_file() {
            println!("{} is not there: left out", path.display());
            return;
        }
        let model = crate::animation::read_animated(&path, &ReadOptions::default()).unwrap();
        let mut mesh = model.mesh().clone();
        let edges = |mesh: &trixel::Mesh| -> Vec<f64> {
            let length = |[a, b]: [u32; 2]| {
                let [a, b] = [a, b].map(|v| mesh.positions[v as usize]);
                (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt()
            };
            mesh.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]].map(length)).collect()
        };
        let rest = edges(&mesh);
        assert_eq!(model.animations().len(), 1);
        let mut moved = false;
        for step in 0..8 {
            model.pose(0, f64::from(step) / 4.0, &mut mesh);
            let longest = edges(&mesh).iter().zip(&rest).map(|(now, then)| now - then).fold(0.0, f64::max);
            assert!(longest < 0.1, "an edge of a figure 1.5 high grows by {longest}");
            moved |= mesh.positions != model.mesh().positions;
            let bounds = mesh.bounds().unwrap();
            let height = (0..3).map(|axis| bounds.max[axis] - bounds.min[axis]).fold(0.0, f64::max);
            assert!((1.3..1.7).contains(&height), "{height}");
        }
        assert!(moved);
    }

    #[test]
    fn damaged_animations_are_named() {
        let problem = |change: fn(&mut serde_json::Value)| {
            let mut document = bending();
            change(&mut document);
            load(&document).err().unwrap().to_string()
        };
        let message = problem(|d| d["animations"][0]["channels"][0]["target"]["node"] = 9.into());
        assert_eq!(message, "animation 0, channel 0: moves node 9, which does not exist; the file is damaged");
        assert!(problem(|d| d["skins"][0]["joints"] = json!([1, 7])).contains("node 7 as a joint"));
        assert!(problem(|d| d["animations"][0]["samplers"][0]["interpolation"] = "FAST".into()).contains("FAST"));
        assert!(problem(|d| d["animations"][0]["samplers"][0]["output"] = 2.into()).contains("16 values for 2 keys"));
        assert!(problem(|d| d["nodes"][0]["skin"] = 3.into()).contains("skin that does not exist"));
    }
}
