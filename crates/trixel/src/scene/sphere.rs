//! The unit sphere, as an icosahedron whose edges are cut into N and pushed out: triangles of nearly equal size.

use super::numbers::{Vec3, add, cross, dot, normalize, scale};
use super::{Builder, Scene};

pub(super) const SCENE: Scene = Scene {
    name: "sphere",
    description: "the unit sphere, a subdivided icosahedron, closed",
    parameter: "number of pieces of each edge of the icosahedron (20 N^2 triangles)",
    default: 64,
    min: 1,
    max: 1800,
    count: |n| 20 * n * n,
    fill: |builder, n| icosphere(builder, [0.0; 3], 1.0, n),
};

/// A closed sphere of `20 n^2` triangles.
pub(super) fn icosphere(builder: &mut Builder, center: Vec3, radius: f64, n: u32) {
    let corners = icosahedron();
    let mut vertex = |p: Vec3| builder.vertex(add(center, scale(normalize(p), radius)));
    let between = |a: Vec3, b: Vec3, i: u32| add(scale(a, f64::from(n - i)), scale(b, f64::from(i)));
    let corner_vertices = corners.map(&mut vertex);

    // The vertices of each edge are made once, from its lower to its higher corner, and shared by two faces.
    let joined = |i: usize, j: usize| {
        let d = add(corners[i], scale(corners[j], -1.0));
        // Edges are 2 long; the next larger distance is 3.2.
        dot(d, d) < 5.0
    };
    let mut edges = [[0; 12]; 12];
    for i in 0..12 {
        for j in i + 1..12 {
            if joined(i, j) {
                for step in 1..n {
                    let made = vertex(between(corners[i], corners[j], step));
                    if step == 1 {
                        edges[i][j] = made;
                    }
                }
            }
        }
    }
    let on_edge = |i: usize, j: usize, step: u32| match step {
        0 => corner_vertices[i],
        step if step == n => corner_vertices[j],
        step if i < j => edges[i][j] + step - 1,
        step => edges[j][i] + n - step - 1,
    };

    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if !(joined(a, b) && joined(b, c) && joined(a, c)) {
                    continue;
                }
                let outwards = dot(corners[a], cross(corners[b], corners[c])) > 0.0;
                let (b, c) = if outwards { (b, c) } else { (c, b) };
                // Row `r` runs from edge ab to edge ac and has r + 1 vertices; those inside the face are its own.
                let inside = builder.next_vertex();
                for row in 2..n {
                    let ends = [between(corners[a], corners[b], row), between(corners[a], corners[c], row)];
                    for i in 1..row {
                        let p = add(scale(ends[0], f64::from(row - i)), scale(ends[1], f64::from(i)));
                        builder.vertex(add(center, scale(normalize(p), radius)));
                    }
                }
                let at = |row: u32, i: u32| match i {
                    _ if row == n => on_edge(b, c, i),
                    0 => on_edge(a, b, row),
                    i if i == row => on_edge(a, c, row),
                    i => inside + (row - 1) * (row - 2) / 2 + i - 1,
                };
                for row in 0..n {
                    for i in 0..=row {
                        builder.triangle([at(row, i), at(row + 1, i), at(row + 1, i + 1)]);
                        if i < row {
                            builder.triangle([at(row, i), at(row + 1, i + 1), at(row, i + 1)]);
                        }
                    }
                }
            }
        }
    }
}

/// The corners of an icosahedron with edges of length 2: the cyclic permutations of (0, +-1, +-golden ratio).
fn icosahedron() -> [Vec3; 12] {
    let golden = (1.0 + 5.0_f64.sqrt()) / 2.0;
    std::array::from_fn(|i| {
        let one = if i & 1 == 0 { 1.0 } else { -1.0 };
        let long = if i & 2 == 0 { golden } else { -golden };
        let mut corner = [0.0, one, long];
        corner.rotate_right(i / 4);
        corner
    })
}
