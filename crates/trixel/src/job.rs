//! The validated description of a voxelization, built alike by every front end.

use crate::grid::Grid;
use crate::lattice::STEPS_PER_VOXEL;
use crate::mode::Mode;

/// What to voxelize into and how. The same for every backend.
///
/// ```
/// use trixel::{Grid, Job, Mode};
/// let job = Job::new(Grid::new([0.0; 3], [1.0; 3], [8, 8, 8])?, Mode::Sliced).with_overlap(0.25)?;
/// assert_eq!(job.overlap_steps(), 16384);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Job {
    grid: Grid,
    mode: Mode,
    overlap_steps: u32,
    strategy: Strategy,
}

/// The way to compute a voxelization. All of them give the same voxels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Strategy {
    /// Whatever the backend finds best.
    #[default]
    Auto,
    /// The CPU's: every triangle becomes one run of voxels per grid column that it meets.
    ColumnRuns,
    /// GPU: one invocation a triangle (\[HCV\] 3.1).
    TriangleParallel,
    /// GPU: one fragment a column of a triangle, made by the rasterizer (\[HCV\] 3.2).
    FragmentParallel,
    /// GPU: small triangles as in [`Self::TriangleParallel`], large ones left to [`Self::FragmentParallel`] within the
    /// same submission (\[HCV\] 3.3, figure 3.12).
    Hybrid,
    /// GPU: the triangles are sorted into small and large first (\[HCV\] figure 3.11).
    HybridTwoPass,
    /// GPU: one invocation a pair of triangle and column (\[HCV\] chapter 5).
    Balanced,
    /// GPU: triangles sorted by whether their boxes extend along one, two or three axes, each case by code of its own
    /// (Schwarz and Seidel 2010; \[HCV\]'s swizzle makes three cases of their nine).
    CaseSorted,
    /// GPU: pairs of tile and triangle, sorted; one workgroup a tile, which blends in its own memory (Pantaleoni's VoxelPipe,
    /// 2011).
    Tiled,
    /// GPU, [`Mode::Sliced`] alone: each triangle once for each slice that it may meet, all in one draw (\[CL\] 2.2).
    Sliced,
    /// GPU, [`Mode::Sliced`] alone: the whole mesh once for each slice (Llamas 2007).
    SlicePerPass,
}

impl Strategy {
    /// Every strategy.
    pub const ALL: [Self; 11] = [
        Self::Auto,
        Self::ColumnRuns,
        Self::TriangleParallel,
        Self::FragmentParallel,
        Self::Hybrid,
        Self::HybridTwoPass,
        Self::Balanced,
        Self::CaseSorted,
        Self::Tiled,
        Self::Sliced,
        Self::SlicePerPass,
    ];

    /// The name on the command line and in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::ColumnRuns => "column-runs",
            Self::TriangleParallel => "triangle-parallel",
            Self::FragmentParallel => "fragment-parallel",
            Self::Hybrid => "hybrid",
            Self::HybridTwoPass => "hybrid-two-pass",
            Self::Balanced => "balanced",
            Self::CaseSorted => "case-sorted",
            Self::Tiled => "tiled",
            Self::Sliced => "sliced",
            Self::SlicePerPass => "slice-per-pass",
        }
    }

    /// The modes that it can do.
    #[must_use]
    pub fn modes(self) -> &'static [Mode] {
        match self {
            Self::Sliced | Self::SlicePerPass => &[Mode::Sliced],
            _ => &Mode::ALL,
        }
    }
}

impl std::fmt::Display for Strategy {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// What is wrong with a job.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum JobError {
    /// An overlap was asked for in a mode that has none.
    #[error("an overlap only means something in mode `sliced`, not in `{0}`")]
    OverlapWithoutSlices(Mode),
    /// The overlap is out of range.
    #[error("an overlap of {0} voxels is out of range: it takes 0 to {max}", max = Job::MAX_OVERLAP)]
    Overlap(f64),
}

impl Job {
    /// The largest overlap, in voxels.
    pub const MAX_OVERLAP: u32 = 1024;

    /// A job with the backend's own choice of strategy.
    #[must_use]
    pub fn new(grid: Grid, mode: Mode) -> Self {
        Self { grid, mode, overlap_steps: 0, strategy: Strategy::Auto }
    }

    /// Extends every slice of [`Mode::Sliced`] by `voxels` on both sides, rounded to the lattice.
    ///
    /// # Errors
    /// When the mode is another and the overlap is not 0, or the overlap is not within 0 to [`Job::MAX_OVERLAP`].
    pub fn with_overlap(mut self, voxels: f64) -> Result<Self, JobError> {
        if !(0.0..=f64::from(Self::MAX_OVERLAP)).contains(&voxels) {
            return Err(JobError::Overlap(voxels));
        }
        if self.mode != Mode::Sliced && voxels != 0.0 {
            return Err(JobError::OverlapWithoutSlices(self.mode));
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked above")]
        {
            self.overlap_steps = (voxels * f64::from(STEPS_PER_VOXEL)).round_ties_even() as u32;
        }
        Ok(self)
    }

    /// Chooses a strategy.
    #[must_use]
    pub fn with_strategy(mut self, strategy: Strategy) -> Self {
        self.strategy = strategy;
        self
    }

    /// The grid.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The mode.
    #[must_use]
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// The slices' overlap, in lattice steps.
    #[must_use]
    pub fn overlap_steps(&self) -> u32 {
        self.overlap_steps
    }

    /// The strategy asked for.
    #[must_use]
    pub fn strategy(&self) -> Strategy {
        self.strategy
    }
}
