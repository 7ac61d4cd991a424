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
        let (merged, vertices) = merge_positions(mesh);
        let mut topology = Self { vertices, ..Self::default() };
        let triangles = || mesh.triangles.iter().filter(|t| t.iter().all(|&v| (v as usize) < mesh.positions.len()));

        // Edges by their smaller vertex, in one array.
        let mut starts = vec![0usize; vertices + 1];
        let edges = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|v| merged[v as usize]);
            [(a, b), (b, c), (c, a)].into_iter().filter(|(v, w)| v != w).map(|(v, w)| (v.min(w), v.max(w)))
        };
        for (v, _) in triangles().flat_map(edges) {
            starts[v as usize + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let mut ends = vec![0u32; starts[vertices]];
        let mut next = starts.clone();
        let mut pieces = Pieces::new(vertices);
        for triangle in triangles() {
            for (v, w) in edges(triangle) {
                ends[next[v as usize]] = w;
                next[v as usize] += 1;
                pieces.join(v, w);
            }
            topology.degenerate_triangles += usize::from(is_degenerate(triangle.map(|v| mesh.positions[v as usize])));
        }
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
        topology.components = pieces.count();
        topology
    }

    /// Whether every edge has exactly two faces, so that the mesh has an inside.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.open_edges == 0 && self.non_manifold_edges == 0
    }
}

fn is_degenerate([a, b, c]: [[f64; 3]; 3]) -> bool {
    let e = |p: [f64; 3]| [p[0] - a[0], p[1] - a[1], p[2] - a[2]];
    let (u, v) = (e(b), e(c));
    (0..3).all(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        u[j] * v[k] == u[k] * v[j]
    })
}

/// For each vertex the number of its merged vertex, and how many of those there are. Unused vertices get 0.
fn merge_positions(mesh: &Mesh) -> (Vec<u32>, usize) {
    let mut used = vec![false; mesh.positions.len()];
    for &vertex in mesh.triangles.as_flattened() {
        if let Some(used) = used.get_mut(vertex as usize) {
            *used = true;
        }
    }
    // Adding 0 turns -0 into 0.
    let bits = |p: &[f64; 3]| p.map(|c| (c + 0.0).to_bits());
    let mut keys: Vec<([u64; 3], u32)> =
        (0u32..).zip(&mesh.positions).filter(|&(i, _)| used[i as usize]).map(|(i, p)| (bits(p), i)).collect();
    #[cfg(feature = "threads")]
    rayon::slice::ParallelSliceMut::par_sort_unstable(keys.as_mut_slice());
    #[cfg(not(feature = "threads"))]
    keys.sort_unstable();
    let mut merged = vec![0u32; mesh.positions.len()];
    let mut count = 0u32;
    for same in keys.chunk_by(|a, b| a.0 == b.0) {
        for &(_, vertex) in same {
            merged[vertex as usize] = count;
        }
        count += 1;
    }
    (merged, count as usize)
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

    fn join(&mut self, v: u32, w: u32) {
        let (v, w) = (self.root(v), self.root(w));
        self.0[v.max(w) as usize] = v.min(w);
    }

    fn count(&self) -> usize {
        (0u32..).zip(&self.0).filter(|&(v, &parent)| v == parent).count()
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
