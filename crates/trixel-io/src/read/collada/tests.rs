use trixel::{AlphaMode, ImageSource, Mesh, UpAxis, Wrap};

use super::read;
use crate::read::testing::{Memory, assault, check_consistent, check_model};
use crate::read::{Loaded, Problem, ReadOptions};

/// Five corners: a unit square and the tip of a roof; normals, texture coordinates, colours.
const SOURCES: &str = r##"
    <source id="pos"><float_array id="pos-array" count="15">0 0 0 1 0 0 1 1 0 0 1 0 0.5 2 0</float_array>
        <technique_common><accessor source="#pos-array" count="5" stride="3">
        <param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
        </accessor></technique_common></source>
    <source id="nor"><float_array id="nor-array" count="6">0 0 1 0 0 -1</float_array>
        <technique_common><accessor source="#nor-array" count="2" stride="3"/></technique_common></source>
    <source id="tex"><float_array id="tex-array" count="9">9 0.25 9 9 0.5 1 9 0.75 0</float_array>
        <technique_common><accessor source="#tex-array" count="3" stride="3">
        <param type="float"/><param name="S" type="float"/><param name="T" type="float"/>
        </accessor></technique_common></source>
    <source id="col"><float_array id="col-array" count="6">1 0 0 0 1 1</float_array>
        <technique_common><accessor source="#col-array" count="2" stride="3"/></technique_common></source>
    <vertices id="ver"><input semantic="POSITION" source="#pos"/></vertices>"##;

const VERTEX: &str = r##"<input semantic="VERTEX" source="#ver" offset="0"/>"##;

fn document(primitives: &str, rest: &str, scene: &str) -> String {
    format!(
        r##"<?xml version="1.0" encoding="utf-8"?>
        <COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
        <asset><unit meter="0.01"/><up_axis>Z_UP</up_axis></asset>
        <library_geometries><geometry id="geo" name="g"><mesh>{SOURCES}{primitives}</mesh></geometry></library_geometries>
        {rest}
        <library_visual_scenes><visual_scene id="vis">{scene}</visual_scene></library_visual_scenes>
        <scene><instance_visual_scene url="#vis"/></scene></COLLADA>"##
    )
}

/// One node with the geometry.
const NODE: &str = r##"<node id="n"><instance_geometry url="#geo"/></node>"##;

fn load_text(text: &str) -> Result<Loaded, Problem> {
    let loaded = read(text.as_bytes(), &ReadOptions::default(), &Memory::default())?;
    check_consistent(&loaded.mesh);
    Ok(loaded)
}

fn triangles(primitives: &str) -> Vec<[u32; 3]> {
    load_text(&document(primitives, "", NODE)).unwrap().mesh.triangles
}

fn one_triangle() -> String {
    format!("<triangles count=\"1\">{VERTEX}<p>0 1 2</p></triangles>")
}

#[track_caller]
fn assert_refused(text: &str, what: &str) {
    let problem = load_text(text).unwrap_err();
    assert!(problem.to_string().contains(what), "{problem}");
}

#[test]
fn every_primitive_with_an_area() {
    assert_eq!(triangles(&one_triangle()), [[0, 1, 2]]);
    let list = |name: &str, inside: &str| triangles(&format!("<{name}>{VERTEX}{inside}</{name}>"));
    assert_eq!(list("triangles", "<p>0 1 2 2 3 0 4</p>"), [[0, 1, 2], [2, 3, 0]]);
    assert_eq!(list("triangles", ""), [[0u32; 3]; 0]);
    assert_eq!(list("trifans", "<p>0 1 2 3</p><p>2 4 3</p>"), [[0, 1, 2], [0, 2, 3], [2, 4, 3]]);
    assert_eq!(list("tristrips", "<p>0 1 3 2 2 4</p>"), [[0, 1, 3], [1, 2, 3]]);
    assert_eq!(list("polylist", "<vcount>4 3 2</vcount><p>0 1 2 3 3 2 4 0 1</p>"), [[0, 1, 2], [0, 2, 3], [3, 2, 4]]);
    assert_eq!(list("polygons", "<p>0 1 2 3</p><p>3 2 4</p>"), [[0, 1, 2], [0, 2, 3], [3, 2, 4]]);
    assert_eq!(list("polygons", "<p>0 1 2<!-- comment --> 3</p>"), [[0, 1, 2], [0, 2, 3]]);
}

#[test]
fn concave_polygons_keep_their_shape() {
    // A square with a notch from above, which the fan around the first corner would cover.
    let pos = "0 0 0 4 0 0 4 4 0 2 1 0 0 4 0";
    let primitives = format!("<polylist>{VERTEX}<vcount>5</vcount><p>4 0 1 2 3</p></polylist>");
    let text = document(&primitives, "", NODE).replace("0 0 0 1 0 0 1 1 0 0 1 0 0.5 2 0", pos);
    let mesh = load_text(&text).unwrap().mesh;
    let area = |[a, b, c]: [u32; 3]| {
        let [a, b, c] = [a, b, c].map(|vertex| mesh.positions[vertex as usize]);
        0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
    };
    let areas: Vec<f64> = mesh.triangles.iter().map(|&triangle| area(triangle)).collect();
    assert!(areas.len() == 3 && areas.iter().all(|&area| area > 0.0), "{areas:?}");
    assert_eq!(areas.iter().sum::<f64>(), 10.0);
}

#[test]
fn lines_are_skipped_and_holes_filled_with_a_warning() {
    let primitives =
        format!("<lines>{VERTEX}<p>0 1</p></lines><polygons>{VERTEX}<ph><p>0 1 2 3</p><h>0 1 2</h></ph></polygons>");
    let loaded = load_text(&document(&primitives, "", NODE)).unwrap();
    assert_eq!(loaded.mesh.triangles.len(), 2);
    assert_eq!(loaded.warnings, ["1 elements of lines skipped", "1 holes in polygons were filled"]);
}

#[test]
fn attributes_have_corners_and_v_points_down() {
    let primitives = format!(
        r##"<triangles material="m">{VERTEX}<input semantic="NORMAL" source="#nor" offset="1"/>
        <input semantic="TEXCOORD" source="#tex" offset="2" set="0"/><input semantic="COLOR" source="#col" offset="1"/>
        <p>0 0 0 1 0 1 2 1 2</p></triangles>
        <triangles>{VERTEX}<input semantic="NORMAL" source="#nor" offset="1"/><p>0 1 2 -1 3 1 0 1 2 1 3 1</p></triangles>"##
    );
    let mesh = load_text(&document(&primitives, "", NODE)).unwrap().mesh;
    assert_eq!((mesh.positions.len(), mesh.triangles.len()), (5, 3));
    let normals = mesh.normals.unwrap();
    assert_eq!(normals.values.len(), 2);
    assert_eq!(normals.corners.as_ref().unwrap()[0], [0, 0, 1]);
    assert_eq!(normals.on_triangle(1, mesh.triangles[1]), None);
    assert_eq!(normals.on_triangle(2, mesh.triangles[2]), Some([[0.0, 0.0, -1.0]; 3]));
    assert_eq!(mesh.uvs[0].on_triangle(0, [0; 3]), Some([[0.25, -8.0], [0.5, 0.0], [0.75, 1.0]]));
    let colors = mesh.colors.unwrap();
    assert_eq!(colors.on_triangle(0, [0; 3]).unwrap()[2], [0.0, 1.0, 1.0, 1.0]);
    assert_eq!(colors.on_triangle(1, [0; 3]), None);
}

#[test]
fn node_transforms_nest_and_up_axis_and_unit_are_not_applied() {
    let scene = r##"<node><translate>10 0 0</translate><rotate>0 0 1 90</rotate><node><scale>2 2 2</scale>
        <instance_geometry url="#geo"/></node></node>"##;
    let mesh = load_text(&document(&one_triangle(), "", scene)).unwrap().mesh;
    assert_eq!(mesh.up, Some(UpAxis::Z));
    assert_eq!(mesh.positions[1], [10.0, 2.0, 0.0]);
}

#[test]
fn library_nodes_are_instanced_and_cycles_refused() {
    let library = r##"<library_nodes><node id="lib"><translate>0 0 1</translate>
        <instance_geometry url="#geo"/></node></library_nodes>"##;
    let scene = r##"<node><translate>5 0 0</translate><instance_node url="#lib"/></node><node><instance_node url="#lib"/>
        <instance_node url="other.dae#x"/></node>"##;
    let loaded = load_text(&document(&one_triangle(), library, scene)).unwrap();
    assert_eq!(loaded.mesh.positions[0], [5.0, 0.0, 1.0]);
    assert_eq!(loaded.mesh.positions[5], [0.0, 0.0, 1.0]);
    assert!(loaded.warnings[0].contains("1 references"));
    let cycle = r##"<node id="a"><node id="b"><instance_node url="#a"/></node></node>"##;
    assert_refused(&document(&one_triangle(), "", cycle), "contains itself");

    let mut bomb = String::from(r##"<library_nodes><node id="n0"><instance_geometry url="#geo"/></node>"##);
    for i in 1..64 {
        let twice = format!(r##"<instance_node url="#n{}"/>"##, i - 1).repeat(2);
        bomb += &format!(r##"<node id="n{i}">{twice}</node>"##);
    }
    bomb += "</library_nodes>";
    let scene = r##"<node><instance_node url="#n63"/></node>"##;
    assert_refused(&document(&one_triangle(), &bomb, scene), "instances of instances");
}

#[test]
fn skin_places_its_geometry_in_the_bind_shape() {
    let controllers = r##"<library_controllers>
        <controller id="skin"><skin source="#morph"><bind_shape_matrix>2 0 0 1 0 2 0 0 0 0 2 0 0 0 0 1</bind_shape_matrix>
        </skin></controller>
        <controller id="morph"><morph source="#geo"/></controller>
        <controller id="loop"><skin source="#loop"/></controller></library_controllers>"##;
    let scene = r##"<node><translate>0 0 5</translate><instance_controller url="#skin"/></node>
        <node><instance_controller url="#loop"/></node>"##;
    let loaded = load_text(&document(&one_triangle(), controllers, scene)).unwrap();
    assert_eq!(loaded.mesh.positions[1], [3.0, 0.0, 5.0]);
    assert!(loaded.warnings[0].contains("1 references"));
}

#[test]
fn materials_of_effects() {
    let rest = r##"<library_images><image id="img"><init_from>file:///C:/work/wood%20grain.png</init_from></image>
        <image id="lost"><init_from>lost.png</init_from></image></library_images>
        <library_effects><effect id="fx"><profile_COMMON>
        <newparam sid="surf"><surface type="2D"><init_from>img</init_from></surface></newparam>
        <newparam sid="samp"><sampler2D><source>surf</source><wrap_s>MIRROR</wrap_s></sampler2D></newparam>
        <technique sid="t"><phong><emission><color>0 1 0 1</color></emission>
        <diffuse><texture texture="samp" texcoord="UV"/></diffuse>
        <transparent opaque="A_ONE"><color>1 1 1 1</color></transparent><transparency><float>0.25</float></transparency>
        <index_of_refraction><float>1.4</float></index_of_refraction></phong></technique>
        <extra><technique profile="GOOGLEEARTH"><double_sided>1</double_sided></technique></extra>
        </profile_COMMON></effect>
        <effect id="plain"><profile_COMMON><technique sid="t"><lambert><diffuse><color>1 0 0 1</color></diffuse>
        <transparency><float>0</float></transparency></lambert></technique></profile_COMMON></effect>
        <effect id="gone"><profile_COMMON><technique sid="t"><lambert><diffuse><texture texture="lost"/></diffuse>
        </lambert></technique></profile_COMMON></effect></library_effects>
        <library_materials><material id="ma" name="wood"><instance_effect url="#fx"/></material>
        <material id="mb"><instance_effect url="#plain"/></material>
        <material id="mc"><instance_effect url="#gone"/></material></library_materials>"##;
    let primitive = |symbol: &str| one_triangle().replace("<triangles", &format!("<triangles material=\"{symbol}\""));
    let primitives = [primitive("s"), primitive("t"), one_triangle(), primitive("mc")].concat();
    let scene = r##"<node><instance_geometry url="#geo"><bind_material><technique_common>
        <instance_material symbol="s" target="#ma"/><instance_material symbol="t" target="#mb"/>
        </technique_common></bind_material></instance_geometry></node>"##;
    let text = document(&primitives, rest, scene);
    let resources = Memory::with("wood grain.png", vec![]);
    let loaded = read(text.as_bytes(), &ReadOptions::default(), &resources).unwrap();
    let mesh = &loaded.mesh;
    check_consistent(mesh);
    assert_eq!(mesh.triangle_materials, [0, 1, Mesh::NO_MATERIAL, 2]);
    let wood = &mesh.materials[0];
    assert_eq!((wood.name.as_str(), wood.base_color), ("wood", [1.0, 1.0, 1.0, 0.25]));
    assert_eq!((wood.alpha_mode, wood.double_sided, wood.emissive), (AlphaMode::Blend, true, [0.0, 1.0, 0.0]));
    assert_eq!(wood.index_of_refraction, 1.4);
    let texture = mesh.textures[wood.base_color_texture.unwrap().texture as usize];
    assert_eq!(texture.wrap, [Wrap::Mirror, Wrap::Repeat]);
    assert_eq!(mesh.images[texture.image as usize].source, ImageSource::File("wood grain.png".into()));
    // A transparency of 0 without a mode is an exporter's way to say opaque.
    assert_eq!((mesh.materials[1].base_color, mesh.materials[1].alpha_mode), ([1.0, 0.0, 0.0, 1.0], AlphaMode::Opaque));
    assert_eq!(mesh.materials[2].base_color_texture, None);
    assert_eq!(loaded.warnings.len(), 1, "{:?}", loaded.warnings);
    assert!(loaded.warnings[0].contains("lost.png"));
}

#[test]
fn damage_is_named() {
    let with = |old: &str, new: &str| document(&one_triangle(), "", NODE).replacen(old, new, 1);
    assert_refused(&with("<p>0 1 2", "<p>0 1 5"), "names a vertex that does not exist: there are 5");
    assert_refused(&with("<p>0 1 2", "<p>0 1 -1"), "names a vertex that does not exist");
    assert_refused(&with("<p>0 1 2", "<p>0 1 99999999999"), "names a vertex that does not exist");
    assert_refused(&with("<p>0 1 2", "<p>0 1 x"), "'x' is not an index");
    assert_refused(&with("0.5 2 0<", "0.5 2 zero<"), "'zero' is not a number");
    assert_refused(&with(">0 0 0 1 ", ">NaN 0 0 1 "), "vertex 0 is not finite");
    assert_refused(&with("count=\"5\"", "count=\"6\""), "room for 5");
    assert_refused(&with("count=\"5\"", "count=\"18446744073709551615\""), "room for 5");
    assert_refused(&with("stride=\"3\"", "stride=\"0\""), "stride of 0");
    assert_refused(&with("stride=\"3\"", "stride=\"two\""), "whole number");
    assert_refused(&with("source=\"#ver\"", "source=\"#no\""), "'#no'");
    assert_refused(&with("source=\"#pos\"/>", "source=\"#no\"/>"), "'#no'");
    assert_refused(&with("semantic=\"POSITION\"", "semantic=\"OTHER\""), "POSITION");
    assert_refused(&with("offset=\"0\"", "offset=\"-1\""), "whole number");
    assert_refused(&with("</mesh>", ""), "line ");
    assert_refused(&with("</COLLADA>", ""), "cut off");
    assert_refused("<svg/>", "no <COLLADA>");
    assert_refused("", "cut off");
    assert_refused(&with("<node id=\"n\">", "<node id=\"n\"><scale>1</scale>"), "1 numbers where 3");
    let list = |counts: &str| {
        document(&format!("<polylist>{VERTEX}<vcount>{counts}</vcount><p>0 1 2</p></polylist>"), "", NODE)
    };
    assert_refused(&list("4000000000"), "4000000000 corners");
    assert_refused(&list("3 3"), "more polygons");
}

#[test]
fn huge_offsets_make_no_corners() {
    let text = document(&one_triangle(), "", NODE).replace("offset=\"0\"", "offset=\"18446744073709551615\"");
    assert!(load_text(&text).unwrap().mesh.triangles.is_empty());
}

#[test]
fn entities_of_a_document_type_are_refused_and_predefined_ones_read() {
    let text = document(&one_triangle(), "", NODE)
        .replace("<COLLADA", r#"<!DOCTYPE COLLADA [<!ENTITY a "0 1 2"><!ENTITY b "&a;&a;&a;&a;">]><COLLADA"#);
    assert_eq!(load_text(&text).unwrap().mesh.triangles.len(), 1);
    assert_refused(&text.replace("<p>0 1 2", "<p>&b;"), "the entity &b; is not known");
    assert_eq!(triangles(&one_triangle().replace("<p>0 1 2", "<p>0&#32;1&#x20;&#50;")), [[0, 1, 2]]);
}

#[test]
fn a_hundred_thousand_nested_elements_need_no_stack() {
    let deep = 100_000;
    let scene = format!(
        r##"{}<instance_geometry url="#geo"/>{}"##,
        "<node><translate>1 0 0</translate>".repeat(deep),
        "</node>".repeat(deep)
    );
    let mesh = load_text(&document(&one_triangle(), "", &scene)).unwrap().mesh;
    assert_eq!(mesh.positions[0][0], 100_000.0);
    let other = format!("{}{}", "<x>".repeat(deep), "</x>".repeat(deep));
    assert_eq!(load_text(&document(&one_triangle(), &other, NODE)).unwrap().mesh.triangles.len(), 1);
}

#[test]
fn nested_namespaces_cost_no_more_than_their_bytes() {
    let deep: String = (0..60_000).map(|i| format!("<x xmlns:n{i}=\"urn:{i}\">")).collect();
    let text = document(&one_triangle(), &format!("{deep}{}", "</x>".repeat(60_000)), NODE);
    assert_eq!(load_text(&text).unwrap().mesh.triangles.len(), 1);
}

#[test]
fn other_encodings_and_prefixes() {
    let text = document(&one_triangle(), "", NODE);
    let utf16: Vec<u8> = std::iter::once(0xfeff).chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    let options = ReadOptions::default();
    assert_eq!(read(&utf16, &options, &Memory::default()).unwrap().mesh.triangles.len(), 1);
    let big: Vec<u8> = std::iter::once(0xfeff).chain(text.encode_utf16()).flat_map(u16::to_be_bytes).collect();
    assert_eq!(read(&big, &options, &Memory::default()).unwrap().mesh.triangles.len(), 1);
    let mut latin = text.replace("name=\"g\"", "name=\"*\"").into_bytes();
    latin.iter_mut().filter(|byte| **byte == b'*').for_each(|byte| *byte = 0xe9);
    assert_eq!(read(&latin, &options, &Memory::default()).unwrap().mesh.triangles.len(), 1);
    let marked = [b"\xef\xbb\xbf", text.as_bytes()].concat();
    assert_eq!(read(&marked, &options, &Memory::default()).unwrap().mesh.triangles.len(), 1);
    let prefixed = text.replace("</", "</c:").replace("<", "<c:").replace("<c:/c:", "</c:").replace("<c:?", "<?");
    assert_eq!(load_text(&prefixed).unwrap().mesh.triangles.len(), 1);
}

#[test]
fn without_a_scene_every_geometry_is_read() {
    let text = document(&one_triangle(), "", NODE);
    let text = text.replace("visual_scene", "other");
    let loaded = load_text(&text).unwrap();
    assert_eq!(loaded.mesh.triangles.len(), 1);
    assert!(loaded.warnings[0].contains("no scene"));
}

#[test]
fn damaged_files_never_panic() {
    let primitives = format!(
        r##"<polylist material="m">{VERTEX}<input semantic="NORMAL" source="#nor" offset="1"/>
        <input semantic="TEXCOORD" source="#tex" offset="1"/><vcount>4</vcount><p>0 0 1 0 2 1 3 1</p></polylist>
        <tristrips>{VERTEX}<p>0 1 2 3</p></tristrips>"##
    );
    let rest = r##"<library_effects><effect id="fx"><profile_COMMON><technique><phong><diffuse><color>1 0 0 1</color>
        </diffuse></phong></technique></profile_COMMON></effect></library_effects><library_materials><material id="m">
        <instance_effect url="#fx"/></material></library_materials><library_controllers><controller id="c">
        <skin source="#geo"/></controller></library_controllers>"##;
    let scene = r##"<node id="a"><matrix>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</matrix><instance_geometry url="#geo"/></node>
        <node><lookat>1 2 3 0 0 0 0 1 0</lookat><instance_node url="#a"/><instance_controller url="#c"/></node>"##;
    let text = document(&primitives, rest, scene);
    load_text(&text).unwrap();
    assault(text.as_bytes(), 4000, read, &Memory::default());
}

#[test]
fn real_mesh_has_the_triangles_and_box_it_is_known_for() {
    check_model("duck/duck.dae", read, 4212, [-69.299, 9.9294, -61.328], [96.18, 163.97, 53.925]);
}
