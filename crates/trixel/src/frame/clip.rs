//! Cutting triangles in homogeneous coordinates, before the division (I. Sutherland & G. Hodgman, *Reentrant polygon
//! clipping*, 1974).

use glam::{DVec3, DVec4};

/// A corner of what is left of a triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    /// Homogeneous voxel space.
    pub(super) at: DVec4,
    /// The weights of the triangle's own corners; linear in the world.
    pub(super) weights: DVec3,
}

/// Keeps what has a dot product of at least 0 with each of the planes: a convex polygon, or nothing.
pub(super) fn clip(triangle: [DVec4; 3], planes: &[DVec4]) -> Vec<Corner> {
    let mut polygon: Vec<Corner> =
        triangle.into_iter().zip([DVec3::X, DVec3::Y, DVec3::Z]).map(|(at, weights)| Corner { at, weights }).collect();
    for plane in planes {
        let mut kept = Vec::with_capacity(polygon.len() + 1);
        for (i, b) in polygon.iter().enumerate() {
            let a = polygon[(i + polygon.len() - 1) % polygon.len()];
            let (da, db) = (plane.dot(a.at), plane.dot(b.at));
            if (da < 0.0) != (db < 0.0) {
                let t = da / (da - db);
                kept.push(Corner { at: a.at.lerp(b.at, t), weights: a.weights.lerp(b.weights, t) });
            }
            if db >= 0.0 {
                kept.push(*b);
            }
        }
        polygon = kept;
    }
    polygon
}
