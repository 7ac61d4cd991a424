//! The CPU backend against the definitions.

use trixel::conformance::{oracle, suite, zoo};
use trixel::lattice::LatticeMesh;
use trixel::{CpuBackend, Grid, Instructions, Job, Mode};

trixel::conformance_suite!(cpu_all_threads, CpuBackend::default());
trixel::conformance_suite!(cpu_one_thread, CpuBackend::with_threads(1).unwrap());
trixel::conformance_suite!(cpu_three_threads, CpuBackend::with_threads(3).unwrap());
trixel::conformance_suite!(cpu_avx2, CpuBackend::default().limited_to(Instructions::Avx2));
trixel::conformance_suite!(cpu_sse42, CpuBackend::default().limited_to(Instructions::Sse42));
trixel::conformance_suite!(cpu_sse2, CpuBackend::default().limited_to(Instructions::Sse2));

/// A large triangle of which the plane is so nearly vertical that floats do not hold where it is in a column.
#[test]
fn a_plane_one_step_from_vertical() {
    let step = 1.0 / 65536.0;
    let mesh = zoo::soup(&[[[0.0; 3], [100.0 + step, 100.0, 50.0], [step, step, 100.0]]]);
    let grid = Grid::new([0.0; 3], [1.0; 3], [101; 3]).unwrap();
    let lattice = LatticeMesh::snap(&mesh, &grid).unwrap();
    for mode in Mode::ALL {
        let job = Job::new(grid, mode);
        let expected = oracle::voxelize(&lattice, &job).unwrap();
        suite::assert_same(mode.name(), &suite::run(&CpuBackend::default(), &mesh, &job), &expected);
    }
}
