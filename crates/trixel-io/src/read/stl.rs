//! STL, binary and ASCII.
//!
//! Every triangle gets three vertices of its own, as the file has them. Facet normals are not read: they say no more than
//! the corners do. Own code because crates for STL keep `f32` where ASCII files hold more digits, and take any file that
//! starts with `solid` for ASCII.

use rayon::prelude::*;
use trixel::Mesh;

use super::pieces::{self, Part};
use super::polygon::Faces;
use super::text::{self, Scanner};
use super::{Loaded, Problem, ReadOptions, Resources};

const HEADER: usize = 80;
/// Header and triangle count.
pub(super) const PREFIX: usize = HEADER + 4;
/// Twelve floats (normal, three corners) and two bytes of attributes.
pub(super) const TRIANGLE: usize = 50;

pub(super) fn read(bytes: &[u8], _options: &ReadOptions, _resources: &dyn Resources) -> Result<Loaded, Problem> {
    if looks_binary_by_size(bytes) || !looks_ascii(bytes) { read_binary(bytes) } else { read_ascii(bytes) }
}

/// Whether the size is exactly that of the binary file whose triangle count this would be.
pub(super) fn looks_binary_by_size(bytes: &[u8]) -> bool {
    claimed_triangles(bytes).is_some_and(|count| (bytes.len() - PREFIX) as u64 == count * TRIANGLE as u64)
}

/// `solid` in front proves nothing: some binary headers start with it too. Binary files hold zero bytes soon.
fn looks_ascii(bytes: &[u8]) -> bool {
    let bytes = text::without_byte_order_mark(bytes).trim_ascii_start();
    let head = &bytes[..bytes.len().min(1024)];
    head.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid")) && !head.contains(&0)
}

fn claimed_triangles(bytes: &[u8]) -> Option<u64> {
    let count = bytes.get(HEADER..PREFIX)?.first_chunk()?;
    Some(u64::from(u32::from_le_bytes(*count)))
}

fn read_binary(bytes: &[u8]) -> Result<Loaded, Problem> {
    let Some(count) = claimed_triangles(bytes) else {
        let what = format!(
            "the file has only {} bytes; a binary STL file starts with {PREFIX} and an ASCII one with `solid`: it is \
             truncated or not STL",
            bytes.len()
        );
        return Err(Problem::new("start", what));
    };
    let data = bytes.get(PREFIX..).unwrap_or_default();
    let whole = data.len() / TRIANGLE;
    let Some(count) = usize::try_from(count).ok().filter(|&count| count <= whole) else {
        let what = format!(
            "the header promises {count} triangles, but the file holds only {whole}: it is truncated or not STL"
        );
        return Err(Problem::new(format!("byte {HEADER}"), what));
    };
    let mut warnings = Vec::new();
    let (data, trailing) = data.split_at(count * TRIANGLE);
    if count == 0 && whole > 0 {
        let what = format!("the header promises no triangles, but there is data for {whole} behind it");
        return Err(Problem::new(format!("byte {HEADER}"), what));
    }
    if !trailing.is_empty() {
        warnings.push(format!("ignored {} bytes behind the last triangle", trailing.len()));
    }

    let mut positions = Vec::with_capacity(3 * count);
    for record in data.as_chunks::<TRIANGLE>().0 {
        positions.extend_from_slice(&corners(record));
    }
    let Some(vertices) = u32::try_from(positions.len()).ok() else {
        return Err(Problem::new(format!("byte {HEADER}"), "more than 1,431,655,765 triangles: split the file"));
    };
    let triangles = (0..vertices / 3).map(|triangle| [3 * triangle, 3 * triangle + 1, 3 * triangle + 2]).collect();
    Ok(Loaded { mesh: Mesh::new(positions, triangles), warnings })
}

/// The corners in a record of a binary file.
pub(super) fn corners(record: &[u8; TRIANGLE]) -> [[f64; 3]; 3] {
    let corner = |at: usize| -> [f64; 3] {
        std::array::from_fn(|axis| {
            let at = at + 4 * axis;
            f64::from(f32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]]))
        })
    };
    [corner(12), corner(24), corner(36)]
}

/// The number of triangles, if a file of `length` bytes that starts with `head` is surely binary.
pub(super) fn binary_triangles(head: &[u8], length: u64) -> Option<u64> {
    let count = claimed_triangles(head)?;
    (length == PREFIX as u64 + count * TRIANGLE as u64).then_some(count)
}

fn read_ascii(bytes: &[u8]) -> Result<Loaded, Problem> {
    let bytes = text::without_byte_order_mark(bytes);
    let read = match read_pieces(bytes) {
        Some(read) => read,
        None => Ascii::read(bytes)?,
    };
    let mut warnings = Vec::new();
    if read.open == Some(true) {
        warnings.push("there is no `endsolid` at the end; the file may be truncated".into());
    }
    if read.unknown > 0 {
        warnings.push(format!("ignored {} words that are not of the STL format", read.unknown));
    }
    let triangles = read.faces.finish(&read.positions, &mut [], &mut warnings);
    Ok(Loaded { mesh: Mesh::new(read.positions, triangles), warnings })
}

/// The whole in pieces that start with a facet each; `None` if one thread would read anything else.
fn read_pieces(bytes: &[u8]) -> Option<Ascii> {
    let facet = |at: usize| {
        let line = bytes[at..].trim_ascii_start();
        line.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"facet"))
    };
    let pieces = pieces::cut(bytes, facet);
    if pieces.len() == 1 {
        return None;
    }
    let parts: Vec<Ascii> = pieces.par_iter().map(|piece| Ascii::read(piece.bytes).ok()).collect::<Option<_>>()?;
    u32::try_from(parts.iter().map(|part| part.positions.len()).sum::<usize>()).ok()?;
    let mut all = Ascii::default();
    parts.into_iter().for_each(|part| all.append(part));
    Some(all)
}

/// What is read from an ASCII file, or from a piece of whole facets.
#[derive(Default)]
struct Ascii {
    positions: Vec<[f64; 3]>,
    faces: Faces,
    /// Whether it ends inside a solid, if one starts or ends in it.
    open: Option<bool>,
    /// Words that are none of the format's.
    unknown: u64,
}

impl Part for Ascii {
    fn append(&mut self, more: Self) {
        // There are fewer than 2^32 vertices in all.
        let first = u32::try_from(self.positions.len()).unwrap_or(u32::MAX);
        self.faces.append(more.faces, first);
        self.positions.extend(more.positions);
        self.open = more.open.or(self.open);
        self.unknown += more.unknown;
    }
}

impl Ascii {
    fn read(bytes: &[u8]) -> Result<Self, Problem> {
        let mut scanner = Scanner::new(bytes);
        let mut read = Self::default();
        // The vertices of the facet being read start here.
        let mut facet: Option<usize> = None;
        let mut corners = Vec::new();
        while let Some(word) = scanner.word() {
            let is = |keyword: &str| word.eq_ignore_ascii_case(keyword.as_bytes());
            if is("vertex") {
                let mut position = [0.0; 3];
                for coordinate in &mut position {
                    *coordinate = scanner.float().ok_or_else(|| scanner.unexpected("a coordinate"))?;
                }
                facet.get_or_insert(read.positions.len());
                read.positions.push(position);
            } else if is("facet") {
                if facet.is_some() {
                    return Err(scanner.problem("this facet starts before the last one ends with `endfacet`"));
                }
            } else if is("normal") {
                // Words, not numbers: some exporters write `-nan(ind)` for a triangle without an area.
                (0..3).for_each(|_| _ = scanner.word_on_line());
            } else if is("endfacet") {
                let first = facet.take().unwrap_or(read.positions.len());
                corners.clear();
                for vertex in first..read.positions.len() {
                    let index = u32::try_from(vertex)
                        .map_err(|_| scanner.problem("more than 2^32 vertices: split the file"))?;
                    corners.push(index);
                }
                read.faces.push(&corners);
            } else if is("solid") {
                scanner.skip_line();
                read.open = Some(true);
            } else if is("endsolid") {
                scanner.skip_line();
                read.open = Some(false);
            } else if !(is("outer") || is("loop") || is("endloop")) {
                read.unknown += 1;
            }
        }
        if facet.is_some() {
            return Err(scanner.problem("the file ends inside a facet; it is truncated"));
        }
        Ok(read)
    }
}
