//! Binary STL and PLY files of triangles, read in passes: for meshes that do not fit the memory.
//!
//! Of STL nothing is kept between passes; of PLY the vertices are, 12 bytes each where the file has 32-bit floats.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::ply_header::{Element, Encoding, Header, Kind, Scalar};
use super::{MeshFormat, Problem, ReadError, damaged, ply, stl};
use crate::open::open;

/// Triangles decoded by one task.
const TASK: usize = 1 << 13;
/// Bytes of a file that are read at a time; the next are read while these are worked on.
const BLOCK_BYTES: usize = 8 << 20;
/// A header is at most this long; files with longer ones are read whole.
const HEADER_BYTES: u64 = 1 << 16;

/// A mesh file whose triangles can be gone through several times without holding them.
#[derive(Debug)]
pub struct MeshStream {
    path: PathBuf,
    triangles: u64,
    /// Where the first record is.
    start: u64,
    record: Record,
}

/// How a triangle is stored.
#[derive(Debug)]
enum Record {
    Stl,
    Ply { stride: usize, offset: usize, big: bool, vertices: Vertices },
}

/// Vertices, as exact as the file has them.
#[derive(Debug)]
enum Vertices {
    Single(Vec<[f32; 3]>),
    Double(Vec<[f64; 3]>),
}

impl Vertices {
    fn get(&self, index: u32) -> Option<[f64; 3]> {
        match self {
            Self::Single(vertices) => Some(vertices.get(index as usize)?.map(f64::from)),
            Self::Double(vertices) => vertices.get(index as usize).copied(),
        }
    }
}

impl MeshStream {
    /// Opens a mesh file to be read in passes; `None` if it is not a binary STL or PLY file of triangles alone with their
    /// vertices in front, so that [`super::read_mesh`] has to read it.
    ///
    /// # Errors
    /// When the file cannot be read or is damaged.
    pub fn open(path: &Path) -> Result<Option<Self>, ReadError> {
        let failed = |source| ReadError::Io { path: path.to_owned(), source };
        let (file, length) = open(path).map_err(failed)?;
        if !file.metadata().map_err(failed)?.is_file() {
            return Ok(None);
        }
        let mut head = Vec::new();
        file.take(HEADER_BYTES).read_to_end(&mut head).map_err(failed)?;
        match MeshFormat::from_path(path) {
            Some(MeshFormat::Stl) => Ok(stl::binary_triangles(&head, length).map(|triangles| Self {
                path: path.to_owned(),
                triangles,
                start: stl::PREFIX as u64,
                record: Record::Stl,
            })),
            Some(MeshFormat::Ply) => Self::open_ply(path, &head, length),
            _ => Ok(None),
        }
    }

    fn open_ply(path: &Path, head: &[u8], length: u64) -> Result<Option<Self>, ReadError> {
        let Ok(header) = Header::parse(head) else { return Ok(None) };
        let big = match header.encoding {
            Encoding::Ascii => return Ok(None),
            Encoding::LittleEndian => false,
            Encoding::BigEndian => true,
        };
        let [vertex, face, ..] = header.elements.as_slice() else { return Ok(None) };
        if vertex.name != b"vertex" || face.name != b"face" {
            return Ok(None);
        }
        let (Some(layout), Some((stride, offset))) = (VertexLayout::of(vertex), ply::triangle_rows(face)) else {
            return Ok(None);
        };
        let vertices_start = header.end as u64;
        let start = vertices_start.saturating_add(vertex.count.saturating_mul(layout.stride as u64));
        let end = start.saturating_add(face.count.saturating_mul(stride as u64));
        if end > length {
            let what = format!("the header promises {end} bytes, but the file has only {length}: it is truncated");
            return Err(damaged(path, Problem::new("header", what)));
        }
        let vertices = layout.read(path, vertices_start, vertex.count, big)?;
        let record = Record::Ply { stride, offset, big, vertices };
        Ok(Some(Self { path: path.to_owned(), triangles: face.count, start, record }))
    }

    /// The number of triangles.
    #[must_use]
    pub fn triangle_count(&self) -> u64 {
        self.triangles
    }

    /// Bytes that one pass reads.
    #[must_use]
    pub fn bytes_per_pass(&self) -> u64 {
        self.triangles * self.stride() as u64
    }

    /// Bytes that are held between passes.
    #[must_use]
    pub fn bytes_held(&self) -> u64 {
        match &self.record {
            Record::Stl => 0,
            Record::Ply { vertices: Vertices::Single(vertices), .. } => vertices.len() as u64 * 12,
            Record::Ply { vertices: Vertices::Double(vertices), .. } => vertices.len() as u64 * 24,
        }
    }

    /// Bytes that a pass takes beside [`Self::bytes_held`].
    #[must_use]
    pub fn bytes_in_flight() -> u64 {
        // Two blocks, and one decoded: an STL triangle of 50 bytes becomes 72.
        4 * BLOCK_BYTES as u64
    }

    fn stride(&self) -> usize {
        match &self.record {
            Record::Stl => stl::TRIANGLE,
            Record::Ply { stride, .. } => *stride,
        }
    }

    /// Goes through the file once: `map` gets the number of the first of some triangles, and their corners, on several
    /// threads; `each` gets what it gave, in the order of the file, on the calling thread.
    ///
    /// # Errors
    /// When the file cannot be read, or a triangle names a vertex that does not exist, or is none.
    pub fn for_each<T: Send>(
        &self,
        map: impl Fn(u64, &[[[f64; 3]; 3]]) -> T + Sync,
        mut each: impl FnMut(T),
    ) -> Result<(), ReadError> {
        let failed = |source| ReadError::Io { path: self.path.clone(), source };
        let (mut file, _) = open(&self.path).map_err(failed)?;
        file.seek(SeekFrom::Start(self.start)).map_err(failed)?;
        let stride = self.stride();
        let block = BLOCK_BYTES / (stride * TASK) * TASK;
        let block = block.max(TASK);
        let mut left = self.triangles;
        let mut first = 0;
        let mut read_next = |bytes: &mut Vec<u8>| -> std::io::Result<()> {
            let count = usize::try_from(left).unwrap_or(usize::MAX).min(block);
            bytes.resize(count * stride, 0);
            file.read_exact(bytes)?;
            left -= count as u64;
            Ok(())
        };
        let (mut now, mut next) = (Vec::new(), Vec::new());
        read_next(&mut now).map_err(failed)?;
        while !now.is_empty() {
            // Reading and working overlap.
            let (read, results) = rayon::join(
                || read_next(&mut next),
                || -> Result<Vec<T>, Problem> {
                    let tasks = now.par_chunks(TASK * stride).enumerate();
                    let work = |(task, bytes): (usize, &[u8])| {
                        let first = first + (task * TASK) as u64;
                        Ok(map(first, &self.decode(first, bytes)?))
                    };
                    tasks.map(work).collect()
                },
            );
            results.map_err(|problem| damaged(&self.path, problem))?.into_iter().for_each(&mut each);
            read.map_err(failed)?;
            first += (now.len() / stride) as u64;
            std::mem::swap(&mut now, &mut next);
        }
        Ok(())
    }

    fn decode(&self, first: u64, bytes: &[u8]) -> Result<Vec<[[f64; 3]; 3]>, Problem> {
        match &self.record {
            Record::Stl => Ok(bytes.as_chunks().0.iter().map(stl::corners).collect()),
            Record::Ply { stride, offset, big, vertices } => {
                let triangle = |(row, bytes): (u64, &[u8])| {
                    let problem = |what: String| Problem::new(format!("face {row}"), what);
                    let Some(indices) = ply::triangle_of_row(bytes.get(*offset..).unwrap_or_default(), *big) else {
                        return Err(problem(
                            "it is no triangle, and files that do not fit the memory are read only if all are; \
                             triangulate the mesh, or raise the memory limit"
                                .into(),
                        ));
                    };
                    let corner = |index: u32| {
                        vertices
                            .get(index)
                            .ok_or_else(|| problem(format!("it names vertex {index}, which is not there")))
                    };
                    Ok([corner(indices[0])?, corner(indices[1])?, corner(indices[2])?])
                };
                (first..).zip(bytes.chunks_exact(*stride)).map(triangle).collect()
            }
        }
    }
}

/// Where the coordinates are in the rows of vertices.
struct VertexLayout {
    stride: usize,
    /// Place and type of x, y and z.
    coordinates: [(usize, Scalar); 3],
}

impl VertexLayout {
    fn of(element: &Element<'_>) -> Option<Self> {
        let mut stride = 0;
        let mut coordinates = [None; 3];
        for property in &element.properties {
            let Kind::Scalar(scalar) = property.kind else { return None };
            if let Some(axis) = [b"x", b"y", b"z"].iter().position(|name| *name == property.name) {
                coordinates[axis] = Some((stride, scalar));
            }
            stride += scalar.size();
        }
        Some(Self { stride, coordinates: [coordinates[0]?, coordinates[1]?, coordinates[2]?] })
    }

    fn read(&self, path: &Path, start: u64, count: u64, big: bool) -> Result<Vertices, ReadError> {
        let failed = |source| ReadError::Io { path: path.to_owned(), source };
        let mut file = File::open(path).map_err(failed)?;
        file.seek(SeekFrom::Start(start)).map_err(failed)?;
        let mut file = BufReader::with_capacity(1 << 20, file);
        // The caller has checked the count against the file's length.
        let capacity = usize::try_from(count).unwrap_or(usize::MAX);
        let single = self.coordinates.iter().all(|(_, scalar)| *scalar == Scalar::F32);
        let mut vertices = if single {
            Vertices::Single(Vec::with_capacity(capacity))
        } else {
            Vertices::Double(Vec::with_capacity(capacity))
        };
        let mut row = vec![0; self.stride];
        for _ in 0..count {
            file.read_exact(&mut row).map_err(failed)?;
            let number = |axis: usize| {
                let (offset, scalar) = self.coordinates[axis];
                ply::number(scalar, row.get(offset..).unwrap_or_default(), big).unwrap_or(f64::NAN)
            };
            let vertex = [number(0), number(1), number(2)];
            match &mut vertices {
                #[expect(clippy::cast_possible_truncation, reason = "they were f32")]
                Vertices::Single(list) => list.push(vertex.map(|c| c as f32)),
                Vertices::Double(list) => list.push(vertex),
            }
        }
        Ok(vertices)
    }
}
