//! Whether a mesh is closed: edges counted over vertices merged by position.

use crate::mesh::Mesh;

/// What the edges and faces of a mesh say about it.
///
/// Vertices with bit-identical positions (and `-0 = 0`) count as one, as files that split vertices at seams require.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Topology {
    /// Positions that triangles use, merged.
    pub vertices: usize,
    /// Edges between merged vertices.
    pub edges: usize,
    /// Edges with one face: the border of a hole.
    pub open_edges: usize,
    /// Edges with three or more faces.
    pub non_manifold_edges: usize,
    /// Triangles without area: corners that coincide or lie on one line, as f64 arithmetic sees it.
    pub degenerate_triangles: usize,
    /// Connected pieces, over merged vertices.
    pub components: usize,
}

impl Topology {
    /// Counts edges and faces of `mesh`. Triangles with an index out of range are left out.
    #[must_use]
    pub fn of(mesh: &Mesh) -> Self {
        let (degenerate_triangles, topology) = both(|| degenerate_triangles(mesh), || Self::of_edges(mesh));
        Self { degenerate_triangles, ..topology }
    }

    /// All but the triangles without area.
    fn of_edges(mesh: &Mesh) -> Self {
        let (triangles, vertices) = numbered_as_met(mesh);
        let mut topology = Self { vertices, ..Self::default() };
        // Edges by their smaller vertex, in one array.
        let edges = |&[a, b, c]: &[u32; 3]| {
            [(a, b), (b, c), (c, a)].into_iter().filter(|(v, w)| v != w).map(|(v, w)| (v.min(w), v.max(w)))
        };
        let mut starts = vec![0usize; vertices + 1];
        for (v, _) in triangles.iter().flat_map(edges) {
            starts[v as usize + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let mut ends = vec![0u32; starts[vertices]];
        let mut next = starts.clone();
        let mut joined = 0;
        let mut pieces = Pieces::new(vertices);
        for (v, w) in triangles.iter().flat_map(edges) {
            ends[next[v as usize]] = w;
            next[v as usize] += 1;
            joined += usize::from(pieces.join(v, w));
        }
        topology.components = vertices - joined;
        for v in 0..vertices {
            let ends = &mut ends[starts[v]..starts[v + 1]];
            ends.sort_unstable();
            for same in ends.chunk_by(|a, b| a == b) {
                topology.edges += 1;
                match same.len() {
                    1 => topology.open_edges += 1,
                    2 => {}
                    _ => topology.non_manifold_edges += 1,
                }
            }
        }
        topology
    }

    /// Whether every edge has exactly two faces, so that the mesh has an inside.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.open_edges == 0 && self.non_manifold_edges == 0
    }
}

/// Does both, at once where there are threads.
#[cfg(feature = "threads")]
fn both<A: Send, B: Send>(a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
    rayon::join(a, b)
}

#[cfg(not(feature = "threads"))]
fn both<A, B>(a: impl FnOnce() -> A, b: impl FnOnce() -> B) -> (A, B) {
    (a(), b())
}

/// The triangles without an index out of range.
fn whole_triangles(mesh: &Mesh) -> impl Iterator<Item = [u32; 3]> {
    mesh.triangles.iter().copied().filter(|t| t.iter().all(|&v| (v as usize) < mesh.positions.len()))
}

fn degenerate_triangles(mesh: &Mesh) -> usize {
    whole_triangles(mesh).filter(|t| is_degenerate(t.map(|v| mesh.positions[v as usize]))).count()
}

fn is_degenerate([a, b, c]: [[f64; 3]; 3]) -> bool {
    let e = |p: [f64; 3]| [p[0] - a[0], p[1] - a[1], p[2] - a[2]];
    let (u, v) = (e(b), e(c));
    (0..3).all(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        u[j] * v[k] == u[k] * v[j]
    })
}

/// The triangles with merged vertices, numbered as they are first met, and how many of those there are. Triangles that follow
/// each other are mostly neighbours, whatever the order of the file's vertices: what is looked up by such numbers is in the
/// cache.
fn numbered_as_met(mesh: &Mesh) -> (Vec<[u32; 3]>, usize) {
    const NONE: u32 = u32::MAX;
    let merged = merge_positions(mesh);
    let mut numbers = vec![NONE; merged.len()];
    let mut count = 0;
    let mut number = |vertex: u32| {
        let vertex = vertex as usize;
        // Most were met before, and need no second look-up.
        if numbers[vertex] == NONE {
            let first = merged[vertex] as usize;
            if numbers[first] == NONE {
                numbers[first] = count;
                count += 1;
            }
            numbers[vertex] = numbers[first];
        }
        numbers[vertex]
    };
    let triangles = whole_triangles(mesh).map(|triangle| triangle.map(&mut number)).collect();
    (triangles, count as usize)
}

/// For each vertex the first one at its position.
fn merge_positions(mesh: &Mesh) -> Vec<u32> {
    // Adding 0 turns -0 into 0.
    let bits = |vertex: u32| mesh.positions[vertex as usize].map(|c| (c + 0.0).to_bits());
    let mut merged: Vec<u32> = (0u32..).take(mesh.positions.len()).collect();
    let mut keys: Vec<(u64, u32)> = merged.iter().map(|&vertex| (hash(bits(vertex)), vertex)).collect();
    #[cfg(feature = "threads")]
    rayon::slice::ParallelSliceMut::par_sort_unstable(keys.as_mut_slice());
    #[cfg(not(feature = "threads"))]
    keys.sort_unstable();
    for same_hash in keys.chunk_by_mut(|a, b| a.0 == b.0).filter(|same| same.len() > 1) {
        // Different positions with one hash are hardly ever there.
        same_hash.sort_unstable_by_key(|&(_, vertex)| (bits(vertex), vertex));
        for same in same_hash.chunk_by(|a, b| bits(a.1) == bits(b.1)) {
            for &(_, vertex) in same {
                merged[vertex as usize] = same[0].1;
            }
        }
    }
    merged
}

/// Numbers that differ for nearly all positions.
fn hash(bits: [u64; 3]) -> u64 {
    // 2^64 over the golden ratio.
    const MULTIPLIER: u64 = 0x9e37_79b9_7f4a_7c15;
    bits.iter().fold(0u64, |hash, bits| (hash.rotate_left(23) ^ bits).wrapping_mul(MULTIPLIER).rotate_right(32))
}

/// Union-find with path halving.
struct Pieces(Vec<u32>);

impl Pieces {
    fn new(vertices: usize) -> Self {
        Self((0u32..).take(vertices).collect())
    }

    fn root(&mut self, mut v: u32) -> u32 {
        while self.0[v as usize] != v {
            self.0[v as usize] = self.0[self.0[v as usize] as usize];
            v = self.0[v as usize];
        }
        v
    }

    /// Whether they were in different pieces.
    fn join(&mut self, v: u32, w: u32) -> bool {
        let (v, w) = (self.root(v), self.root(w));
        self.0[v.max(w) as usize] = v.min(w);
        v != w
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conformance::zoo;

    #[test]
    fn a_cube_is_closed() {
        let topology = Topology::of(&zoo::cube([0.0; 3], 1.0));
        assert_eq!(topology, Topology { vertices: 8, edges: 18, components: 1, ..Topology::default() });
        assert!(topology.is_closed());
    }

    #[test]
    fn split_vertices_are_merged() {
        let cube = zoo::cube([-0.0; 3], 1.0);
        let corners: Vec<_> = cube.triangles.iter().map(|t| t.map(|v| cube.positions[v as usize])).collect();
        assert_eq!(Topology::of(&zoo::soup(&corners)), Topology::of(&cube));
    }

    #[test]
    fn holes_fins_and_degenerates_are_counted() {
        let mut cube = zoo::cube([0.0; 3], 1.0);
        cube.triangles.pop();
        assert_eq!(Topology::of(&cube).open_edges, 3);
        cube.triangles.extend([cube.triangles[0], [0, 0, 1], [3, 3, 3]]);
        let topology = Topology::of(&cube);
        // The doubled face, and edge (0, 1), which [0, 0, 1] meets twice.
        assert_eq!((topology.non_manifold_edges, topology.degenerate_triangles), (4, 2));
        assert!(!topology.is_closed());
    }

    #[test]
    fn bodies_are_counted() {
        let two = zoo::merged(&[zoo::cube([0.0; 3], 1.0), zoo::cube([5.0; 3], 1.0)]);
        assert_eq!(Topology::of(&two).components, 2);
        assert_eq!(Topology::of(&Mesh::default()), Topology::default());
    }
}
