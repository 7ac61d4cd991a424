//! The definition of each mode, once, as plain and obviously correct code in 128-bit integers, without factoring.
//!
//! Slow on purpose: it tests every voxel of a triangle's bounding box by itself. It shares no arithmetic with the
//! backends: the conservative test is the full separating-axis test over 13 axes, not the edge functions of \[HCV\].

use crate::job::Job;
use crate::lattice::{LatticeMesh, STEPS_PER_VOXEL};
use crate::mode::Mode;
use crate::volume::Volume;

const S: i128 = STEPS_PER_VOXEL as i128;

type Vector = [i128; 3];

#[inline]
fn sub(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline]
fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline]
fn dot(a: Vector, b: Vector) -> i128 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The voxels that the job's mode sets, one triangle and one voxel at a time.
///
/// # Errors
/// When the volume cannot be had.
pub fn voxelize(mesh: &LatticeMesh<'_>, job: &Job) -> Result<Volume, crate::volume::VolumeError> {
    let mut volume = Volume::new(*job.grid())?;
    let dims = job.grid().dims();
    let overlap = i128::from(job.overlap_steps());
    for index in 0..mesh.triangles.len() {
        let triangle = mesh.corners(index).map(|corner| corner.map(i128::from));
        // Solid looks along -z from every voxel of the column; sliced reaches beyond the box by its overlap.
        let (z_low, z_high) = match job.mode() {
            Mode::Solid => (i128::MIN, i128::MAX),
            Mode::Sliced => (-overlap, overlap),
            Mode::Conservative | Mode::Thin => (0, 0),
        };
        let range = |axis: usize, below: i128, above: i128| {
            let low = triangle.iter().map(|v| v[axis]).min().unwrap_or(0).saturating_add(below);
            let high = triangle.iter().map(|v| v[axis]).max().unwrap_or(0).saturating_add(above);
            let low = (low.div_euclid(S) - 1).max(0);
            let high = high.div_euclid(S).min(i128::from(dims[axis]) - 1);
            low..=high
        };
        for x in range(0, 0, 0) {
            for y in range(1, 0, 0) {
                // The same for every z: where the line through the column's centres meets the triangle.
                let looks_along_z = matches!(job.mode(), Mode::Solid | Mode::Sliced);
                let height = if looks_along_z { height_on_centre_line(triangle, x, y) } else { None };
                if looks_along_z && height.is_none() {
                    continue;
                }
                for z in range(2, z_low, z_high) {
                    let voxel = [x, y, z];
                    let hit = match job.mode() {
                        Mode::Conservative => conservative(triangle, voxel),
                        Mode::Thin => thin(triangle, voxel),
                        Mode::Sliced => height.is_some_and(|height| height.is_in_slice(z, overlap)),
                        Mode::Solid => height.is_some_and(|height| height.is_at_or_below_centre(z)),
                    };
                    if hit {
                        let voxel = voxel.map(|i| u32::try_from(i).unwrap_or(u32::MAX));
                        if job.mode() == Mode::Solid {
                            toggle(&mut volume, voxel);
                        } else {
                            volume.set(voxel);
                        }
                    }
                }
            }
        }
    }
    Ok(volume)
}

fn toggle(volume: &mut Volume, [x, y, z]: [u32; 3]) {
    let column = x as usize * volume.grid().dims()[1] as usize + y as usize;
    let word = column * volume.column_words() + (z / 64) as usize;
    volume.words_mut()[word] ^= 1 << (z % 64);
}

/// The closed cube and the convex hull of the three corners share a point: no axis separates them.
#[must_use]
pub fn conservative(triangle: [Vector; 3], voxel: Vector) -> bool {
    let edges = [0, 1, 2].map(|k| sub(triangle[(k + 1) % 3], triangle[k]));
    let units = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
    let apart = |axis: Vector| {
        let corners = (0..8).map(|i| [0, 1, 2].map(|a| (voxel[a] + (i >> a & 1)) * S));
        let (cube_low, cube_high) = interval(corners.map(|corner| dot(axis, corner)));
        let (low, high) = interval(triangle.iter().map(|&v| dot(axis, v)));
        low > cube_high || cube_low > high
    };
    !units.into_iter().any(apart)
        && !apart(cross(edges[0], edges[1]))
        && !edges.into_iter().any(|edge| units.into_iter().any(|unit| apart(cross(edge, unit))))
}

#[inline]
fn interval(values: impl Iterator<Item = i128>) -> (i128, i128) {
    values.fold((i128::MAX, i128::MIN), |(low, high), v| (low.min(v), high.max(v)))
}

/// DESIGN's three conditions. Everything is doubled, so that half a voxel is a whole number.
#[must_use]
pub fn thin(triangle: [Vector; 3], voxel: Vector) -> bool {
    let bounds_meet = (0..3).all(|a| {
        let (low, high) = interval(triangle.iter().map(|v| v[a]));
        low <= (voxel[a] + 1) * S && voxel[a] * S <= high
    });
    if !bounds_meet {
        return false;
    }
    let centre2 = voxel.map(|i| (2 * i + 1) * S);
    let offset2 = |v: Vector| [0, 1, 2].map(|a| centre2[a] - 2 * v[a]);
    let edges = [0, 1, 2].map(|k| sub(triangle[(k + 1) % 3], triangle[k]));
    let normal = cross(edges[0], edges[1]);
    let projections = [(0, 1, 2), (1, 2, 0), (2, 0, 1)];
    if normal == [0; 3] {
        // A segment or a point: the longest edge stands for it.
        let longest = (0..3).max_by_key(|&k| dot(edges[k], edges[k])).unwrap_or(0);
        return projections.iter().all(|&(a, b, _)| {
            let n = (-edges[longest][b], edges[longest][a]);
            let offset = offset2(triangle[longest]);
            (n.0 * offset[a] + n.1 * offset[b]).abs() <= S * n.0.abs().max(n.1.abs())
        });
    }
    let reach = normal.iter().map(|c| c.abs()).max().unwrap_or(0);
    if dot(normal, offset2(triangle[0])).abs() > S * reach {
        return false;
    }
    projections.iter().all(|&(a, b, c)| {
        // Edge-on there is no inside; condition 2 then already says what either choice of sign would.
        let sign = if normal[c] < 0 { -1 } else { 1 };
        (0..3).all(|k| {
            let n = (-edges[k][b] * sign, edges[k][a] * sign);
            let offset = offset2(triangle[k]);
            n.0 * offset[a] + n.1 * offset[b] + S * n.0.abs().max(n.1.abs()) >= 0
        })
    })
}

/// A height above the grid's floor, in steps, as a fraction.
#[derive(Clone, Copy)]
struct Height {
    numerator: i128,
    /// Positive.
    denominator: i128,
}

impl Height {
    /// Inside the closed slice of voxel `z`, extended by `overlap` steps on both sides.
    fn is_in_slice(self, z: i128, overlap: i128) -> bool {
        let (low, high) = (z * S - overlap, (z + 1) * S + overlap);
        low * self.denominator <= self.numerator && self.numerator <= high * self.denominator
    }

    /// Not above the centre of voxel `z`.
    fn is_at_or_below_centre(self, z: i128) -> bool {
        2 * self.numerator <= (2 * z + 1) * S * self.denominator
    }
}

/// Where the line along z through the centres of column (x, y), shifted by (+e, +e^2), meets the triangle; the height
/// is that without the shift.
fn height_on_centre_line(triangle: [Vector; 3], x: i128, y: i128) -> Option<Height> {
    let centre2 = [(2 * x + 1) * S, (2 * y + 1) * S];
    let normal = cross(sub(triangle[1], triangle[0]), sub(triangle[2], triangle[0]));
    if normal[2] == 0 {
        return None;
    }
    let sign = normal[2].signum();
    for k in 0..3 {
        let (v, w) = (triangle[k], triangle[(k + 1) % 3]);
        let n = (-(w[1] - v[1]) * sign, (w[0] - v[0]) * sign);
        let side = n.0 * (centre2[0] - 2 * v[0]) + n.1 * (centre2[1] - 2 * v[1]);
        let shifted_inside = side > 0 || side == 0 && (n.0 > 0 || n.0 == 0 && n.1 > 0);
        if !shifted_inside {
            return None;
        }
    }
    // N . (P - v0) = 0 for P = (centre, height).
    let v = triangle[0];
    let height = 2 * normal[2] * v[2] - normal[0] * (centre2[0] - 2 * v[0]) - normal[1] * (centre2[1] - 2 * v[1]);
    Some(Height { numerator: height * sign, denominator: 2 * normal[2].abs() })
}
