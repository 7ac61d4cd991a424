//! PLY in all its encodings.

use trixel::Attribute;
use trixel_io::read::{Loaded, MeshFormat, ReadOptions, read_mesh, read_mesh_bytes};

fn read(bytes: impl AsRef<[u8]>) -> Loaded {
    super::read(MeshFormat::Ply, bytes)
}

fn error(bytes: impl AsRef<[u8]>) -> String {
    super::error(MeshFormat::Ply, bytes)
}

const POSITIONS: &str = "property double x\nproperty double y\nproperty double z\n";
const FACES: &str = "property list uchar int vertex_indices\n";

fn ascii(vertex_properties: &str, vertices: &str, faces: &str) -> String {
    let (vertex_count, face_count) = (vertices.lines().count(), faces.lines().count());
    format!(
        "ply\nformat ascii 1.0\nelement vertex {vertex_count}\n{POSITIONS}{vertex_properties}element face {face_count}\n\
         {FACES}end_header\n{vertices}{faces}"
    )
}

const TRIANGLE: &str = "0.1 0 0\n1 0 0\n0 1 0\n";

/// Two triangles and a quad around four vertices, with a skipped element in front and everything that a row can hold.
pub(super) fn binary(big: bool) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat binary_{}_endian 1.0\nelement camera 2\nproperty short a\nproperty list ushort double b\n\
         element vertex 4\nproperty uchar before\nproperty float x\nproperty double y\nproperty short z\nproperty uchar red\n\
         property uchar green\nproperty uchar blue\nelement face 3\nproperty list ushort float extra\n\
         property list uchar uint vertex_index\nproperty int flags\nend_header\n",
        if big { "big" } else { "little" }
    )
    .into_bytes();
    macro_rules! put {
        ($value:expr) => {
            bytes.extend(if big { $value.to_be_bytes().to_vec() } else { $value.to_le_bytes().to_vec() })
        };
    }
    for row in 0..2u16 {
        put!(-7i16);
        put!(row);
        for _ in 0..row {
            put!(0.5f64);
        }
    }
    for (x, y, z) in [(0.1f32, 0.1f64, -3i16), (1.0, 0.0, 0), (1.0, 1.0, 0), (0.0, 1.0, 0)] {
        put!(9u8);
        put!(x);
        put!(y);
        put!(z);
        bytes.extend([255, 0, 51]);
    }
    for face in [&[0u32, 1, 2][..], &[2, 1, 0], &[0, 1, 2, 3]] {
        put!(1u16);
        put!(2.5f32);
        bytes.push(u8::try_from(face.len()).unwrap());
        for &vertex in face {
            put!(vertex);
        }
        put!(-1i32);
    }
    bytes
}

/// Three `float` coordinates and nothing else: the form of large scans, read in bulk.
pub(super) fn plain_binary(big: bool, corners: &[&[i32]]) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat binary_{}_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        if big { "big" } else { "little" },
        corners.len()
    )
    .into_bytes();
    for c in [0.1f32, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0] {
        bytes.extend(if big { c.to_be_bytes() } else { c.to_le_bytes() });
    }
    for face in corners {
        bytes.push(u8::try_from(face.len()).unwrap());
        for vertex in *face {
            bytes.extend(if big { vertex.to_be_bytes() } else { vertex.to_le_bytes() });
        }
    }
    bytes
}

#[test]
fn ascii_numbers_are_the_nearest_f64() {
    let loaded = read(ascii("", TRIANGLE, "3 0 1 2\n"));
    assert_eq!(loaded.mesh.positions, [[0.1, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    assert_eq!(loaded.mesh.triangles, [[0, 1, 2]]);
    assert!(loaded.warnings.is_empty());
}

#[test]
fn both_byte_orders_mixed_types_and_everything_else_skipped() {
    for big in [false, true] {
        let mesh = read(binary(big)).mesh;
        assert_eq!(mesh.positions[0], [f64::from(0.1f32), 0.1, -3.0], "big: {big}");
        assert_eq!(mesh.triangles, [[0, 1, 2], [2, 1, 0], [0, 1, 2], [0, 2, 3]]);
        let color = mesh.colors.unwrap().values[3];
        assert_eq!((color[0], color[1], color[3]), (1.0, 0.0, 1.0));
        assert!((color[2] - 0.033_105).abs() < 1e-5);
    }
}

#[test]
fn plain_triangles_between_polygons_in_both_byte_orders() {
    for big in [false, true] {
        let mesh = read(plain_binary(big, &[&[0, 1, 2], &[0, 1, 2, 3], &[3, 2, 1], &[0, 1], &[0, 2, 3]])).mesh;
        assert_eq!(mesh.positions[0], [f64::from(0.1f32), 0.0, 0.0]);
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 1, 2], [0, 2, 3], [3, 2, 1], [0, 2, 3]]);
        let message = error(plain_binary(big, &[&[0, 1, 2], &[0, -1, 2]]));
        assert!(message.contains("face 1: -1 is not the number of a vertex"), "{message}");
        assert!(error(plain_binary(big, &[&[0, 1, 2], &[0, 1, 4]])).contains("triangle 1: names vertex 4"));
        let whole = plain_binary(big, &[&[0, 1, 2]]);
        assert!(
            error(&whole[..whole.len() - 1]).contains("`vertex_indices` of face 0 of 1, but the file ends too soon")
        );
        assert!(error(&whole[..whole.len() - 20]).contains("`y` of vertex 3 of 4, but the file ends too soon"));
    }
}

#[test]
fn elements_in_any_order() {
    let text = format!(
        "ply\nformat ascii 1.0\nelement face 1\n{FACES}element vertex 3\n{POSITIONS}end_header\n3 0 1 2\n{TRIANGLE}"
    );
    assert_eq!(read(text).mesh.triangles, [[0, 1, 2]]);
}

#[test]
fn tristrips_restart_at_minus_one_and_alternate() {
    for ty in ["int int", "uchar short", "int float"] {
        let text = format!(
            "ply\nformat ascii 1.0\nelement vertex 5\n{POSITIONS}element tristrips 2\nproperty list {ty} vertex_indices\n\
             end_header\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n2 2 0\n9 0 1 2 3 4 -1 4 3 2\n5 0 1 2 2 3\n"
        );
        assert_eq!(read(text).mesh.triangles, [[0, 1, 2], [2, 1, 3], [2, 3, 4], [4, 3, 2], [0, 1, 2]]);
    }
}

#[test]
fn normals_texture_coordinates_and_colours_of_vertices() {
    let properties = "property float nx\nproperty float ny\nproperty float nz\nproperty float s\nproperty float t\n\
                      property float red\nproperty float green\nproperty float blue\nproperty float alpha\n";
    let row = "0 0 1 0.25 0.25 1 0 0 0.5\n";
    let vertices = format!("0 0 0 {row}1 0 0 {row}0 1 0 {row}");
    let mesh = read(ascii(properties, &vertices, "3 0 1 2\n")).mesh;
    assert_eq!(mesh.normals.unwrap().values, [[0.0, 0.0, 1.0]; 3]);
    assert_eq!(mesh.uvs, [Attribute::per_vertex(vec![[0.25, 0.75]; 3])]);
    assert_eq!(mesh.colors.unwrap().values, [[1.0, 0.0, 0.0, 0.5]; 3]);
}

#[test]
fn dark_byte_colours_are_bytes() {
    let properties = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    let mesh = read(ascii(properties, "0 0 0 1 1 1\n1 0 0 0 0 0\n0 1 0 0 0 0\n", "3 0 1 2\n")).mesh;
    assert!(mesh.colors.unwrap().values[0][0] < 0.001);
}

#[test]
fn texture_coordinates_of_faces_keep_seams() {
    let text = format!(
        "ply\nformat ascii 1.0\ncomment TextureFile a.png\ncomment TextureFile b.png\nelement vertex 4\n{POSITIONS}\
         element face 3\n{FACES}property list uchar float texcoord\nproperty int texnumber\nend_header\n\
         0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 6 0 0 1 0 1 1 1\n3 0 2 3 0 0\n4 0 1 2 3 8 0 0 0.5 0 0.5 0.5 0 0.5 -1\n"
    );
    let loaded = read(text);
    let mesh = loaded.mesh;
    let uvs = &mesh.uvs[0];
    assert_eq!(uvs.on_triangle(0, mesh.triangles[0]), Some([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0]]));
    assert_eq!(uvs.on_triangle(1, mesh.triangles[1]), None);
    assert_eq!(uvs.on_triangle(3, mesh.triangles[3]), Some([[0.0, 1.0], [0.5, 0.5], [0.0, 0.5]]));
    assert_eq!(mesh.triangle_materials, [1, 0, 0, 0]);
    assert_eq!(mesh.materials.len(), 2);
    assert_eq!(loaded.warnings[0], "the texture `a.png` is not there; its faces stay without");
}

#[test]
fn a_texture_that_is_there_is_located() {
    let folder = std::env::temp_dir().join(format!("trixel-ply-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let text = ascii("", TRIANGLE, "3 0 1 2\n").replace("1.0\n", "1.0\ncomment TextureFile my wood.png\n");
    std::fs::write(folder.join("mesh.Ply"), text).unwrap();
    std::fs::write(folder.join("my wood.png"), "").unwrap();
    let mesh = read_mesh(&folder.join("mesh.Ply"), &ReadOptions::default()).unwrap().mesh;
    assert_eq!(mesh.images[0].source, trixel::ImageSource::File(folder.join("my wood.png")));
    assert_eq!(mesh.materials[0].base_color_texture, Some(trixel::TextureRef::new(0)));
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn without_attributes_only_positions_and_triangles_are_read() {
    let loaded = read_mesh_bytes(MeshFormat::Ply, &binary(false), &ReadOptions { attributes: false }).unwrap();
    assert_eq!(loaded.mesh.triangles.len(), 4);
    assert!(loaded.mesh.colors.is_none());
}

#[test]
fn lying_counts_end_where_the_file_ends() {
    let lies = ascii("", TRIANGLE, "3 0 1 2\n").replace("element face 1", "element face 18446744073709551615");
    assert!(error(lies).contains("face 1 of 18446744073709551615"));
    let lies = ascii("", TRIANGLE, "3 0 1 2\n").replace("vertex 3", "vertex 4294967295");
    assert!(error(lies).contains("of 4294967295, but the file ends here"));
    let lies = ascii("", TRIANGLE, "3 0 1 2\n").replace("vertex 3", "vertex 4294967296");
    assert!(error(lies).contains("more than 32-bit indices can name"));
    let nothing =
        ascii("", TRIANGLE, "3 0 1 2\n").replace("element vertex", "element nothing 99999999999\nelement vertex");
    assert_eq!(read(nothing).mesh.triangles.len(), 1);
    let long_list =
        ascii("", TRIANGLE, "3 0 1 2\n").replace("list uchar", "list uint").replace("\n3 0 1 2", "\n4000000000 0 1 2");
    assert!(error(long_list).contains("the file ends here"));
}

#[test]
fn errors_say_where_and_what() {
    let good = ascii("", TRIANGLE, "3 0 1 2\n");
    for (text, message) in [
        (good.replace("3 0 1 2", "3 0 1 3"), "triangle 0: names vertex 3"),
        (good.replace("3 0 1 2", "3 0 1 -1"), "face 0: -1 is not the number of a vertex"),
        (good.replace("3 0 1 2", "3 0 1 1.5"), "face 0: 1.5 is not the number of a vertex"),
        (good.replace("3 0 1 2", "3 0 1 x"), "line 13: expected `vertex_indices` of face 0 of 1, found `x`"),
        (good.replace("0.1", "nan"), "vertex 0 (counted from 0): its position (NaN, 0, 0) is not finite"),
        (good.replace("double y", "double w"), "header: the vertices have no number `y`"),
        (good.replace("element vertex", "element vertices"), "header: there is no element `vertex`"),
        (good.replace("end_header", "the end"), "the header has no `end_header`"),
    ] {
        let found = error(text);
        assert!(found.contains(message), "{found}");
    }
}

#[test]
fn points_without_faces_are_empty() {
    let points = format!("ply\nformat ascii 1.0\nelement vertex 3\n{POSITIONS}end_header\n{TRIANGLE}");
    assert!(super::is_empty(MeshFormat::Ply, points));
    assert!(super::is_empty(MeshFormat::Ply, ascii("", TRIANGLE, "")));
    assert_eq!(read(ascii("", TRIANGLE, "2 0 1\n3 0 1 2\n")).warnings, ["skipped 1 faces with fewer than 3 corners"]);
}
