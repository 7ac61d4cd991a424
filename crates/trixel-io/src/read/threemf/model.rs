//! One model part of a 3MF package: objects, properties and the build (3MF core specification 1.3, materials extension
//! 1.2, production extension 1.1).

use std::collections::HashMap;
use std::io::BufRead;

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use super::package::part_name;
use crate::numbers::narrow;
use crate::read::Problem;
use crate::read::color::linear;
use crate::read::text::shown;
use crate::read::transform::Affine;

/// What a model part holds.
#[derive(Default)]
pub(super) struct Model {
    pub(super) objects: Vec<Object>,
    pub(super) items: Vec<Reference>,
    pub(super) groups: HashMap<u32, Group>,
    pub(super) textures: HashMap<u32, Texture2d>,
    /// Property groups of kinds that are not read.
    pub(super) unknown_groups: usize,
}

/// A mesh, or other objects put together.
#[derive(Default)]
pub(super) struct Object {
    pub(super) id: u32,
    pub(super) name: String,
    pub(super) positions: Vec<[f64; 3]>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// One a triangle, or none at all.
    pub(super) properties: Vec<Property>,
    pub(super) components: Vec<Reference>,
    /// What triangles without properties of their own have.
    property: Property,
}

impl Object {
    /// The object's name in messages.
    pub(super) fn describe(&self) -> String {
        if self.name.is_empty() { format!("object {}", self.id) } else { format!("object {} ({})", self.id, self.name) }
    }
}

/// An object and where it is placed.
pub(super) struct Reference {
    /// The other part that the object is in.
    pub(super) path: Option<String>,
    pub(super) object: u32,
    pub(super) transform: Affine,
}

/// The property group of a triangle and the entries on its corners.
#[derive(Clone, Copy, Default)]
pub(super) struct Property {
    pub(super) group: Option<u32>,
    pub(super) corners: [u32; 3],
}

/// Properties that triangles choose from.
pub(super) enum Group {
    /// Names and linear colours.
    Base(Vec<(String, [f32; 4])>),
    /// Linear colours.
    Colors(Vec<[f32; 4]>),
    /// A texture and coordinates, `v` up.
    Coordinates {
        /// The id of the `texture2d`.
        texture: u32,
        /// The coordinates.
        values: Vec<[f32; 2]>,
    },
}

/// An image and how it repeats.
pub(super) struct Texture2d {
    pub(super) path: String,
    pub(super) tile: [String; 2],
    pub(super) nearest: bool,
}

/// Extensions that a file may require: what they add is read, or changes no shape.
const SUPPORTED: [&str; 4] = [
    "http://schemas.microsoft.com/3dmanufacturing/core/2015/02",
    "http://schemas.microsoft.com/3dmanufacturing/material/2015/02",
    "http://schemas.microsoft.com/3dmanufacturing/production/2015/06",
    "http://schemas.microsoft.com/3dmanufacturing/trianglesets/2021/07",
];

/// Reads a model part, called `part` in messages.
pub(super) fn read(input: impl BufRead, part: &str, attributes: bool) -> Result<Model, Problem> {
    let mut reader = Reader::from_reader(input);
    let mut parser = Parser { attributes, model: Model::default(), group: 0 };
    let mut open: Vec<Place> = Vec::new();
    let mut buffer = Vec::new();
    let mut seen_model = false;
    loop {
        buffer.clear();
        let event = reader.read_event_into(&mut buffer);
        let located = |what: String| Problem::new(format!("{part}, byte {}", reader.buffer_position()), what);
        let event = event.map_err(|error| located(format!("{error}; the file is damaged")))?;
        match &event {
            Event::Start(element) | Event::Empty(element) => {
                let place = parser.enter(open.last().copied(), element).map_err(located)?;
                seen_model |= matches!(place, Place::Model);
                if matches!(event, Event::Start(_)) {
                    open.push(place);
                } else if matches!(place, Place::Object) {
                    parser.finish_object().map_err(located)?;
                }
            }
            Event::End(_) => {
                if matches!(open.pop(), Some(Place::Object)) {
                    parser.finish_object().map_err(located)?;
                }
            }
            Event::Eof if open.is_empty() && seen_model => return Ok(parser.model),
            Event::Eof if seen_model => return Err(located("the XML ends too soon; the file is cut off".into())),
            Event::Eof => return Err(located("there is no <model> element; the file is no 3MF".into())),
            _ => {}
        }
    }
}

/// Where in the document an element is. Elements of unknown extensions, and all in them, are `Other`: their names may be
/// those of the core.
#[derive(Clone, Copy)]
enum Place {
    Model,
    Resources,
    Build,
    Object,
    Mesh,
    Vertices,
    Triangles,
    Components,
    BaseMaterials,
    ColorGroup,
    TextureGroup,
    Other,
}

struct Parser {
    attributes: bool,
    model: Model,
    /// The property group that is open.
    group: u32,
}

impl Parser {
    fn enter(&mut self, parent: Option<Place>, element: &BytesStart<'_>) -> Result<Place, String> {
        let name = element.local_name();
        match (parent, name.as_ref()) {
            (Some(Place::Vertices), "vertex") => self.vertex(element)?,
            (Some(Place::Triangles), "triangle") => self.triangle(element)?,
            (None, "model") => {
                check_required(element)?;
                return Ok(Place::Model);
            }
            (Some(Place::Model), "resources") => return Ok(Place::Resources),
            (Some(Place::Model), "build") => return Ok(Place::Build),
            (Some(Place::Resources), "object") => {
                self.object(element)?;
                return Ok(Place::Object);
            }
            (Some(Place::Object), "mesh") => return Ok(Place::Mesh),
            (Some(Place::Object), "components") => return Ok(Place::Components),
            (Some(Place::Mesh), "vertices") => return Ok(Place::Vertices),
            (Some(Place::Mesh), "triangles") => return Ok(Place::Triangles),
            (Some(Place::Components), "component") => {
                let component = reference(element)?;
                if let Some(object) = self.model.objects.last_mut() {
                    object.components.push(component);
                }
            }
            (Some(Place::Build), "item") => self.model.items.push(reference(element)?),
            (Some(place), name) if self.attributes => return self.property(place, name, element),
            _ => {}
        }
        Ok(Place::Other)
    }

    fn vertex(&mut self, element: &BytesStart<'_>) -> Result<(), String> {
        let mut position = [None; 3];
        each_attribute(element, |name, value| {
            let axis = match name {
                "x" => 0,
                "y" => 1,
                "z" => 2,
                _ => return Ok(()),
            };
            position[axis] = Some(number(value)?);
            Ok(())
        })?;
        let [Some(x), Some(y), Some(z)] = position else {
            return Err("a vertex lacks x, y or z; the file is damaged".into());
        };
        if let Some(object) = self.model.objects.last_mut() {
            object.positions.push([x, y, z]);
        }
        Ok(())
    }

    fn triangle(&mut self, element: &BytesStart<'_>) -> Result<(), String> {
        let mut vertices = [None; 3];
        let (mut group, mut corners) = (None, [None; 3]);
        let attributes = self.attributes;
        each_attribute(element, |name, value| {
            match name {
                "v1" => vertices[0] = Some(index(value)?),
                "v2" => vertices[1] = Some(index(value)?),
                "v3" => vertices[2] = Some(index(value)?),
                _ if !attributes => {}
                "pid" => group = Some(index(value)?),
                "p1" => corners[0] = Some(index(value)?),
                "p2" => corners[1] = Some(index(value)?),
                "p3" => corners[2] = Some(index(value)?),
                _ => {}
            }
            Ok(())
        })?;
        let [Some(a), Some(b), Some(c)] = vertices else {
            return Err("a triangle lacks v1, v2 or v3; the file is damaged".into());
        };
        let Some(object) = self.model.objects.last_mut() else { return Ok(()) };
        object.triangles.push([a, b, c]);
        let default = object.property;
        if group.is_some() || default.group.is_some() || !object.properties.is_empty() {
            object.properties.resize(object.triangles.len() - 1, Property::default());
            let first = corners[0].unwrap_or(default.corners[0]);
            object.properties.push(Property {
                group: group.or(default.group),
                corners: [first, corners[1].unwrap_or(first), corners[2].unwrap_or(first)],
            });
        }
        Ok(())
    }

    fn object(&mut self, element: &BytesStart<'_>) -> Result<(), String> {
        let mut id = None;
        let mut object = Object::default();
        let attributes = self.attributes;
        each_attribute(element, |name, value| {
            match name {
                "id" => id = Some(index(value)?),
                "name" => object.name = value.to_owned(),
                "pid" if attributes => object.property.group = Some(index(value)?),
                "pindex" if attributes => object.property.corners = [index(value)?; 3],
                _ => {}
            }
            Ok(())
        })?;
        object.id = id.ok_or("an object has no id; the file is damaged")?;
        self.model.objects.push(object);
        Ok(())
    }

    fn finish_object(&self) -> Result<(), String> {
        let Some(object) = self.model.objects.last() else { return Ok(()) };
        let vertices = object.positions.len();
        for (i, triangle) in object.triangles.iter().enumerate() {
            if let Some(vertex) = triangle.iter().find(|&&v| v as usize >= vertices) {
                return Err(format!(
                    "{}: triangle {i} names vertex {vertex}, but there are only {vertices}; the file is damaged",
                    object.describe()
                ));
            }
        }
        Ok(())
    }

    fn property(&mut self, parent: Place, name: &str, element: &BytesStart<'_>) -> Result<Place, String> {
        let model = &mut self.model;
        match (parent, name) {
            (Place::Resources, "basematerials" | "colorgroup" | "texture2dgroup") => {
                let (mut id, mut texture) = (None, None);
                each_attribute(element, |name, value| {
                    match name {
                        "id" => id = Some(index(value)?),
                        "texid" => texture = Some(index(value)?),
                        _ => {}
                    }
                    Ok(())
                })?;
                self.group = id.ok_or_else(|| format!("<{name}> has no id; the file is damaged"))?;
                let (group, place) = match name {
                    "basematerials" => (Group::Base(Vec::new()), Place::BaseMaterials),
                    "colorgroup" => (Group::Colors(Vec::new()), Place::ColorGroup),
                    _ => {
                        let texture = texture.ok_or("<texture2dgroup> has no texid; the file is damaged")?;
                        (Group::Coordinates { texture, values: Vec::new() }, Place::TextureGroup)
                    }
                };
                model.groups.insert(self.group, group);
                Ok(place)
            }
            (Place::Resources, "compositematerials" | "multiproperties" | "pbspecular" | "pbmetallic") => {
                model.unknown_groups += 1;
                Ok(Place::Other)
            }
            (Place::Resources, "texture2d") => {
                let mut id = None;
                let mut texture = Texture2d { path: String::new(), tile: Default::default(), nearest: false };
                each_attribute(element, |name, value| {
                    match name {
                        "id" => id = Some(index(value)?),
                        "path" => texture.path = part_name(value),
                        "tilestyleu" => texture.tile[0] = value.to_owned(),
                        "tilestylev" => texture.tile[1] = value.to_owned(),
                        "filter" => texture.nearest = value == "nearest",
                        _ => {}
                    }
                    Ok(())
                })?;
                model.textures.insert(id.ok_or("a <texture2d> has no id; the file is damaged")?, texture);
                Ok(Place::Other)
            }
            (Place::BaseMaterials | Place::ColorGroup | Place::TextureGroup, _) => {
                let mut label = String::new();
                let mut rgba = [1.0; 4];
                let mut uv = [0.0; 2];
                each_attribute(element, |name, value| {
                    match name {
                        "name" => label = value.to_owned(),
                        "displaycolor" | "color" => rgba = color(value)?,
                        "u" => uv[0] = coordinate(value)?,
                        "v" => uv[1] = coordinate(value)?,
                        _ => {}
                    }
                    Ok(())
                })?;
                match (model.groups.get_mut(&self.group), name) {
                    (Some(Group::Base(values)), "base") => values.push((label, rgba)),
                    (Some(Group::Colors(values)), "color") => values.push(rgba),
                    (Some(Group::Coordinates { values, .. }), "tex2coord") => values.push(uv),
                    _ => {}
                }
                Ok(Place::Other)
            }
            _ => Ok(Place::Other),
        }
    }
}

/// Refuses a file that requires an extension that is not supported.
fn check_required(element: &BytesStart<'_>) -> Result<(), String> {
    let mut required = String::new();
    let mut namespaces: Vec<(String, String)> = Vec::new();
    each_attribute_with_prefix(element, |prefix, name, value| {
        match (prefix, name) {
            (Some("xmlns"), prefix) => namespaces.push((prefix.to_owned(), value.to_owned())),
            (None, "requiredextensions") => required = value.to_owned(),
            _ => {}
        }
        Ok(())
    })?;
    for prefix in required.split_ascii_whitespace() {
        let namespace = namespaces.iter().find(|(known, _)| known == prefix).map_or(prefix, |(_, uri)| uri);
        if !SUPPORTED.contains(&namespace) {
            return Err(format!(
                "the file requires the extension '{prefix}' ({namespace}), which is not supported; export the file \
                 without it"
            ));
        }
    }
    Ok(())
}

/// The object, transform and part of a component or build item.
fn reference(element: &BytesStart<'_>) -> Result<Reference, String> {
    let mut object = None;
    let mut reference = Reference { path: None, object: 0, transform: Affine::IDENTITY };
    each_attribute_with_prefix(element, |prefix, name, value| {
        match (prefix, name) {
            (None, "objectid") => object = Some(index(value)?),
            (None, "transform") => reference.transform = matrix(value)?,
            (Some(_), "path") => reference.path = Some(part_name(value)),
            _ => {}
        }
        Ok(())
    })?;
    reference.object = object.ok_or("a component or build item has no objectid; the file is damaged")?;
    Ok(reference)
}

/// The 4x3 matrix of 3MF, row by row, for row vectors: its rows are the columns here.
fn matrix(text: &str) -> Result<Affine, String> {
    let mut map = Affine::IDENTITY;
    let mut count = 0;
    for (i, token) in text.split_ascii_whitespace().enumerate() {
        count += 1;
        if let Some(row) = map.0.get_mut(i % 3)
            && let Some(entry) = row.get_mut(i / 3)
        {
            *entry = number(token)?;
        }
    }
    if count != 12 {
        return Err(format!("a transform has {count} numbers where 12 are needed; the file is damaged"));
    }
    Ok(map)
}

/// Calls `use_it` with each attribute that has no prefix.
fn each_attribute(
    element: &BytesStart<'_>,
    mut use_it: impl FnMut(&str, &str) -> Result<(), String>,
) -> Result<(), String> {
    for attribute in element.attributes().with_checks(false) {
        let attribute = attribute.map_err(|error| format!("{error}; the file is damaged"))?;
        if attribute.value.contains('&') {
            use_it(attribute.key.0, &unescaped(&attribute.value)?)?;
        } else {
            use_it(attribute.key.0, &attribute.value)?;
        }
    }
    Ok(())
}

fn each_attribute_with_prefix(
    element: &BytesStart<'_>,
    mut use_it: impl FnMut(Option<&str>, &str, &str) -> Result<(), String>,
) -> Result<(), String> {
    each_attribute(element, |name, value| match name.split_once(':') {
        Some((prefix, name)) => use_it(Some(prefix), name, value),
        None => use_it(None, name, value),
    })
}

fn unescaped(value: &str) -> Result<std::borrow::Cow<'_, str>, String> {
    quick_xml::escape::unescape(value).map_err(|error| format!("{error}; the file is damaged"))
}

fn number(text: &str) -> Result<f64, String> {
    text.trim().parse().map_err(|_| format!("'{}' is not a number; the file is damaged", shown(text.as_bytes())))
}

fn coordinate(text: &str) -> Result<f32, String> {
    number(text).map(narrow)
}

fn index(text: &str) -> Result<u32, String> {
    text.trim().parse().map_err(|_| format!("'{}' is not an index; the file is damaged", shown(text.as_bytes())))
}

/// `#RRGGBB` or `#RRGGBBAA`, sRGB.
fn color(text: &str) -> Result<[f32; 4], String> {
    let bad = || format!("'{}' is not a colour of the form #RRGGBB or #RRGGBBAA", shown(text.as_bytes()));
    let digits = text.trim().strip_prefix('#').ok_or_else(bad)?;
    if !matches!(digits.len(), 6 | 8) || !digits.is_ascii() {
        return Err(bad());
    }
    let mut rgba = [1.0; 4];
    for (channel, pair) in rgba.iter_mut().zip(digits.as_bytes().chunks(2)) {
        let pair = std::str::from_utf8(pair).map_err(|_| bad())?;
        *channel = f32::from(u8::from_str_radix(pair, 16).map_err(|_| bad())?) / 255.0;
    }
    Ok(linear(rgba))
}
