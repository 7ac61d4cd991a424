//! 3MF (3MF Consortium): the objects that the build places, in the file's unit.
//!
//! The package is read with `zip` and its parts with `quick-xml`, as they expand; coordinates are decimals and read as
//! `f64`. Objects that the build does not reach (supports, alternatives) are left out.

mod model;
mod package;
#[cfg(test)]
mod tests;

use std::collections::HashMap;

use trixel::{Attribute, Filter, Image, ImageSource, Material, Mesh, Texture, TextureRef, UpAxis, Wrap};

use self::model::{Group, Model, Object, Property, Reference};
use self::package::Package;
use super::assemble::{Assembly, Budget, CornerAttribute, Part};
use super::instances::{Child, walk};
use super::{Loaded, Problem, ReadOptions, Resources};

/// Reads 3MF. Everything is in the package, so the resources beside it are not asked.
pub(super) fn read(bytes: &[u8], options: &ReadOptions, _: &dyn Resources) -> Result<Loaded, Problem> {
    let mut package = Package::open(bytes)?;
    let root = package.root_model()?;
    let parts = load_parts(&mut package, &root, options.attributes)?;
    let mut warnings = Vec::new();

    // Number the objects of all parts, then turn references into those numbers.
    let mut numbers: HashMap<(&str, u32), usize> = HashMap::new();
    let mut objects: Vec<(usize, &Object)> = Vec::new();
    for (part, (name, model)) in parts.iter().enumerate() {
        for object in &model.objects {
            if numbers.insert((name, object.id), objects.len()).is_some() {
                return Err(Problem::new(name, format!("defines object {} twice; the file is damaged", object.id)));
            }
            objects.push((part, object));
        }
    }
    let resolve = |from: &str, reference: &Reference| {
        let part = reference.path.as_deref().unwrap_or(from);
        match numbers.get(&(part, reference.object)) {
            Some(&node) => Ok(Child { node, transform: reference.transform }),
            None => Err(Problem::new(
                from,
                format!("object {} of {part} does not exist, but is used; the file is damaged", reference.object),
            )),
        }
    };
    let name_of = |part: usize| parts.get(part).map_or("", |(name, _)| name.as_str());
    let mut children = Vec::with_capacity(objects.len());
    for &(part, object) in &objects {
        let components = object.components.iter().map(|component| resolve(name_of(part), component));
        children.push(components.collect::<Result<Vec<_>, _>>()?);
    }
    let items = parts.first().map_or(&[][..], |(_, model)| &model.items);
    let mut roots = items.iter().map(|item| resolve(&root, item)).collect::<Result<Vec<_>, _>>()?;
    if roots.is_empty() && !objects.is_empty() {
        warnings.push("the build is empty: every object is read where it lies".into());
        let alone = |&node: &usize| objects.get(node).is_some_and(|(_, object)| object.components.is_empty());
        let place = |node| Child { node, transform: super::transform::Affine::IDENTITY };
        roots = (0..objects.len()).filter(alone).map(place).collect();
    }

    let budget = Budget::for_bytes(package.expanded());
    let mut assembly = Assembly::new(budget);
    let mut properties = Properties { parts: &parts, ..Properties::default() };
    let mut made: Vec<Option<Part>> = Vec::new();
    made.resize_with(objects.len(), || None);
    let describe = |node: usize| objects.get(node).map_or_else(|| format!("object {node}"), |(_, o)| o.describe());
    walk(&children, &roots, budget.limit(), describe, |node, transform| {
        let (Some(&(part, object)), Some(made)) = (objects.get(node), made.get_mut(node)) else { return Ok(()) };
        let made = made.get_or_insert_with(|| properties.part(part, object));
        assembly.place(made, transform, |material| material).map(|_| ())
    })?;

    let mut mesh = assembly.finish();
    mesh.up = Some(UpAxis::Z);
    if options.attributes {
        properties.fill(&mut mesh, &mut package, &mut warnings);
    }
    let unknown: usize = parts.iter().map(|(_, model)| model.unknown_groups).sum();
    if unknown > 0 {
        warnings.push(format!("{unknown} groups of composite materials or multiple properties are not read"));
    }
    Ok(Loaded { mesh, warnings })
}

/// The root part and every part that is referred to from it, by name, the root first.
fn load_parts(package: &mut Package<'_>, root: &str, attributes: bool) -> Result<Vec<(String, Model)>, Problem> {
    let mut parts: Vec<(String, Model)> = Vec::new();
    let mut known: HashMap<String, ()> = HashMap::from([(root.to_owned(), ())]);
    let mut pending = vec![root.to_owned()];
    while let Some(name) = pending.pop() {
        let model = model::read(package.part(&name)?, &name, attributes)?;
        let components = model.objects.iter().flat_map(|object| &object.components);
        for path in model.items.iter().chain(components).filter_map(|reference| reference.path.as_ref()) {
            if known.insert(path.clone(), ()).is_none() {
                pending.push(path.clone());
            }
        }
        parts.push((name, model));
    }
    Ok(parts)
}

/// Turns the properties of triangles into materials, colours and texture coordinates.
#[derive(Default)]
struct Properties<'a> {
    parts: &'a [(String, Model)],
    materials: Vec<Material>,
    /// Texture of each material that has one: the part and the id of the `texture2d`.
    textured: Vec<(usize, usize, u32)>,
    /// Index of the material of each entry of each group that a triangle has used.
    known: HashMap<(usize, u32, u32), u32>,
    /// Triangles whose property does not exist.
    missing: usize,
}

impl Properties<'_> {
    fn part(&mut self, part: usize, object: &Object) -> Part {
        let mut out = Part {
            name: object.describe(),
            positions: object.positions.clone(),
            triangles: object.triangles.clone(),
            ..Part::default()
        };
        let Some((_, model)) = self.parts.get(part) else { return out };
        let mut colors = Corners::default();
        let mut uvs = Corners::default();
        for (triangle, property) in object.properties.iter().enumerate() {
            let Property { group: Some(id), corners } = *property else { continue };
            let found = match model.groups.get(&id) {
                Some(Group::Base(values)) => {
                    let entry = corners[0];
                    values.get(entry as usize).map(|(name, color)| {
                        let material = self.material(part, id, entry, || Material {
                            name: name.clone(),
                            base_color: *color,
                            ..Material::default()
                        });
                        out.materials.resize(triangle, Mesh::NO_MATERIAL);
                        out.materials.push(material);
                    })
                }
                Some(Group::Colors(values)) => colors.add(triangle, id, corners, |i| values.get(i).copied()),
                Some(Group::Coordinates { texture, values }) => {
                    // v points up in 3MF and down in a mesh.
                    let flipped = |i: usize| values.get(i).map(|&[u, v]| [u, 1.0 - v]);
                    uvs.add(triangle, id, corners, flipped).map(|()| {
                        let before = self.materials.len();
                        let material = self.material(part, id, 0, Material::default);
                        if self.materials.len() > before {
                            self.textured.push((before, part, *texture));
                        }
                        out.materials.resize(triangle, Mesh::NO_MATERIAL);
                        out.materials.push(material);
                    })
                }
                None => None,
            };
            if found.is_none() {
                self.missing += 1;
            }
        }
        if !out.materials.is_empty() {
            out.materials.resize(out.triangles.len(), Mesh::NO_MATERIAL);
        }
        out.colors = colors.attribute.finish(out.triangles.len());
        if let Some(uvs) = uvs.attribute.finish(out.triangles.len()) {
            out.uvs.push(Some(uvs));
        }
        out
    }

    fn material(&mut self, part: usize, group: u32, entry: u32, make: impl FnOnce() -> Material) -> u32 {
        *self.known.entry((part, group, entry)).or_insert_with(|| {
            self.materials.push(make());
            u32::try_from(self.materials.len() - 1).unwrap_or(Mesh::NO_MATERIAL)
        })
    }

    /// Gives the mesh its materials, with their textures and images.
    fn fill(mut self, mesh: &mut Mesh, package: &mut Package<'_>, warnings: &mut Vec<String>) {
        let mut images: HashMap<&str, Option<u32>> = HashMap::new();
        for &(material, part, id) in &self.textured {
            let Some(texture) = self.parts.get(part).and_then(|(_, model)| model.textures.get(&id)) else {
                warnings.push(format!("texture {id} does not exist, but is used"));
                continue;
            };
            let image = *images.entry(&texture.path).or_insert_with(|| match package.bytes(&texture.path) {
                Ok(bytes) => {
                    mesh.images.push(Image { name: texture.path.clone(), source: ImageSource::Encoded(bytes) });
                    u32::try_from(mesh.images.len() - 1).ok()
                }
                Err(problem) => {
                    warnings.push(format!("{problem}; its texture is left out"));
                    None
                }
            });
            let Some(image) = image else { continue };
            let wrap = |style: &String| match style.as_str() {
                "mirror" => Wrap::Mirror,
                "clamp" | "none" => Wrap::Clamp,
                _ => Wrap::Repeat,
            };
            mesh.textures.push(Texture {
                image,
                wrap: [wrap(&texture.tile[0]), wrap(&texture.tile[1])],
                filter: if texture.nearest { Filter::Nearest } else { Filter::Linear },
                mipmaps: !texture.nearest,
            });
            let index = u32::try_from(mesh.textures.len() - 1).ok();
            if let Some(material) = self.materials.get_mut(material) {
                material.base_color_texture = index.map(TextureRef::new);
            }
        }
        if self.missing > 0 {
            warnings.push(format!("{} triangles name properties that do not exist", self.missing));
        }
        mesh.materials = self.materials;
    }
}

/// Gathers values on corners, each entry of a group once.
struct Corners<T> {
    attribute: CornerAttribute<T>,
    known: HashMap<(u32, u32), u32>,
}

impl<T> Default for Corners<T> {
    fn default() -> Self {
        Self { attribute: CornerAttribute::default(), known: HashMap::new() }
    }
}

impl<T: Copy> Corners<T> {
    fn add(
        &mut self,
        triangle: usize,
        group: u32,
        entries: [u32; 3],
        value: impl Fn(usize) -> Option<T>,
    ) -> Option<()> {
        let mut corners = [Attribute::<T>::NONE; 3];
        for (corner, entry) in corners.iter_mut().zip(entries) {
            *corner = match self.known.get(&(group, entry)) {
                Some(&known) => known,
                None => {
                    let values = &mut self.attribute.values;
                    let index = u32::try_from(values.len()).ok()?;
                    values.push(value(entry as usize)?);
                    self.known.insert((group, entry), index);
                    index
                }
            };
        }
        self.attribute.push(triangle, corners);
        Some(())
    }
}
