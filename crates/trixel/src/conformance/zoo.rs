//! Named nasty meshes, each with the grid that makes it nasty.

use crate::grid::Grid;
use crate::mesh::Mesh;

/// A mesh, a grid, and a name for messages.
#[derive(Clone, Debug)]
pub struct Specimen {
    /// What it is and why it is nasty.
    pub name: &'static str,
    /// The mesh.
    pub mesh: Mesh,
    /// The grid.
    pub grid: Grid,
}

/// Every specimen, small enough for the oracle.
#[must_use]
pub fn all() -> Vec<Specimen> {
    let grid = |origin: [f64; 3], size: [f64; 3], dims: [u32; 3]| Grid::new(origin, size, dims).ok();
    let unit = |dims: [u32; 3]| grid([0.0; 3], [1.0; 3], dims);
    let list = [
        ("cube of 8 with every face on voxel faces", cube([4.0; 3], 8.0), unit([16, 16, 16])),
        ("cube that fills its grid, faces on the grid's own faces", cube([0.0; 3], 8.0), unit([8, 8, 8])),
        ("cube of 50 on voxel faces", cube([1.0; 3], 50.0), unit([52, 52, 52])),
        ("cube of 64, so runs end at word ends", cube([0.0; 3], 64.0), unit([65, 64, 66])),
        ("cube with faces through voxel centres", cube([2.5; 3], 5.0), unit([11, 11, 11])),
        ("unit-cube scale", cube([0.25; 3], 0.5), grid([0.0; 3], [1.0 / 48.0; 3], [48, 48, 48])),
        ("cube 1e6 from the origin of the world", cube([1e6; 3], 1.0), grid([1e6; 3], [0.1; 3], [10, 10, 10])),
        ("cube in a grid that cuts it", cube([-3.0; 3], 8.0), unit([3, 5, 70])),
        ("cube around the whole grid", cube([-100.0; 3], 200.0), unit([5, 6, 7])),
        ("cube wholly below the grid", cube([1.0, 1.0, -20.0], 3.0), unit([6, 6, 6])),
        ("cube wholly above the grid", cube([1.0, 1.0, 20.0], 3.0), unit([6, 6, 6])),
        ("cube beside the grid", cube([20.0, 1.0, 1.0], 3.0), unit([6, 6, 6])),
        (
            "plate on a voxel face",
            quad([[1.0, 1.0, 3.0], [6.0, 1.0, 3.0], [6.0, 6.0, 3.0], [1.0, 6.0, 3.0]]),
            unit([8; 3]),
        ),
        (
            "plate through centres",
            quad([[1.0, 1.0, 3.5], [6.0, 1.0, 3.5], [6.0, 6.0, 3.5], [1.0, 6.0, 3.5]]),
            unit([8; 3]),
        ),
        (
            "upright plate on a voxel face",
            quad([[3.0, 1.0, 1.0], [3.0, 6.0, 1.0], [3.0, 6.0, 6.0], [3.0, 1.0, 6.0]]),
            unit([8; 3]),
        ),
        (
            "upright plate through centres",
            quad([[3.5, 1.5, 1.5], [3.5, 6.5, 1.5], [3.5, 6.5, 6.5], [3.5, 1.5, 6.5]]),
            unit([8; 3]),
        ),
        (
            "slanted plate through centres",
            quad([[0.5, 0.5, 0.5], [7.5, 0.5, 7.5], [7.5, 7.5, 7.5], [0.5, 7.5, 0.5]]),
            unit([8; 3]),
        ),
        (
            "plate that leaves the grid",
            quad([[-9.0, -9.0, 3.3], [19.0, -9.0, 4.1], [19.0, 19.0, 5.2], [-9.0, 19.0, 2.2]]),
            unit([8; 3]),
        ),
        ("sliver", soup(&[[[0.1, 0.1, 0.1], [30.0, 29.0, 31.0], [30.0, 29.0001, 31.0]]]), unit([32; 3])),
        ("needle along z", soup(&[[[4.5, 4.5, -1.0], [4.5, 4.5, 70.0], [4.50002, 4.5, 70.0]]]), unit([9, 9, 70])),
        ("needle along x", soup(&[[[-1.0, 4.5, 4.5], [70.0, 4.5, 4.5], [70.0, 4.50002, 4.5]]]), unit([70, 9, 9])),
        ("zero area: segments and points", degenerates(), unit([10; 3])),
        ("duplicate face", soup(&[SLANTED, SLANTED, SLANTED]), unit([10; 3])),
        ("duplicate face, opposite way round", soup(&[SLANTED, [SLANTED[1], SLANTED[0], SLANTED[2]]]), unit([10; 3])),
        ("T-junction", t_junction(), unit([10; 3])),
        ("inverted shell", inverted(cube([1.0; 3], 6.0)), unit([8; 3])),
        (
            "nested shells",
            merged(&[cube([1.0; 3], 14.0), inverted(cube([4.0; 3], 8.0)), cube([6.0; 3], 4.0)]),
            unit([16; 3]),
        ),
        ("height field whose vertices lie on ray lines", terrain(12), unit([13, 13, 9])),
        ("octahedron with corners on ray lines", octahedron([6.5; 3], 6.0), unit([13; 3])),
        ("octahedron with corners on voxel corners", octahedron([6.0; 3], 6.0), unit([12; 3])),
        ("octahedron in flat voxels", octahedron([6.0; 3], 6.0), grid([0.0; 3], [0.25, 1.0, 3.0], [48, 12, 4])),
        (
            "few huge triangles",
            soup(&[[[-500.0, -400.0, -300.0], [900.0, 100.0, 50.0], [-100.0, 800.0, 60.5]]]),
            unit([40, 33, 29]),
        ),
        (
            "huge triangle with far corners",
            soup(&[[[-9e6, -8e6, -7e6], [9e6, 1e6, 8e6], [-1e6, 9e6, 1.0]]]),
            unit([21, 22, 23]),
        ),
        (
            "huge triangle almost along z",
            soup(&[[[-9e6, 5.4, -9e6], [9e6, 5.6, -9e6], [0.0, 5.5, 9e6]]]),
            unit([21, 22, 23]),
        ),
        ("one voxel", octahedron([0.5; 3], 0.4), unit([1, 1, 1])),
        ("flat grid", terrain(12), unit([13, 13, 1])),
        ("column of many words", octahedron([2.0, 2.0, 100.0], 2.0), unit([4, 4, 200])),
        ("many tiny triangles", tiny(20_000), unit([16; 3])),
    ];
    list.into_iter().filter_map(|(name, mesh, grid)| Some(Specimen { name, mesh, grid: grid? })).collect()
}

const SLANTED: [[f64; 3]; 3] = [[1.2, 2.3, 3.4], [8.7, 3.1, 5.5], [4.4, 8.8, 6.6]];

/// Separate triangles.
#[must_use]
pub fn soup(triangles: &[[[f64; 3]; 3]]) -> Mesh {
    let positions = triangles.as_flattened().to_vec();
    let indices = (0..).step_by(3).take(triangles.len()).map(|i| [i, i + 1, i + 2]).collect();
    Mesh::new(positions, indices)
}

/// Two triangles.
#[must_use]
pub fn quad(corners: [[f64; 3]; 4]) -> Mesh {
    Mesh::new(corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]])
}

/// A closed axis-aligned cube, faces outwards.
#[must_use]
pub fn cube(low: [f64; 3], edge: f64) -> Mesh {
    let corner = |i: u32| [0, 1, 2].map(|a| low[a] + f64::from(i >> a & 1) * edge);
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    Mesh::new((0..8).map(corner).collect(), triangles)
}

/// A closed octahedron, faces outwards.
#[must_use]
pub fn octahedron(centre: [f64; 3], radius: f64) -> Mesh {
    let tip = |i: usize| {
        let mut p = centre;
        p[i / 2] += if i.is_multiple_of(2) { radius } else { -radius };
        p
    };
    let faces = vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    Mesh::new((0..6).map(tip).collect(), faces)
}

/// The same faces the other way round.
#[must_use]
pub fn inverted(mut mesh: Mesh) -> Mesh {
    for triangle in &mut mesh.triangles {
        triangle.swap(1, 2);
    }
    mesh
}

/// Several meshes as one.
#[must_use]
pub fn merged(meshes: &[Mesh]) -> Mesh {
    let mut all = Mesh::default();
    for mesh in meshes {
        let base = u32::try_from(all.positions.len()).unwrap_or(u32::MAX);
        all.positions.extend_from_slice(&mesh.positions);
        all.triangles.extend(mesh.triangles.iter().map(|t| t.map(|v| v + base)));
    }
    all
}

/// A height field over whole and half coordinates: rays through voxel centres meet vertices and edges.
#[must_use]
pub fn terrain(n: u32) -> Mesh {
    let height = |x: u32, y: u32| f64::from((x * 7 + y * 13 + x * y * 3) % 17) * 0.5;
    let positions =
        (0..=n).flat_map(|x| (0..=n).map(move |y| [f64::from(x) + 0.5, f64::from(y) + 0.5, height(x, y)])).collect();
    let triangles = (0..n)
        .flat_map(|x| (0..n).map(move |y| x * (n + 1) + y))
        .flat_map(|i| [[i, i + n + 1, i + n + 2], [i, i + n + 2, i + 1]])
        .collect();
    Mesh::new(positions, triangles)
}

fn degenerates() -> Mesh {
    soup(&[
        [[1.0, 1.0, 1.0]; 3],
        [[2.5, 2.5, 2.5]; 3],
        [[3.5, 3.0, 3.5]; 3],
        [[1.0, 1.0, 1.0], [8.0, 8.0, 8.0], [4.5, 4.5, 4.5]],
        [[1.0, 8.0, 3.0], [8.0, 8.0, 3.0], [1.0, 8.0, 3.0]],
        [[0.5, 8.5, 0.5], [8.5, 0.5, 4.5], [4.5, 4.5, 2.5]],
        [[9.25, 9.25, 1.0], [9.25, 9.25, 1.0], [9.25, 9.25, 9.0]],
    ])
}

fn t_junction() -> Mesh {
    soup(&[
        [[1.0, 1.0, 1.0], [9.0, 1.0, 1.0], [5.0, 9.0, 4.0]],
        [[1.0, 1.0, 1.0], [5.0, 1.0, 1.0], [3.0, 1.0, 8.0]],
        [[5.0, 1.0, 1.0], [9.0, 1.0, 1.0], [7.0, 1.0, 8.0]],
    ])
}

/// Triangles much smaller than a voxel, all over a cube of 16.
#[must_use]
pub fn tiny(count: usize) -> Mesh {
    let mut random = super::random::Random::new(7);
    let mut coordinate = |low: i64, high: i64| {
        #[expect(clippy::cast_precision_loss, reason = "lattice steps of a small cube")]
        let steps = random.range(low, high) as f64;
        steps / f64::from(crate::lattice::STEPS_PER_VOXEL)
    };
    let triangles: Vec<[[f64; 3]; 3]> = (0..count)
        .map(|_| {
            let at = [0, 1, 2].map(|_| coordinate(0, 16 << 16));
            [0, 1, 2].map(|_| [0, 1, 2].map(|axis| at[axis] + coordinate(-3000, 3000)))
        })
        .collect();
    soup(&triangles)
}
