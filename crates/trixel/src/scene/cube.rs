//! The unit cube, aligned with the axes.

use super::{Builder, Scene};

pub(super) const SCENE: Scene = Scene {
    name: "cube",
    description: "the unit cube from (0,0,0) to (1,1,1), closed",
    parameter: "number of squares along an edge (12 N^2 triangles)",
    default: 1,
    min: 1,
    max: 2048,
    count: |n| 12 * n * n,
    fill,
};

fn fill(builder: &mut Builder, n: u32) {
    builder.block([0.0; 3], [1.0; 3], n);
}
