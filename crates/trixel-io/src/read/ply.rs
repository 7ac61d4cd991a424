//! PLY, the Stanford polygon format: ASCII and binary of both byte orders.
//!
//! Own code because the crates for PLY build a hash map for every vertex, tens of times slower than the voxelizing that
//! follows.

use trixel::{Attribute, Image, ImageSource, Material, Mesh, Texture, TextureRef};

use super::color::Scale;
use super::pieces::{self, Part, Text};
use super::ply_header::{Element, Encoding, Header, Kind, Property, Scalar};
use super::polygon::Faces;
use super::text::{self, Scanner, shown};
use super::vertices::Vertices;
use super::{Loaded, Problem, ReadOptions, Resources, warn_of};
use crate::numbers::narrow;

pub(super) fn read(bytes: &[u8], options: &ReadOptions, resources: &dyn Resources) -> Result<Loaded, Problem> {
    let bytes = text::without_byte_order_mark(bytes);
    let header = Header::parse(bytes)?;
    let data = bytes.get(header.end..).unwrap_or_default();
    match header.encoding {
        Encoding::Ascii => {
            let mut words = Words { scanner: Scanner::new(data), file: bytes, start: header.end };
            read_elements(&mut words, &header, options, resources)
        }
        Encoding::LittleEndian => {
            read_elements(&mut Binary::<false> { data, at: 0, start: header.end }, &header, options, resources)
        }
        Encoding::BigEndian => {
            read_elements(&mut Binary::<true> { data, at: 0, start: header.end }, &header, options, resources)
        }
    }
}

/// The numbers behind the header, in whichever encoding.
trait Source: Sized {
    /// The next number; `None` when there is none or it is none.
    fn number(&mut self, scalar: Scalar) -> Option<f64>;

    /// Moves over `count` numbers.
    fn skip(&mut self, scalar: Scalar, count: u64) -> Option<()>;

    /// Where the source is, and what is wrong there if a number was expected.
    fn problem(&mut self, expected: &str) -> Problem;

    /// The most rows that can still follow, when each takes at least `smallest_row` bytes in binary.
    fn most_rows(&self, smallest_row: usize, properties: usize) -> usize;

    /// Reads `count` rows into `all` with `row`, which is told the number of each and moves over at least one number.
    fn rows<T: Part>(
        &mut self,
        count: u64,
        all: &mut T,
        row: impl Fn(&mut Self, &mut T, u64) -> Result<(), Problem> + Sync,
    ) -> Result<(), Problem>;

    /// Moves over rows for as long as they are triangles (`rows.offset` bytes into each, a count of 3 and 32-bit indices)
    /// and appends those; returns how many. `None` where the encoding has no such rows.
    fn triangles(&mut self, rows: Rows, out: &mut Vec<[u32; 3]>) -> Option<u64>;

    /// Moves over all rows and appends the three `f32` that each holds, where the encoding lets it do so quickly;
    /// otherwise returns `false` and moves nowhere.
    fn float_triples(&mut self, rows: Rows, out: &mut Vec<[f64; 3]>) -> bool;
}

/// Rows that all take the same number of bytes in a binary file.
#[derive(Clone, Copy)]
struct Rows {
    count: u64,
    stride: usize,
    /// Where in a row the wanted numbers start.
    offset: usize,
}

struct Words<'a> {
    scanner: Scanner<'a>,
    file: &'a [u8],
    start: usize,
}

impl Source for Words<'_> {
    fn number(&mut self, _scalar: Scalar) -> Option<f64> {
        self.scanner.float()
    }

    fn skip(&mut self, _scalar: Scalar, count: u64) -> Option<()> {
        (0..count).try_for_each(|_| self.scanner.word().map(|_| ()))
    }

    fn problem(&mut self, expected: &str) -> Problem {
        self.scanner.skip_space();
        let at = text::line_at(self.file, self.start + self.scanner.offset());
        Problem::new(at, self.scanner.expected(expected))
    }

    fn most_rows(&self, _smallest_row: usize, properties: usize) -> usize {
        // A digit and a space are the least for a number.
        self.scanner.rest().len() / (2 * properties).max(1)
    }

    fn rows<T: Part>(
        &mut self,
        count: u64,
        all: &mut T,
        row: impl Fn(&mut Self, &mut T, u64) -> Result<(), Problem> + Sync,
    ) -> Result<(), Problem> {
        pieces::rows(self, count, all, row)
    }

    fn triangles(&mut self, _rows: Rows, _out: &mut Vec<[u32; 3]>) -> Option<u64> {
        None
    }

    fn float_triples(&mut self, _rows: Rows, _out: &mut Vec<[f64; 3]>) -> bool {
        false
    }
}

impl<'a> Text<'a> for Words<'a> {
    fn scanner(&mut self) -> &mut Scanner<'a> {
        &mut self.scanner
    }

    fn of(&self, piece: &'a [u8]) -> Self {
        Self { scanner: self.scanner.like(piece), ..*self }
    }
}

struct Binary<'a, const BIG: bool> {
    data: &'a [u8],
    at: usize,
    start: usize,
}

impl<const BIG: bool> Binary<'_, BIG> {
    fn take(&mut self, size: usize) -> Option<&[u8]> {
        let taken = self.data.get(self.at..self.at.checked_add(size)?)?;
        self.at += size;
        Some(taken)
    }
}

/// The number at the start of `bytes`, exactly; `None` when they are too few.
fn decode<const BIG: bool>(scalar: Scalar, bytes: &[u8]) -> Option<f64> {
    macro_rules! number {
        ($type:ty) => {{
            let bytes = *bytes.first_chunk()?;
            f64::from(if BIG { <$type>::from_be_bytes(bytes) } else { <$type>::from_le_bytes(bytes) })
        }};
    }
    Some(match scalar {
        Scalar::I8 => number!(i8),
        Scalar::U8 => number!(u8),
        Scalar::I16 => number!(i16),
        Scalar::U16 => number!(u16),
        Scalar::I32 => number!(i32),
        Scalar::U32 => number!(u32),
        Scalar::F32 => number!(f32),
        Scalar::F64 => number!(f64),
    })
}

impl<const BIG: bool> Source for Binary<'_, BIG> {
    fn number(&mut self, scalar: Scalar) -> Option<f64> {
        decode::<BIG>(scalar, self.take(scalar.size())?)
    }

    fn skip(&mut self, scalar: Scalar, count: u64) -> Option<()> {
        self.take(usize::try_from(count).ok()?.checked_mul(scalar.size())?).map(|_| ())
    }

    fn problem(&mut self, expected: &str) -> Problem {
        let what = format!("expected {expected}, but the file ends too soon; it is truncated");
        Problem::new(format!("byte {}", self.start + self.at), what)
    }

    fn most_rows(&self, smallest_row: usize, _properties: usize) -> usize {
        (self.data.len() - self.at) / smallest_row.max(1)
    }

    fn rows<T: Part>(
        &mut self,
        count: u64,
        all: &mut T,
        row: impl Fn(&mut Self, &mut T, u64) -> Result<(), Problem> + Sync,
    ) -> Result<(), Problem> {
        (0..count).try_for_each(|number| row(self, all, number))
    }

    fn triangles(&mut self, rows: Rows, out: &mut Vec<[u32; 3]>) -> Option<u64> {
        let data = self.data.get(self.at..).unwrap_or_default();
        let most = usize::try_from(rows.count).unwrap_or(usize::MAX);
        let before = out.len();
        for row in data.chunks_exact(rows.stride).take(most) {
            let Some(triangle) = triangle_of_row(&row[rows.offset..], BIG) else { break };
            out.push(triangle);
        }
        let read = out.len() - before;
        self.at += read * rows.stride;
        Some(read as u64)
    }

    fn float_triples(&mut self, rows: Rows, out: &mut Vec<[f64; 3]>) -> bool {
        let float = |bytes: [u8; 4]| f64::from(if BIG { f32::from_be_bytes(bytes) } else { f32::from_le_bytes(bytes) });
        let size = usize::try_from(rows.count).ok().and_then(|count| count.checked_mul(rows.stride));
        let Some(data) = size.and_then(|size| self.take(size)) else { return false };
        for row in data.chunks_exact(rows.stride) {
            if let Some(&[x0, x1, x2, x3, y0, y1, y2, y3, z0, z1, z2, z3]) = row[rows.offset..].first_chunk() {
                out.push([float([x0, x1, x2, x3]), float([y0, y1, y2, y3]), float([z0, z1, z2, z3])]);
            }
        }
        true
    }
}

/// A triangle from a count of 3 and three 32-bit indices; negative ones are left to those who complain of them.
#[inline]
pub(super) fn triangle_of_row(bytes: &[u8], big: bool) -> Option<[u32; 3]> {
    let &[3, a0, a1, a2, a3, b0, b1, b2, b3, c0, c1, c2, c3] = bytes.first_chunk()? else { return None };
    let index = |bytes: [u8; 4]| if big { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) };
    let triangle = [index([a0, a1, a2, a3]), index([b0, b1, b2, b3]), index([c0, c1, c2, c3])];
    ((triangle[0] | triangle[1] | triangle[2]) <= i32::MAX as u32).then_some(triangle)
}

/// The bytes of a row of faces and where in it [`triangle_of_row`] finds the triangle, where faces may be triangles.
pub(super) fn triangle_rows(element: &Element<'_>) -> Option<(usize, usize)> {
    let slots: Vec<FaceSlot> = element.properties.iter().map(|property| face_slot(property, false)).collect();
    plain_triangles(element, &slots).map(|rows| (rows.stride, rows.offset))
}

/// The number at the start of `bytes`, in either byte order.
pub(super) fn number(scalar: Scalar, bytes: &[u8], big: bool) -> Option<f64> {
    if big { decode::<true>(scalar, bytes) } else { decode::<false>(scalar, bytes) }
}

fn read_elements<S: Source>(
    source: &mut S,
    header: &Header<'_>,
    options: &ReadOptions,
    resources: &dyn Resources,
) -> Result<Loaded, Problem> {
    let mut vertices = None;
    let mut faces = FaceData::default();
    for element in &header.elements {
        match element.name {
            b"vertex" if vertices.is_none() => vertices = Some(read_vertices(source, element, options)?),
            b"face" => read_faces(source, element, options, &mut faces)?,
            b"tristrips" => read_strips(source, element, &mut faces)?,
            _ => skip_element(source, element)?,
        }
    }
    let Some(mut mesh) = vertices else {
        return Err(Problem::new("header", "there is no element `vertex`"));
    };
    let mut warnings = Vec::new();
    mesh.triangles = faces.faces.finish(&mesh.positions, &mut [&mut faces.uv_corners], &mut warnings);
    let triangles = mesh.triangles.len();
    if !faces.uvs.is_empty() {
        faces.uv_corners.resize(triangles, [Attribute::<[f32; 2]>::NONE; 3]);
        // What the faces say is more exact than what the vertices say: it has seams.
        mesh.uvs = vec![Attribute { values: faces.uvs, corners: Some(faces.uv_corners) }];
    }
    if options.attributes && !header.textures.is_empty() {
        add_textures(&mut mesh, &header.textures, resources, &mut warnings);
        mesh.triangle_materials = expand_runs(&faces.texture_runs, triangles, mesh.materials.len());
    }
    Ok(Loaded { mesh, warnings })
}

/// What a vertex property is, as a place in a row of numbers.
fn vertex_slot(name: &[u8]) -> Option<usize> {
    Some(match name {
        b"x" => 0,
        b"y" => 1,
        b"z" => 2,
        b"nx" => 3,
        b"ny" => 4,
        b"nz" => 5,
        b"s" | b"u" | b"texture_u" | b"texture_s" => 6,
        b"t" | b"v" | b"texture_v" | b"texture_t" => 7,
        b"red" | b"r" | b"diffuse_red" => 8,
        b"green" | b"g" | b"diffuse_green" => 9,
        b"blue" | b"b" | b"diffuse_blue" => 10,
        b"alpha" | b"a" | b"diffuse_alpha" => 11,
        _ => return None,
    })
}

const SLOTS: usize = 12;

fn read_vertices<S: Source>(source: &mut S, element: &Element<'_>, options: &ReadOptions) -> Result<Mesh, Problem> {
    if u32::try_from(element.count).is_err() {
        let what = format!("{} vertices are more than 32-bit indices can name: split the file", element.count);
        return Err(Problem::new("header", what));
    }
    let wanted = |property: &Property<'_>| match property.kind {
        Kind::Scalar(scalar) => {
            vertex_slot(property.name).filter(|&slot| slot < 3 || options.attributes).map(|slot| (slot, scalar))
        }
        Kind::List { .. } => None,
    };
    let slots: Vec<Option<(usize, Scalar)>> = element.properties.iter().map(wanted).collect();
    let kind_of = |slot: usize| slots.iter().flatten().find(|s| s.0 == slot).map(|s| s.1);
    for (slot, name) in ["x", "y", "z"].iter().enumerate() {
        if kind_of(slot).is_none() {
            return Err(Problem::new("header", format!("the vertices have no number `{name}`")));
        }
    }
    let has = |mut range: std::ops::Range<usize>| range.all(|slot| kind_of(slot).is_some());
    let (has_normals, has_uvs, has_colors) = (has(3..6), has(6..8), has(8..11));

    let mut vertices = Vertices::with_capacity(capacity(source, element));
    if let Some(rows) = float_positions(element, &slots)
        && source.float_triples(rows, &mut vertices.positions)
    {
        return Ok(Mesh::new(vertices.positions, Vec::new()));
    }
    source.rows(element.count, &mut vertices, |source, vertices, vertex| {
        let mut row = [f64::NAN; SLOTS];
        for (property, slot) in element.properties.iter().zip(&slots) {
            let found = match *slot {
                Some((slot, scalar)) => source.number(scalar).map(|number| row[slot] = number),
                None => skip_property(source, property),
            };
            if found.is_none() {
                let what = format!("`{}` of vertex {vertex} of {}", shown(property.name), element.count);
                return Err(source.problem(&what));
            }
        }
        if has_colors {
            vertices.colors.set(vertices.positions.len(), [row[8], row[9], row[10], row[11]]);
        }
        if has_normals {
            vertices.normals.push([row[3], row[4], row[5]].map(narrow));
        }
        if has_uvs {
            vertices.uvs.push([row[6], 1.0 - row[7]].map(narrow));
        }
        vertices.positions.push([row[0], row[1], row[2]]);
        Ok(())
    })?;
    let scale = match kind_of(8) {
        None | Some(Scalar::F32 | Scalar::F64) => Scale::Guess,
        Some(Scalar::U16) => Scale::Of(65_535.0),
        Some(_) => Scale::Of(255.0),
    };
    Ok(vertices.finish(scale))
}

/// The rows of vertices of which only the position is wanted and is three `f32` in a row, as in most large files.
fn float_positions(element: &Element<'_>, slots: &[Option<(usize, Scalar)>]) -> Option<Rows> {
    let first = slots.iter().position(Option::is_some)?;
    let position = [0, 1, 2].map(|slot| Some((slot, Scalar::F32)));
    let others = slots.get(first + 3..)?;
    let plain = slots[first..first + 3] == position && others.iter().all(Option::is_none);
    let offset = fixed_size(&element.properties[..first])?;
    let stride = fixed_size(&element.properties)?;
    plain.then_some(Rows { count: element.count, stride, offset })
}

/// The rows of faces that are triangles with 32-bit indices, and of whose other properties none is wanted.
fn plain_triangles(element: &Element<'_>, slots: &[FaceSlot]) -> Option<Rows> {
    let list = slots.iter().position(|slot| !matches!(slot, FaceSlot::Other))?;
    let FaceSlot::Vertices { count: Scalar::I8 | Scalar::U8, item: Scalar::I32 | Scalar::U32 } = slots[list] else {
        return None;
    };
    let others = slots.get(list + 1..)?;
    let plain = others.iter().all(|slot| matches!(slot, FaceSlot::Other));
    let offset = fixed_size(&element.properties[..list])?;
    let behind = fixed_size(&element.properties[list + 1..])?;
    plain.then_some(Rows { count: element.count, stride: offset + 13 + behind, offset })
}

/// The bytes that properties take together in a binary file, if none is a list.
fn fixed_size(properties: &[Property<'_>]) -> Option<usize> {
    properties.iter().try_fold(0, |size, property| match property.kind {
        Kind::Scalar(scalar) => Some(size + scalar.size()),
        Kind::List { .. } => None,
    })
}

/// Room for the rows of an element, as far as the file can hold them.
fn capacity(source: &impl Source, element: &Element<'_>) -> usize {
    let most = source.most_rows(element.smallest_row(), element.properties.len());
    usize::try_from(element.count).unwrap_or(usize::MAX).min(most)
}

/// Faces as they are read.
#[derive(Default)]
struct FaceData {
    faces: Faces,
    uvs: Vec<[f32; 2]>,
    /// Indices into `uvs` beside the triangles, as far as there are any.
    uv_corners: Vec<[u32; 3]>,
    /// First triangle and texture of each run of faces with the same texture.
    texture_runs: Vec<(usize, Option<u32>)>,
    /// Of the face being read: its vertices, and the numbers of its texture coordinates.
    corners: Vec<u32>,
    corner_uvs: Vec<f64>,
}

impl FaceData {
    /// Starts a run of faces with a texture, or goes on with one.
    fn set_texture(&mut self, texture: Option<u32>) {
        if self.texture_runs.last().is_none_or(|&(_, last)| last != texture) {
            self.texture_runs.push((self.faces.triangles.len(), texture));
        }
    }

    /// Adds the face that was read.
    fn push(&mut self) {
        let (before, corners) = (self.faces.triangles.len(), self.corners.len());
        self.faces.push(&self.corners);
        // A list of another length than two a corner says nothing.
        if !self.corner_uvs.is_empty() && self.corner_uvs.len() == 2 * corners && corners > 2 {
            let first = self.uvs.len();
            self.uvs.extend(self.corner_uvs.chunks_exact(2).map(|uv| [uv[0], 1.0 - uv[1]].map(narrow)));
            self.uv_corners.resize(before, [Attribute::<[f32; 2]>::NONE; 3]);
            // The fan, as for the vertices.
            self.uv_corners.extend((2..corners).map(|i| [first, first + i - 1, first + i].map(uv_index)));
        }
    }
}

impl Part for FaceData {
    fn append(&mut self, more: Self) {
        let (triangles, uvs) = (self.faces.triangles.len(), self.uvs.len());
        for (first, texture) in more.texture_runs {
            if self.texture_runs.last().is_none_or(|&(_, last)| last != texture) {
                self.texture_runs.push((triangles + first, texture));
            }
        }
        if !more.uvs.is_empty() {
            let none = Attribute::<[f32; 2]>::NONE;
            let behind = |index: u32| if index == none { none } else { uv_index(uvs + index as usize) };
            self.uv_corners.resize(triangles, [none; 3]);
            self.uv_corners.extend(more.uv_corners.into_iter().map(|triangle| triangle.map(behind)));
            self.uvs.extend(more.uvs);
        }
        self.faces.append(more.faces, 0);
    }
}

fn uv_index(index: usize) -> u32 {
    u32::try_from(index).unwrap_or(Attribute::<[f32; 2]>::NONE)
}

/// What a face property is.
#[derive(Clone, Copy)]
enum FaceSlot {
    Vertices { count: Scalar, item: Scalar },
    TextureCoordinates { count: Scalar, item: Scalar },
    TextureNumber(Scalar),
    Other,
}

fn face_slot(property: &Property<'_>, attributes: bool) -> FaceSlot {
    match (property.name, property.kind) {
        (b"vertex_indices" | b"vertex_index", Kind::List { count, item }) => FaceSlot::Vertices { count, item },
        (b"texcoord", Kind::List { count, item }) if attributes => FaceSlot::TextureCoordinates { count, item },
        (b"texnumber", Kind::Scalar(scalar)) if attributes => FaceSlot::TextureNumber(scalar),
        _ => FaceSlot::Other,
    }
}

fn read_faces<S: Source>(
    source: &mut S,
    element: &Element<'_>,
    options: &ReadOptions,
    data: &mut FaceData,
) -> Result<(), Problem> {
    let slots: Vec<FaceSlot> = element.properties.iter().map(|p| face_slot(p, options.attributes)).collect();
    if !slots.iter().any(|slot| matches!(slot, FaceSlot::Vertices { .. })) {
        return skip_element(source, element);
    }
    data.faces.triangles.reserve(capacity(source, element));
    let row = |source: &mut S, data: &mut FaceData, face| read_face(source, element, &slots, data, face);
    let mut face = 0;
    if let Some(plain) = plain_triangles(element, &slots) {
        data.set_texture(None);
        while face < element.count {
            let left = Rows { count: element.count - face, ..plain };
            match source.triangles(left, &mut data.faces.triangles) {
                None => break,
                Some(0) => {
                    row(source, data, face)?;
                    face += 1;
                }
                Some(read) => face += read,
            }
        }
    }
    source.rows(element.count - face, data, row)?;
    let textured = if data.uvs.is_empty() { 0 } else { data.faces.triangles.len() };
    data.uv_corners.resize(textured, [Attribute::<[f32; 2]>::NONE; 3]);
    Ok(())
}

fn read_face<S: Source>(
    source: &mut S,
    element: &Element<'_>,
    slots: &[FaceSlot],
    data: &mut FaceData,
    face: u64,
) -> Result<(), Problem> {
    let mut texture = None;
    data.corner_uvs.clear();
    for (property, slot) in element.properties.iter().zip(slots) {
        let found = match *slot {
            FaceSlot::Vertices { count, item } => {
                data.corners.clear();
                let mut wrong = None;
                let found = list(source, count, item, |number| match vertex_index(number) {
                    Some(index) => data.corners.push(index),
                    None => wrong = Some(number),
                });
                if let Some(number) = wrong {
                    let what = format!("{number} is not the number of a vertex");
                    return Err(Problem::new(format!("face {face}"), what));
                }
                found
            }
            FaceSlot::TextureCoordinates { count, item } => {
                list(source, count, item, |number| data.corner_uvs.push(number))
            }
            FaceSlot::TextureNumber(scalar) => source.number(scalar).map(|number| texture = vertex_index(number)),
            FaceSlot::Other => skip_property(source, property),
        };
        if found.is_none() {
            let what = format!("`{}` of face {face} of {}", shown(property.name), element.count);
            return Err(source.problem(&what));
        }
    }
    data.set_texture(texture);
    data.push();
    Ok(())
}

/// Triangle strips: each list holds any number of strips, which -1 parts. Every second triangle of a strip is turned.
fn read_strips<S: Source>(source: &mut S, element: &Element<'_>, data: &mut FaceData) -> Result<(), Problem> {
    for row in 0..element.count {
        for property in &element.properties {
            let found = match face_slot(property, false) {
                FaceSlot::Vertices { count, item } => {
                    let (mut last, mut length, mut wrong) = ([0u32; 2], 0usize, None);
                    let found = list(source, count, item, |number| {
                        let Some(index) = vertex_index(number) else {
                            wrong = wrong.or((number != -1.0).then_some(number));
                            length = 0;
                            return;
                        };
                        let [a, b] = last;
                        // Repeated vertices join strips; they are no triangles.
                        if length >= 2 && a != b && b != index && a != index {
                            data.faces.push(&if length % 2 == 0 { [a, b, index] } else { [b, a, index] });
                        }
                        last = [b, index];
                        length += 1;
                    });
                    if let Some(number) = wrong {
                        let what = format!("{number} is neither the number of a vertex nor -1");
                        return Err(Problem::new(format!("triangle strip {row}"), what));
                    }
                    found
                }
                _ => skip_property(source, property),
            };
            if found.is_none() {
                let what = format!("`{}` of triangle strip {row} of {}", shown(property.name), element.count);
                return Err(source.problem(&what));
            }
        }
    }
    Ok(())
}

/// A number as an index, if it is one that 32 bits hold.
fn vertex_index(number: f64) -> Option<u32> {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked by converting back")]
    let index = number as u32;
    (f64::from(index) == number).then_some(index)
}

/// Reads a list and hands each of its numbers on; `None` when the data ends or the length is no count.
fn list<S: Source>(source: &mut S, count: Scalar, item: Scalar, mut each: impl FnMut(f64)) -> Option<()> {
    for _ in 0..vertex_index(source.number(count)?)? {
        each(source.number(item)?);
    }
    Some(())
}

fn skip_property<S: Source>(source: &mut S, property: &Property<'_>) -> Option<()> {
    match property.kind {
        Kind::Scalar(scalar) => source.skip(scalar, 1),
        Kind::List { count, item } => {
            let count = vertex_index(source.number(count)?)?;
            source.skip(item, u64::from(count))
        }
    }
}

fn skip_element<S: Source>(source: &mut S, element: &Element<'_>) -> Result<(), Problem> {
    // Rows without properties take no bytes, so any number of them is nothing.
    let rows = if element.properties.is_empty() { 0 } else { element.count };
    for row in 0..rows {
        for property in &element.properties {
            if skip_property(source, property).is_none() {
                let (property, element_name) = (shown(property.name), shown(element.name));
                return Err(source.problem(&format!("`{property}` of {element_name} {row} of {}", element.count)));
            }
        }
    }
    Ok(())
}

/// One material for each texture that the header names.
fn add_textures(mesh: &mut Mesh, names: &[String], resources: &dyn Resources, warnings: &mut Vec<String>) {
    let mut missing = Vec::new();
    for name in names {
        let mut material = Material { name: name.clone(), ..Material::default() };
        match resources.locate(name) {
            Some(path) => {
                let image = u32::try_from(mesh.images.len()).unwrap_or(u32::MAX);
                mesh.images.push(Image { name: name.clone(), source: ImageSource::File(path) });
                mesh.textures.push(Texture {
                    image,
                    wrap: Default::default(),
                    filter: Default::default(),
                    mipmaps: true,
                });
                material.base_color_texture = Some(TextureRef::new(image));
            }
            None => missing.push(name.clone()),
        }
        mesh.materials.push(material);
    }
    warn_of(warnings, &missing, "texture", "not there; its faces stay without");
}

/// The material of each triangle from runs of texture numbers; faces without a number have the first texture.
fn expand_runs(runs: &[(usize, Option<u32>)], triangles: usize, materials: usize) -> Vec<u32> {
    let mut expanded = Vec::with_capacity(triangles);
    // Strips may follow faces, or come alone.
    expanded.resize(runs.first().map_or(triangles, |run| run.0), 0);
    for (index, &(_, texture)) in runs.iter().enumerate() {
        let end = runs.get(index + 1).map_or(triangles, |next| next.0);
        let material = texture.unwrap_or(0);
        let known = (material as usize) < materials;
        expanded.resize(end, if known { material } else { Mesh::NO_MATERIAL });
    }
    expanded
}
