//! Wavefront OBJ: polygons, with vertex colours and the materials of MTL libraries.
//!
//! Own code because the usual crate reads coordinates as `f32`, splits vertices at seams, and takes several times as long.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};

use memchr::memchr2;
use rayon::prelude::*;
use trixel::{Attribute, Mesh};

use super::color::{Scale, VertexColors};
use super::mtl::{MOST_MATERIALS, Materials};
use super::pieces::{self, Part, Piece};
use super::polygon::{Faces, fan};
use super::text::{self, Scanner, line_at, shown};
use super::{Loaded, Problem, ReadOptions, Resources, warn_of};
use crate::numbers::narrow;

/// More material libraries than any real file names; each costs a look into the folder, and may be as large as it likes.
const MOST_LIBRARIES: usize = 256;

/// A corner without texture coordinates or normal.
const NONE: u32 = Attribute::<[f32; 2]>::NONE;

pub(super) fn read(bytes: &[u8], options: &ReadOptions, resources: &dyn Resources) -> Result<Loaded, Problem> {
    let bytes = text::without_byte_order_mark(bytes);
    let pieces = pieces::cut(bytes, |at| !continues(bytes, at));
    let parts = before_pieces(&pieces).into_par_iter().zip(&pieces).map(|(before, piece)| {
        let mut reader = Reader { attributes: options.attributes, before, ..Reader::default() };
        let read = for_each_line(piece.bytes, |line, at| {
            reader.line(line, piece.start + at).map_err(|what| (piece.start + at, what))
        });
        read.map(|()| reader)
    });
    let mut parts = parts.collect::<Vec<_>>().into_iter();
    let mut all = Reader { attributes: options.attributes, ..Reader::default() };
    // The first thing wrong in the file is that of the first piece with any.
    parts
        .try_for_each(|part| part.map(|part| all.append(part)))
        .map_err(|(at, what)| Problem::new(line_at(bytes, at), what))?;
    all.finish(bytes, resources)
}

/// Whether the line that starts at byte `at` continues the one before.
fn continues(bytes: &[u8], at: usize) -> bool {
    let line = bytes[..at].strip_suffix(b"\n").unwrap_or(&bytes[..at]);
    line.strip_suffix(b"\r").unwrap_or(line).ends_with(b"\\")
}

/// Calls `each` with every line and where it starts.
fn for_each_line<E>(bytes: &[u8], mut each: impl FnMut(&[u8], usize) -> Result<(), E>) -> Result<(), E> {
    let mut at = 0;
    while at < bytes.len() {
        let (line, next) = logical_line(bytes, at);
        each(&line, at)?;
        at = next;
    }
    Ok(())
}

/// Lines that the corners of faces count, from the first or backwards from the last.
#[derive(Clone, Copy, Default)]
struct Counts {
    positions: usize,
    texture_coordinates: usize,
    normals: usize,
}

/// What is in front of each piece.
fn before_pieces(pieces: &[Piece<'_>]) -> Vec<Counts> {
    let mut before = Counts::default();
    let in_pieces: Vec<Counts> = match pieces {
        [_] => vec![before],
        _ => pieces.par_iter().map(|piece| count(piece.bytes)).collect(),
    };
    let sums = in_pieces.into_iter().map(|here| {
        let sum = before;
        before.positions += here.positions;
        before.texture_coordinates += here.texture_coordinates;
        before.normals += here.normals;
        sum
    });
    sums.collect()
}

fn count(bytes: &[u8]) -> Counts {
    let mut counts = Counts::default();
    let Ok(()) = for_each_line(bytes, |line, _| {
        match Scanner::with_comments(line).word() {
            Some(b"v") => counts.positions += 1,
            Some(b"vt") => counts.texture_coordinates += 1,
            Some(b"vn") => counts.normals += 1,
            _ => {}
        }
        Ok::<(), std::convert::Infallible>(())
    });
    counts
}

/// The line at `at`, joined with those that it continues on by a `\` at its end, and where the next starts.
fn logical_line(bytes: &[u8], at: usize) -> (Cow<'_, [u8]>, usize) {
    let (line, mut next) = physical_line(bytes, at);
    let continued = |line: &[u8]| line.last() == Some(&b'\\');
    // A comment may end with the path of a folder.
    if !continued(line) || line.trim_ascii_start().starts_with(b"#") {
        return (Cow::Borrowed(line), next);
    }
    let mut joined = line.to_vec();
    while continued(&joined) && next < bytes.len() {
        joined.pop();
        joined.push(b' ');
        let (line, after) = physical_line(bytes, next);
        joined.extend_from_slice(line);
        next = after;
    }
    (Cow::Owned(joined), next)
}

fn physical_line(bytes: &[u8], at: usize) -> (&[u8], usize) {
    let rest = &bytes[at..];
    match memchr2(b'\n', b'\r', rest) {
        None => (rest, bytes.len()),
        Some(length) => {
            let end = if rest[length..].starts_with(b"\r\n") { 2 } else { 1 };
            (&rest[..length], at + length + end)
        }
    }
}

/// Indices of a face's corners into one of the lists.
#[derive(Default)]
struct Corners {
    /// Of the face being read.
    face: Vec<u32>,
    /// Of all triangles, from the first face that has any.
    triangles: Vec<[u32; 3]>,
}

impl Corners {
    /// Adds the face that was read, whose triangles were the last of `triangles`.
    fn push(&mut self, triangles: usize) {
        if self.triangles.is_empty() && self.face.iter().all(|&corner| corner == NONE) {
            return;
        }
        self.triangles.resize(triangles + 2 - self.face.len(), [NONE; 3]);
        fan(&self.face, &mut self.triangles);
    }

    /// Adds those behind the first `triangles`.
    fn append(&mut self, triangles: usize, more: Self) {
        if !more.triangles.is_empty() {
            self.triangles.resize(triangles, [NONE; 3]);
            self.triangles.extend(more.triangles);
        }
    }

    /// The attribute that the corners choose values of, and how many chose one that does not exist.
    fn finish<T: Copy>(mut self, triangles: usize, values: Vec<T>) -> (Option<Attribute<T>>, usize) {
        if self.triangles.is_empty() {
            return (None, 0);
        }
        self.triangles.resize(triangles, [NONE; 3]);
        let mut wrong = 0;
        for corner in self.triangles.iter_mut().flatten() {
            if *corner != NONE && *corner as usize >= values.len() {
                *corner = NONE;
                wrong += 1;
            }
        }
        (Some(Attribute { values, corners: Some(self.triangles) }), wrong)
    }
}

#[derive(Default)]
struct Reader {
    attributes: bool,
    /// What is in front of the piece that is read; all lists and numbers below start with the piece.
    before: Counts,
    positions: Vec<[f64; 3]>,
    colors: VertexColors,
    texture_coordinates: Vec<[f32; 2]>,
    normals: Vec<[f32; 3]>,
    faces: Faces,
    vertices: Vec<u32>,
    texture_corners: Corners,
    normal_corners: Corners,
    /// The highest vertex that a face names, and where the line with it starts.
    highest: Option<(u32, usize)>,
    /// First triangle of each run of faces with the same material, and its number in `used`.
    material_runs: Vec<(usize, u32)>,
    used: Vec<Vec<u8>>,
    used_by_name: HashMap<Vec<u8>, u32>,
    libraries: Vec<Vec<u8>>,
    /// Vertices with a weight.
    weighted: usize,
    free_forms: usize,
    /// Number and first place of lines that are not OBJ.
    unknown: (usize, usize),
}

impl Part for Reader {
    fn append(&mut self, more: Self) {
        let (vertices, triangles) = (self.positions.len(), self.faces.triangles.len());
        self.colors.append(vertices, more.colors);
        self.positions.extend(more.positions);
        self.texture_coordinates.extend(more.texture_coordinates);
        self.normals.extend(more.normals);
        self.texture_corners.append(triangles, more.texture_corners);
        self.normal_corners.append(triangles, more.normal_corners);
        self.faces.append(more.faces, 0);
        self.highest = match (self.highest, more.highest) {
            (Some(here), Some(behind)) if behind.0 < here.0 => Some(here),
            (here, behind) => behind.or(here),
        };
        let numbers: Vec<u32> = more.used.iter().map(|name| self.number_of(name, MOST_MATERIALS)).collect();
        let runs = more.material_runs.iter().map(|&(first, used)| (triangles + first, numbers[used as usize]));
        self.material_runs.extend(runs);
        self.libraries.extend(more.libraries);
        self.weighted += more.weighted;
        self.free_forms += more.free_forms;
        let first = if self.unknown.0 > 0 { self.unknown.1 } else { more.unknown.1 };
        self.unknown = (self.unknown.0 + more.unknown.0, first);
    }
}

impl Reader {
    /// Reads the line that starts at byte `at`; what is wrong with it otherwise.
    fn line(&mut self, line: &[u8], at: usize) -> Result<(), String> {
        let mut scanner = Scanner::with_comments(line);
        let Some(keyword) = scanner.word() else { return Ok(()) };
        match keyword {
            b"v" => return self.vertex(&mut scanner),
            b"f" | b"fo" => return self.face(&mut scanner, at),
            b"vt" if self.attributes => {
                let u = number(&mut scanner)?;
                let v = scanner.float().unwrap_or(0.0);
                self.texture_coordinates.push([u, 1.0 - v].map(narrow));
            }
            b"vn" if self.attributes => {
                let normal = [number(&mut scanner)?, number(&mut scanner)?, number(&mut scanner)?];
                self.normals.push(normal.map(narrow));
            }
            b"usemtl" if self.attributes => self.use_material(rest_of(line, &scanner)),
            b"mtllib" if self.attributes => self.libraries.push(rest_of(line, &scanner).to_vec()),
            b"curv" | b"curv2" | b"surf" => self.free_forms += 1,
            b"vt" | b"vn" | b"usemtl" | b"mtllib" | b"g" | b"o" | b"s" | b"p" | b"l" | b"vp" | b"cstype" | b"deg"
            | b"bmat" | b"step" | b"parm" | b"trim" | b"hole" | b"scrv" | b"sp" | b"end" | b"con" | b"mg"
            | b"bevel" | b"c_interp" | b"d_interp" | b"lod" | b"shadow_obj" | b"trace_obj" | b"ctech" | b"stech"
            | b"maplib" | b"usemap" => {}
            _ => {
                if self.unknown.0 == 0 {
                    self.unknown.1 = at;
                }
                self.unknown.0 += 1;
            }
        }
        Ok(())
    }

    /// `v x y z`, with a weight, a colour, or a colour and its alpha behind.
    fn vertex(&mut self, scanner: &mut Scanner<'_>) -> Result<(), String> {
        let mut position = [number(scanner)?, number(scanner)?, number(scanner)?];
        let mut more = [f64::NAN; 4];
        let found = more.iter_mut().map_while(|n| scanner.float().map(|f| *n = f)).count();
        // The weight of a rational curve; a polygon's vertex with one is meant as homogeneous.
        if found == 1 && more[0] != 1.0 {
            position = position.map(|c| c / more[0]);
            self.weighted += 1;
        }
        if found >= 3 && self.attributes {
            self.colors.set(self.positions.len(), more);
        }
        self.positions.push(position);
        Ok(())
    }

    fn face(&mut self, scanner: &mut Scanner<'_>, at: usize) -> Result<(), String> {
        self.vertices.clear();
        self.texture_corners.face.clear();
        self.normal_corners.face.clear();
        while scanner.skip_space().is_some() {
            let mut corner = References { rest: scanner.rest() };
            let parsed = corner.next(self.before.positions + self.positions.len()).and_then(|vertex| {
                if !self.attributes {
                    return Some([vertex, NONE, NONE]);
                }
                let texture =
                    corner.next_after_slash(self.before.texture_coordinates + self.texture_coordinates.len())?;
                let normal = corner.next_after_slash(self.before.normals + self.normals.len())?;
                corner.rest.first().is_none_or(|&b| b <= b' ').then_some([vertex, texture, normal])
            });
            let word = scanner.word();
            let Some([vertex, texture, normal]) = parsed else {
                let word = shown(word.unwrap_or_default());
                return Err(format!(
                    "`{word}` is not a face corner: vertex, vertex/texture, vertex//normal or vertex/texture/normal, each \
                     counted from 1, or from -1 backwards and not before the first"
                ));
            };
            if self.highest.is_none_or(|(highest, _)| vertex >= highest) {
                self.highest = Some((vertex, at));
            }
            self.vertices.push(vertex);
            if self.attributes {
                self.texture_corners.face.push(texture);
                self.normal_corners.face.push(normal);
            }
        }
        if self.faces.push(&self.vertices) > 0 && self.attributes {
            self.texture_corners.push(self.faces.triangles.len());
            self.normal_corners.push(self.faces.triangles.len());
        }
        Ok(())
    }

    fn use_material(&mut self, name: &[u8]) {
        let index = self.number_of(name, usize::MAX);
        self.material_runs.push((self.faces.triangles.len(), index));
    }

    /// The number in `used` of a material, of at most so many.
    fn number_of(&mut self, name: &[u8], most: usize) -> u32 {
        if let Some(&index) = self.used_by_name.get(name) {
            return index;
        }
        if self.used.len() >= most {
            return Mesh::NO_MATERIAL;
        }
        let index = u32::try_from(self.used.len()).unwrap_or(Mesh::NO_MATERIAL);
        self.used.push(name.to_vec());
        self.used_by_name.insert(name.to_vec(), index);
        index
    }

    fn finish(mut self, bytes: &[u8], resources: &dyn Resources) -> Result<Loaded, Problem> {
        let vertices = self.positions.len();
        if let Some((highest, at)) = self.highest
            && highest as usize >= vertices
            && !self.faces.triangles.is_empty()
        {
            let what = format!("the face names vertex {}, but the file has only {vertices}", u64::from(highest) + 1);
            return Err(Problem::new(line_at(bytes, at), what));
        }
        let mut warnings = Vec::new();
        self.warn_of_lines(bytes, &mut warnings);

        let mut corners = [&mut self.texture_corners.triangles, &mut self.normal_corners.triangles];
        let triangles = std::mem::take(&mut self.faces).finish(&self.positions, &mut corners, &mut warnings);
        let count = triangles.len();
        let mut mesh = Mesh::new(std::mem::take(&mut self.positions), triangles);
        mesh.colors = std::mem::take(&mut self.colors).finish(vertices, Scale::Guess);
        let (uvs, wrong_uvs) =
            std::mem::take(&mut self.texture_corners).finish(count, std::mem::take(&mut self.texture_coordinates));
        let (normals, wrong_normals) =
            std::mem::take(&mut self.normal_corners).finish(count, std::mem::take(&mut self.normals));
        mesh.uvs = uvs.into_iter().collect();
        mesh.normals = normals;
        for (wrong, kind) in [(wrong_uvs, "texture coordinates"), (wrong_normals, "normals")] {
            if wrong > 0 {
                warnings.push(format!("{wrong} face corners name {kind} that do not exist; they stay without"));
            }
        }
        self.add_materials(&mut mesh, resources, &mut warnings);
        Ok(Loaded { mesh, warnings })
    }

    fn warn_of_lines(&self, bytes: &[u8], warnings: &mut Vec<String>) {
        if self.free_forms > 0 {
            warnings.push(format!(
                "skipped {} free-form curves and surfaces, which are not supported: export polygons instead",
                self.free_forms
            ));
        }
        if self.weighted > 0 {
            warnings.push(format!("divided the coordinates of {} vertices by their weight", self.weighted));
        }
        if self.unknown.0 > 0 {
            let (count, first) = self.unknown;
            warnings.push(format!("skipped {count} lines that are not OBJ, the first at {}", line_at(bytes, first)));
        }
    }

    fn add_materials(&self, mesh: &mut Mesh, resources: &dyn Resources, warnings: &mut Vec<String>) {
        let mut materials = Materials::default();
        let complete = self.load_libraries(&mut materials, resources, warnings);
        let mut unknown = Vec::new();
        let numbers: Vec<u32> = self
            .used
            .iter()
            .map(|name| {
                materials.find(name).unwrap_or_else(|| {
                    unknown.push(shown(name));
                    materials.add(name)
                })
            })
            .collect();
        // Otherwise a missing library explains it.
        if complete {
            warn_of(warnings, &unknown, "material", "in no material library; it gets the default");
        }
        if !self.material_runs.is_empty() {
            let count = mesh.triangles.len();
            let starts = self.material_runs.iter().skip(1).map(|run| run.0).chain([count]);
            mesh.triangle_materials = vec![Mesh::NO_MATERIAL; self.material_runs[0].0];
            mesh.triangle_materials.reserve_exact(count - self.material_runs[0].0);
            for (&(_, used), end) in self.material_runs.iter().zip(starts) {
                let material = numbers.get(used as usize).copied().unwrap_or(Mesh::NO_MATERIAL);
                mesh.triangle_materials.resize(end, material);
            }
        }
        materials.finish(mesh, warnings);
    }

    /// Loads each library once, and returns whether all are there. A line may name several, or one with spaces in its
    /// name.
    fn load_libraries(&self, materials: &mut Materials, resources: &dyn Resources, warnings: &mut Vec<String>) -> bool {
        let (mut tried, mut missing) = (HashSet::new(), Vec::new());
        for line in &self.libraries {
            let mut load = |name: &[u8]| {
                if !tried.insert(name.to_vec()) {
                    return true;
                }
                if tried.len() > MOST_LIBRARIES {
                    return false;
                }
                match resources.load(&String::from_utf8_lossy(name)) {
                    Ok(bytes) => {
                        materials.read(text::without_byte_order_mark(&bytes), resources);
                        true
                    }
                    Err(_) => false,
                }
            };
            if load(line) {
                continue;
            }
            let mut names: Vec<&[u8]> = line.split(u8::is_ascii_whitespace).filter(|name| !name.is_empty()).collect();
            // Already tried as the whole line.
            names.retain(|name| *name != line.as_slice());
            if names.is_empty() {
                missing.push(shown(line));
            }
            for name in names {
                if !load(name) {
                    missing.push(shown(name));
                }
            }
        }
        warn_of(warnings, &missing, "material library", "not there; its materials get the default");
        missing.is_empty()
    }
}

/// Everything behind the keyword, where `#` is part of a name.
fn rest_of<'a>(line: &'a [u8], scanner: &Scanner<'_>) -> &'a [u8] {
    line.get(scanner.offset()..).unwrap_or_default().trim_ascii()
}

fn number(scanner: &mut Scanner<'_>) -> Result<f64, String> {
    scanner.float().ok_or_else(|| match scanner.word() {
        Some(word) => format!("expected a number, found `{}`", shown(word)),
        None => "the line has too few numbers".into(),
    })
}

/// The numbers of one corner of a face.
struct References<'a> {
    rest: &'a [u8],
}

impl References<'_> {
    /// A number of an entry, counted from 1 or backwards from the last of `count`, as an index from 0.
    fn next(&mut self, count: usize) -> Option<u32> {
        let negative = self.rest.first() == Some(&b'-');
        let digits = &self.rest[usize::from(negative)..];
        let (mut number, mut length) = (0u64, 0);
        while let Some(digit) = digits.get(length).map(|b| b.wrapping_sub(b'0')).filter(|&d| d < 10) {
            // Far beyond any index, so that it cannot overflow, however long the digits go on.
            number = (number * 10 + u64::from(digit)).min(1 << 40);
            length += 1;
        }
        self.rest = &digits[length..];
        let index = if negative { (count as u64).checked_sub(number)? } else { number.checked_sub(1)? };
        // Minus nothing is no entry; neither is the mark of a missing one.
        if negative && number == 0 {
            return None;
        }
        u32::try_from(index).ok().filter(|&index| index != NONE)
    }

    /// The number behind a slash; [`NONE`] where there is no slash or nothing behind it.
    fn next_after_slash(&mut self, count: usize) -> Option<u32> {
        let Some(rest) = self.rest.strip_prefix(b"/") else { return Some(NONE) };
        self.rest = rest;
        if rest.first().is_none_or(|&b| b == b'/' || b <= b' ') { Some(NONE) } else { self.next(count) }
    }
}
