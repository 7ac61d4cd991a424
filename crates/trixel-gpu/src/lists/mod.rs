//! Lists of the set voxels on the GPU: \[HCV\] 3.4.

mod append;
mod histopyramid;
mod scan;
mod sort;

use trixel::{Grid, VoxelOrder};

use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::kernel::{Bound, Dispatcher};
use crate::volume::{GpuVolume, Slab};

pub(crate) use append::{append, appended};
pub(crate) use scan::count;
pub(crate) use sort::{SortKey, sort_pairs};
use sort::{distinct, sort};

/// How a list of the set voxels is made. All methods give the same list.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ListMethod {
    /// From the finished bits, by prefix sums over population counts.
    #[default]
    Scan,
    /// From the finished bits, by a pyramid of sums that every entry descends alone (Ziegler et al. 2006).
    Histopyramid,
    /// While voxelizing: whoever sets a bit first appends the voxel to the list, which is then sorted. The dense bits are
    /// the claim buffer that keeps duplicates out.
    Atomic,
    /// While voxelizing, without dense bits: every voxel of every triangle is appended, and duplicates are merged after
    /// sorting (Crassin & Green 2012). Not for solids, whose insides no triangle meets.
    FragmentList,
}

/// A name that is no [`ListMethod`]'s.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no list method is named `{0}`; there are scan, histopyramid, atomic and fragment-list")]
pub struct UnknownListMethod(pub String);

impl ListMethod {
    /// Every method.
    pub const ALL: [Self; 4] = [Self::Scan, Self::Histopyramid, Self::Atomic, Self::FragmentList];

    /// The name on the command line and in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Scan => "scan",
            Self::Histopyramid => "histopyramid",
            Self::Atomic => "atomic",
            Self::FragmentList => "fragment-list",
        }
    }
}

impl std::fmt::Display for ListMethod {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for ListMethod {
    type Err = UnknownListMethod;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::ALL.into_iter().find(|method| method.name() == name).ok_or_else(|| UnknownListMethod(name.to_owned()))
    }
}

/// The set voxels of a grid as a sorted list in a buffer of a [`Gpu`].
///
/// ```no_run
/// use trixel::lattice::LatticeMesh;
/// use trixel::{Grid, Job, Mode, VoxelOrder};
/// use trixel_gpu::{AdapterChoice, Gpu, GpuMesh, ListMethod, Options, Voxelizer};
///
/// let mesh = trixel::scene::build("torus")?;
/// let grid = Grid::fit(&mesh.bounds().expect("a torus has triangles"), 256)?;
/// let job = Job::new(grid, Mode::Conservative);
/// let gpu = Gpu::open(&AdapterChoice::Any)?;
/// let mesh = GpuMesh::upload(&gpu, &LatticeMesh::snap(&mesh, &grid)?)?;
/// let list = Voxelizer::new(&gpu, &job, &Options::default())?
///     .list(&mesh, ListMethod::Scan, VoxelOrder::Morton)?;
/// println!("{} voxels, the first is {:?}", list.len(), list.download(&gpu)?.first());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct GpuVoxelList {
    grid: Grid,
    order: VoxelOrder,
    entries: wgpu::Buffer,
    length: u32,
    scratch_bytes: u64,
}

/// Entries of a list, before they are sorted or after.
#[derive(Debug)]
pub(crate) struct Entries {
    /// Two words an entry.
    pub(crate) buffer: wgpu::Buffer,
    pub(crate) length: u32,
}

/// Bytes of an entry.
const ENTRY_BYTES: u64 = 8;

impl Entries {
    /// Room for so many.
    pub(crate) fn new(gpu: &Gpu, length: u32) -> Result<Self, GpuError> {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        // An empty one is still bound.
        let bytes = u64::from(length.max(1)) * ENTRY_BYTES;
        Ok(Self { buffer: gpu.storage("the list's voxels", bytes, usage)?, length })
    }
}

/// The most memory that was in use at any time beside the volume and the finished list.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Memory(u64);

impl Memory {
    /// So many bytes are in use together.
    pub(crate) fn reach(&mut self, bytes: u64) {
        self.0 = self.0.max(bytes);
    }

    pub(crate) fn most(&self) -> u64 {
        self.0
    }
}

impl GpuVoxelList {
    /// The list of what `volume` holds, after everything submitted so far; waits for the number of voxels.
    ///
    /// # Errors
    /// When the method works only while voxelizing ([`crate::Voxelizer::list`] knows all), the list exceeds what the adapter
    /// binds, memory runs out or the device is lost.
    pub fn of(gpu: &Gpu, volume: &GpuVolume, method: ListMethod, order: VoxelOrder) -> Result<Self, GpuError> {
        let mut memory = Memory::default();
        let entries = match method {
            ListMethod::Scan => scan::list(gpu, volume, &mut memory)?,
            ListMethod::Histopyramid => histopyramid::list(gpu, volume, &mut memory)?,
            ListMethod::Atomic | ListMethod::FragmentList => {
                let (of, instead) = ("of voxels that are there already", "scan or histopyramid");
                return Err(GpuError::ListMethod { method, of, instead });
            }
        };
        let entries = match order {
            // The order of the bits.
            VoxelOrder::Xyz => entries,
            VoxelOrder::Morton => sort(gpu, entries, volume.grid(), order, &mut memory)?,
        };
        Ok(Self::new(*volume.grid(), order, entries, memory))
    }

    pub(crate) fn new(grid: Grid, order: VoxelOrder, entries: Entries, memory: Memory) -> Self {
        let Entries { buffer, length } = entries;
        Self { grid, order, entries: buffer, length, scratch_bytes: memory.0 }
    }

    /// The grid.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The order of the voxels.
    #[must_use]
    pub fn order(&self) -> VoxelOrder {
        self.order
    }

    /// How many voxels there are.
    #[must_use]
    pub fn len(&self) -> u32 {
        self.length
    }

    /// Whether no voxel is set.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.length == 0
    }

    /// The voxels, two `u32` each: x in the low half of the first and y in its high half, then z. The buffer may be longer
    /// than the list.
    #[must_use]
    pub fn buffer(&self) -> &wgpu::Buffer {
        &self.entries
    }

    /// Bytes of the list.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        u64::from(self.length) * ENTRY_BYTES
    }

    /// The most bytes that making it took at any time, beside the volume and the list itself.
    #[must_use]
    pub fn scratch_bytes(&self) -> u64 {
        self.scratch_bytes
    }

    /// The voxels `[x, y, z]`.
    ///
    /// # Errors
    /// When memory runs out or the device is lost.
    pub fn download(&self, gpu: &Gpu) -> Result<Vec<[u32; 3]>, GpuError> {
        let words = self.length as usize * 2;
        let read = Dispatcher::new(gpu).read_words(&[(&self.entries, words)])?;
        let entries = read.iter().flat_map(|words| words.as_chunks::<2>().0);
        Ok(entries.map(|[xy, z]| [xy & 0xffff, xy >> 16, *z]).collect())
    }
}

/// `Slab` of `slab.wgsl`.
fn slab_words(volume: &GpuVolume, slab: &Slab, first: u32, voxels: u32) -> [u32; 6] {
    let ny = volume.grid().dims()[1];
    let words = u32::try_from(volume.slab_bytes(slab) / 4).unwrap_or(u32::MAX);
    [ny, volume.column_words, slab.x(), words, first, voxels]
}

/// Where each slab's voxels begin in the list, and the number of all.
fn starts(gpu: &Gpu, totals: &[u32]) -> Result<(Vec<u32>, u32), GpuError> {
    let mut starts = vec![];
    let mut sum = 0u64;
    for total in totals {
        starts.push(u32::try_from(sum).unwrap_or(u32::MAX));
        sum += u64::from(*total);
    }
    let length = u32::try_from(sum).map_err(|_| GpuError::BindingTooSmall {
        adapter: gpu.info().to_string(),
        what: "the list's voxels",
        needed: sum * ENTRY_BYTES,
        limit: gpu.limits().binding_bytes,
    })?;
    Ok((starts, length))
}

/// Counts the voxels of every slab, makes a list of as many, and writes every slab's part of it.
fn by_slabs<Counted>(
    gpu: &Gpu,
    volume: &GpuVolume,
    count: impl Fn(&mut Dispatcher<'_>, &Slab) -> Result<Counted, GpuError>,
    total: impl Fn(&Counted) -> &wgpu::Buffer,
    write: impl Fn(&mut Dispatcher<'_>, [u32; 6], &Slab, &Counted, &wgpu::Buffer) -> Result<(), GpuError>,
) -> Result<Entries, GpuError> {
    let mut counting = Dispatcher::new(gpu);
    let counted = volume.slabs().iter().map(|slab| count(&mut counting, slab)).collect::<Result<Vec<_>, _>>()?;
    let totals: Vec<_> = counted.iter().map(|counted| (total(counted), 1)).collect();
    let totals: Vec<u32> = counting.read_words(&totals)?.into_iter().flatten().collect();
    let (starts, length) = starts(gpu, &totals)?;
    let entries = Entries::new(gpu, length)?;
    let mut writing = Dispatcher::new(gpu);
    for (((slab, counted), start), voxels) in volume.slabs().iter().zip(&counted).zip(starts).zip(totals) {
        if voxels > 0 {
            write(&mut writing, slab_words(volume, slab, start, voxels), slab, counted, &entries.buffer)?;
        }
    }
    writing.submit()?;
    Ok(entries)
}

/// The bindings of a slab's parameters and bits.
fn slab_bound<'a>(words: &'a [u32; 6], slab: &'a Slab) -> [(u32, Bound<'a>); 2] {
    [(0, Bound::Words(words)), (1, Bound::Buffer(slab.buffer()))]
}
