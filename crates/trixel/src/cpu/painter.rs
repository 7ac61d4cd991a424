//! A mode, bound to the instructions that it is computed with: paints triangles into a piece of the grid.

use fearless_simd::{Level, dispatch};

use super::kernel::{self, VoxelBox};
#[cfg(feature = "threads")]
use super::outbox::Outbox;
use super::rule::{Conservative, Sliced, Solid, SurfaceRule, Thin};
use super::sink::{CubeSink, SetRuns, Slab, ToggleRuns};
use super::triangles::Selected;
use crate::job::Job;
#[cfg(feature = "threads")]
use crate::lattice::LatticeMesh;
use crate::lattice::STEP_BITS;
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
    pub(super) fn paint(&self, triangles: &Selected<'_>, clip: &VoxelBox, slab: Slab<'_>) {
        match self.mode {
            Mode::Conservative => surface(self.level, &Conservative, triangles, clip, &mut SetRuns(slab)),
            Mode::Thin => surface(self.level, &Thin, triangles, clip, &mut SetRuns(slab)),
            Mode::Sliced => {
                let (rule, mut sink) = (Sliced { overlap: self.overlap }, SetRuns(slab));
                dispatch!(self.level, simd => kernel::centres(simd, &rule, triangles, clip, &mut sink));
            }
            Mode::Solid => {
                let mut sink = ToggleRuns(slab);
                dispatch!(self.level, simd => kernel::solid(simd, &Solid, triangles, clip, &mut sink));
            }
        }
    }

    /// Sorts the triangles, or what tiny ones set or toggle, into the slabs of an outbox.
    #[cfg(feature = "threads")]
    pub(super) fn sort(&self, triangles: &Selected<'_>, grid: &VoxelBox, outbox: &mut Outbox<'_>) {
        match self.mode {
            Mode::Conservative => surface(self.level, &Conservative, triangles, grid, outbox),
            Mode::Thin => surface(self.level, &Thin, triangles, grid, outbox),
            Mode::Sliced => {
                let rule = Sliced { overlap: self.overlap };
                dispatch!(self.level, simd => kernel::centres(simd, &rule, triangles, grid, outbox));
            }
            Mode::Solid => dispatch!(self.level, simd => kernel::solid(simd, &Solid, triangles, grid, outbox)),
        }
    }

    /// Paints what an outbox holds for a slab.
    #[cfg(feature = "threads")]
    pub(super) fn paint_sorted(
        &self,
        mesh: &LatticeMesh<'_>,
        outbox: &Outbox<'_>,
        slab: usize,
        clip: &VoxelBox,
        into: &mut Slab<'_>,
    ) {
        let triangles = Selected::listed(mesh, outbox.triangles(slab));
        if self.toggles() {
            outbox.toggle(slab, into);
            let mut sink = ToggleRuns(into.reborrow());
            dispatch!(self.level, simd => kernel::centres(simd, &Solid, &triangles, clip, &mut sink));
            return;
        }
        outbox.set(slab, into);
        let mut sink = SetRuns(into.reborrow());
        match self.mode {
            Mode::Conservative => not_tiny(self.level, &Conservative, &triangles, clip, &mut sink),
            Mode::Thin => not_tiny(self.level, &Thin, &triangles, clip, &mut sink),
            Mode::Sliced | Mode::Solid => {
                let rule = Sliced { overlap: self.overlap };
                dispatch!(self.level, simd => kernel::centres(simd, &rule, &triangles, clip, &mut sink));
            }
        }
    }
}

#[cfg(feature = "threads")]
fn not_tiny<R: SurfaceRule>(level: Level, rule: &R, triangles: &Selected<'_>, clip: &VoxelBox, sink: &mut SetRuns<'_>) {
    dispatch!(level, simd => kernel::surface_not_tiny(simd, rule, triangles, clip, sink));
}

fn surface<R: SurfaceRule>(
    level: Level,
    rule: &R,
    triangles: &Selected<'_>,
    clip: &VoxelBox,
    sink: &mut impl CubeSink,
) {
    dispatch!(level, simd => kernel::surface(simd, rule, triangles, clip, sink));
}
