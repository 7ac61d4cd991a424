//! Shading normals: the mesh's own, or ones that round what is not a sharp edge.

use std::collections::HashMap;

use glam::DVec3;
use trixel::Mesh;

/// Neighbouring triangles at a larger angle meet in a sharp edge.
const SHARP_DEGREES: f64 = 50.0;
/// Round a vertex with more triangles than this, all of them count; a closer look would cost their number squared.
const MOST_AROUND: usize = 256;

/// Unit normals on the corners of each triangle; 0 for a triangle without area whose corners have none.
pub(super) fn corner_normals(mesh: &Mesh, class_of: impl Fn(usize) -> u8) -> Vec<[DVec3; 3]> {
    let position = |vertex: u32| mesh.positions.get(vertex as usize).map_or(DVec3::ZERO, |&p| DVec3::from_array(p));
    let faces: Vec<DVec3> = mesh
        .triangles
        .iter()
        .map(|&corners| {
            let [a, b, c] = corners.map(position);
            (b - a).cross(c - a).normalize_or_zero()
        })
        .collect();
    let mut around: HashMap<[u64; 3], Vec<(usize, f64)>> = HashMap::new();
    let key = |vertex: u32| (position(vertex) + DVec3::ZERO).to_array().map(f64::to_bits);
    for (triangle, &corners) in mesh.triangles.iter().enumerate() {
        let points = corners.map(position);
        for (i, &corner) in corners.iter().enumerate() {
            let (to_next, to_last) = (points[(i + 1) % 3] - points[i], points[(i + 2) % 3] - points[i]);
            let angle = to_next.normalize_or_zero().dot(to_last.normalize_or_zero()).clamp(-1.0, 1.0).acos();
            around.entry(key(corner)).or_default().push((triangle, angle));
        }
    }
    let least_cos = SHARP_DEGREES.to_radians().cos();
    let rounded = |triangle: usize, vertex: u32| {
        let face = faces[triangle];
        let Some(neighbours) = around.get(&key(vertex)) else { return face };
        let all = neighbours.len() > MOST_AROUND;
        let counts = |&&(other, _): &&(usize, f64)| {
            class_of(other) == class_of(triangle) && (all || faces[other].dot(face) >= least_cos)
        };
        let sum: DVec3 = neighbours.iter().filter(counts).map(|&(other, angle)| faces[other] * angle).sum();
        sum.normalize_or(face)
    };
    let own = |triangle: usize, vertices: [u32; 3]| {
        let normals = mesh.normals.as_ref()?.on_triangle(triangle, vertices)?;
        let unit = normals.map(|n| DVec3::from_array(n.map(f64::from)).normalize_or_zero());
        unit.iter().all(|&n| n != DVec3::ZERO).then_some(unit)
    };
    mesh.triangles
        .iter()
        .enumerate()
        .map(|(triangle, &vertices)| {
            own(triangle, vertices).unwrap_or_else(|| vertices.map(|vertex| rounded(triangle, vertex)))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sphere_becomes_round_and_a_cube_stays_sharp() {
        let sphere = trixel::scene::build("sphere:8").unwrap();
        for (normals, corners) in corner_normals(&sphere, |_| 0).iter().zip(&sphere.triangles) {
            for (normal, &vertex) in normals.iter().zip(corners) {
                assert!(normal.dot(DVec3::from_array(sphere.positions[vertex as usize])) > 0.9995);
            }
        }
        let cube = trixel::scene::build("cube:3").unwrap();
        let axis = |n: &DVec3| (n.abs().max_element() - 1.0).abs() < 1e-12;
        assert!(corner_normals(&cube, |_| 0).iter().flatten().all(axis));
    }

    #[test]
    fn triangles_without_area_have_finite_normals() {
        let mesh = Mesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0]], vec![[0, 0, 1], [0, 1, 1], [0, 0, 0]]);
        assert!(corner_normals(&mesh, |_| 0).iter().flatten().all(|n| n.is_finite()));
    }
}
