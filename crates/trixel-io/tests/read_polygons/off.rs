//! OFF and its variants.

use trixel_io::read::{Loaded, MeshFormat};

fn read(text: &str) -> Loaded {
    super::read(MeshFormat::Off, text)
}

fn error(text: &str) -> String {
    super::error(MeshFormat::Off, text)
}

#[test]
fn counts_behind_the_header_or_below_comments_or_without_a_header() {
    let body = "0.1 0 0\n1 0 0 # a comment\n\n# another\n0 1 0\n3 0 1 2\n";
    for head in
        ["OFF 3 1 0\n", "OFF\n# comment\n\n3 1 0\n", "# first\nOFF # a\n3 1\n", "3 1 0\n", "\u{feff}OFF\r\n3 1 0\r\n"]
    {
        let loaded = read(&format!("{head}{body}"));
        assert_eq!(loaded.mesh.triangles, [[0, 1, 2]], "{head:?}");
        assert_eq!(loaded.mesh.positions[0], [0.1, 0.0, 0.0]);
        assert!(loaded.warnings.is_empty());
    }
}

#[test]
fn polygons_and_face_colours() {
    let mesh =
        read("OFF\n4 3 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3 255 0 0\n3 0 1 2 0.5 0.5 0.5 1\n3 2 1 0 7\n").mesh;
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 2], [2, 1, 0]]);
    assert!(mesh.colors.is_none());
}

#[test]
fn coff_has_colours_of_three_or_four_numbers_bytes_or_fractions() {
    let bytes = read("COFF\n3 1 0\n0 0 0 255 0 0 255\n1 0 0 0 255 0 0\n0 1 0 0 0 255\n3 0 1 2\n").mesh.colors.unwrap();
    assert_eq!(bytes.values, [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 1.0]]);
    let fractions = read("COFF\n3 1 0\n0 0 0 1 0 0 0.5\n1 0 0 0 1 0 1\n0 1 0\n3 0 1 2\n").mesh.colors.unwrap();
    assert_eq!(fractions.values, [[1.0, 0.0, 0.0, 0.5], [0.0, 1.0, 0.0, 1.0], [1.0; 4]]);
}

#[test]
fn noff_has_normals_and_stoff_texture_coordinates() {
    let mesh = read("NOFF\n3 1 0\n0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 0 1\n3 0 1 2\n").mesh;
    assert_eq!(mesh.normals.unwrap().values, [[0.0, 0.0, 1.0]; 3]);
    let mesh = read("STOFF\n3 1 0\n0 0 0 0.25 0.25\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n").mesh;
    assert_eq!(mesh.uvs[0].values, [[0.25, 0.75], [1.0, 1.0], [0.0, 0.0]]);
}

#[test]
fn combined_headers_in_the_order_normal_colour_texture() {
    let mesh = read(
        "STCNOFF\n3 1 0\n0 0 0 0 0 1 1 0 0 0.5 0.25\n1 0 0 0 0 1 0 1 0 1 0.5 0.25\n0 1 0 0 0 1 0 0 1 0 0\n3 0 1 2\n",
    )
    .mesh;
    assert_eq!(mesh.normals.unwrap().values[0], [0.0, 0.0, 1.0]);
    assert_eq!(mesh.colors.unwrap().values[1], [0.0, 1.0, 0.0, 1.0]);
    assert_eq!(mesh.uvs[0].values[..2], [[0.5, 0.75], [0.5, 0.75]]);
    let mesh = read("CNOFF\n3 1 0\n0 0 0 0 0 1 1 0 0\n1 0 0 0 0 1 1 0 0\n0 1 0 0 0 1 1 0 0\n3 0 1 2\n").mesh;
    assert_eq!(mesh.colors.unwrap().values[0], [1.0, 0.0, 0.0, 1.0]);
}

#[test]
fn other_dimensions_and_binary_are_refused_by_name() {
    for (head, found) in [
        ("4OFF", "`4OFF` holds points"),
        ("nOFF", "`nOFF` holds points"),
        ("4nOFF\n3", "`4nOFF` holds"),
        ("OFF BINARY", "`OFF` BINARY is not supported"),
    ] {
        let message = error(&format!("{head}\n3 1 0\n"));
        assert!(message.contains(&format!("line 1: {found}")), "{message}");
    }
    assert!(error("hello\n").contains("`hello` is not an OFF header"));
}

#[test]
fn errors_name_the_line() {
    for (text, message) in [
        ("OFF\n", "line 2: expected `OFF` or the number of vertices, but the file ends here"),
        ("OFF\n3 x\n", "line 2: expected the number of faces, found `x`"),
        ("OFF\n3 1 0\n0 0 0\n1 0 zero\n", "line 4: expected a coordinate of vertex 1 of 3, found `zero`"),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n", "line 5: expected a coordinate of vertex 2 of 3, but the file ends here"),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "line 6: face 0 names vertex 3, but the file has 3"),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 -1 2\n", "line 6: expected a vertex of face 0, found `-1`"),
        ("OFF\n3 9 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "line 7: expected the number of corners of face 1 of 9"),
        ("OFF\n4294967296 9 0\n", "4294967296 vertices are more than 32-bit"),
        ("OFF\n3 1 0\nnan 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "vertex 0 (counted from 0): its position (NaN, 0, 0) is not"),
    ] {
        let found = error(text);
        assert!(found.contains(message), "{found}");
    }
}

#[test]
fn faces_without_area_are_counted_and_no_face_is_empty() {
    let loaded = read("OFF\n3 4 0\n0 0 0\n1 0 0\n0 1 0\n2 0 1\n1 0\n0\n3 0 1 2\n");
    assert_eq!(loaded.warnings, ["skipped 3 faces with fewer than 3 corners"]);
    assert!(super::is_empty(MeshFormat::Off, "OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n"));
}
