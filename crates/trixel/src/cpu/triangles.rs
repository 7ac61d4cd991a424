//! Which triangles the kernel is to go through, and their corners.

use crate::lattice::{LatticeMesh, LatticePositions};

/// Some triangles of a mesh, one after the other.
#[derive(Clone, Copy)]
pub(super) struct Selected<'a> {
    pub(super) mesh: &'a LatticeMesh<'a>,
    /// The triangles, or `None` for all.
    pub(super) indices: Option<&'a [u32]>,
}

impl Selected<'_> {
    /// Calls `each` with the corners of every triangle.
    #[inline(always)]
    pub(super) fn for_each(&self, mut each: impl FnMut(&[[i64; 3]; 3])) {
        let count = self.indices.map_or(self.mesh.triangles.len(), <[u32]>::len);
        // One loop for both, because `each` is a whole kernel.
        for i in 0..count {
            let triangle = self.indices.map_or(i, |indices| indices[i] as usize);
            each(&corners(self.mesh, self.mesh.triangles[triangle]));
        }
    }
}

/// The corners of a triangle.
#[inline(always)]
pub(super) fn corners(mesh: &LatticeMesh<'_>, [a, b, c]: [u32; 3]) -> [[i64; 3]; 3] {
    let corner = |vertex: u32| match &mesh.positions {
        LatticePositions::Narrow(positions) => {
            let [x, y, z] = positions[vertex as usize];
            [i64::from(x), i64::from(y), i64::from(z)]
        }
        LatticePositions::Wide(positions) => positions[vertex as usize],
    };
    [corner(a), corner(b), corner(c)]
}
