//! Large triangles: runs that follow lines, without a division a column.
//!
//! Every test of a mode is linear in the voxel's indices, so the voxels that a triangle sets in one column along z are
//! one run. Its ends are the tightest of the box, the plane's two bounds, and the edges of the two projections that
//! contain z, of which one depends on x alone and the other on y alone. This is [HCV] section 3.1 (optimization steps 1
//! to 5) with the loop over depth replaced by its closed form; cost follows columns, not voxels.

use fearless_simd::Level;

use super::kernel::VoxelBox;
use super::number::{FloorLine, Int, MEDIUM_EXTENT};
use super::rule::Rule;
use super::setup::{Constraint, Setup};
use super::sink::{Sink, turn};
use super::slanted::{COLUMNS, Ranges, Runs, Slanted};

/// One bound on b that follows a: `low` (b at least) or not (b at most).
#[derive(Clone, Copy)]
struct Bound<T> {
    line: FloorLine<T>,
    low: bool,
}

impl<T: Int> Constraint<T> {
    /// The same in other integers, which hold it.
    #[inline(always)]
    fn narrowed(from: Constraint<i128>) -> Self {
        Self { na: T::narrowed(from.na), nb: T::narrowed(from.nb), t: T::narrowed(from.t) }
    }

    /// The bound on b from a = `start` on; `None` when the constraint does not involve b.
    #[inline(always)]
    fn bound(self, start: i64) -> Option<Bound<T>> {
        let (zero, one) = (T::from(0), T::from(1));
        let at_start = self.t - self.na * T::from(start);
        if self.nb > zero {
            // b >= ceil((t - na a) / nb)
            Some(Bound { line: FloorLine::new(at_start + self.nb - one, -self.na, self.nb), low: true })
        } else if self.nb < zero {
            // b <= floor((na a - t) / -nb)
            Some(Bound { line: FloorLine::new(-at_start, self.na, -self.nb), low: false })
        } else {
            None
        }
    }
}

/// Up to five bounds on b for consecutive a.
struct Bounds<T> {
    bounds: [Option<Bound<T>>; 5],
    count: usize,
}

impl<T: Int> Bounds<T> {
    #[inline(always)]
    fn new() -> Self {
        Self { bounds: [None; 5], count: 0 }
    }

    #[inline(always)]
    fn push(&mut self, bound: Option<Bound<T>>) {
        if bound.is_some() {
            self.bounds[self.count] = bound;
            self.count += 1;
        }
    }

    /// The range of b at the current a, within `range`, and on to the next a.
    #[inline(always)]
    fn next(&mut self, [mut low, mut high]: [i64; 2]) -> [i64; 2] {
        for bound in self.bounds[..self.count].iter_mut().flatten() {
            let value = bound.line.quotient.saturate();
            if bound.low {
                low = low.max(value);
            } else {
                high = high.min(value);
            }
            bound.line.advance();
        }
        [low, high]
    }
}

/// Buffers that one thread keeps between triangles.
#[derive(Default)]
pub(super) struct Scratch {
    /// For each y of the triangle's box, the z range that the yz projection allows.
    z_by_y: Ranges,
    runs: Runs,
}

/// Sends the voxels of a triangle of any size inside `clip` to the sink.
///
/// Out of line: rare, and its 128-bit code would crowd the common paths.
#[inline(never)]
pub(super) fn voxelize<R: Rule>(
    level: Level,
    rule: &R,
    triangle: &[[i64; 3]; 3],
    clip: &VoxelBox,
    sink: &mut impl Sink,
    scratch: &mut Scratch,
) {
    let around = VoxelBox::around(triangle);
    let wanted = if R::SURFACE { around } else { VoxelBox::columns(triangle, clip) };
    let Some(mut clipped) = wanted.clipped(clip) else { return };
    let extent = around.extent();
    let (mut triangle, mut base) = (*triangle, around.low);
    // Rows along the longer side, so that there are few, where it pays: columns are farther apart along x than along y. Centres
    // on edges are told by x before y, which turning would change.
    let [along_x, along_y, _] = clipped.extent();
    let turned = R::SURFACE && along_x > 2 * along_y;
    if turned {
        for point in triangle.iter_mut().chain([&mut base, &mut clipped.low, &mut clipped.high]) {
            point.swap(0, 1);
        }
    }
    if extent[0].max(extent[1]).max(extent[2]) <= MEDIUM_EXTENT && rule.fits_small() {
        runs::<i64, _>(level, rule, &triangle, base, &clipped, turned, sink, scratch);
    } else {
        runs::<i128, _>(level, rule, &triangle, base, &clipped, turned, sink, scratch);
    }
}

/// [`voxelize`], following lines in integers that hold what is said at [`MEDIUM_EXTENT`]; x and y are exchanged if `turned`.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "a step of the kernel")]
fn runs<T: Int, R: Rule>(
    level: Level,
    rule: &R,
    triangle: &[[i64; 3]; 3],
    base: [i64; 3],
    clipped: &VoxelBox,
    turned: bool,
    sink: &mut impl Sink,
    scratch: &mut Scratch,
) {
    let setup = Setup::<i128>::new(triangle, base);
    if !R::SURFACE && setup.normal[2] == 0 {
        return;
    }
    let low: [i64; 3] = std::array::from_fn(|i| clipped.low[i] - base[i]);
    let high: [i64; 3] = std::array::from_fn(|i| clipped.high[i] - base[i]);
    let (zero, one) = (T::from(0), T::from(1));

    let [mut x_low, mut x_high] = [low[0], high[0]];
    let mut y_by_x = Bounds::new();
    let xy = setup.projection(rule, 0, 1).map(Constraint::<T>::narrowed);
    for constraint in xy {
        if !R::SURFACE && constraint.nb == zero {
            // An edge along y limits x alone. (On surfaces the box already implies it.)
            if constraint.na > zero {
                x_low = x_low.max(-(-constraint.t).div_floor(constraint.na).0.saturate());
            } else if constraint.na < zero {
                x_high = x_high.min((-constraint.t).div_floor(-constraint.na).0.saturate());
            }
        } else {
            y_by_x.push(constraint.bound(x_low));
        }
    }
    if !R::SURFACE && x_low > low[0] {
        // The bounds start at the first x that is left.
        y_by_x = Bounds::new();
        for constraint in xy {
            y_by_x.push(constraint.bound(x_low));
        }
    }
    if x_low > x_high {
        return;
    }

    let (up, d1, d2) = setup.plane(rule);
    let (up, d1, d2) = (up.map(T::narrowed), T::narrowed(d1), T::narrowed(d2));
    let slanted = up[2] > zero;
    if !slanted {
        // A plane along z limits x and y only: two more edges. Where it is also along y or x, the box implies it.
        y_by_x.push(Constraint { na: up[0], nb: up[1], t: d1 }.bound(x_low));
        y_by_x.push(Constraint { na: -up[0], nb: -up[1], t: -d2 }.bound(x_low));
    }

    let Scratch { z_by_y, runs } = scratch;
    let mut z_by_x = Bounds::new();
    let mut bounds = Bounds::new();
    if R::SURFACE {
        for constraint in setup.projection(rule, 1, 2) {
            bounds.push(Constraint::<T>::narrowed(constraint).bound(low[1]));
        }
        for constraint in setup.projection(rule, 0, 2) {
            z_by_x.push(Constraint::<T>::narrowed(constraint).bound(x_low));
        }
    }
    z_by_y.fill(to_index(high[1] - low[1]) + 1, std::iter::repeat_with(|| bounds.next([low[2], high[2]])));

    if !slanted {
        for x in x_low..=x_high {
            let [y_low, y_high] = y_by_x.next([low[1], high[1]]);
            let z = z_by_x.next([low[2], high[2]]);
            for y in y_low..=y_high {
                let [from, to] = z_by_y.within(to_index(y - low[1]), z);
                if from <= to {
                    let [x, y] = turn(turned, [x + base[0], y + base[1]]);
                    sink.run(x, y, from + base[2], to + base[2]);
                }
            }
        }
        return;
    }
    // z <= floor((d2 - N_x x - N_y y) / N_z).
    let mut at_row = d2 - up[0] * T::from(x_low);
    let mut slanted = Slanted::new(up, [d1, d2], [high[0], high[1]]);
    // The lower bound is `thickness` below it.
    let (thickness, thickness_rest) = (d2 - d1).div_floor(up[2]);
    let mut top = FloorLine::new(zero, -up[1], up[2]);
    for x in x_low..=x_high {
        let [y_low, y_high] = y_by_x.next([low[1], high[1]]);
        let z = z_by_x.next([low[2], high[2]]);
        if y_low <= y_high && z[0] <= z[1] {
            top.restart(at_row - up[1] * T::from(y_low));
            if let Some(slanted) = &mut slanted {
                slanted.start(&top);
                let mut first = y_low;
                while first <= y_high {
                    let columns = to_index(first - low[1])..to_index(y_high - low[1]) + 1;
                    let set = slanted.next(level, z_by_y, columns, z, R::TO_TOP, runs);
                    let [row_x, row_y] = turn(turned, [x + base[0], first + base[1]]);
                    sink.row([row_x, row_y, base[2]], turned, set, &runs.starts, &runs.ends);
                    first += COLUMNS as i64;
                }
            } else {
                for y in y_low..=y_high {
                    // ceil((d1 - L) / N) with d2 - L = q N + r and d2 - d1 = w N + s is q - w + (r > s).
                    let carry = if top.remainder > thickness_rest { one } else { zero };
                    let [y_from, y_to] = z_by_y.within(to_index(y - low[1]), z);
                    let from = (top.quotient - thickness + carry).saturate().max(y_from);
                    let to = if R::TO_TOP { z[1] } else { top.quotient.saturate().min(y_to) };
                    if from <= to {
                        let [x, y] = turn(turned, [x + base[0], y + base[1]]);
                        sink.run(x, y, from + base[2], to + base[2]);
                    }
                    top.advance();
                }
            }
        }
        at_row = at_row - up[0];
    }
}

/// An index or a count.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "of voxels, and not negative")]
fn to_index(i: i64) -> usize {
    i as usize
}
