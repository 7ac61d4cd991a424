//! Fragments: the voxels of one triangle at a time, so that attributes know which triangles meet in a voxel.
//!
//! The kernel's paths merge all triangles into bits. This one keeps them apart. It states the same thresholds
//! ([`super::rule`]) as plain interval arithmetic, one column after the other, and is exact for the same reasons; the
//! tests compare the union of its runs with the kernel's bits. For attributes its time does not count: every fragment
//! then costs more than its share of it.

use super::number::{Int, SMALL_EXTENT};
use super::rule::{Conservative, Rule, Sliced, Thin};
use super::setup::{Constraint, Setup};
use crate::job::Job;
use crate::lattice::{STEP_BITS, STEPS_PER_VOXEL};
use crate::mode::Mode;

const S: i64 = STEPS_PER_VOXEL as i64;

/// Which (voxel, triangle) pairs there are, for a job's mode.
///
/// For a surface mode, those where the mode's set of that triangle alone has the voxel. For a solid, where the triangle
/// meets the voxel's cube grown by half a voxel on all sides ([`Shell`]).
#[derive(Clone, Copy, Debug)]
pub(crate) enum Pairs {
    Conservative,
    Thin,
    /// With the overlap in steps.
    Sliced(i64),
    Shell,
}

impl Pairs {
    pub(crate) fn of(job: &Job) -> Self {
        match job.mode() {
            Mode::Conservative => Self::Conservative,
            Mode::Thin => Self::Thin,
            Mode::Sliced => Self::Sliced(i64::from(job.overlap_steps())),
            Mode::Solid => Self::Shell,
        }
    }

    /// Steps that a triangle reaches beyond the voxels that its box meets, along x.
    pub(crate) fn grow(self) -> i64 {
        match self {
            Self::Shell => S / 2,
            _ => 0,
        }
    }

    /// Steps that a triangle may be away from the cube of a voxel that it is paired with, along any axis.
    pub(crate) fn reach(self) -> i64 {
        match self {
            Self::Conservative | Self::Thin => 0,
            Self::Sliced(overlap) => overlap,
            Self::Shell => S / 2,
        }
    }

    /// Calls `run(x, y, from, to)` for the voxels `(x, y, from..=to)` that `triangle` is paired with inside the box of
    /// voxels from `low` to `high`, both included. Every column comes at most once.
    pub(crate) fn for_each_run(
        self,
        triangle: &[[i64; 3]; 3],
        low: [i64; 3],
        high: [i64; 3],
        run: &mut impl FnMut(i64, i64, i64, i64),
    ) {
        match self {
            Self::Conservative => runs(&Conservative, 0, triangle, low, high, run),
            Self::Thin => runs(&Thin, 0, triangle, low, high, run),
            Self::Sliced(overlap) => runs(&Sliced { overlap }, 0, triangle, low, high, run),
            Self::Shell => runs(&Shell, S / 2, triangle, low, high, run),
        }
    }
}

/// The cube of two voxels' width around a voxel's centre shares a point with the triangle.
///
/// Between the centres of a set voxel and an unset one beside it, a closed mesh passes at most one voxel from the set
/// one's centre: so every exposed voxel of a solid has a triangle, which with its own cube alone it might not.
#[derive(Clone, Copy)]
struct Shell;

impl Rule for Shell {
    const SURFACE: bool = true;
    const TOUCH_IS_ENOUGH: bool = true;

    fn edge<T: Int>(&self, na: T, nb: T, nv: T) -> T {
        // n . (c - v) + S (|na| + |nb|) >= 0 with c = S (p + 1/2).
        let half = T::from(S / 2);
        let numerator = nv - half * (na + nb) - T::from(S) * (na.max(-na) + nb.max(-nb));
        (numerator + T::from(S - 1)).floor_voxels()
    }

    fn plane<T: Int>(&self, n: [T; 3], v0: [i64; 3]) -> (T, T) {
        // |N . (c - v0)| <= S sum |N_i|, with v0 split into whole voxels and the rest so that products stay small.
        let zero = T::from(0);
        let (mut whole, mut rest, mut reach) = (zero, zero, zero);
        for i in 0..3 {
            whole = whole + n[i] * T::from(v0[i].div_euclid(S));
            rest = rest + n[i] * T::from(v0[i].rem_euclid(S) - S / 2);
            reach = reach + n[i].max(-n[i]);
        }
        (whole - reach + (rest + T::from(S - 1)).floor_voxels(), whole + reach + rest.floor_voxels())
    }
}

/// The part of the box of voxels that the triangle's own box allows, or `None` if there is none, and the lowest voxel
/// that the triangle's own box meets.
fn clip<R: Rule>(
    grow: i64,
    triangle: &[[i64; 3]; 3],
    low: [i64; 3],
    high: [i64; 3],
) -> Option<([[i64; 3]; 2], [i64; 3], i64)> {
    let [a, b, c] = triangle;
    let (mut from, mut to, mut base, mut extent) = (low, high, [0; 3], 0);
    for i in 0..3 {
        let (least, most) = (a[i].min(b[i]).min(c[i]), a[i].max(b[i]).max(c[i]));
        base[i] = (least - 1) >> STEP_BITS;
        extent = extent.max((most >> STEP_BITS) - base[i]);
        // What looks along z from centres is not limited by the box along z.
        if R::SURFACE || i < 2 {
            from[i] = from[i].max((least - grow - 1) >> STEP_BITS);
            to[i] = to[i].min((most + grow) >> STEP_BITS);
        }
        if from[i] > to[i] {
            return None;
        }
    }
    Some(([from, to], base, extent))
}

fn runs<R: Rule>(
    rule: &R,
    grow: i64,
    triangle: &[[i64; 3]; 3],
    low: [i64; 3],
    high: [i64; 3],
    run: &mut impl FnMut(i64, i64, i64, i64),
) {
    let Some((range, base, extent)) = clip::<R>(grow, triangle, low, high) else { return };
    if extent <= SMALL_EXTENT && rule.fits_small() {
        columns::<R, i64>(rule, triangle, range, base, run);
    } else {
        columns::<R, i128>(rule, triangle, range, base, run);
    }
}

/// The bounds that `constraint` puts on b at `a`; `None` where it allows none.
#[inline]
fn narrow<T: Int>(constraint: &Constraint<T>, a: i64, [mut low, mut high]: [i64; 2]) -> Option<[i64; 2]> {
    let zero = T::from(0);
    let at = constraint.t - constraint.na * T::from(a);
    if constraint.nb > zero {
        low = low.max((-(-at).div_floor(constraint.nb).0).saturate());
    } else if constraint.nb < zero {
        high = high.min((-at).div_floor(-constraint.nb).0.saturate());
    } else if at > zero {
        return None;
    }
    (low <= high).then_some([low, high])
}

fn narrow_all<T: Int>(constraints: &[Constraint<T>], a: i64, range: [i64; 2]) -> Option<[i64; 2]> {
    constraints.iter().try_fold(range, |range, constraint| narrow(constraint, a, range))
}

fn columns<R: Rule, T: Int>(
    rule: &R,
    triangle: &[[i64; 3]; 3],
    [from, to]: [[i64; 3]; 2],
    base: [i64; 3],
    run: &mut impl FnMut(i64, i64, i64, i64),
) {
    let zero = T::from(0);
    let setup = Setup::<T>::new(triangle, base);
    if !R::SURFACE && setup.normal[2] == zero {
        return;
    }
    let low: [i64; 3] = std::array::from_fn(|i| from[i] - base[i]);
    let high: [i64; 3] = std::array::from_fn(|i| to[i] - base[i]);
    let (up, d1, d2) = setup.plane(rule);
    let y_by_x = setup.projection(rule, 0, 1);
    let sides = R::SURFACE.then(|| (setup.projection(rule, 0, 2), setup.projection(rule, 1, 2)));
    for x in low[0]..=high[0] {
        let Some([y_low, y_high]) = narrow_all(&y_by_x, x, [low[1], high[1]]) else { continue };
        let z_at_x = match &sides {
            Some((z_by_x, _)) => narrow_all(z_by_x, x, [low[2], high[2]]),
            None => Some([low[2], high[2]]),
        };
        let Some(z_at_x) = z_at_x else { continue };
        for y in y_low..=y_high {
            let z = match &sides {
                Some((_, z_by_y)) => narrow_all(z_by_y, y, z_at_x),
                None => Some(z_at_x),
            };
            let level = up[0] * T::from(x) + up[1] * T::from(y);
            let plane = [Constraint { na: level, nb: up[2], t: d1 }, Constraint { na: -level, nb: -up[2], t: -d2 }];
            let Some([z_from, z_to]) = z.and_then(|z| narrow_all(&plane, 1, z)) else { continue };
            run(x + base[0], y + base[1], z_from + base[2], z_to + base[2]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conformance::oracle;
    use crate::conformance::random::{Placement, Random, triangle};
    use crate::grid::Grid;
    use crate::lattice::{LatticeMesh, LatticePositions};
    use crate::volume::Volume;

    fn union(pairs: Pairs, mesh: &LatticeMesh<'_>, grid: Grid) -> Volume {
        let mut volume = Volume::new(grid).unwrap();
        let high = grid.dims().map(|d| i64::from(d) - 1);
        for index in 0..mesh.triangles.len() {
            pairs.for_each_run(&mesh.corners(index), [0; 3], high, &mut |x, y, from, to| {
                for z in from..=to {
                    volume.set([x, y, z].map(|c| u32::try_from(c).unwrap()));
                }
            });
        }
        volume
    }

    #[test]
    fn runs_are_the_definition() {
        let mut random = Random::new(5);
        let grid = Grid::new([0.0; 3], [1.0; 3], [12, 11, 70]).unwrap();
        for round in 0..6000 {
            let placement = Placement::ALL[round % 5];
            let extent = [1, 3, 9, 80][round / 5 % 4];
            let corners = triangle(&mut random, placement, -3, 12, extent);
            let mesh = LatticeMesh { positions: LatticePositions::Wide(corners.to_vec()), triangles: &[[0, 1, 2]] };
            for mode in [Mode::Conservative, Mode::Thin, Mode::Sliced] {
                let mut job = Job::new(grid, mode);
                if mode == Mode::Sliced && round % 3 == 0 {
                    job = job.with_overlap([0.3, 4.7][round % 2]).unwrap();
                }
                let expected = oracle::voxelize(&mesh, &job).unwrap();
                assert_eq!(union(Pairs::of(&job), &mesh, grid), expected, "{mode} {corners:?}");
            }
        }
    }

    #[test]
    fn a_shell_is_the_conservative_set_of_doubled_cubes() {
        let mut random = Random::new(6);
        let grid = Grid::new([0.0; 3], [1.0; 3], [9, 8, 10]).unwrap();
        for round in 0..3000 {
            let corners = triangle(&mut random, Placement::ALL[round % 5], -2, 9, [1, 3, 9, 80][round / 5 % 4]);
            let mesh = LatticeMesh { positions: LatticePositions::Wide(corners.to_vec()), triangles: &[[0, 1, 2]] };
            let found = union(Pairs::Shell, &mesh, grid);
            // Scaled so that the cube around the centre, two voxels wide, becomes one voxel: [p - 1/2, p + 3/2] / 2.
            for x in 0..9 {
                for y in 0..8 {
                    for z in 0..10 {
                        let voxel = [x, y, z];
                        let local = corners.map(|v| {
                            std::array::from_fn(|i| {
                                i128::from(v[i]) - i128::from(S) * i128::from(voxel[i]) + i128::from(S / 2)
                            })
                        });
                        // Cubes of S x S x S from 0 on, so doubled coordinates halve exactly by doubling S instead:
                        // eight unit cubes make the doubled one.
                        let expected =
                            (0..8).any(|corner| oracle::conservative(local, [0, 1, 2].map(|i| corner >> i & 1)));
                        assert_eq!(found.get(voxel), expected, "{voxel:?} {corners:?}");
                    }
                }
            }
        }
    }
}
