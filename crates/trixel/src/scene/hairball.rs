//! A hairball: thin open tubes wound around a sphere, each crossing all the others' space.

use super::numbers::{Random, Vec3, add, cross, dot, normalize, rotation, scale, sin_cos};
use super::{Builder, Scene};

pub(super) const SCENE: Scene = Scene {
    name: "hairball",
    description: "thin open tubes wound around a sphere of radius 1",
    parameter: "number of strands (1536 triangles each)",
    default: 300,
    min: 1,
    max: 40_000,
    count: |n| 2 * SIDES as u64 * STEPS as u64 * n,
    fill,
};

const SIDES: u32 = 3;
const STEPS: u32 = 256;
const THICKNESS: f64 = 0.004;

fn fill(builder: &mut Builder, n: u32) {
    let mut random = Random(0x4a12);
    for _ in 0..n {
        // A strand goes round a great circle whose plane turns slowly, and breathes in and out.
        let start = random.direction();
        let plane = normalize(cross(start, random.direction()));
        let drift = random.direction();
        let turns = random.between(1.0, 2.2);
        let twist = random.between(-0.3, 0.3);
        let (waves, phase) = (random.between(0.5, 3.0), random.between(0.0, 1.0));
        let radius = random.between(0.72, 0.94);
        let path = |step: u32| -> Vec3 {
            let t = f64::from(step) / f64::from(STEPS);
            let along = rotation(plane, turns * t).map(|row| dot(row, start));
            let turned = rotation(drift, twist * t).map(|row| dot(row, along));
            scale(turned, radius + 0.05 * sin_cos(waves * t + phase).0)
        };
        let ring = |step: u32| {
            let here = path(step);
            let (before, after) = (path(step.saturating_sub(1)), path((step + 1).min(STEPS)));
            let tangent = normalize(add(after, scale(before, -1.0)));
            let side = normalize(cross(tangent, here));
            (here, THICKNESS, [side, cross(tangent, side)])
        };
        builder.rings((0..=STEPS).map(ring), SIDES);
    }
}
