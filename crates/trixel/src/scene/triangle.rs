//! One triangle that spans the scene, or many that cross it.

use super::numbers::{dot, normalize, rotation, scale};
use super::{Builder, Scene};

pub(super) const SCENE: Scene = Scene {
    name: "triangle",
    description: "one triangle that spans the scene, in general position",
    parameter: "number of triangles, each turned further and a little smaller than the one before (N triangles)",
    default: 1,
    min: 1,
    max: 16_000_000,
    count: |n| n,
    fill,
};

fn fill(builder: &mut Builder, n: u32) {
    let corners = [[-0.95, -0.83, -0.61], [0.97, -0.29, 0.37], [-0.13, 0.91, 0.59]];
    let axis = normalize([0.31, -0.47, 0.83]);
    for i in 0..n {
        let share = f64::from(i) / f64::from(n);
        let rows = rotation(axis, share);
        let vertices = corners.map(|corner| builder.vertex(scale(rows.map(|row| dot(row, corner)), 1.0 - 0.5 * share)));
        builder.triangle(vertices);
    }
}
