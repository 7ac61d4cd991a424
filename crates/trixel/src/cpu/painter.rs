//! A mode, bound to the instructions that it is computed with: paints triangles into a piece of the grid.

#[cfg(feature = "threads")]
use fearless_simd::Simd;
use fearless_simd::{Level, dispatch};

use super::kernel::{self, VoxelBox};
#[cfg(feature = "threads")]
use super::outbox::{Outbox, STRIPS};
use super::rule::{Conservative, Sliced, Solid, SurfaceRule, Thin, VectorRule};
use super::sink::{CubeSink, SetRuns, Sink, Slab, ToggleRuns};
use super::triangles::Selected;
use crate::job::Job;
use crate::lattice::{LatticeMesh, STEP_BITS};
use crate::mode::Mode;

/// Paints triangles in one mode.
pub(super) struct Painter {
    level: Level,
    mode: Mode,
    /// The overlap of mode `sliced`, in lattice steps.
    overlap: i64,
}

impl Painter {
    pub(super) fn new(level: Level, job: &Job) -> Self {
        Self { level, mode: job.mode(), overlap: i64::from(job.overlap_steps()) }
    }

    /// Whether it leaves toggles, which the parity of each column turns into voxels.
    pub(super) fn toggles(&self) -> bool {
        self.mode == Mode::Solid
    }

    /// How many voxels along z beyond its box a triangle can set or toggle.
    pub(super) fn reach(&self) -> i64 {
        match self.mode {
            Mode::Conservative | Mode::Thin => 0,
            Mode::Solid | Mode::Sliced => 1 + (self.overlap >> STEP_BITS),
        }
    }

    /// Sets or toggles the voxels of the triangles inside `clip` in `slab`, which holds all of it.
    pub(super) fn paint<'a>(
        &self,
        mesh: &LatticeMesh<'_>,
        pieces: impl Iterator<Item = Selected<'a>>,
        clip: &VoxelBox,
        slab: Slab<'_>,
    ) {
        match self.mode {
            Mode::Conservative => surface(self.level, &Conservative, mesh, pieces, clip, &mut SetRuns::new(slab)),
            Mode::Thin => surface(self.level, &Thin, mesh, pieces, clip, &mut SetRuns::new(slab)),
            Mode::Sliced => {
                not_tiny(self.level, &Sliced { overlap: self.overlap }, mesh, pieces, clip, &mut SetRuns::new(slab));
            }
            Mode::Solid => {
                let mut sink = ToggleRuns(slab);
                dispatch!(self.level, simd => kernel::solid(simd, &Solid, mesh, pieces, clip, &mut sink));
            }
        }
    }

    /// Moves the voxels or toggles of a copy into the original.
    #[cfg(feature = "threads")]
    pub(super) fn move_voxels(&self, from: &mut [u64], to: &mut [u64]) {
        let toggles = self.toggles();
        dispatch!(self.level, simd => simd.vectorize(
            #[inline(always)]
            || {
                if toggles {
                    move_voxels(from, to, |to, from| to ^ from);
                } else {
                    move_voxels(from, to, |to, from| to | from);
                }
            }
        ));
    }

    /// Sorts the triangles, or what tiny ones set or toggle, into the slabs of an outbox, until it is full.
    #[cfg(feature = "threads")]
    pub(super) fn sort<'a>(
        &self,
        mesh: &LatticeMesh<'_>,
        pieces: impl Iterator<Item = Selected<'a>>,
        grid: &VoxelBox,
        outbox: &mut Outbox<'_>,
    ) {
        match self.mode {
            Mode::Conservative => surface(self.level, &Conservative, mesh, pieces, grid, outbox),
            Mode::Thin => surface(self.level, &Thin, mesh, pieces, grid, outbox),
            Mode::Sliced => {
                not_tiny(self.level, &Sliced { overlap: self.overlap }, mesh, pieces, grid, outbox);
            }
            Mode::Solid => dispatch!(self.level, simd => kernel::solid(simd, &Solid, mesh, pieces, grid, outbox)),
        }
    }

    /// Paints what outboxes hold for a slab.
    #[cfg(feature = "threads")]
    pub(super) fn paint_sorted<'a, 'b: 'a>(
        &self,
        mesh: &LatticeMesh<'_>,
        outboxes: &(impl Iterator<Item = &'a Outbox<'b>> + Clone),
        slab: usize,
        clip: &VoxelBox,
        mut into: Slab<'_>,
    ) {
        for outbox in outboxes.clone() {
            if self.toggles() {
                outbox.toggle(slab, &mut into);
            } else {
                outbox.set(slab, &mut into);
            }
        }
        // Strip by strip, so that what is painted is near each other.
        let strips = (0..STRIPS).flat_map(|strip| outboxes.clone().map(move |outbox| outbox.triangles(slab, strip)));
        let pieces = strips.map(|numbers| Selected::listed(mesh, numbers));
        match self.mode {
            Mode::Conservative => surface(self.level, &Conservative, mesh, pieces, clip, &mut SetRuns::new(into)),
            Mode::Thin => surface(self.level, &Thin, mesh, pieces, clip, &mut SetRuns::new(into)),
            Mode::Sliced => {
                not_tiny(self.level, &Sliced { overlap: self.overlap }, mesh, pieces, clip, &mut SetRuns::new(into));
            }
            Mode::Solid => not_tiny(self.level, &Solid, mesh, pieces, clip, &mut ToggleRuns(into)),
        }
    }
}

/// In blocks, because most of a copy has no voxels, and what has some is quicker moved without asking.
#[cfg(feature = "threads")]
#[inline(always)]
fn move_voxels(from: &mut [u64], to: &mut [u64], join: impl Fn(u64, u64) -> u64) {
    const BLOCK: usize = 64;
    for (to, from) in to.chunks_mut(BLOCK).zip(from.chunks_mut(BLOCK)) {
        if from.iter().fold(0, |all, word| all | word) != 0 {
            for (to, from) in to.iter_mut().zip(from) {
                *to = join(*to, std::mem::take(from));
            }
        }
    }
}

fn not_tiny<'a, R: VectorRule>(
    level: Level,
    rule: &R,
    mesh: &LatticeMesh<'_>,
    pieces: impl Iterator<Item = Selected<'a>>,
    clip: &VoxelBox,
    sink: &mut impl Sink,
) {
    dispatch!(level, simd => kernel::not_tiny(simd, rule, mesh, pieces, clip, sink));
}

fn surface<'a, R: SurfaceRule>(
    level: Level,
    rule: &R,
    mesh: &LatticeMesh<'_>,
    pieces: impl Iterator<Item = Selected<'a>>,
    clip: &VoxelBox,
    sink: &mut impl CubeSink,
) {
    dispatch!(level, simd => kernel::surface(simd, rule, mesh, pieces, clip, sink));
}

#[cfg(feature = "threads")]
#[cfg(test)]
mod tests {
    use super::*;
    use crate::Grid;
    use crate::cpu::instructions::Instructions;

    #[test]
    fn copies_are_moved() {
        let grid = Grid::new([0.0; 3], [1.0; 3], [1; 3]).unwrap();
        for mode in Mode::ALL {
            let painter = Painter::new(Instructions::Best.level(), &Job::new(grid, mode));
            let (mut from, mut to) = ([0; 1000], [0b0110; 1000]);
            from[70..].fill(0b0011);
            painter.move_voxels(&mut from, &mut to);
            // What both toggle is as it was.
            let both = if painter.toggles() { 0b0101 } else { 0b0111 };
            assert_eq!((to[..70].to_vec(), to[70..].to_vec()), (vec![0b0110; 70], vec![both; 930]), "{mode}");
            assert_eq!(from, [0; 1000], "{mode}");
        }
    }
}
