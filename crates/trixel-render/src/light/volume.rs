//! The material volume: what each voxel is of, and the surface's normals near it, as textures hold them.

use std::time::Instant;

use glam::Vec3;
use half::f16;
use rayon::prelude::*;
use trixel::attributes::{AttributeKind, AttributeRequest, Combine, Values, compute};
use trixel::fill::Fill;
use trixel::lattice::LatticeMesh;
use trixel::{Backend, Bounds, CpuBackend, Grid, Job, Mesh, Mode, Topology, Volume};

use super::error::LightError;
use super::options::LightOptions;
use super::scene::OpticalScene;

/// A scene as voxels. Texels follow one another with x fastest.
pub struct OpticalVolume {
    pub(super) dims: [u32; 3],
    pub(super) origin: [f64; 3],
    pub(super) voxel: f64,
    /// The share of the voxel that each class fills, of 255; what is left is air.
    pub(super) shares: Vec<[u8; 4]>,
    /// Filtered normals, and a distance in voxels within which there is no surface.
    pub(super) surface: Vec<[f16; 4]>,
    /// Milliseconds that the surface's voxels took.
    pub voxelize_ms: f64,
    /// Milliseconds that the inside took.
    pub fill_ms: f64,
}

/// Empty voxels round the object, so that filtered normals have room.
const MARGIN: u32 = 3;
/// The finest grid that insides are computed on has about this many voxels along an axis.
const FINEST: u32 = 512;

impl OpticalVolume {
    /// Voxelizes a scene. Insides are those of a grid that is up to four times finer along each axis, by
    /// [`LightOptions::fill`].
    ///
    /// # Errors
    /// When memory runs out, or there are more than [`OpticalScene::MAX_CLASSES`] classes.
    pub fn new(scene: &OpticalScene, options: &LightOptions) -> Result<Self, LightError> {
        scene.check_classes()?;
        let start = Instant::now();
        let bounds = Bounds { min: (-scene.half).to_array(), max: scene.half.to_array() };
        let inner = Grid::fit(&bounds, options.resolution)?;
        let voxel = inner.voxel_size()[0];
        let origin = inner.origin().map(|c| c - f64::from(MARGIN) * voxel);
        let dims = inner.dims().map(|n| n + 2 * MARGIN);
        let grid = Grid::new(origin, [voxel; 3], dims)?;
        let surface = surface(scene, &grid, options)?;
        let voxelize_ms = start.elapsed().as_secs_f64() * 1e3;
        let start = Instant::now();
        let shares = shares(scene, &grid, options.fill)?;
        Ok(Self { dims, origin, voxel, shares, surface, voxelize_ms, fill_ms: start.elapsed().as_secs_f64() * 1e3 })
    }
}

/// Filtered normals and distances.
fn surface(scene: &OpticalScene, grid: &Grid, options: &LightOptions) -> Result<Vec<[f16; 4]>, LightError> {
    let job = Job::new(*grid, Mode::Conservative);
    let lattice = LatticeMesh::snap(&scene.mesh, grid).map_err(trixel::Error::from)?;
    let mut boundary = Volume::new(*grid)?;
    CpuBackend::default().voxelize(&lattice, &job, &mut boundary)?;
    let request = AttributeRequest::new(&[AttributeKind::Normal], Combine::AreaWeighted);
    let attributes = compute(&scene.mesh, &lattice, &job, &boundary, &request)?;
    let layout = Layout::of(grid);
    let mut normals = vec![Vec3::ZERO; layout.count];
    let mut distances = vec![u8::MAX; layout.count];
    if let Some(Values::F32x3(values)) = attributes.get(AttributeKind::Normal) {
        for ([x, y, z], normal) in boundary.iter().zip(values) {
            let index = layout.index([x, y, z]);
            normals[index] = Vec3::from_array(*normal);
            distances[index] = 0;
        }
    }
    for _ in 0..options.normal_filter {
        for axis in 0..3 {
            normals = layout.filtered(&normals, axis);
        }
    }
    for axis in 0..3 {
        layout.spread(&mut distances, axis);
    }
    let texel = |(normal, distance): (&Vec3, &u8)| {
        let [x, y, z] = normal.normalize_or_zero().to_array().map(f16::from_f32);
        // Steps along the axes are at most the square root of 3 times as long as the straight way.
        [x, y, z, f16::from_f32(f32::from(*distance) / 3.0_f32.sqrt())]
    };
    Ok(normals.par_iter().zip(&distances).map(texel).collect())
}

/// The share of each voxel that each class fills.
fn shares(scene: &OpticalScene, grid: &Grid, fill: Option<Fill>) -> Result<Vec<[u8; 4]>, LightError> {
    let longest = grid.dims().into_iter().max().unwrap_or(1);
    let fine = [4, 2].into_iter().find(|n| longest * n <= FINEST + 8 * MARGIN).unwrap_or(1);
    let voxel = grid.voxel_size()[0] / f64::from(fine);
    let fine_grid = Grid::new(grid.origin(), [voxel; 3], grid.dims().map(|n| n * fine))?;
    let insides = (0..scene.classes.len())
        .map(|class| inside(&scene.part_of_class(class), &fine_grid, fill))
        .collect::<Result<Vec<_>, LightError>>()?;
    let layout = Layout::of(grid);
    let [nx, ny, nz] = grid.dims();
    let full = fine * fine * fine;
    let mask = (1_u64 << fine) - 1;
    let mut shares = vec![[0; 4]; layout.count];
    // A plane of constant y at a time: each has its own texels in every row, so planes are made apart and put together.
    let planes: Vec<Vec<[u8; 4]>> = (0..ny)
        .into_par_iter()
        .map(|y| {
            let mut plane = vec![[0_u32; 4]; nx as usize * nz as usize];
            for x in 0..nx {
                for (fx, fy) in (0..fine).flat_map(|fx| (0..fine).map(move |fy| (fx, fy))) {
                    let columns = insides.iter().map(|inside| inside.column(x * fine + fx, y * fine + fy));
                    let columns: Vec<&[u64]> = columns.collect();
                    for z in 0..nz {
                        let bit = z * fine;
                        let mut free = mask;
                        for (class, column) in columns.iter().enumerate().rev() {
                            let bits = column[bit as usize / 64] >> (bit % 64) & free;
                            free &= !bits;
                            plane[(z * nx + x) as usize][class] += bits.count_ones();
                        }
                    }
                }
            }
            let share = |count: u32| u8::try_from((count * 255 + full / 2) / full).unwrap_or(u8::MAX);
            plane.into_iter().map(|counts| counts.map(share)).collect()
        })
        .collect();
    for (y, plane) in (0..ny).zip(&planes) {
        for (z, row) in (0..nz).zip(plane.chunks_exact(nx as usize)) {
            let start = layout.index([0, y, z]);
            shares[start..start + nx as usize].copy_from_slice(row);
        }
    }
    Ok(shares)
}

/// The inside of what one class is made of.
fn inside(part: &Mesh, grid: &Grid, fill: Option<Fill>) -> Result<Volume, LightError> {
    let fill = fill.unwrap_or_else(|| if Topology::of(part).open_edges == 0 { Fill::Parity } else { Fill::Xor });
    let lattice = LatticeMesh::snap(part, grid).map_err(trixel::Error::from)?;
    let mut voxels = Volume::new(*grid)?;
    let mode = if fill == Fill::Parity { Mode::Solid } else { Mode::Sliced };
    CpuBackend::default().voxelize(&lattice, &Job::new(*grid, mode), &mut voxels)?;
    if fill == Fill::Parity { Ok(voxels) } else { Ok(trixel::fill::fill(&voxels, fill)?.0) }
}

/// Where a voxel's texel is.
#[derive(Clone, Copy)]
struct Layout {
    dims: [usize; 3],
    count: usize,
}

impl Layout {
    fn of(grid: &Grid) -> Self {
        let dims = grid.dims().map(|n| n as usize);
        Self { dims, count: dims.iter().product() }
    }

    fn index(&self, [x, y, z]: [u32; 3]) -> usize {
        (z as usize * self.dims[1] + y as usize) * self.dims[0] + x as usize
    }

    fn stride(&self, axis: usize) -> usize {
        self.dims[..axis].iter().product()
    }

    /// Each value with its two neighbours along an axis, by weights 1, 2 and 1; outside there is nothing.
    fn filtered(&self, values: &[Vec3], axis: usize) -> Vec<Vec3> {
        let (stride, length) = (self.stride(axis), self.dims[axis]);
        let at = |index: usize| {
            let place = index / stride % length;
            let mut sum = 2.0 * values[index];
            if place > 0 {
                sum += values[index - stride];
            }
            if place + 1 < length {
                sum += values[index + stride];
            }
            sum
        };
        (0..values.len()).into_par_iter().map(at).collect()
    }

    /// Lowers each number to at most one more than its neighbours' along an axis.
    fn spread(&self, numbers: &mut [u8], axis: usize) {
        let (stride, length) = (self.stride(axis), self.dims[axis]);
        // Lines along the axis lie within blocks of `stride * length` numbers.
        numbers.par_chunks_mut(stride * length).for_each(|block| {
            for i in stride..block.len() {
                block[i] = block[i].min(block[i - stride].saturating_add(1));
            }
            for i in (0..block.len() - stride).rev() {
                block[i] = block[i].min(block[i + stride].saturating_add(1));
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::super::scene::{Medium, Placement};
    use super::*;

    fn volume(name: &str, options: &LightOptions) -> OpticalVolume {
        let mesh = trixel::scene::build(name).unwrap();
        let placement = Placement::new(&mesh.bounds().unwrap(), trixel::UpAxis::Z).unwrap();
        let scene = OpticalScene::new(&mesh, &placement, &Medium::of_mesh(&mesh)).unwrap();
        OpticalVolume::new(&scene, options).unwrap()
    }

    #[test]
    fn shares_add_up_to_the_volume() {
        let options = LightOptions { resolution: 24, ..LightOptions::default() };
        let sphere = volume("sphere:32", &options);
        let sum: f64 = sphere.shares.iter().map(|share| f64::from(share[0]) / 255.0).sum();
        let expected = std::f64::consts::PI / 6.0;
        assert!((sum * sphere.voxel.powi(3) / expected - 1.0).abs() < 0.01);
        assert!(sphere.shares.iter().all(|share| share[1..] == [0; 3]));
    }

    /// The share of air that is taken for glass, of all voxels, above a torus whose bottom has holes.
    #[test]
    fn holes_do_not_leak_upwards() {
        let mut mesh = trixel::scene::build("torus:64").unwrap();
        let triangles = mesh.triangles.iter().copied().enumerate();
        let low = |t: &[u32; 3]| t.iter().all(|&v| mesh.positions[v as usize][2] < -0.3);
        mesh.triangles = triangles.filter(|(i, t)| !(low(t) && i % 40 == 0)).map(|(_, t)| t).collect();
        let placement = Placement::new(&mesh.bounds().unwrap(), trixel::UpAxis::Z).unwrap();
        let scene = OpticalScene::new(&mesh, &placement, &Medium::of_mesh(&mesh)).unwrap();
        let above = |fill: Option<Fill>| {
            let options = LightOptions { resolution: 48, fill, ..LightOptions::default() };
            let torus = OpticalVolume::new(&scene, &options).unwrap();
            let [nx, ny, nz] = torus.dims.map(|n| n as usize);
            let top = torus.shares.chunks_exact(nx * ny).skip(nz - 2).flatten();
            top.filter(|share| share[0] > 0).count()
        };
        assert!(above(Some(Fill::Parity)) > 10, "the holes are there");
        assert_eq!(above(None), 0);
    }

    #[test]
    #[expect(clippy::cast_precision_loss, clippy::cast_possible_truncation, reason = "small")]
    fn normals_point_outwards_and_distances_do_not_reach_the_surface() {
        let options = LightOptions { resolution: 20, ..LightOptions::default() };
        let sphere = volume("sphere:32", &options);
        let [nx, ny, _] = sphere.dims.map(|n| n as usize);
        for (i, texel) in sphere.surface.iter().enumerate() {
            let place = [i % nx, i / nx % ny, i / nx / ny];
            let p = Vec3::from_array(std::array::from_fn(|axis| {
                (sphere.origin[axis] + (place[axis] as f64 + 0.5) * sphere.voxel) as f32
            }));
            let [x, y, z, free] = texel.map(f16::to_f32);
            let normal = Vec3::new(x, y, z);
            let away = (p.length() - 0.5).abs() / sphere.voxel as f32;
            // Where the surface is; further out the filter sees less of it.
            if away < 1.5 {
                assert!(normal.dot(p.normalize()) > 0.98, "{p} {normal}");
            }
            assert!(free <= away + 1.0, "{free} {away}");
        }
    }
}
