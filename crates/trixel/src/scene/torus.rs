//! A torus about the z axis.

use super::numbers::sin_cos;
use super::{Builder, Scene};

pub(super) const SCENE: Scene = Scene {
    name: "torus",
    description: "a torus around the z axis, major radius 1, minor radius 0.4, closed",
    parameter: "number of segments around, half as many around the tube (N^2 triangles for an even N)",
    default: 256,
    min: 6,
    max: 8192,
    count: |n| 2 * n * (n / 2),
    fill,
};

pub(super) const MAJOR: f64 = 1.0;
pub(super) const MINOR: f64 = 0.4;

fn fill(builder: &mut Builder, n: u32) {
    let around_tube = n / 2;
    for i in 0..n {
        let (sin, cos) = sin_cos(f64::from(i) / f64::from(n));
        for j in 0..around_tube {
            let (height, out) = sin_cos(f64::from(j) / f64::from(around_tube));
            let radius = MAJOR + MINOR * out;
            builder.vertex([radius * cos, radius * sin, MINOR * height]);
        }
    }
    let at = |i: u32, j: u32| i % n * around_tube + j % around_tube;
    for i in 0..n {
        for j in 0..around_tube {
            builder.quad([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
}
