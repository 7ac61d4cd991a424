use std::io::{Cursor, Write};

use trixel::{Filter, ImageSource, Mesh, UpAxis, Wrap};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::read;
use crate::read::testing::{Memory, assault, check_consistent, check_model};
use crate::read::{Loaded, Problem, ReadOptions};

const CORE: &str = r#"xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02""#;
const PRODUCTION: &str = r#"xmlns:p="http://schemas.microsoft.com/3dmanufacturing/production/2015/06""#;

/// A triangle of one mesh object.
const TRIANGLE: &str = r#"<mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/>
    <vertex x="0" y="1" z="0"/></vertices><triangles><triangle v1="0" v2="1" v3="2"/></triangles></mesh>"#;

fn package(parts: &[(&str, &[u8])]) -> Vec<u8> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in parts {
        writer.start_file(*name, SimpleFileOptions::default()).unwrap();
        writer.write_all(bytes).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

fn model(resources: &str, build: &str) -> String {
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?><model unit="millimeter" {CORE} {PRODUCTION}>
        <metadata name="Title">x</metadata><resources>{resources}</resources><build>{build}</build></model>"#
    )
}

fn load_bytes(bytes: &[u8]) -> Result<Loaded, Problem> {
    let loaded = read(bytes, &ReadOptions::default(), &Memory::default())?;
    check_consistent(&loaded.mesh);
    Ok(loaded)
}

fn load(resources: &str, build: &str) -> Result<Loaded, Problem> {
    load_bytes(&package(&[("3D/3dmodel.model", model(resources, build).as_bytes())]))
}

#[track_caller]
fn assert_refused(resources: &str, build: &str, what: &str) {
    let problem = load(resources, build).unwrap_err();
    assert!(problem.to_string().contains(what), "{problem}");
}

#[test]
fn build_items_are_placed_by_their_row_vector_matrices() {
    let object = format!(r#"<object id="1" type="model">{TRIANGLE}</object>"#);
    // x goes to y, y to -x; then (10, 20, 30).
    let build = r#"<item objectid="1"/><item objectid="1" transform="0 1 0 -1 0 0 0 0 1 10 20 30"/>"#;
    let mesh = load(&object, build).unwrap().mesh;
    assert_eq!(mesh.up, Some(UpAxis::Z));
    assert_eq!(mesh.positions[..3], [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    assert_eq!(mesh.positions[3..], [[10.0, 20.0, 30.0], [10.0, 21.0, 30.0], [9.0, 20.0, 30.0]]);
}

#[test]
fn components_multiply_their_transforms_from_the_inside_out() {
    let objects = format!(
        r#"<object id="1">{TRIANGLE}</object>
        <object id="2"><components><component objectid="1" transform="2 0 0 0 2 0 0 0 2 1 0 0"/></components></object>
        <object id="3"><components><component objectid="2" transform="1 0 0 0 1 0 0 0 1 0 5 0"/>
            <component objectid="1"/></components></object>"#
    );
    let mesh = load(&objects, r#"<item objectid="3" transform="10 0 0 0 10 0 0 0 10 0 0 0"/>"#).unwrap().mesh;
    assert_eq!(mesh.positions[1], [(2.0 + 1.0) * 10.0, 50.0, 0.0]);
    assert_eq!(mesh.positions[4], [10.0, 0.0, 0.0]);
    assert_eq!(mesh.triangles.len(), 2);
}

#[test]
fn coordinates_are_decimals_in_f64() {
    let object = format!(r#"<object id="1">{}</object>"#, TRIANGLE.replace(r#"x="1""#, r#"x=" 0.1 ""#));
    assert_eq!(load(&object, r#"<item objectid="1"/>"#).unwrap().mesh.positions[1][0], 0.1);
}

#[test]
fn only_what_the_build_reaches_is_read() {
    let objects =
        format!(r#"<object id="1" type="support">{TRIANGLE}</object><object id="2" type="model">{TRIANGLE}</object>"#);
    assert_eq!(load(&objects, r#"<item objectid="2"/>"#).unwrap().mesh.triangles.len(), 1);
    let loaded = load(&objects, "").unwrap();
    assert_eq!(loaded.mesh.triangles.len(), 2);
    assert!(loaded.warnings[0].contains("build is empty"));
}

#[test]
fn production_extension_reads_objects_of_other_parts() {
    let root = model(
        r#"<object id="1"><components><component p:path="/3D/Objects/a%20b.model" objectid="1"/></components></object>"#,
        r#"<item objectid="1" transform="1 0 0 0 1 0 0 0 1 5 0 0"/><item p:path="/3D/Objects/a b.model" objectid="1"/>"#,
    )
    .replace("<model ", r#"<model requiredextensions="p" "#);
    let other = model(&format!(r#"<object id="1">{TRIANGLE}</object>"#), "");
    let bytes = package(&[("3D/3dmodel.model", root.as_bytes()), ("3D/Objects/a b.model", other.as_bytes())]);
    let mesh = load_bytes(&bytes).unwrap().mesh;
    assert_eq!((mesh.triangles.len(), mesh.positions[0][0], mesh.positions[3][0]), (2, 5.0, 0.0));
    let missing = package(&[("3D/3dmodel.model", root.as_bytes())]);
    assert!(load_bytes(&missing).unwrap_err().at.contains("3D/Objects/a b.model"));
}

#[test]
fn relationships_name_the_root_part() {
    let rels = br#"<Relationships><Relationship Target="/thumb.png" Type="x/thumbnail"/>
        <Relationship Target="/Other/Main.model" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>
        </Relationships>"#;
    let model = model(&format!(r#"<object id="1">{TRIANGLE}</object>"#), r#"<item objectid="1"/>"#);
    // Part names do not tell upper from lower case.
    let bytes = package(&[("_rels/.rels", rels), ("other/main.model", model.as_bytes())]);
    assert_eq!(load_bytes(&bytes).unwrap().mesh.triangles.len(), 1);
}

#[test]
fn required_extension_is_refused_by_name() {
    let beams = r#"xmlns:b="http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02""#;
    let model = model("", "").replace("<model ", &format!(r#"<model requiredextensions="p b" {beams} "#));
    let problem = load_bytes(&package(&[("3D/3dmodel.model", model.as_bytes())])).unwrap_err();
    assert!(problem.what.contains("'b'") && problem.what.contains("beamlattice/2017/02"), "{problem}");
}

#[test]
fn elements_of_unknown_extensions_are_not_taken_for_the_core() {
    let object = format!(
        r#"<s:slicestack id="9"><s:slice><s:vertices><s:vertex x="5" y="5"/></s:vertices></s:slice></s:slicestack>
        <object id="1">{TRIANGLE}<s:extra><vertices><vertex x="bad"/></vertices></s:extra></object>"#
    );
    let loaded = load(&object, r#"<item objectid="1"/>"#).unwrap();
    assert_eq!(loaded.mesh.positions.len(), 3);
}

#[test]
fn component_cycles_and_bombs_are_refused() {
    let cycle = r#"<object id="1" name="ring"><components><component objectid="2"/></components></object>
        <object id="2"><components><component objectid="1"/></components></object>"#;
    assert_refused(cycle, r#"<item objectid="1"/>"#, "object 1 (ring): contains itself");

    let mut objects = format!(r#"<object id="1">{TRIANGLE}</object>"#);
    for id in 2..64 {
        let below = format!(r#"<component objectid="{}"/>"#, id - 1).repeat(2);
        objects += &format!(r#"<object id="{id}"><components>{below}</components></object>"#);
    }
    assert_refused(&objects, r#"<item objectid="63"/>"#, "instances of instances");
}

#[test]
fn deep_components_and_deep_elements_need_no_stack() {
    let mut objects = format!(r#"<object id="1">{TRIANGLE}</object>"#);
    for id in 2..=20_000 {
        let below = format!(r#"<component objectid="{}" transform="1 0 0 0 1 0 0 0 1 1 0 0"/>"#, id - 1);
        objects += &format!(r#"<object id="{id}"><components>{below}</components></object>"#);
    }
    let mesh = load(&objects, r#"<item objectid="20000"/>"#).unwrap().mesh;
    assert_eq!(mesh.positions[0][0], 19_999.0);

    // Random names, or the package would shrink so well that it is taken for a bomb.
    let names: Vec<String> = (0..100_000u32).map(|i| format!("e{}", i.wrapping_mul(2_654_435_761))).collect();
    let open: String = names.iter().map(|name| format!("<{name}>")).collect();
    let close: String = names.iter().rev().map(|name| format!("</{name}>")).collect();
    assert!(load(&format!("{open}{close}"), "").unwrap().mesh.triangles.is_empty());
}

#[test]
fn zip_bomb_is_refused_while_it_expands() {
    let spaces = " ".repeat(64 << 20);
    let bytes = package(&[("3D/3dmodel.model", model(&spaces, "").as_bytes())]);
    assert!(bytes.len() < 100_000);
    let problem = load_bytes(&bytes).unwrap_err();
    assert!(problem.what.contains("200 times its size"), "{problem}");
}

#[test]
fn stored_and_unsupported_compression() {
    let text = model(&format!(r#"<object id="1">{TRIANGLE}</object>"#), r#"<item objectid="1"/>"#);
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    let stored = SimpleFileOptions::default().compression_method(CompressionMethod::Stored).large_file(true);
    writer.start_file("3D/3dmodel.model", stored).unwrap();
    writer.write_all(text.as_bytes()).unwrap();
    let mut bytes = writer.finish().unwrap().into_inner();
    assert_eq!(load_bytes(&bytes).unwrap().mesh.triangles.len(), 1);
    // Method 12 (bzip2) in the local header and in the directory.
    let directory = bytes.windows(4).rposition(|w| w == b"PK\x01\x02").unwrap();
    bytes[8] = 12;
    bytes[directory + 10] = 12;
    let problem = load_bytes(&bytes).unwrap_err();
    assert!(problem.what.contains("pack the file again"), "{problem}");
}

#[test]
fn damage_is_named() {
    let build = r#"<item objectid="1"/>"#;
    let object = |inside: &str| format!(r#"<object id="1">{inside}</object>"#);
    assert_refused(&object(&TRIANGLE.replace(r#"v3="2""#, r#"v3="3""#)), build, "triangle 0 names vertex 3");
    assert_refused(&object(&TRIANGLE.replace(r#"v3="2""#, "")), build, "lacks v1, v2 or v3");
    assert_refused(&object(&TRIANGLE.replace(r#"v3="2""#, r#"v3="-1""#)), build, "'-1' is not an index");
    assert_refused(&object(&TRIANGLE.replacen(r#"y="0""#, "", 1)), build, "lacks x, y or z");
    assert_refused(&object(&TRIANGLE.replace(r#"x="1""#, r#"x="1,5""#)), build, "'1,5' is not a number");
    assert_refused(&object(&TRIANGLE.replace(r#"x="1""#, r#"x="nan""#)), build, "vertex 1 is not finite");
    assert_refused(&object(TRIANGLE), r#"<item objectid="4"/>"#, "object 4");
    assert_refused(&object(TRIANGLE), r#"<item/>"#, "no objectid");
    assert_refused(&object(TRIANGLE), r#"<item objectid="1" transform="1 0 0"/>"#, "3 numbers where 12");
    assert_refused(&object(TRIANGLE).repeat(2), build, "defines object 1 twice");
    assert_refused(&object(TRIANGLE).replace("</mesh>", "</mush>"), build, "the file is damaged");
    assert_refused("<object/>", build, "no id");

    let text = model(&object(TRIANGLE), build);
    let cut = package(&[("3D/3dmodel.model", text.split_at(text.len() - 8).0.as_bytes())]);
    assert!(load_bytes(&cut).unwrap_err().what.contains("ends too soon"));
    assert!(load_bytes(&package(&[("3D/3dmodel.model", b"<svg/>")])).unwrap_err().what.contains("no <model>"));
    assert!(load_bytes(&package(&[("readme.txt", b"x")])).unwrap_err().what.contains("not in the package"));
    assert!(load_bytes(b"PK\x03\x04 not really").unwrap_err().what.contains("no readable ZIP"));
}

#[test]
fn materials_colours_and_textures() {
    let mesh = r##"<mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="0" y="1" z="0"/>
        </vertices><triangles>
        <triangle v1="0" v2="1" v3="2"/>
        <triangle v1="0" v2="1" v3="2" pid="5" p1="1"/>
        <triangle v1="0" v2="1" v3="2" pid="6" p1="0" p2="1" p3="0"/>
        <triangle v1="0" v2="1" v3="2" pid="7" p1="0" p2="1" p3="2"/>
        <triangle v1="0" v2="1" v3="2" pid="5" p1="9"/>
        </triangles></mesh>"##;
    let resources = format!(
        r##"<m:texture2d id="8" path="/3D/Textures/a.png" contenttype="image/png" tilestyleu="mirror" filter="nearest"/>
        <basematerials id="5"><base name="red" displaycolor="#FF0000"/><base name="half" displaycolor="#00FF0080"/></basematerials>
        <m:colorgroup id="6"><m:color color="#0000FF"/><m:color color="#FFFFFF00"/></m:colorgroup>
        <m:texture2dgroup id="7" texid="8"><m:tex2coord u="0" v="0"/><m:tex2coord u="1" v="0.25"/>
            <m:tex2coord u="0" v="1"/></m:texture2dgroup>
        <m:multiproperties id="10" pids="5 6"/>
        <object id="1" pid="5" pindex="0">{mesh}</object>"##
    );
    let text = model(&resources, r#"<item objectid="1"/>"#);
    let bytes = package(&[("3D/3dmodel.model", text.as_bytes()), ("3D/Textures/a.png", b"pixels")]);
    let loaded = load_bytes(&bytes).unwrap();
    let mesh = &loaded.mesh;
    let material = |triangle: usize| &mesh.materials[mesh.triangle_materials[triangle] as usize];
    assert_eq!((material(0).name.as_str(), material(0).base_color), ("red", [1.0, 0.0, 0.0, 1.0]));
    assert_eq!((material(1).name.as_str(), material(1).base_color), ("half", [0.0, 1.0, 0.0, 128.0 / 255.0]));
    assert_eq!(mesh.triangle_materials[2], Mesh::NO_MATERIAL);
    assert_eq!(mesh.triangle_materials[4], Mesh::NO_MATERIAL);
    let colors = mesh.colors.as_ref().unwrap();
    let (blue, clear) = ([0.0, 0.0, 1.0, 1.0], [1.0, 1.0, 1.0, 0.0]);
    assert_eq!(colors.on_triangle(2, mesh.triangles[2]), Some([blue, clear, blue]));
    assert_eq!(colors.on_triangle(0, mesh.triangles[0]), None);
    assert_eq!(mesh.uvs[0].on_triangle(3, mesh.triangles[3]), Some([[0.0, 1.0], [1.0, 0.75], [0.0, 0.0]]));
    let texture = mesh.textures[material(3).base_color_texture.unwrap().texture as usize];
    assert_eq!((texture.wrap, texture.filter), ([Wrap::Mirror, Wrap::Repeat], Filter::Nearest));
    assert_eq!(mesh.images[0].source, ImageSource::Encoded(b"pixels".to_vec()));
    assert_eq!(loaded.warnings.len(), 2, "{:?}", loaded.warnings);

    let plain = read(&bytes, &ReadOptions { attributes: false }, &Memory::default()).unwrap().mesh;
    assert_eq!((plain.triangles.len(), plain.materials.len(), plain.colors), (5, 0, None));

    let without = load_bytes(&package(&[("3D/3dmodel.model", text.as_bytes())])).unwrap();
    assert!(without.warnings.iter().any(|warning| warning.contains("its texture is left out")));
    assert_eq!(without.mesh.triangles.len(), 5);
}

#[test]
fn damaged_files_never_panic() {
    let resources = format!(
        r##"<m:texture2d id="8" path="/a.png"/><basematerials id="5"><base name="r" displaycolor="#FF0000"/></basematerials>
        <m:texture2dgroup id="7" texid="8"><m:tex2coord u="0" v="0"/></m:texture2dgroup>
        <m:colorgroup id="6"><m:color color="#0000FF"/></m:colorgroup>
        <object id="1" pid="5" pindex="0">{TRIANGLE}</object><object id="2"><components>
        <component objectid="1" transform="1 0 0 0 1 0 0 0 1 0 0 0"/></components></object>"##
    );
    let text = model(&resources, r#"<item objectid="2"/><item objectid="1"/>"#);
    // Damage to the package itself,
    let bytes = package(&[("3D/3dmodel.model", text.as_bytes()), ("a.png", b"pixels")]);
    assault(&bytes, 3000, read, &Memory::default());
    // and to the model in it.
    fn wrapped(bytes: &[u8], options: &ReadOptions, resources: &dyn crate::read::Resources) -> Result<Loaded, Problem> {
        let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
        let stored = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
        writer.start_file("3D/3dmodel.model", stored).unwrap();
        writer.write_all(bytes).unwrap();
        read(&writer.finish().unwrap().into_inner(), options, resources)
    }
    assault(text.as_bytes(), 4000, wrapped, &Memory::default());
}

#[test]
fn real_meshes_have_the_triangles_and_boxes_they_are_known_for() {
    check_model("cad/counterXP.3MF", read, 83_750, [-111.49, 5.7792, 255.86], [193.31, 310.19, 281.7]);
    check_model("cad/pyramids.3mf", read, 3276, [5.0123, 5.0236, 10.025], [351.74, 168.11, 35.025]);
}
