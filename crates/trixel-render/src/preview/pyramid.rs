//! An occupancy pyramid over a bit-packed volume, and rays that walk it.
//!
//! J. Amanatides & A. Woo, *A Fast Voxel Traversal Algorithm for Ray Tracing*, Eurographics 1987, with cells of
//! several sizes: level `n` has one bit for each cube of `4^n` voxels, set when any voxel in it is. Each step leaves the
//! largest empty cell that the ray is in. Level 0 is the volume itself, so the pyramid adds a sixty-third to its memory.

use glam::DVec3;
use rayon::prelude::*;
use trixel::{Volume, WORD_BITS};

/// Each level's cells are `2^LEVEL_SHIFT` cells of the level below wide.
const LEVEL_SHIFT: u32 = 2;

/// Where the bits of one level are; they are packed as in [`Volume`].
#[derive(Clone, Copy, Default)]
struct Level {
    start: usize,
    rows: usize,
    column_words: usize,
}

/// More levels than a grid of 32768 voxels along an axis can have.
const MAX_LEVELS: usize = 8;

/// A volume and its coarser levels.
pub(super) struct Pyramid<'a> {
    /// Level 0.
    fine: &'a [u64],
    /// The levels above, one after another.
    coarse: Vec<u64>,
    levels: [Level; MAX_LEVELS],
    top: usize,
    /// What a voxel's coordinates are shifted by at the top.
    top_shift: u32,
    dims: [i32; 3],
    lo: [i32; 3],
    hi: [i32; 3],
}

/// Where a ray enters a set voxel.
pub(super) struct Hit {
    /// Distance in units of the ray's direction.
    pub t: f64,
    /// The voxel.
    pub voxel: [i32; 3],
    /// The axis of the face through which the ray enters.
    pub axis: usize,
}

impl<'a> Pyramid<'a> {
    /// Builds the levels; `None` when no voxel is set.
    pub(super) fn build(volume: &'a Volume) -> Option<Self> {
        let dims = volume.grid().dims().map(|d| i32::try_from(d).unwrap_or(i32::MAX));
        let (lo, hi) = occupied_box(volume)?;
        let mut size = volume.grid().dims().map(|d| d as usize);
        let mut levels = [Level::default(); MAX_LEVELS];
        levels[0] = Level { start: 0, rows: size[1], column_words: volume.column_words() };
        let (mut coarse, mut top, mut top_shift) = (Vec::new(), 0, 0);
        while size.iter().any(|&s| s > 1 << LEVEL_SHIFT) && top + 1 < MAX_LEVELS {
            let smaller = size.map(|s| s.div_ceil(1 << LEVEL_SHIFT));
            let below = levels[top];
            let words = coarsen(if top == 0 { volume.words() } else { &coarse[below.start..] }, below, size, smaller);
            let column_words = smaller[2].div_ceil(WORD_BITS as usize);
            top += 1;
            top_shift += LEVEL_SHIFT;
            levels[top] = Level { start: coarse.len(), rows: smaller[1], column_words };
            coarse.extend(words);
            size = smaller;
        }
        Some(Self { fine: volume.words(), coarse, levels, top, top_shift, dims, lo, hi })
    }

    /// The lowest voxel, and one past the highest, of the smallest box around all set voxels.
    pub(super) fn occupied_box(&self) -> ([i32; 3], [i32; 3]) {
        (self.lo, self.hi)
    }

    /// Whether a voxel is set; none is outside the grid.
    #[cfg(test)]
    fn get(&self, voxel: [i32; 3]) -> bool {
        let inside = (0..3).all(|i| voxel[i] >= 0 && voxel[i] < self.dims[i]);
        inside && self.occupied(0, voxel)
    }

    /// The `count <= 32` voxels upwards of `[x, y, z]` along z, the first in bit 0; those outside the grid are not set.
    #[inline]
    pub(super) fn run_along_z(&self, [x, y, z]: [i32; 3], count: u32) -> u32 {
        let (Ok(ux), Ok(uy)) = (usize::try_from(x), usize::try_from(y)) else { return 0 };
        if x >= self.dims[0] || y >= self.dims[1] {
            return 0;
        }
        let Level { rows, column_words, .. } = self.levels[0];
        let start = (ux * rows + uy) * column_words;
        let column = &self.fine[start..start + column_words];
        let bits = WORD_BITS as i32;
        let first = z.div_euclid(bits);
        let shift = z.rem_euclid(bits);
        let word = |index: i32| usize::try_from(index).ok().and_then(|i| column.get(i)).copied().unwrap_or(0);
        let low = word(first) >> shift;
        let high = if shift == 0 { 0 } else { word(first + 1) << (bits - shift) };
        #[expect(clippy::cast_possible_truncation, reason = "masked to at most 32 bits")]
        let run = ((low | high) & ((1 << count) - 1)) as u32;
        run
    }

    /// Calls `visit` with the boxes (in voxels) of the lowest and highest occupied cell of each column of the finest level
    /// that has at most `most` cells: together they have the extent of all set voxels in every direction.
    pub(super) fn visit_outer_cells(&self, most: u64, mut visit: impl FnMut([i32; 3], [i32; 3])) {
        let cells = |level: usize| -> [i32; 3] {
            let shift = LEVEL_SHIFT * u32::try_from(level).unwrap_or(0);
            self.dims.map(|d| ((d - 1) >> shift) + 1)
        };
        let count = |level: usize| cells(level).iter().map(|&d| u64::from(d.unsigned_abs())).product::<u64>();
        let level = (0..self.top).find(|&l| count(l) <= most).unwrap_or(self.top);
        let edge = 1 << (LEVEL_SHIFT * u32::try_from(level).unwrap_or(0));
        let [nx, ny, nz] = cells(level);
        for x in 0..nx {
            for y in 0..ny {
                let mut visit = |z: i32| {
                    let cell = [x, y, z];
                    let lo = std::array::from_fn(|i| (cell[i] * edge).max(self.lo[i]));
                    let hi = std::array::from_fn(|i| ((cell[i] + 1) * edge).min(self.hi[i]));
                    visit(lo, hi);
                };
                let occupied = |z: &i32| self.occupied(level, [x, y, *z]);
                if let Some(lowest) = (0..nz).find(occupied) {
                    visit(lowest);
                    (lowest + 1..nz).rev().find(occupied).into_iter().for_each(visit);
                }
            }
        }
    }

    #[inline]
    #[expect(clippy::cast_sign_loss, reason = "cells inside the grid")]
    fn occupied(&self, level: usize, cell: [i32; 3]) -> bool {
        let [x, y, z] = cell.map(|c| c as usize);
        let Level { start, rows, column_words } = self.levels[level];
        let index = start + (x * rows + y) * column_words + z / WORD_BITS as usize;
        let word = if level == 0 { self.fine[index] } else { self.coarse[index] };
        word >> (z % WORD_BITS as usize) & 1 == 1
    }

    /// The first set voxel that the ray `origin + t * direction`, in voxels, enters for `0 <= t < limit`.
    pub(super) fn march(&self, origin: DVec3, direction: DVec3, limit: f64) -> Option<Hit> {
        // A ray along an axis is tilted by less than a millionth of a voxel, which keeps the reciprocals finite.
        let d = direction.to_array().map(|c| if c.abs() < 1e-12 { 1e-12_f64.copysign(c) } else { c });
        let o = origin.to_array();
        let inverse = d.map(|c| 1.0 / c);

        let (mut near, mut far, mut axis) = (f64::NEG_INFINITY, limit, 0);
        for i in 0..3 {
            let a = (f64::from(self.lo[i]) - o[i]) * inverse[i];
            let b = (f64::from(self.hi[i]) - o[i]) * inverse[i];
            if a.min(b) > near {
                near = a.min(b);
                axis = i;
            }
            far = far.min(a.max(b));
        }
        let mut t = near.max(0.0);
        if t.is_nan() || t >= far {
            return None;
        }
        let forward = d.map(|c| c > 0.0);
        let step = forward.map(|f| if f { 1 } else { -1 });
        // Where the ray leaves the slab of cells with this coordinate, along one axis.
        let exit =
            |i: usize, cell: i32, shift: u32| (f64::from((cell + i32::from(forward[i])) << shift) - o[i]) * inverse[i];

        // From here on `cell` counts cells of `level`, and `exits` are its far sides.
        let mut level = self.top;
        let mut shift = self.top_shift;
        let mut cell: [i32; 3] = std::array::from_fn(|i| {
            let entered = i == axis && near > 0.0;
            let edge = if forward[i] { self.lo[i] } else { self.hi[i] - 1 };
            (if entered { edge } else { voxel_at(o[i] + t * d[i], self.lo[i], self.hi[i] - 1) }) >> shift
        });
        let mut exits: [f64; 3] = std::array::from_fn(|i| exit(i, cell[i], shift));
        // The voxel beside the side through which the ray came, which rounding must not change.
        let mut entered = if forward[axis] { self.lo[axis] } else { self.hi[axis] - 1 };
        let mut came_in = near > 0.0;
        loop {
            while self.occupied(level, cell) {
                if level == 0 {
                    return Some(Hit { t, voxel: cell, axis });
                }
                level -= 1;
                shift -= LEVEL_SHIFT;
                for i in 0..3 {
                    let start = cell[i] << LEVEL_SHIFT << shift;
                    let last = (start + (1 << LEVEL_SHIFT << shift)).min(self.hi[i]) - 1;
                    let first = start.max(self.lo[i]);
                    let voxel = if came_in && i == axis { entered } else { voxel_at(o[i] + t * d[i], first, last) };
                    cell[i] = voxel >> shift;
                    exits[i] = exit(i, cell[i], shift);
                }
            }
            loop {
                axis = if exits[0] < exits[1] {
                    if exits[0] < exits[2] { 0 } else { 2 }
                } else if exits[1] < exits[2] {
                    1
                } else {
                    2
                };
                t = exits[axis];
                if t.is_nan() || t >= far {
                    return None;
                }
                let before = cell[axis];
                cell[axis] += step[axis];
                // Cells overlap the box of set voxels, so outside their range nothing is set.
                if cell[axis] < self.lo[axis] >> shift || cell[axis] > (self.hi[axis] - 1) >> shift {
                    return None;
                }
                exits[axis] = exit(axis, cell[axis], shift);
                // A coarser level has news only when the ray has left its cell too.
                let crossed = (before ^ cell[axis]) >> LEVEL_SHIFT != 0;
                if crossed && level < self.top && !self.occupied(level + 1, cell.map(|c| c >> LEVEL_SHIFT)) {
                    level += 1;
                    shift += LEVEL_SHIFT;
                    cell = cell.map(|c| c >> LEVEL_SHIFT);
                    exits = std::array::from_fn(|i| exit(i, cell[i], shift));
                } else if self.occupied(level, cell) {
                    break;
                }
            }
            came_in = true;
            let low_side = cell[axis] << shift;
            entered = if forward[axis] { low_side } else { low_side + (1 << shift) - 1 };
        }
    }
}

/// The voxel of a coordinate, kept within `first..=last`.
#[inline]
fn voxel_at(coordinate: f64, first: i32, last: i32) -> i32 {
    // Rounds towards 0 rather than down, which the clamp to voxels of the grid makes the same.
    #[expect(clippy::cast_possible_truncation, reason = "saturates, then clamped")]
    let voxel = coordinate as i32;
    voxel.max(first).min(last)
}

/// One bit for each cube of `4^3` bits of `words`.
fn coarsen(words: &[u64], level: Level, size: [usize; 3], coarse: [usize; 3]) -> Vec<u64> {
    const WIDTH: usize = 1 << LEVEL_SHIFT;
    let column_words = coarse[2].div_ceil(WORD_BITS as usize);
    let mut result = vec![0_u64; coarse[0] * coarse[1] * column_words];
    result.par_chunks_mut(coarse[1] * column_words).enumerate().for_each(|(cx, slab)| {
        for (cy, column) in slab.chunks_exact_mut(column_words).enumerate() {
            for x in cx * WIDTH..size[0].min((cx + 1) * WIDTH) {
                for y in cy * WIDTH..size[1].min((cy + 1) * WIDTH) {
                    let start = (x * level.rows + y) * level.column_words;
                    for (i, &word) in words[start..start + level.column_words].iter().enumerate() {
                        if word != 0 {
                            column[i / WIDTH] |= any_in_nibbles(word) << (i % WIDTH * 16);
                        }
                    }
                }
            }
        }
    });
    result
}

/// Bit `n` of the result tells whether any of bits `4 n .. 4 n + 4` is set.
fn any_in_nibbles(word: u64) -> u64 {
    let mut x = word | word >> 2;
    x = (x | x >> 1) & 0x1111_1111_1111_1111;
    x = (x | x >> 3) & 0x0303_0303_0303_0303;
    x = (x | x >> 6) & 0x000f_000f_000f_000f;
    x = (x | x >> 12) & 0x0000_00ff_0000_00ff;
    (x | x >> 24) & 0xffff
}

/// The lowest set voxel, and one past the highest, along each axis.
fn occupied_box(volume: &Volume) -> Option<([i32; 3], [i32; 3])> {
    if volume.is_pristine() {
        return None;
    }
    let [_, ny, _] = volume.grid().dims().map(|d| d as usize);
    let column_words = volume.column_words();
    let merge = |a: Option<([usize; 3], [usize; 3])>, b: Option<([usize; 3], [usize; 3])>| match (a, b) {
        (Some((alo, ahi)), Some((blo, bhi))) => {
            Some((std::array::from_fn(|i| alo[i].min(blo[i])), std::array::from_fn(|i| ahi[i].max(bhi[i]))))
        }
        (a, b) => a.or(b),
    };
    let (lo, hi) = volume
        .words()
        .par_chunks(ny * column_words)
        .enumerate()
        .map(|(x, slab)| {
            let mut found = None;
            for (y, column) in slab.chunks_exact(column_words).enumerate() {
                let Some(first) = column.iter().position(|&w| w != 0) else { continue };
                let last = column.iter().rposition(|&w| w != 0).unwrap_or(first);
                let bits = WORD_BITS as usize;
                let low = first * bits + column[first].trailing_zeros() as usize;
                let high = last * bits + bits - column[last].leading_zeros() as usize;
                found = merge(found, Some(([x, y, low], [x + 1, y + 1, high])));
            }
            found
        })
        .reduce(|| None, merge)?;
    let narrow = |v: [usize; 3]| v.map(|c| i32::try_from(c).unwrap_or(i32::MAX));
    Some((narrow(lo), narrow(hi)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use trixel::Grid;

    /// A small deterministic stream of numbers in [0, 1).
    fn random(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / (1_u64 << 24) as f64
        }
    }

    fn random_volume(dims: [u32; 3], voxels: u32, seed: u64) -> Volume {
        let mut volume = Volume::new(Grid::new([0.0; 3], [1.0; 3], dims).unwrap()).unwrap();
        let mut next = random(seed);
        for _ in 0..voxels {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below the dimensions")]
            volume.set(dims.map(|d| (next() * f64::from(d)) as u32));
        }
        volume
    }

    /// The first voxel by brute force: the slab test against every set voxel.
    fn nearest(volume: &Volume, o: DVec3, d: DVec3) -> Option<f64> {
        let enter = |voxel: [u32; 3]| {
            let lo = DVec3::from_array(voxel.map(f64::from));
            let (a, b) = ((lo - o) / d, (lo + 1.0 - o) / d);
            let (near, far) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
            (near < far).then_some(near)
        };
        volume.iter().filter_map(enter).min_by(f64::total_cmp)
    }

    #[test]
    fn marching_finds_what_brute_force_finds() {
        for (dims, voxels, seed) in [([70, 33, 130], 60, 1), ([1, 90, 64], 30, 2), ([5, 6, 7], 20, 3)] {
            let volume = random_volume(dims, voxels, seed);
            let pyramid = Pyramid::build(&volume).unwrap();
            let mut next = random(seed + 100);
            let mut hits = 0;
            for _ in 0..20_000 {
                let point = |next: &mut dyn FnMut() -> f64, spread: f64| {
                    DVec3::from_array(dims.map(|d| ((next() - 0.5) * spread + 0.5) * f64::from(d)))
                };
                let o = point(&mut next, 3.0);
                let d = (point(&mut next, 1.0) - o).normalize();
                let expected = nearest(&volume, o, d);
                let found = pyramid.march(o, d, f64::INFINITY);
                match (&expected, &found) {
                    (Some(t), Some(hit)) => {
                        assert!((t - hit.t).abs() < 1e-9, "{t} is not {}", hit.t);
                        assert!(pyramid.get(hit.voxel));
                        hits += 1;
                    }
                    (None, None) => {}
                    _ => panic!("brute force finds {expected:?}, marching {:?}", found.map(|h| h.t)),
                }
            }
            assert!(hits > 300, "only {hits} rays hit anything");
        }
    }

    #[test]
    fn rays_along_axes_and_through_edges_hit() {
        let volume = random_volume([9, 9, 9], 0, 1);
        assert!(Pyramid::build(&volume).is_none());
        let mut volume = volume;
        volume.set([4, 5, 6]);
        let pyramid = Pyramid::build(&volume).unwrap();
        let hit = pyramid.march(DVec3::new(-10.0, 5.5, 6.5), DVec3::X, f64::INFINITY).unwrap();
        assert_eq!((hit.t, hit.voxel, hit.axis), (14.0, [4, 5, 6], 0));
        let hit = pyramid.march(DVec3::new(4.5, 5.5, 20.0), DVec3::NEG_Z, f64::INFINITY).unwrap();
        assert_eq!((hit.t, hit.voxel, hit.axis), (13.0, [4, 5, 6], 2));
        assert!(pyramid.march(DVec3::new(4.5, 5.5, 20.0), DVec3::NEG_Z, 12.0).is_none());
        assert!(pyramid.march(DVec3::new(4.5, 5.5, 20.0), DVec3::Z, f64::INFINITY).is_none());
        // Nonsense ends.
        let _ = pyramid.march(DVec3::NAN, DVec3::Z, f64::INFINITY);
    }

    #[test]
    fn runs_along_z_agree_with_single_voxels() {
        let volume = random_volume([3, 4, 150], 900, 7);
        let pyramid = Pyramid::build(&volume).unwrap();
        for x in -1..4 {
            for y in -1..5 {
                for z in -9..160 {
                    let expected = (0..7).fold(0, |bits, i| bits | u32::from(pyramid.get([x, y, z + i])) << i);
                    assert_eq!(pyramid.run_along_z([x, y, z], 7), expected);
                }
            }
        }
    }

    #[test]
    fn the_occupied_box_is_tight() {
        let mut volume = random_volume([70, 40, 200], 0, 1);
        volume.set([3, 30, 65]);
        volume.set([60, 2, 190]);
        let pyramid = Pyramid::build(&volume).unwrap();
        assert_eq!(pyramid.occupied_box(), ([3, 2, 65], [61, 31, 191]));
        let mut cells = Vec::new();
        pyramid.visit_outer_cells(1, |lo, hi| cells.push((lo, hi)));
        assert!(
            cells.iter().any(|(lo, _)| lo[0] == 3) && cells.iter().any(|(_, hi)| *hi == [61, 31, 191]),
            "{cells:?}"
        );
    }
}
