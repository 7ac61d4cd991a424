//! A room: walls and floor of two huge triangles each, and furniture of many tiny ones.
//!
//! The mix is what hybrid voxelization is for. The walls at the front and on the right are left out, to look in.

use super::numbers::{Vec3, dot, normalize, rotation};
use super::sphere::icosphere;
use super::{Builder, Scene};

pub(super) const SCENE: Scene = Scene {
    name: "room",
    description: "a room of huge walls and finely tessellated furniture: table, chairs, lamp, vase, ball",
    parameter: "number of segments around the furniture's round parts (about 51 N^2 triangles)",
    default: 64,
    min: 8,
    max: 1024,
    count,
    fill: |builder, n| fill(builder, n, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
};

pub(super) const ROTATED: Scene = Scene {
    name: "room-rotated",
    description: "the room turned by a general angle about a general axis, so that no wall is aligned",
    fill: |builder, n| fill(builder, n, rotation(normalize([0.36, -0.48, 0.80]), 0.0917)),
    ..SCENE
};

/// Quads along the edge of a box.
fn cuts(n: u32) -> u32 {
    n / 4
}

fn count(n: u64) -> u64 {
    let cut = n / 4;
    let boxes = 12 * cut * cut * BOXES;
    // A closed lathe of n + 1 rings between two points, and an open one of n + 1 rings.
    let closed = 2 * n * n + 2 * n;
    let open = 2 * n * n;
    2 * PLANES + boxes + CLOSED_LATHES * closed + open + BALLS * 20 * (n / 4).pow(2)
}

const PLANES: u64 = 3;
/// The rug, and the seat and back of four chairs.
const BOXES: u64 = 9;
/// Table top, its leg and foot; four legs of four chairs; foot and pole of the lamp; the vase.
const CLOSED_LATHES: u64 = 2 + 16 + 1 + 1;
const BALLS: u64 = 2;

/// Everything in metres; the floor spans 5 x 4, the walls are 2.6 high.
fn fill(builder: &mut Builder, n: u32, turned: [Vec3; 3]) {
    let here = |p: Vec3| turned.map(|row| dot(row, p));
    builder.place(turned, [0.0; 3]);

    builder.material("floor", [0.36, 0.22, 0.12], 0.6);
    builder.sheet([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [5.0, 4.0, 0.0], [0.0, 4.0, 0.0]]);
    builder.material("wall", [0.78, 0.75, 0.68], 0.9);
    builder.sheet([[0.0, 4.0, 0.0], [5.0, 4.0, 0.0], [5.0, 4.0, 2.6], [0.0, 4.0, 2.6]]);
    builder.sheet([[0.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 4.0, 2.6], [0.0, 0.0, 2.6]]);

    builder.material("rug", [0.42, 0.07, 0.06], 1.0);
    builder.block([0.8, 0.5, 0.0], [4.2, 3.5, 0.02], cuts(n));

    builder.material("wood", [0.30, 0.15, 0.06], 0.5);
    let table = [2.5, 2.0, 0.0];
    let top = [[0.0, 0.70], [0.70, 0.70], [0.76, 0.71], [0.76, 0.73], [0.70, 0.75], [0.0, 0.75]];
    let leg = [[0.0, 0.02], [0.38, 0.02], [0.36, 0.06], [0.07, 0.12], [0.05, 0.45], [0.08, 0.68], [0.0, 0.71]];
    builder.lathe(table, &refine(&top, n), n);
    builder.lathe(table, &refine(&leg, n), n);

    for quarter in 0..4_u32 {
        // The chair is modelled facing +x, its seat's middle above the origin.
        let facing = rotation([0.0, 0.0, 1.0], f64::from(quarter) / 4.0 + 0.03);
        let place = facing.map(|row| dot(row, [-1.05, 0.0, 0.0]));
        let offset = here([table[0] + place[0], table[1] + place[1], 0.02]);
        builder.place(multiply(turned, facing), offset);
        builder.use_material(WOOD);
        let leg = [[0.0, 0.0], [0.016, 0.0], [0.024, 0.42], [0.0, 0.42]];
        for (x, y) in [(-0.18, -0.18), (0.18, -0.18), (0.18, 0.18), (-0.18, 0.18)] {
            builder.lathe([x, y, 0.0], &refine(&leg, n), n);
        }
        builder.block([-0.22, -0.22, 0.42], [0.22, 0.22, 0.46], cuts(n));
        builder.block([-0.22, -0.21, 0.52], [-0.19, 0.21, 0.92], cuts(n));
    }
    builder.place(turned, [0.0; 3]);

    builder.material("brass", [0.55, 0.38, 0.12], 0.3);
    let lamp = [0.55, 3.4, 0.0];
    let pole = [[0.0, 0.0], [0.18, 0.0], [0.17, 0.03], [0.02, 0.06], [0.015, 1.50], [0.0, 1.52]];
    builder.lathe(lamp, &refine(&pole, n), n);
    builder.material("lampshade", [0.85, 0.74, 0.50], 0.9);
    builder.lathe(lamp, &refine(&[[0.32, 1.30], [0.16, 1.70]], n), n);

    builder.material("glaze", [0.05, 0.20, 0.33], 0.15);
    let vase = [
        [0.0, 0.75],
        [0.07, 0.75],
        [0.12, 0.84],
        [0.13, 0.90],
        [0.09, 1.00],
        [0.045, 1.06],
        [0.04, 1.10],
        [0.065, 1.15],
        [0.055, 1.15],
        [0.03, 1.10],
        [0.0, 1.08],
    ];
    builder.lathe([2.35, 2.1, 0.0], &refine(&vase, n), n);
    builder.material("ball", [0.70, 0.30, 0.04], 0.4);
    icosphere(builder, [2.85, 1.8, 0.85], 0.10, n / 4);
    icosphere(builder, [4.2, 0.8, 0.20], 0.18, n / 4);
}

/// The index of the wood among the materials that [`fill`] makes.
const WOOD: u32 = 3;

/// `n + 1` points along a profile, its corners rounded off by a quadratic B-spline, between ends that close it on the
/// axis where the profile's do.
fn refine(profile: &[[f64; 2]], n: u32) -> Vec<[f64; 2]> {
    let closed = |end: Option<&[f64; 2]>| end.copied().filter(|end| end[0] == 0.0);
    let (first, last) = (closed(profile.first()), closed(profile.last()));
    let inner = &profile[usize::from(first.is_some())..profile.len() - usize::from(last.is_some())];
    let spline = (0..=n).map(|i| quadratic_spline(inner, f64::from(i) / f64::from(n)));
    first.into_iter().chain(spline).chain(last).collect()
}

/// A point of the clamped uniform quadratic B-spline of `points`, for `t` from 0 to 1.
fn quadratic_spline(points: &[[f64; 2]], t: f64) -> [f64; 2] {
    let mix = |a: [f64; 2], b: [f64; 2], t: f64| [a[0] * (1.0 - t) + b[0] * t, a[1] * (1.0 - t) + b[1] * t];
    let (Some(&first), Some(&last)) = (points.first(), points.last()) else { return [0.0; 2] };
    if points.len() < 3 {
        return mix(first, last, t);
    }
    // Each inner point bends one piece, from the middle of the segment before it to that of the one after it.
    let pieces = points.len() - 2;
    let along = t * pieces_as_f64(pieces);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to the number of pieces")]
    let piece = (along as usize).min(pieces - 1);
    let t = along - pieces_as_f64(piece);
    let from = if piece == 0 { first } else { mix(points[piece], points[piece + 1], 0.5) };
    let to = if piece == pieces - 1 { last } else { mix(points[piece + 1], points[piece + 2], 0.5) };
    let bend = points[piece + 1];
    mix(mix(from, bend, t), mix(bend, to, t), t)
}

#[expect(clippy::cast_precision_loss, reason = "a handful")]
fn pieces_as_f64(pieces: usize) -> f64 {
    pieces as f64
}

/// The rotation that does `second`'s, then `first`'s.
fn multiply(first: [Vec3; 3], second: [Vec3; 3]) -> [Vec3; 3] {
    first.map(|row| std::array::from_fn(|j| (0..3).map(|k| row[k] * second[k][j]).sum()))
}
