//! STL, binary and ASCII.

use trixel_io::read::{Loaded, MeshFormat};

fn read(bytes: impl AsRef<[u8]>) -> Loaded {
    super::read(MeshFormat::Stl, bytes)
}

fn error(bytes: impl AsRef<[u8]>) -> String {
    super::error(MeshFormat::Stl, bytes)
}

/// A binary file of two triangles.
pub(super) fn binary(header: &str) -> Vec<u8> {
    let mut bytes = header.as_bytes().to_vec();
    bytes.resize(80, 0);
    bytes.extend(2u32.to_le_bytes());
    for triangle in [[0.1f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0, 0.0, 1.0, 0.0, 1.0, 1e-38]]
    {
        bytes.extend([0; 12]);
        bytes.extend(triangle.iter().flat_map(|c| c.to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

const FACET: &str =
    "facet normal 0 0 1\n outer loop\n  vertex 0.1 0 0\n  vertex 1 0 0\n  vertex 0 1 0\n endloop\nendfacet\n";

#[test]
fn binary_floats_are_widened_exactly() {
    let loaded = read(binary("made by hand"));
    assert_eq!(loaded.mesh.triangles, [[0, 1, 2], [3, 4, 5]]);
    assert_eq!(loaded.mesh.positions[0], [f64::from(0.1f32), 0.0, 0.0]);
    assert_eq!(loaded.mesh.positions[5][2], f64::from(1e-38f32));
    assert!(loaded.warnings.is_empty());
}

#[test]
fn binary_that_starts_with_solid_is_binary() {
    assert_eq!(read(binary("solid cube")).mesh.triangles.len(), 2);
    assert!(error(&binary("solid cube")[..150]).contains("truncated"));
}

#[test]
fn binary_with_fewer_triangles_than_promised_is_truncated() {
    let bytes = binary("x");
    let message = "byte 80: the header promises 2 triangles, but the file holds only 1";
    assert!(error(&bytes[..bytes.len() - 1]).contains(message));
    assert!(error(&bytes[..83]).contains("only 83 bytes"));
    let mut lying = bytes.clone();
    lying[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(error(lying).contains("promises 4294967295 triangles"));
    let mut lying = bytes;
    lying[80..84].copy_from_slice(&[0; 4]);
    assert!(error(lying).contains("promises no triangles, but there is data for 2"));
}

#[test]
fn bytes_behind_the_last_triangle_are_a_warning() {
    let mut bytes = binary("x");
    bytes.extend([7; 33]);
    let loaded = read(bytes);
    assert_eq!(loaded.mesh.triangles.len(), 2);
    assert_eq!(loaded.warnings, ["ignored 33 bytes behind the last triangle"]);
}

#[test]
fn ascii_coordinates_are_the_nearest_f64() {
    let loaded = read(format!("solid a\n{FACET}endsolid a\n"));
    assert_eq!(loaded.mesh.positions, [[0.1, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    assert!(loaded.warnings.is_empty());
}

#[test]
fn several_solids_upper_case_and_names_that_are_keywords() {
    let text = format!("  SOLID vertex facet\n{}ENDSOLID facet\nsolid\n{FACET}endsolid\n", FACET.to_uppercase());
    assert_eq!(read(text).mesh.triangles, [[0, 1, 2], [3, 4, 5]]);
}

#[test]
fn a_missing_endsolid_is_a_warning_and_a_facet_cut_off_an_error() {
    let text = format!("solid a\n{FACET}{FACET}");
    assert_eq!(read(&text).warnings, ["there is no `endsolid` at the end; the file may be truncated"]);
    assert!(error(&text[..text.len() - 12]).contains("the file ends inside a facet; it is truncated"));
    let message = error(&text[..text.find("1 0 0").unwrap() + 3]);
    assert!(message.contains("line 4: expected a coordinate, but the file ends here"), "{message}");
}

#[test]
fn facets_of_four_corners_and_of_two() {
    let facet = |corners: &[&str]| {
        let vertices: String = corners.iter().map(|c| format!("vertex {c}\n")).collect();
        format!("facet normal 0 0 0\nouter loop\n{vertices}endloop\nendfacet\n")
    };
    let text = format!("solid\n{}{}endsolid", facet(&["0 0 0", "1 0 0", "1 1 0", "0 1 0"]), facet(&["0 0 0", "1 0 0"]));
    let loaded = read(text);
    assert_eq!(loaded.mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(loaded.warnings, ["skipped 1 faces with fewer than 3 corners"]);
}

#[test]
fn facets_on_one_line_and_normals_that_are_no_numbers() {
    let facet =
        "facet normal -nan(ind) -nan(ind) -nan(ind) outer loop vertex 0 0 0 vertex 1 0 0 vertex 0 1 0 endloop endfacet";
    let loaded = read(format!("solid a\n{facet} {facet}\nendsolid"));
    assert_eq!(loaded.mesh.triangles, [[0, 1, 2], [3, 4, 5]]);
    assert!(loaded.warnings.is_empty());
}

#[test]
fn a_wrong_number_names_its_line() {
    let message = error("solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 zero 0\n");
    assert!(message.contains("line 4: expected a coordinate, found `zero`"), "{message}");
    assert!(error(format!("solid a\n{}endsolid", FACET.replace("0.1", "nan"))).contains("not finite"));
}

#[test]
fn a_facet_in_a_facet_is_an_error() {
    assert!(
        error("solid a\nfacet normal 0 0 1\nvertex 0 0 0\nfacet normal 0 0 1\n").contains("before the last one ends")
    );
}

#[test]
fn no_facet_is_empty() {
    assert!(super::is_empty(MeshFormat::Stl, "solid a\nendsolid a\n"));
    let mut none = vec![0; 84];
    none[0] = b'x';
    assert!(super::is_empty(MeshFormat::Stl, none));
}
