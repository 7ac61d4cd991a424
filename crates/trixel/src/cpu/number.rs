//! The integers that the kernel computes in, and floor divisions that follow a line without dividing again.

use std::ops::{Add, Mul, Neg, Sub};

use crate::lattice::STEP_BITS;

/// An integer wide enough for the triangles it is used on: `i64` up to [`SMALL_EXTENT`] voxels or, where only runs are
/// followed, [`MEDIUM_EXTENT`], `i128` above.
pub(crate) trait Int:
    Copy + Ord + From<i64> + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self>
{
    /// `floor(self / S)` with S the steps of a voxel.
    fn floor_voxels(self) -> Self;

    /// `floor(self / divisor)` and the remainder, for `divisor > 0`.
    fn div_floor(self, divisor: Self) -> (Self, Self);

    /// A number that the caller knows to fit.
    fn narrowed(from: i128) -> Self;

    /// An index of a voxel from a quotient that may be far outside every grid.
    fn saturate(self) -> i64;

    /// As a float, which holds it exactly up to 2^53.
    fn as_float(self) -> f64;
}

/// The largest bounding box, in voxels along an axis less one, for which 64-bit arithmetic is exact.
///
/// With local coordinates of at most 2^22 steps, a normal's component is at most the area of the box in its projection,
/// 2^44. The plane's terms stay below 3 * 2^44 * 2^16 < 2^62, and the numerators of all divisions below
/// 3 * 2^44 * 67 < 2^52. Both sides of a division are then below 2^53, and an f64 division rounded down or up is the exact
/// floor or ceiling: a quotient a / b that is no integer is at least 1 / b away from one, more than half an ulp.
pub(crate) const SMALL_EXTENT: i64 = 63;

/// The largest bounding box, in voxels along an axis less one, on which runs can follow lines in 64-bit arithmetic: with
/// local coordinates of at most 2^25 steps, and thus normals of 2^50, a plane's bounds on voxel indices stay below
/// 3 * 2^50 * 2^10. Finding them needs more.
pub(super) const MEDIUM_EXTENT: i64 = 511;

impl Int for i64 {
    #[inline(always)]
    fn floor_voxels(self) -> Self {
        self >> STEP_BITS
    }

    #[inline(always)]
    fn div_floor(self, divisor: Self) -> (Self, Self) {
        (self.div_euclid(divisor), self.rem_euclid(divisor))
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "the caller knows")]
    fn narrowed(from: i128) -> Self {
        debug_assert!(Self::try_from(from).is_ok_and(|number| number.abs() < 1 << 62), "{from} is too large");
        from as Self
    }

    #[inline(always)]
    fn saturate(self) -> i64 {
        self
    }

    #[inline(always)]
    #[expect(clippy::cast_precision_loss, reason = "documented")]
    fn as_float(self) -> f64 {
        self as f64
    }
}

impl Int for i128 {
    #[inline(always)]
    fn floor_voxels(self) -> Self {
        self >> STEP_BITS
    }

    #[inline(always)]
    fn div_floor(self, divisor: Self) -> (Self, Self) {
        (self.div_euclid(divisor), self.rem_euclid(divisor))
    }

    #[inline(always)]
    fn narrowed(from: i128) -> Self {
        from
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "limited to 41 bits")]
    fn saturate(self) -> i64 {
        const LIMIT: i128 = 1 << 40;
        self.clamp(-LIMIT, LIMIT) as i64
    }

    #[inline(always)]
    #[expect(clippy::cast_precision_loss, reason = "documented")]
    fn as_float(self) -> f64 {
        self as f64
    }
}

/// `floor((start + slope * i) / divisor)` for i = 0, 1, 2, ... with two divisions in all.
#[derive(Clone, Copy)]
pub(super) struct FloorLine<T> {
    pub(super) quotient: T,
    pub(super) remainder: T,
    step_quotient: T,
    step_remainder: T,
    divisor: T,
}

impl<T: Int> FloorLine<T> {
    #[inline(always)]
    pub(super) fn new(start: T, slope: T, divisor: T) -> Self {
        let (quotient, remainder) = start.div_floor(divisor);
        let (step_quotient, step_remainder) = slope.div_floor(divisor);
        Self { quotient, remainder, step_quotient, step_remainder, divisor }
    }

    /// Goes on to the next i.
    #[inline(always)]
    pub(super) fn advance(&mut self) {
        self.quotient = self.quotient + self.step_quotient;
        self.remainder = self.remainder + self.step_remainder;
        if self.remainder >= self.divisor {
            self.remainder = self.remainder - self.divisor;
            self.quotient = self.quotient + T::from(1);
        }
    }

    /// Goes to another start with the same slope and divisor.
    #[inline(always)]
    pub(super) fn restart(&mut self, start: T) {
        (self.quotient, self.remainder) = start.div_floor(self.divisor);
    }
}
