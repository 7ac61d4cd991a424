//! OBJ and MTL.

use trixel::{Attribute, ImageSource, Mesh};
use trixel_io::read::{Loaded, MeshFormat, ReadOptions, read_mesh, read_mesh_bytes};

fn read(text: &str) -> Loaded {
    super::read(MeshFormat::Obj, text)
}

fn error(text: &str) -> String {
    super::error(MeshFormat::Obj, text)
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

#[test]
fn positions_are_the_nearest_f64_to_the_decimal() {
    let mesh = read("v 0.1 -2.7427900000000002e-11 1e30\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").mesh;
    assert_eq!(mesh.positions[0], [0.1, -2.742_790_000_000_000_2e-11, 1e30]);
}

#[test]
fn negative_indices_count_back_from_the_face() {
    let mesh = read("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 5 5 5\nf -1 -2 1\n").mesh;
    assert_eq!(mesh.triangles, [[0, 1, 2], [3, 2, 0]]);
}

#[test]
fn convex_polygons_become_fans_and_concave_ones_are_cut_inside() {
    let quad = read("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n").mesh;
    assert_eq!(quad.triangles, [[0, 1, 2], [0, 2, 3]]);
    // A fan from the first corner would leave the arrow head.
    let arrow = read("v 2 -1 0\nv 0.5 0 0\nv 2 1 0\nv 0 0 0\nf 1 2 3 4\n").mesh;
    assert!(arrow.triangles.iter().all(|t| t.contains(&1) && t.contains(&3)), "{:?}", arrow.triangles);
}

#[test]
fn concave_polygons_keep_their_texture_coordinates_on_their_corners() {
    let mesh = read("v 2 -1 0\nv 0.5 0 0\nv 2 1 0\nv 0 0 0\nvt 0 0\nvt 1 0\nvt 2 0\nvt 3 0\nf 1/1 2/2 3/3 4/4\n").mesh;
    let uvs = &mesh.uvs[0];
    for (triangle, vertices) in mesh.triangles.iter().enumerate() {
        let on_corners = uvs.on_triangle(triangle, *vertices).unwrap();
        assert_eq!(on_corners.map(|uv| uv[0]), vertices.map(|v| f32::from(u16::try_from(v).unwrap())));
    }
}

#[test]
fn faces_may_come_before_their_vertices() {
    assert_eq!(read("f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n").mesh.triangles, [[0, 1, 2]]);
}

#[test]
fn every_form_of_a_face_corner() {
    let head = format!("{TRIANGLE}vt 0.25 0.25\nvt 1 0\nvt 0 1\nvn 0 0 1\n");
    let plain = read(&format!("{head}f 1 2 3\n")).mesh;
    assert!(plain.uvs.is_empty() && plain.normals.is_none());
    let textured = read(&format!("{head}f 1/1 2/2 3/3\n")).mesh;
    assert_eq!(textured.uvs[0].corners.as_deref(), Some(&[[0, 1, 2]][..]));
    assert_eq!(textured.uvs[0].values[0], [0.25, 0.75], "v points down");
    let with_normals = read(&format!("{head}f 1//1 2//1 3//-1\n")).mesh;
    assert!(with_normals.uvs.is_empty());
    assert_eq!(with_normals.normals.unwrap().on_triangle(0, [0, 1, 2]), Some([[0.0, 0.0, 1.0]; 3]));
    let both = read(&format!("{head}f 1/1/1 2/2/1 3/3/1\nf 1/1/ 2 3/3\n")).mesh;
    assert_eq!(both.uvs[0].corners.as_deref(), Some(&[[0, 1, 2], [0, Attribute::<[f32; 2]>::NONE, 2]][..]));
    assert_eq!(both.positions.len(), 3, "vertices are never split");
}

#[test]
fn attributes_that_start_late_stay_on_their_faces() {
    let mesh = read(&format!("{TRIANGLE}vt 0 0\nvt 1 0\nvt 0 1\nf 1 2 3\nf 1/1 2/2 3/3\nf 3 2 1\n")).mesh;
    assert_eq!(mesh.uvs[0].on_triangle(0, [0, 1, 2]), None);
    assert!(mesh.uvs[0].on_triangle(1, [0, 1, 2]).is_some());
    assert_eq!(mesh.uvs[0].on_triangle(2, [2, 1, 0]), None);
}

#[test]
fn lines_continue_behind_a_backslash() {
    let mesh = read("v 0 0 \\\n0\nv 1 0 0\r\nv 0 1 0\nf 1 \\\r\n2\\\n 3\n# folder\\\nf 3 2 1").mesh;
    assert_eq!(mesh.triangles, [[0, 1, 2], [2, 1, 0]]);
}

#[test]
fn line_ends_of_all_systems_and_comments_behind_lines() {
    for end in ["\n", "\r\n", "\r"] {
        let text =
            ["\u{feff}# made by hand", "  v 0 0 0 # first", "v 1 0 0", "v\t0 1 0", "f 1 2 3# no", "f 1 2 3 # yes"];
        let text = text.join(end).replace("f 1 2 3# no", "");
        assert_eq!(read(&text).mesh.triangles, [[0, 1, 2]]);
    }
}

#[test]
fn vertex_colours_are_made_linear() {
    let mesh = read("v 0 0 0 1 0 0\nv 1 0 0 0 0.5 0\nv 0 1 0\nf 1 2 3\n").mesh;
    let colors = mesh.colors.unwrap().values;
    assert_eq!((colors[0], colors[2]), ([1.0, 0.0, 0.0, 1.0], [1.0; 4]));
    assert!((colors[1][1] - 0.214_041).abs() < 1e-5);
    let bytes = read("v 0 0 0 255 0 0\nv 1 0 0 0 127.5 0\nv 0 1 0 0 0 255 255\nf 1 2 3\n").mesh.colors.unwrap().values;
    assert_eq!(bytes[0], [1.0, 0.0, 0.0, 1.0]);
    assert!((bytes[1][1] - 0.214_041).abs() < 1e-5);
}

#[test]
fn a_weight_other_than_one_divides() {
    let loaded = read("v 2 4 6 2\nv 1 0 0 1\nv 0 1 0 1.0\nf 1 2 3\n");
    assert_eq!(loaded.mesh.positions, [[1.0, 2.0, 3.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    assert_eq!(loaded.warnings, ["divided the coordinates of 1 vertices by their weight"]);
    assert!(error("v 2 4 6 0\nv 1 0 0 1\nv 0 1 0 1\nf 1 2 3\n").contains("vertex 0 (counted from 0)"));
}

#[test]
fn points_lines_and_groups_are_nothing_to_warn_of() {
    let loaded = read(&format!("o a\ng b c\ns off\n{TRIANGLE}p 1 2\nl 1 2\nf 1 2 3\n"));
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
}

#[test]
fn free_form_geometry_faces_without_area_and_strange_lines_are_counted() {
    let loaded = read(&format!(
        "{TRIANGLE}cstype bezier\ndeg 3\ncurv 0 1 1 2\nsurf 0 1 0 1 1 2 3\nend\nhello\nf 1 2\nf 1 2 3\n"
    ));
    assert_eq!(
        loaded.warnings,
        [
            "skipped 2 free-form curves and surfaces, which are not supported: export polygons instead",
            "skipped 1 lines that are not OBJ, the first at line 9",
            "skipped 1 faces with fewer than 3 corners",
        ]
    );
}

#[test]
fn errors_name_the_line() {
    let cases = [
        ("f 1 2 4", "line 4: the face names vertex 4, but the file has only 3"),
        ("f 1 2 -4", "line 4: `-4` is not a face corner"),
        ("f 0 1 2", "line 4: `0` is not a face corner"),
        ("f 1 2 3x", "line 4: `3x` is not a face corner"),
        ("f 1/2/3/4 2 3", "line 4: `1/2/3/4` is not a face corner"),
        ("f 99999999999999999999999 1 2", "line 4: `99999999999999999999999` is not a face corner"),
        ("v 1 2", "line 4: the line has too few numbers"),
        ("v 1 2 1.#QNAN", "line 4: expected a number, found `1.#QNAN`"),
    ];
    for (line, message) in cases {
        let found = error(&format!("{TRIANGLE}{line}\n"));
        assert!(found.starts_with(&format!("<bytes>.obj: {message}")), "{found}");
    }
}

#[test]
fn a_vertex_that_is_not_finite_is_an_error_only_where_it_is_used() {
    assert!(
        error("v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").contains("vertex 0 (counted from 0): its position (NaN, 0, 0)")
    );
    assert!(error("v 1e400 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").contains("(inf, 0, 0) is not finite"));
    assert_eq!(read(&format!("{TRIANGLE}v inf nan 0\nf 1 2 3\n")).mesh.triangles.len(), 1);
}

#[test]
fn corners_of_attributes_that_do_not_exist_stay_without() {
    let loaded = read(&format!("{TRIANGLE}vt 0 0\nvn 0 0 1\nf 1/1/1 2/9/1 3/1/7\n"));
    assert_eq!(loaded.mesh.uvs[0].on_triangle(0, [0, 1, 2]), None);
    assert_eq!(loaded.warnings.len(), 2, "{:?}", loaded.warnings);
}

#[test]
fn without_attributes_only_positions_and_triangles_are_read() {
    let text = "mtllib none.mtl\nv 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\nvt 0 0\nvn 0 0 1\nusemtl a\nf 1/1/1 2/1/1 3/1/1\n";
    let loaded = read_mesh_bytes(MeshFormat::Obj, text.as_bytes(), &ReadOptions { attributes: false }).unwrap();
    let mesh = loaded.mesh;
    assert_eq!(mesh.triangles, [[0, 1, 2]]);
    assert!(mesh.uvs.is_empty() && mesh.normals.is_none() && mesh.colors.is_none() && mesh.materials.is_empty());
    assert!(loaded.warnings.is_empty());
}

/// A folder of its own with the given files in it.
fn folder(name: &str, files: &[(&str, &str)]) -> std::path::PathBuf {
    let folder = std::env::temp_dir().join(format!("trixel-obj-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    for (file, text) in files {
        std::fs::write(folder.join(file), text).unwrap();
    }
    folder
}

#[test]
fn materials_of_several_libraries_and_names_with_spaces() {
    let folder = folder(
        "materials",
        &[
            ("first one.mtl", "newmtl red paint\nKd 1 0 0\nmap_Kd wood grain.png\n"),
            ("second.mtl", "newmtl green\nKd 0 1 0\nmap_d gone.png\n"),
            ("third.mtl", "newmtl blue\nKd 0 0 1\n"),
            ("wood grain.png", ""),
            (
                "mesh.OBJ",
                "mtllib first one.mtl\nmtllib second.mtl third.mtl\nmtllib second.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n\
                 f 1 2 3\nusemtl red paint\nf 1 2 3 4\nusemtl blue\nf 1 2 3\nusemtl unheard of\nf 1 2 3\nusemtl red paint\nf 1 2 3\n",
            ),
        ],
    );
    let loaded = read_mesh(&folder.join("mesh.OBJ"), &ReadOptions::default()).unwrap();
    let mesh = loaded.mesh;
    let names: Vec<&str> = mesh.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["red paint", "green", "blue", "unheard of"]);
    assert_eq!(mesh.triangle_materials, [Mesh::NO_MATERIAL, 0, 0, 2, 3, 0]);
    assert_eq!(mesh.materials[2].base_color, [0.0, 0.0, 1.0, 1.0]);
    let texture = mesh.materials[0].base_color_texture.unwrap();
    let image = &mesh.images[mesh.textures[texture.texture as usize].image as usize];
    assert_eq!(image.source, ImageSource::File(folder.join("wood grain.png")));
    assert_eq!(
        loaded.warnings,
        [
            "the material `unheard of` is in no material library; it gets the default",
            "the texture `gone.png` is not there; materials stay without",
        ]
    );
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn a_missing_library_is_a_warning() {
    let loaded = read(&format!("mtllib none.mtl\n{TRIANGLE}usemtl a\nf 1 2 3\n"));
    assert_eq!(loaded.warnings, ["the material library `none.mtl` is not there; its materials get the default"]);
    assert_eq!(loaded.mesh.triangle_materials, [0]);
    assert_eq!(loaded.mesh.materials[0].name, "a");
}

#[test]
fn many_warnings_of_one_kind_are_counted() {
    let uses: String = (0..9).map(|i| format!("usemtl m{i}\nf 1 2 3\n")).collect();
    let loaded = read(&format!("{TRIANGLE}{uses}"));
    assert_eq!(loaded.warnings.len(), 6);
    assert_eq!(loaded.warnings[5], "4 more warnings like the last, each about another material");
}

#[test]
fn absurdly_many_materials_are_cut_off() {
    let uses: String = (0..70_000).map(|i| format!("usemtl {i}\nf 1 2 3\n")).collect();
    let mesh = read(&format!("{TRIANGLE}{uses}")).mesh;
    assert_eq!(mesh.materials.len(), 65_536);
    assert_eq!(mesh.triangle_materials[65_535..65_537], [65_535, Mesh::NO_MATERIAL]);
}

#[test]
fn no_face_is_empty() {
    assert!(super::is_empty(MeshFormat::Obj, TRIANGLE));
    assert!(super::is_empty(MeshFormat::Obj, "f 1\nv 0 0 0\n"));
}
