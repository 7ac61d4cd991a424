//! The runs of a large triangle in a plane that is not vertical: eight columns of a row at a time, one a vector lane.
//!
//! Along a row of columns the plane's upper bound is the floor of a line, which is followed without dividing: quotients and
//! remainders of eight columns are known, and those of the next eight are a constant further. All are integers below 2^53,
//! in f64, as more vector units compare and limit those.

use std::ops::Range;

use fearless_simd::{Level, Simd, dispatch, f64x8, i64x8, prelude::*};

use super::number::{FloorLine, Int};

/// Columns of a vector.
const LANES: usize = 8;

/// Columns of a row that are done together.
pub(super) const COLUMNS: usize = 64;

/// What is exact with room for sums of two.
const LIMIT: i64 = 1 << 51;

/// A quotient and its remainder.
#[derive(Clone, Copy)]
struct Division<T> {
    quotient: T,
    remainder: T,
}

/// Follows the bounds that a plane sets to z along rows of columns.
pub(super) struct Slanted {
    /// The divisor, N_z.
    divisor: f64,
    /// How much further the plane's upper bound is 0 to 7 columns on, and 8.
    ahead: Division<[f64; LANES]>,
    step: Division<f64>,
    /// How far the lower bound is below the upper one.
    thickness: Division<f64>,
    /// The upper bound in the next eight columns.
    top: Division<[f64; LANES]>,
}

/// For each y of a triangle's box, the z range that the yz projection allows; whole vectors of them.
#[derive(Default)]
pub(super) struct Ranges {
    pub(super) low: Vec<f64>,
    pub(super) high: Vec<f64>,
}

impl Ranges {
    /// Those of `count` columns, one after the other.
    pub(super) fn fill(&mut self, count: usize, ranges: impl Iterator<Item = [i64; 2]>) {
        let whole = count + LANES;
        self.low.clear();
        self.high.clear();
        for [low, high] in ranges.take(count) {
            self.low.push(low.as_float());
            self.high.push(high.as_float());
        }
        self.low.resize(whole, 0.0);
        self.high.resize(whole, 0.0);
    }

    /// The range of the `i`th column within `z`.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "whole numbers")]
    pub(super) fn within(&self, i: usize, z: [i64; 2]) -> [i64; 2] {
        [z[0].max(self.low[i] as i64), z[1].min(self.high[i] as i64)]
    }
}

/// The ends of the runs of some columns.
pub(super) struct Runs {
    pub(super) starts: [i64; COLUMNS],
    pub(super) ends: [i64; COLUMNS],
}

impl Default for Runs {
    fn default() -> Self {
        Self { starts: [0; COLUMNS], ends: [0; COLUMNS] }
    }
}

impl Slanted {
    /// For `d1 <= up . p <= d2` in the columns from 0 to `high`, where `up[2]` is above 0. `None` if numbers would be too large.
    #[inline(always)]
    pub(super) fn new<T: Int>(up: [T; 3], [d1, d2]: [T; 2], high: [i64; 2]) -> Option<Self> {
        let abs = |value: T| value.max(-value);
        let limit = T::from(LIMIT);
        // Some columns past the end are computed too, and not used.
        let columns = [high[0], high[1] + 2 * LANES as i64].map(T::from);
        let farthest = abs(d1) + abs(d2) + abs(up[0]) * columns[0] + abs(up[1]) * columns[1];
        if up[2] >= limit || farthest.div_floor(up[2]).0 >= limit {
            return None;
        }
        let mut ahead = Division { quotient: [0.0; LANES], remainder: [0.0; LANES] };
        let mut line = FloorLine::new(T::from(0), -up[1], up[2]);
        for lane in 0..LANES {
            (ahead.quotient[lane], ahead.remainder[lane]) = (line.quotient.as_float(), line.remainder.as_float());
            line.advance();
        }
        let division =
            |(quotient, remainder): (T, T)| Division { quotient: quotient.as_float(), remainder: remainder.as_float() };
        let step = division((line.quotient, line.remainder));
        let thickness = division((d2 - d1).div_floor(up[2]));
        Some(Self { divisor: up[2].as_float(), ahead, step, thickness, top: ahead })
    }

    /// Goes to the column in which the plane's upper bound is where `line` is.
    #[inline(always)]
    pub(super) fn start<T: Int>(&mut self, line: &FloorLine<T>) {
        let (quotient, remainder) = (line.quotient.as_float(), line.remainder.as_float());
        for lane in 0..LANES {
            let sum = remainder + self.ahead.remainder[lane];
            let carry = if sum >= self.divisor { 1.0 } else { 0.0 };
            self.top.quotient[lane] = quotient + self.ahead.quotient[lane] + carry;
            self.top.remainder[lane] = sum - carry * self.divisor;
        }
    }

    /// The runs of the next columns, of which the ranges of z are given, within `z` or, if `to_top`, from within it to its
    /// end. Gives the columns that have one.
    ///
    /// The instructions are picked here, so that large triangles' other code is not compiled for each set of them.
    pub(super) fn next(
        &mut self,
        level: Level,
        ranges: &Ranges,
        columns: Range<usize>,
        z: [i64; 2],
        to_top: bool,
        runs: &mut Runs,
    ) -> u64 {
        let z = z.map(Int::as_float);
        dispatch!(level, simd => self.vectors(simd, ranges, columns, z, to_top, runs))
    }

    #[inline(always)]
    fn vectors<V: Simd>(
        &mut self,
        simd: V,
        ranges: &Ranges,
        columns: Range<usize>,
        [low, high]: [f64; 2],
        to_top: bool,
        runs: &mut Runs,
    ) -> u64 {
        let (zero, one) = (f64x8::splat(simd, 0.0), f64x8::splat(simd, 1.0));
        let (low, high) = (f64x8::splat(simd, low), f64x8::splat(simd, high));
        let divisor = f64x8::splat(simd, self.divisor);
        let thickness_rest = f64x8::splat(simd, self.thickness.remainder);
        let count = columns.len().min(COLUMNS);
        let mut set = 0;
        let mut quotient = f64x8::from_slice(simd, &self.top.quotient);
        let mut remainder = f64x8::from_slice(simd, &self.top.remainder);
        for first in (0..count).step_by(LANES) {
            let at = columns.start + first;
            // ceil((d1 - L) / N) with d2 - L = q N + r and d2 - d1 = w N + s is q - w + (r > s).
            let carry = remainder.simd_gt(thickness_rest).select(one, zero);
            let from = (quotient - self.thickness.quotient + carry)
                .max(f64x8::from_slice(simd, &ranges.low[at..at + LANES]))
                .max(low);
            let to = quotient.min(f64x8::from_slice(simd, &ranges.high[at..at + LANES])).min(high);
            let to = if to_top { high } else { to };
            set |= from.simd_le(to).to_bitmask() << first;
            from.to_int::<i64x8<V>>().store_slice(&mut runs.starts[first..first + LANES]);
            to.to_int::<i64x8<V>>().store_slice(&mut runs.ends[first..first + LANES]);

            let sum = remainder + self.step.remainder;
            let carry = sum.simd_ge(divisor);
            quotient += carry.select(one, zero) + self.step.quotient;
            remainder = carry.select(sum - divisor, sum);
        }
        quotient.store_slice(&mut self.top.quotient);
        remainder.store_slice(&mut self.top.remainder);
        set & (u64::MAX >> (COLUMNS - count))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conformance::random::Random;

    /// The runs of every row of planes of all slopes and sizes are those that the definition's divisions give.
    #[test]
    fn runs_are_between_the_planes_bounds() {
        let mut random = Random::new(7);
        let (mut followed, mut too_large) = (0, 0);
        for round in 0..3000 {
            // Normals as large as boxes of up to 1024 voxels give, or with a component that is very small.
            let bits = random.range(1, 52);
            let mut component = |least: i64| {
                let bits = if random.range(0, 2) == 0 { random.range(1, bits) } else { bits };
                random.range(least, 1 << bits)
            };
            let (x, y, z) = (component(0), component(0), component(1));
            let mut sign = |value: i64| if random.range(0, 1) == 0 { value } else { -value };
            let up = [sign(x), sign(y), z].map(i128::from);
            let high = [random.range(0, 900), random.range(0, 900)];
            let through = [high[0], high[1], 900].map(|most| i128::from(random.range(0, most)));
            let d1 = up[0] * through[0] + up[1] * through[1] + up[2] * through[2];
            let d2 = d1 + (up[0].abs() + up[1].abs() + up[2]) * i128::from(random.range(0, 64)) / 32;
            let Some(mut slanted) = Slanted::new(up, [d1, d2], high) else {
                too_large += 1;
                continue;
            };
            followed += 1;

            let mut ranges = Ranges::default();
            let any: Vec<[i64; 2]> = (0..=high[1]).map(|_| [random.range(-5, 200), random.range(500, 1000)]).collect();
            ranges.fill(any.len(), any.iter().copied());
            let z = [random.range(0, 100), random.range(600, 900)];
            let mut runs = Runs::default();
            for x in [0, high[0] / 2, high[0]] {
                let first = random.range(0, high[1]);
                let at_first = d2 - up[0] * i128::from(x) - up[1] * i128::from(first);
                slanted.start(&FloorLine::new(at_first, -up[1], up[2]));
                for start in (first..=high[1]).step_by(COLUMNS) {
                    let columns = usize::try_from(start).unwrap()..any.len();
                    let to_top = round % 3 == 0;
                    let set = slanted.next(Level::new(), &ranges, columns, z, to_top, &mut runs);
                    for (i, y) in (0..COLUMNS).zip(start..) {
                        let at = up[0] * i128::from(x) + up[1] * i128::from(y);
                        let range = any.get(usize::try_from(y).unwrap());
                        let expected = range.and_then(|&[low, high]| {
                            let from = (-(at - d1).div_euclid(up[2])).max(i128::from(low.max(z[0])));
                            let to = (d2 - at).div_euclid(up[2]).min(i128::from(high.min(z[1])));
                            let to = if to_top { i128::from(z[1]) } else { to };
                            (from <= to).then_some([from, to])
                        });
                        let found = (set >> i & 1 != 0).then(|| [runs.starts[i], runs.ends[i]].map(i128::from));
                        assert_eq!(found, expected, "round {round}: {up:?}, {d1} to {d2}, column ({x}, {y})");
                    }
                }
            }
        }
        assert!(followed > 1000 && too_large > 20, "{followed} planes followed, {too_large} too large");
    }
}
