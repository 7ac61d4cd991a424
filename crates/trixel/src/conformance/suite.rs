//! The checks, each a function of a backend. They panic with what differs.

#![expect(clippy::panic, reason = "these are test bodies")]

use super::random::{self, Placement, Random};
use super::{oracle, zoo};
use crate::backend::{Backend, Error};
use crate::grid::Grid;
use crate::job::Job;
use crate::lattice::{LatticeMesh, STEPS_PER_VOXEL};
use crate::mesh::Mesh;
use crate::mode::Mode;
use crate::volume::Volume;

/// Runs a job on a backend, into a volume that holds rubbish before.
///
/// # Panics
/// When the backend refuses.
#[must_use]
pub fn run(backend: &dyn Backend, mesh: &Mesh, job: &Job) -> Volume {
    let volume = LatticeMesh::snap(mesh, job.grid()).map_err(Error::from).and_then(|lattice| {
        let mut volume = Volume::new(*job.grid())?;
        backend.voxelize(&lattice, job, &mut volume)?;
        Ok(volume)
    });
    match volume {
        Ok(volume) => volume,
        Err(error) => panic!("{} backend: {error}", backend.name()),
    }
}

/// Compares a backend with the oracle on one mesh.
///
/// # Panics
/// When a voxel differs; the message names the first few.
pub fn compare(backend: &dyn Backend, what: &str, mesh: &Mesh, job: &Job) {
    let got = run(backend, mesh, job);
    let expected = match LatticeMesh::snap(mesh, job.grid()) {
        Ok(lattice) => oracle::voxelize(&lattice, job),
        Err(error) => panic!("{what}: {error}"),
    };
    let Ok(expected) = expected else { panic!("{what}: no memory for the oracle") };
    assert_same(&format!("{} backend, {}, {what}", backend.name(), job.mode()), &got, &expected);
}

/// Asserts that two volumes hold the same voxels.
///
/// # Panics
/// When they do not; the message names the first few.
pub fn assert_same(what: &str, got: &Volume, expected: &Volume) {
    if got == expected {
        return;
    }
    let missing: Vec<_> = expected.iter().filter(|&voxel| !got.get(voxel)).collect();
    let extra: Vec<_> = got.iter().filter(|&voxel| !expected.get(voxel)).collect();
    let first = |voxels: &[[u32; 3]]| voxels.iter().take(4).copied().collect::<Vec<_>>();
    panic!(
        "{what}: {} missing, first {:?}; {} extra, first {:?}; {} expected",
        missing.len(),
        first(&missing),
        extra.len(),
        first(&extra),
        expected.count()
    );
}

fn unit_grid(dims: [u32; 3]) -> Grid {
    grid([0.0; 3], [1.0; 3], dims)
}

fn grid(origin: [f64; 3], voxel_size: [f64; 3], dims: [u32; 3]) -> Grid {
    match Grid::new(origin, voxel_size, dims) {
        Ok(grid) => grid,
        Err(error) => panic!("{error}"),
    }
}

/// A mesh of lattice triangles; every lattice coordinate is exact in the grid of unit voxels at the origin.
#[must_use]
pub fn lattice_mesh(triangles: &[[[i64; 3]; 3]]) -> Mesh {
    #[expect(clippy::cast_precision_loss, reason = "lattice coordinates are below 2^41")]
    let steps = |c: i64| c as f64 / f64::from(STEPS_PER_VOXEL);
    zoo::soup(&triangles.iter().map(|t| t.map(|v| v.map(steps))).collect::<Vec<_>>())
}

fn zoo_in(backend: &dyn Backend, mode: Mode) {
    for specimen in zoo::all() {
        compare(backend, specimen.name, &specimen.mesh, &Job::new(specimen.grid, mode));
    }
}

/// The zoo, conservative.
pub fn zoo_conservative(backend: &dyn Backend) {
    zoo_in(backend, Mode::Conservative);
}

/// The zoo, thin.
pub fn zoo_thin(backend: &dyn Backend) {
    zoo_in(backend, Mode::Thin);
}

/// The zoo, solid.
pub fn zoo_solid(backend: &dyn Backend) {
    zoo_in(backend, Mode::Solid);
}

/// The zoo, sliced.
pub fn zoo_sliced(backend: &dyn Backend) {
    zoo_in(backend, Mode::Sliced);
}

/// Random triangles, one at a time, so that none hides behind another.
fn random(backend: &dyn Backend, seed: u64, rounds: u32, placements: &[Placement], dims: [u32; 3], extents: &[i64]) {
    let grid = unit_grid(dims);
    let top = i64::from(dims.into_iter().max().unwrap_or(1));
    let mut random = Random::new(seed);
    for round in 0..rounds {
        for &placement in placements {
            for &extent in extents {
                let triangle = random::triangle(&mut random, placement, -extent / 2, top - extent / 2, extent);
                let mesh = lattice_mesh(&[triangle]);
                for &mode in backend.modes() {
                    compare(
                        backend,
                        &format!("round {round}, {placement:?} {triangle:?}"),
                        &mesh,
                        &Job::new(grid, mode),
                    );
                }
            }
        }
    }
}

/// Small triangles in every placement.
pub fn random_small(backend: &dyn Backend) {
    random(backend, 1, 400, &Placement::ALL, [6, 7, 5], &[1, 2, 4]);
}

/// Triangles whose corners tie with faces, edges, corners and centres.
pub fn random_on_lattice(backend: &dyn Backend) {
    use Placement::{HalfVoxels, InAxisPlane, NearQuarters};
    random(backend, 2, 150, &[HalfVoxels, NearQuarters, InAxisPlane], [9, 8, 70], &[3, 9]);
}

/// Segments and points.
pub fn random_degenerate(backend: &dyn Backend) {
    random(backend, 3, 500, &[Placement::Degenerate], [8, 9, 10], &[1, 5, 12]);
}

/// Triangles around the size where 64 bits stop sufficing, and far larger.
pub fn random_large(backend: &dyn Backend) {
    random(backend, 4, 12, &Placement::ALL, [24, 20, 28], &[60, 64, 66, 300, 5000, 1_000_000]);
}

/// Few triangles, up to the size where 32-bit halves stop sufficing.
pub fn random_huge(backend: &dyn Backend) {
    random(backend, 9, 2, &Placement::ALL, [24, 20, 28], &[300, 5000, 8191, 10_000]);
}

/// Triangles many times as long along x or y as along the other axes, through grids that are long too: rows of many columns.
pub fn random_elongated(backend: &dyn Backend) {
    const SIDE: i64 = 9;
    let mut random = Random::new(12);
    for (axis, dims) in [(0, [150, 9, 14]), (1, [9, 150, 14])] {
        let grid = unit_grid(dims);
        for stretch in [16, 1000, 200_000] {
            for placement in Placement::ALL.into_iter().cycle().take(6 * Placement::ALL.len()) {
                let mut triangle = random::triangle(&mut random, placement, -SIDE / 2, SIDE / 2, SIDE);
                for corner in &mut triangle {
                    corner[axis] *= stretch;
                }
                for &mode in backend.modes() {
                    let job = Job::new(grid, mode);
                    compare(backend, &format!("{placement:?} {triangle:?}"), &lattice_mesh(&[triangle]), &job);
                }
            }
        }
    }
}

/// Thousands of triangles, each alone in a cell of one grid, so that none hides behind another; the outermost cells are
/// cut by the grid's border.
pub fn random_in_cells(backend: &dyn Backend) {
    in_cells(backend, &[]);
}

/// The same in a mesh whose other corners are so far away that lattice coordinates need more than 32 bits.
pub fn random_in_cells_beside_far(backend: &dyn Backend) {
    const FAR: i64 = 1_000_000 << 16;
    in_cells(backend, &[[[FAR, FAR, 0], [FAR, FAR, FAR], [2 * FAR, FAR, FAR]]]);
}

fn in_cells(backend: &dyn Backend, others: &[[[i64; 3]; 3]]) {
    let mut random = Random::new(7);
    for (extent, along) in [(1, 12), (2, 12), (4, 10), (9, 8), (70, 2), (150, 1)] {
        for placement in Placement::ALL {
            // Room for a triangle that starts anywhere in the middle voxel, and for half a slice of overlap.
            let pitch = 2 * extent + 5;
            let triangles: Vec<_> = (0..along * along * along)
                .map(|cell| {
                    let at = [cell / along / along, cell / along % along, cell % along].map(|c| (c * pitch) << 16);
                    let corners = random::triangle(&mut random, placement, 0, 1, extent);
                    corners.map(|corner| std::array::from_fn(|axis| corner[axis] + at[axis]))
                })
                .chain(others.iter().copied())
                .collect();
            let side = u32::try_from((along - 1) * pitch + extent / 2).unwrap_or(1);
            let cells = grid([1.0; 3], [1.0; 3], [side, side + 3, side - 1]);
            let mesh = lattice_mesh(&triangles);
            for &mode in backend.modes() {
                let job = Job::new(cells, mode);
                let job = if mode == Mode::Sliced { job.with_overlap(0.5) } else { Ok(job) };
                match job {
                    Ok(job) => compare(backend, &format!("{placement:?}, up to {extent} voxels"), &mesh, &job),
                    Err(error) => panic!("{error}"),
                }
            }
        }
    }
}

/// Triangles mostly outside the grid.
pub fn random_far_outside(backend: &dyn Backend) {
    let mut random = Random::new(5);
    let grid = unit_grid([10, 11, 12]);
    for round in 0..300 {
        let triangle = random::triangle(&mut random, Placement::Anywhere, -40, 40, 30);
        for &mode in backend.modes() {
            compare(backend, &format!("round {round} {triangle:?}"), &lattice_mesh(&[triangle]), &Job::new(grid, mode));
        }
    }
}

/// Slices with overlaps from one lattice step to many voxels.
pub fn sliced_overlap(backend: &dyn Backend) {
    let mut random = Random::new(6);
    let grid = unit_grid([8, 8, 20]);
    for overlap in [1.0 / 65536.0, 0.25, 0.5, 1.0, 1.75, 2.0, 3.5, 1024.0] {
        for placement in Placement::ALL {
            for round in 0..20 {
                let extent = if round % 2 == 0 { 8 } else { 60 };
                let triangle = random::triangle(&mut random, placement, -extent / 2, 12, extent);
                let job = match Job::new(grid, Mode::Sliced).with_overlap(overlap) {
                    Ok(job) => job,
                    Err(error) => panic!("{error}"),
                };
                compare(backend, &format!("overlap {overlap} {triangle:?}"), &lattice_mesh(&[triangle]), &job);
            }
        }
    }
}

/// Many triangles at once in every mode: runs, toggles and threads must not disturb each other.
pub fn solid_closed_soup(backend: &dyn Backend) {
    let mut random = Random::new(8);
    let triangles: Vec<_> =
        (0..3000).map(|i| random::triangle(&mut random, Placement::ALL[i % 5], -4, 60, [1, 3, 9, 40][i % 4])).collect();
    let mesh = lattice_mesh(&triangles);
    for &mode in backend.modes() {
        compare(backend, "soup", &mesh, &Job::new(unit_grid([61, 50, 67]), mode));
    }
}

/// The largest index along each axis: lattice coordinates reach 2^31.
pub fn huge_dims(backend: &dyn Backend) {
    let far = f64::from(Grid::MAX_DIM);
    for axis in 0..3 {
        let mut dims = [2, 3, 4];
        dims[axis] = Grid::MAX_DIM;
        let mut centre = [1.0, 1.5, 2.0];
        centre[axis] = far - 2.0;
        let near = zoo::octahedron([1.0, 1.5, 2.0], 1.2);
        let mesh = zoo::merged(&[near, zoo::octahedron(centre, 2.0)]);
        for &mode in backend.modes() {
            compare(backend, "octahedra at both ends", &mesh, &Job::new(unit_grid(dims), mode));
        }
    }
}

/// A volume that held other voxels before holds only the new ones after.
pub fn grid_is_overwritten(backend: &dyn Backend) {
    let mesh = zoo::octahedron([6.5; 3], 5.0);
    for &mode in backend.modes() {
        let job = Job::new(unit_grid([13, 13, 13]), mode);
        let Ok(lattice) = LatticeMesh::snap(&mesh, job.grid()) else { panic!("snap") };
        let Ok(mut volume) = Volume::new(*job.grid()) else { panic!("volume") };
        volume.words_mut().fill(0x1555);
        assert!(backend.voxelize(&lattice, &job, &mut volume).is_ok());
        assert_same("overwritten", &volume, &run(backend, &mesh, &job));
    }
}

/// A volume of another grid is refused, not misread.
pub fn other_grid_is_refused(backend: &dyn Backend) {
    let mesh = zoo::cube([0.0; 3], 2.0);
    let job = Job::new(unit_grid([4, 4, 4]), Mode::Conservative);
    let Ok(lattice) = LatticeMesh::snap(&mesh, job.grid()) else { panic!("snap") };
    let Ok(mut volume) = Volume::new(unit_grid([4, 4, 5])) else { panic!("volume") };
    assert_eq!(backend.voxelize(&lattice, &job, &mut volume), Err(Error::GridMismatch));
}

/// cuda_voxelizer issue 64: a solid axis-aligned cube of 8 came out 8 x 8 x 7.
pub fn rival_cuda_voxelizer_64_aligned_cube(backend: &dyn Backend) {
    for edge in [8, 50, 64] {
        let size = f64::from(edge);
        let volume = run(backend, &zoo::cube([0.0; 3], size), &Job::new(unit_grid([edge; 3]), Mode::Solid));
        assert_eq!(volume.count(), u64::from(edge).pow(3));
    }
}

/// FluidX3D pull request 323: terrain whose vertices lie on the rays lost columns.
pub fn rival_fluidx3d_323_lattice_terrain(backend: &dyn Backend) {
    let n = 24;
    let mut mesh = zoo::terrain(n);
    // Close it below with skirts and a floor, so that each column has exactly one run down to z = -1.
    let top = mesh.triangles.clone();
    let offset = u32::try_from(mesh.positions.len()).unwrap_or(0);
    let floor: Vec<_> = mesh.positions.iter().map(|p| [p[0], p[1], -1.0]).collect();
    mesh.positions.extend(floor);
    mesh.triangles.extend(top.iter().map(|&[a, b, c]| [a + offset, c + offset, b + offset]));
    for i in 0..n {
        let side = |a: u32, b: u32| [[a, b, b + offset], [a, b + offset, a + offset]];
        let row = n + 1;
        for (a, b) in
            [(i, i + 1), (n * row + i, n * row + i + 1), (i * row, (i + 1) * row), (i * row + n, (i + 1) * row + n)]
        {
            mesh.triangles.extend(side(a, b));
        }
    }
    let grid = grid([0.0, 0.0, -2.0], [1.0; 3], [n + 2, n + 2, 12]);
    compare(backend, "lattice terrain", &mesh, &Job::new(grid, Mode::Solid));
    let volume = run(backend, &mesh, &Job::new(grid, Mode::Solid));
    for x in 0..n {
        for y in 0..n {
            let runs = (0..11).filter(|&z| volume.get([x, y, z]) != volume.get([x, y, z + 1])).count();
            assert_eq!(runs, 2, "column ({x}, {y}) is not one run");
        }
    }
}

/// Open3D issue 6111: only the edges of a triangle were tested, its interior missed.
pub fn rival_open3d_6111_interior(backend: &dyn Backend) {
    let mesh = zoo::soup(&[[[0.0, 0.0, 5.5], [40.0, 0.0, 5.5], [0.0, 40.0, 5.5]]]);
    let volume = run(backend, &mesh, &Job::new(unit_grid([40, 40, 11]), Mode::Conservative));
    assert!(volume.get([10, 10, 5]) && volume.get([19, 19, 5]) && !volume.get([30, 30, 5]));
    assert_eq!(volume.count(), (0..40).map(|x: u64| (41 - x).min(40)).sum::<u64>());
}

/// VoxSurf issue 10: a cube with its faces on voxel faces lost faces. The closed set has two layers at each face.
pub fn rival_voxsurf_10_cube(backend: &dyn Backend) {
    let volume = run(backend, &zoo::cube([2.0; 3], 4.0), &Job::new(unit_grid([8, 8, 8]), Mode::Conservative));
    assert_eq!(volume.count(), 6 * 6 * 6 - 2 * 2 * 2);
}

/// cinolib issue 189: faces exactly on voxel planes. PEERS counts 49,168 voxels for such a cube at 128.
pub fn rival_cinolib_189_faces_on_planes(backend: &dyn Backend) {
    // 64 voxels inside a grid of 128: two layers at each of the six faces.
    let volume = run(backend, &zoo::cube([32.0; 3], 64.0), &Job::new(unit_grid([128; 3]), Mode::Conservative));
    assert_eq!(volume.count(), 66u64.pow(3) - 62u64.pow(3));
}

/// cuda_voxelizer issue 10: 32-bit voxel indices broke above 1024.
pub fn rival_cuda_voxelizer_10_beyond_1024(backend: &dyn Backend) {
    // 2^33 voxels would be needed to overflow 32-bit indices in bits; 2^21 columns of 2^11 overflow them in voxels.
    let dims = [1500, 1500, 2000];
    let mesh = zoo::cube([1490.25, 1490.25, 1980.25], 8.5);
    let volume = run(backend, &mesh, &Job::new(unit_grid(dims), Mode::Conservative));
    assert_eq!(volume.count(), 9u64.pow(3) - 7u64.pow(3));
    assert!(volume.get([1490, 1490, 1980]) && volume.get([1498, 1498, 1988]));
}

/// trimesh subdivides and samples points, missing 6.9 to 10.4 % of the touched voxels.
pub fn rival_trimesh_subdivision_misses(backend: &dyn Backend) {
    compare(
        backend,
        "octahedron grazing corners",
        &zoo::octahedron([20.0; 3], 19.999),
        &Job::new(unit_grid([40; 3]), Mode::Conservative),
    );
}

/// cuda_voxelizer issue 59: strides were wrong for unequal dimensions.
pub fn rival_cuda_voxelizer_59_unequal_dims(backend: &dyn Backend) {
    let mesh = zoo::octahedron([9.0, 20.0, 35.0], 9.0);
    for &mode in backend.modes() {
        compare(backend, "unequal dims", &mesh, &Job::new(unit_grid([18, 41, 67]), mode));
    }
}

/// OpenVDB issue 151: anisotropic voxels gave wrong results.
pub fn rival_openvdb_151_anisotropic(backend: &dyn Backend) {
    let mesh = zoo::octahedron([0.0; 3], 1.0);
    for &mode in backend.modes() {
        let grid = grid([-1.0, -1.1, -1.2], [0.1, 0.05, 0.3], [20, 44, 8]);
        compare(backend, "anisotropic", &mesh, &Job::new(grid, mode));
    }
}

/// OpenVDB issue 111: nested shells were filled.
pub fn rival_openvdb_111_nested_shells(backend: &dyn Backend) {
    let mesh = zoo::merged(&[zoo::cube([1.0; 3], 10.0), zoo::cube([3.0; 3], 6.0)]);
    let volume = run(backend, &mesh, &Job::new(unit_grid([12; 3]), Mode::Solid));
    assert_eq!(volume.count(), 10u64.pow(3) - 6u64.pow(3));
}
