//! A trefoil: a tube that is knotted once, alone or inside a ball of glass.

use super::numbers::{Vec3, add, cross, dot, normalize, scale, sin_cos};
use super::sphere::icosphere;
use super::{Builder, Scene};

pub(super) const SCENE: Scene = Scene {
    name: "knot",
    description: "a trefoil knot of a tube, closed",
    parameter: "number of segments along the tube, an eighth as many around it (N^2 / 4 triangles for a multiple of 8)",
    default: 512,
    min: 24,
    max: 8192,
    count: |n| 2 * n * (n / 8),
    fill: |builder, n| tube(builder, n, n / 8, 1.0),
};

pub(super) const IN_A_BALL: Scene = Scene {
    name: "glass-ball",
    description: "a ball of clear glass with a trefoil knot of amber inside, both closed",
    parameter: "number of pieces of each edge of the icosahedron that the ball is cut from (36 N^2 triangles)",
    default: 48,
    min: 3,
    max: 1200,
    count: |n| 36 * n * n,
    fill: |builder, n| {
        builder.clear_material("glass", [0.94, 0.97, 0.96], 1.14);
        icosphere(builder, [0.0; 3], 1.0, n);
        builder.clear_material("amber", [0.72, 0.24, 0.03], 1.45);
        tube(builder, 8 * n, n, 0.8);
    },
};

/// How far the knot's tube reaches from its middle, and how thick it is, when the whole is 1 in radius.
const RADIUS: f64 = 0.2;
const MIDDLE: f64 = (1.0 - RADIUS) / 3.0;

/// A knot that fits a ball of radius `size`.
fn tube(builder: &mut Builder, along: u32, around: u32, size: f64) {
    let start = builder.next_vertex();
    for i in 0..along {
        let turn = f64::from(i) / f64::from(along);
        let ((sin2, cos2), (sin3, cos3)) = (sin_cos(2.0 * turn), sin_cos(3.0 * turn));
        // The curve lies on a torus, whose normal is square to it.
        let out: Vec3 = [cos3 * cos2, cos3 * sin2, sin3];
        let reach = 2.0 + cos3;
        let curve = [reach * cos2, reach * sin2, sin3];
        let slope =
            normalize([-3.0 * sin3 * cos2 - 2.0 * reach * sin2, -3.0 * sin3 * sin2 + 2.0 * reach * cos2, 3.0 * cos3]);
        debug_assert!(dot(out, slope).abs() < 1e-9);
        let side = cross(slope, out);
        for j in 0..around {
            let (sin, cos) = sin_cos(f64::from(j) / f64::from(around));
            let ring = add(scale(out, cos * RADIUS), scale(side, sin * RADIUS));
            builder.vertex(scale(add(scale(curve, MIDDLE), ring), size));
        }
    }
    let at = |i: u32, j: u32| start + i % along * around + j % around;
    for i in 0..along {
        for j in 0..around {
            builder.quad([at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)]);
        }
    }
}
