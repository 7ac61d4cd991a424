//! Solids from the boundary voxels of slices: H.-H. Chang and Y.-C. Lai, *Real-time GPU-based Voxelization and Applications*,
//! 2011, section 2.3, as definitions that every backend repeats bit for bit.
//!
//! [`crate::Mode::Solid`] counts triangles and is exact. These two only look at the voxels of [`crate::Mode::Sliced`], as the
//! paper does, so two surfaces in one voxel, or one surface in two, turn inside out what lies above in the column. A column
//! with an odd number of boundary voxels is *questionable*, and is corrected from the eight columns around it:
//!
//! - [`Fill::Xor`]: each boundary voxel switches between outside and inside, from the first slice on; then, in up to
//!   [`XOR_PASSES`] passes, a questionable column next to good ones takes in every slice what most of these have. It is good
//!   from the next pass on.
//! - [`Fill::March`]: figure 3's ray, one along every column: the slices inside are added up to a thickness. A questionable
//!   column gets the mean of the thicknesses around it. The paper stops there; as voxels, it is filled so far from the mean
//!   of its neighbours' first boundary voxels on (of those that have any, else its own). Only the column itself and its
//!   neighbours are looked at, so that a renderer can do it on the fly.
//!
//! As in figure 3, the boundary voxel where a column enters is inside and the one where it leaves is not. A column without
//! boundary voxels is outside, though the figure has it questionable. A questionable column without good neighbours keeps its
//! boundary voxels alone: nothing else is known of it.

mod columns;
mod march;
mod xor;

use crate::volume::{Volume, VolumeError};

use columns::Columns;

/// How many passes correct questionable columns in [`Fill::Xor`]; what lies deeper in a hole stays empty.
pub const XOR_PASSES: u32 = 8;

/// How a solid is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Fill {
    /// [`crate::Mode::Solid`]'s own, exact: the triangles below a voxel's centre are counted.
    #[default]
    Parity,
    /// Boundary voxels switch, slice after slice; most neighbours correct.
    Xor,
    /// Each column is marched along; its neighbours' mean thickness corrects.
    March,
}

impl Fill {
    /// Every way.
    pub const ALL: [Self; 3] = [Self::Parity, Self::Xor, Self::March];

    /// The name on the command line and in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Parity => "parity",
            Self::Xor => "xor",
            Self::March => "march",
        }
    }
}

impl std::fmt::Display for Fill {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// What became of the columns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FillReport {
    /// Columns with an odd number of boundary voxels.
    pub questionable: u64,
    /// Of these, those without good neighbours, which keep their boundary voxels alone.
    pub uncorrected: u64,
}

/// Fills between the boundary voxels of [`crate::Mode::Sliced`], along z. With [`Fill::Parity`] nothing is corrected, so that
/// odd columns are inside up to the border of the grid: exact only where every crossing is a voxel of its own.
///
/// # Errors
/// When there is no memory for the result.
///
/// ```
/// use trixel::{Grid, Job, Mode, fill::{Fill, fill}};
/// let mesh = trixel::scene::build("sphere")?;
/// let grid = Grid::fit(&mesh.bounds().ok_or("no triangles")?, 64)?;
/// let boundary = trixel::voxelize(&mesh, &Job::new(grid, Mode::Sliced))?;
/// let (solid, report) = fill(&boundary, Fill::Xor)?;
/// assert!(solid.get([32, 32, 32]) && !solid.get([0, 0, 0]));
/// assert_eq!(report.uncorrected, 0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn fill(boundary: &Volume, fill: Fill) -> Result<(Volume, FillReport), VolumeError> {
    let mut filled = Volume::new(*boundary.grid())?;
    let columns = Columns::of(boundary);
    columns.switch(&mut filled, fill == Fill::Parity);
    let report = match fill {
        Fill::Parity => FillReport { questionable: columns.questionable(), uncorrected: columns.questionable() },
        Fill::Xor => xor::correct(&columns, &mut filled),
        Fill::March => march::correct(&columns, &mut filled),
    };
    Ok((filled, report))
}

/// How much of a solid a line along z passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Thickness {
    /// Slices inside, all together. [`crate::Frame::thickness`] tells how long each is in the world.
    pub slices: u32,
    /// Whether the number of boundary voxels was odd: then `slices` is the mean of the good columns among the eight around,
    /// or what was marched if there are none.
    pub questionable: bool,
}

/// \[CL\] figure 3: the thickness of every column of the boundary voxels of [`crate::Mode::Sliced`], y fastest, then x.
#[must_use]
pub fn thicknesses(boundary: &Volume) -> Vec<Thickness> {
    march::thicknesses(&Columns::of(boundary))
}

#[cfg(test)]
mod tests;
