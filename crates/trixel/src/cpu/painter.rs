//! A mode, bound to the instructions that it is computed with: paints triangles into a piece of the grid.

use fearless_simd::{Level, dispatch};

use super::kernel::{self, VoxelBox};
use super::rule::{Conservative, Sliced, Solid, SurfaceRule, Thin};
use super::sink::{SetRuns, Slab, ToggleRuns};
use super::triangles::Selected;
use crate::job::Job;
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
    pub(super) fn paint(&self, triangles: Selected<'_>, clip: &VoxelBox, slab: Slab<'_>) {
        match self.mode {
            Mode::Conservative => surface(self.level, &Conservative, triangles, clip, slab),
            Mode::Thin => surface(self.level, &Thin, triangles, clip, slab),
            Mode::Sliced => {
                let (rule, mut sink) = (Sliced { overlap: self.overlap }, SetRuns(slab));
                dispatch!(self.level, simd => kernel::sliced(simd, &rule, triangles, clip, &mut sink));
            }
            Mode::Solid => {
                let mut sink = ToggleRuns(slab);
                dispatch!(self.level, simd => kernel::solid(simd, &Solid, triangles, clip, &mut sink));
            }
        }
    }
}

fn surface<R: SurfaceRule>(level: Level, rule: &R, triangles: Selected<'_>, clip: &VoxelBox, slab: Slab<'_>) {
    let mut sink = SetRuns(slab);
    dispatch!(level, simd => kernel::surface(simd, rule, triangles, clip, &mut sink));
}
