//! The kernel: one run of voxels per (triangle, grid column).
//!
//! Every test of a mode is linear in the voxel's indices, so the voxels that a triangle sets in one column along z are
//! one run. Its ends are the tightest of the box, the plane's two bounds, and the edges of the two projections that
//! contain z, of which one depends on x alone and the other on y alone. This is [HCV] section 3.1 (optimization steps 1
//! to 5) with the loop over depth replaced by its closed form; cost follows columns, not voxels.

use super::number::{FloorLine, Int, SMALL_EXTENT};
use super::rule::Rule;
use super::setup::{Constraint, Setup};
use super::sink::Sink;
use super::small::{self, TILED_EXTENT};
use crate::lattice::STEP_BITS;

/// Buffers that one thread keeps between triangles.
#[derive(Default)]
pub(super) struct Scratch {
    /// For each y of the triangle's box, the z range that the yz projection allows.
    z_by_y: Vec<[i64; 2]>,
}

/// The voxel indices of a box, both ends included.
#[derive(Clone, Copy, Debug)]
pub(super) struct VoxelBox {
    pub(super) low: [i64; 3],
    pub(super) high: [i64; 3],
}

impl VoxelBox {
    /// The voxels whose closed cubes meet the triangle's closed bounding box.
    #[inline(always)]
    pub(super) fn around([a, b, c]: &[[i64; 3]; 3]) -> Self {
        let low = |i: usize| (a[i].min(b[i]).min(c[i]) - 1) >> STEP_BITS;
        let high = |i: usize| a[i].max(b[i]).max(c[i]) >> STEP_BITS;
        Self { low: [low(0), low(1), low(2)], high: [high(0), high(1), high(2)] }
    }

    /// The part inside `other`, or `None` if there is none.
    #[inline(always)]
    fn clipped(&self, other: &Self) -> Option<Self> {
        let low = |i: usize| self.low[i].max(other.low[i]);
        let high = |i: usize| self.high[i].min(other.high[i]);
        let (low, high) = ([low(0), low(1), low(2)], [high(0), high(1), high(2)]);
        (low[0] <= high[0] && low[1] <= high[1] && low[2] <= high[2]).then_some(Self { low, high })
    }
}

/// Sends the voxels that `triangle` sets inside `clip` to `sink`.
///
/// For [`super::rule::Solid`], the sink gets runs from the lowest voxel whose centre is not below the triangle to the top
/// of the clip; a triangle below the clip gives whole columns.
#[inline(always)]
pub(super) fn voxelize_triangle<R: Rule>(
    rule: &R,
    triangle: &[[i64; 3]; 3],
    clip: &VoxelBox,
    sink: &mut impl Sink,
    scratch: &mut Scratch,
) {
    let around = VoxelBox::around(triangle);
    let extent = |i: usize| around.high[i] - around.low[i];
    let clipped = if R::SURFACE {
        around.clipped(clip)
    } else {
        // The run's ends come from the plane, which may reach past the box; only the columns are the box's.
        let [low, high] = [clip.low[2], clip.high[2]];
        VoxelBox { low: [around.low[0], around.low[1], low], high: [around.high[0], around.high[1], high] }
            .clipped(clip)
    };
    let Some(clipped) = clipped else { return };
    if R::BOX_IS_ENOUGH && extent(0).min(1) + extent(1).min(1) + extent(2).min(1) <= 1 {
        // The triangle is connected and strictly inside the box in at least two axes: it meets every voxel of the row.
        for x in clipped.low[0]..=clipped.high[0] {
            for y in clipped.low[1]..=clipped.high[1] {
                sink.run(x, y, clipped.low[2], clipped.high[2]);
            }
        }
        return;
    }
    let longest = extent(0).max(extent(1)).max(extent(2));
    if R::SURFACE && longest <= TILED_EXTENT {
        small::surface(rule, triangle, &around, &clipped, sink);
    } else if longest <= SMALL_EXTENT && rule.fits_small() {
        general::<i64, R>(rule, triangle, &around, &clipped, sink, scratch);
    } else {
        large(rule, triangle, &around, &clipped, sink, scratch);
    }
}

/// Kept out of line: rare, and its 128-bit code would crowd the common path.
#[inline(never)]
fn large<R: Rule>(
    rule: &R,
    triangle: &[[i64; 3]; 3],
    around: &VoxelBox,
    clipped: &VoxelBox,
    sink: &mut impl Sink,
    scratch: &mut Scratch,
) {
    general::<i128, R>(rule, triangle, around, clipped, sink, scratch);
}

/// One bound on b that follows a: `low` (b at least) or not (b at most).
#[derive(Clone, Copy)]
struct Bound<T> {
    line: FloorLine<T>,
    low: bool,
}

impl<T: Int> Constraint<T> {
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

fn general<T: Int, R: Rule>(
    rule: &R,
    triangle: &[[i64; 3]; 3],
    around: &VoxelBox,
    clipped: &VoxelBox,
    sink: &mut impl Sink,
    scratch: &mut Scratch,
) {
    let zero = T::from(0);
    let base = around.low;
    let setup = Setup::<T>::new(triangle, base);
    let low: [i64; 3] = std::array::from_fn(|i| clipped.low[i] - base[i]);
    let high: [i64; 3] = std::array::from_fn(|i| clipped.high[i] - base[i]);

    if !R::SURFACE && setup.normal[2] == zero {
        return;
    }

    let [mut x_low, mut x_high] = [low[0], high[0]];
    let mut y_by_x = Bounds::new();
    let xy = setup.projection(rule, 0, 1);
    for constraint in xy {
        if !R::SURFACE && constraint.nb == zero {
            // An edge along y limits x alone. (On surfaces the box already implies it.)
            if constraint.na > zero {
                x_low = x_low.max(-((-constraint.t).div_floor(constraint.na).0.saturate()));
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
    let slanted = up[2] > zero;
    if !slanted {
        // A plane along z limits x and y only: two more edges. Where it is also along y or x, the box implies it.
        y_by_x.push(Constraint { na: up[0], nb: up[1], t: d1 }.bound(x_low));
        y_by_x.push(Constraint { na: -up[0], nb: -up[1], t: -d2 }.bound(x_low));
    }

    let mut z_by_x = Bounds::new();
    if R::SURFACE {
        let mut z_by_y = Bounds::new();
        setup.projection(rule, 1, 2).into_iter().for_each(|c| z_by_y.push(c.bound(low[1])));
        setup.projection(rule, 0, 2).into_iter().for_each(|c| z_by_x.push(c.bound(x_low)));
        scratch.z_by_y.clear();
        scratch.z_by_y.extend((low[1]..=high[1]).map(|_| z_by_y.next([low[2], high[2]])));
    }

    if slanted {
        // z <= floor((d2 - N_x x - N_y y) / N_z), and the lower bound is `thickness` below it: see `low_end`.
        let (thickness, thickness_rest) = (d2 - d1).div_floor(up[2]);
        let mut top = FloorLine::new(zero, -up[1], up[2]);
        let mut at_row = d2 - up[0] * T::from(x_low);
        for x in x_low..=x_high {
            let [y_low, y_high] = y_by_x.next([low[1], high[1]]);
            let [z_low, z_high] = z_by_x.next([low[2], high[2]]);
            if y_low <= y_high && z_low <= z_high {
                top.restart(at_row - up[1] * T::from(y_low));
                for y in y_low..=y_high {
                    // ceil((d1 - L) / N) with d2 - L = q N + r and d2 - d1 = w N + s is q - w + (r > s).
                    let carry = T::from(i64::from(top.remainder > thickness_rest));
                    let mut from = (top.quotient - thickness + carry).saturate().max(z_low);
                    let mut to = top.quotient.saturate().min(z_high);
                    if R::SURFACE {
                        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "y >= low[1]")]
                        let [y_from, y_to] = scratch.z_by_y[(y - low[1]) as usize];
                        from = from.max(y_from);
                        to = to.min(y_to);
                    }
                    if R::TO_TOP {
                        to = z_high;
                    }
                    if from <= to {
                        sink.run(x + base[0], y + base[1], from + base[2], to + base[2]);
                    }
                    top.advance();
                }
            }
            at_row -= up[0];
        }
    } else {
        for x in x_low..=x_high {
            let [y_low, y_high] = y_by_x.next([low[1], high[1]]);
            let [z_low, z_high] = z_by_x.next([low[2], high[2]]);
            for y in y_low..=y_high {
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "y >= low[1]")]
                let [y_from, y_to] = scratch.z_by_y[(y - low[1]) as usize];
                let (from, to) = (z_low.max(y_from), z_high.min(y_to));
                if from <= to {
                    sink.run(x + base[0], y + base[1], from + base[2], to + base[2]);
                }
            }
        }
    }
}
