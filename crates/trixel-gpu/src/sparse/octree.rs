//! Sparse voxel octrees: C. Crassin & S. Green, *Octree-Based Sparse Voxelization Using the GPU Hardware Rasterizer*, 2012;
//! M. Schwarz & H.-P. Seidel, *Fast Parallel Surface and Solid Voxelization on GPUs*, 2010, section 5.
//!
//! Built level by level from the voxels up: each level's cubes, still along the Morton curve, are the list of the next. With
//! attributes, the first octant of a cube adds up what all of them have, so that sums follow the cubes and no two invocations
//! meet.

use trixel::attributes::device::light_tables;
use trixel::octree::{Look, Node, Octree};
use trixel::{Grid, VoxelOrder};

use super::{cubes, leaves, list_bound, read_word};
use crate::attributes::GpuAttributes;
use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::kernel::{Bound, Dispatcher, Kernel};
use crate::lists::{Entries, GpuVoxelList};
use crate::prefix_sum::PrefixSum;

/// Words of a [`Look`].
pub(super) const LOOK_WORDS: usize = 4;
/// Bytes of `Sum` in `octree_sum.wgsl`.
const SUM_BYTES: u64 = 64;

/// A sparse voxel octree in buffers of a [`Gpu`]: the nodes of [`Octree`] and, with attributes, what they look like.
#[derive(Debug)]
pub struct GpuOctree {
    pub(super) grid: Grid,
    nodes: Entries,
    pub(super) everything: bool,
    pub(super) looks: Option<Looks>,
}

/// What an octree's parts look like.
#[derive(Debug)]
pub(super) struct Looks {
    pub(super) nodes: wgpu::Buffer,
    pub(super) voxels: wgpu::Buffer,
    voxel_count: u32,
}

impl Looks {
    pub(super) fn new(gpu: &Gpu, nodes: u32, voxels: u32) -> Result<Self, GpuError> {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        // Empty ones are still bound.
        let room = |what, count: u32| gpu.storage(what, u64::from(count.max(1)) * 4 * LOOK_WORDS as u64, usage);
        let (nodes, voxel_looks) =
            (room("an octree's looks", nodes)?, room("the looks of an octree's voxels", voxels)?);
        Ok(Self { nodes, voxels: voxel_looks, voxel_count: voxels })
    }
}

/// What the octants of a level's cubes are, as kernels are specialized for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Below {
    /// Voxels without attributes.
    Voxels,
    /// Voxels that may have attributes.
    Leaves,
    /// The cubes of the level below.
    Cubes,
}

/// The octants of a level's cubes.
#[derive(Clone, Copy)]
enum Octants<'a> {
    Voxels,
    Leaves(&'a wgpu::Buffer),
    Cubes(&'a Level),
}

/// Levels of nodes over a grid: the root's cube is 2^height voxels wide.
pub(super) fn height_of(grid: &Grid) -> u32 {
    let longest = grid.dims().into_iter().max().unwrap_or(1);
    longest.next_power_of_two().trailing_zeros().max(1)
}

/// The cubes of one level that hold any voxel.
struct Level {
    cubes: Entries,
    /// Octants with voxels, and full ones above; and mixed cubes of the level below before the first child, or entries of
    /// the list before the first leaf.
    masks: wgpu::Buffer,
    /// Summed up: how many mixed cubes come before each.
    mixed: PrefixSum,
    /// With attributes, what the voxels in each cube have together.
    sums: Option<wgpu::Buffer>,
}

impl Level {
    /// The cubes that eight octants make, which are `length` entries of `list`.
    fn above(gpu: &Gpu, (list, length): (&wgpu::Buffer, u32), octants: Octants<'_>) -> Result<Self, GpuError> {
        let parameters = [length, 1];
        let mut counting = Dispatcher::new(gpu);
        let begun = cubes(&mut counting, &parameters, list)?;
        let count = read_word(counting, begun.total())?;
        let room = |what, bytes: u64| gpu.storage(what, u64::from(count.max(1)) * bytes, wgpu::BufferUsages::STORAGE);
        let from = match octants {
            Octants::Voxels => None,
            Octants::Leaves(leaves) => Some((true, leaves)),
            Octants::Cubes(below) => below.sums.as_ref().map(|sums| (false, sums)),
        };
        let level = Self {
            cubes: Entries::new(gpu, count)?,
            masks: room("an octree's masks", 8)?,
            mixed: PrefixSum::new(gpu, count)?,
            sums: from.map(|_| room("an octree's sums", SUM_BYTES)).transpose()?,
        };
        let entries = list_bound(&parameters, list, &begun);
        let mut bound = entries.to_vec();
        let below = match octants {
            Octants::Voxels => Below::Voxels,
            Octants::Leaves(leaves) => {
                bound.push((3, Bound::Buffer(leaves)));
                Below::Leaves
            }
            Octants::Cubes(below) => {
                bound.extend([(3, Bound::Buffer(&below.masks)), (4, Bound::Buffer(below.mixed.numbers()))]);
                Below::Cubes
            }
        };
        let written = [&level.cubes.buffer, &level.masks, level.mixed.numbers()];
        bound.extend((5..).zip(written.map(Bound::Buffer)));
        let mut gathering = Dispatcher::new(gpu);
        gathering.dispatch(Kernel::GatherOctants(below), &bound, length)?;
        if let (Some((leaves, from)), Some(sums)) = (from, &level.sums) {
            let mut bound = [&entries[..], &[(3, Bound::Buffer(from)), (4, Bound::Buffer(sums))]].concat();
            let tables = leaves.then(|| tables(gpu)).transpose()?;
            bound.extend(tables.iter().map(|tables| (TABLES, Bound::Buffer(tables))));
            gathering.dispatch(Kernel::SumOctants { leaves }, &bound, length)?;
        }
        level.mixed.record(&mut gathering)?;
        gathering.submit()?;
        Ok(level)
    }

    /// The bindings of `octree_level.wgsl`.
    fn bound<'a>(&'a self, parameters: &'a [u32; 3]) -> Vec<(u32, Bound<'a>)> {
        let [masks, mixed] = [&self.masks, self.mixed.numbers()].map(Bound::Buffer);
        vec![(0, Bound::Words(parameters)), (1, masks), (2, mixed)]
    }
}

/// Where the tables of light are bound.
const TABLES: u32 = 8;

/// As `octree_light.wgsl` wants them.
fn tables(gpu: &Gpu) -> Result<wgpu::Buffer, GpuError> {
    gpu.buffer_with("tables of light", bytemuck::cast_slice(&light_tables().concat()), wgpu::BufferUsages::STORAGE)
}

/// All levels, before their nodes are written.
struct Levels {
    /// From the last one's up.
    levels: Vec<Level>,
    /// How many nodes each has.
    counts: Vec<u32>,
}

impl Levels {
    fn of(gpu: &Gpu, list: &GpuVoxelList, leaves: Option<&wgpu::Buffer>) -> Result<Self, GpuError> {
        let mut levels: Vec<Level> = vec![];
        for _ in 0..height_of(list.grid()) {
            let level = match levels.last() {
                None => {
                    Level::above(gpu, (list.buffer(), list.len()), leaves.map_or(Octants::Voxels, Octants::Leaves))?
                }
                Some(below) => Level::above(gpu, (&below.cubes.buffer, below.cubes.length), Octants::Cubes(below))?,
            };
            levels.push(level);
        }
        let totals: Vec<_> = levels.iter().map(|level| (level.mixed.total(), 1)).collect();
        let counts = Dispatcher::new(gpu).read_words(&totals)?.into_iter().flatten().collect();
        Ok(Self { levels, counts })
    }

    /// How many nodes there are: at most a list's length and a seventh more.
    fn nodes(&self) -> u32 {
        self.counts.iter().fold(0, |sum: u32, count| sum.saturating_add(*count))
    }

    /// How many of so many voxels are in nodes of the last level: full cubes have eight each.
    fn voxels(&self, all: u32) -> u32 {
        let full = |(level, count): (&Level, &u32)| level.cubes.length.saturating_sub(*count);
        let full = self.levels.first().zip(self.counts.first()).map_or(0, full);
        all.saturating_sub(8 * full)
    }

    /// Every level from the root's down, and `Level` of `octree_level.wgsl`; whether it is the last.
    fn placed(&self) -> impl Iterator<Item = (&Level, [u32; 3], bool)> {
        let mut start = 0;
        self.levels.iter().zip(&self.counts).enumerate().rev().map(move |(i, (level, count))| {
            // The voxels below the last level have no nodes.
            let below = if i == 0 { 0 } else { start + count };
            let parameters = [level.cubes.length, start, below];
            start += count;
            (level, parameters, i == 0)
        })
    }

    fn write_nodes(&self, gpu: &Gpu, leaves: bool) -> Result<Entries, GpuError> {
        let nodes = Entries::new(gpu, self.nodes())?;
        let mut writing = Dispatcher::new(gpu);
        for (level, parameters, last) in self.placed() {
            let mut bound = level.bound(&parameters);
            bound.push((3, Bound::Buffer(&nodes.buffer)));
            writing.dispatch(Kernel::WriteNodes { leaves: last && leaves }, &bound, level.cubes.length)?;
        }
        writing.submit()?;
        Ok(nodes)
    }

    /// What nodes look like, and those voxels of a list that they have.
    fn write_looks(&self, gpu: &Gpu, voxels: u32, leaves: &wgpu::Buffer) -> Result<Looks, GpuError> {
        let looks = Looks::new(gpu, self.nodes(), self.voxels(voxels))?;
        let tables = tables(gpu)?;
        let mut writing = Dispatcher::new(gpu);
        for (level, parameters, last) in self.placed() {
            let mut write = |kernel, from: (u32, &wgpu::Buffer), to: &wgpu::Buffer| {
                let mut bound = level.bound(&parameters);
                bound.extend([from, (5, to), (TABLES, &tables)].map(|(at, buffer)| (at, Bound::Buffer(buffer))));
                writing.dispatch(kernel, &bound, level.cubes.length)
            };
            if let Some(sums) = &level.sums {
                write(Kernel::WriteNodeLooks, (4, sums), &looks.nodes)?;
            }
            if last {
                write(Kernel::WriteVoxelLooks, (3, leaves), &looks.voxels)?;
            }
        }
        writing.submit()?;
        Ok(looks)
    }
}

impl GpuOctree {
    /// The octree of a list's voxels, without attributes.
    ///
    /// # Errors
    /// When the list is not along the Morton curve, the nodes exceed what the adapter binds, memory runs out or the device is
    /// lost.
    pub fn of(gpu: &Gpu, list: &GpuVoxelList) -> Result<Self, GpuError> {
        Self::build(gpu, list, None)
    }

    /// The octree of a list's voxels with their attributes averaged upwards, colours and normals where they were asked for:
    /// bit for bit that of [`Octree::new`]. Beside what [`GpuOctree::of`] takes, building takes 20 bytes a voxel, and 64 a cube
    /// that is not empty, of two voxels' width and more.
    ///
    /// ```no_run
    /// use trixel::attributes::{AttributeKind, AttributeRequest, Combine};
    /// use trixel::lattice::LatticeMesh;
    /// use trixel::{Grid, Job, Mode, VoxelOrder};
    /// use trixel_gpu::{
    ///     AdapterChoice, Gpu, GpuMesh, GpuOctree, GpuSurface, GpuVolume, GpuVoxelList, ListMethod, Options, Voxelizer,
    /// };
    ///
    /// let mesh = trixel::scene::build("torus")?;
    /// let grid = Grid::fit(&mesh.bounds().expect("a torus has triangles"), 256)?;
    /// let job = Job::new(grid, Mode::Conservative);
    /// let request = AttributeRequest::new(&[AttributeKind::Color, AttributeKind::Normal], Combine::Mean);
    /// let gpu = Gpu::open(&AdapterChoice::Any)?;
    /// let lattice = LatticeMesh::snap(&mesh, &grid)?;
    /// let volume = GpuVolume::new(&gpu, grid)?;
    /// let mut voxelizer = Voxelizer::new(&gpu, &job, &Options::default())?;
    /// voxelizer.run(&GpuMesh::upload(&gpu, &lattice)?, &volume)?;
    /// let surface = GpuSurface::upload(&gpu, &mesh, &lattice, &grid, &request)?;
    /// let attributes = voxelizer.attributes(&surface, &volume)?;
    /// let list = GpuVoxelList::of(&gpu, &volume, ListMethod::Scan, VoxelOrder::Morton)?;
    /// let tree = GpuOctree::with_attributes(&gpu, &list, &attributes)?;
    /// println!("from afar: {:?}", tree.find(&gpu, &[[0; 3]], tree.height())?);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// When the list is not along the Morton curve, the attributes are of other voxels, the tree or what building takes
    /// exceeds what the adapter binds, memory runs out or the device is lost.
    pub fn with_attributes(gpu: &Gpu, list: &GpuVoxelList, attributes: &GpuAttributes) -> Result<Self, GpuError> {
        let described = attributes.list();
        if list.grid() != described.grid() || list.len() != described.len() {
            return Err(GpuError::AttributesOfOthers { attributes: described.len(), list: list.len() });
        }
        if list.order() != VoxelOrder::Morton {
            return Err(GpuError::ListOrder);
        }
        let leaves = leaves::leaves(gpu, list, attributes)?;
        Self::build(gpu, list, Some(&leaves))
    }

    fn build(gpu: &Gpu, list: &GpuVoxelList, leaves: Option<&wgpu::Buffer>) -> Result<Self, GpuError> {
        if list.order() != VoxelOrder::Morton {
            return Err(GpuError::ListOrder);
        }
        let levels = Levels::of(gpu, list, leaves)?;
        let nodes = levels.write_nodes(gpu, leaves.is_some())?;
        let looks = leaves.map(|leaves| levels.write_looks(gpu, list.len(), leaves)).transpose()?;
        let everything = nodes.length == 0 && !list.is_empty();
        Ok(Self { grid: *list.grid(), nodes, everything, looks })
    }

    /// The grid that the list had.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The number of levels of nodes; the root's cube is `2^height` voxels wide.
    #[must_use]
    pub fn height(&self) -> u32 {
        height_of(&self.grid)
    }

    /// How many nodes there are.
    #[must_use]
    pub fn len(&self) -> u32 {
        self.nodes.length
    }

    /// Whether there is no node: the grid is empty, or [full](Self::is_full).
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether every voxel of the root's cube is set.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.everything
    }

    /// The nodes, level by level from the root, two `u32` each: [`Node::some`] in the lowest eight bits of the first and
    /// [`Node::full`] in the next eight, then [`Node::first`].
    #[must_use]
    pub fn buffer(&self) -> &wgpu::Buffer {
        &self.nodes.buffer
    }

    /// With attributes, what each node looks like, four `u32` each: the bytes of [`Look::color`], red in the lowest, then the
    /// bits of the floats of [`Look::normal`].
    #[must_use]
    pub fn node_looks(&self) -> Option<&wgpu::Buffer> {
        self.looks.as_ref().map(|looks| &looks.nodes)
    }

    /// With attributes, what the voxels of the last level's nodes look like, likewise, and how many there are. Those of a
    /// node begin at [`Node::first`].
    #[must_use]
    pub fn voxel_looks(&self) -> Option<(&wgpu::Buffer, u32)> {
        self.looks.as_ref().map(|looks| (&looks.voxels, looks.voxel_count))
    }

    /// Bytes of nodes and looks.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let looks = self.looks.as_ref().map_or(0, |looks| u64::from(self.len()) + u64::from(looks.voxel_count));
        8 * u64::from(self.len()) + 4 * LOOK_WORDS as u64 * looks
    }

    /// The same octree as the CPU has it.
    ///
    /// # Errors
    /// When memory runs out, the device is lost, or what comes back is no octree.
    pub fn download(&self, gpu: &Gpu) -> Result<Octree, GpuError> {
        let mut wanted = vec![(self.buffer(), 2 * self.len() as usize)];
        if let Some(looks) = &self.looks {
            wanted.push((&looks.nodes, LOOK_WORDS * self.len() as usize));
            wanted.push((&looks.voxels, LOOK_WORDS * looks.voxel_count as usize));
        }
        let read = Dispatcher::new(gpu).read_words(&wanted)?;
        let nodes = read.iter().take(1).flat_map(|words| words.as_chunks::<2>().0).map(|[masks, first]| {
            let [some, full, ..] = masks.to_le_bytes();
            Node { some, full, first: *first }
        });
        let nodes = nodes.collect();
        let looks = |words: &Vec<u32>| words.as_chunks::<LOOK_WORDS>().0.iter().map(look_of).collect();
        Ok(match read.get(1..) {
            Some([of_nodes, of_voxels]) => {
                Octree::from_nodes_and_looks(self.grid, nodes, self.everything, looks(of_nodes), looks(of_voxels))?
            }
            _ => Octree::from_nodes(self.grid, nodes, self.everything)?,
        })
    }
}

/// A look as `look_of` in `octree_sum.wgsl` has it.
pub(super) fn look_of([color, normal @ ..]: &[u32; LOOK_WORDS]) -> Look {
    Look { color: color.to_le_bytes(), normal: normal.map(f32::from_bits) }
}
