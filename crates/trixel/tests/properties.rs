//! What must hold for any mesh: invariances, inclusions, separation, and volumes that converge.

#![expect(clippy::unwrap_used, reason = "a failure here is a failed test")]

use proptest::prelude::*;
use trixel::conformance::suite::lattice_mesh;
use trixel::conformance::zoo;
use trixel::{Backend, CpuBackend, Grid, Job, Mesh, Mode, Volume, lattice::LatticeMesh};

const STEPS: i64 = 1 << 16;
const DIMS: [u32; 3] = [13, 11, 17];

fn voxelize(mesh: &Mesh, grid: Grid, mode: Mode) -> Volume {
    trixel::voxelize(mesh, &Job::new(grid, mode)).unwrap()
}

fn unit_grid(dims: [u32; 3]) -> Grid {
    Grid::new([0.0; 3], [1.0; 3], dims).unwrap()
}

/// Lattice coordinates that are often on a voxel face or centre, or one step beside.
fn coordinate() -> impl Strategy<Value = i64> {
    prop_oneof![
        -3 * STEPS..20 * STEPS,
        (-6i64..40).prop_map(|halves| halves * STEPS / 2),
        (-6i64..40, -1i64..=1).prop_map(|(halves, off)| halves * STEPS / 2 + off),
    ]
}

fn triangle() -> impl Strategy<Value = [[i64; 3]; 3]> {
    prop::array::uniform3(prop::array::uniform3(coordinate()))
}

fn soup() -> impl Strategy<Value = Vec<[[i64; 3]; 3]>> {
    prop::collection::vec(triangle(), 1..12)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(400) })]

    #[test]
    fn order_and_orientation_change_nothing(triangles in soup(), rotation in 0usize..12, flips in 0u32..4096) {
        let mut shuffled = triangles.clone();
        let count = shuffled.len();
        shuffled.rotate_left(rotation % count);
        shuffled.reverse();
        for (i, triangle) in shuffled.iter_mut().enumerate() {
            triangle.rotate_left((flips as usize + i) % 3);
            if flips >> i & 1 == 1 {
                triangle.swap(0, 1);
            }
        }
        for mode in Mode::ALL {
            let grid = unit_grid(DIMS);
            prop_assert_eq!(
                voxelize(&lattice_mesh(&triangles), grid, mode),
                voxelize(&lattice_mesh(&shuffled), grid, mode),
            );
        }
    }

    #[test]
    fn whole_voxel_translations_translate(triangles in soup(), shift in prop::array::uniform3(-4i64..40)) {
        let moved: Vec<_> = triangles
            .iter()
            .map(|t| t.map(|v| [0, 1, 2].map(|a| v[a] + shift[a] * STEPS)))
            .collect();
        for mode in Mode::ALL {
            let here = voxelize(&lattice_mesh(&triangles), unit_grid(DIMS), mode);
            let there = voxelize(&lattice_mesh(&moved), unit_grid(DIMS.map(|d| d + 40)), mode);
            for x in 0..DIMS[0] {
                for y in 0..DIMS[1] {
                    for z in 0..DIMS[2] {
                        let to = [x, y, z].map(i64::from);
                        let to = [0, 1, 2].map(|a| to[a] + shift[a]);
                        if to.iter().all(|&c| c >= 0) {
                            let to = to.map(|c| u32::try_from(c).unwrap());
                            prop_assert_eq!(here.get([x, y, z]), there.get(to), "{} {:?}", mode, [x, y, z]);
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn mirrors_and_axis_swaps_move_surfaces_along(triangles in soup(), axis in 0usize..3) {
        let size = i64::from(DIMS[axis]);
        let other = (axis + 1) % 3;
        let mirrored: Vec<_> = triangles.iter().map(|t| t.map(|mut v| { v[axis] = size * STEPS - v[axis]; v })).collect();
        let swapped: Vec<_> = triangles.iter().map(|t| t.map(|mut v| { v.swap(axis, other); v })).collect();
        let mut swapped_dims = DIMS;
        swapped_dims.swap(axis, other);
        for mode in [Mode::Conservative, Mode::Thin] {
            let volume = voxelize(&lattice_mesh(&triangles), unit_grid(DIMS), mode);
            let mirror = voxelize(&lattice_mesh(&mirrored), unit_grid(DIMS), mode);
            let swap = voxelize(&lattice_mesh(&swapped), unit_grid(swapped_dims), mode);
            prop_assert_eq!(volume.count(), mirror.count());
            prop_assert_eq!(volume.count(), swap.count());
            for voxel in volume.iter() {
                let mut there = voxel;
                there[axis] = DIMS[axis] - 1 - voxel[axis];
                prop_assert!(mirror.get(there), "{} mirrored: {:?}", mode, voxel);
                let mut there = voxel;
                there.swap(axis, other);
                prop_assert!(swap.get(there), "{} swapped: {:?}", mode, voxel);
            }
        }
    }

    #[test]
    fn conservative_contains_the_other_surfaces(triangles in soup()) {
        let mesh = lattice_mesh(&triangles);
        let conservative = voxelize(&mesh, unit_grid(DIMS), Mode::Conservative);
        for mode in [Mode::Thin, Mode::Sliced] {
            for voxel in voxelize(&mesh, unit_grid(DIMS), mode).iter() {
                prop_assert!(conservative.get(voxel), "{} has {:?}", mode, voxel);
            }
        }
    }

    #[test]
    fn threads_change_nothing(triangles in prop::collection::vec(triangle(), 1..400), threads in 2usize..6) {
        let mesh = lattice_mesh(&triangles);
        for mode in Mode::ALL {
            let job = Job::new(unit_grid([61, 40, 70]), mode);
            let run = |threads| {
                let lattice = LatticeMesh::snap(&mesh, job.grid()).unwrap();
                let mut volume = Volume::new(*job.grid()).unwrap();
                CpuBackend::with_threads(threads).unwrap().voxelize(&lattice, &job, &mut volume).unwrap();
                volume
            };
            prop_assert_eq!(run(1), run(threads));
        }
    }

    /// Parity does not depend on which way the ray goes, as long as nothing lies exactly on a ray.
    #[test]
    fn solids_mirror_along(shift in prop::array::uniform3(1i64..STEPS / 4), axis in 0usize..3) {
        // Odd offsets below a quarter of a step keep every vertex and edge of the octahedron off the centres.
        let offset = shift.map(|s| (2 * s + 1) as f64 / (2 * STEPS) as f64);
        let mesh = zoo::octahedron([0, 1, 2].map(|a| 6.0 + offset[a]), 5.3);
        let mut mirrored = mesh.clone();
        mirrored.positions.iter_mut().for_each(|p| p[axis] = 13.0 - p[axis]);
        let volume = voxelize(&mesh, unit_grid([13; 3]), Mode::Solid);
        let mirror = voxelize(&mirrored, unit_grid([13; 3]), Mode::Solid);
        let differ = volume.iter().filter(|&voxel| {
            let mut there = voxel;
            there[axis] = 12 - voxel[axis];
            !mirror.get(there)
        });
        prop_assert_eq!(differ.count(), 0);
        prop_assert_eq!(volume.count(), mirror.count());
    }
}

/// The voxels that a walk from the grid's corner reaches without stepping on a set one.
fn reachable(volume: &Volume, diagonal: bool) -> Volume {
    let dims = volume.grid().dims();
    let mut reached = Volume::new(*volume.grid()).unwrap();
    let mut stack = vec![[0u32; 3]];
    assert!(!volume.get([0; 3]), "the walk starts outside");
    reached.set([0; 3]);
    while let Some(at) = stack.pop() {
        for step in 0..27i64 {
            let step = [step % 3 - 1, step / 3 % 3 - 1, step / 9 - 1];
            let axes = step.iter().filter(|&&s| s != 0).count();
            if axes == 0 || (!diagonal && axes > 1) {
                continue;
            }
            let to = [0, 1, 2].map(|a| i64::from(at[a]) + step[a]);
            if (0..3).all(|a| (0..i64::from(dims[a])).contains(&to[a])) {
                let to = to.map(|c| u32::try_from(c).unwrap());
                if !volume.get(to) && !reached.get(to) {
                    reached.set(to);
                    stack.push(to);
                }
            }
        }
    }
    reached
}

/// Closed surfaces of several shapes, each with a voxel that is well inside.
fn closed_surfaces() -> Vec<(&'static str, Mesh, [u32; 3])> {
    let fitted = |mesh: Mesh| {
        // Into [2, 38]^3 at an odd place.
        let bounds = mesh.bounds().unwrap();
        let scale = 35.3 / bounds.size().into_iter().fold(0.0, f64::max);
        let positions = mesh.positions.iter();
        Mesh { positions: positions.map(|p| [0, 1, 2].map(|a| 2.3 + (p[a] - bounds.min[a]) * scale)).collect(), ..mesh }
    };
    let scene = |spec| fitted(trixel::scene::build(spec).unwrap());
    vec![
        ("octahedron", zoo::octahedron([20.2, 20.3, 20.4], 17.0), [20, 20, 20]),
        ("cube on voxel faces", zoo::cube([4.0; 3], 30.0), [20, 20, 20]),
        ("cube through centres", zoo::cube([4.5; 3], 30.0), [20, 20, 20]),
        ("sphere", scene("sphere:20"), [19, 19, 19]),
        // The middle of the tube at -x.
        ("torus", scene("torus:90"), [7, 20, 7]),
    ]
}

#[test]
fn no_26_path_through_a_conservative_surface() {
    for (name, mesh, inside) in closed_surfaces() {
        let volume = voxelize(&mesh, unit_grid([41; 3]), Mode::Conservative);
        assert!(!volume.get(inside), "{name}: the inside is set");
        assert!(!reachable(&volume, true).get(inside), "{name} leaks");
    }
}

#[test]
fn no_6_path_through_a_thin_surface() {
    for (name, mesh, inside) in closed_surfaces() {
        let volume = voxelize(&mesh, unit_grid([41; 3]), Mode::Thin);
        assert!(!volume.get(inside), "{name}: the inside is set");
        assert!(!reachable(&volume, false).get(inside), "{name} leaks");
    }
}

#[test]
fn a_solid_is_what_a_6_path_cannot_reach() {
    for (name, mesh, inside) in closed_surfaces() {
        let solid = voxelize(&mesh, unit_grid([41; 3]), Mode::Solid);
        assert!(solid.get(inside), "{name}: the inside is missing");
        let surface = voxelize(&mesh, unit_grid([41; 3]), Mode::Thin);
        let outside = reachable(&surface, false);
        for voxel in solid.iter() {
            assert!(!outside.get(voxel) || surface.get(voxel), "{name}: {voxel:?} is outside");
        }
    }
}

#[test]
fn solid_volumes_converge() {
    let pi = std::f64::consts::PI;
    let cases = [
        ("cube", trixel::scene::build("cube").unwrap(), None),
        ("sphere:64", trixel::scene::build("sphere:64").unwrap(), Some(4.0 / 3.0 * pi)),
        ("torus:512", trixel::scene::build("torus:512").unwrap(), Some(2.0 * pi * pi * 0.4 * 0.4)),
    ];
    for (name, mesh, volume) in cases {
        let bounds = mesh.bounds().unwrap();
        let expected = volume.unwrap_or_else(|| bounds.size().iter().product());
        let error = |resolution: u32| {
            let grid = Grid::fit(&bounds, resolution).unwrap();
            let voxel: f64 = grid.voxel_size().iter().product();
            let count = voxelize(&mesh, grid, Mode::Solid).count();
            (count as f64 * voxel / expected - 1.0).abs()
        };
        assert!(error(32) < 0.03, "{name} at 32: {}", error(32));
        assert!(error(256) < 0.001, "{name} at 256: {}", error(256));
    }
}

#[test]
fn exact_scaling_changes_nothing() {
    let mesh = zoo::octahedron([0.3, 0.1, -0.2], 1.7);
    for mode in Mode::ALL {
        let job = |scale: f64| {
            let grid = Grid::new([-2.0 * scale; 3], [0.125 * scale; 3], [32; 3]).unwrap();
            let positions = mesh.positions.iter().map(|p| p.map(|c| c * scale)).collect();
            voxelize(&Mesh::new(positions, mesh.triangles.clone()), grid, mode).words().to_vec()
        };
        assert_eq!(job(1.0), job(2f64.powi(-90)), "{mode}");
        assert_eq!(job(1.0), job(2f64.powi(90)), "{mode}");
    }
}
