//! How threads share a grid without ever writing the same word.
//!
//! One thread paints all of it. More paint a grid each, where those fit a cache, and put them together. Larger
//! grids are cut along x into slabs of whole columns: threads first take triangles as they come and sort them into slabs: tiny
//! ones are decided at once, and their voxels kept in an [`outbox`](super::outbox); the others are for every slab that they
//! meet. Then the slabs are painted, one a thread at a time: nobody waits for memory that another has changed, and what is
//! painted fits a cache. Slabs hold about the same work each, and there are several a thread to level the rest.

use super::kernel::VoxelBox;
use super::painter::Painter;
use super::sink::{Slab, prefix_xor};
use super::triangles::Selected;
use crate::lattice::LatticeMesh;
use crate::volume::Volume;

/// Memory that is kept between calls. Whoever else comes meanwhile finds none.
#[derive(Debug, Default)]
pub(super) struct Spare {
    #[cfg(feature = "threads")]
    kept: std::sync::Mutex<parallel::Kept>,
}

/// Clears the volume and sets the voxels of the painter's mode.
#[cfg_attr(not(feature = "threads"), expect(unused_variables, reason = "one thread needs no copies"))]
pub(super) fn voxelize(painter: &Painter, mesh: &LatticeMesh<'_>, volume: &mut Volume, spare: &Spare) {
    let dims = volume.grid().dims();
    #[cfg(feature = "threads")]
    {
        /// Below this many triangles' worth of work, waking threads costs more than it saves.
        const WORTH_THREADS: u64 = 2000;
        let threads = rayon::current_num_threads();
        // Outboxes have triangles as 32-bit numbers.
        let shared = dims[0] > 1 && u32::try_from(mesh.triangles.len()).is_ok();
        if threads > 1 && shared && parallel::weight_at_least(mesh, volume, WORTH_THREADS) {
            if parallel::copies_are_small(mesh, volume, threads) {
                parallel::voxelize_in_copies(painter, mesh, volume, threads, spare);
            } else {
                parallel::voxelize_in_slabs(painter, mesh, volume, threads, spare);
            }
            return;
        }
    }
    let (columns, column_words) = (dims[1] as usize, volume.column_words());
    volume.clear();
    let mut slab = Slab { words: volume.words_mut(), start: [0; 3], columns, column_words };
    let all = Selected::range(mesh, 0..mesh.triangles.len());
    painter.paint(&all, &clip_of(dims, 0..dims[0]), slab.reborrow());
    if painter.toggles() {
        prefix_xor(slab.words, column_words, dims[2]);
    }
}

/// The voxels with x in `x_range` (its end excluded).
fn clip_of(volume_dims: [u32; 3], x_range: std::ops::Range<u32>) -> VoxelBox {
    let [_, ny, nz] = volume_dims.map(i64::from);
    VoxelBox { low: [i64::from(x_range.start), 0, 0], high: [i64::from(x_range.end) - 1, ny - 1, nz - 1] }
}

#[cfg(feature = "threads")]
mod parallel {
    use std::ops::Range;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use rayon::prelude::*;

    use super::{LatticeMesh, Painter, Selected, Slab, Spare, VoxelBox, clip_of, prefix_xor};
    use crate::cpu::outbox::{Compartment, Cuts, Outbox};
    use crate::cpu::triangles::corners;
    use crate::volume::Volume;

    /// Slabs a thread.
    const SLABS: usize = 3;
    /// Pieces of the triangles a thread, within limits of triangles.
    const CHUNKS: usize = 32;
    const CHUNK: Range<usize> = 1 << 10..1 << 12;
    /// Pieces of the grid a thread, when copies are put together.
    const PIECES: usize = 8;
    /// Triangles that are looked at to cut the grid.
    const SAMPLES: usize = 1 << 11;

    #[derive(Debug, Default)]
    pub(super) struct Kept {
        /// Threads' copies of a grid, with no voxel set.
        copies: Vec<Vec<u64>>,
        /// Threads' outboxes.
        outboxes: Vec<Vec<Compartment>>,
    }

    impl Spare {
        fn lock(&self) -> std::sync::MutexGuard<'_, Kept> {
            // Nobody panics while holding it.
            self.kept.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
        }
    }

    /// The range of x that a triangle's box meets inside the grid, and the work that it stands for.
    #[inline(always)]
    fn x_range(corners: &[[i64; 3]; 3], nx: i64) -> Option<[usize; 2]> {
        let around = VoxelBox::around(corners);
        let (low, high) = (around.low[0].max(0), around.high[0].min(nx - 1));
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside the grid")]
        (low <= high).then_some([low as usize, high as usize])
    }

    /// The work in a triangle for each x that it meets: a share of its set-up, and its columns.
    #[inline(always)]
    fn weight_per_x(corners: &[[i64; 3]; 3], ny: i64) -> u64 {
        let around = VoxelBox::around(corners);
        let columns = around.high[1].min(ny - 1) - around.low[1].max(0) + 1;
        8 + u64::try_from(columns).unwrap_or(0)
    }

    pub(super) fn weight_at_least(mesh: &LatticeMesh<'_>, volume: &Volume, limit: u64) -> bool {
        let [nx, ny, _] = volume.grid().dims().map(i64::from);
        let mut total = 0;
        for &triangle in mesh.triangles {
            let corners = corners(mesh, triangle);
            if let Some([low, high]) = x_range(&corners, nx) {
                total += (high - low + 1) as u64 * weight_per_x(&corners, ny);
                if total >= 8 * limit {
                    return true;
                }
            }
        }
        // A large grid is worth it for the clearing and filling alone.
        volume.words().len() > 1 << 18
    }

    /// The triangles in pieces, for whoever comes first.
    struct Chunks {
        all: usize,
        size: usize,
        taken: AtomicUsize,
    }

    impl Chunks {
        fn new(all: usize, threads: usize) -> Self {
            Self { all, size: (all / (threads * CHUNKS)).clamp(CHUNK.start, CHUNK.end), taken: AtomicUsize::new(0) }
        }

        fn next(&self) -> Option<Range<usize>> {
            let start = self.taken.fetch_add(self.size, Ordering::Relaxed);
            (start < self.all).then(|| start..self.all.min(start + self.size))
        }

        fn all_taken(&self) -> bool {
            self.taken.load(Ordering::Relaxed) >= self.all
        }
    }

    /// Whether grids of their own for all threads cost less than sorting the triangles: measured, they do as long as they
    /// fit the cache that threads share, and are not large beside the mesh.
    pub(super) fn copies_are_small(mesh: &LatticeMesh<'_>, volume: &Volume, threads: usize) -> bool {
        /// 24 MiB, and so few in tests that some grids are larger.
        const MOST_WORDS: usize = if cfg!(test) { 1 << 16 } else { 3 << 20 };
        /// For each triangle.
        const WORDS: usize = 16;
        let words = volume.words().len().saturating_mul(threads);
        words <= MOST_WORDS && words / WORDS <= mesh.triangles.len()
    }

    /// Every thread paints into a grid of its own.
    pub(super) fn voxelize_in_copies(
        painter: &Painter,
        mesh: &LatticeMesh<'_>,
        volume: &mut Volume,
        threads: usize,
        spare: &Spare,
    ) {
        let dims = volume.grid().dims();
        let (columns, column_words) = (dims[1] as usize, volume.column_words());
        let clean = volume.is_pristine();
        let words = volume.words_mut();
        let length = words.len();
        let mut copies = std::mem::take(&mut spare.lock().copies);
        copies.resize_with(threads - 1, Vec::new);
        let chunks = Chunks::new(mesh.triangles.len(), threads);
        let grid = clip_of(dims, 0..dims[0]);
        let paint = |words: &mut [u64]| {
            let mut slab = Slab { words, start: [0; 3], columns, column_words };
            while let Some(range) = chunks.next() {
                painter.paint(&Selected::range(mesh, range), &grid, slab.reborrow());
            }
        };
        rayon::scope(|scope| {
            for copy in &mut copies {
                let (chunks, paint) = (&chunks, &paint);
                scope.spawn(move |_| {
                    // Whoever comes too late needs none.
                    if !chunks.all_taken() {
                        if copy.len() < length {
                            *copy = vec![0; length];
                        }
                        paint(&mut copy[..length]);
                    }
                });
            }
            if !clean {
                words.fill(0);
            }
            paint(words);
        });
        // Whole layers, as many as leave each thread several pieces.
        let piece = columns * column_words * (dims[0] as usize).div_ceil(threads * PIECES);
        let mut pieces: Vec<_> = words.chunks_mut(piece).map(|words| (words, Vec::new())).collect();
        for copy in copies.iter_mut().filter(|copy| !copy.is_empty()) {
            for ((_, parts), part) in pieces.iter_mut().zip(copy[..length].chunks_mut(piece)) {
                parts.push(part);
            }
        }
        pieces.into_par_iter().with_max_len(1).for_each(|(words, parts)| {
            for part in parts {
                move_voxels(part, words, painter.toggles());
            }
            if painter.toggles() {
                prefix_xor(words, column_words, dims[2]);
            }
        });
        spare.lock().copies = copies;
    }

    /// Moves the voxels or toggles of a copy, most of whose words have none.
    fn move_voxels(from: &mut [u64], to: &mut [u64], toggles: bool) {
        /// A cache line.
        const LINE: usize = 8;
        for (to, from) in to.chunks_mut(LINE).zip(from.chunks_mut(LINE)) {
            if from.iter().fold(0, |all, word| all | word) != 0 {
                for (to, from) in to.iter_mut().zip(&mut *from) {
                    *to = if toggles { *to ^ *from } else { *to | *from };
                }
                from.fill(0);
            }
        }
    }

    /// Every thread paints slabs.
    pub(super) fn voxelize_in_slabs(
        painter: &Painter,
        mesh: &LatticeMesh<'_>,
        volume: &mut Volume,
        threads: usize,
        spare: &Spare,
    ) {
        let dims = volume.grid().dims();
        let cuts = Cuts::new(cut(mesh, dims, threads * SLABS), dims[1] as usize, volume.column_words());
        let mut kept = std::mem::take(&mut spare.lock().outboxes);
        kept.resize_with(threads, Vec::new);
        let mut outboxes: Vec<_> = kept.into_iter().map(|kept| Outbox::new(&cuts, kept)).collect();
        let mut clean = volume.is_pristine();
        let words = volume.words_mut();
        let grid = clip_of(dims, 0..dims[0]);
        let chunks = Chunks::new(mesh.triangles.len(), threads);
        loop {
            outboxes.par_iter_mut().with_max_len(1).for_each(|outbox| {
                outbox.clear();
                while !outbox.is_full()
                    && let Some(range) = chunks.next()
                {
                    painter.sort(&Selected::range(mesh, range), &grid, outbox);
                }
            });
            let last = chunks.all_taken();
            cuts.slabs(words).into_par_iter().enumerate().with_max_len(1).for_each(|(i, mut slab)| {
                if !clean {
                    slab.words.fill(0);
                }
                let clip = clip_of(dims, cuts.x(i));
                for outbox in &outboxes {
                    painter.paint_sorted(mesh, outbox, i, &clip, &mut slab);
                }
                if last && painter.toggles() {
                    prefix_xor(slab.words, slab.column_words, dims[2]);
                }
            });
            if last {
                break;
            }
            clean = true;
        }
        spare.lock().outboxes = outboxes.into_iter().map(Outbox::into_compartments).collect();
    }

    /// Where to cut x so that each of up to `pieces` slabs holds about the same work; first 0, last nx.
    fn cut(mesh: &LatticeMesh<'_>, dims: [u32; 3], pieces: usize) -> Vec<u32> {
        let nx = dims[0] as usize;
        let [nx_signed, ny, _] = dims.map(i64::from);
        // Where the work is, is known well enough from some of the triangles.
        let every = (mesh.triangles.len() / SAMPLES).max(1);
        // Differences of the work at each x, so that a triangle costs two additions however long it is.
        let mut differences = vec![0i64; nx + 1];
        for &triangle in mesh.triangles.iter().step_by(every) {
            let corners = corners(mesh, triangle);
            if let Some([low, high]) = x_range(&corners, nx_signed) {
                #[expect(clippy::cast_possible_wrap, reason = "at most the grid's columns along y, and the triangles")]
                let weight = (weight_per_x(&corners, ny) * every as u64) as i64;
                differences[low] += weight;
                differences[high + 1] -= weight;
            }
        }
        // Empty layers still have to be cleared and filled.
        let per_layer = 1 + ny / 64;
        let mut at_x = 0;
        let mut before = Vec::with_capacity(nx + 1);
        let mut total = 0i64;
        before.push(0);
        for difference in &differences[..nx] {
            at_x += difference;
            total += at_x + per_layer;
            before.push(total);
        }
        let mut cuts = vec![0u32];
        for piece in 1..=pieces {
            let target = i128::from(total) * piece as i128 / pieces as i128;
            let x = before.partition_point(|&sum| i128::from(sum) < target);
            let x = u32::try_from(x).unwrap_or(dims[0]).min(dims[0]);
            if x > cuts[cuts.len() - 1] {
                cuts.push(x);
            }
        }
        if cuts[cuts.len() - 1] < dims[0] {
            cuts.push(dims[0]);
        }
        cuts
    }
}

#[cfg(all(test, feature = "threads"))]
mod tests {
    use crate::cpu::CpuBackend;
    use crate::lattice::LatticeMesh;
    use crate::{Backend, Grid, Job, Mode, Volume, scene};

    /// Outboxes fill up several times, and every grid is cut through tiny triangles; small grids are copied, into memory
    /// that was used for others.
    #[test]
    fn threads_paint_what_one_thread_does() {
        let backends = [1, 7].map(|threads| CpuBackend::with_threads(threads).unwrap());
        for (name, resolution) in
            [("sphere:48", 33), ("room", 70), ("sphere:48", 90), ("sphere:48", 40), ("sphere:48", 30)]
        {
            let mesh = scene::build(name).unwrap();
            let grid = Grid::fit(&mesh.bounds().unwrap(), resolution).unwrap();
            let lattice = LatticeMesh::snap(&mesh, &grid).unwrap();
            for mode in Mode::ALL {
                let [one, seven] = backends.each_ref().map(|backend| {
                    let mut volume = Volume::new(grid).unwrap();
                    // What was there before does not matter.
                    volume.words_mut().fill(u64::MAX);
                    backend.voxelize(&lattice, &Job::new(grid, mode), &mut volume).unwrap();
                    volume
                });
                assert!(one == seven, "{name}, {mode}, {resolution}");
            }
        }
    }
}
