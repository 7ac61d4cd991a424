//! A tree: closed tapered branches, and leaves that are single open quads.

use super::numbers::{Random, Vec3, across, add, dot, normalize, rotation, scale};
use super::{Builder, Scene};

pub(super) const SCENE: Scene = Scene {
    name: "tree",
    description: "a tree: closed tapered branches (brown) and leaves of one open quad each (green)",
    parameter: "number of times that branches part, the trunk included (three branches grow of each)",
    default: 7,
    min: 1,
    max: 12,
    count: |n| {
        let twigs = 3_u64.pow(u32::try_from(n - 1).unwrap_or(u32::MAX).min(32));
        let branches = (3 * twigs - 1) / 2;
        branches * (2 * SIDES as u64 * (RINGS as u64 - 1) + 2 * SIDES as u64) + twigs * 2 * LEAVES as u64
    },
    fill,
};

const SIDES: u32 = 8;
const RINGS: u32 = 6;
const LEAVES: u32 = 26;
/// Indices of the materials, in the order in which [`fill`] makes them.
const BARK: u32 = 0;
const LEAF: u32 = 1;

/// A branch about to grow.
struct Branch {
    from: Vec3,
    direction: Vec3,
    length: f64,
    radius: f64,
    /// How many times it will part.
    partings: u32,
}

fn fill(builder: &mut Builder, n: u32) {
    builder.material("bark", [0.105, 0.058, 0.030], 0.95);
    builder.material("leaf", [0.110, 0.280, 0.045], 0.7);
    let mut random = Random(0x7ee);
    let trunk = Branch { from: [0.0; 3], direction: [0.0, 0.0, 1.0], length: 1.9, radius: 0.17, partings: n - 1 };
    grow(builder, &mut random, &trunk);
}

fn grow(builder: &mut Builder, random: &mut Random, branch: &Branch) {
    let last = f64::from(RINGS - 1);
    let bend = scale(random.direction(), 0.12 * branch.length);
    let frame = across(branch.direction);
    let at = |t: f64| add(add(branch.from, scale(branch.direction, branch.length * t)), scale(bend, t * t));
    let radius = |t: f64| branch.radius * (1.0 - 0.45 * t);
    builder.use_material(BARK);
    let rings = (0..RINGS).map(|i| f64::from(i) / last).map(|t| (at(t), radius(t), frame));
    let ends = [(at(0.0), 0.0, frame), (at(1.0), 0.0, frame)];
    builder.rings(ends.into_iter().take(1).chain(rings).chain(ends.into_iter().skip(1)), SIDES);

    if branch.partings == 0 {
        builder.use_material(LEAF);
        for _ in 0..LEAVES {
            let twig = at(random.between(0.25, 1.0));
            leaf(builder, random, twig, branch.length);
        }
        return;
    }
    let spin = random.between(0.0, 1.0);
    for child in 0..3_u32 {
        // The first goes on almost straight; the others leave lower and turn away further.
        let (t, lean) = match child {
            0 => (0.97, random.between(0.03, 0.07)),
            1 => (0.82, random.between(0.10, 0.15)),
            _ => (0.62, random.between(0.11, 0.17)),
        };
        let around = rotation(branch.direction, spin + f64::from(child) / 3.0 + random.between(-0.06, 0.06));
        let axis = around.map(|row| dot(row, frame[0]));
        let leaning = rotation(axis, lean).map(|row| dot(row, branch.direction));
        let direction = normalize(add(leaning, [0.0, 0.0, 0.10]));
        let length = branch.length * random.between(0.64, 0.76);
        let grown = Branch { from: at(t), direction, length, radius: radius(t) * 0.72, partings: branch.partings - 1 };
        grow(builder, random, &grown);
    }
}

/// A leaf near `twig`, of a size that goes with the twig's length.
fn leaf(builder: &mut Builder, random: &mut Random, twig: Vec3, length: f64) {
    let size = 0.055 + 0.10 * length;
    let outwards = random.direction();
    let center = add(twig, scale(outwards, size * random.between(0.6, 1.6)));
    let [u, v] = across(normalize(add(random.direction(), [0.0, 0.0, 0.8])));
    let (u, v) = (scale(u, 0.5 * size), scale(v, 0.32 * size));
    let corner = |a: f64, b: f64| add(center, add(scale(u, a), scale(v, b)));
    builder.sheet([corner(-1.0, 0.0), corner(0.0, -1.0), corner(1.0, 0.0), corner(0.0, 1.0)]);
}
