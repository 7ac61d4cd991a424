//! Large triangles: runs that follow lines, without a division a column.
//!
//! Every test of a mode is linear in the voxel's indices, so the voxels that a triangle sets in one column along z are
//! one run. Its ends are the tightest of the box, the plane's two bounds, and the edges of the two projections that
//! contain z, of which one depends on x alone and the other on y alone. This is [HCV] section 3.1 (optimization steps 1
//! to 5) with the loop over depth replaced by its closed form; cost follows columns, not voxels.

use super::kernel::VoxelBox;
use super::number::{FloorLine, div_floor, saturate};
use super::rule::Rule;
use super::setup::{Constraint, Setup};
use super::sink::Sink;

/// One bound on b that follows a: `low` (b at least) or not (b at most).
#[derive(Clone, Copy)]
struct Bound {
    line: FloorLine,
    low: bool,
}

impl Constraint<i128> {
    /// The bound on b from a = `start` on; `None` when the constraint does not involve b.
    #[inline(always)]
    fn bound(self, start: i64) -> Option<Bound> {
        let at_start = self.t - self.na * i128::from(start);
        if self.nb > 0 {
            // b >= ceil((t - na a) / nb)
            Some(Bound { line: FloorLine::new(at_start + self.nb - 1, -self.na, self.nb), low: true })
        } else if self.nb < 0 {
            // b <= floor((na a - t) / -nb)
            Some(Bound { line: FloorLine::new(-at_start, self.na, -self.nb), low: false })
        } else {
            None
        }
    }
}

/// Up to five bounds on b for consecutive a.
struct Bounds {
    bounds: [Option<Bound>; 5],
    count: usize,
}

impl Bounds {
    #[inline(always)]
    fn new() -> Self {
        Self { bounds: [None; 5], count: 0 }
    }

    #[inline(always)]
    fn push(&mut self, bound: Option<Bound>) {
        if bound.is_some() {
            self.bounds[self.count] = bound;
            self.count += 1;
        }
    }

    /// The range of b at the current a, within `range`, and on to the next a.
    #[inline(always)]
    fn next(&mut self, [mut low, mut high]: [i64; 2]) -> [i64; 2] {
        for bound in self.bounds[..self.count].iter_mut().flatten() {
            let value = saturate(bound.line.quotient);
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
    z_by_y: Vec<[i64; 2]>,
}

/// Sends the voxels of a triangle of any size inside `clipped` to the sink.
///
/// Out of line: rare, and its 128-bit code would crowd the common paths.
#[inline(never)]
pub(super) fn voxelize<R: Rule>(
    rule: &R,
    triangle: &[[i64; 3]; 3],
    around: &VoxelBox,
    clipped: &VoxelBox,
    sink: &mut impl Sink,
    scratch: &mut Scratch,
) {
    let base = around.low;
    let setup = Setup::<i128>::new(triangle, base);
    let low: [i64; 3] = std::array::from_fn(|i| clipped.low[i] - base[i]);
    let high: [i64; 3] = std::array::from_fn(|i| clipped.high[i] - base[i]);

    if !R::SURFACE && setup.normal[2] == 0 {
        return;
    }

    let [mut x_low, mut x_high] = [low[0], high[0]];
    let mut y_by_x = Bounds::new();
    let xy = setup.projection(rule, 0, 1);
    for constraint in xy {
        if !R::SURFACE && constraint.nb == 0 {
            // An edge along y limits x alone. (On surfaces the box already implies it.)
            if constraint.na > 0 {
                x_low = x_low.max(-saturate(div_floor(-constraint.t, constraint.na).0));
            } else if constraint.na < 0 {
                x_high = x_high.min(saturate(div_floor(-constraint.t, -constraint.na).0));
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
    let slanted = up[2] > 0;
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
        // z <= floor((d2 - N_x x - N_y y) / N_z), and the lower bound is `thickness` below it.
        let (thickness, thickness_rest) = div_floor(d2 - d1, up[2]);
        let mut top = FloorLine::new(0, -up[1], up[2]);
        let mut at_row = d2 - up[0] * i128::from(x_low);
        for x in x_low..=x_high {
            let [y_low, y_high] = y_by_x.next([low[1], high[1]]);
            let [z_low, z_high] = z_by_x.next([low[2], high[2]]);
            if y_low <= y_high && z_low <= z_high {
                top.restart(at_row - up[1] * i128::from(y_low));
                for y in y_low..=y_high {
                    // ceil((d1 - L) / N) with d2 - L = q N + r and d2 - d1 = w N + s is q - w + (r > s).
                    let carry = i128::from(top.remainder > thickness_rest);
                    let mut from = saturate(top.quotient - thickness + carry).max(z_low);
                    let mut to = saturate(top.quotient).min(z_high);
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
