//! Brick maps against the definitions, and against the dense volumes that they stand for.

#![expect(clippy::unwrap_used, reason = "a failure here is a failed test")]

use trixel::conformance::random::{self, Placement, Random};
use trixel::conformance::suite::{assert_same, lattice_mesh};
use trixel::conformance::zoo;
use trixel::lattice::LatticeMesh;
use trixel::{Backend, BrickMap, CpuBackend, Error, Grid, Instructions, Job, Mesh, Mode, Occupancy, Strategy, Volume};

/// Voxelizes into bricks and then makes them dense, so that the whole suite can judge them.
struct ThroughBricks(CpuBackend);

impl Backend for ThroughBricks {
    fn name(&self) -> &'static str {
        "bricks"
    }

    fn strategies(&self) -> &'static [Strategy] {
        self.0.strategies()
    }

    fn voxelize(&self, mesh: &LatticeMesh<'_>, job: &Job, volume: &mut Volume) -> Result<Strategy, Error> {
        if volume.grid() != job.grid() {
            return Err(Error::GridMismatch);
        }
        let map = self.0.voxelize_bricks(mesh, job, None)?;
        *volume = map.to_volume(None)?;
        assert_eq!(map.count(), volume.count());
        Ok(Strategy::ColumnRuns)
    }
}

trixel::conformance_suite!(bricks_all_threads, ThroughBricks(CpuBackend::default()));
trixel::conformance_suite!(bricks_three_threads, ThroughBricks(CpuBackend::with_threads(3).unwrap()));
trixel::conformance_suite!(bricks_sse2, ThroughBricks(CpuBackend::default().limited_to(Instructions::Sse2)));

fn unit_grid(dims: [u32; 3]) -> Grid {
    Grid::new([0.0; 3], [1.0; 3], dims).unwrap()
}

fn bricks(mesh: &Mesh, job: &Job) -> BrickMap {
    let lattice = LatticeMesh::snap(mesh, job.grid()).unwrap();
    CpuBackend::default().voxelize_bricks(&lattice, job, None).unwrap()
}

/// Triangles from less than a voxel to far larger than the grid, over several pillars and tiles.
fn soup(seed: u64, count: usize, extents: &[i64]) -> Mesh {
    let mut random = Random::new(seed);
    let triangles: Vec<_> = (0..count)
        .map(|i| {
            let extent = extents[i % extents.len()];
            random::triangle(
                &mut random,
                Placement::ALL[i % Placement::ALL.len()],
                -extent / 2,
                300 - extent / 2,
                extent,
            )
        })
        // So far away, every other time, that lattice coordinates need more than 32 bits.
        .chain((seed % 2 == 1).then_some([[1 << 37, 1 << 37, 0], [1 << 37, 1 << 38, 0], [1 << 37, 1 << 37, 1 << 37]]))
        .collect();
    lattice_mesh(&triangles)
}

#[test]
fn large_triangles_meet_the_same_voxels_as_dense() {
    // Dimensions that are no multiple of a brick, and one that is of a tile.
    for dims in [[200, 150, 300], [65, 64, 129], [130, 7, 256]] {
        for (seed, extents) in [(1, &[2, 40, 64, 70][..]), (2, &[100, 200, 400]), (3, &[1000, 20_000, 1_000_000])] {
            for round in 0..6 {
                let mesh = soup(10 * seed + round, 12, extents);
                for mode in Mode::ALL {
                    let mut job = Job::new(unit_grid(dims), mode);
                    if mode == Mode::Sliced {
                        job = job.with_overlap(f64::from(u32::try_from(round).unwrap()) * 40.0).unwrap();
                    }
                    let dense = trixel::voxelize(&mesh, &job).unwrap();
                    let map = bricks(&mesh, &job);
                    let what = format!("{mode}, {dims:?}, {extents:?}, round {round}");
                    assert_same(&what, &map.to_volume(None).unwrap(), &dense);
                    assert_eq!(map.count(), dense.count(), "{what}");
                }
            }
        }
    }
}

#[test]
fn words_in_any_range_are_those_of_the_dense_volume() {
    let mesh = zoo::merged(&[zoo::cube([10.5; 3], 120.0), zoo::octahedron([70.0; 3], 68.0)]);
    let voxels = |words: &mut Vec<[u32; 3]>| -> Vec<[u32; 3]> { std::mem::take(words) };
    for mode in [Mode::Conservative, Mode::Solid] {
        let job = Job::new(unit_grid([140, 139, 141]), mode);
        let (dense, map) = (trixel::voxelize(&mesh, &job).unwrap(), bricks(&mesh, &job));
        let ranges = [
            [0..140, 0..139, 0..141],
            [10..11, 3..130, 0..141],
            [63..66, 60..70, 61..67],
            [5..140, 8..9, 11..12],
            [0..9, 0..9, 130..1000],
            [20..20, 0..139, 0..141],
            [12..14, 12..14, 16..136],
        ];
        for range in ranges {
            let mut list = Vec::new();
            let expand = |[x, y, z]: [u32; 3], word: u64, list: &mut Vec<[u32; 3]>| {
                assert_ne!(word, 0);
                list.extend((0..64).filter(|i| word >> i & 1 == 1).map(|i| [x, y, z + i]));
            };
            map.for_each_word(&range, |at, word| expand(at, word, &mut list));
            let of_map = voxels(&mut list);
            dense.for_each_word(&range, |at, word| expand(at, word, &mut list));
            let of_dense = voxels(&mut list);
            let expected: Vec<_> = dense.iter().filter(|v| (0..3).all(|axis| range[axis].contains(&v[axis]))).collect();
            assert!(of_map == expected && of_dense == expected, "{mode}, {range:?}");
        }
        for voxel in [[0, 0, 0], [11, 11, 11], [64, 64, 64], [139, 138, 140], [140, 0, 0], [3, 3, u32::MAX]] {
            assert_eq!(map.get(voxel), dense.get(voxel), "{voxel:?}");
        }
    }
}

#[test]
fn pieces_make_the_whole_for_any_number_of_threads() {
    let mesh = soup(77, 300, &[3, 30, 90, 500]);
    for mode in Mode::ALL {
        let job = Job::new(unit_grid([300, 200, 250]), mode);
        let whole = bricks(&mesh, &job);
        let lattice = LatticeMesh::snap(&mesh, job.grid()).unwrap();
        assert!(CpuBackend::with_threads(1).unwrap().voxelize_bricks(&lattice, &job, None).unwrap() == whole);
        let [px, py] = BrickMap::pillars_of(job.grid());
        assert_eq!([px, py], [5, 4]);
        let mut count = 0;
        for layers in [0..2, 2..3, 3..5] {
            let binned = CpuBackend::default().bin(&lattice, &job, layers.clone()).unwrap();
            for x in layers {
                for ys in [0..1, 1..4] {
                    let piece = binned.voxelize(x..x + 1, ys.clone());
                    let range = [64 * x..64 * (x + 1), 64 * ys.start..64 * ys.end, 0..250];
                    let (mut got, mut expected) = (Vec::new(), Vec::new());
                    piece.for_each_word(&[0..300, 0..200, 0..250], |at, word| got.push((at, word)));
                    whole.for_each_word(&range, |at, word| expected.push((at, word)));
                    assert!(got == expected, "{mode}, {range:?}");
                    count += piece.count();
                }
            }
        }
        assert_eq!(count, whole.count());
    }
}

#[test]
fn memory_follows_the_surface_also_of_a_solid() {
    let mesh = zoo::octahedron([500.37, 499.61, 500.83], 477.3);
    for mode in [Mode::Conservative, Mode::Solid] {
        let bytes_at = |scale: u32| {
            let grid = Grid::new([0.0; 3], [1.0 / f64::from(scale); 3], [1000 * scale; 3]).unwrap();
            bricks(&mesh, &Job::new(grid, mode)).bytes()
        };
        let (coarse, fine) = (bytes_at(1), bytes_at(2));
        // Four times, not eight.
        assert!(fine < 5 * coarse, "{mode}: {coarse} to {fine}");
    }
}

#[test]
fn a_memory_limit_is_kept() {
    let mesh = zoo::octahedron([50.5; 3], 48.0);
    let job = Job::new(unit_grid([101; 3]), Mode::Conservative);
    let lattice = LatticeMesh::snap(&mesh, job.grid()).unwrap();
    let backend = CpuBackend::default();
    let map = backend.voxelize_bricks(&lattice, &job, None).unwrap();
    let needed = map.bytes() + backend.bin(&lattice, &job, 0..2).unwrap().bytes();
    assert!(backend.voxelize_bricks(&lattice, &job, Some(needed)).unwrap() == map);
    let error = backend.voxelize_bricks(&lattice, &job, Some(needed / 2)).unwrap_err().to_string();
    assert!(error.contains("even as bricks"), "{error}");
}
