//! COLLADA 1.4 and 1.5 (Khronos): the scene's geometries with their nodes' transforms.
//!
//! Units and the up axis are kept as the file has them, only named in [`Mesh::up`](trixel::Mesh::up). Skinned meshes are
//! read in their bind shape, morphed ones in their base shape; references to other documents are not followed.

mod geometry;
mod material;
mod node;
#[cfg(test)]
mod tests;

use std::borrow::Cow;
use std::collections::HashMap;
use std::rc::Rc;

use trixel::{Mesh, UpAxis};

use self::geometry::{Geometries, Geometry};
use self::material::Materials;
use super::assemble::{Assembly, Budget};
use super::instances::{Child, walk};
use super::text::without_byte_order_mark;
use super::transform::Affine;
use super::{Loaded, Problem, ReadOptions, Resources};
use crate::xml::{Document, Element};

/// Reads COLLADA.
pub(super) fn read(bytes: &[u8], options: &ReadOptions, resources: &dyn Resources) -> Result<Loaded, Problem> {
    let text = decode(bytes);
    let document = Document::parse(&text)?;
    let Some(root) = document.root().filter(|root| root.name() == "COLLADA") else {
        return Err(Problem::new("start", "there is no <COLLADA> element; the file is no COLLADA"));
    };
    let mut reader = SceneReader {
        geometries: Geometries::new(options.attributes, Budget::for_bytes(bytes.len())),
        assembly: Assembly::new(Budget::for_bytes(bytes.len())),
        materials: Materials::new(&document, resources),
        document: &document,
        attributes: options.attributes,
        read: HashMap::new(),
        bound: HashMap::new(),
        missing: 0,
    };
    let mut warnings = Vec::new();
    reader.scene(root, &mut warnings)?;

    warnings.extend(reader.geometries.warnings());
    warnings.append(&mut reader.materials.warnings);
    if reader.missing > 0 {
        warnings.push(format!("{} references to what this file does not hold are ignored", reader.missing));
    }
    let mut mesh = reader.assembly.finish();
    mesh.up = Some(up_axis(root));
    mesh.materials = reader.materials.materials;
    mesh.textures = reader.materials.textures;
    mesh.images = reader.materials.images;
    Ok(Loaded { mesh, warnings })
}

/// UTF-8, or UTF-16 with a byte order mark. Bytes that are neither occur in names only, where they do no harm.
fn decode(bytes: &[u8]) -> Cow<'_, str> {
    let words = |big: bool| {
        let (pairs, _) = bytes.get(2..).unwrap_or_default().as_chunks::<2>();
        let word = |&pair: &[u8; 2]| if big { u16::from_be_bytes(pair) } else { u16::from_le_bytes(pair) };
        String::from_utf16_lossy(&pairs.iter().map(word).collect::<Vec<u16>>())
    };
    match bytes {
        [0xff, 0xfe, ..] => Cow::Owned(words(false)),
        [0xfe, 0xff, ..] => Cow::Owned(words(true)),
        _ => String::from_utf8_lossy(without_byte_order_mark(bytes)),
    }
}

/// Y unless the file says otherwise.
fn up_axis(root: Element<'_>) -> UpAxis {
    let axis = root.child("asset").and_then(|asset| asset.child("up_axis")).map(|axis| axis.text().trim());
    match axis {
        Some("X_UP") => UpAxis::X,
        Some("Z_UP") => UpAxis::Z,
        _ => UpAxis::Y,
    }
}

struct SceneReader<'d> {
    document: &'d Document<'d>,
    attributes: bool,
    geometries: Geometries,
    materials: Materials<'d>,
    assembly: Assembly,
    /// Geometries that have been read, by element.
    read: HashMap<usize, Rc<Geometry>>,
    /// Material of each symbol, by instance.
    bound: HashMap<usize, Rc<Vec<u32>>>,
    /// References that lead nowhere.
    missing: usize,
}

impl<'d> SceneReader<'d> {
    fn scene(&mut self, root: Element<'d>, warnings: &mut Vec<String>) -> Result<(), Problem> {
        let instance = root.child("scene").and_then(|scene| scene.child("instance_visual_scene"));
        let scene = match instance {
            Some(instance) => instance.target("url"),
            None => self.document.all("visual_scene").next(),
        };
        let Some(scene) = scene else {
            warnings.push("there is no scene: every geometry is read as it is".into());
            for geometry in self.document.all("geometry") {
                self.place(geometry, None, &Affine::IDENTITY)?;
            }
            return Ok(());
        };
        let nodes: Vec<Element<'d>> = self.document.all("node").collect();
        let numbers: HashMap<usize, usize> = nodes.iter().enumerate().map(|(i, node)| (node.index(), i)).collect();
        let transforms = nodes.iter().map(|&node| node::transform(node)).collect::<Result<Vec<_>, _>>()?;
        let mut missing = 0;
        let mut below = |parent: Element<'d>| {
            let mut children = Vec::new();
            for child in parent.children() {
                let target = match child.name() {
                    "node" => Some(child),
                    "instance_node" => child.target("url"),
                    _ => continue,
                };
                match target.and_then(|target| numbers.get(&target.index())) {
                    Some(&node) => {
                        let transform = transforms.get(node).copied().unwrap_or(Affine::IDENTITY);
                        children.push(Child { node, transform });
                    }
                    None => missing += 1,
                }
            }
            children
        };
        let roots = below(scene);
        let children: Vec<Vec<Child>> = nodes.iter().map(|&node| below(node)).collect();
        self.missing += missing;
        let describe = |node: usize| nodes.get(node).map_or_else(|| "node".into(), |node| node.describe());
        let limit = self.geometries.budget.limit();
        walk(&children, &roots, limit, describe, |node, transform| match nodes.get(node) {
            Some(node) => self.instances(*node, transform),
            None => Ok(()),
        })
    }

    /// Places what a node instances.
    fn instances(&mut self, node: Element<'d>, transform: &Affine) -> Result<(), Problem> {
        for instance in node.children() {
            match instance.name() {
                "instance_geometry" => match instance.target("url") {
                    Some(geometry) => self.place(geometry, Some(instance), transform)?,
                    None => self.missing += 1,
                },
                "instance_controller" => self.controller(instance, transform)?,
                _ => {}
            }
        }
        Ok(())
    }

    /// Follows skins and morphs to the geometry that they deform.
    fn controller(&mut self, instance: Element<'d>, transform: &Affine) -> Result<(), Problem> {
        /// A skin of a morph is usual; more is not.
        const MOST_DEFORMERS: usize = 8;
        let mut transform = *transform;
        let mut target = instance.target("url");
        for _ in 0..MOST_DEFORMERS {
            let Some(element) = target else { break };
            if element.name() != "controller" {
                return self.place(element, Some(instance), &transform);
            }
            target = element.children().find(|deformer| matches!(deformer.name(), "skin" | "morph"));
            if let Some(shape) = target.and_then(|deformer| deformer.child("bind_shape_matrix")) {
                transform = transform.after(&node::matrix(shape)?);
            }
            target = target.and_then(|deformer| deformer.target("source"));
        }
        self.missing += 1;
        Ok(())
    }

    fn place(
        &mut self,
        geometry: Element<'d>,
        instance: Option<Element<'d>>,
        transform: &Affine,
    ) -> Result<(), Problem> {
        let read = match self.read.get(&geometry.index()) {
            Some(read) => Rc::clone(read),
            None => {
                let read = Rc::new(self.geometries.read(geometry)?);
                self.read.insert(geometry.index(), Rc::clone(&read));
                read
            }
        };
        if read.part.triangles.is_empty() {
            return Ok(());
        }
        let bound = match instance {
            Some(instance) if self.attributes => match self.bound.get(&instance.index()) {
                Some(bound) => Rc::clone(bound),
                None => {
                    self.geometries.budget.take(&read.part.name, read.symbols.len())?;
                    let bound = Rc::new(self.bind(instance, &read.symbols));
                    self.bound.insert(instance.index(), Rc::clone(&bound));
                    bound
                }
            },
            _ => Rc::new(Vec::new()),
        };
        let material = |symbol: u32| bound.get(symbol as usize).copied().unwrap_or(Mesh::NO_MATERIAL);
        self.assembly.place(&read.part, transform, material).map(|_| ())
    }

    /// The material of each symbol, as an instance binds them; an unbound symbol may itself be a material's id.
    fn bind(&mut self, instance: Element<'d>, symbols: &[String]) -> Vec<u32> {
        let technique = instance.child("bind_material").and_then(|bind| bind.child("technique_common"));
        let bindings: HashMap<Cow<'_, str>, Element<'d>> = technique
            .into_iter()
            .flat_map(|technique| technique.all("instance_material"))
            .filter_map(|bind| Some((bind.attribute("symbol")?, bind.target("target")?)))
            .collect();
        let material = |symbol: &String| {
            let bound = bindings.get(symbol.as_str()).copied().or_else(|| self.document.by_id(symbol));
            bound
                .filter(|bound| bound.name() == "material")
                .and_then(|bound| self.materials.index(bound))
                .unwrap_or(Mesh::NO_MATERIAL)
        };
        symbols.iter().map(material).collect()
    }
}
