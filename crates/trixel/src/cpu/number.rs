//! The integers that the kernel computes in, and floor divisions that follow a line without dividing again.

use std::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};

/// An integer wide enough for the triangles it is used on: `i64` up to [`SMALL_EXTENT`] voxels, `i128` above.
pub(super) trait Int:
    Copy
    + Ord
    + From<i64>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
{
    /// `floor(self / divisor)` and the remainder in `0..divisor`, for `divisor > 0`.
    fn div_floor(self, divisor: Self) -> (Self, Self);

    /// `floor(self / S)` with S the steps of a voxel.
    fn floor_voxels(self) -> Self;

    /// The value limited to what an index into a grid, and one step beyond, can be.
    fn saturate(self) -> i64;
}

/// The largest bounding box, in voxels along an axis, for which 64-bit arithmetic is exact.
///
/// With local coordinates of at most 2^22 steps, a normal's component is at most the area of the box in its projection,
/// 2^44. The plane's terms stay below 3 * 2^44 * 2^16 < 2^62, and the numerators of all divisions below
/// 3 * 2^44 * 67 < 2^52, so that an f64 division floors them exactly.
pub(super) const SMALL_EXTENT: i64 = 63;

impl Int for i64 {
    #[inline(always)]
    fn div_floor(self, divisor: Self) -> (Self, Self) {
        debug_assert!(divisor > 0 && self.abs() < 1 << 53 && divisor < 1 << 53);
        // Both are below 2^53, so the rounded quotient never crosses an integer: |a / b - n| >= 1 / b > ulp(a / b) / 2.
        // Truncated and corrected, because rounding down is a function call on baseline x86-64.
        #[expect(clippy::cast_precision_loss, clippy::cast_possible_truncation, reason = "exact below 2^53")]
        let truncated = (self as f64 / divisor as f64) as i64;
        let remainder = self - truncated * divisor;
        let below = remainder >> 63;
        (truncated + below, remainder + (below & divisor))
    }

    #[inline(always)]
    fn floor_voxels(self) -> Self {
        self >> crate::lattice::STEP_BITS
    }

    #[inline(always)]
    fn saturate(self) -> i64 {
        self
    }
}

impl Int for i128 {
    #[inline]
    fn div_floor(self, divisor: Self) -> (Self, Self) {
        (self.div_euclid(divisor), self.rem_euclid(divisor))
    }

    #[inline]
    fn floor_voxels(self) -> Self {
        self >> crate::lattice::STEP_BITS
    }

    #[inline]
    fn saturate(self) -> i64 {
        const LIMIT: i128 = 1 << 40;
        #[expect(clippy::cast_possible_truncation, reason = "limited to 41 bits")]
        {
            self.clamp(-LIMIT, LIMIT) as i64
        }
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
        self.quotient += self.step_quotient;
        self.remainder += self.step_remainder;
        if self.remainder >= self.divisor {
            self.remainder -= self.divisor;
            self.quotient += T::from(1);
        }
    }

    /// Goes to another start with the same slope and divisor.
    #[inline(always)]
    pub(super) fn restart(&mut self, start: T) {
        (self.quotient, self.remainder) = start.div_floor(self.divisor);
    }
}
