//! COLLADA geometry as parts: sources, `vertices`, and every primitive that has an area (COLLADA 1.4.1, chapter 5, and
//! 1.5.0).

use std::collections::HashMap;
use std::rc::Rc;

use trixel::Mesh;

use crate::numbers::narrow;
use crate::read::Problem;
use crate::read::assemble::{Budget, CornerAttribute, Part};
use crate::read::color::linear;
use crate::read::polygon::triangulate_corners;
use crate::xml::Element;

/// Sets of texture coordinates that are read.
const MOST_UV_SETS: usize = 4;

/// A geometry, its triangles' materials given as indices into `symbols`.
pub(super) struct Geometry {
    pub(super) part: Part,
    pub(super) symbols: Vec<String>,
}

/// Decodes geometries, and counts what it leaves out.
pub(super) struct Geometries {
    pub(super) attributes: bool,
    pub(super) budget: Budget,
    arrays: HashMap<usize, Rc<Vec<f64>>>,
    lines: usize,
    holes: usize,
    splines: usize,
}

impl Geometries {
    pub(super) fn new(attributes: bool, budget: Budget) -> Self {
        Self { attributes, budget, arrays: HashMap::new(), lines: 0, holes: 0, splines: 0 }
    }

    /// What was left out, one sentence each.
    pub(super) fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        if self.lines > 0 {
            warnings.push(format!("{} elements of lines skipped", self.lines));
        }
        if self.holes > 0 {
            warnings.push(format!("{} holes in polygons were filled", self.holes));
        }
        if self.splines > 0 {
            warnings.push(format!("{} geometries that are no meshes (splines, breps) skipped", self.splines));
        }
        warnings
    }

    /// Reads a `<geometry>`.
    pub(super) fn read(&mut self, geometry: Element<'_>) -> Result<Geometry, Problem> {
        let mut builder = Builder::new(geometry.describe());
        let Some(mesh) = geometry.child("mesh").or_else(|| geometry.child("convex_mesh")) else {
            self.splines += 1;
            return Ok(builder.finish());
        };
        for primitive in mesh.children() {
            match primitive.name() {
                "triangles" | "trifans" | "tristrips" | "polylist" | "polygons" => {
                    self.primitive(primitive, &mut builder)?;
                }
                "lines" | "linestrips" => self.lines += 1,
                _ => {}
            }
        }
        Ok(builder.finish())
    }

    fn primitive(&mut self, primitive: Element<'_>, builder: &mut Builder) -> Result<(), Problem> {
        let Some(corners) = self.inputs(primitive, builder)? else { return Ok(()) };
        builder.begin(primitive.attribute("material").as_deref(), self.attributes);
        let mut polygon = Vec::new();
        let mut triangles = Vec::new();
        let mut lists: Vec<Element<'_>> = Vec::new();
        for child in primitive.children() {
            match child.name() {
                "p" => lists.push(child),
                "ph" => {
                    self.holes += child.all("h").count();
                    lists.extend(child.child("p"));
                }
                _ => {}
            }
        }
        let counts = match primitive.child("vcount") {
            Some(counts) if primitive.name() == "polylist" => counts.indices()?,
            _ => Vec::new(),
        };
        let mut counts = counts.into_iter();
        for list in lists {
            let indices = list.indices()?;
            let corner_count = indices.len() / corners.stride;
            self.budget.take(&builder.part.name, corner_count)?;
            let list = List { element: list, indices: &indices, corners: &corners };
            match primitive.name() {
                "triangles" => {
                    for first in (0..corner_count - corner_count % 3).step_by(3) {
                        builder.triangle(&list, [first, first + 1, first + 2])?;
                    }
                }
                "tristrips" => {
                    for first in 0..corner_count.saturating_sub(2) {
                        let odd = first % 2;
                        builder.strip_triangle(&list, [first, first + 1 + odd, first + 2 - odd])?;
                    }
                }
                "trifans" => {
                    for second in 1..corner_count.saturating_sub(1) {
                        builder.strip_triangle(&list, [0, second, second + 1])?;
                    }
                }
                shape => {
                    let mut first = 0;
                    while first < corner_count {
                        let count = if shape == "polylist" {
                            match counts.next() {
                                Some(count) => count as usize,
                                None => break,
                            }
                        } else {
                            corner_count
                        };
                        if count > corner_count - first {
                            return Err(primitive.problem(format!(
                                "a polygon of {count} corners is listed, but only {} are left; the file is damaged",
                                corner_count - first
                            )));
                        }
                        polygon.clear();
                        triangles.clear();
                        for corner in first..first + count {
                            polygon.push(builder.vertex(&list, corner)?);
                        }
                        triangulate_corners(&builder.part.positions, &polygon, &mut triangles);
                        for triangle in &triangles {
                            builder.triangle(&list, triangle.map(|corner| first + corner as usize))?;
                        }
                        first += count;
                    }
                }
            }
        }
        if primitive.name() == "polylist" && counts.any(|count| count > 0) {
            return Err(primitive.problem("lists more polygons than it has corners for; the file is damaged"));
        }
        Ok(())
    }

    /// Resolves the inputs of a primitive and adds their sources to the part; `None` without positions.
    fn inputs(&mut self, primitive: Element<'_>, builder: &mut Builder) -> Result<Option<Corners>, Problem> {
        let mut stride = 1;
        let mut inputs = Vec::new();
        for input in primitive.all("input") {
            let offset = input.integer("offset", 0)?;
            stride = stride.max(offset.saturating_add(1));
            let semantic = input.attribute("semantic").unwrap_or_default().into_owned();
            inputs.push((semantic, input, offset, input.integer("set", 0)?));
        }
        let Some(at) = inputs.iter().position(|(semantic, ..)| semantic == "VERTEX") else { return Ok(None) };
        let (_, vertex, vertex_offset, _) = inputs.swap_remove(at);
        let vertices = target(vertex)?;
        let mut position = None;
        for input in vertices.all("input") {
            match input.attribute("semantic").as_deref() {
                Some("POSITION") => position = Some(input),
                Some(semantic) => {
                    inputs.push((semantic.to_owned(), input, vertex_offset, input.integer("set", 0)?));
                }
                None => {}
            }
        }
        let Some(position) = position else {
            return Err(vertices.problem("has no input with the semantic POSITION; the file is damaged"));
        };
        let position = target(position)?;
        let positions = match builder.positions.get(&position.index()) {
            Some(&known) => known,
            None => {
                let (values, components) = self.vectors::<3>(position)?;
                if components < 3 {
                    return Err(position.problem(format!("holds positions of {components} components; 3 are needed")));
                }
                let span = Span::new(builder.part.positions.len(), values.len());
                builder.part.positions.extend(values);
                builder.positions.insert(position.index(), span);
                span
            }
        };
        let mut corners =
            Corners { stride, vertex: (vertex_offset, positions), normal: None, color: None, uvs: vec![] };
        if !self.attributes {
            return Ok(Some(corners));
        }
        inputs.sort_by_key(|&(_, _, _, set)| set);
        for (semantic, input, offset, _) in inputs {
            match semantic.as_str() {
                "NORMAL" if corners.normal.is_none() => {
                    let span = self.layer(&mut builder.normals, target(input)?, |n: [f64; 3], _| n.map(narrow))?;
                    corners.normal = Some((offset, span));
                }
                "COLOR" if corners.color.is_none() => {
                    // Authoring tools write what the screen shows, which is sRGB.
                    let color = |c: [f64; 4], components| {
                        let [r, g, b, a] = c.map(narrow);
                        linear([r, g, b, if components < 4 { 1.0 } else { a }])
                    };
                    let span = self.layer(&mut builder.colors, target(input)?, color)?;
                    corners.color = Some((offset, span));
                }
                "TEXCOORD" if corners.uvs.len() < MOST_UV_SETS => {
                    if builder.uvs.len() <= corners.uvs.len() {
                        builder.uvs.push(Layer::default());
                    }
                    let Some(layer) = builder.uvs.get_mut(corners.uvs.len()) else { continue };
                    // v points up in COLLADA and down in a mesh.
                    let flipped = |[u, v]: [f64; 2], _| [narrow(u), narrow(1.0 - v)];
                    corners.uvs.push((offset, self.layer(layer, target(input)?, flipped)?));
                }
                _ => {}
            }
        }
        Ok(Some(corners))
    }

    fn layer<const N: usize, T>(
        &mut self,
        layer: &mut Layer<T>,
        source: Element<'_>,
        convert: impl Fn([f64; N], usize) -> T,
    ) -> Result<Span, Problem> {
        if let Some(&span) = layer.sources.get(&source.index()) {
            return Ok(span);
        }
        let (values, components) = self.vectors::<N>(source)?;
        let gathered = &mut layer.attribute.values;
        let span = Span::new(gathered.len(), values.len());
        gathered.extend(values.into_iter().map(|value| convert(value, components)));
        layer.sources.insert(source.index(), span);
        Ok(span)
    }

    /// The first `N` named components of a source's elements, and how many it has.
    fn vectors<const N: usize>(&mut self, source: Element<'_>) -> Result<(Vec<[f64; N]>, usize), Problem> {
        let accessor = source.child("technique_common").and_then(|technique| technique.child("accessor"));
        let array = match accessor {
            Some(accessor) => accessor.target("source").or_else(|| source.child("float_array")),
            None => source.child("float_array"),
        };
        let Some(array) = array else {
            return Err(source.problem("has no array of numbers; the file is damaged"));
        };
        let numbers = match self.arrays.get(&array.index()) {
            Some(numbers) => Rc::clone(numbers),
            None => {
                let numbers = Rc::new(array.numbers()?);
                self.arrays.insert(array.index(), Rc::clone(&numbers));
                numbers
            }
        };
        let (mut offset, mut stride, mut count) = (0, N, None);
        let mut places: Vec<usize> = Vec::new();
        let mut components = 0;
        if let Some(accessor) = accessor {
            offset = accessor.integer("offset", 0)?;
            stride = accessor.integer("stride", 1)?;
            if accessor.attribute("count").is_some() {
                count = Some(accessor.integer("count", 0)?);
            }
            // A parameter without a name is a number to skip.
            for (place, param) in accessor.all("param").enumerate() {
                if param.attribute("name").is_some_and(|name| !name.is_empty()) {
                    components += 1;
                    if places.len() < N {
                        places.push(place);
                    }
                }
            }
        }
        if places.is_empty() {
            components = stride;
            places = (0..N.min(stride)).collect();
        }
        let size = places.last().map_or(0, |&last| last + 1);
        if stride == 0 || size > stride {
            return Err(source.problem(format!("has elements of {size} numbers with a stride of {stride}")));
        }
        let Some(values) = numbers.get(offset..) else {
            return Err(source.problem(format!("starts at number {offset} of {}; the file is damaged", numbers.len())));
        };
        let available = if values.len() < size { 0 } else { (values.len() - size) / stride + 1 };
        let count = count.unwrap_or(available);
        if count > available {
            return Err(source.problem(format!(
                "should have {count} elements, but its array has room for {available}; the file is cut off or damaged"
            )));
        }
        self.budget.take(&source.describe(), count)?;
        let element = |chunk: &[f64]| {
            std::array::from_fn(|i| places.get(i).and_then(|&place| chunk.get(place)).copied().unwrap_or(0.0))
        };
        Ok((values.chunks(stride).take(count).map(element).collect(), components))
    }
}

fn target(input: Element<'_>) -> Result<Element<'_>, Problem> {
    input.target("source").ok_or_else(|| {
        let source = input.attribute("source").unwrap_or_default().into_owned();
        input.problem(format!("refers to '{source}', which does not exist in this file; the file is damaged"))
    })
}

/// Where the values of a source lie in a part.
#[derive(Clone, Copy)]
struct Span {
    first: u32,
    count: u32,
}

impl Span {
    fn new(first: usize, count: usize) -> Self {
        Self { first: u32::try_from(first).unwrap_or(u32::MAX), count: u32::try_from(count).unwrap_or(0) }
    }

    fn index(self, index: u32) -> Option<u32> {
        (index < self.count).then(|| self.first + index)
    }
}

/// How the indices of one corner are to be read: the place of each input among them, and its values.
struct Corners {
    stride: usize,
    vertex: (usize, Span),
    normal: Option<(usize, Span)>,
    color: Option<(usize, Span)>,
    uvs: Vec<(usize, Span)>,
}

/// The indices of one `<p>`.
struct List<'l> {
    element: Element<'l>,
    indices: &'l [u32],
    corners: &'l Corners,
}

impl List<'_> {
    fn value(&self, input: Option<&(usize, Span)>, corner: usize) -> u32 {
        let found =
            input.and_then(|&(offset, span)| span.index(*self.indices.get(corner * self.corners.stride + offset)?));
        found.unwrap_or(u32::MAX)
    }
}

/// Values on corners, gathered from sources.
struct Layer<T> {
    attribute: CornerAttribute<T>,
    sources: HashMap<usize, Span>,
}

impl<T> Default for Layer<T> {
    fn default() -> Self {
        Self { attribute: CornerAttribute::default(), sources: HashMap::new() }
    }
}

/// A part that grows by one primitive after the other.
struct Builder {
    part: Part,
    symbols: Vec<String>,
    known_symbols: HashMap<String, usize>,
    symbol: Option<u32>,
    positions: HashMap<usize, Span>,
    normals: Layer<[f32; 3]>,
    colors: Layer<[f32; 4]>,
    uvs: Vec<Layer<[f32; 2]>>,
}

impl Builder {
    fn new(name: String) -> Self {
        Self {
            part: Part { name, ..Part::default() },
            symbols: Vec::new(),
            known_symbols: HashMap::new(),
            symbol: None,
            positions: HashMap::new(),
            normals: Layer::default(),
            colors: Layer::default(),
            uvs: Vec::new(),
        }
    }

    /// Starts a primitive with the material that is bound to `symbol`.
    fn begin(&mut self, symbol: Option<&str>, attributes: bool) {
        self.symbol = symbol.filter(|_| attributes).and_then(|symbol| {
            let next = self.symbols.len();
            let known = *self.known_symbols.entry(symbol.to_owned()).or_insert(next);
            if known == next {
                self.symbols.push(symbol.to_owned());
            }
            u32::try_from(known).ok()
        });
    }

    fn vertex(&self, list: &List<'_>, corner: usize) -> Result<u32, Problem> {
        let vertex = list.value(Some(&list.corners.vertex), corner);
        if vertex == u32::MAX {
            return Err(list.element.problem(format!(
                "corner {corner} of {} names a vertex that does not exist: there are {}; the file is damaged",
                self.part.name, list.corners.vertex.1.count
            )));
        }
        Ok(vertex)
    }

    fn triangle(&mut self, list: &List<'_>, corners: [usize; 3]) -> Result<(), Problem> {
        let [a, b, c] = corners;
        let vertices = [self.vertex(list, a)?, self.vertex(list, b)?, self.vertex(list, c)?];
        let triangle = self.part.triangles.len();
        self.part.triangles.push(vertices);
        let values = |input: Option<&(usize, Span)>| corners.map(|corner| list.value(input, corner));
        self.normals.attribute.push(triangle, values(list.corners.normal.as_ref()));
        self.colors.attribute.push(triangle, values(list.corners.color.as_ref()));
        for (layer, input) in self.uvs.iter_mut().zip(&list.corners.uvs) {
            layer.attribute.push(triangle, values(Some(input)));
        }
        if let Some(symbol) = self.symbol {
            self.part.materials.resize(triangle, Mesh::NO_MATERIAL);
            self.part.materials.push(symbol);
        }
        Ok(())
    }

    /// A triangle of a strip or fan; one that repeats a vertex only stitches pieces together and is no surface.
    fn strip_triangle(&mut self, list: &List<'_>, corners: [usize; 3]) -> Result<(), Problem> {
        let [a, b, c] = corners;
        let [a, b, c] = [self.vertex(list, a)?, self.vertex(list, b)?, self.vertex(list, c)?];
        if a == b || b == c || c == a { Ok(()) } else { self.triangle(list, corners) }
    }

    fn finish(self) -> Geometry {
        let mut part = self.part;
        let triangles = part.triangles.len();
        if !part.materials.is_empty() {
            part.materials.resize(triangles, Mesh::NO_MATERIAL);
        }
        part.normals = self.normals.attribute.finish(triangles);
        part.colors = self.colors.attribute.finish(triangles);
        part.uvs = self.uvs.into_iter().map(|layer| layer.attribute.finish(triangles)).collect();
        Geometry { part, symbols: self.symbols }
    }
}
