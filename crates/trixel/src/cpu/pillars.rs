//! The grid cut into pillars of 64 x 64 columns, each made of tiles of 64 voxels along z: only tiles that a triangle may
//! meet are visited, and what is set in them becomes bricks.
//!
//! Binning follows J. Pantaleoni, *VoxelPipe*, HPG 2011, section 4 (sort pairs of tile and triangle, then one task a
//! tile), with exact tests of large triangles against the tiles so that time follows the surface.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use super::kernel::VoxelBox;
use super::painter::Painter;
use super::sink::{Slab, prefix_parity};
use super::triangles::{Selected, corners};
use crate::bricks::{BRICK_SIDE, Brick, BrickMap, PILLAR_SIDE, Pillar, PillarBuilder};
use crate::grid::Grid;
use crate::lattice::{LatticeMesh, STEP_BITS, STEPS_PER_VOXEL};

/// Voxels along the edge of a tile; one word along z.
const SIDE: usize = PILLAR_SIDE as usize;
const SIDE_SIGNED: i64 = PILLAR_SIDE as i64;
/// Bricks along the edge of a tile.
const BRICKS: usize = SIDE / BRICK_SIDE as usize;

/// A mesh whose triangles are sorted into the pillars that they may meet, made by
/// [`CpuBackend::bin`](crate::CpuBackend::bin).
pub struct BinnedMesh<'a> {
    painter: Painter,
    mesh: &'a LatticeMesh<'a>,
    grid: Grid,
    /// Pairs of pillar and triangle, ascending: the pillar's number in the upper half.
    pairs: Vec<u64>,
}

impl std::fmt::Debug for BinnedMesh<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("BinnedMesh").field("grid", &self.grid).field("pairs", &self.pairs.len()).finish_non_exhaustive()
    }
}

impl<'a> BinnedMesh<'a> {
    /// Sorts the triangles into the pillars with x in `layers`.
    pub(super) fn new(painter: Painter, mesh: &'a LatticeMesh<'a>, grid: Grid, layers: Range<u32>) -> Self {
        let [_, count_y] = BrickMap::pillars_of(&grid);
        let [nx, ny, nz] = grid.dims().map(i64::from);
        let reach = painter.reach();
        // Toggles of triangles below the grid still count.
        let lowest = if painter.toggles() { i64::MIN } else { -reach };
        let pairs_of = |chunk: usize, triangles: &[[u32; 3]]| {
            let mut pairs = Vec::new();
            for (index, &triangle) in (chunk * CHUNK..).zip(triangles) {
                let corners = corners(mesh, triangle);
                let around = VoxelBox::around(&corners);
                if around.low[2] >= nz + reach || around.high[2] < lowest {
                    continue;
                }
                let range = |axis: usize, n: i64, limit: Range<u32>| {
                    let [low, high] = [around.low[axis].max(0), around.high[axis].min(n - 1)];
                    let [low, high] = [low, high].map(|i| i.div_euclid(SIDE_SIGNED));
                    low.max(i64::from(limit.start))..(high + 1).min(i64::from(limit.end))
                };
                let (xs, ys) = (range(0, nx, layers.clone()), range(1, ny, 0..count_y));
                // Only where it pays.
                let large = (xs.end - xs.start).saturating_mul(ys.end - ys.start) > 4;
                for px in xs {
                    for py in ys.clone() {
                        if !large || Rect::of_pillar([px, py]).may_meet(&corners) {
                            #[expect(clippy::cast_sign_loss, reason = "both are inside the grid")]
                            let pillar = (px * i64::from(count_y) + py) as u64;
                            pairs.push(pillar << 32 | index as u64);
                        }
                    }
                }
            }
            pairs
        };
        Self { painter, mesh, grid, pairs: sorted_pairs(mesh.triangles, &pairs_of) }
    }

    /// Bytes that the sorting takes, the mesh aside.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.pairs.len() as u64 * 8
    }

    /// The voxels of the pillars with the given x and y, of which x must have been among the `layers` that were binned.
    #[must_use]
    pub fn voxelize(&self, px: Range<u32>, py: Range<u32>) -> BrickMap {
        let empty = BrickMap::empty(self.grid);
        self.voxelize_within(px, py, u64::MAX).unwrap_or(empty)
    }

    /// [`Self::voxelize`]; `None` if the bricks take more than `available` bytes.
    pub(super) fn voxelize_within(&self, px: Range<u32>, py: Range<u32>, available: u64) -> Option<BrickMap> {
        let [_, count_y] = BrickMap::pillars_of(&self.grid);
        let tasks: Vec<[u32; 2]> = px.clone().flat_map(|x| py.clone().map(move |y| [x, y])).collect();
        // Whatever the order, the sum passes the limit or does not.
        let taken = AtomicU64::new(0);
        let pillars = map_tasks(&tasks, Scratch::default, |scratch, &[x, y]| {
            let number = u64::from(x) * u64::from(count_y) + u64::from(y);
            let from = self.pairs.partition_point(|&pair| pair >> 32 < number);
            let length = self.pairs[from..].partition_point(|&pair| pair >> 32 == number);
            if taken.load(Ordering::Relaxed) > available {
                return Pillar::default();
            }
            let pillar = self.pillar([x, y].map(i64::from), &self.pairs[from..from + length], scratch);
            taken.fetch_add(pillar.bytes(), Ordering::Relaxed);
            pillar
        });
        (taken.into_inner() <= available).then(|| BrickMap::new(self.grid, [px, py], pillars))
    }

    fn pillar(&self, at: [i64; 2], pairs: &[u64], scratch: &mut Scratch) -> Pillar {
        let nz = self.grid.dims()[2];
        let tiles = i64::from(nz.div_ceil(PILLAR_SIDE));
        let Scratch { by_tile, indices, tile, builder } = scratch;
        let rect = Rect::of_pillar(at);
        by_tile.clear();
        for &pair in pairs {
            #[expect(clippy::cast_possible_truncation, reason = "the lower half")]
            let triangle = pair as u32;
            let corners = corners(self.mesh, self.mesh.triangles[triangle as usize]);
            let [low, high] = rect.z_range(&corners).map(|z| z.clamp(-(1 << 40), 1 << 40));
            let (mut low, mut high) = (low - self.painter.reach(), high + self.painter.reach());
            if self.painter.toggles() {
                (low, high) = (low.max(0), high.max(0));
            }
            let first = low.div_euclid(SIDE_SIGNED).max(0);
            for z in first..(high.div_euclid(SIDE_SIGNED) + 1).min(tiles) {
                #[expect(clippy::cast_sign_loss, reason = "inside the grid")]
                by_tile.push((z as u64) << 32 | u64::from(triangle));
            }
        }
        by_tile.sort_unstable();
        let dims = self.grid.dims().map(i64::from);
        let toggles = self.painter.toggles();
        let mut inside = Inside::default();
        // The first tile that is not done yet.
        let mut next = 0;
        for group in by_tile.chunk_by(|a, b| a >> 32 == b >> 32) {
            #[expect(clippy::cast_possible_truncation, reason = "the lower half")]
            {
                indices.clear();
                indices.extend(group.iter().map(|&pair| pair as u32));
            }
            // At most 512 tiles.
            let at_z = group.first().map_or(0, |&pair| u32::try_from(pair >> 32).unwrap_or(u32::MAX));
            if toggles {
                inside.fill(next..at_z, nz, builder);
                next = at_z + 1;
            }
            let start = [at[0] * SIDE_SIGNED, at[1] * SIDE_SIGNED, i64::from(at_z) * SIDE_SIGNED];
            let mut clip = VoxelBox {
                low: start,
                high: std::array::from_fn(|axis| (start[axis] + SIDE_SIGNED).min(dims[axis]) - 1),
            };
            if toggles && at_z > 0 {
                // Toggles are clipped to here from below, and then dropped: they were counted in the tile below.
                clip.low[2] -= 1;
            }
            let slab = Slab { words: tile.words.as_mut_slice(), start, columns: SIDE, column_words: 1 };
            let listed = Selected::listed(self.mesh, indices);
            self.painter.paint(self.mesh, std::iter::once(listed), &clip, slab);
            if toggles {
                inside.pass(tile, nz - at_z * PILLAR_SIDE);
            }
            tile.take_bricks(at_z, builder);
        }
        if toggles {
            inside.fill(next..nz.div_ceil(PILLAR_SIDE), nz, builder);
        }
        builder.finish()
    }
}

/// Triangles binned by one task.
const CHUNK: usize = 1 << 14;

fn sorted_pairs(triangles: &[[u32; 3]], pairs_of: &(impl Fn(usize, &[[u32; 3]]) -> Vec<u64> + Sync)) -> Vec<u64> {
    #[cfg(feature = "threads")]
    {
        use rayon::prelude::*;
        let chunks: Vec<Vec<u64>> =
            triangles.par_chunks(CHUNK).enumerate().map(|(i, chunk)| pairs_of(i, chunk)).collect();
        let mut pairs = chunks.concat();
        drop(chunks);
        pairs.par_sort_unstable();
        pairs
    }
    #[cfg(not(feature = "threads"))]
    {
        let mut pairs: Vec<u64> = triangles.chunks(CHUNK).enumerate().flat_map(|(i, c)| pairs_of(i, c)).collect();
        pairs.sort_unstable();
        pairs
    }
}

/// The result of each task, in order.
fn map_tasks<T: Sync, S, R: Send>(
    tasks: &[T],
    scratch: impl Fn() -> S + Sync + Send,
    work: impl Fn(&mut S, &T) -> R + Sync + Send,
) -> Vec<R> {
    #[cfg(feature = "threads")]
    {
        use rayon::prelude::*;
        tasks.par_iter().map_init(scratch, work).collect()
    }
    #[cfg(not(feature = "threads"))]
    {
        let mut scratch = scratch();
        tasks.iter().map(|task| work(&mut scratch, task)).collect()
    }
}

/// Buffers that one thread keeps between pillars.
#[derive(Default)]
struct Scratch {
    /// Pairs of tile and triangle.
    by_tile: Vec<u64>,
    indices: Vec<u32>,
    tile: Tile,
    builder: PillarBuilder,
}

/// 64 x 64 x 64 voxels, a word along z for each x and y, with y fastest.
struct Tile {
    words: Box<[u64; SIDE * SIDE]>,
}

impl Default for Tile {
    fn default() -> Self {
        Self { words: Box::new([0; SIDE * SIDE]) }
    }
}

impl Tile {
    /// Moves the voxels of the tile, the `at_z`th of its pillar, to the builder, and leaves it empty.
    fn take_bricks(&mut self, at_z: u32, builder: &mut PillarBuilder) {
        // At most 4096 bricks along z.
        let lowest = u16::try_from(at_z * PILLAR_SIDE / BRICK_SIDE).unwrap_or(u16::MAX);
        for (bx, layers) in self.words.chunks_exact_mut(BRICKS * SIDE).enumerate() {
            for by in 0..BRICKS {
                let mut bricks: [Brick; BRICKS] = [[0; BRICKS]; BRICKS];
                let mut any = 0;
                for (x, layer) in layers.chunks_exact_mut(SIDE).enumerate() {
                    let Some(rows) = layer.as_chunks_mut::<BRICKS>().0.get_mut(by) else { continue };
                    let set = rows.iter().fold(0, |set, word| set | word);
                    if set != 0 {
                        for (brick, word) in bricks.iter_mut().zip(transpose_bytes(rows)) {
                            brick[x] = word;
                        }
                        *rows = [0; BRICKS];
                        any |= set;
                    }
                }
                if any != 0 {
                    let bar = u8::try_from(bx * BRICKS + by).unwrap_or(u8::MAX);
                    for (height, brick) in (lowest..).zip(&bricks) {
                        builder.push(bar, height, brick);
                    }
                }
            }
        }
    }
}

/// A matrix of 8 x 8 bytes, transposed.
fn transpose_bytes(rows: &[u64; 8]) -> [u64; 8] {
    let mut m = *rows;
    for (distance, mask) in [(4, 0xffff_ffff_u64), (2, 0x0000_ffff_0000_ffff), (1, 0x00ff_00ff_00ff_00ff)] {
        for i in (0..8).filter(|i| i & distance == 0) {
            let shift = 8 * distance;
            let swap = ((m[i] >> shift) ^ m[i + distance]) & mask;
            m[i] ^= swap << shift;
            m[i + distance] ^= swap;
        }
    }
    m
}

/// Which columns of a pillar are inside the mesh where the tiles so far end: bit y of word x.
struct Inside([u64; SIDE]);

impl Default for Inside {
    fn default() -> Self {
        Self([0; SIDE])
    }
}

impl Inside {
    /// Turns a tile's toggles into parity, and goes on above it. The grid ends `height` voxels above the tile's bottom.
    fn pass(&mut self, tile: &mut Tile, height: u32) {
        let kept = u64::MAX >> PILLAR_SIDE.saturating_sub(height);
        for (inside, layer) in self.0.iter_mut().zip(tile.words.as_chunks_mut::<SIDE>().0) {
            let mut above = 0;
            for (y, word) in layer.iter_mut().enumerate() {
                let parity = prefix_parity(*word) ^ 0u64.wrapping_sub(*inside >> y & 1);
                above |= (parity >> 63) << y;
                *word = parity & kept;
            }
            *inside = above;
        }
    }

    /// Adds the voxels of tiles that no triangle meets.
    fn fill(&self, tiles: Range<u32>, nz: u32, builder: &mut PillarBuilder) {
        if tiles.is_empty() || self.0.iter().all(|&columns| columns == 0) {
            return;
        }
        // At most 4096 bricks; the last one of the grid may be cut.
        let bricks = |voxels: u32| u16::try_from(voxels / BRICK_SIDE).unwrap_or(u16::MAX);
        let end = (tiles.end * PILLAR_SIDE).min(nz);
        let whole = bricks(tiles.start * PILLAR_SIDE)..bricks(end);
        let cut = end % BRICK_SIDE;
        for (bar, (bx, by)) in (0u8..).zip((0..BRICKS).flat_map(|bx| (0..BRICKS).map(move |by| (bx, by)))) {
            let columns: Brick = std::array::from_fn(|x| spread_bits(self.0[bx * BRICKS + x] >> (BRICKS * by)));
            if columns == [u64::MAX; BRICKS] && !whole.is_empty() {
                builder.push_run(bar, [whole.start, whole.end - 1]);
            } else {
                whole.clone().for_each(|height| builder.push(bar, height, &columns));
            }
            if cut != 0 {
                let kept = 0x0101_0101_0101_0101 * ((1 << cut) - 1);
                builder.push(bar, whole.end, &columns.map(|word| word & kept));
            }
        }
    }
}

/// Byte i is 255 where bit i of the lowest eight is set.
fn spread_bits(bits: u64) -> u64 {
    (0..8).fold(0, |word, i| word | ((bits >> i & 1) * 0xff) << (8 * i))
}

/// The columns of a pillar and one voxel around them, in lattice steps.
struct Rect {
    low: [i64; 2],
    high: [i64; 2],
}

impl Rect {
    fn of_pillar(at: [i64; 2]) -> Self {
        let steps = |voxel: i64| voxel << STEP_BITS;
        Self { low: at.map(|i| steps(i * SIDE_SIGNED - 1)), high: at.map(|i| steps((i + 1) * SIDE_SIGNED + 1)) }
    }

    fn corners(&self) -> [[i64; 2]; 4] {
        let Self { low, high } = self;
        [[low[0], low[1]], [low[0], high[1]], [high[0], low[1]], [high[0], high[1]]]
    }

    /// Whether the triangle may meet the columns: `false` only if an edge of its projection separates them.
    fn may_meet(&self, triangle: &[[i64; 3]; 3]) -> bool {
        (0..3).all(|k| {
            let (v, w) = (triangle[k], triangle[(k + 1) % 3]);
            let [na, nb] = [w[1] - v[1], v[0] - w[0]].map(i128::from);
            let along = |x: i64, y: i64| na * i128::from(x) + nb * i128::from(y);
            let [a, b, c] = triangle.map(|corner| along(corner[0], corner[1]));
            let (least, most) = (a.min(b).min(c), a.max(b).max(c));
            let [d, e, f, g] = self.corners().map(|[x, y]| along(x, y));
            d.min(e).min(f).min(g) <= most && d.max(e).max(f).max(g) >= least
        })
    }

    /// Lowest and highest voxel that the triangle may meet in the columns: of its box, and for triangles that are larger
    /// than the pillar also of its plane.
    fn z_range(&self, triangle: &[[i64; 3]; 3]) -> [i64; 2] {
        /// Below this many voxels, f64 arithmetic is within 2^-8 of a voxel.
        const MOST: f64 = (1u64 << 40) as f64;
        let around = VoxelBox::around(triangle);
        let in_box = [around.low[2], around.high[2]];
        if (0..2).all(|axis| around.high[axis] - around.low[axis] < SIDE_SIGNED) {
            return in_box;
        }
        let [v, w, u] = triangle;
        let edge = |to: &[i64; 3]| [to[0] - v[0], to[1] - v[1], to[2] - v[2]].map(i128::from);
        let (e, f) = (edge(w), edge(u));
        #[expect(clippy::cast_precision_loss, reason = "within the margin")]
        let cross = |i: usize, j: usize| (e[i] * f[j] - e[j] * f[i]) as f64;
        let normal = [cross(1, 2), cross(2, 0), cross(0, 1)];
        let steps = f64::from(STEPS_PER_VOXEL);
        // The part of the rectangle around the triangle's box, as seen from v. Within a voxel all around, since a voxel
        // may be set by what passes beside its centre.
        #[expect(clippy::cast_precision_loss, reason = "below 2^53")]
        let side = |axis: usize| {
            let low = self.low[axis].max((around.low[axis] - 1) << STEP_BITS);
            let high = self.high[axis].min((around.high[axis] + 2) << STEP_BITS);
            [low, high].map(|at| (at - v[axis]) as f64 / steps)
        };
        let at = |i: usize, axis: usize| side(axis)[i] * normal[axis] / normal[2];
        let (xs, ys) = ([at(0, 0), at(1, 0)], [at(0, 1), at(1, 1)]);
        if ![xs, ys].as_flattened().iter().all(|term| term.abs() < MOST) {
            return in_box;
        }
        #[expect(clippy::cast_precision_loss, reason = "below 2^53")]
        let top = v[2] as f64 / steps;
        let (least, most) = (top - xs[0].max(xs[1]) - ys[0].max(ys[1]), top - xs[0].min(xs[1]) - ys[0].min(ys[1]));
        // One voxel each way for the voxels that touch, one for rounding.
        #[expect(clippy::cast_possible_truncation, reason = "below 2^42")]
        let (low, high) = (least.floor() as i64 - 2, most.floor() as i64 + 2);
        [in_box[0].max(low), in_box[1].min(high)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_transpose() {
        let row = |first: u8| u64::from_le_bytes([0, 1, 2, 3, 4, 5, 6, 7].map(|j| first + j));
        let rows = [0, 8, 16, 24, 32, 40, 48, 56].map(row);
        for (j, column) in (0u8..).zip(transpose_bytes(&rows)) {
            assert_eq!(column.to_le_bytes(), [0, 1, 2, 3, 4, 5, 6, 7].map(|i| 8 * i + j));
        }
    }
}
