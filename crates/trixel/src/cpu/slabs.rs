//! How threads share a grid without ever writing the same word.
//!
//! One thread paints all of a small grid. More paint a grid each, where those fit a cache, and put them together. Other
//! grids are cut along x into slabs of whole columns: threads first take triangles as they come and sort them into slabs: tiny
//! ones are decided at once, and their voxels kept in an [`outbox`](super::outbox); the others are for every slab that they
//! meet. Then the slabs are painted, one a thread at a time, the largest first: nobody waits for memory that another has
//! changed, and what is painted is near each other, so that one thread gains from it too.
//!
//! Each thread begins at a place of its own in the mesh, because triangles that follow each other are mostly near each
//! other, and helps the others when it is done.

#[cfg(feature = "threads")]
use super::crew::Crew;
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
#[cfg_attr(not(feature = "threads"), expect(unused_variables, reason = "one thread keeps nothing"))]
pub(super) fn voxelize(
    painter: &Painter,
    mesh: &LatticeMesh<'_>,
    volume: &mut Volume,
    spare: &Spare,
    #[cfg(feature = "threads")] crew: &Crew<'_>,
) {
    #[cfg(feature = "threads")]
    {
        let threads = crew.count();
        // Threads share triangles by 32-bit numbers.
        if let Ok(triangles) = u32::try_from(mesh.triangles.len())
            && volume.grid().dims()[0] > 1
            && parallel::pays(painter, mesh, volume, threads)
        {
            let parts = parallel::Parts::new(triangles, threads);
            if parallel::copies_are_small(painter, mesh, volume, threads) {
                parallel::voxelize_in_copies(painter, mesh, volume, &parts, spare, crew);
            } else {
                parallel::voxelize_in_slabs(painter, mesh, volume, &parts, spare, crew);
            }
            return;
        }
    }
    voxelize_at_once(painter, mesh, volume);
}

/// One thread, one triangle after the other.
fn voxelize_at_once(painter: &Painter, mesh: &LatticeMesh<'_>, volume: &mut Volume) {
    let dims = volume.grid().dims();
    let (columns, column_words) = (dims[1] as usize, volume.column_words());
    volume.clear();
    let mut slab = Slab { words: volume.words_mut(), start: [0; 3], columns, column_words };
    let all = Selected::range(mesh, 0..mesh.triangles.len());
    painter.paint(mesh, std::iter::once(all), &clip_of(dims, 0..dims[0]), slab.reborrow());
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
    use std::ops::{Range, RangeInclusive};
    use std::sync::atomic::{AtomicU64, Ordering};
    use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

    use super::{LatticeMesh, Painter, Selected, Slab, Spare, VoxelBox, clip_of, prefix_xor};
    use crate::cpu::crew::Crew;
    use crate::cpu::gate::Gate;
    use crate::cpu::outbox::{Compartment, Cuts, Outbox};
    use crate::cpu::triangles::{BLOCK, corners};
    use crate::volume::Volume;

    /// The smallest slab has this part of a thread's work.
    const SMALLEST: i64 = 16;
    /// The largest piece is this part of a thread's triangles, within limits of triangles.
    const PIECES: u64 = 64;
    const PIECE: RangeInclusive<u64> = 1 << 8..=1 << 11;
    /// No piece is more than this part of what is left of a thread's, so that all are done at about the same time.
    const LAST_PIECES: u64 = 16;
    /// But all except the last are whole blocks, so that no vector is half empty.
    const WHOLE: u64 = BLOCK as u64;
    /// Pieces of the grid a thread, when copies are put together.
    const PIECES_OF_GRID: usize = 8;
    /// Triangles that are looked at to cut the grid.
    const SAMPLES: usize = 1 << 11;

    #[derive(Debug, Default)]
    pub(super) struct Kept {
        /// Threads' copies of a grid, with no voxel set.
        copies: Vec<Vec<u64>>,
        /// Threads' outboxes.
        outboxes: Vec<Vec<Compartment>>,
    }

    /// Nobody panics while holding a lock.
    fn lock<T: ?Sized>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
        mutex.lock().unwrap_or_else(PoisonError::into_inner)
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

    fn weight_at_least(mesh: &LatticeMesh<'_>, volume: &Volume, limit: u64) -> bool {
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

    /// The triangles, in a part for each thread: it begins at the start of its own, and goes on at the ends of the others'.
    pub(super) struct Parts {
        /// What is left of each: the first in the lower half, the end in the upper.
        left: Vec<AtomicU64>,
        /// Triangles in a piece, at most.
        size: u64,
    }

    fn packed(start: u64, end: u64) -> u64 {
        end << 32 | start
    }

    impl Parts {
        pub(super) fn new(triangles: u32, threads: usize) -> Self {
            let (all, parts) = (u64::from(triangles), threads as u64);
            let left = (0..parts).map(|i| AtomicU64::new(packed(all * i / parts, all * (i + 1) / parts))).collect();
            Self { left, size: (all / (parts * PIECES)).clamp(*PIECE.start(), *PIECE.end()) }
        }

        /// The threads.
        fn count(&self) -> usize {
            self.left.len()
        }

        /// A piece for the `i`th thread.
        pub(super) fn next(&self, i: usize) -> Option<Range<usize>> {
            let parts = self.count();
            (0..parts).find_map(|other| self.take((i + other) % parts, other != 0))
        }

        /// [`Self::next`], until there are none.
        fn pieces<'a>(&self, mesh: &'a LatticeMesh<'a>, i: usize) -> impl Iterator<Item = Selected<'a>> {
            std::iter::from_fn(move || self.next(i)).map(|range| Selected::range(mesh, range))
        }

        #[expect(clippy::cast_possible_truncation, reason = "the halves")]
        fn take(&self, part: usize, from_end: bool) -> Option<Range<usize>> {
            let split = |left: u64| u64::from(left as u32)..left >> 32;
            let size_of = |left: u64| {
                let size = (left / LAST_PIECES).clamp(WHOLE, self.size);
                (size - size % WHOLE).min(left)
            };
            let left = self.left[part].fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| {
                let Range { start, end } = split(left);
                let size = size_of(end.saturating_sub(start));
                (size > 0).then(|| if from_end { packed(start, end - size) } else { packed(start + size, end) })
            });
            let Range { start, end } = split(left.ok()?);
            let size = size_of(end - start);
            let taken = if from_end { end - size..end } else { start..start + size };
            Some(taken.start as usize..taken.end as usize)
        }

        pub(super) fn all_taken(&self) -> bool {
            self.left.iter().all(|left| {
                let left = left.load(Ordering::Relaxed);
                left >> 32 == left & u64::from(u32::MAX)
            })
        }
    }

    /// What fits the cache that threads share: 32 MiB, and so little in tests that some grids are larger.
    const CACHE_WORDS: usize = if cfg!(test) { 1 << 16 } else { 4 << 20 };
    /// What stays in it beside a mesh and the work of others: 8 MiB.
    const STAYING_WORDS: usize = CACHE_WORDS / 4;
    /// Words for each triangle up to which a grid is small beside the mesh.
    const WORDS: usize = 16;

    /// Whether to do anything but voxelize at once.
    pub(super) fn pays(painter: &Painter, mesh: &LatticeMesh<'_>, volume: &Volume, threads: usize) -> bool {
        /// Below this many triangles' worth of work, waking threads costs more than it saves.
        const WORTH_THREADS: u64 = 2000;
        /// One thread paints slabs for the sake of the cache if there are some triangles in each. It pays most where
        /// painting is most of the work: for large triangles, and for parity.
        const WORTH_SLABS: usize = 1000;
        let (words, triangles) = (volume.words().len(), mesh.triangles.len());
        if threads == 1 {
            words > STAYING_WORDS && triangles >= WORTH_SLABS && (painter.toggles() || words / WORDS > triangles)
        } else {
            weight_at_least(mesh, volume, WORTH_THREADS)
        }
    }

    /// Whether grids of their own for all threads cost less than sorting the triangles: measured, they do as long as they
    /// about fit the cache, and are not large beside the mesh. Toggles are sorted more quickly.
    pub(super) fn copies_are_small(painter: &Painter, mesh: &LatticeMesh<'_>, volume: &Volume, threads: usize) -> bool {
        let words = volume.words().len().saturating_mul(threads);
        let most = if painter.toggles() { CACHE_WORDS / 2 } else { CACHE_WORDS };
        threads > 1 && words <= most && words / WORDS <= mesh.triangles.len()
    }

    /// Every thread paints a grid of its own: the first one the volume. Then pieces of it get what is in the others.
    pub(super) fn voxelize_in_copies(
        painter: &Painter,
        mesh: &LatticeMesh<'_>,
        volume: &mut Volume,
        parts: &Parts,
        spare: &Spare,
        crew: &Crew<'_>,
    ) {
        let (dims, threads) = (volume.grid().dims(), parts.count());
        let (columns, column_words) = (dims[1] as usize, volume.column_words());
        let clean = volume.is_pristine();
        let words = volume.words_mut();
        let length = words.len();
        // Whole layers, as many as leave each thread several pieces.
        let piece = columns * column_words * (dims[0] as usize).div_ceil(threads * PIECES_OF_GRID);
        let grid = clip_of(dims, 0..dims[0]);
        let paint = |i: usize, words: &mut [u64]| {
            let slab = Slab { words, start: [0; 3], columns, column_words };
            painter.paint(mesh, parts.pieces(mesh, i), &grid, slab);
        };
        let mut kept = std::mem::take(&mut lock(&spare.kept).copies);
        kept.resize_with(threads - 1, Vec::new);
        // Cut into pieces too.
        let copies: Vec<OnceLock<Vec<Mutex<&mut [u64]>>>> = kept.iter().map(|_| OnceLock::new()).collect();
        // For whoever comes first, once the first thread is done with the volume.
        let pieces = Mutex::new([].chunks_mut(piece).enumerate());
        let next = || lock(&pieces).next();
        let gate = Gate::new();
        let join = || {
            while let Some((i, words)) = next() {
                for copy in copies.iter().filter_map(OnceLock::get) {
                    painter.move_voxels(&mut lock(&copy[i]), words);
                }
                if painter.toggles() {
                    prefix_xor(words, column_words, dims[2]);
                }
            }
        };
        crew.scope(|scope| {
            for ((i, kept), copy) in (1..).zip(&mut kept).zip(&copies) {
                let (gate, join, paint) = (&gate, &join, &paint);
                scope.spawn(move |_| {
                    gate.pass(|| {
                        // Whoever comes too late needs none.
                        if !parts.all_taken() {
                            if kept.len() < length {
                                *kept = vec![0; length];
                            }
                            paint(i, &mut kept[..length]);
                            // Nobody else sets it.
                            let _ = copy.set(kept[..length].chunks_mut(piece).map(Mutex::new).collect());
                        }
                    });
                    join();
                });
            }
            if !clean {
                words.fill(0);
            }
            let mut words = Some(words);
            gate.pass(|| {
                if let Some(words) = words.take() {
                    paint(0, words);
                    *lock(&pieces) = words.chunks_mut(piece).enumerate();
                }
            });
            // If the others were quicker, all of it is in their copies.
            if let Some(words) = words {
                *lock(&pieces) = words.chunks_mut(piece).enumerate();
            }
            join();
        });
        lock(&spare.kept).copies = kept;
    }

    /// Every thread paints slabs.
    pub(super) fn voxelize_in_slabs(
        painter: &Painter,
        mesh: &LatticeMesh<'_>,
        volume: &mut Volume,
        parts: &Parts,
        spare: &Spare,
        crew: &Crew<'_>,
    ) {
        let dims = volume.grid().dims();
        let threads = parts.count();
        let cuts = Cuts::new(cut(mesh, dims, threads), dims[1] as usize, volume.column_words());
        let mut kept = std::mem::take(&mut lock(&spare.kept).outboxes);
        kept.resize_with(threads, Vec::new);
        let mut clean = volume.is_pristine();
        let words = volume.words_mut();
        let grid = clip_of(dims, 0..dims[0]);
        loop {
            let gate = Gate::new();
            let sorted: Vec<OnceLock<Outbox<'_>>> = kept.iter().map(|_| OnceLock::new()).collect();
            // For whoever comes first, one after the other: the largest are at the beginning.
            let slabs = Mutex::new(cuts.slabs(words).into_iter().enumerate());
            let next = || lock(&slabs).next();
            let share = |i: usize, kept: &mut Vec<Compartment>| {
                gate.pass(|| {
                    let mut outbox = Outbox::new(&cuts, std::mem::take(kept));
                    painter.sort(mesh, parts.pieces(mesh, i), &grid, &mut outbox);
                    // Nobody else sets it.
                    let _ = sorted[i].set(outbox);
                });
                let last = parts.all_taken();
                while let Some((i, mut slab)) = next() {
                    if !clean {
                        slab.words.fill(0);
                    }
                    let outboxes = sorted.iter().filter_map(OnceLock::get);
                    painter.paint_sorted(mesh, &outboxes, i, &clip_of(dims, cuts.x(i)), slab.reborrow());
                    if last && painter.toggles() {
                        prefix_xor(slab.words, slab.column_words, dims[2]);
                    }
                }
            };
            crew.scope(|scope| {
                let mut all = kept.iter_mut().enumerate();
                let mine = all.next();
                for (i, kept) in all {
                    let share = &share;
                    scope.spawn(move |_| share(i, kept));
                }
                if let Some((i, kept)) = mine {
                    share(i, kept);
                }
            });
            for (kept, sorted) in kept.iter_mut().zip(sorted) {
                if let Some(outbox) = sorted.into_inner() {
                    *kept = outbox.into_compartments();
                }
            }
            if parts.all_taken() {
                break;
            }
            clean = true;
        }
        lock(&spare.kept).outboxes = kept;
    }

    /// Where to cut x, into slabs that hold ever less work, so that threads are done at about the same time; first 0, last nx.
    fn cut(mesh: &LatticeMesh<'_>, dims: [u32; 3], threads: usize) -> Vec<u32> {
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
        let threads = i64::try_from(threads).unwrap_or(i64::MAX);
        let mut done = 0;
        while done < total {
            done += ((total - done) / threads.saturating_mul(2)).max(total / threads.saturating_mul(SMALLEST)).max(1);
            let x = before.partition_point(|&sum| sum < done);
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

#[cfg(feature = "threads")]
#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::triangles::BLOCK;
    use crate::cpu::{CpuBackend, Instructions};
    use crate::{Backend, Grid, Job, Mesh, Mode, scene};

    fn threads_give_what_one_does(name: &str, grid: Grid) {
        threads_give_what_one_does_of(&scene::build(name).unwrap(), name, grid);
    }

    fn threads_give_what_one_does_of(mesh: &Mesh, name: &str, grid: Grid) {
        let lattice = LatticeMesh::snap(mesh, &grid).unwrap();
        let backends = [1, 7].map(|threads| CpuBackend::with_threads(threads).unwrap());
        for mode in Mode::ALL {
            let job = Job::new(grid, mode);
            let mut expected = Volume::new(grid).unwrap();
            voxelize_at_once(&Painter::new(Instructions::Best.level(), &job), &lattice, &mut expected);
            // The second time in memory that was used before.
            for backend in backends.iter().chain(&backends) {
                let mut volume = Volume::new(grid).unwrap();
                // What was there before does not matter.
                volume.words_mut().fill(u64::MAX);
                backend.voxelize(&lattice, &job, &mut volume).unwrap();
                assert!(volume == expected, "{name}, {mode}, {:?}, {} threads", grid.dims(), backend.threads());
            }
        }
    }

    /// In whatever order threads come; and pieces are whole blocks, except one a thread.
    #[test]
    fn every_triangle_is_in_one_piece() {
        for (triangles, threads) in [(0, 2), (1, 3), (63, 1), (1000, 2), (100_000, 7), (1_000_003, 2)] {
            let parts = parallel::Parts::new(triangles, threads);
            let mut times = vec![0; triangles as usize];
            // Some come more often than others.
            let turns = (0..threads).chain(threads / 2..threads).cycle();
            let mut not_whole = 0;
            for piece in turns.map_while(|thread| parts.next(thread)) {
                not_whole += usize::from(piece.len() % BLOCK != 0);
                times[piece].iter_mut().for_each(|times| *times += 1);
            }
            assert!(not_whole <= threads, "{triangles}, {threads} threads");
            assert!(parts.all_taken() && times.iter().all(|&times| times == 1), "{triangles}, {threads} threads");
        }
    }

    /// Outboxes fill up several times, and every grid is cut through tiny triangles; small grids are copied.
    #[test]
    fn threads_paint_what_one_thread_does() {
        for (name, resolution) in [
            ("sphere:48", 33),
            ("room", 70),
            ("sphere:48", 90),
            ("sphere:48", 40),
            ("sphere:48", 30),
            ("sphere:8", 256),
        ] {
            let bounds = scene::build(name).unwrap().bounds().unwrap();
            threads_give_what_one_does(name, Grid::fit(&bounds, resolution).unwrap());
        }
    }

    /// Every triangle comes twice, mostly to different threads: no voxel is inside. The smaller grid is copied.
    #[test]
    fn what_two_threads_toggle_is_as_it_was() {
        let mut mesh = scene::build("sphere:48").unwrap();
        mesh.triangles.extend_from_within(..);
        let bounds = mesh.bounds().unwrap();
        for resolution in [33, 90] {
            let grid = Grid::fit(&bounds, resolution).unwrap();
            threads_give_what_one_does_of(&mesh, "two spheres", grid);
            let mut volume = Volume::new(grid).unwrap();
            let lattice = LatticeMesh::snap(&mesh, &grid).unwrap();
            CpuBackend::with_threads(7).unwrap().voxelize(&lattice, &Job::new(grid, Mode::Solid), &mut volume).unwrap();
            assert_eq!(volume.count(), 0, "{resolution}");
        }
    }

    /// From outside of any pool, from a pool's own threads, from another pool's, and all at once.
    #[test]
    fn whoever_calls_gets_the_same() {
        let mesh = scene::build("sphere:48").unwrap();
        for resolution in [33, 90] {
            let grid = Grid::fit(&mesh.bounds().unwrap(), resolution).unwrap();
            let lattice = LatticeMesh::snap(&mesh, &grid).unwrap();
            for mode in Mode::ALL {
                let job = Job::new(grid, mode);
                let mut expected = Volume::new(grid).unwrap();
                voxelize_at_once(&Painter::new(Instructions::Best.level(), &job), &lattice, &mut expected);
                let (backend, other) = (CpuBackend::with_threads(3).unwrap(), CpuBackend::with_threads(2).unwrap());
                let check = || {
                    let mut volume = Volume::new(grid).unwrap();
                    backend.voxelize(&lattice, &job, &mut volume).unwrap();
                    assert!(volume == expected, "{mode}, {resolution}");
                };
                std::thread::scope(|scope| {
                    for _ in 0..2 {
                        scope.spawn(check);
                        scope.spawn(|| backend.install(check));
                        scope.spawn(|| other.install(check));
                    }
                });
            }
        }
    }

    /// Cubes of voxels begin before the first column, by more than a layer has. All but the first are cut into slabs.
    #[test]
    fn threads_paint_grids_of_few_columns() {
        for dims in [[30, 1, 60], [300, 1, 9000], [300, 2, 9000], [300, 3, 9000], [2, 300, 2000]] {
            let name = "sphere:24";
            let bounds = scene::build(name).unwrap().bounds().unwrap();
            for voxels in [20.0, 90.0] {
                let size = (bounds.max[0] - bounds.min[0]) / voxels;
                // Through the middle, where the surface is steep, and at the side, where it is flat.
                for at in [0.5, 0.02] {
                    let origin = [bounds.min[0], bounds.min[1] + at * voxels * size, bounds.min[2]];
                    threads_give_what_one_does(name, Grid::new(origin, [size; 3], dims).unwrap());
                }
            }
        }
    }
}
