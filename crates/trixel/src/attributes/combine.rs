//! How the triangles of one voxel become one: sums, or a winner; [`super`] has the definitions.

use super::Combine;
use super::light::{FULL, multiply, narrow};
use super::nearest::Weights;
use super::surface::Patch;
use super::vector;
use crate::mesh::Mesh;

/// What a surface is like at a point, as far as it was asked for.
#[derive(Clone, Copy)]
pub(super) struct Row {
    pub(super) color: [u16; 4],
    pub(super) normal: [i64; 3],
    pub(super) geometric_normal: [i64; 3],
    pub(super) coordinate: [i64; 2],
    pub(super) emission: [u32; 3],
    pub(super) metallic_roughness: [u16; 2],
    pub(super) triangle: u32,
    pub(super) material: u32,
    pub(super) weights: Weights,
}

impl Row {
    /// A voxel without a triangle.
    pub(super) const NOTHING: Self = Self {
        color: [0; 4],
        normal: [0; 3],
        geometric_normal: [0; 3],
        coordinate: [0; 2],
        emission: [0; 3],
        metallic_roughness: [0; 2],
        triangle: u32::MAX,
        material: Mesh::NO_MATERIAL,
        weights: [0; 3],
    };
}

/// What of a row is asked for; the rest is cheap.
#[derive(Clone, Copy, Default)]
pub(super) struct Wanted {
    pub(super) color: bool,
    pub(super) normal: bool,
    pub(super) geometric_normal: bool,
    pub(super) emission: bool,
    pub(super) metallic_roughness: bool,
    /// Anything that only the winner has.
    pub(super) winner: bool,
}

/// The row at a point of a triangle that the alpha test has passed.
pub(super) fn row(patch: &Patch<'_>, triangle: u32, material: u32, weights: Weights, wanted: Wanted) -> Row {
    let mut row = Row { triangle, material, weights, ..Row::NOTHING };
    if wanted.color {
        // Tested before, so never `None`.
        row.color = patch.color(weights).unwrap_or_default();
    }
    if wanted.normal {
        row.normal = patch.shading_normal(weights);
    }
    if wanted.geometric_normal {
        row.geometric_normal = patch.geometric_normal();
    }
    if wanted.emission {
        row.emission = patch.emission(weights);
    }
    if wanted.metallic_roughness {
        row.metallic_roughness = patch.metallic_roughness(weights);
    }
    if wanted.winner {
        row.coordinate = patch.coordinate(weights);
    }
    row
}

/// The triangles of one voxel so far.
#[derive(Clone, Copy)]
pub(super) struct Cell {
    /// The highest priority that was met.
    priority: u32,
    /// The least of what decides, with its triangle: of equals the lowest.
    least: u32,
    triangle: u32,
    /// Triangles of that priority.
    pub(super) count: u32,
}

impl Cell {
    pub(super) const EMPTY: Self = Self { priority: 0, least: u32::MAX, triangle: u32::MAX, count: 0 };

    /// The winner, if there is any triangle.
    pub(super) fn winner(&self) -> Option<u32> {
        (self.count > 0).then_some(self.triangle)
    }

    /// Starts anew where `priority` beats all before; whether a triangle with it counts.
    pub(super) fn admits(&mut self, priority: u32, sums: Option<&mut Sums>) -> bool {
        if self.count > 0 && priority < self.priority {
            return false;
        }
        if self.count > 0 && priority > self.priority {
            *self = Self::EMPTY;
            if let Some(sums) = sums {
                *sums = Sums::default();
            }
        }
        self.priority = priority;
        true
    }

    /// Counts a triangle; the least `value` wins.
    pub(super) fn add(&mut self, value: u32, triangle: u32) {
        self.count = self.count.saturating_add(1);
        if (value, triangle) < (self.least, self.triangle) {
            (self.least, self.triangle) = (value, triangle);
        }
    }
}

/// Sums, or maxima, over the triangles of one voxel.
#[derive(Clone, Copy, Default)]
pub(super) struct Sums {
    weight: u64,
    /// Red, green and blue times alpha, and alpha.
    color: [u64; 4],
    normal: [i64; 3],
    geometric_normal: [i64; 3],
    emission: [u64; 3],
    metallic_roughness: [u64; 2],
}

impl Sums {
    pub(super) fn add(&mut self, row: &Row, weight: u32) {
        let weight = u64::from(weight);
        self.weight += weight;
        let [r, g, b, a] = row.color;
        let shown = if a == FULL { [r, g, b, a] } else { [multiply(r, a), multiply(g, a), multiply(b, a), a] };
        add(&mut self.color, shown.map(u64::from), weight);
        add(&mut self.emission, row.emission.map(u64::from), weight);
        add(&mut self.metallic_roughness, row.metallic_roughness.map(u64::from), weight);
        for i in 0..3 {
            self.normal[i] += row.normal[i] * weight.cast_signed();
            self.geometric_normal[i] += row.geometric_normal[i] * weight.cast_signed();
        }
    }

    /// Keeps the largest of each component.
    pub(super) fn take_largest(&mut self, row: &Row) {
        let first = self.weight == 0;
        self.weight = 1;
        largest(&mut self.color, row.color.map(u64::from), false);
        largest(&mut self.emission, row.emission.map(u64::from), false);
        largest(&mut self.metallic_roughness, row.metallic_roughness.map(u64::from), false);
        largest(&mut self.normal, row.normal, first);
        largest(&mut self.geometric_normal, row.geometric_normal, first);
    }

    /// Puts the mean, or the maxima, in place of the winner's values.
    pub(super) fn finish(&self, combine: Combine, row: &mut Row) {
        let mean = |sum: u64| (sum + self.weight / 2) / self.weight.max(1);
        let narrowed = |sum: u64| narrow(u32::try_from(mean(sum)).unwrap_or(u32::MAX));
        row.color = if combine == Combine::Max {
            self.color.map(narrowed)
        } else {
            let [r, g, b, a] = self.color;
            [straight(r, a), straight(g, a), straight(b, a), narrowed(a)]
        };
        row.emission = self.emission.map(|sum| u32::try_from(mean(sum)).unwrap_or(u32::MAX));
        row.metallic_roughness = self.metallic_roughness.map(narrowed);
        // Sheets that face each other's backs cancel out: then the winner's normal stays.
        row.normal = vector::normalized(self.normal).unwrap_or(row.normal);
        row.geometric_normal = vector::normalized(self.geometric_normal).unwrap_or(row.geometric_normal);
    }
}

/// A colour component whose sum was multiplied by alpha.
fn straight(sum: u64, alpha: u64) -> u16 {
    let shift = (u64::BITS - alpha.leading_zeros()).saturating_sub(32);
    let (sum, alpha) = (sum >> shift, alpha >> shift);
    let value = (sum * u64::from(FULL) + alpha / 2) / alpha.max(1);
    narrow(u32::try_from(value).unwrap_or(u32::MAX))
}

fn add<const N: usize>(sums: &mut [u64; N], values: [u64; N], weight: u64) {
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum += value * weight;
    }
}

fn largest<T: Copy + Ord, const N: usize>(kept: &mut [T; N], values: [T; N], first: bool) {
    for (kept, value) in kept.iter_mut().zip(values) {
        *kept = if first { value } else { (*kept).max(value) };
    }
}
