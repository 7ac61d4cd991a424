//! OFF, the Object File Format of Geomview, in its ASCII forms: OFF, COFF, NOFF, STOFF and their combinations.
//!
//! One vertex and one face a line, as every writer does. Colours of faces are not read: [`trixel::Mesh`] has none.
//! Own code because the crates for OFF read coordinates as `f32`.

use trixel::Mesh;

use super::color::Scale;
use super::pieces::{self, Part};
use super::polygon::Faces;
use super::text::{self, Scanner};
use super::vertices::Vertices;
use super::{Loaded, Problem, ReadOptions, Resources};
use crate::numbers::narrow;

/// What a vertex has besides its position, as letters in front of `OFF` say.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Header {
    texture: bool,
    color: bool,
    normal: bool,
    /// `4`: a fourth coordinate.
    four: bool,
    /// `n`: any number of coordinates.
    dimension: bool,
}

impl Header {
    /// The header that a first word is, if it is one.
    fn parse(word: &[u8]) -> Option<Self> {
        let mut flags = word.strip_suffix(b"OFF")?;
        let mut take = |flag: &[u8]| match flags.strip_prefix(flag) {
            Some(rest) => {
                flags = rest;
                true
            }
            None => false,
        };
        let header = Self {
            texture: take(b"ST"),
            color: take(b"C"),
            normal: take(b"N"),
            four: take(b"4"),
            dimension: take(b"n"),
        };
        flags.is_empty().then_some(header)
    }
}

/// Whether a file starts as OFF files do.
pub(super) fn looks_like_off(bytes: &[u8]) -> bool {
    let mut scanner = Scanner::with_comments(text::without_byte_order_mark(bytes));
    scanner.word().is_some_and(|word| Header::parse(word).is_some())
}

pub(super) fn read(bytes: &[u8], options: &ReadOptions, _resources: &dyn Resources) -> Result<Loaded, Problem> {
    let mut scanner = Scanner::with_comments(text::without_byte_order_mark(bytes));
    let header = read_header(&mut scanner)?;
    let vertices = scanner.count().ok_or_else(|| scanner.unexpected("`OFF` or the number of vertices"))?;
    let faces = scanner.count().ok_or_else(|| scanner.unexpected("the number of faces"))?;
    scanner.skip_line(); // The number of edges, which nobody needs.
    if u32::try_from(vertices).is_err() {
        return Err(
            scanner.problem(format!("{vertices} vertices are more than 32-bit indices can name: split the file"))
        );
    }

    let mut mesh = read_vertices(&mut scanner, header, vertices, options)?;
    let mut warnings = Vec::new();
    let faces = read_faces(&mut scanner, faces, mesh.positions.len())?;
    mesh.triangles = faces.finish(&mesh.positions, &mut [], &mut warnings);
    Ok(Loaded { mesh, warnings })
}

/// Reads the first word, which may be missing, and refuses the variants that are not meshes in space or not text.
fn read_header(scanner: &mut Scanner<'_>) -> Result<Header, Problem> {
    if scanner.skip_space().is_some_and(|byte| byte.is_ascii_digit()) {
        // `4OFF` starts with a digit too.
        let mut ahead = Scanner::new(scanner.rest());
        if ahead.count().is_some() {
            return Ok(Header::default());
        }
    }
    let problem = scanner.problem("");
    let word = scanner.word().unwrap_or_default();
    let refuse = |what: &str| Err(Problem::new(problem.at.clone(), format!("`{}` {what}", text::shown(word))));
    let Some(header) = Header::parse(word) else {
        return refuse("is not an OFF header such as `OFF`, `COFF` or `NOFF`");
    };
    if header.four || header.dimension {
        return refuse("holds points of other than three dimensions, which is not supported: project them to 3D first");
    }
    let mut ahead = Scanner::new(scanner.rest());
    if ahead.word_on_line().is_some_and(|word| word.eq_ignore_ascii_case(b"BINARY")) {
        return refuse("BINARY is not supported: save the file as ASCII OFF, or as PLY");
    }
    Ok(header)
}

fn read_vertices(
    scanner: &mut Scanner<'_>,
    header: Header,
    count: u64,
    options: &ReadOptions,
) -> Result<Mesh, Problem> {
    // Three digits, two spaces and a line end are the least that a vertex takes.
    let capacity = usize::try_from(count).unwrap_or(usize::MAX).min(scanner.rest().len() / 6);
    let mut vertices = Vertices::with_capacity(capacity);
    pieces::rows(scanner, count, &mut vertices, |scanner, vertices, vertex| {
        let mut position = [0.0; 3];
        for coordinate in &mut position {
            *coordinate = scanner
                .float()
                .ok_or_else(|| scanner.unexpected(&format!("a coordinate of vertex {vertex} of {count}")))?;
        }
        vertices.positions.push(position);
        if options.attributes {
            read_attributes(scanner, header, vertices);
        }
        scanner.skip_line();
        Ok(())
    })?;
    Ok(vertices.finish(Scale::Guess))
}

/// What follows the position of the last vertex.
fn read_attributes(scanner: &mut Scanner<'_>, header: Header, vertices: &mut Vertices) {
    let mut numbers = |into: &mut [f64]| into.iter_mut().map_while(|x| scanner.float_on_line().map(|f| *x = f)).count();
    if header.normal {
        let mut normal = [0.0; 3];
        numbers(&mut normal);
        vertices.normals.push(normal.map(narrow));
    }
    if header.color || header.texture {
        // Colours have three or four numbers; the texture coordinates are the last two of the line.
        let mut rest = [f64::NAN; 6];
        let found = numbers(&mut rest);
        let color = if header.texture { found.saturating_sub(2) } else { found };
        if header.color {
            let mut rgba = [f64::NAN; 4];
            rgba[..color.min(4)].copy_from_slice(&rest[..color.min(4)]);
            vertices.colors.set(vertices.positions.len() - 1, rgba);
        }
        if header.texture {
            let uv = if found >= 2 { [rest[color], 1.0 - rest[color + 1]] } else { [0.0; 2] };
            vertices.uvs.push(uv.map(narrow));
        }
    }
}

/// Faces as they are read.
#[derive(Default)]
struct FaceRows {
    faces: Faces,
    /// Of the face being read.
    corners: Vec<u32>,
}

impl Part for FaceRows {
    fn append(&mut self, more: Self) {
        self.faces.append(more.faces, 0);
    }
}

fn read_faces(scanner: &mut Scanner<'_>, count: u64, vertices: usize) -> Result<Faces, Problem> {
    let mut all = FaceRows::default();
    // "3 0 1 2" and a line end.
    all.faces.triangles.reserve(usize::try_from(count).unwrap_or(usize::MAX).min(scanner.rest().len() / 8));
    pieces::rows(scanner, count, &mut all, |scanner, rows, face| {
        let size = scanner
            .count()
            .ok_or_else(|| scanner.unexpected(&format!("the number of corners of face {face} of {count}")))?;
        rows.corners.clear();
        for _ in 0..size {
            let vertex = scanner.count().ok_or_else(|| scanner.unexpected(&format!("a vertex of face {face}")))?;
            match u32::try_from(vertex) {
                Ok(index) if (index as usize) < vertices => rows.corners.push(index),
                _ => {
                    let what =
                        format!("face {face} names vertex {vertex}, but the file has {vertices}, counted from 0");
                    return Err(scanner.problem(what));
                }
            }
        }
        rows.faces.push(&rows.corners);
        scanner.skip_line();
        Ok(())
    })?;
    Ok(all.faces)
}
