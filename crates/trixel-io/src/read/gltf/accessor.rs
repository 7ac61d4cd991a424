//! Typed views of buffers: any component type, interleaved, sparse, normalized (glTF 2.0, sections 3.6.2 and 3.11, and
//! `KHR_mesh_quantization`).

use super::buffer::Buffers;
use super::json::{Accessor, Document};
use crate::read::Problem;
use crate::read::assemble::Budget;

/// Decodes accessors, every access checked.
pub(super) struct Accessors<'a> {
    pub(super) document: &'a Document<'a>,
    pub(super) buffers: &'a Buffers<'a>,
}

/// What a component is stored as.
#[derive(Clone, Copy, PartialEq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn from_code(code: u32, at: &str) -> Result<Self, Problem> {
        Ok(match code {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return Err(Problem::new(at, format!("has the unknown component type {code}"))),
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }
}

impl Accessors<'_> {
    /// How many elements an accessor has.
    pub(super) fn count(&self, index: usize) -> Result<usize, Problem> {
        Ok(self.get(index)?.0.count)
    }

    /// The type of an accessor's elements: "VEC3".
    pub(super) fn kind(&self, index: usize) -> Result<&str, Problem> {
        Ok(&self.get(index)?.0.kind)
    }

    /// Whether an accessor has bytes of its own.
    pub(super) fn has_view(&self, index: usize) -> Result<bool, Problem> {
        Ok(self.get(index)?.0.buffer_view.is_some())
    }

    /// The elements of a `SCALAR`, `VEC2`, `VEC3`, `VEC4` or `MAT4` accessor, normalized integers mapped to -1..1 or 0..1.
    pub(super) fn vectors<const N: usize>(&self, index: usize, budget: &mut Budget) -> Result<Vec<[f64; N]>, Problem> {
        let (accessor, at) = self.get(index)?;
        let kind = match N {
            1 => "SCALAR".to_owned(),
            16 => "MAT4".to_owned(),
            _ => format!("VEC{N}"),
        };
        if accessor.kind != kind {
            return Err(Problem::new(at, format!("is of type {} where {kind} is needed", accessor.kind)));
        }
        let component = Component::from_code(accessor.component_type, &at)?;
        if component == Component::U32 {
            return Err(Problem::new(at, "has component type 5125, which only indices may have"));
        }
        budget.take(&at, accessor.count)?;
        let size = N * component.size();
        let mut values = match accessor.buffer_view {
            None => vec![[0.0; N]; accessor.count],
            Some(view) => {
                let (bytes, stride) = self.buffers.view(view, &at)?;
                let elements = elements(bytes, accessor.byte_offset, stride, size, accessor.count, &at)?;
                vectors_from(elements, component, accessor.normalized)
            }
        };
        if let Some(sparse) = &accessor.sparse {
            let at = format!("{at}, sparse");
            budget.take(&at, sparse.count)?;
            let indices = {
                let component = Component::from_code(sparse.indices.component_type, &at)?;
                let (bytes, _) = self.buffers.view(sparse.indices.buffer_view, &at)?;
                let offset = sparse.indices.byte_offset;
                indices_from(elements(bytes, offset, None, component.size(), sparse.count, &at)?, component, &at)?
            };
            let (bytes, _) = self.buffers.view(sparse.values.buffer_view, &at)?;
            let replacements = elements(bytes, sparse.values.byte_offset, None, size, sparse.count, &at)?;
            for (place, value) in
                indices.into_iter().zip(vectors_from::<N>(replacements, component, accessor.normalized))
            {
                match values.get_mut(place as usize) {
                    Some(slot) => *slot = value,
                    None => {
                        return Err(Problem::new(
                            at,
                            format!("replaces element {place}, but there are only {}", accessor.count),
                        ));
                    }
                }
            }
        }
        Ok(values)
    }

    /// The elements of an accessor of indices.
    pub(super) fn indices(&self, index: usize, budget: &mut Budget) -> Result<Vec<u32>, Problem> {
        let (accessor, at) = self.get(index)?;
        if accessor.kind != "SCALAR" {
            return Err(Problem::new(at, format!("is of type {} where indices (SCALAR) are needed", accessor.kind)));
        }
        if accessor.sparse.is_some() {
            return Err(Problem::new(at, "holds sparse indices, which are not supported; export it again without"));
        }
        let component = Component::from_code(accessor.component_type, &at)?;
        // Three indices a triangle.
        budget.take(&at, accessor.count / 3)?;
        let Some(view) = accessor.buffer_view else {
            return Err(Problem::new(at, "holds indices but names no bufferView"));
        };
        let (bytes, stride) = self.buffers.view(view, &at)?;
        indices_from(
            elements(bytes, accessor.byte_offset, stride, component.size(), accessor.count, &at)?,
            component,
            &at,
        )
    }

    fn get(&self, index: usize) -> Result<(&Accessor, String), Problem> {
        let at = format!("accessor {index}");
        match self.document.accessors.get(index) {
            Some(accessor) => Ok((accessor, at)),
            None => Err(Problem::new(at, "does not exist, but the file names it; the file is damaged")),
        }
    }
}

/// The bytes of each element.
fn elements<'b>(
    bytes: &'b [u8],
    offset: usize,
    stride: Option<usize>,
    size: usize,
    count: usize,
    at: &str,
) -> Result<std::slice::Chunks<'b, u8>, Problem> {
    // Exporters of the first glTF wrote 0 for "without gaps".
    let stride = stride.filter(|&stride| stride != 0).unwrap_or(size);
    if stride < size {
        return Err(Problem::new(
            at,
            format!("has a byteStride of {stride}, less than the {size} bytes of an element"),
        ));
    }
    if count == 0 {
        return Ok([].chunks(stride));
    }
    let span = (count - 1).checked_mul(stride).and_then(|n| n.checked_add(size));
    let all = span.and_then(|span| offset.checked_add(span)).and_then(|end| bytes.get(offset..end));
    match all {
        Some(all) => Ok(all.chunks(stride)),
        None => Err(Problem::new(
            at,
            format!(
                "needs {count} elements of {size} bytes, {stride} apart, from byte {offset}, but its bufferView has \
                 only {} bytes; the file is cut off or damaged",
                bytes.len()
            ),
        )),
    }
}

fn vectors_from<const N: usize>(
    elements: std::slice::Chunks<'_, u8>,
    component: Component,
    normalized: bool,
) -> Vec<[f64; N]> {
    let signed = |value: f64, most: f64| if normalized { (value / most).max(-1.0) } else { value };
    let unsigned = |value: f64, most: f64| if normalized { value / most } else { value };
    match component {
        Component::I8 => convert(elements, |b| signed(i8::from_le_bytes(b).into(), i8::MAX.into())),
        Component::U8 => convert(elements, |b| unsigned(u8::from_le_bytes(b).into(), u8::MAX.into())),
        Component::I16 => convert(elements, |b| signed(i16::from_le_bytes(b).into(), i16::MAX.into())),
        Component::U16 => convert(elements, |b| unsigned(u16::from_le_bytes(b).into(), u16::MAX.into())),
        Component::U32 => convert(elements, |b| unsigned(u32::from_le_bytes(b).into(), u32::MAX.into())),
        Component::F32 => convert(elements, |b| f32::from_le_bytes(b).into()),
    }
}

fn convert<const N: usize, const W: usize>(
    elements: std::slice::Chunks<'_, u8>,
    value: impl Fn([u8; W]) -> f64,
) -> Vec<[f64; N]> {
    let element = |bytes: &[u8]| {
        let (words, _) = bytes.as_chunks::<W>();
        std::array::from_fn(|i| words.get(i).map_or(0.0, |&word| value(word)))
    };
    elements.map(element).collect()
}

fn indices_from(elements: std::slice::Chunks<'_, u8>, component: Component, at: &str) -> Result<Vec<u32>, Problem> {
    fn read<const W: usize>(elements: std::slice::Chunks<'_, u8>, value: impl Fn([u8; W]) -> u32) -> Vec<u32> {
        elements.map(|bytes| bytes.first_chunk().map_or(u32::MAX, |&word| value(word))).collect()
    }
    match component {
        Component::U8 => Ok(read(elements, |b| u8::from_le_bytes(b).into())),
        Component::U16 => Ok(read(elements, |b| u16::from_le_bytes(b).into())),
        Component::U32 => Ok(read(elements, u32::from_le_bytes)),
        Component::I8 | Component::I16 | Component::F32 => {
            Err(Problem::new(at, "holds indices that are signed or not integers"))
        }
    }
}
