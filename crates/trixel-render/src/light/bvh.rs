//! A hierarchy of boxes over triangles, to find what rays hit. In f64 throughout.

use glam::DVec3;
use trixel::Mesh;

/// Triangles of a leaf.
const LEAF: usize = 4;
/// Places at which a node may be cut.
const BINS: usize = 16;

/// Triangles in a hierarchy of boxes.
pub(super) struct Bvh {
    nodes: Vec<Node>,
    corners: Vec<[DVec3; 3]>,
    /// The mesh's number of each of `corners`.
    triangles: Vec<u32>,
}

struct Node {
    low: DVec3,
    high: DVec3,
    /// Of a leaf, its first triangle; else the second child. The first child follows its parent.
    start: u32,
    /// Triangles of a leaf; 0 for others.
    count: u32,
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    /// Distance, in lengths of the direction.
    pub(super) t: f64,
    /// The mesh's triangle.
    pub(super) triangle: u32,
    /// Weights of the triangle's corners.
    pub(super) weights: [f64; 3],
    /// The triangle's normal, not of unit length.
    pub(super) face: DVec3,
}

impl Bvh {
    pub(super) fn new(mesh: &Mesh) -> Self {
        let position = |vertex: u32| mesh.positions.get(vertex as usize).map_or(DVec3::ZERO, |&p| DVec3::from_array(p));
        let mut items: Vec<Item> = (0u32..)
            .zip(&mesh.triangles)
            .map(|(triangle, corners)| {
                let corners = corners.map(position);
                let (low, high) =
                    (corners[0].min(corners[1]).min(corners[2]), corners[0].max(corners[1]).max(corners[2]));
                Item { low, high, middle: 0.5 * (low + high), corners, triangle }
            })
            .collect();
        let mut nodes = Vec::with_capacity(2 * items.len() / LEAF + 1);
        build(&mut nodes, &mut items, 0);
        let (corners, triangles) = items.iter().map(|item| (item.corners, item.triangle)).unzip();
        Self { nodes, corners, triangles }
    }

    /// The nearest hit farther than `beyond`.
    pub(super) fn nearest(&self, origin: DVec3, direction: DVec3, beyond: f64) -> Option<Hit> {
        let mut nearest: Option<Hit> = None;
        self.visit(origin, direction, |hit, limit| {
            if hit.t > beyond && hit.t < *limit {
                *limit = hit.t;
                nearest = Some(hit);
            }
        });
        nearest
    }

    /// Every hit in front of the origin, nearest first.
    pub(super) fn all(&self, origin: DVec3, direction: DVec3) -> Vec<Hit> {
        let mut hits = vec![];
        self.visit(origin, direction, |hit, _| {
            if hit.t > 0.0 {
                hits.push(hit);
            }
        });
        hits.sort_by(|a, b| a.t.total_cmp(&b.t).then(a.triangle.cmp(&b.triangle)));
        hits
    }

    /// Calls `take` with hits and the distance beyond which none is wanted, which it may lower.
    fn visit(&self, origin: DVec3, direction: DVec3, mut take: impl FnMut(Hit, &mut f64)) {
        let inverse = direction.recip();
        let mut limit = f64::INFINITY;
        let mut stack = Vec::with_capacity(64);
        if !self.triangles.is_empty() {
            stack.push(0);
        }
        while let Some(index) = stack.pop() {
            let Some(node) = self.nodes.get(index) else { continue };
            if !node.meets(origin, inverse, limit) {
                continue;
            }
            let start = node.start as usize;
            if node.count == 0 {
                stack.push(start);
                stack.push(index + 1);
                continue;
            }
            for i in start..start + node.count as usize {
                if let Some((t, weights, face)) = meet(&self.corners[i], origin, direction) {
                    take(Hit { t, triangle: self.triangles[i], weights, face }, &mut limit);
                }
            }
        }
    }
}

struct Item {
    low: DVec3,
    high: DVec3,
    middle: DVec3,
    corners: [DVec3; 3],
    triangle: u32,
}

/// Builds the node of some triangles, the first of which is triangle `first` of all, and everything below it.
fn build(nodes: &mut Vec<Node>, items: &mut [Item], first: usize) {
    let index = nodes.len();
    let start = u32::try_from(first).unwrap_or(u32::MAX);
    let low = items.iter().fold(DVec3::INFINITY, |low, item| low.min(item.low));
    let high = items.iter().fold(DVec3::NEG_INFINITY, |high, item| high.max(item.high));
    let cut = if items.len() <= LEAF { 0 } else { partition(items) };
    if items.len() <= LEAF {
        nodes.push(Node { low, high, start, count: u32::try_from(items.len()).unwrap_or(0) });
        return;
    }
    nodes.push(Node { low, high, start, count: 0 });
    let (left, right) = items.split_at_mut(cut);
    build(nodes, left, first);
    nodes[index].start = u32::try_from(nodes.len()).unwrap_or(u32::MAX);
    build(nodes, right, first + cut);
}

/// Orders triangles so that those before the place returned make a cheap pair of boxes with those from it on (binned surface
/// area heuristic: I. Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", 2007).
fn partition(items: &mut [Item]) -> usize {
    let low = items.iter().fold(DVec3::INFINITY, |low, item| low.min(item.middle));
    let high = items.iter().fold(DVec3::NEG_INFINITY, |high, item| high.max(item.middle));
    let extent = high - low;
    let axis = (0..3).max_by(|&a, &b| extent[a].total_cmp(&extent[b])).unwrap_or(0);
    if extent[axis] > 0.0 {
        #[expect(clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "few")]
        let bin = |item: &Item| (((item.middle[axis] - low[axis]) / extent[axis] * BINS as f64) as usize).min(BINS - 1);
        let mut bins = [(0usize, DVec3::INFINITY, DVec3::NEG_INFINITY); BINS];
        for item in items.iter() {
            let (count, low, high) = &mut bins[bin(item)];
            *count += 1;
            *low = low.min(item.low);
            *high = high.max(item.high);
        }
        #[expect(clippy::cast_precision_loss, reason = "an estimate")]
        let cost = |bins: &[(usize, DVec3, DVec3)]| {
            let mut all = (0, DVec3::INFINITY, DVec3::NEG_INFINITY);
            for (count, low, high) in bins {
                all = (all.0 + count, all.1.min(*low), all.2.max(*high));
            }
            let size = (all.2 - all.1).max(DVec3::ZERO);
            if all.0 == 0 { 0.0 } else { all.0 as f64 * (size.x * size.y + size.y * size.z + size.z * size.x) }
        };
        let best = (1..BINS).min_by(|&a, &b| {
            let [a, b] = [a, b].map(|cut| cost(&bins[..cut]) + cost(&bins[cut..]));
            a.total_cmp(&b)
        });
        let best = best.unwrap_or(BINS / 2);
        items.sort_by_key(|item| bin(item) >= best);
        let cut = items.partition_point(|item| bin(item) < best);
        if cut > 0 && cut < items.len() {
            return cut;
        }
    }
    items.len() / 2
}

impl Node {
    fn meets(&self, origin: DVec3, inverse: DVec3, limit: f64) -> bool {
        let (mut near, mut far) = (0.0_f64, limit);
        for axis in 0..3 {
            if inverse[axis].is_infinite() {
                // Along the faces, which count as inside: infinity times their distances of 0 would be no number.
                if origin[axis] < self.low[axis] || origin[axis] > self.high[axis] {
                    return false;
                }
                continue;
            }
            let a = (self.low[axis] - origin[axis]) * inverse[axis];
            let b = (self.high[axis] - origin[axis]) * inverse[axis];
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        near <= far * (1.0 + 1e-14)
    }
}

/// Where a ray meets a triangle, edges included. The edge functions of a shared edge differ in nothing but their sign, so no
/// ray slips through between two triangles.
fn meet(corners: &[DVec3; 3], origin: DVec3, direction: DVec3) -> Option<(f64, [f64; 3], DVec3)> {
    let [a, b, c] = corners.map(|corner| corner - origin);
    let edges = [b.cross(c), c.cross(a), a.cross(b)].map(|edge| edge.dot(direction));
    let inside = edges.iter().all(|&e| e >= 0.0) || edges.iter().all(|&e| e <= 0.0);
    let sum: f64 = edges.iter().sum();
    if !inside || sum == 0.0 {
        return None;
    }
    let weights = edges.map(|e| e / sum);
    let face = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    let t = (weights[0] * a + weights[1] * b + weights[2] * c).dot(direction) / direction.length_squared();
    t.is_finite().then_some((t, weights, face))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers from -1 to 1.
    fn random(state: &mut u64) -> f64 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        #[expect(clippy::cast_precision_loss, reason = "24 bits")]
        let number = (*state >> 40) as f64 / f64::from(1 << 23) - 1.0;
        number
    }

    #[test]
    fn the_hierarchy_finds_what_trying_every_triangle_finds() {
        let mesh = trixel::scene::build("tree:4").unwrap();
        let bvh = Bvh::new(&mesh);
        let mut state = 7;
        let mut found = 0;
        for aim in mesh.positions.iter().step_by(mesh.positions.len() / 300) {
            let [origin, aside] =
                [3.0, 0.1].map(|size| DVec3::from_array(std::array::from_fn(|_| size * random(&mut state))));
            // Near something, or hardly any ray would hit the twigs.
            let direction = DVec3::from_array(*aim) + aside - origin;
            let all = bvh.all(origin, direction);
            let tried: Vec<_> = mesh
                .triangles
                .iter()
                .filter_map(|t| meet(&t.map(|v| DVec3::from_array(mesh.positions[v as usize])), origin, direction))
                .filter(|hit| hit.0 > 0.0)
                .collect();
            assert_eq!(all.len(), tried.len());
            found += all.len();
            let least = tried.iter().map(|hit| hit.0).fold(f64::INFINITY, f64::min);
            let nearest = bvh.nearest(origin, direction, 0.0).map_or(f64::INFINITY, |hit| hit.t);
            assert_eq!(nearest, least);
        }
        assert!(found > 100, "{found} hits");
    }

    #[test]
    fn rays_through_edges_and_corners_hit() {
        let mesh = trixel::scene::build("cube:4").unwrap();
        let bvh = Bvh::new(&mesh);
        for (x, y) in [(0.25, 0.25), (0.3, 0.3), (0.5, 0.1), (0.125, 0.6)] {
            let hit = bvh.nearest(DVec3::new(x, y, 2.0), DVec3::NEG_Z, 0.0).unwrap();
            assert_eq!(hit.t, 1.0);
        }
        assert!(bvh.nearest(DVec3::new(1.5, 0.5, 2.0), DVec3::NEG_Z, 0.0).is_none());
    }

    #[test]
    fn many_triangles_in_one_place_do_not_exhaust_the_stack() {
        let mesh = Mesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]; 20_000]);
        assert_eq!(Bvh::new(&mesh).all(DVec3::new(0.2, 0.2, -1.0), DVec3::Z).len(), 20_000);
        assert!(Bvh::new(&Mesh::default()).nearest(DVec3::ZERO, DVec3::Z, 0.0).is_none());
    }
}
