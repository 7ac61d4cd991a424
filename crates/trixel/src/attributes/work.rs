//! The work cut along x into slabs of about equally many set voxels, each with the triangles that reach it: tasks that
//! share nothing, so that threads cannot change a result.

use crate::lattice::{LatticeMesh, STEP_BITS};
use crate::rank::Rank;

/// Most slabs: enough to keep many threads busy and the sums of one slab small.
const SLABS: u64 = 128;
/// Voxels below which a slab is not worth its triangles' second visits.
const LEAST_VOXELS: u64 = 1 << 12;

/// Slabs and their triangles.
pub(super) struct Work {
    /// Where slabs begin, and where the last one ends.
    cuts: Vec<u32>,
    /// Where each slab's triangles begin in `triangles`.
    starts: Vec<usize>,
    triangles: Vec<u32>,
}

/// Voxels with x in a range, and the triangles that reach them, ascending.
pub(super) struct Slab<'a> {
    pub(super) x: std::ops::Range<u32>,
    pub(super) triangles: &'a [u32],
}

impl Work {
    /// For triangles that reach `grow` steps beyond themselves along x. There must be fewer than 2^32 of them.
    pub(super) fn new(mesh: &LatticeMesh<'_>, rank: &Rank<'_>, grow: i64) -> Self {
        let nx = rank.volume().grid().dims()[0];
        let cuts = cut(rank, nx);
        let slabs = cuts.len() - 1;
        let slab_of = |x: i64| cuts.partition_point(|&start| i64::from(start) <= x).saturating_sub(1).min(slabs - 1);
        let reached = |index: usize| {
            let xs = mesh.corners(index).map(|corner| corner[0]);
            let low = (xs[0].min(xs[1]).min(xs[2]) - grow - 1) >> STEP_BITS;
            let high = (xs[0].max(xs[1]).max(xs[2]) + grow) >> STEP_BITS;
            if high < 0 || low >= i64::from(nx) { 0..0 } else { slab_of(low.max(0))..slab_of(high) + 1 }
        };
        // Counted first, so that the lists lie in one piece.
        let mut starts = vec![0usize; slabs + 1];
        for index in 0..mesh.triangles.len() {
            for slab in reached(index) {
                starts[slab + 1] += 1;
            }
        }
        for slab in 0..slabs {
            starts[slab + 1] += starts[slab];
        }
        let mut next = starts.clone();
        let mut triangles = vec![0; starts[slabs]];
        for (index, triangle) in (0..mesh.triangles.len()).zip(0u32..) {
            for slab in reached(index) {
                triangles[next[slab]] = triangle;
                next[slab] += 1;
            }
        }
        Self { cuts, starts, triangles }
    }

    pub(super) fn count(&self) -> usize {
        self.cuts.len() - 1
    }

    /// Slab `index`, which must be below the count.
    pub(super) fn slab(&self, index: usize) -> Slab<'_> {
        Slab {
            x: self.cuts[index]..self.cuts[index + 1],
            triangles: &self.triangles[self.starts[index]..self.starts[index + 1]],
        }
    }
}

/// Where to cut x; first 0, last `nx`.
fn cut(rank: &Rank<'_>, nx: u32) -> Vec<u32> {
    let slabs = (rank.count() / LEAST_VOXELS).clamp(1, SLABS);
    let mut cuts = vec![0];
    for x in 1..nx {
        // At least one layer each, and a cut where the next share is full.
        let share = u128::from(rank.before_column(x, 0)) * u128::from(slabs);
        if share >= u128::from(rank.count()) * cuts.len() as u128 && rank.count() > 0 {
            cuts.push(x);
        }
    }
    cuts.push(nx);
    cuts
}
