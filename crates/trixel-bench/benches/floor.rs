//! Conservative and solid voxelizing at 512 beside the *floor*, in the same run: what no voxelizer can do without, on one
//! thread: the box of every triangle through the index buffer, a warm clear of the grid, and setting the voxels from a
//! list that is ready.
//!
//! `cargo bench -p trixel-bench --bench floor`; `-- dragon` one mesh. Milliseconds, medians of the second of two runs.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a benchmark")]

use std::hint::black_box;

use trixel::lattice::{LatticeMesh, LatticePositions};
use trixel::{Backend, CpuBackend, Grid, Job, Mode, Volume};
use trixel_bench::{asked_for, load, median, second_run_ms};

const RESOLUTION: u32 = 512;
const ROUNDS: usize = 15;

fn main() {
    println!(
        "{:44} {:>6} {:>6} {:>6} {:>6} | {:>7} {:>6} {:>7} {:>6} | {:>7} {:>7} {:>6}",
        "mesh", "box", "clear", "set", "floor", "conserv", "ratio", "2 thr", "gain", "solid", "2 thr", "gain"
    );
    for name in asked_for() {
        let mesh = load(name).unwrap();
        let grid = Grid::fit(&mesh.bounds().unwrap(), RESOLUTION).unwrap();
        let lattice = LatticeMesh::snap(&mesh, &grid).unwrap();
        let mut volume = Volume::new(grid).unwrap();
        let backends = [1, 2].map(|threads| CpuBackend::with_threads(threads).unwrap());
        let conservative = Job::new(grid, Mode::Conservative);
        backends[0].voxelize(&lattice, &conservative, &mut volume).unwrap();
        let voxels: Vec<(u32, u32, u32)> = volume.iter().map(|[x, y, z]| (x, y, z)).collect();
        let (columns, column_words) = (grid.dims()[1] as usize, volume.column_words());
        // Interleaved, so that all see the same neighbours on the machine.
        let mut times: [Vec<f64>; 7] = Default::default();
        for _ in 0..ROUNDS {
            times[0].push(second_run_ms(|| box_every_triangle(&lattice)));
            times[1].push(second_run_ms(|| volume.words_mut().fill(0)));
            times[2].push(second_run_ms(|| {
                let words = volume.words_mut();
                for &(x, y, z) in &voxels {
                    words[(x as usize * columns + y as usize) * column_words + (z / 64) as usize] |= 1 << (z % 64);
                }
            }));
            for (i, mode) in [Mode::Conservative, Mode::Solid].into_iter().enumerate() {
                for (j, backend) in backends.iter().enumerate() {
                    let job = Job::new(grid, mode);
                    times[3 + 2 * i + j].push(second_run_ms(|| {
                        backend.voxelize(&lattice, &job, &mut volume).unwrap();
                    }));
                }
            }
        }
        let [boxes, clear, set, one, two, solid_one, solid_two] = times.map(|mut times| median(&mut times));
        let floor = boxes + clear + set;
        println!(
            "{name:44} {boxes:6.2} {clear:6.2} {set:6.2} {floor:6.2} | {one:7.2} {:6.2} {two:7.2} {:6.2} | {solid_one:7.2} \
             {solid_two:7.2} {:6.2}",
            one / floor,
            one / two,
            solid_one / solid_two,
        );
    }
}

fn box_every_triangle(lattice: &LatticeMesh<'_>) {
    let LatticePositions::Narrow(positions) = &lattice.positions else { return };
    let mut sum = 0i32;
    for triangle in lattice.triangles {
        let [a, b, c] = triangle.map(|vertex| positions[vertex as usize]);
        for axis in 0..3 {
            sum ^= (a[axis].min(b[axis]).min(c[axis]) - 1) >> 16;
            sum = sum.wrapping_add(a[axis].max(b[axis]).max(c[axis]) >> 16);
        }
    }
    black_box(sum);
}
