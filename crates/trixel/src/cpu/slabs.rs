//! The grid cut along x into slabs of whole columns, one task each, so that threads never write the same word.
//!
//! With one thread there is one slab and no sorting. With more, triangles are first sorted into the slabs that they
//! meet; slabs are cut so that each holds about the same work, and there are several a thread to level the rest.

use super::kernel::VoxelBox;
use super::painter::Painter;
use super::sink::{Slab, prefix_xor};
use super::triangles::Selected;
use crate::lattice::LatticeMesh;
use crate::volume::Volume;

/// Clears the volume and sets the voxels of the painter's mode.
pub(super) fn voxelize(painter: &Painter, mesh: &LatticeMesh<'_>, volume: &mut Volume) {
    let nz = volume.grid().dims()[2];
    for_each_slab(mesh, volume, |mut slab, clip, indices| {
        painter.paint(Selected { mesh, indices }, clip, slab.reborrow());
        if painter.toggles() {
            prefix_xor(slab.words, slab.column_words, nz);
        }
    });
}

/// The voxels with x in `x_range` (its end excluded).
fn clip_of(volume_dims: [u32; 3], x_range: std::ops::Range<u32>) -> VoxelBox {
    let [_, ny, nz] = volume_dims.map(i64::from);
    VoxelBox { low: [i64::from(x_range.start), 0, 0], high: [i64::from(x_range.end) - 1, ny - 1, nz - 1] }
}

#[cfg_attr(not(feature = "threads"), expect(unused_variables, reason = "only sorting looks at the mesh"))]
fn for_each_slab(
    mesh: &LatticeMesh<'_>,
    volume: &mut Volume,
    work: impl Fn(Slab<'_>, &VoxelBox, Option<&[u32]>) + Send + Sync,
) {
    #[cfg(feature = "threads")]
    {
        /// Below this many triangles' worth of work, sorting and waking threads costs more than it saves.
        const WORTH_THREADS: u64 = 2000;
        let threads = rayon::current_num_threads();
        // Sorted triangles are 32-bit indices.
        let sortable = volume.grid().dims()[0] > 1 && u32::try_from(mesh.triangles.len()).is_ok();
        if threads > 1 && sortable && parallel::weight_at_least(mesh, volume, WORTH_THREADS) {
            parallel::for_each_slab(mesh, volume, threads, work);
            return;
        }
    }
    let dims = volume.grid().dims();
    let (columns, column_words) = (dims[1] as usize, volume.column_words());
    volume.clear();
    let slab = Slab { words: volume.words_mut(), start: [0; 3], columns, column_words };
    work(slab, &clip_of(dims, 0..dims[0]), None);
}

#[cfg(feature = "threads")]
mod parallel {
    use rayon::prelude::*;

    use super::{LatticeMesh, Slab, VoxelBox, clip_of};
    use crate::cpu::triangles::corners;
    use crate::volume::Volume;

    /// Triangles sorted by one task.
    const CHUNK: usize = 1 << 14;
    /// Triangles that are looked at to cut the grid.
    const SAMPLES: usize = 1 << 13;

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

    pub(super) fn for_each_slab(
        mesh: &LatticeMesh<'_>,
        volume: &mut Volume,
        threads: usize,
        work: impl Fn(Slab<'_>, &VoxelBox, Option<&[u32]>) + Send + Sync,
    ) {
        let dims = volume.grid().dims();
        let cuts = cut(mesh, dims, threads * 8);
        let lists = sort(mesh, dims, &cuts);

        let (columns, column_words) = (dims[1] as usize, volume.column_words());
        let clean = volume.is_pristine();
        let mut rest = volume.words_mut();
        let mut slabs = Vec::with_capacity(lists.len());
        for (range, list) in cuts.windows(2).zip(lists) {
            let words = (range[1] - range[0]) as usize * columns * column_words;
            let (mine, others) = rest.split_at_mut(words);
            rest = others;
            slabs.push((mine, range[0]..range[1], list));
        }
        slabs.into_par_iter().with_max_len(1).for_each(|(words, range, list)| {
            if !clean {
                words.fill(0);
            }
            let clip = clip_of(dims, range.clone());
            let slab = Slab { words, start: [i64::from(range.start), 0, 0], columns, column_words };
            work(slab, &clip, Some(&list));
        });
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

    /// The indices of the triangles that meet each slab.
    fn sort(mesh: &LatticeMesh<'_>, dims: [u32; 3], cuts: &[u32]) -> Vec<Vec<u32>> {
        let slabs = cuts.len() - 1;
        let mut slab_of_x = vec![0u32; dims[0] as usize];
        for (slab, range) in (0u32..).zip(cuts.windows(2)) {
            slab_of_x[range[0] as usize..range[1] as usize].fill(slab);
        }
        let nx = i64::from(dims[0]);
        let sorted: Vec<Vec<Vec<u32>>> = mesh
            .triangles
            .par_chunks(CHUNK)
            .enumerate()
            .map(|(chunk, triangles)| {
                let mut lists = vec![Vec::new(); slabs];
                for (index, &triangle) in (chunk * CHUNK..).zip(triangles) {
                    if let Some([low, high]) = x_range(&corners(mesh, triangle), nx) {
                        for slab in slab_of_x[low]..=slab_of_x[high] {
                            #[expect(clippy::cast_possible_truncation, reason = "checked by the caller")]
                            lists[slab as usize].push(index as u32);
                        }
                    }
                }
                lists
            })
            .collect();
        (0..slabs)
            .into_par_iter()
            .map(|slab| {
                let length = sorted.iter().map(|lists| lists[slab].len()).sum();
                let mut list = Vec::with_capacity(length);
                for lists in &sorted {
                    list.extend_from_slice(&lists[slab]);
                }
                list
            })
            .collect()
    }
}
