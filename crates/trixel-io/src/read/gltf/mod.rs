//! glTF 2.0, JSON and binary (GLB), after the Khronos specification of 2021.
//!
//! The default scene is read, with the transforms of its nodes composed in `f64`. Skinned meshes are read as they lie in
//! their node, without their skin; morph targets by their default weights. Cameras and lights are ignored. Skins and
//! animations are what [`read_animated`] reads for [`crate::animation`].

mod accessor;
mod animation;
mod buffer;
mod json;
mod material;
mod mesh;
mod rig;
#[cfg(test)]
mod tests;

use std::collections::HashMap;
use std::rc::Rc;

use trixel::UpAxis;

use rig::{Deformable, Local};

use super::assemble::{Assembly, Budget, Part};
use super::instances::{Child, walk};
use super::transform::Affine;
use super::{Loaded, Problem, ReadOptions, Resources};

pub(crate) use rig::Rig;

/// Reads glTF or GLB.
pub(super) fn read(bytes: &[u8], options: &ReadOptions, resources: &dyn Resources) -> Result<Loaded, Problem> {
    read_document(bytes, options, resources, false).map(|(loaded, _)| loaded)
}

/// Reads glTF or GLB with what moves it. The mesh is at rest, as its skins place it.
pub(super) fn read_animated(
    bytes: &[u8],
    options: &ReadOptions,
    resources: &dyn Resources,
) -> Result<(Loaded, Rig), Problem> {
    let (mut loaded, rig) = read_document(bytes, options, resources, true)?;
    let rig = rig.ok_or_else(|| Problem::new("nodes", "were not read"))?;
    rig.pose(None, 0.0, &mut loaded.mesh);
    Ok((loaded, rig))
}

fn read_document(
    bytes: &[u8],
    options: &ReadOptions,
    resources: &dyn Resources,
    animated: bool,
) -> Result<(Loaded, Option<Rig>), Problem> {
    let container = buffer::Container::open(bytes)?;
    let document: json::Document<'_> = serde_json::from_slice(container.json)
        .map_err(|error| Problem::new("JSON", format!("{error}; the file is damaged or no glTF")))?;
    check_supported(&document)?;

    let buffers = buffer::Buffers::load(&document, container.binary, options.attributes, resources);
    let size = bytes.len().saturating_add(buffers.total());
    let budget = Budget::for_bytes(size);
    let mut warnings = container.warnings;

    let accessors = accessor::Accessors { document: &document, buffers: &buffers };
    let mut rig = match animated {
        true => Some(Rig::read(&document, &accessors, &mut budget.clone(), &mut warnings)?),
        false => None,
    };
    let mut meshes = mesh::Meshes::new(accessors, options.attributes, budget);
    let mut assembly = Assembly::new(budget);
    let mut placed: HashMap<usize, Rc<[Part]>> = HashMap::new();
    let mut deformable: HashMap<usize, Deformable> = HashMap::new();
    let mut place = |meshes: &mut mesh::Meshes<'_>,
                     rig: &mut Option<Rig>,
                     index: Option<usize>,
                     mesh: usize,
                     transform: &Affine| {
        let node = index.and_then(|index| document.nodes.get(index));
        let weights = node.map_or(&[][..], |node| &node.weights);
        let instances = match node.and_then(|node| node.extensions.instancing.as_ref()) {
            Some(instancing) => instance_transforms(meshes, &instancing.attributes)?,
            None => vec![Affine::IDENTITY],
        };
        if let (Some(rig), Some(index)) = (rig, index) {
            let parts = match deformable.get(&mesh) {
                Some(parts) => Rc::clone(parts),
                None => Rc::clone(deformable.entry(mesh).or_insert(meshes.deformable_parts(mesh)?.into())),
            };
            for instance in instances {
                for (i, (part, _)) in parts.iter().enumerate() {
                    let transform = if rig.is_skinned(index) { Affine::IDENTITY } else { transform.after(&instance) };
                    let start = assembly.place(part, &transform, |material| material)?;
                    rig.place(index, &parts, i, instance, start);
                }
            }
            return Ok(());
        }
        let parts = match placed.get(&mesh) {
            Some(parts) if weights.is_empty() => Rc::clone(parts),
            _ => {
                let parts: Rc<[Part]> = meshes.parts(mesh, weights)?.into();
                if weights.is_empty() {
                    placed.insert(mesh, Rc::clone(&parts));
                }
                parts
            }
        };
        for instance in instances {
            let transform = transform.after(&instance);
            parts.iter().try_for_each(|part| assembly.place(part, &transform, |material| material).map(|_| ()))?;
        }
        Ok::<(), Problem>(())
    };

    if document.nodes.is_empty() && !document.meshes.is_empty() {
        warnings.push("there is no node that places a mesh: every mesh is read as it is".into());
        for mesh in 0..document.meshes.len() {
            place(&mut meshes, &mut rig, None, mesh, &Affine::IDENTITY)?;
        }
    }
    let children = children(&document)?;
    let name = |node: usize| match document.nodes.get(node) {
        Some(json::Node { name, .. }) if !name.is_empty() => format!("node {node} ({name})"),
        _ => format!("node {node}"),
    };
    let mut seen = vec![false; document.nodes.len()];
    let mut parents = vec![None; document.nodes.len()];
    walk(&children, &roots(&document, &children)?, budget.limit(), name, |index, transform| {
        if seen.get_mut(index).is_some_and(|seen| std::mem::replace(seen, true)) {
            return Err(Problem::new(
                name(index),
                "is in the scene twice: listed twice, or both as a root and below another; export the file again",
            ));
        }
        if let Some(rig) = &mut rig {
            rig.visit(&document, index, &mut parents);
        }
        match document.nodes.get(index) {
            Some(json::Node { mesh: Some(mesh), .. }) => place(&mut meshes, &mut rig, Some(index), *mesh, transform),
            _ => Ok(()),
        }
    })?;
    warnings.extend(meshes.warnings());

    let mut mesh = assembly.finish();
    mesh.up = Some(UpAxis::Y);
    if options.attributes {
        let read = material::read(&document, &buffers, size, resources);
        warnings.extend(read.warnings);
        mesh.materials = read.materials;
        mesh.textures = read.textures;
        mesh.images = read.images;
        if mesh.triangle_materials.is_empty() {
            mesh.materials.clear();
        }
    }
    Ok((Loaded { mesh, warnings }, rig))
}

/// Refuses other versions, and extensions without which the file cannot be understood.
fn check_supported(document: &json::Document<'_>) -> Result<(), Problem> {
    let version = &document.asset.version;
    if !version.starts_with("2.") {
        return Err(Problem::new(
            "asset",
            format!("this is glTF {version}, and only 2.x is read; export it as glTF 2.0"),
        ));
    }
    for name in &document.extensions_required {
        let supported = matches!(
            name.as_str(),
            "KHR_mesh_quantization" | "KHR_texture_transform" | "EXT_mesh_gpu_instancing" | "EXT_texture_webp"
        ) || ["KHR_materials_", "KHR_lights_", "KHR_xmp", "KHR_animation_"]
            .iter()
            .any(|prefix| name.starts_with(prefix));
        if supported {
            continue;
        }
        let advice = match name.as_str() {
            "KHR_draco_mesh_compression" => "export the file without Draco compression",
            "EXT_meshopt_compression" | "KHR_meshopt_compression" => "export the file without meshopt compression",
            "KHR_texture_basisu" => "export the file with PNG or JPEG textures",
            _ => "export the file without it",
        };
        return Err(Problem::new(
            "extensionsRequired",
            format!("the file requires the extension {name}, which is not supported; {advice}"),
        ));
    }
    Ok(())
}

/// The children of each node, each with its transform. glTF's nodes form trees: no node has two parents.
fn children(document: &json::Document<'_>) -> Result<Vec<Vec<Child>>, Problem> {
    let mut parents: Vec<Option<usize>> = vec![None; document.nodes.len()];
    let mut all = Vec::with_capacity(document.nodes.len());
    for (parent, node) in document.nodes.iter().enumerate() {
        let mut children = Vec::with_capacity(node.children.len());
        for &child in &node.children {
            let Some(slot) = parents.get_mut(child) else {
                return Err(Problem::new(
                    format!("node {parent}"),
                    format!("has node {child} as its child, which does not exist; the file is damaged"),
                ));
            };
            if let Some(other) = slot.replace(parent) {
                return Err(Problem::new(
                    format!("node {child}"),
                    format!("is a child of both node {other} and node {parent}; a node may have one parent only"),
                ));
            }
            children.push(Child { node: child, transform: local_transform(&document.nodes, child) });
        }
        all.push(children);
    }
    Ok(all)
}

/// The roots of the default scene, or of the first; without scenes, every node that has no parent.
fn roots(document: &json::Document<'_>, children: &[Vec<Child>]) -> Result<Vec<Child>, Problem> {
    let mut has_parent = vec![false; document.nodes.len()];
    for child in children.iter().flatten() {
        if let Some(has_parent) = has_parent.get_mut(child.node) {
            *has_parent = true;
        }
    }
    let scene = document.scene.unwrap_or(0);
    let nodes: Vec<usize> = match document.scenes.get(scene) {
        Some(scene) => scene.nodes.clone(),
        None if document.scene.is_some() => {
            return Err(Problem::new("scene", format!("scene {scene} does not exist; the file is damaged")));
        }
        None => (0..document.nodes.len()).filter(|&node| !has_parent[node]).collect(),
    };
    if document.scenes.is_empty() && nodes.is_empty() && !document.nodes.is_empty() {
        return Err(Problem::new("node 0", "every node has a parent: the scene has a cycle; export the file again"));
    }
    Ok(nodes.into_iter().map(|node| Child { node, transform: local_transform(&document.nodes, node) }).collect())
}

fn local_transform(nodes: &[json::Node<'_>], index: usize) -> Affine {
    nodes.get(index).map_or(Affine::IDENTITY, |node| Local::of(node).transform())
}

/// The transforms of `EXT_mesh_gpu_instancing`.
fn instance_transforms(
    meshes: &mut mesh::Meshes<'_>,
    attributes: &json::InstanceAttributes,
) -> Result<Vec<Affine>, Problem> {
    let all = [attributes.translation, attributes.rotation, attributes.scale];
    let Some(first) = all.into_iter().flatten().next() else { return Ok(vec![Affine::IDENTITY]) };
    let count = meshes.accessors.count(first)?;
    for accessor in all.into_iter().flatten() {
        if meshes.accessors.count(accessor)? != count {
            return Err(Problem::new(
                format!("accessor {accessor}"),
                format!("must have {count} elements like the other attributes of the instances"),
            ));
        }
    }
    meshes.budget.take("EXT_mesh_gpu_instancing", count)?;
    let mut transforms = vec![Affine::IDENTITY; count];
    let (accessors, budget) = (&meshes.accessors, &mut meshes.budget);
    if let Some(accessor) = attributes.scale {
        for (transform, scale) in transforms.iter_mut().zip(accessors.vectors(accessor, budget)?) {
            *transform = Affine::scale(scale);
        }
    }
    if let Some(accessor) = attributes.rotation {
        for (transform, rotation) in transforms.iter_mut().zip(accessors.vectors(accessor, budget)?) {
            *transform = Affine::rotation(rotation).after(transform);
        }
    }
    if let Some(accessor) = attributes.translation {
        for (transform, translation) in transforms.iter_mut().zip(accessors.vectors(accessor, budget)?) {
            *transform = Affine::translation(translation).after(transform);
        }
    }
    Ok(transforms)
}
