//! The format of a file whose name does not tell, from its first bytes.

use memchr::memmem;

use super::{MeshFormat, off, stl, text};

/// How far into an XML file its first element may be.
const XML_PROLOGUE: usize = 4096;

/// The format that the bytes are of, as far as that can be seen; OBJ and binary STL have no mark of their own, and only
/// the latter's size gives it away.
pub(super) fn format_of(bytes: &[u8]) -> Option<MeshFormat> {
    let start = text::without_byte_order_mark(bytes).trim_ascii_start();
    if bytes.starts_with(b"PK\x03\x04") {
        Some(MeshFormat::ThreeMf)
    } else if bytes.starts_with(b"glTF") {
        Some(MeshFormat::Glb)
    } else if stl::looks_binary_by_size(bytes) {
        Some(MeshFormat::Stl)
    } else if matches!(start, [b'p', b'l', b'y', b'\r' | b'\n' | b' ', ..]) {
        Some(MeshFormat::Ply)
    } else if start.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid")) {
        Some(MeshFormat::Stl)
    } else if start.starts_with(b"{") && memmem::find(start, b"\"asset\"").is_some() {
        Some(MeshFormat::Gltf)
    } else if start.starts_with(b"<") && memmem::find(&start[..start.len().min(XML_PROLOGUE)], b"<COLLADA").is_some() {
        Some(MeshFormat::Collada)
    } else if off::looks_like_off(bytes) {
        Some(MeshFormat::Off)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_format_by_its_first_bytes() {
        let mut binary_stl = vec![b'x'; 84 + 50];
        binary_stl[80..84].copy_from_slice(&1u32.to_le_bytes());
        let cases: [(&[u8], Option<MeshFormat>); 15] = [
            (b"ply\nformat ascii 1.0\n", Some(MeshFormat::Ply)),
            (b"ply\r\nformat", Some(MeshFormat::Ply)),
            (b"glTF\x02\0\0\0", Some(MeshFormat::Glb)),
            (b"OFF\n3 1 0", Some(MeshFormat::Off)),
            (b"# made by hand\nSTCNOFF 3 1 0", Some(MeshFormat::Off)),
            (b"solid cube\n", Some(MeshFormat::Stl)),
            (b"  SOLID cube\n", Some(MeshFormat::Stl)),
            (&binary_stl, Some(MeshFormat::Stl)),
            (b"PK\x03\x04rest", Some(MeshFormat::ThreeMf)),
            (b" {\"scene\": 0, \"asset\": {\"version\": \"2.0\"}}", Some(MeshFormat::Gltf)),
            (b"\xef\xbb\xbf<?xml version=\"1.0\"?>\n<COLLADA xmlns=", Some(MeshFormat::Collada)),
            (b"<svg>", None),
            (b"{\"a\": 1}", None),
            (b"KICKOFF", None),
            (b"", None),
        ];
        for (bytes, format) in cases {
            assert_eq!(format_of(bytes), format, "{}", String::from_utf8_lossy(bytes));
        }
    }
}
