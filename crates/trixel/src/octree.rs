//! Sparse voxel octrees: a volume as a tree of cubes, empty and full ones pruned, attributes averaged upwards.
//!
//! After C. Crassin & S. Green, *Octree-Based Sparse Voxelization Using the GPU Hardware Rasterizer*, 2012, and the sparse
//! solid octree of M. Schwarz & H.-P. Seidel, *Fast Parallel Surface and Solid Voxelization on GPUs*, 2010, section 5.
//!
//! A node stands for a cube of `2^level` voxels and has a mask of the octants that hold any voxel and one of those that
//! are full. Octant `4 x + 2 y + z` is the half that the bits say. An octant that is neither empty nor full has a node of
//! its own; the nodes of one parent follow each other, and nodes lie level by level from the root, each level in the order
//! of the Morton curve. The nodes of the last level have single voxels as octants. So one volume gives one tree, on any
//! device.
//!
//! Voxels with an attribute are never pruned: a solid's inside, which has none, collapses into a few large cubes, and its
//! skin keeps its colours.

use crate::attributes::light::{self, FULL};
use crate::attributes::vector;
use crate::attributes::{AttributeKind, Described, Values};
use crate::grid::Grid;
use crate::volume::{Volume, VolumeError, WORD_BITS};

/// A cube of voxels that is neither empty nor full.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Node {
    /// The octants that hold any voxel.
    pub some: u8,
    /// The octants that are full.
    pub full: u8,
    /// Where the nodes of the octants that are neither begin; on the last level, where their voxels' looks begin, or 0
    /// without attributes.
    pub first: u32,
}

/// What a voxel, or a cube on average, looks like.
///
/// Averages are of the voxels that have attributes, each counting the same, colours by their alpha: sums of integers, so that
/// every device finds the same. Without colours they are white, and without normals these are 0.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Look {
    /// sRGB colour and alpha.
    pub color: [u8; 4],
    /// The unit normal, or 0.
    pub normal: [f32; 3],
}

/// A volume as a sparse octree.
///
/// ```
/// use trixel::octree::Octree;
/// use trixel::{Grid, Volume};
/// let mut volume = Volume::new(Grid::new([0.0; 3], [1.0; 3], [64; 3])?)?;
/// volume.set([5, 6, 7]);
/// let tree = Octree::new(&volume, None)?;
/// assert!(tree.get([5, 6, 7]) && !tree.get([5, 6, 8]));
/// assert_eq!(tree.nodes().len(), 6);
/// let hit = tree.march([5.5, 6.5, 100.0], [0.0, 0.0, -1.0]).ok_or("missed")?;
/// assert_eq!((hit.voxel, hit.distance), ([5, 6, 7], 92.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Octree {
    grid: Grid,
    /// The root stands for a cube of `2^height` voxels.
    height: u32,
    /// Whether the root's cube holds any voxel, and whether it is full: then there are no nodes.
    root: Content,
    nodes: Vec<Node>,
    /// Where each level's nodes begin, from the root's.
    levels: Vec<usize>,
    /// With attributes: the look of every node, and of the last level's voxels.
    node_looks: Vec<Look>,
    voxel_looks: Vec<Look>,
}

/// What a cube holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Content {
    Nothing,
    Everything,
    Some,
}

/// A cube of an octree at a level of detail.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// The cube's index: it begins at `cell * 2^level` voxels.
    pub cell: [u32; 3],
    /// Whether all of it is set.
    pub full: bool,
    /// What it looks like on average, where there are attributes.
    pub look: Option<Look>,
}

/// Where a ray enters a set voxel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The distance, in units of the direction's length.
    pub distance: f64,
    /// The voxel.
    pub voxel: [u32; 3],
    /// The axis of the face through which the ray enters; 0 when it starts inside.
    pub axis: usize,
}

/// Why there is no octree.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum OctreeError {
    /// The coarser levels could not be had while building.
    #[error(transparent)]
    Volume(#[from] VolumeError),
    /// There are more nodes or voxels with attributes than 32-bit pointers reach.
    #[error("the octree has more than 4,294,967,295 nodes or voxels; choose a lower resolution")]
    TooLarge,
    /// Nodes that are no octree's.
    #[error("node {0} of the octree's nodes is not what the nodes before it call for")]
    Nodes(usize),
    /// Looks that are not those of as many nodes and voxels.
    #[error("the octree has {needed} {of}, and there are looks of {given}; give one of each")]
    Looks {
        /// Nodes or voxels.
        of: &'static str,
        /// How many looks there are.
        given: usize,
        /// How many there should be.
        needed: usize,
    },
    /// The attributes are of another volume.
    #[error("the attributes describe another grid; compute them for this volume")]
    GridMismatch,
}

impl Octree {
    /// The octree of a volume; with attributes, colours and normals where they were asked for.
    ///
    /// # Errors
    /// When memory is short, the tree is too large for its pointers, or the attributes are of another grid.
    pub fn new(volume: &Volume, described: Option<&Described<'_>>) -> Result<Self, OctreeError> {
        if described.is_some_and(|described| described.rank().volume().grid() != volume.grid()) {
            return Err(OctreeError::GridMismatch);
        }
        let height = height_of(volume.grid());
        let bare = described.map(|described| without_covered(volume, described)).transpose()?;
        let pyramid = Pyramid::new(volume, bare.as_ref().unwrap_or(volume), height)?;
        let mut tree = Self {
            grid: *volume.grid(),
            height,
            root: pyramid.content(volume, bare.as_ref(), height, [0; 3]),
            nodes: Vec::new(),
            levels: vec![0],
            node_looks: Vec::new(),
            voxel_looks: Vec::new(),
        };
        let mut cubes = if tree.root == Content::Some { vec![[0; 3]] } else { Vec::new() };
        let mut looks = described.map(|_| Vec::new());
        for level in (1..=height).rev() {
            let start = tree.nodes.len() + cubes.len();
            let mut below = Vec::new();
            for cube in cubes {
                let mut node = Node { some: 0, full: 0, first: pointer(start + below.len())? };
                if level == 1 {
                    node.first = pointer(looks.as_ref().map_or(0, Vec::len))?;
                }
                for octant in 0..8 {
                    let child = child_of(cube, octant);
                    match pyramid.content(volume, bare.as_ref(), level - 1, child) {
                        Content::Nothing => {}
                        Content::Everything => {
                            node.some |= 1 << octant;
                            node.full |= 1 << octant;
                        }
                        Content::Some => {
                            node.some |= 1 << octant;
                            below.push(child);
                        }
                    }
                }
                if level == 1 {
                    node.full = node.some;
                    if let (Some(looks), Some(described)) = (&mut looks, described) {
                        let voxels = (0..8).filter(|octant| node.some >> octant & 1 == 1);
                        looks.extend(voxels.map(|octant| Sum::of(described, child_of(cube, octant))));
                    }
                }
                tree.nodes.push(node);
            }
            tree.levels.push(tree.nodes.len());
            cubes = if level == 1 { Vec::new() } else { below };
        }
        pointer(tree.nodes.len())?;
        if let Some(looks) = looks {
            tree.average(&looks);
        }
        Ok(tree)
    }

    /// An octree without attributes of nodes that were built elsewhere, level by level from the root as
    /// [`Octree::nodes`] has them. Without nodes the root's cube is full if `everything`, else empty.
    ///
    /// # Errors
    /// When the nodes are not those that [`Octree::new`] would make.
    pub fn from_nodes(grid: Grid, nodes: Vec<Node>, everything: bool) -> Result<Self, OctreeError> {
        let (levels, _) = levels_of(&grid, &nodes, false)?;
        Ok(Self::assembled(grid, nodes, levels, everything))
    }

    /// An octree with attributes that was built elsewhere: nodes as for [`Octree::from_nodes`], what each of them looks like,
    /// and what the voxels of the last level's nodes look like, as [`Octree::node_looks`] and [`Octree::voxel_looks`] have
    /// them.
    ///
    /// # Errors
    /// When the nodes are not those that [`Octree::new`] would make, or the looks are not as many as the nodes call for. The
    /// looks themselves are taken as they are.
    pub fn from_nodes_and_looks(
        grid: Grid,
        nodes: Vec<Node>,
        everything: bool,
        node_looks: Vec<Look>,
        voxel_looks: Vec<Look>,
    ) -> Result<Self, OctreeError> {
        let (levels, voxels) = levels_of(&grid, &nodes, true)?;
        let counts = [("nodes", node_looks.len(), nodes.len()), ("voxels in nodes", voxel_looks.len(), voxels)];
        if let Some((of, given, needed)) = counts.into_iter().find(|(_, given, needed)| given != needed) {
            return Err(OctreeError::Looks { of, given, needed });
        }
        Ok(Self { node_looks, voxel_looks, ..Self::assembled(grid, nodes, levels, everything) })
    }

    fn assembled(grid: Grid, nodes: Vec<Node>, levels: Vec<usize>, everything: bool) -> Self {
        let root = match (nodes.is_empty(), everything) {
            (false, _) => Content::Some,
            (true, false) => Content::Nothing,
            (true, true) => Content::Everything,
        };
        let height = height_of(&grid);
        Self { grid, height, root, nodes, levels, node_looks: Vec::new(), voxel_looks: Vec::new() }
    }

    /// Averages the voxels' attributes upwards; pruned cubes have none.
    fn average(&mut self, voxels: &[Sum]) {
        self.voxel_looks = voxels.iter().map(Sum::look).collect();
        let mut sums = vec![Sum::default(); self.nodes.len()];
        let leaves = self.levels[self.levels.len() - 2];
        for (index, node) in self.nodes.iter().enumerate().rev() {
            let (first, count, from) = if index >= leaves {
                (node.first as usize, node.some.count_ones() as usize, voxels)
            } else {
                (node.first as usize, (node.some & !node.full).count_ones() as usize, &sums[..])
            };
            let total = from[first..first + count].iter().fold(Sum::default(), Sum::plus);
            sums[index] = total;
        }
        self.node_looks = sums.iter().map(Sum::look).collect();
    }

    /// The grid that the volume had.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The number of levels of nodes; the root's cube is `2^height` voxels wide.
    #[must_use]
    pub fn height(&self) -> u32 {
        self.height
    }

    /// All nodes, level by level from the root.
    #[must_use]
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// With attributes, what each of the [`Octree::nodes`] looks like on average.
    #[must_use]
    pub fn node_looks(&self) -> &[Look] {
        &self.node_looks
    }

    /// With attributes, what the voxels of the last level's nodes look like, those of a node from [`Node::first`] on; 0
    /// throughout where a voxel has no attributes.
    #[must_use]
    pub fn voxel_looks(&self) -> &[Look] {
        &self.voxel_looks
    }

    /// Bytes that the tree takes.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let looks = self.node_looks.len() + self.voxel_looks.len();
        (self.nodes.len() * size_of::<Node>() + looks * size_of::<Look>()) as u64
    }

    /// Whether a voxel is set; a voxel outside the grid is not.
    #[must_use]
    pub fn get(&self, voxel: [u32; 3]) -> bool {
        self.find(voxel, 0).is_some()
    }

    /// What a voxel looks like; `None` when it is not set or has no attributes.
    #[must_use]
    pub fn look(&self, voxel: [u32; 3]) -> Option<Look> {
        self.find(voxel, 0)?.look
    }

    /// The cube of level `level` (2^level voxels wide) that holds `voxel`; `None` when it is empty.
    #[must_use]
    pub fn find(&self, voxel: [u32; 3], level: u32) -> Option<Cell> {
        let cell = voxel.map(|c| c.checked_shr(level).unwrap_or(0));
        let width = 1u32.checked_shl(self.height).unwrap_or(u32::MAX);
        if self.root == Content::Nothing || voxel.iter().any(|&c| c >= width) {
            return None;
        }
        let full = |look| Some(Cell { cell, full: true, look });
        if self.root == Content::Everything {
            return full(None);
        }
        let (mut index, mut at) = (0usize, self.height);
        while at > level {
            let node = self.nodes.get(index)?;
            let octant = octant_of(voxel, at);
            if node.some >> octant & 1 == 0 {
                return None;
            }
            let before = (1u8 << octant) - 1;
            if at == 1 {
                let place = node.first as usize + (node.some & before).count_ones() as usize;
                return full(self.voxel_looks.get(place).copied().filter(|look| *look != Look::default()));
            }
            if node.full >> octant & 1 == 1 {
                return full(None);
            }
            index = node.first as usize + (node.some & !node.full & before).count_ones() as usize;
            at -= 1;
        }
        Some(Cell { cell, full: false, look: self.node_looks.get(index).copied() })
    }

    /// The cubes of `2^level` voxels that hold any voxel, sorted by x, y, z: level 0 gives the voxels themselves.
    #[must_use]
    pub fn cells(&self, level: u32) -> Vec<Cell> {
        let mut cells = Vec::new();
        if level <= self.height {
            self.collect(Some(0), self.root, self.height, [0; 3], level, &mut cells);
        }
        cells.sort_unstable_by_key(|cell| cell.cell);
        cells
    }

    /// Collects the cells of a cube; `index` is its node where it has one.
    fn collect(
        &self,
        index: Option<usize>,
        content: Content,
        at: u32,
        cube: [u32; 3],
        level: u32,
        cells: &mut Vec<Cell>,
    ) {
        let dims = self.grid.dims();
        if content == Content::Nothing || (0..3).any(|i| cube[i] << at >= dims[i]) {
            return;
        }
        if at == level {
            let look = index.filter(|_| content == Content::Some).and_then(|index| self.node_looks.get(index)).copied();
            cells.push(Cell { cell: cube, full: content == Content::Everything, look });
            return;
        }
        let node = index.filter(|_| content == Content::Some).and_then(|index| self.nodes.get(index));
        for octant in 0..8 {
            let child = child_of(cube, octant);
            let Some(node) = node else {
                self.collect(None, content, at - 1, child, level, cells);
                continue;
            };
            let before = (1u8 << octant) - 1;
            if node.some >> octant & 1 == 0 {
                continue;
            }
            if at == 1 {
                cells.extend(self.find(child, 0));
            } else if node.full >> octant & 1 == 1 {
                self.collect(None, Content::Everything, at - 1, child, level, cells);
            } else {
                let index = node.first as usize + (node.some & !node.full & before).count_ones() as usize;
                self.collect(Some(index), Content::Some, at - 1, child, level, cells);
            }
        }
    }

    /// The first set voxel on a ray, which must go on inside it: a ray along a face has the voxel above the face, and edges and
    /// corners that it only touches are passed by. With origins in 1/256 voxel and directions of integers up to 2^15 no
    /// rounding can decide.
    ///
    /// Origin and direction in voxels from the grid's minimum corner; `None` when there
    /// is none, or the direction is 0 or not finite.
    #[must_use]
    pub fn march(&self, origin: [f64; 3], direction: [f64; 3]) -> Option<Hit> {
        if !origin.iter().chain(&direction).all(|c| c.is_finite()) || direction.iter().all(|&c| c == 0.0) {
            return None;
        }
        let ray = Ray { origin, direction };
        let span = ray.through([0; 3], self.height)?;
        self.first_hit(&ray, 0, self.root, self.height, [0; 3], span)
    }

    fn first_hit(&self, ray: &Ray, index: usize, content: Content, at: u32, cube: [u32; 3], span: Span) -> Option<Hit> {
        if content == Content::Nothing {
            return None;
        }
        if content == Content::Everything && at == 0 {
            return Some(Hit { distance: span.from, voxel: cube, axis: span.axis });
        }
        // Down to the voxel in full cubes as well, so that the same divisions decide everywhere.
        let everything = Node { some: u8::MAX, full: u8::MAX, first: 0 };
        let node = if content == Content::Everything { &everything } else { self.nodes.get(index)? };
        let mut entered: [(f64, u8, Option<Span>); 8] = std::array::from_fn(|_| (f64::INFINITY, 0, None));
        for octant in (0..8u8).filter(|octant| node.some >> octant & 1 == 1) {
            let span = ray.through(child_of(cube, octant), at - 1);
            entered[usize::from(octant)] = (span.map_or(f64::INFINITY, |span| span.from), octant, span);
        }
        entered.sort_by(|a, b| a.0.total_cmp(&b.0));
        entered.into_iter().find_map(|(_, octant, span)| {
            let span = span?;
            let before = (1u8 << octant) - 1;
            let content = if node.full >> octant & 1 == 1 { Content::Everything } else { Content::Some };
            let index = node.first as usize + (node.some & !node.full & before).count_ones() as usize;
            self.first_hit(ray, index, content, at - 1, child_of(cube, octant), span)
        })
    }
}

/// The levels of nodes over a grid.
fn height_of(grid: &Grid) -> u32 {
    let longest = grid.dims().into_iter().max().unwrap_or(1);
    longest.next_power_of_two().trailing_zeros().max(1)
}

/// Checks nodes level by level: where each level begins, and how many voxels the last one has. With attributes its nodes say
/// where these voxels' looks begin, and may have all octants.
fn levels_of(grid: &Grid, nodes: &[Node], looks: bool) -> Result<(Vec<usize>, usize), OctreeError> {
    let mut levels = vec![0];
    let mut end = usize::from(!nodes.is_empty());
    let mut voxels = 0;
    for level in (1..=height_of(grid)).rev() {
        let start = *levels.last().unwrap_or(&0);
        let mut next = end;
        for (index, node) in nodes.iter().enumerate().take(end).skip(start) {
            let (first, full) = match level {
                1 => (if looks { voxels } else { 0 }, node.some),
                _ => (next, node.full),
            };
            let pruned = node.full == u8::MAX && !(looks && level == 1);
            let fits = node.some != 0 && !pruned && node.full & !node.some == 0 && node.full == full;
            if !fits || node.first as usize != first {
                return Err(OctreeError::Nodes(index));
            }
            next += (node.some & !node.full).count_ones() as usize;
            voxels += if level == 1 { node.some.count_ones() as usize } else { 0 };
        }
        if end > nodes.len() {
            return Err(OctreeError::Nodes(nodes.len()));
        }
        levels.push(end);
        end = next;
    }
    if end != nodes.len() {
        return Err(OctreeError::Nodes(end));
    }
    Ok((levels, voxels))
}

/// A ray in voxels.
struct Ray {
    origin: [f64; 3],
    direction: [f64; 3],
}

/// The part of a ray inside a cube, and the axis of the face through which it enters.
#[derive(Clone, Copy)]
struct Span {
    from: f64,
    axis: usize,
}

impl Ray {
    /// The part inside the cube with index `cube` of `2^level` voxels, from the origin on; grazing an edge is outside.
    fn through(&self, cube: [u32; 3], level: u32) -> Option<Span> {
        let (mut from, mut to, mut axis) = (0.0, f64::INFINITY, 0);
        for i in 0..3 {
            let (low, high) = (f64::from(cube[i] << level), f64::from((cube[i] + 1) << level));
            if self.direction[i] == 0.0 {
                if self.origin[i] < low || self.origin[i] >= high {
                    return None;
                }
                continue;
            }
            let (a, b) = ((low - self.origin[i]) / self.direction[i], (high - self.origin[i]) / self.direction[i]);
            let (near, far) = (a.min(b), a.max(b));
            if near > from {
                (from, axis) = (near, i);
            }
            to = to.min(far);
        }
        (from < to).then_some(Span { from, axis })
    }
}

/// The index of an octant's cube.
fn child_of(cube: [u32; 3], octant: u8) -> [u32; 3] {
    [2, 1, 0].map(|shift| u32::from(octant >> shift & 1)).into_iter().zip(cube).enumerate().fold(
        [0; 3],
        |mut child, (i, (bit, c))| {
            child[i] = 2 * c + bit;
            child
        },
    )
}

/// The octant of a cube of `2^level` voxels that holds a voxel.
fn octant_of(voxel: [u32; 3], level: u32) -> u8 {
    let bit = |c: u32| u8::from(c >> (level - 1) & 1 == 1);
    bit(voxel[0]) << 2 | bit(voxel[1]) << 1 | bit(voxel[2])
}

fn pointer(index: usize) -> Result<u32, OctreeError> {
    u32::try_from(index).map_err(|_| OctreeError::TooLarge)
}

/// The voxels that have no triangle, which may be pruned.
fn without_covered(volume: &Volume, described: &Described<'_>) -> Result<Volume, VolumeError> {
    let mut bare = Volume::new(*volume.grid())?;
    for voxel in volume.iter() {
        if described
            .rank()
            .of(voxel)
            .is_none_or(|rank| usize::try_from(rank).is_ok_and(|rank| !described.attributes().is_covered(rank)))
        {
            bare.set(voxel);
        }
    }
    Ok(bare)
}

/// Which cubes hold any voxel, and which are full of bare ones: two bits a cube and level.
struct Pyramid {
    any: Vec<Volume>,
    all: Vec<Volume>,
}

impl Pyramid {
    fn new(volume: &Volume, bare: &Volume, height: u32) -> Result<Self, VolumeError> {
        let (mut any, mut all) = (Vec::new(), Vec::new());
        for _ in 0..height {
            let next = (
                halved(any.last().unwrap_or(volume), |a, b| a | b)?,
                halved(all.last().unwrap_or(bare), |a, b| a & b)?,
            );
            any.push(next.0);
            all.push(next.1);
        }
        Ok(Self { any, all })
    }

    fn content(&self, volume: &Volume, bare: Option<&Volume>, level: u32, cube: [u32; 3]) -> Content {
        let (any, all) = match (level as usize).checked_sub(1) {
            Some(above) => (self.any.get(above), self.all.get(above)),
            None => (Some(volume), Some(bare.unwrap_or(volume))),
        };
        if !any.is_some_and(|any| any.get(cube)) {
            Content::Nothing
        } else if all.is_some_and(|all| all.get(cube)) {
            Content::Everything
        } else {
            Content::Some
        }
    }
}

/// A volume of half the size, each voxel made of eight by `join`; outside the grid nothing is set.
fn halved(volume: &Volume, join: impl Fn(u64, u64) -> u64) -> Result<Volume, VolumeError> {
    let dims = volume.grid().dims();
    let smaller = dims.map(|n| n.div_ceil(2));
    // Where the cubes are does not matter here.
    let Ok(grid) = Grid::new([0.0; 3], [1.0; 3], smaller) else { return Volume::new(*volume.grid()) };
    let mut out = Volume::new(grid)?;
    let column_words = out.column_words();
    for (column, words) in (0u32..).zip(out.words_mut().chunks_exact_mut(column_words)) {
        let (x, y) = (column / smaller[1], column % smaller[1]);
        for (index, word) in words.iter_mut().enumerate() {
            let half = |i: usize| {
                let fetch = |dx: u32, dy: u32| {
                    let (x, y) = (2 * x + dx, 2 * y + dy);
                    let inside = x < dims[0] && y < dims[1];
                    if inside { volume.column(x, y).get(i).copied().unwrap_or(0) } else { 0 }
                };
                let four = join(join(fetch(0, 0), fetch(0, 1)), join(fetch(1, 0), fetch(1, 1)));
                even_bits(join(four, four >> 1))
            };
            *word = half(2 * index) | half(2 * index + 1) << (WORD_BITS / 2);
        }
    }
    Ok(out)
}

/// Bits 0, 2, 4, ... next to each other.
fn even_bits(mut x: u64) -> u64 {
    x &= 0x5555_5555_5555_5555;
    x = (x | x >> 1) & 0x3333_3333_3333_3333;
    x = (x | x >> 2) & 0x0f0f_0f0f_0f0f_0f0f;
    x = (x | x >> 4) & 0x00ff_00ff_00ff_00ff;
    x = (x | x >> 8) & 0x0000_ffff_0000_ffff;
    (x | x >> 16) & 0xffff_ffff
}

/// Sums of attributes, in integers, so that no order shows.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    voxels: u64,
    /// Linear light times alpha, and alpha.
    color: [u64; 4],
    normal: [i64; 3],
}

impl Sum {
    /// Of one voxel; of none when it has no attributes.
    fn of(described: &Described<'_>, voxel: [u32; 3]) -> Self {
        let attributes = described.attributes();
        let place = described.rank().of(voxel).and_then(|rank| usize::try_from(rank).ok());
        let covered = place.filter(|&place| attributes.is_covered(place));
        let Some(row) = covered.and_then(|place| attributes.row(place)) else { return Self::default() };
        let color = match attributes.get(AttributeKind::Color) {
            Some(Values::U8x4(colors)) => colors.get(row).copied().unwrap_or_default(),
            _ => [u8::MAX; 4],
        };
        let [r, g, b] = [color[0], color[1], color[2]].map(light::linear_of_srgb);
        let alpha = light::widen(color[3]);
        let normal = match attributes.get(AttributeKind::Normal) {
            Some(Values::F32x3(normals)) => normals.get(row).copied().unwrap_or_default(),
            _ => [0.0; 3],
        };
        let shown = [r, g, b].map(|c| u64::from(light::multiply(c, alpha)));
        Self { voxels: 1, color: [shown[0], shown[1], shown[2], u64::from(alpha)], normal: vector::integers(normal) }
    }

    fn plus(self, other: &Self) -> Self {
        Self {
            voxels: self.voxels + other.voxels,
            color: std::array::from_fn(|i| self.color[i] + other.color[i]),
            normal: std::array::from_fn(|i| self.normal[i] + other.normal[i]),
        }
    }

    fn look(&self) -> Look {
        if self.voxels == 0 {
            return Look::default();
        }
        let [r, g, b, a] = self.color;
        let narrow = |value: u64| u16::try_from(value).unwrap_or(FULL);
        let straight = |c: u64| narrow((c * u64::from(FULL) + a / 2) / a.max(1));
        let alpha = narrow((a + self.voxels / 2) / self.voxels);
        Look {
            color: light::encode([straight(r), straight(g), straight(b), alpha]),
            normal: vector::floats(vector::normalized(self.normal).unwrap_or_default()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attributes::{AttributeRequest, Combine, compute};
    use crate::conformance::random::Random;
    use crate::job::Job;
    use crate::lattice::LatticeMesh;
    use crate::mode::Mode;
    use crate::rank::Rank;
    use crate::{Material, scene, voxelize};

    /// Boxes and single voxels, so that there are full and empty cubes of all sizes.
    fn random_volume(random: &mut Random, dims: [u32; 3]) -> Volume {
        let mut volume = Volume::new(Grid::new([0.0; 3], [1.0; 3], dims).unwrap()).unwrap();
        for round in 0..12 {
            let size = if round < 3 { 24 } else { 1 };
            let low: [u32; 3] = dims.map(|d| u32::try_from(random.range(0, i64::from(d) - 1)).unwrap());
            let high: [u32; 3] = std::array::from_fn(|i| (low[i] + size).min(dims[i]));
            for x in low[0]..high[0] {
                for y in low[1]..high[1] {
                    (low[2]..high[2]).for_each(|z| volume.set([x, y, z]));
                }
            }
        }
        volume
    }

    fn all(dims: [u32; 3]) -> impl Iterator<Item = [u32; 3]> {
        (0..dims[0]).flat_map(move |x| (0..dims[1]).flat_map(move |y| (0..dims[2]).map(move |z| [x, y, z])))
    }

    #[test]
    fn the_tree_has_the_voxels_of_the_volume() {
        let mut random = Random::new(31);
        for dims in [[40, 33, 70], [1, 1, 1], [64, 64, 64], [2, 130, 5], [16, 16, 16]] {
            let volume = random_volume(&mut random, dims);
            let tree = Octree::new(&volume, None).unwrap();
            assert!(all(dims.map(|d| d + 2)).all(|voxel| tree.get(voxel) == volume.get(voxel)), "{dims:?}");
            assert!(tree.cells(0).iter().map(|cell| cell.cell).eq(volume.iter()), "{dims:?}");
            for level in 0..=tree.height() {
                let mut expected: Vec<_> = volume.iter().map(|voxel| voxel.map(|c| c >> level)).collect();
                expected.sort_unstable();
                expected.dedup();
                let cells = tree.cells(level);
                assert!(cells.iter().map(|cell| cell.cell).eq(expected), "{dims:?} {level}");
                for cell in cells {
                    let low = cell.cell.map(|c| c << level);
                    let full = all([1 << level; 3]).all(|v| volume.get(std::array::from_fn(|i| low[i] + v[i])));
                    assert_eq!(cell.full, full, "{cell:?}");
                }
            }
        }
        assert!(
            Octree::new(&Volume::new(Grid::new([0.0; 3], [1.0; 3], [9; 3]).unwrap()).unwrap(), None)
                .unwrap()
                .cells(0)
                .is_empty()
        );
    }

    #[test]
    fn trees_of_nodes_are_checked() {
        let mut random = Random::new(33);
        for dims in [[40, 33, 70], [1, 1, 1], [64, 64, 64]] {
            let tree = Octree::new(&random_volume(&mut random, dims), None).unwrap();
            let again = Octree::from_nodes(*tree.grid(), tree.nodes().to_vec(), false);
            assert_eq!(again.as_ref(), Ok(&tree), "{dims:?}");
            let last = tree.nodes().len() - 1;
            for change in [|n: &mut Node| n.first += 1, |n: &mut Node| n.some = 0, |n: &mut Node| n.full = u8::MAX] {
                let mut nodes = tree.nodes().to_vec();
                change(&mut nodes[last]);
                assert_eq!(Octree::from_nodes(*tree.grid(), nodes, false), Err(OctreeError::Nodes(last)));
            }
            let fewer = Octree::from_nodes(*tree.grid(), tree.nodes()[..last].to_vec(), false);
            assert!(fewer.is_err() || last == 0, "{dims:?}");
            let more = [tree.nodes(), &tree.nodes()[last..]].concat();
            assert_eq!(Octree::from_nodes(*tree.grid(), more, false), Err(OctreeError::Nodes(last + 1)));
        }
        let grid = Grid::new([0.0; 3], [1.0; 3], [8; 3]).unwrap();
        assert!(Octree::from_nodes(grid, Vec::new(), true).unwrap().get([7; 3]));
        assert!(!Octree::from_nodes(grid, Vec::new(), false).unwrap().get([7; 3]));
    }

    #[test]
    fn full_and_empty_cubes_have_no_nodes() {
        let mut volume = Volume::new(Grid::new([0.0; 3], [1.0; 3], [64; 3]).unwrap()).unwrap();
        all([64; 3]).for_each(|voxel| volume.set(voxel));
        let tree = Octree::new(&volume, None).unwrap();
        assert_eq!((tree.nodes().len(), tree.get([63; 3]), tree.cells(5).len()), (0, true, 8));
        let hit = tree.march([-3.0, 5.5, 6.5], [2.0, 0.0, 0.0]).unwrap();
        assert_eq!(hit, Hit { distance: 1.5, voxel: [0, 5, 6], axis: 0 });
        let hit = tree.march([5.5, 5.5, 70.0], [0.0, 0.0, -1.0]).unwrap();
        assert_eq!(hit, Hit { distance: 6.0, voxel: [5, 5, 63], axis: 2 });
        // One voxel less splits one path of cubes.
        let column = volume.column_words();
        volume.words_mut()[column] &= !1;
        assert_eq!(Octree::new(&volume, None).unwrap().nodes().len(), 6);
    }

    #[test]
    fn rays_hit_what_a_search_finds() {
        let mut random = Random::new(32);
        let dims = [40, 33, 70];
        let volume = random_volume(&mut random, dims);
        let tree = Octree::new(&volume, None).unwrap();
        let voxels: Vec<_> = volume.iter().collect();
        let mut hits = 0;
        for _ in 0..400 {
            let mut point = |spread: i64| -> [f64; 3] {
                std::array::from_fn(|i| {
                    random.range(-spread, i64::from(dims[i]) * 64 + spread) as f64 / 64.0 + 1.0 / 128.0
                })
            };
            let (origin, target) = (point(3000), point(0));
            let direction: [f64; 3] = std::array::from_fn(|i| target[i] - origin[i]);
            let ray = Ray { origin, direction };
            let nearest = voxels
                .iter()
                .filter_map(|&voxel| Some((ray.through(voxel, 0)?.from, voxel)))
                .min_by(|a, b| a.0.total_cmp(&b.0));
            let found = tree.march(origin, direction);
            assert_eq!(found.map(|hit| hit.distance), nearest.map(|(distance, _)| distance));
            if let Some(hit) = found {
                assert!(volume.get(hit.voxel), "{hit:?}");
                hits += 1;
            }
        }
        assert!(hits > 100);
        for nonsense in [[0.0; 3], [f64::NAN, 1.0, 0.0], [f64::INFINITY; 3]] {
            assert!(tree.march([1.0; 3], nonsense).is_none());
        }
    }

    #[test]
    fn attributes_are_averaged_upwards_and_kept_at_the_skin() {
        let mut mesh = scene::build("sphere:3").unwrap();
        mesh.materials = vec![Material { base_color: [0.0, 0.5, 1.0, 1.0], ..Material::default() }];
        mesh.triangle_materials = vec![0; mesh.triangles.len()];
        let job = Job::new(Grid::fit(&mesh.bounds().unwrap(), 50).unwrap(), Mode::Solid);
        let volume = voxelize(&mesh, &job).unwrap();
        let lattice = LatticeMesh::snap(&mesh, job.grid()).unwrap();
        let request = AttributeRequest::new(&[AttributeKind::Color, AttributeKind::Normal], Combine::Mean);
        let attributes = compute(&mesh, &lattice, &job, &volume, &request).unwrap();
        let rank = Rank::new(&volume);
        let described = Described::new(&rank, &attributes).unwrap();
        let tree = Octree::new(&volume, Some(&described)).unwrap();
        let color = [0, 188, 255, 255];
        for voxel in volume.iter() {
            assert!(tree.get(voxel));
            assert_eq!(tree.look(voxel).map(|look| look.color), described.color(voxel), "{voxel:?}");
        }
        assert!(tree.nodes().len() < volume.iter().count() / 6, "the inside is pruned");
        for level in 1..=tree.height() {
            for cell in tree.cells(level).into_iter().filter(|cell| !cell.full) {
                assert_eq!(cell.look.unwrap().color, color, "{level} {cell:?}");
            }
        }
        // Top octants of the sphere look up.
        let top = tree.cells(4).into_iter().filter(|cell| cell.cell[2] == 3).filter_map(|cell| cell.look);
        assert!(top.map(|look| look.normal[2]).all(|z| z > 0.3));
    }

    #[test]
    fn trees_with_looks_are_checked() {
        let mut mesh = scene::build("sphere:3").unwrap();
        mesh.materials = vec![Material { base_color: [0.0, 0.5, 1.0, 1.0], ..Material::default() }];
        mesh.triangle_materials = vec![0; mesh.triangles.len()];
        let job = Job::new(Grid::fit(&mesh.bounds().unwrap(), 20).unwrap(), Mode::Solid);
        let volume = voxelize(&mesh, &job).unwrap();
        let lattice = LatticeMesh::snap(&mesh, job.grid()).unwrap();
        let request = AttributeRequest::new(&[AttributeKind::Color], Combine::Mean);
        let attributes = compute(&mesh, &lattice, &job, &volume, &request).unwrap();
        let rank = Rank::new(&volume);
        let tree = Octree::new(&volume, Described::new(&rank, &attributes).as_ref()).unwrap();
        let built = |nodes: &[Node], node_looks: &[Look], voxel_looks: &[Look]| {
            let [node_looks, voxel_looks] = [node_looks, voxel_looks].map(<[_]>::to_vec);
            Octree::from_nodes_and_looks(*job.grid(), nodes.to_vec(), false, node_looks, voxel_looks)
        };
        let (nodes, node_looks, voxel_looks) = (tree.nodes(), tree.node_looks(), tree.voxel_looks());
        assert_eq!(built(nodes, node_looks, voxel_looks).as_ref(), Ok(&tree));
        let (given, needed) = (nodes.len() - 1, nodes.len());
        let fewer = built(nodes, &node_looks[1..], voxel_looks);
        assert_eq!(fewer, Err(OctreeError::Looks { of: "nodes", given, needed }));
        let fewer = built(nodes, node_looks, &voxel_looks[1..]);
        assert!(matches!(fewer, Err(OctreeError::Looks { of: "voxels in nodes", .. })));
        // Its last nodes point to looks, and some have all octants, which bare ones never do.
        assert!(matches!(Octree::from_nodes(*job.grid(), nodes.to_vec(), false), Err(OctreeError::Nodes(_))));
        assert!(nodes.iter().any(|node| node.full == u8::MAX));
        let mut wrong = nodes.to_vec();
        wrong[needed - 1].first += 1;
        assert_eq!(built(&wrong, node_looks, voxel_looks), Err(OctreeError::Nodes(needed - 1)));
    }

    #[test]
    fn a_sparse_surface_takes_little_memory() {
        let mesh = scene::build("torus:40").unwrap();
        let job = Job::new(Grid::fit(&mesh.bounds().unwrap(), 200).unwrap(), Mode::Conservative);
        let volume = voxelize(&mesh, &job).unwrap();
        let tree = Octree::new(&volume, None).unwrap();
        assert!(tree.bytes() < 4 * volume.count(), "{} bytes for {} voxels", tree.bytes(), volume.count());
    }
}
