//! A city: boxes on integers, so that every face lies in a voxel boundary of some grid.

use super::numbers::Random;
use super::{Builder, Scene};

pub(super) const SCENE: Scene = Scene {
    name: "city",
    description: "N x N closed axis-aligned boxes with integer coordinates, taller towards the middle",
    parameter: "number of boxes along a side (12 N^2 triangles)",
    default: 24,
    min: 1,
    max: 2300,
    count: |n| 12 * n * n,
    fill,
};

fn fill(builder: &mut Builder, n: u32) {
    for block in plan(n) {
        let [low, high] = block.map(|corner| corner.map(f64::from));
        builder.block(low, high, 1);
    }
}

/// The lowest and highest corner of each box.
pub(super) fn plan(n: u32) -> impl Iterator<Item = [[u32; 3]; 2]> {
    let mut random = Random(0x0c17);
    (0..n).flat_map(move |i| (0..n).map(move |j| (i, j))).map(move |(i, j)| {
        // A lot is 8 wide; a house covers 4 to 6 of it.
        let [x, y] = [i, j].map(|c| 8 * c + 1 + random.below(2));
        let [wide, deep] = [0, 1].map(|_| 4 + random.below(3));
        // Distance from the middle, 0 to n in each direction.
        let [dx, dy] = [i, j].map(|c| (2 * c + 1).abs_diff(n));
        let tallest = 4 + 44 * (n - dx.max(dy)) / n;
        let height = 3 + random.below(tallest);
        [[x, y, 0], [x + wide, y + deep, height]]
    })
}
