//! Polygons to triangles: fans where polygons are convex, ear clipping where they are clearly not.
//!
//! A polygon of n corners always gives n - 2 triangles that use every corner, in the polygon's orientation. That is why
//! this is own code: triangulation crates drop corners on straight edges, where the neighbouring polygon keeps them, and
//! a closed mesh would get cracks. It also lets readers push fans while positions are still unknown and have the concave
//! ones rewritten in place ([`Faces::finish`]).
//!
//! Ear clipping after G. H. Meisters, "Polygons have ears", 1975, with a uniform grid over the reflex corners. Holes
//! bridged by doubled edges, as exporters write them, work. The work is bounded in proportion to the corners, so a
//! hostile polygon ends as a partial fan, not as a hang.

/// Appends the triangles of `polygon`, which names its vertices, as numbers of its corners, so that attributes can
/// follow. For formats that know all positions before their polygons; the others push to [`Faces`].
pub(super) fn triangulate_corners(positions: &[[f64; 3]], polygon: &[u32], out: &mut Vec<[u32; 3]>) {
    let Some(outline) = Outline::concave(positions, polygon) else {
        let corners = u32::try_from(polygon.len()).unwrap_or(u32::MAX);
        return out.extend((2..corners).map(|corner| [0, corner - 1, corner]));
    };
    outline.clip_ears(out);
}

/// Appends the fan of `corners` around its first.
pub(super) fn fan(corners: &[u32], out: &mut Vec<[u32; 3]>) {
    if let [first, rest @ ..] = corners {
        out.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]]));
    }
}

/// The triangles of a file's polygons, pushed before all positions are known.
#[derive(Default)]
pub(super) struct Faces {
    /// The triangles so far.
    pub(super) triangles: Vec<[u32; 3]>,
    /// First triangle and number of triangles of each polygon that has more than one.
    fans: Vec<(usize, usize)>,
    /// Faces without an area, by definition.
    skipped: usize,
}

impl Faces {
    /// Adds a polygon; returns the number of triangles that this made.
    pub(super) fn push(&mut self, corners: &[u32]) -> usize {
        match *corners {
            [a, b, c] => self.triangles.push([a, b, c]),
            [_, _, _, ..] => {
                self.fans.push((self.triangles.len(), corners.len() - 2));
                fan(corners, &mut self.triangles);
            }
            _ => self.skipped += 1,
        }
        corners.len().saturating_sub(2)
    }

    /// Adds those of a later part of the file, whose vertices are counted from `first_vertex` of this one's.
    pub(super) fn append(&mut self, more: Self, first_vertex: u32) {
        let first = self.triangles.len();
        self.triangles.extend(more.triangles.into_iter().map(|triangle| triangle.map(|vertex| vertex + first_vertex)));
        self.fans.extend(more.fans.into_iter().map(|(at, count)| (first + at, count)));
        self.skipped += more.skipped;
    }

    /// Triangulates the concave polygons anew, with `attributes` (corner indices beside the triangles, each empty or as
    /// long), and warns of what was skipped.
    pub(super) fn finish(
        mut self,
        positions: &[[f64; 3]],
        attributes: &mut [&mut Vec<[u32; 3]>],
        warnings: &mut Vec<String>,
    ) -> Vec<[u32; 3]> {
        if self.skipped > 0 {
            warnings.push(format!("skipped {} faces with fewer than 3 corners", self.skipped));
        }
        let (mut polygon, mut pieces) = (Vec::new(), Vec::new());
        for &(first, count) in &self.fans {
            let range = first..first + count;
            unfan(&self.triangles[range.clone()], &mut polygon);
            let Some(outline) = Outline::concave(positions, &polygon) else { continue };
            pieces.clear();
            outline.clip_ears(&mut pieces);
            rewrite(&mut self.triangles[range.clone()], &pieces, &polygon);
            for corners in attributes.iter_mut() {
                if let Some(triangles) = corners.get_mut(range.clone()) {
                    unfan(triangles, &mut polygon);
                    rewrite(triangles, &pieces, &polygon);
                }
            }
        }
        self.triangles
    }
}

/// The corners that [`fan`] was given.
fn unfan(fan: &[[u32; 3]], corners: &mut Vec<u32>) {
    corners.clear();
    if let Some(first) = fan.first() {
        corners.extend(&first[..2]);
        corners.extend(fan.iter().map(|triangle| triangle[2]));
    }
}

fn rewrite(triangles: &mut [[u32; 3]], pieces: &[[u32; 3]], corners: &[u32]) {
    for (triangle, piece) in triangles.iter_mut().zip(pieces) {
        *triangle = piece.map(|corner| corners[corner as usize]);
    }
}

/// A polygon in the plane that it mostly lies in, counter-clockwise, as a ring of corners not yet cut off.
struct Outline {
    points: Vec<[f64; 2]>,
    next: Vec<u32>,
    previous: Vec<u32>,
}

/// What cutting a large polygon may cost, in steps per corner: a sane polygon needs a few dozen.
const STEPS_PER_CORNER: usize = 1024;

impl Outline {
    /// The outline of a polygon that turns the wrong way at some corner, by more than rounding explains. `None` for
    /// convex polygons, triangles, and those with unknown, infinite or no extent, for which a fan is as good.
    fn concave(positions: &[[f64; 3]], polygon: &[u32]) -> Option<Self> {
        if polygon.len() < 4 {
            return None;
        }
        let at = |corner: usize| positions.get(*polygon.get(corner)? as usize).copied();
        let first = at(0)?;
        // Newell's normal, relative to the first corner so that a polygon far from the origin keeps its digits.
        let (mut normal, mut reach, mut last) = ([0.0f64; 3], 0.0f64, [0.0f64; 3]);
        for corner in 1..polygon.len() {
            let position = at(corner)?;
            let here: [f64; 3] = std::array::from_fn(|i| position[i] - first[i]);
            for i in 0..3 {
                let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                normal[i] += last[j] * here[k] - last[k] * here[j];
                reach = reach.max(position[i].abs()).max(first[i].abs());
            }
            last = here;
        }
        let size = normal.map(f64::abs);
        let axis = if size[0] >= size[1] && size[0] >= size[2] { 0 } else { 1 + usize::from(size[2] > size[1]) };
        if !(size[axis].is_normal() && reach.is_finite()) {
            return None;
        }
        let (mut u, mut v) = ((axis + 1) % 3, (axis + 2) % 3);
        if normal[axis] < 0.0 {
            (u, v) = (v, u);
        }
        let points: Vec<[f64; 2]> = (0..polygon.len()).map(|c| at(c).map(|p| [p[u], p[v]])).collect::<Option<_>>()?;
        // Coordinates of size `reach` that were rounded to f32 are off by up to reach * 2^-24 each, which moves the
        // doubled area of a corner by up to twice that times the lengths (in the 1-norm) of its two edges. A straight
        // corner may turn by that much. But one that turns by more than about 2^-10 is never taken for straight: far
        // from the origin coordinates may well hold more digits than f32 does.
        let rounding = reach * 2f64.powi(-23);
        let slack = |a: f64, b: f64| (rounding * (a + b)).min(2f64.powi(-10) * a * b);
        let n = points.len();
        let clearly_reflex = (0..n).any(|i| {
            let (a, b, c) = (points[(i + n - 1) % n], points[i], points[(i + 1) % n]);
            turn(a, b, c) < -slack(distance(a, b), distance(b, c))
        });
        let index = u32::try_from(n).ok()?;
        clearly_reflex.then(|| Self {
            points,
            next: (1..index).chain([0]).collect(),
            previous: [index - 1].into_iter().chain(0..index - 1).collect(),
        })
    }

    /// Cuts off ears until a triangle is left, and appends them, with the corners' numbers.
    fn clip_ears(mut self, out: &mut Vec<[u32; 3]>) {
        let mut left = self.points.len();
        let mut steps = left.saturating_mul(STEPS_PER_CORNER);
        let reflex = ReflexGrid::new(&self);
        let (mut corner, mut tried) = (0u32, 0usize);
        while left > 2 {
            let (previous, next) = (self.previous[corner as usize], self.next[corner as usize]);
            // A polygon that crosses itself may have no ear: then, as when the work is used up, any corner will do.
            if steps == 0 || tried >= left || self.is_ear(corner, &reflex, &mut steps) {
                out.push([previous, corner, next]);
                self.next[previous as usize] = next;
                self.previous[next as usize] = previous;
                // Its own link marks a corner that was cut off.
                self.next[corner as usize] = corner;
                left -= 1;
                tried = 0;
                // Skipping a corner avoids a fan of slivers.
                corner = if steps == 0 { next } else { self.next[next as usize] };
            } else {
                tried += 1;
                corner = next;
            }
        }
    }

    fn corner(&self, corner: u32) -> [f64; 2] {
        self.points[corner as usize]
    }

    fn turn_at(&self, corner: u32) -> f64 {
        let (previous, next) = (self.previous[corner as usize], self.next[corner as usize]);
        turn(self.corner(previous), self.corner(corner), self.corner(next))
    }

    /// Whether the triangle at a corner turns left and holds no other corner that is reflex.
    fn is_ear(&self, corner: u32, reflex: &ReflexGrid, steps: &mut usize) -> bool {
        *steps = steps.saturating_sub(1);
        if self.turn_at(corner) <= 0.0 {
            return false;
        }
        let (previous, next) = (self.previous[corner as usize], self.next[corner as usize]);
        let triangle = [self.corner(previous), self.corner(corner), self.corner(next)];
        let blocks = |other: u32| {
            let point = self.corner(other);
            // Corners at the same place are the two sides of a bridge to a hole.
            self.next[other as usize] != other
                && !triangle.contains(&point)
                && turn(triangle[0], triangle[1], point) >= 0.0
                && turn(triangle[1], triangle[2], point) >= 0.0
                && turn(triangle[2], triangle[0], point) >= 0.0
                && self.turn_at(other) <= 0.0
        };
        !reflex.any_in_box_of(triangle, steps, blocks)
    }
}

/// The corners that were reflex or straight at first (clipping makes no new ones), by the cell of a grid they lie in.
struct ReflexGrid {
    min: [f64; 2],
    cell: [f64; 2],
    side: usize,
    /// Corners, cell after cell.
    corners: Vec<u32>,
    /// Where each cell's corners start, and the end of the last.
    starts: Vec<usize>,
}

impl ReflexGrid {
    fn new(outline: &Outline) -> Self {
        let all = 0..u32::try_from(outline.points.len()).unwrap_or(u32::MAX);
        let reflex: Vec<u32> = all.filter(|&corner| outline.turn_at(corner) <= 0.0).collect();
        let (mut min, mut max) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for point in &outline.points {
            for i in 0..2 {
                min[i] = min[i].min(point[i]);
                max[i] = max[i].max(point[i]);
            }
        }
        let side = reflex.len().isqrt().max(1);
        #[expect(clippy::cast_precision_loss, reason = "at most 2^16")]
        let cell = std::array::from_fn(|i| (max[i] - min[i]) / side as f64);
        let mut grid = Self { min, cell, side, corners: Vec::new(), starts: Vec::new() };
        let mut placed: Vec<(usize, u32)> = reflex
            .into_iter()
            .map(|corner| {
                let [x, y] = grid.cell_of(outline.corner(corner));
                (y * side + x, corner)
            })
            .collect();
        placed.sort_unstable();
        grid.starts = (0..=side * side).map(|cell| placed.partition_point(|&(c, _)| c < cell)).collect();
        grid.corners = placed.into_iter().map(|(_, corner)| corner).collect();
        grid
    }

    fn cell_of(&self, point: [f64; 2]) -> [usize; 2] {
        std::array::from_fn(|i| {
            // `as` makes 0 of NaN (a box without extent) and of negatives.
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates, then bounded")]
            let index = ((point[i] - self.min[i]) / self.cell[i]) as usize;
            index.min(self.side - 1)
        })
    }

    /// Whether `test` holds for any corner in a cell that the triangle's box meets; gives up, with yes, out of steps.
    fn any_in_box_of(&self, triangle: [[f64; 2]; 3], steps: &mut usize, test: impl Fn(u32) -> bool) -> bool {
        let least = |i: usize| triangle[0][i].min(triangle[1][i]).min(triangle[2][i]);
        let most = |i: usize| triangle[0][i].max(triangle[1][i]).max(triangle[2][i]);
        let (from, to) = (self.cell_of([least(0), least(1)]), self.cell_of([most(0), most(1)]));
        for y in from[1]..=to[1] {
            // The cells of a row lie one after the other.
            let row = self.starts[y * self.side + from[0]]..self.starts[y * self.side + to[0] + 1];
            *steps = steps.saturating_sub(1);
            for &corner in &self.corners[row] {
                if *steps == 0 || test(corner) {
                    return true;
                }
                *steps -= 1;
            }
        }
        false
    }
}

/// Twice the signed area of `abc`: positive where it turns left.
fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// The 1-norm of `b - a`.
fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (b[0] - a[0]).abs() + (b[1] - a[1]).abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(points: &[[f64; 2]]) -> (Vec<[f64; 3]>, Vec<u32>) {
        let positions = points.iter().map(|p| [p[0], p[1], 0.0]).collect();
        (positions, (0..u32::try_from(points.len()).unwrap()).collect())
    }

    fn area(points: &[[f64; 2]], triangle: [u32; 3]) -> f64 {
        let [a, b, c] = triangle.map(|corner| points[corner as usize]);
        turn(a, b, c) / 2.0
    }

    /// Triangulates and checks the count, that no triangle is inside out, and that the areas add up.
    fn check(points: &[[f64; 2]], expected_area: f64) -> Vec<[u32; 3]> {
        let (positions, polygon) = flat(points);
        let mut triangles = Vec::new();
        triangulate_corners(&positions, &polygon, &mut triangles);
        assert_eq!(triangles.len(), points.len() - 2);
        let areas: Vec<f64> = triangles.iter().map(|&t| area(points, t)).collect();
        assert!(areas.iter().all(|&a| a >= 0.0), "{triangles:?} {areas:?}");
        let sum: f64 = areas.iter().sum();
        assert!((sum - expected_area).abs() < 1e-9 * expected_area, "{sum} for {expected_area}");
        triangles
    }

    #[test]
    fn convex_polygons_are_fans_from_the_first_corner() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        assert_eq!(check(&square, 1.0), [[0, 1, 2], [0, 2, 3]]);
        let with_straight_corner = [[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        assert_eq!(check(&with_straight_corner, 1.0), [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
    }

    #[test]
    fn almost_straight_corners_stay_fans() {
        let bent = [[0.0, 0.0], [0.5, 1e-9], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let (positions, polygon) = flat(&bent);
        let mut triangles = Vec::new();
        triangulate_corners(&positions, &polygon, &mut triangles);
        assert_eq!(triangles, [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
    }

    #[test]
    fn saddle_quads_are_fans() {
        let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.3], [1.0, 1.0, 0.0], [0.0, 1.0, 0.3]];
        let mut triangles = Vec::new();
        triangulate_corners(&positions, &[0, 1, 2, 3], &mut triangles);
        assert_eq!(triangles, [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn concave_quad_is_cut_at_its_reflex_corner() {
        check(&[[0.0, 0.0], [2.0, -1.0], [0.5, 0.0], [2.0, 1.0]], 0.5);
    }

    #[test]
    fn small_concave_polygons_far_from_the_origin() {
        let arrow = [[0.0, 0.0], [0.5, -0.25], [0.125, 0.0], [0.5, 0.25]];
        check(&arrow.map(|[x, y]| [x + 500_000.0, y + 4_000_000.0]), 0.03125);
    }

    #[test]
    fn letter_c_and_comb() {
        let c = [[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 2.0], [3.0, 2.0], [3.0, 3.0], [0.0, 3.0]];
        check(&c, 7.0);
        let mut comb = vec![[0.0, -1.0]];
        for tooth in 0..1000 {
            let x = f64::from(tooth);
            comb.extend([[x, -1.0], [x + 0.5, -1.0], [x + 0.5, 5.0], [x + 0.9, 5.0]]);
        }
        comb.extend([[1000.0, 6.0], [0.0, 6.0]]);
        comb.remove(0);
        let (positions, polygon) = flat(&comb);
        let mut triangles = Vec::new();
        triangulate_corners(&positions, &polygon, &mut triangles);
        let sum: f64 = triangles.iter().map(|&t| area(&comb, t)).sum();
        let whole: f64 = triangulated_area(&comb);
        assert!((sum - whole).abs() < 1e-6 * whole);
        assert!(triangles.iter().all(|&t| area(&comb, t) >= 0.0));
    }

    /// The shoelace formula.
    fn triangulated_area(points: &[[f64; 2]]) -> f64 {
        (2..points.len()).map(|i| turn(points[0], points[i - 1], points[i]) / 2.0).sum()
    }

    #[test]
    fn hole_bridged_by_a_doubled_edge() {
        let outer = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0], [0.0, 0.0]];
        let hole = [[1.0, 1.0], [1.0, 3.0], [3.0, 3.0], [3.0, 1.0], [1.0, 1.0]];
        let points: Vec<[f64; 2]> = outer.into_iter().chain(hole).collect();
        check(&points, 12.0);
    }

    #[test]
    fn star_in_any_plane_keeps_its_orientation() {
        let star: Vec<[f64; 2]> = (0..10)
            .map(|i| {
                let (angle, radius) = (f64::from(i) * 0.2 * std::f64::consts::PI, if i % 2 == 0 { 2.0 } else { 0.7 });
                [radius * angle.cos(), radius * angle.sin()]
            })
            .collect();
        check(&star, triangulated_area(&star));
        for axis in 0..3 {
            let positions: Vec<[f64; 3]> = star
                .iter()
                .map(|p| {
                    let mut position = [1000.0; 3];
                    position[(axis + 1) % 3] = p[1];
                    position[(axis + 2) % 3] = p[0];
                    position
                })
                .collect();
            let mut triangles = Vec::new();
            triangulate_corners(&positions, &(0..10).collect::<Vec<u32>>(), &mut triangles);
            let sum: f64 = triangles.iter().map(|&t| area(&star, t)).sum();
            assert!((sum - triangulated_area(&star)).abs() < 1e-9, "axis {axis}");
        }
    }

    #[test]
    fn a_self_crossing_spiral_of_many_corners_ends_soon() {
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            f64::from(u32::try_from(state >> 40).unwrap())
        };
        let points: Vec<[f64; 2]> = (0..20_000).map(|_| [random(), random()]).collect();
        let (positions, polygon) = flat(&points);
        let mut triangles = Vec::new();
        let start = std::time::Instant::now();
        triangulate_corners(&positions, &polygon, &mut triangles);
        assert_eq!(triangles.len(), points.len() - 2);
        assert!(start.elapsed().as_secs() < 5, "{:?}", start.elapsed());
    }

    #[test]
    fn nonsense_polygons_are_fans_or_nothing() {
        let positions = [[f64::NAN; 3], [1e308; 3], [-1e308; 3], [0.0; 3]];
        for polygon in [&[0, 1, 2, 3][..], &[9, 9, 9, 9], &[3, 3, 3, 3], &[], &[1], &[1, 2]] {
            let mut triangles = Vec::new();
            triangulate_corners(&positions, polygon, &mut triangles);
            assert_eq!(triangles.len(), polygon.len().saturating_sub(2));
        }
    }

    #[test]
    fn faces_rewrite_concave_fans_and_their_attributes() {
        let (positions, _) = flat(&[[0.0, 0.0], [2.0, -1.0], [0.5, 0.0], [2.0, 1.0]]);
        let mut faces = Faces::default();
        // Starting at the corner from which a fan would leave the polygon.
        let corners = [1, 2, 3, 0];
        assert_eq!(faces.push(&corners), 2);
        assert_eq!(faces.push(&[0, 1]), 0);
        let mut attribute = Vec::new();
        fan(&corners.map(|c| c + 10), &mut attribute);
        let mut warnings = Vec::new();
        let triangles = faces.finish(&positions, &mut [&mut attribute, &mut Vec::new()], &mut warnings);
        for triangle in &triangles {
            assert!(triangle.contains(&0) && triangle.contains(&2), "cut between 0 and 2: {triangles:?}");
        }
        let shifted: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(|c| c + 10)).collect();
        assert_eq!(attribute, shifted);
        assert_eq!(warnings, ["skipped 1 faces with fewer than 3 corners"]);
    }
}
