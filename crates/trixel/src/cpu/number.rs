//! The integers that the kernel computes in, and floor divisions that follow a line without dividing again.

use std::ops::{Add, Mul, Neg, Sub};

use crate::lattice::STEP_BITS;

/// An integer wide enough for the triangles it is used on: `i64` up to [`SMALL_EXTENT`] voxels, `i128` above.
pub(crate) trait Int:
    Copy + Ord + From<i64> + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self>
{
    /// `floor(self / S)` with S the steps of a voxel.
    fn floor_voxels(self) -> Self;
}

/// The largest bounding box, in voxels along an axis less one, for which 64-bit arithmetic is exact.
///
/// With local coordinates of at most 2^22 steps, a normal's component is at most the area of the box in its projection,
/// 2^44. The plane's terms stay below 3 * 2^44 * 2^16 < 2^62, and the numerators of all divisions below
/// 3 * 2^44 * 67 < 2^52. Both sides of a division are then below 2^53, and an f64 division rounded down or up is the exact
/// floor or ceiling: a quotient a / b that is no integer is at least 1 / b away from one, more than half an ulp.
pub(crate) const SMALL_EXTENT: i64 = 63;

impl Int for i64 {
    #[inline(always)]
    fn floor_voxels(self) -> Self {
        self >> STEP_BITS
    }
}

impl Int for i128 {
    #[inline(always)]
    fn floor_voxels(self) -> Self {
        self >> STEP_BITS
    }
}

/// An index of a voxel from a quotient that may be far outside every grid.
#[inline(always)]
pub(super) fn saturate(quotient: i128) -> i64 {
    const LIMIT: i128 = 1 << 40;
    #[expect(clippy::cast_possible_truncation, reason = "limited to 41 bits")]
    {
        quotient.clamp(-LIMIT, LIMIT) as i64
    }
}

/// `floor(value / divisor)` and the remainder, for `divisor > 0`.
#[inline(always)]
pub(super) fn div_floor(value: i128, divisor: i128) -> (i128, i128) {
    (value.div_euclid(divisor), value.rem_euclid(divisor))
}

/// `floor((start + slope * i) / divisor)` for i = 0, 1, 2, ... with two divisions in all.
#[derive(Clone, Copy)]
pub(super) struct FloorLine {
    pub(super) quotient: i128,
    pub(super) remainder: i128,
    step_quotient: i128,
    step_remainder: i128,
    divisor: i128,
}

impl FloorLine {
    pub(super) fn new(start: i128, slope: i128, divisor: i128) -> Self {
        let (quotient, remainder) = div_floor(start, divisor);
        let (step_quotient, step_remainder) = div_floor(slope, divisor);
        Self { quotient, remainder, step_quotient, step_remainder, divisor }
    }

    /// Goes on to the next i.
    #[inline(always)]
    pub(super) fn advance(&mut self) {
        self.quotient += self.step_quotient;
        self.remainder += self.step_remainder;
        if self.remainder >= self.divisor {
            self.remainder -= self.divisor;
            self.quotient += 1;
        }
    }

    /// Goes to another start with the same slope and divisor.
    #[inline(always)]
    pub(super) fn restart(&mut self, start: i128) {
        (self.quotient, self.remainder) = div_floor(start, self.divisor);
    }
}
