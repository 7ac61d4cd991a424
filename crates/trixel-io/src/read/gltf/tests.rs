use base64::Engine;
use base64::engine::general_purpose::{STANDARD, STANDARD_NO_PAD};
use serde_json::{Value, json};
use trixel::{AlphaMode, Filter, ImageSource, Wrap};

use super::read;
use crate::read::testing::{Memory, assault, check_consistent, check_model};
use crate::read::{Loaded, Problem, ReadOptions};

/// Four corners of a unit square, two triangles of u16 indices.
fn square() -> Vec<u8> {
    let positions: [f32; 12] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0];
    let mut bytes = floats(&positions);
    bytes.extend(shorts(&[0, 1, 2, 2, 1, 3]));
    bytes
}

pub(super) fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn shorts(values: &[u16]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn data_uri(bytes: &[u8]) -> String {
    format!("data:application/octet-stream;base64,{}", STANDARD.encode(bytes))
}

/// The square under one node, its bytes in a data URI.
pub(super) fn square_document() -> Value {
    json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"}
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 12}
        ],
        "buffers": [{"byteLength": 60, "uri": data_uri(&square())}]
    })
}

/// Appends a buffer, a view of all of it and an accessor; returns the accessor's index.
pub(super) fn add_accessor(document: &mut Value, bytes: &[u8], component: u32, count: usize, kind: &str) -> usize {
    let push = |list: &mut Value, value: Value| {
        let list = list.as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    };
    let buffer = push(&mut document["buffers"], json!({"byteLength": bytes.len(), "uri": data_uri(bytes)}));
    let view = push(&mut document["bufferViews"], json!({"buffer": buffer, "byteLength": bytes.len()}));
    let accessor = json!({"bufferView": view, "componentType": component, "count": count, "type": kind});
    push(&mut document["accessors"], accessor)
}

fn glb(document: &Value, binary: Option<&[u8]>) -> Vec<u8> {
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut chunks = chunk(b"JSON", &json);
    if let Some(binary) = binary {
        chunks.extend(chunk(b"BIN\0", binary));
    }
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend(u32::try_from(12 + chunks.len()).unwrap().to_le_bytes());
    bytes.extend(chunks);
    bytes
}

fn chunk(kind: &[u8], data: &[u8]) -> Vec<u8> {
    [&u32::try_from(data.len()).unwrap().to_le_bytes(), kind, data].concat()
}

fn load_bytes(bytes: &[u8], resources: &Memory) -> Result<Loaded, Problem> {
    let loaded = read(bytes, &ReadOptions::default(), resources)?;
    check_consistent(&loaded.mesh);
    Ok(loaded)
}

fn load(document: &Value) -> Loaded {
    load_bytes(document.to_string().as_bytes(), &Memory::default()).unwrap()
}

#[track_caller]
fn assert_refused(document: &Value, at: &str, what: &str) {
    let problem = load_bytes(document.to_string().as_bytes(), &Memory::default()).unwrap_err();
    assert!(problem.at.contains(at) && problem.what.contains(what), "{problem}");
}

#[test]
fn square_is_read() {
    let mesh = load(&square_document()).mesh;
    assert_eq!(mesh.triangles, [[0, 1, 2], [2, 1, 3]]);
    assert_eq!(mesh.positions[3], [1.0, 1.0, 0.0]);
    assert_eq!(mesh.up, Some(trixel::UpAxis::Y));
    assert!(mesh.triangle_materials.is_empty());
}

#[test]
fn node_transforms_compose_in_f64() {
    let mut document = square_document();
    document["nodes"] = json!([
        {"children": [1], "translation": [0.1, 0, 0], "scale": [0.1, 0.1, 0.1]},
        {"mesh": 0, "matrix": [2,0,0,0, 0,2,0,0, 0,0,2,0, 5,6,7,1]}
    ]);
    let mesh = load(&document).mesh;
    assert_eq!(mesh.positions[0], [0.1 * 5.0 + 0.1, 0.1 * 6.0, 0.1 * 7.0]);
    assert_eq!(mesh.positions[1][0], 0.1 * 2.0 + (0.1 * 5.0 + 0.1));
}

#[test]
fn mesh_of_two_nodes_is_placed_twice_and_mirrored_triangles_are_turned() {
    let mut document = square_document();
    document["nodes"] = json!([{"mesh": 0}, {"mesh": 0, "scale": [-1, 1, 1]}]);
    document["scenes"] = json!([{"nodes": [0, 1]}]);
    let mesh = load(&document).mesh;
    assert_eq!(mesh.positions.len(), 8);
    assert_eq!(mesh.triangles[2], [4, 6, 5]);
}

#[test]
fn default_scene_first_scene_all_roots_and_no_nodes() {
    let mut document = square_document();
    document["nodes"] = json!([{"mesh": 0}, {"mesh": 0}, {"mesh": 0}]);
    document["scenes"] = json!([{"nodes": [0]}, {"nodes": [1, 2]}]);
    document["scene"] = json!(1);
    assert_eq!(load(&document).mesh.triangles.len(), 4);
    document.as_object_mut().unwrap().remove("scene");
    assert_eq!(load(&document).mesh.triangles.len(), 2);
    document["scenes"] = json!([]);
    assert_eq!(load(&document).mesh.triangles.len(), 6);
    document["nodes"] = json!([]);
    let loaded = load(&document);
    assert_eq!(loaded.mesh.triangles.len(), 2);
    assert!(loaded.warnings[0].contains("no node"));
    document["scene"] = json!(3);
    assert_refused(&document, "scene", "scene 3 does not exist");
}

#[test]
fn gpu_instancing_places_every_instance() {
    let mut document = square_document();
    let translation = add_accessor(&mut document, &floats(&[0.0, 0.0, 0.0, 10.0, 0.0, 0.0]), 5126, 2, "VEC3");
    let scale = add_accessor(&mut document, &floats(&[1.0, 1.0, 1.0, 2.0, 2.0, 2.0]), 5126, 2, "VEC3");
    document["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    document["nodes"][0]["extensions"] =
        json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": translation, "SCALE": scale}}});
    let mesh = load(&document).mesh;
    assert_eq!(mesh.triangles.len(), 4);
    assert_eq!(mesh.positions[7], [12.0, 2.0, 0.0]);
}

#[test]
fn cycles_and_second_parents_are_refused_by_name() {
    let mut document = square_document();
    document["nodes"] = json!([{"children": [1]}, {"name": "arm", "children": [0], "mesh": 0}]);
    assert_refused(&document, "node 0", "cycle");
    document["scenes"] = json!([]);
    document.as_object_mut().unwrap().remove("scene");
    assert_refused(&document, "node 0", "cycle");
    document["nodes"] = json!([{"children": [2]}, {"children": [2]}, {"mesh": 0}]);
    assert_refused(&document, "node 2", "child of both node 0 and node 1");
    document["nodes"] = json!([{"children": [9]}]);
    assert_refused(&document, "node 0", "node 9");
    document["nodes"] = json!([{"children": [1]}, {"mesh": 0, "name": "arm"}]);
    document["scenes"] = json!([{"nodes": [0, 1]}]);
    assert_refused(&document, "node 1 (arm)", "twice");
    document["scenes"] = json!([{"nodes": [7]}]);
    assert_refused(&document, "scene", "node 7 does not exist");
}

#[test]
fn chain_of_a_hundred_thousand_nodes() {
    let mut document = square_document();
    let nodes = 100_000;
    let mut list: Vec<Value> = (1..nodes).map(|i| json!({"children": [i], "translation": [0.5, 0, 0]})).collect();
    list.push(json!({"mesh": 0}));
    document["nodes"] = list.into();
    assert_eq!(load(&document).mesh.positions[0][0], 0.5 * 99_999.0);
}

#[test]
fn deep_json_is_refused_without_recursing() {
    let deep = "[".repeat(1_000_000);
    let problem = load_bytes(deep.as_bytes(), &Memory::default()).unwrap_err();
    assert_eq!(problem.at, "JSON");
    let text = format!(r#"{{"asset":{{"version":"2.0"}},"extras":{deep}"#);
    assert!(load_bytes(text.as_bytes(), &Memory::default()).is_err());
}

#[test]
fn instancing_bomb_is_refused_before_it_is_placed() {
    let mut document = square_document();
    document["accessors"][0] = json!({"componentType": 5126, "count": 4_000_000, "type": "VEC3"});
    document["nodes"] = (0..1000).map(|_| json!({"mesh": 0})).collect();
    document["scenes"] = json!([{"nodes": (0..1000).collect::<Vec<_>>()}]);
    assert_refused(&document, "mesh 0, primitive 0", "more than");
    // One accessor alone must not claim what the file cannot hold either.
    document["accessors"][0]["count"] = json!(4_000_000_000u64);
    assert_refused(&document, "accessor 0", "more than");
}

#[test]
fn strips_fans_and_missing_indices() {
    let mut document = square_document();
    let primitive = &mut document["meshes"][0]["primitives"][0];
    primitive.as_object_mut().unwrap().remove("indices");
    primitive["mode"] = json!(5);
    assert_eq!(load(&document).mesh.triangles, [[0, 1, 2], [1, 3, 2]]);
    document["meshes"][0]["primitives"][0]["mode"] = json!(6);
    assert_eq!(load(&document).mesh.triangles, [[1, 2, 0], [2, 3, 0]]);
    document["meshes"][0]["primitives"][0]["mode"] = json!(4);
    let loaded = load(&document);
    assert_eq!(loaded.mesh.triangles, [[0, 1, 2]]);
    assert!(loaded.warnings[0].contains("left over"));
    document["meshes"][0]["primitives"][0]["mode"] = json!(7);
    assert_refused(&document, "primitive 0", "mode 7");
}

#[test]
fn points_and_lines_are_skipped_and_counted() {
    let mut document = square_document();
    let triangles = document["meshes"][0]["primitives"][0].clone();
    let mut points = triangles.clone();
    points["mode"] = json!(0);
    let mut lines = triangles.clone();
    lines["mode"] = json!(3);
    document["meshes"][0]["primitives"] = json!([points, triangles, lines]);
    let loaded = load(&document);
    assert_eq!(loaded.mesh.triangles.len(), 2);
    assert_eq!(loaded.warnings, ["2 primitives of points or lines skipped"]);
}

#[test]
fn indices_of_every_width() {
    for (component, bytes) in [
        (5121, vec![0, 1, 2, 2, 1, 3]),
        (5123, shorts(&[0, 1, 2, 2, 1, 3])),
        (5125, [0u32, 1, 2, 2, 1, 3].iter().flat_map(|i| i.to_le_bytes()).collect()),
    ] {
        let mut document = square_document();
        let accessor = add_accessor(&mut document, &bytes, component, 6, "SCALAR");
        document["meshes"][0]["primitives"][0]["indices"] = json!(accessor);
        assert_eq!(load(&document).mesh.triangles, [[0, 1, 2], [2, 1, 3]]);
    }
}

#[test]
fn index_out_of_range_and_primitive_restart_are_refused() {
    for (bad, mode) in [(4, 4), (65535, 5)] {
        let mut document = square_document();
        let accessor = add_accessor(&mut document, &shorts(&[0, 1, bad]), 5123, 3, "SCALAR");
        document["meshes"][0]["primitives"][0] =
            json!({"attributes": {"POSITION": 0}, "indices": accessor, "mode": mode});
        assert_refused(&document, "mesh 0, primitive 0", &format!("index {bad} (entry 2"));
    }
}

#[test]
fn primitives_that_share_vertices_share_them_in_the_mesh() {
    let mut document = square_document();
    let primitive = document["meshes"][0]["primitives"][0].clone();
    document["meshes"][0]["primitives"] = json!([primitive, primitive]);
    let mesh = load(&document).mesh;
    assert_eq!((mesh.positions.len(), mesh.triangles.len()), (4, 4));
}

#[test]
fn interleaved_and_sparse_and_absent_views() {
    // x y z and a fourth number to skip, stride 16.
    let mut document = square_document();
    let bytes = floats(&[0.0, 0.0, 0.0, 9.0, 1.0, 0.0, 0.0, 9.0, 0.0, 1.0, 0.0]);
    let accessor = add_accessor(&mut document, &bytes, 5126, 3, "VEC3");
    document["bufferViews"][2]["byteStride"] = json!(16);
    document["meshes"][0]["primitives"] = json!([{"attributes": {"POSITION": accessor}}]);
    assert_eq!(load(&document).mesh.positions, [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);

    // Zeros but for element 2 (and, in the second round, the view's values but for element 2).
    let index = add_accessor(&mut document, &shorts(&[2]), 5123, 1, "SCALAR");
    let value = add_accessor(&mut document, &floats(&[7.0, 8.0, 9.0]), 5126, 1, "VEC3");
    let view = |accessor: usize| document["accessors"][accessor]["bufferView"].clone();
    let sparse = json!({"count": 1, "indices": {"bufferView": view(index), "componentType": 5123},
        "values": {"bufferView": view(value)}});
    document["accessors"][accessor]["sparse"] = sparse;
    assert_eq!(load(&document).mesh.positions, [[0.0; 3], [1.0, 0.0, 0.0], [7.0, 8.0, 9.0]]);
    document["accessors"][accessor].as_object_mut().unwrap().remove("bufferView");
    assert_eq!(load(&document).mesh.positions, [[0.0; 3], [0.0; 3], [7.0, 8.0, 9.0]]);
    document["accessors"][accessor]["count"] = json!(2);
    assert_refused(&document, "sparse", "replaces element 2");
    document["accessors"][accessor]["sparse"]["count"] = json!(5);
    assert_refused(&document, "sparse", "needs 5 elements");
}

#[test]
fn quantized_positions_and_texture_coordinates() {
    let positions: [(u32, bool, Vec<u8>, f64); 6] = [
        (5120, false, vec![0, 0, 0, 0, 127, 0, 0, 0, 0, 129, 0, 0], -127.0),
        (5120, true, vec![0, 0, 0, 0, 127, 0, 0, 0, 0, 128, 0, 0], -1.0),
        (5121, false, vec![0, 0, 0, 0, 5, 0, 0, 0, 0, 255, 0, 0], 255.0),
        (5121, true, vec![0, 0, 0, 0, 5, 0, 0, 0, 0, 51, 0, 0], 0.2),
        (5122, true, [0i16, 0, 0, 0, 5, 0, 0, 0, 0, -32767, 0, 0].iter().flat_map(|v| v.to_le_bytes()).collect(), -1.0),
        (5123, false, shorts(&[0, 0, 0, 0, 5, 0, 0, 0, 0, 40_000, 0, 0]), 40_000.0),
    ];
    for (component, normalized, bytes, expected) in positions {
        let mut document = square_document();
        document["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
        let accessor = add_accessor(&mut document, &bytes, component, 3, "VEC3");
        document["bufferViews"][2]["byteStride"] = json!(bytes.len() / 3);
        document["accessors"][accessor]["normalized"] = json!(normalized);
        document["meshes"][0]["primitives"] = json!([{"attributes": {"POSITION": accessor}}]);
        // Each element is three numbers and a fourth that pads it to the stride.
        let position = load(&document).mesh.positions[2];
        assert_eq!(position[1], expected, "{component} {normalized}: {position:?}");
    }
    let mut document = square_document();
    let uv = add_accessor(&mut document, &shorts(&[0, 0, 65535, 0, 0, 65535, 13107, 65535]), 5123, 4, "VEC2");
    document["accessors"][uv]["normalized"] = json!(true);
    document["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(uv);
    assert_eq!(load(&document).mesh.uvs[0].values[3], [0.2, 1.0]);
}

#[test]
fn colours_rgb_rgba_and_normalized() {
    let rgb = floats(&[1.0, 0.5, 0.25].repeat(4));
    let cases = [
        (rgb, 5126, "VEC3", [1.0, 0.5, 0.25, 1.0]),
        ([255, 51, 0, 102].repeat(4), 5121, "VEC4", [1.0, 0.2, 0.0, 0.4]),
        (shorts(&[65535, 13107, 0, 26214].repeat(4)), 5123, "VEC4", [1.0, 0.2, 0.0, 0.4]),
    ];
    for (bytes, component, kind, expected) in cases {
        let mut document = square_document();
        let color = add_accessor(&mut document, &bytes, component, 4, kind);
        document["accessors"][color]["normalized"] = json!(component != 5126);
        document["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(color);
        let colors = load(&document).mesh.colors.unwrap();
        assert_eq!(colors.corners, None);
        assert_eq!(colors.values[2], expected);
    }
}

#[test]
fn attribute_of_one_primitive_only_has_corners() {
    let mut document = square_document();
    let plain = document["meshes"][0]["primitives"][0].clone();
    let normal = add_accessor(&mut document, &floats(&[0.0, 0.0, 1.0].repeat(4)), 5126, 4, "VEC3");
    document["meshes"][0]["primitives"] =
        json!([plain, {"attributes": {"POSITION": 0, "NORMAL": normal}, "indices": 1}]);
    let mesh = load(&document).mesh;
    let normals = mesh.normals.unwrap();
    assert_eq!(normals.on_triangle(1, mesh.triangles[1]), None);
    assert_eq!(normals.on_triangle(2, mesh.triangles[2]), Some([[0.0, 0.0, 1.0]; 3]));
    // Without attributes nothing of this is read, not even when it is damaged.
    document["accessors"][normal]["count"] = json!(1_000_000_000);
    let bytes = document.to_string().into_bytes();
    let mesh = read(&bytes, &ReadOptions { attributes: false }, &Memory::default()).unwrap().mesh;
    assert_eq!((mesh.triangles.len(), mesh.normals), (4, None));
    assert_refused(&document, &format!("accessor {normal}"), "");
}

#[test]
fn attribute_with_another_count_than_positions_is_refused() {
    let mut document = square_document();
    let normal = add_accessor(&mut document, &floats(&[0.0; 9]), 5126, 3, "VEC3");
    document["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(normal);
    assert_refused(&document, "primitive 0", "has 3 values for 4 vertices");
}

#[test]
fn morph_targets_follow_the_default_weights() {
    let mut document = square_document();
    let offsets = add_accessor(&mut document, &floats(&[0.0, 0.0, 4.0].repeat(4)), 5126, 4, "VEC3");
    document["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": offsets}]);
    assert_eq!(load(&document).mesh.positions[0][2], 0.0);
    document["meshes"][0]["weights"] = json!([0.5]);
    assert_eq!(load(&document).mesh.positions[0][2], 2.0);
    document["nodes"] = json!([{"mesh": 0}, {"mesh": 0, "weights": [0.25]}]);
    document["scenes"] = json!([{"nodes": [0, 1]}]);
    let mesh = load(&document).mesh;
    assert_eq!((mesh.positions[0][2], mesh.positions[4][2]), (2.0, 1.0));
}

#[test]
fn unsupported_required_extensions_are_refused_by_name_and_used_ones_ignored() {
    let mut document = square_document();
    document["extensionsUsed"] = json!(["KHR_draco_mesh_compression", "VENDOR_secret"]);
    assert_eq!(load(&document).mesh.triangles.len(), 2);
    for (name, advice) in [
        ("KHR_draco_mesh_compression", "without Draco compression"),
        ("EXT_meshopt_compression", "without meshopt compression"),
        ("KHR_texture_basisu", "PNG or JPEG"),
        ("VENDOR_secret", "without it"),
    ] {
        document["extensionsRequired"] = json!([name]);
        assert_refused(&document, "extensionsRequired", name);
        assert_refused(&document, "extensionsRequired", advice);
    }
    document["extensionsRequired"] = json!(["KHR_materials_unlit", "KHR_texture_transform", "KHR_lights_punctual"]);
    assert_eq!(load(&document).mesh.triangles.len(), 2);
}

#[test]
fn draco_without_a_fallback_is_refused_even_when_not_required() {
    let mut document = square_document();
    document["meshes"][0]["primitives"][0]["extensions"] = json!({"KHR_draco_mesh_compression": {"bufferView": 0}});
    assert_eq!(load(&document).mesh.triangles.len(), 2);
    document["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    assert_refused(&document, "primitive 0", "without Draco");
}

#[test]
fn other_versions_are_refused() {
    let mut document = square_document();
    document["asset"]["version"] = json!("1.0");
    assert_refused(&document, "asset", "glTF 1.0");
}

#[test]
fn base64_with_and_without_padding_and_plain_data() {
    let mut bytes = square();
    bytes.push(0);
    let mut document = square_document();
    for encoded in [STANDARD.encode(&bytes), STANDARD_NO_PAD.encode(&bytes)] {
        document["buffers"][0]["uri"] = json!(format!("data:;base64,{encoded}"));
        assert_eq!(load(&document).mesh.triangles.len(), 2);
    }
    let percent: String = bytes.iter().map(|b| format!("%{b:02x}")).collect();
    document["buffers"][0]["uri"] = json!(format!("data:,{percent}"));
    assert_eq!(load(&document).mesh.triangles.len(), 2);
    document["buffers"][0]["uri"] = json!("data:;base64,!!!!");
    assert_refused(&document, "buffer 0", "base64");
    document["buffers"][0]["uri"] = json!("data:nothing");
    assert_refused(&document, "buffer 0", "','");
}

#[test]
fn external_buffers_are_percent_decoded() {
    let mut document = square_document();
    document["buffers"][0]["uri"] = json!("my%20mesh.bin");
    let resources = Memory::with("my mesh.bin", square());
    assert_eq!(load_bytes(document.to_string().as_bytes(), &resources).unwrap().mesh.triangles.len(), 2);
    assert_refused(&document, "buffer 0", "'my mesh.bin'");
    let cut = Memory::with("my mesh.bin", square()[..59].to_vec());
    let problem = load_bytes(document.to_string().as_bytes(), &cut).unwrap_err();
    assert!(problem.what.contains("should have 60 bytes but has 59"), "{problem}");
    document["buffers"][0]["uri"] = json!("https://example.org/mesh.bin");
    assert_refused(&document, "buffer 0", "only files beside the mesh");
}

#[test]
fn glb_and_the_lies_of_its_header() {
    let mut document = square_document();
    document["buffers"][0].as_object_mut().unwrap().remove("uri");
    let good = glb(&document, Some(&square()));
    let resources = Memory::default();
    assert_eq!(load_bytes(&good, &resources).unwrap().mesh.triangles.len(), 2);

    let mut trailing = good.clone();
    trailing.extend([0; 7]);
    assert!(load_bytes(&trailing, &resources).unwrap().warnings[0].contains("7 bytes after the end"));

    let refused = |bytes: &[u8], what: &str| {
        let problem = load_bytes(bytes, &resources).unwrap_err();
        assert!(problem.what.contains(what), "{problem}");
    };
    refused(&good[..good.len() - 1], "it is cut off");
    let with = |at: usize, value: u32| {
        let mut bytes = good.clone();
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        bytes
    };
    refused(&with(4, 1), "version 1");
    refused(&with(8, u32::MAX), "it is cut off");
    refused(&with(12, u32::MAX), "does not fit");
    refused(&with(16, 0x004e_4942), "JSON chunk must be the first");
    refused(&with(8, 12), "no JSON chunk");
    refused(&glb(&document, None), "no data");
    refused(&glb(&document, Some(&square()[..50])), "should have 60 bytes");
    refused(b"glTF", "cut off");
    assert!(load_bytes(b"", &resources).is_err());
}

#[test]
fn lying_views_and_accessors_are_refused() {
    let lies: [(&str, usize, &str, Value, &str); 12] = [
        ("accessors", 0, "count", json!(5), "accessor 0"),
        ("accessors", 0, "byteOffset", json!(u64::MAX), "accessor 0"),
        ("accessors", 0, "componentType", json!(5130), "accessor 0"),
        ("accessors", 0, "componentType", json!(5125), "accessor 0"),
        ("accessors", 0, "type", json!("VEC2"), "accessor 0"),
        ("accessors", 1, "type", json!("VEC3"), "accessor 1"),
        ("accessors", 1, "componentType", json!(5126), "accessor 1"),
        ("accessors", 0, "bufferView", json!(9), "accessor 0"),
        ("bufferViews", 0, "byteLength", json!(1u64 << 60), "bufferView 0"),
        ("bufferViews", 0, "byteOffset", json!(u64::MAX), "bufferView 0"),
        ("bufferViews", 0, "byteStride", json!(4), "accessor 0"),
        ("bufferViews", 0, "buffer", json!(3), "bufferView 0"),
    ];
    for (list, index, key, value, at) in lies {
        let mut document = square_document();
        document[list][index][key] = value;
        assert_refused(&document, at, "");
    }
    let mut document = square_document();
    document["nodes"][0]["mesh"] = json!(4);
    assert_refused(&document, "mesh 4", "does not exist");
    let mut document = square_document();
    document["meshes"][0]["primitives"][0]["indices"] = json!(40);
    assert_refused(&document, "accessor 40", "does not exist");
    let mut document = square_document();
    document["meshes"][0]["primitives"][0]["material"] = json!(0);
    assert_refused(&document, "primitive 0", "material 0");
    let mut document = square_document();
    document["nodes"][0]["scale"] = json!([1e300, 1e300, 1e300]);
    document["nodes"] = json!([{"children": [1], "scale": [1e300, 1, 1]}, {"mesh": 0, "scale": [1e300, 1, 1]}]);
    assert_refused(&document, "mesh 0", "not finite");
}

#[test]
fn positions_that_are_not_finite_are_refused() {
    let mut document = square_document();
    let bad =
        add_accessor(&mut document, &floats(&[0.0, 0.0, 0.0, 1.0, f32::NAN, 0.0, 0.0, 1.0, 0.0]), 5126, 3, "VEC3");
    document["meshes"][0]["primitives"] = json!([{"attributes": {"POSITION": bad}}]);
    assert_refused(&document, "mesh 0, primitive 0", "vertex 1 is not finite");
}

#[test]
fn materials_textures_and_images() {
    let mut document = square_document();
    document["images"] = json!([
        {"uri": "wood%20grain.png"},
        {"bufferView": 1, "mimeType": "image/png", "name": "inside"},
        {"uri": "data:image/png;base64,AQID"},
        {"uri": "gone.png"}
    ]);
    document["samplers"] = json!([{"magFilter": 9728, "wrapS": 33071, "wrapT": 33648}]);
    document["textures"] =
        json!([{"source": 0, "sampler": 0}, {"source": 1}, {"source": 2}, {"source": 3}, {"source": 99}]);
    document["materials"] = json!([
        {
            "name": "wood", "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.25,
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.5, "roughnessFactor": 0.75,
                "baseColorTexture": {"index": 0, "texCoord": 1, "extensions":
                    {"KHR_texture_transform": {"offset": [0.5, 0], "scale": [2, 3], "texCoord": 0}}},
                "metallicRoughnessTexture": {"index": 1}
            },
            "emissiveFactor": [1, 0.5, 0], "emissiveTexture": {"index": 2},
            "extensions": {
                "KHR_materials_emissive_strength": {"emissiveStrength": 4},
                "KHR_materials_transmission": {"transmissionFactor": 0.9},
                "KHR_materials_ior": {"ior": 1.33}
            }
        },
        {"alphaMode": "BLEND", "extensions": {"KHR_materials_pbrSpecularGlossiness":
            {"diffuseFactor": [0.5, 0.5, 0.5, 1], "diffuseTexture": {"index": 3}, "glossinessFactor": 0.25}}},
        {"emissiveTexture": {"index": 4}}
    ]);
    document["meshes"][0]["primitives"][0]["material"] = json!(0);
    let resources = Memory::with("wood grain.png", vec![]);
    let loaded = load_bytes(document.to_string().as_bytes(), &resources).unwrap();
    let mesh = &loaded.mesh;
    assert_eq!(mesh.triangle_materials, [0, 0]);
    let wood = &mesh.materials[0];
    assert_eq!((wood.name.as_str(), wood.base_color), ("wood", [0.1, 0.2, 0.3, 0.4]));
    assert_eq!((wood.metallic, wood.roughness, wood.double_sided), (0.5, 0.75, true));
    assert_eq!(wood.alpha_mode, AlphaMode::Mask { cutoff: 0.25 });
    assert_eq!((wood.emissive, wood.transmission, wood.index_of_refraction), ([4.0, 2.0, 0.0], 0.9, 1.33));
    let base = wood.base_color_texture.unwrap();
    assert_eq!((base.uv_set, base.transform), (0, [[2.0, 0.0, 0.5], [0.0, 3.0, 0.0]]));
    let texture = mesh.textures[base.texture as usize];
    assert_eq!((texture.wrap, texture.filter), ([Wrap::Clamp, Wrap::Mirror], Filter::Nearest));
    let source = |texture: trixel::TextureRef| &mesh.images[mesh.textures[texture.texture as usize].image as usize];
    assert_eq!(source(base).source, ImageSource::File("wood grain.png".into()));
    assert_eq!(source(wood.metallic_roughness_texture.unwrap()).name, "inside");
    assert_eq!(source(wood.metallic_roughness_texture.unwrap()).source, ImageSource::Encoded(square()[48..].to_vec()));
    assert_eq!(source(wood.emissive_texture.unwrap()).source, ImageSource::Encoded(vec![1, 2, 3]));
    let old = &mesh.materials[1];
    assert_eq!((old.base_color, old.metallic, old.roughness), ([0.5, 0.5, 0.5, 1.0], 0.0, 0.75));
    assert_eq!((old.base_color_texture, old.alpha_mode), (None, AlphaMode::Blend));
    assert_eq!(loaded.warnings.len(), 2, "{:?}", loaded.warnings);
    assert!(loaded.warnings[0].contains("gone.png"));
}

#[test]
fn images_that_share_bytes_without_end_are_left_out() {
    let mut document = square_document();
    let images = 2000;
    document["images"] = (0..images).map(|_| json!({"bufferView": 0})).collect();
    document["textures"] = (0..images).map(|i| json!({"source": i})).collect();
    document["materials"] = (0..images).map(|i| json!({"emissiveTexture": {"index": i}})).collect();
    document["meshes"][0]["primitives"][0]["material"] = json!(0);
    let long = square().repeat(2000);
    document["buffers"][0] = json!({"byteLength": long.len(), "uri": data_uri(&long)});
    document["bufferViews"][0]["byteLength"] = json!(long.len());
    let loaded = load(&document);
    assert!(loaded.mesh.images.len() < 50, "{}", loaded.mesh.images.len());
    assert!(loaded.warnings.iter().any(|warning| warning.contains("shares its bytes")));
}

#[test]
fn damaged_files_never_panic() {
    let mut document = square_document();
    let normal = add_accessor(&mut document, &floats(&[0.0, 0.0, 1.0].repeat(4)), 5126, 4, "VEC3");
    let color = add_accessor(&mut document, &[200; 16], 5121, 4, "VEC4");
    let sparse = add_accessor(&mut document, &shorts(&[1, 3]), 5123, 2, "SCALAR");
    let sparse_view = document["accessors"][sparse]["bufferView"].clone();
    document["accessors"][0]["sparse"] =
        json!({"count": 2, "indices": {"bufferView": sparse_view, "componentType": 5123}, "values": {"bufferView": 0}});
    document["meshes"][0]["primitives"][0] = json!({"attributes": {"POSITION": 0, "NORMAL": normal, "COLOR_0": color},
        "indices": 1, "material": 0, "targets": [{"POSITION": 0}]});
    document["meshes"][0]["weights"] = json!([0.5]);
    document["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
    document["textures"] = json!([{"source": 0}]);
    document["images"] = json!([{"bufferView": 1}]);
    document["nodes"] = json!([{"children": [1], "rotation": [0, 0.6, 0, 0.8]}, {"mesh": 0, "extensions":
        {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": normal}}}}]);
    load(&document);
    let resources = Memory::with("square.bin", square());
    assault(document.to_string().as_bytes(), 4000, read, &resources);
    document["buffers"][0] = json!({"byteLength": 60});
    assault(&glb(&document, Some(&square())), 4000, read, &resources);
}

#[test]
fn real_meshes_have_the_triangles_and_boxes_they_are_known_for() {
    check_model("sponza/Sponza.gltf", read, 262_267, [-19.209, -1.2644, -11.828], [17.999, 14.294, 11.054]);
    check_model("tree/oaktree.gltf", read, 5302, [-0.76972, -1.8586e-07, -0.81728], [0.72734, 1.9262, 0.60142]);
    check_model("cesium-man/CesiumMan.glb", read, 4672, [-0.56914, 0.0, -0.131], [0.56914, 1.5065, 0.18095]);
    check_model("morph-sphere/AnimatedMorphSphere.gltf", read, 960, [-1.0; 3], [1.0; 3]);
    check_model("duck/Duck.glb", read, 4212, [-0.69298, 0.099294, -0.61328], [0.9618, 1.6397, 0.53925]);
    check_model("engine/2CylinderEngine.glb", read, 121_496, [-371.69, -180.97, -140.0], [371.69, 92.042, 128.0]);
    check_model("vertex-colour/float_color_cube.glb", read, 48, [-1.0; 3], [1.0; 3]);
    check_model("dirty/mode5.gltf", read, 2786, [-18.506, 1.7778, 15.686], [38.644, 66.314, 91.804]);
}
