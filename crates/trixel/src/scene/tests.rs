use std::collections::HashMap;

use super::*;
use crate::mesh::UpAxis;

/// Six times the volume that the triangles enclose, positive when they face outwards.
fn volume(mesh: &Mesh) -> f64 {
    let at = |v: u32| mesh.positions[v as usize];
    let part = |[a, b, c]: &[u32; 3]| numbers::dot(at(*a), numbers::cross(at(*b), at(*c)));
    mesh.triangles.iter().map(part).sum::<f64>() / 6.0
}

/// How often each edge is used in the direction from its lower to its higher vertex, and in the other.
fn edges(triangles: &[[u32; 3]]) -> HashMap<[u32; 2], [u32; 2]> {
    let mut uses = HashMap::new();
    for &[a, b, c] in triangles {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            let edge: &mut [u32; 2] = uses.entry([from.min(to), from.max(to)]).or_default();
            edge[usize::from(from > to)] += 1;
        }
    }
    uses
}

fn is_closed(triangles: &[[u32; 3]]) -> bool {
    edges(triangles).values().all(|uses| *uses == [1, 1])
}

/// Values of N to test: the least, the default, and one between that divides nothing.
fn sizes(scene: &Scene) -> Vec<u32> {
    let mut sizes = vec![scene.min, (scene.min + 7).min(scene.max), scene.default.min(64)];
    sizes.dedup();
    sizes
}

#[test]
fn every_scene_is_sound_and_has_the_triangles_it_states() {
    for scene in &SCENES {
        for n in sizes(scene) {
            let mesh = scene.build(n).unwrap();
            mesh.check().unwrap();
            assert_eq!(mesh.triangles.len() as u64, scene.triangles(n), "{} {n}", scene.name);
            assert!(mesh.triangle_materials.is_empty() || mesh.triangle_materials.len() == mesh.triangles.len());
            assert!(mesh.triangle_materials.iter().all(|&m| (m as usize) < mesh.materials.len()));
            assert_eq!(mesh.up, Some(UpAxis::Z));
            let used: std::collections::HashSet<u32> = mesh.triangles.iter().flatten().copied().collect();
            assert_eq!(used.len(), mesh.positions.len(), "{} {n} has vertices that nothing uses", scene.name);
            let degenerate = |&[a, b, c]: &[u32; 3]| a == b || b == c || c == a;
            assert!(!mesh.triangles.iter().any(degenerate), "{} {n}", scene.name);
        }
        assert!((scene.min..=scene.max).contains(&scene.default), "{}", scene.name);
        assert!(scene.triangles(scene.max) > 10_000_000, "{} stays small", scene.name);
        assert!(scene.triangles(scene.max) < 70_000_000, "{} may exhaust the memory", scene.name);
    }
}

#[test]
fn every_scene_is_the_same_each_time() {
    for scene in &SCENES {
        let [a, b] = [0, 1].map(|_| scene.build(scene.min + 3).unwrap());
        assert_eq!((a.positions, a.triangles, a.materials), (b.positions, b.triangles, b.materials), "{}", scene.name);
    }
}

/// A hash of all coordinates' bits, so that a platform on which a scene differs is noticed. Where a scene is changed on
/// purpose, its number changes too.
#[test]
fn scenes_are_the_same_to_the_last_bit_as_when_they_were_made() {
    let digest = |scene: &Scene| {
        let mesh = scene.build(scene.min + 3).unwrap();
        let bits = mesh.positions.iter().flatten().map(|c| c.to_bits());
        bits.fold(0xcbf2_9ce4_8422_2325_u64, |hash, b| (hash ^ b).wrapping_mul(0x100_0000_01b3))
    };
    let found = SCENES.map(|scene| (scene.name, digest(&scene)));
    let expected: [(&str, u64); 11] = [
        ("cube", 1_881_318_220_277_171_133),
        ("torus", 16604716844640175554),
        ("sphere", 12250887416807254099),
        ("triangle", 12924660066317331290),
        ("room", 15283163439698500655),
        ("room-rotated", 5627261574788575410),
        ("hairball", 2797405507819153496),
        ("city", 4603737948459794725),
        ("tree", 13993009417708168021),
        ("knot", 7741018775427879933),
        ("glass-ball", 6334335377080578844),
    ];
    assert_eq!(found.as_slice(), expected.as_slice());
}

#[test]
fn closed_scenes_are_closed_and_face_outwards() {
    let tau = std::f64::consts::TAU;
    let torus = tau * tau / 2.0 * torus::MAJOR * torus::MINOR * torus::MINOR;
    for (spec, expected, tolerance) in [
        ("cube", 1.0, 0.0),
        ("cube:2", 1.0, 1e-15),
        ("cube:7", 1.0, 1e-14),
        ("torus:6", torus, 0.7),
        ("torus:256", torus, 2e-3),
        ("torus:257", torus, 2e-3),
        ("sphere:1", tau * 2.0 / 3.0, 0.5),
        ("sphere:2", tau * 2.0 / 3.0, 0.2),
        ("sphere:64", tau * 2.0 / 3.0, 3e-4),
        // The length of the curve times the tube's section.
        ("knot", 1.0689, 3e-3),
        ("glass-ball", tau * 2.0 / 3.0 + 0.512 * 1.0689, 5e-3),
    ] {
        let mesh = build(spec).unwrap();
        assert!(is_closed(&mesh.triangles), "{spec}");
        let found = volume(&mesh);
        assert!((found - expected).abs() <= tolerance * expected, "{spec}: {found} is not {expected}");
    }
}

#[test]
fn a_sphere_has_all_vertices_on_the_sphere_and_none_twice() {
    let mesh = build("sphere:9").unwrap();
    assert_eq!(mesh.positions.len(), 10 * 81 + 2);
    for p in &mesh.positions {
        assert!((numbers::dot(*p, *p) - 1.0).abs() < 1e-15);
    }
    let distinct: std::collections::HashSet<[u64; 3]> = mesh.positions.iter().map(|p| p.map(f64::to_bits)).collect();
    assert_eq!(distinct.len(), mesh.positions.len());
}

#[test]
fn a_city_has_closed_boxes_on_integers_that_stand_apart() {
    let mesh = build("city:13").unwrap();
    assert!(is_closed(&mesh.triangles));
    assert!(mesh.positions.iter().flatten().all(|c| c.fract() == 0.0));
    let plan: Vec<_> = city::plan(13).collect();
    let sizes = plan.iter().map(|[low, high]| (0..3).map(|i| u64::from(high[i] - low[i])).product::<u64>());
    assert_eq!(volume(&mesh), sizes.sum::<u64>() as f64);
    for (i, a) in plan.iter().enumerate() {
        for b in &plan[..i] {
            assert!((0..2).any(|axis| a[1][axis] < b[0][axis] || b[1][axis] < a[0][axis]), "{a:?} touches {b:?}");
        }
    }
}

#[test]
fn a_tree_has_closed_branches_and_open_leaves() {
    let mesh = build("tree:4").unwrap();
    let of = |material: u32| -> Vec<[u32; 3]> {
        let pairs = mesh.triangles.iter().zip(&mesh.triangle_materials);
        pairs.filter(|(_, m)| **m == material).map(|(t, _)| *t).collect()
    };
    assert_eq!(mesh.materials.iter().map(|m| m.name.as_str()).collect::<Vec<_>>(), ["bark", "leaf"]);
    assert!(is_closed(&of(0)));
    assert!(!is_closed(&of(1)) && of(1).len() == 27 * 26 * 2);
    let bark = Mesh::new(mesh.positions.clone(), of(0));
    assert!(volume(&bark) > 0.0);
    assert!(mesh.bounds().unwrap().min[2] > -0.05, "the tree stands on the ground");
}

#[test]
fn a_room_has_huge_planes_and_closed_furniture() {
    let mesh = build("room:9").unwrap();
    let open: Vec<&str> = (0..)
        .zip(&mesh.materials)
        .filter(|(material, _)| {
            let pairs = mesh.triangles.iter().zip(&mesh.triangle_materials);
            let of: Vec<[u32; 3]> = pairs.filter(|(_, m)| *m == material).map(|(t, _)| *t).collect();
            !is_closed(&of)
        })
        .map(|(_, material)| material.name.as_str())
        .collect();
    assert_eq!(open, ["floor", "wall", "lampshade"]);
    let bounds = mesh.bounds().unwrap();
    assert_eq!((bounds.min, bounds.max), ([0.0; 3], [5.0, 4.0, 2.6]), "furniture stays in the room");

    // Turning keeps lengths, so the same room has the same edges.
    let rotated = build("room-rotated:9").unwrap();
    assert_eq!(rotated.triangles, mesh.triangles);
    let apart = |mesh: &Mesh, a: usize, b: usize| {
        let d = numbers::add(mesh.positions[a], numbers::scale(mesh.positions[b], -1.0));
        numbers::dot(d, d).sqrt()
    };
    for i in 1..mesh.positions.len() {
        assert!((apart(&mesh, 0, i) - apart(&rotated, 0, i)).abs() < 1e-12, "vertex {i}");
    }
}

#[test]
fn strands_of_the_hairball_are_open_tubes_near_the_sphere() {
    let mesh = build("hairball:5").unwrap();
    let boundary = edges(&mesh.triangles).values().filter(|uses| **uses != [1, 1]).count();
    assert_eq!(boundary, 5 * 2 * 3);
    assert!(mesh.positions.iter().all(|p| (0.6..1.01).contains(&numbers::dot(*p, *p).sqrt())));
}

#[test]
fn errors_say_what_to_do() {
    let message = |spec: &str| build(spec).unwrap_err().to_string();
    let names = "the scenes are cube, torus, sphere, triangle, room, room-rotated, hairball, city, tree, knot, \
                 glass-ball";
    assert_eq!(message("tours"), format!("there is no scene 'tours'; did you mean 'torus'?; {names}"));
    assert_eq!(message("Sphere"), format!("there is no scene 'Sphere'; did you mean 'sphere'?; {names}"));
    assert_eq!(message("dragon"), format!("there is no scene 'dragon'; {names}"));
    assert_eq!(message(""), format!("there is no scene ''; {names}"));
    let meaning = "N is the number of boxes along a side (12 N^2 triangles), 1 to 2300";
    assert_eq!(message("city:0"), format!("scene:city:0: 0 is out of range; {meaning}"));
    assert_eq!(message("city:99999999999"), format!("scene:city:99999999999: 99999999999 is out of range; {meaning}"));
    for wrong in ["", "x", "-1", "1.5", "3:4", " 3", "99999999999999999999999"] {
        let expected = format!("scene:city:{wrong}: '{wrong}' is not a positive whole number; {meaning}");
        assert_eq!(message(&format!("city:{wrong}")), expected);
    }
}
