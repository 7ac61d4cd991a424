//! What is in a voxel: colour, normals, texture coordinates, materials and more, for the set voxels only.
//!
//! After \[HCV\] sections 3.4 and 3.5, J. Pantaleoni, *VoxelPipe*, 2011 (the ways to combine) and C. Crassin & S. Green,
//! *Octree-Based Sparse Voxelization*, 2012. Occupancy comes first; [`Rank`] gives each set voxel its place in the list
//! of all of them, and attributes are rows of that list, so memory follows the set voxels and not the grid.
//!
//! # Definition
//!
//! Everything below is integer arithmetic on quantized inputs, so that no order of threads, no vector width and no device
//! can change a result. `>>` rounds down.
//!
//! **Pairs.** A triangle counts in a set voxel when, in a surface mode, the mode's own set of that triangle alone has the
//! voxel. For [`Mode::Solid`] it counts when it meets the closed cube of twice the voxel's width
//! around the voxel's centre: then every voxel that touches the outside has a triangle; voxels deeper inside have none.
//!
//! **Point.** The attribute is read at the point of the triangle nearest to the voxel's centre, in voxel space, clamped to
//! the triangle, so nothing is extrapolated. Let b be the bits of the longest side of the triangle's box in lattice steps
//! (S = 2^16 a voxel) and s = max(clamp(b - 13, 2, 9), b - 30). Corners and centre are rounded to units of 2^s steps,
//! `(q + 2^(s-1)) >> s` (centres are whole). Ericson's region tests (*Real-Time Collision Detection*, section 5.1.5) on
//! these are exact, ties in his order: corners a, b, c, edges ab, ac, bc (ab and ac only with a length), inside. Up to 64 voxels of extent they fit 64
//! bits. A barycentric weight is the ratio n / d of two of its numbers: both shifted right by k until d has at most 31
//! bits, `w = (floor(2^17 n / d) + 1) >> 1`; weights sum to 2^16, and what rounding leaves over is the first corner's (on
//! the edge bc the second's). At most 2^-13 of the triangle's size, or 1/128 voxel, is lost.
//!
//! **Distance** of that point: per axis `o = (sum of w_k (q_k - centre) + 2^19) >> 20`, in 2^-12 voxels, at full lattice
//! precision; the sum of squares, at most 2^32 - 1.
//!
//! **Overlap** of triangle and voxel: corners relative to the voxel's low corner in 2^-10 voxels, `(q + 32) >> 6`; clipped
//! against x >= 0, x <= 1024, then y, then z; an edge is cut from its inner end a to its outer end b at
//! `a + floor((b - a) n / d)` per coordinate, with n and n - d the ends' signed depths. Twice the area is the integer square
//! root of the squared length of the sum of the fan's cross products.
//!
//! **Values.** Vertex colours and base colours are linear light in 16 bits (`round_ties_even(65535 c)`); 8-bit sRGB texels
//! become 16-bit linear by table; products are rounded, `(p + (p >> 16)) >> 16` with `p = a b + 2^15`. Between corners,
//! `(sum of w_k c_k + 2^15) >> 16`. Colour is vertex colour x base colour x texture, alpha the same times the opacity
//! texture. Opaque materials have alpha 1; masked ones alpha 1 where alpha >= the cutoff, and elsewhere *the pair does not
//! count*; blended ones keep alpha. Normals have 15 bits: the corners' unit vectors rounded, summed by weight, shifted to
//! 15 bits and divided by the integer square root; in the mesh's own space. Without shading normals the geometric one
//! stands in.
//!
//! The geometric normal is the cross product of two edges in f64, their coordinates divided by the voxel's longest side.
//! Both kinds of normal are divided by their largest component, then by their length, and rounded to 15 bits.
//!
//! **Textures.** A corner's texel coordinate is `round_ties_even(256 n (u - p))` in f64, with u after the texture's
//! transform, n the image's side and, where it repeats, p the even whole number at or below the least corner's u. Between
//! corners it moves by `(w_b (t_b - t_a) + w_c (t_c - t_a) + 2^15) >> 16`. Bilinear shares have 8 bits an axis; texel
//! centres are at half a texel. Where the texture has [mipmaps](crate::Texture::mipmaps), a triangle reads the first level
//! on which a voxel's face covers at most two texels; each level halves (rounding down, at least 1) the one below, in
//! linear light, colours counted by alpha.
//!
//! What is computed in f64 (quantized colours and normals, texel coordinates of corners, the level) is computed once a
//! vertex or triangle, by the processor; a device that repeats the rest takes it as integers.
//!
//! **Combining** ([`Combine`]) only adds integers and compares them. Of equal candidates the lowest triangle wins. Sums of
//! colour are weighted by alpha; means are rounded. Normals that sum to zero become the winner's. The result is given as
//! 8-bit sRGB with 8-bit alpha, and as f32 that hold the integers exactly.
//!
//! ```
//! use trixel::attributes::{AttributeKind, AttributeRequest, Combine, Values, compute};
//! use trixel::lattice::LatticeMesh;
//! use trixel::{Grid, Job, Mode, Rank};
//!
//! let mut mesh = trixel::scene::build("cube")?;
//! mesh.materials = vec![trixel::Material { base_color: [1.0, 0.0, 0.0, 1.0], ..Default::default() }];
//! mesh.triangle_materials = vec![0; mesh.triangles.len()];
//! let job = Job::new(Grid::fit(&mesh.bounds().ok_or("empty")?, 20)?, Mode::Conservative);
//! let volume = trixel::voxelize(&mesh, &job)?;
//! let lattice = LatticeMesh::snap(&mesh, job.grid())?;
//! let request = AttributeRequest::new(&[AttributeKind::Color], Combine::Mean);
//! let attributes = compute(&mesh, &lattice, &job, &volume, &request)?;
//! let Some(Values::U8x4(colors)) = attributes.get(AttributeKind::Color) else { unreachable!() };
//! let place = Rank::new(&volume).of([0, 0, 0]).ok_or("not set")?;
//! assert_eq!(colors[place as usize], [255, 0, 0, 255]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod combine;
mod described;
pub mod device;
pub(crate) mod light;
mod nearest;
mod overlap;
mod surface;
#[cfg(test)]
mod tests;
mod texture;
pub(crate) mod vector;
mod work;

pub use described::Described;

use combine::{Cell, Row, Sums, Wanted};
use nearest::Nearest;
use surface::{COORDINATE_BITS, EMISSION_ONE, Surface, Textures};
use work::{Slab, Work};

use crate::cpu::fragments::Pairs;
use crate::job::Job;
use crate::lattice::LatticeMesh;
use crate::mesh::Mesh;
use crate::mode::Mode;
use crate::rank::Rank;
use crate::volume::{Volume, set_bits};

/// Something that a voxel can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum AttributeKind {
    /// `U8x4`: sRGB colour and alpha. Alpha 0 with no triangle marks what the alpha test cut out.
    Color,
    /// `F32x3`: the shading normal, a unit vector in the mesh's space.
    Normal,
    /// `F32x3`: the normal of the triangle's plane, turned by the right-hand rule.
    GeometricNormal,
    /// `F32x2`: the first set of texture coordinates, v down.
    Texcoord,
    /// `U32`: the material's number; 2^32 - 1 for none.
    Material,
    /// `U32`: the triangle's number; 2^32 - 1 for none.
    Triangle,
    /// `F32x3`: the weights of that triangle's corners at the point.
    Barycentric,
    /// `F32x3`: emitted light, linear.
    Emission,
    /// `F32x2`: metalness, then roughness.
    MetallicRoughness,
}

impl AttributeKind {
    /// Every attribute.
    pub const ALL: [Self; 9] = [
        Self::Color,
        Self::Normal,
        Self::GeometricNormal,
        Self::Texcoord,
        Self::Material,
        Self::Triangle,
        Self::Barycentric,
        Self::Emission,
        Self::MetallicRoughness,
    ];

    /// The name on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Color => "color",
            Self::Normal => "normal",
            Self::GeometricNormal => "geometric_normal",
            Self::Texcoord => "texcoord",
            Self::Material => "material",
            Self::Triangle => "triangle",
            Self::Barycentric => "barycentric",
            Self::Emission => "emission",
            Self::MetallicRoughness => "metallic_roughness",
        }
    }

    fn empty(self) -> Values {
        match self {
            Self::Color => Values::U8x4(Vec::new()),
            Self::Normal | Self::GeometricNormal | Self::Barycentric | Self::Emission => Values::F32x3(Vec::new()),
            Self::Texcoord | Self::MetallicRoughness => Values::F32x2(Vec::new()),
            Self::Material | Self::Triangle => Values::U32(Vec::new()),
        }
    }
}

/// How the triangles that meet in a voxel become one value.
///
/// Texture coordinates, material, triangle and barycentrics cannot be averaged: they are those of one winning triangle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Combine {
    /// Every triangle counts the same; the winner is the nearest.
    #[default]
    Mean,
    /// Triangles count by their area inside the voxel, at least (2^-10 voxels)^2 / 2; the winner is the dominant one.
    AreaWeighted,
    /// The triangle whose nearest point is nearest to the voxel's centre.
    Nearest,
    /// The triangle with the largest area inside the voxel.
    Dominant,
    /// The largest of each component; the winner is the triangle with the highest number.
    Max,
    /// The triangle with the lowest number.
    First,
    /// Every triangle keeps a row of its own, by voxel, then by triangle.
    All,
}

impl Combine {
    /// Every way.
    pub const ALL: [Self; 7] =
        [Self::Mean, Self::AreaWeighted, Self::Nearest, Self::Dominant, Self::Max, Self::First, Self::All];

    /// The name on the command line and in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Mean => "mean",
            Self::AreaWeighted => "area-weighted",
            Self::Nearest => "nearest",
            Self::Dominant => "dominant",
            Self::Max => "max",
            Self::First => "first",
            Self::All => "all",
        }
    }

    fn has_sums(self) -> bool {
        matches!(self, Self::Mean | Self::AreaWeighted | Self::Max)
    }

    fn asks_for_area(self) -> bool {
        matches!(self, Self::AreaWeighted | Self::Dominant)
    }

    fn asks_for_distance(self) -> bool {
        matches!(self, Self::Mean | Self::Nearest)
    }
}

/// Which attributes, and how triangles combine.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct AttributeRequest {
    kinds: Vec<AttributeKind>,
    combine: Combine,
    priorities: Vec<u32>,
}

impl AttributeRequest {
    /// Attributes, each once in the order of [`AttributeKind::ALL`], and how triangles combine.
    #[must_use]
    pub fn new(kinds: &[AttributeKind], combine: Combine) -> Self {
        let mut kinds = kinds.to_vec();
        kinds.sort_unstable();
        kinds.dedup();
        Self { kinds, combine, priorities: Vec::new() }
    }

    /// Makes materials labels with priorities: in each voxel only the triangles count whose material has the highest
    /// priority there, before they combine ([`Combine::All`] keeps the others too). `priorities` is by material; what it
    /// leaves out, and triangles without a material, have 0.
    #[must_use]
    pub fn with_priorities(mut self, priorities: Vec<u32>) -> Self {
        self.priorities = priorities;
        self
    }

    /// The attributes, in order.
    #[must_use]
    pub fn kinds(&self) -> &[AttributeKind] {
        &self.kinds
    }

    /// How triangles combine.
    #[must_use]
    pub fn combine(&self) -> Combine {
        self.combine
    }

    /// Whether any material has a priority.
    #[must_use]
    pub fn has_priorities(&self) -> bool {
        self.priorities.iter().any(|priority| *priority > 0)
    }

    fn wanted(&self) -> Wanted {
        let has = |kind| self.kinds.contains(&kind);
        use AttributeKind as Kind;
        Wanted {
            color: has(Kind::Color),
            normal: has(Kind::Normal),
            geometric_normal: has(Kind::GeometricNormal),
            emission: has(Kind::Emission),
            metallic_roughness: has(Kind::MetallicRoughness),
            winner: [Kind::Texcoord, Kind::Material, Kind::Triangle, Kind::Barycentric].into_iter().any(has),
        }
    }
}

/// The values of one attribute, one a row.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Four bytes.
    U8x4(Vec<[u8; 4]>),
    /// Two floats.
    F32x2(Vec<[f32; 2]>),
    /// Three floats.
    F32x3(Vec<[f32; 3]>),
    /// A number.
    U32(Vec<u32>),
}

impl Values {
    /// How many rows there are.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::U8x4(values) => values.len(),
            Self::F32x2(values) => values.len(),
            Self::F32x3(values) => values.len(),
            Self::U32(values) => values.len(),
        }
    }

    /// Whether there is no row.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Bytes of one row.
    #[must_use]
    pub fn row_bytes(&self) -> usize {
        match self {
            Self::U8x4(_) | Self::U32(_) => 4,
            Self::F32x2(_) => 8,
            Self::F32x3(_) => 12,
        }
    }

    /// NumPy's name of the numbers, and how many a row has.
    #[must_use]
    pub fn layout(&self) -> (&'static str, u64) {
        match self {
            Self::U8x4(_) => ("|u1", 4),
            Self::F32x2(_) => ("<f4", 2),
            Self::F32x3(_) => ("<f4", 3),
            Self::U32(_) => ("<u4", 1),
        }
    }

    /// Appends the little-endian bytes of what a voxel without a row has: zeros, and for ids 2^32 - 1.
    pub fn append_nothing(&self, out: &mut Vec<u8>) {
        let byte = if matches!(self, Self::U32(_)) { u8::MAX } else { 0 };
        out.resize(out.len() + self.row_bytes(), byte);
    }

    /// Appends the little-endian bytes of row `row`; of nothing where there is none.
    pub fn append_row(&self, row: usize, out: &mut Vec<u8>) {
        match self {
            _ if row >= self.len() => self.append_nothing(out),
            Self::U8x4(values) => out.extend(values.get(row).into_iter().flatten()),
            Self::F32x2(values) => out.extend(values.get(row).into_iter().flatten().flat_map(|v| v.to_le_bytes())),
            Self::F32x3(values) => out.extend(values.get(row).into_iter().flatten().flat_map(|v| v.to_le_bytes())),
            Self::U32(values) => out.extend(values.get(row).into_iter().flat_map(|v| v.to_le_bytes())),
        }
    }

    fn append(&mut self, other: Self) {
        match (self, other) {
            (Self::U8x4(all), Self::U8x4(more)) => all.extend(more),
            (Self::F32x2(all), Self::F32x2(more)) => all.extend(more),
            (Self::F32x3(all), Self::F32x3(more)) => all.extend(more),
            (Self::U32(all), Self::U32(more)) => all.extend(more),
            _ => debug_assert!(false, "one attribute has one type"),
        }
    }

    /// Appends what `row` has of `kind`.
    fn push(&mut self, kind: AttributeKind, row: &Row) {
        use AttributeKind as Kind;
        #[expect(clippy::cast_precision_loss, reason = "values of at most 17 bits")]
        match self {
            Self::U8x4(values) => values.push(light::encode(row.color)),
            Self::F32x2(values) if kind == Kind::Texcoord => {
                values.push(row.coordinate.map(coordinate_float));
            }
            Self::F32x2(values) => values.push(row.metallic_roughness.map(fraction_float)),
            Self::F32x3(values) => values.push(match kind {
                Kind::Normal => vector::floats(row.normal),
                Kind::GeometricNormal => vector::floats(row.geometric_normal),
                Kind::Barycentric => row.weights.map(|w| w as f32 / (1u32 << nearest::WEIGHT_BITS) as f32),
                _ => row.emission.map(emission_float),
            }),
            Self::U32(values) => values.push(if kind == Kind::Material { row.material } else { row.triangle }),
        }
    }
}

/// The float of a texture coordinate, rounded.
fn coordinate_float(coordinate: i64) -> f32 {
    #[expect(clippy::cast_precision_loss, reason = "rounded to 24 bits")]
    let float = coordinate as f32 / (1u32 << COORDINATE_BITS) as f32;
    float
}

/// The float of a fraction.
fn fraction_float(fraction: u16) -> f32 {
    f32::from(fraction) / f32::from(light::FULL)
}

/// The float of emitted light, rounded.
fn emission_float(emission: u32) -> f32 {
    #[expect(clippy::cast_possible_truncation, reason = "rounded to 24 bits")]
    let float = (f64::from(emission) / f64::from(EMISSION_ONE)) as f32;
    float
}

/// The names of a mesh's materials, where a request asks for materials.
fn material_names(mesh: &Mesh, request: &AttributeRequest) -> Vec<String> {
    let asked = request.kinds.contains(&AttributeKind::Material);
    mesh.materials.iter().filter(|_| asked).map(|material| material.name.clone()).collect()
}

/// The attributes of a volume's set voxels, in the order of their ranks.
#[derive(Clone, Debug, PartialEq)]
pub struct VoxelAttributes {
    columns: Vec<(AttributeKind, Values)>,
    combine: Combine,
    /// With [`Combine::All`], where each voxel's rows begin, and the number of all.
    offsets: Option<Vec<u64>>,
    /// One bit a voxel: whether it has a triangle.
    covered: Vec<u64>,
    voxels: usize,
    /// Whether a voxel without a triangle is one that the alpha test cut out.
    surface: bool,
    /// Names of the mesh's materials, where these were asked for.
    material_names: Vec<String>,
}

impl VoxelAttributes {
    /// The attributes and their values: one row a set voxel, or a triangle of one with [`Combine::All`].
    #[must_use]
    pub fn columns(&self) -> &[(AttributeKind, Values)] {
        &self.columns
    }

    /// The values of an attribute, if it was asked for.
    #[must_use]
    pub fn get(&self, kind: AttributeKind) -> Option<&Values> {
        self.columns.iter().find(|column| column.0 == kind).map(|column| &column.1)
    }

    /// The names that [`AttributeKind::Material`] numbers; empty when it was not asked for.
    #[must_use]
    pub fn material_names(&self) -> &[String] {
        &self.material_names
    }

    /// How triangles combined.
    #[must_use]
    pub fn combine(&self) -> Combine {
        self.combine
    }

    /// With [`Combine::All`], where each voxel's rows begin, and at the end the number of all rows.
    #[must_use]
    pub fn offsets(&self) -> Option<&[u64]> {
        self.offsets.as_deref()
    }

    /// How many voxels there are.
    #[must_use]
    pub fn voxels(&self) -> usize {
        self.voxels
    }

    /// Whether the voxel at place `rank` has a triangle. In a surface mode those without were cut out by the alpha test; in
    /// a solid most of those without lie inside.
    #[must_use]
    pub fn is_covered(&self, rank: usize) -> bool {
        self.covered.get(rank / 64).is_some_and(|word| word >> (rank % 64) & 1 == 1)
    }

    /// How many voxels have a triangle.
    #[must_use]
    pub fn covered(&self) -> u64 {
        self.covered.iter().map(|word| u64::from(word.count_ones())).sum()
    }

    /// Whether the alpha test cut any voxel out: one of a surface mode, all of whose triangles it failed.
    #[must_use]
    pub fn cuts_out(&self) -> bool {
        self.surface && self.covered() < self.voxels as u64
    }

    /// The row that stands for the voxel at place `rank`: with [`Combine::All`] its first; `None` if it has none.
    #[must_use]
    pub fn row(&self, rank: usize) -> Option<usize> {
        let Some(offsets) = &self.offsets else { return (rank < self.voxels).then_some(rank) };
        let (start, end) = (*offsets.get(rank)?, *offsets.get(rank + 1)?);
        if start < end { usize::try_from(start).ok() } else { None }
    }

    /// The colour of the voxel at place `rank`; `None` when it has none or colours were not asked for.
    #[must_use]
    pub fn color(&self, rank: usize) -> Option<[u8; 4]> {
        let Some(Values::U8x4(colors)) = self.get(AttributeKind::Color) else { return None };
        if self.is_covered(rank) { colors.get(self.row(rank)?).copied() } else { None }
    }

    /// Bytes that the attributes take.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let columns: usize = self.columns.iter().map(|(_, values)| values.len() * values.row_bytes()).sum();
        let offsets = self.offsets.as_ref().map_or(0, Vec::len);
        (columns + 8 * (offsets + self.covered.len())) as u64
    }
}

/// Why there are no attributes.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum AttributeError {
    /// The volume to describe has another grid than the job.
    #[error("the volume's grid is not the job's; voxelize with the same job first")]
    GridMismatch,
    /// There are more triangles than 32-bit ids can name.
    #[error("the mesh has {0} triangles, and attributes number them with 32 bits: split the mesh")]
    TooManyTriangles(usize),
}

/// Computes the attributes of the set voxels of `volume`, which `job` made of `mesh`; `lattice` is the mesh snapped to the
/// job's grid. Images that are not decoded count as missing: their materials' own colours are used.
///
/// # Errors
/// When the volume's grid is not the job's, or there are 2^32 triangles.
pub fn compute(
    mesh: &Mesh,
    lattice: &LatticeMesh<'_>,
    job: &Job,
    volume: &Volume,
    request: &AttributeRequest,
) -> Result<VoxelAttributes, AttributeError> {
    if volume.grid() != job.grid() {
        return Err(AttributeError::GridMismatch);
    }
    if u32::try_from(lattice.triangles.len()).is_err() {
        return Err(AttributeError::TooManyTriangles(lattice.triangles.len()));
    }
    let textures = Textures::new(mesh);
    let surface = Surface::new(mesh, &textures, job.grid());
    let rank = Rank::new(volume);
    let pairs = Pairs::of(job);
    let work = Work::new(lattice, &rank, pairs.grow());
    let task = Task { lattice, surface: &surface, rank: &rank, pairs, request, wanted: request.wanted() };
    #[cfg(feature = "threads")]
    let parts: Vec<Part> = {
        use rayon::prelude::*;
        (0..work.count()).into_par_iter().with_max_len(1).map(|index| task.run(&work.slab(index))).collect()
    };
    #[cfg(not(feature = "threads"))]
    let parts: Vec<Part> = (0..work.count()).map(|index| task.run(&work.slab(index))).collect();
    let surface_mode = job.mode() != Mode::Solid;
    Ok(VoxelAttributes {
        material_names: material_names(mesh, request),
        ..join(parts, request, rank.count(), surface_mode)
    })
}

/// The rows of one slab.
struct Part {
    columns: Vec<Values>,
    /// Triangles of each voxel.
    counts: Vec<u32>,
}

fn join(parts: Vec<Part>, request: &AttributeRequest, voxels: u64, surface: bool) -> VoxelAttributes {
    let mut columns: Vec<_> = request.kinds.iter().map(|&kind| (kind, kind.empty())).collect();
    // As many as there are rows, which are in memory already.
    let voxels = usize::try_from(voxels).unwrap_or(usize::MAX);
    let mut covered = vec![0u64; voxels.div_ceil(64)];
    let mut offsets = (request.combine == Combine::All).then(|| vec![0u64]);
    let (mut place, mut rows) = (0, 0);
    for part in parts {
        for ((_, all), more) in columns.iter_mut().zip(part.columns) {
            all.append(more);
        }
        for count in part.counts {
            covered[place / 64] |= u64::from(count > 0) << (place % 64);
            place += 1;
            rows += u64::from(count);
            if let Some(offsets) = &mut offsets {
                offsets.push(rows);
            }
        }
    }
    let (combine, material_names) = (request.combine, vec![]);
    VoxelAttributes { columns, combine, offsets, covered, voxels, surface, material_names }
}

/// What every slab needs to know.
struct Task<'a> {
    lattice: &'a LatticeMesh<'a>,
    surface: &'a Surface<'a>,
    rank: &'a Rank<'a>,
    pairs: Pairs,
    request: &'a AttributeRequest,
    wanted: Wanted,
}

/// A triangle in a voxel of a slab.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Fragment {
    place: usize,
    triangle: u32,
    weights: nearest::Weights,
}

impl Task<'_> {
    fn run(&self, slab: &Slab<'_>) -> Part {
        let combine = self.request.combine;
        let first = self.rank.before_column(slab.x.start, 0);
        let last = self.rank.before_column(slab.x.end, 0);
        let voxels = usize::try_from(last - first).unwrap_or(usize::MAX);
        let mut cells = vec![Cell::EMPTY; voxels];
        let mut sums = if combine.has_sums() { vec![Sums::default(); voxels] } else { Vec::new() };
        let mut fragments = Vec::new();
        for &triangle in slab.triangles {
            self.visit(triangle, slab, |place, voxel, nearest, patch, corners| {
                let weights = nearest.weights(voxel);
                let material = self.surface.material(triangle);
                if self.surface.is_masked(triangle) && patch.color(weights).is_none() {
                    return;
                }
                let Some(cell) = cells.get_mut(place) else { return };
                if combine == Combine::All {
                    cell.add(0, triangle);
                    fragments.push(Fragment { place, triangle, weights });
                    return;
                }
                let priority = self.request.priorities.get(material as usize).copied().unwrap_or(0);
                if !cell.admits(priority, sums.get_mut(place)) {
                    return;
                }
                let area = if combine.asks_for_area() { overlap::doubled_area(corners, voxel) } else { 0 };
                cell.add(
                    match combine {
                        _ if combine.asks_for_area() => u32::MAX - area,
                        _ if combine.asks_for_distance() => nearest.distance(voxel, weights),
                        Combine::Max => u32::MAX - triangle,
                        _ => 0,
                    },
                    triangle,
                );
                if let Some(sums) = sums.get_mut(place) {
                    let row = combine::row(patch, triangle, material, weights, self.wanted);
                    match combine {
                        Combine::Max => sums.take_largest(&row),
                        Combine::AreaWeighted => sums.add(&row, area.max(1)),
                        _ => sums.add(&row, 1),
                    }
                }
            });
        }
        let columns = if combine == Combine::All {
            // By place, then by triangle: the order in which threads or lists met them is gone.
            fragments.sort_unstable();
            self.rows_of_fragments(&fragments)
        } else {
            self.rows_of_cells(slab, &cells, &sums)
        };
        Part { columns, counts: cells.iter().map(|cell| cell.count).collect() }
    }

    /// Calls `each` with every set voxel of the slab that the triangle is paired with: its place in the slab and where it
    /// is.
    fn visit(
        &self,
        triangle: u32,
        slab: &Slab<'_>,
        mut each: impl FnMut(usize, [i64; 3], &Nearest, &surface::Patch<'_>, &[[i64; 3]; 3]),
    ) {
        let volume = self.rank.volume();
        let [_, ny, nz] = volume.grid().dims().map(i64::from);
        let first = self.rank.before_column(slab.x.start, 0);
        let low = [i64::from(slab.x.start), 0, 0];
        let high = [i64::from(slab.x.end) - 1, ny - 1, nz - 1];
        let corners = self.lattice.corners(triangle as usize);
        let mut ready: Option<(Nearest, surface::Patch<'_>)> = None;
        self.pairs.for_each_run(&corners, low, high, &mut |x, y, from, to| {
            // Inside the grid.
            let [column_x, column_y, from_z, to_z] = [x, y, from, to].map(|c| u32::try_from(c).unwrap_or(0));
            let mut place = self.rank.before([column_x, column_y, from_z]) - first;
            for z in from_z..=to_z {
                if volume.get([column_x, column_y, z]) {
                    let (nearest, patch) = ready.get_or_insert_with(|| {
                        (Nearest::new(&corners, self.pairs.reach()), self.surface.patch(triangle))
                    });
                    each(usize::try_from(place).unwrap_or(usize::MAX), [x, y, i64::from(z)], nearest, patch, &corners);
                    place += 1;
                }
            }
        });
    }

    fn rows_of_fragments(&self, fragments: &[Fragment]) -> Vec<Values> {
        let mut columns: Vec<Values> = self.request.kinds.iter().map(|kind| kind.empty()).collect();
        for fragment in fragments {
            let patch = self.surface.patch(fragment.triangle);
            let material = self.surface.material(fragment.triangle);
            let row = combine::row(&patch, fragment.triangle, material, fragment.weights, self.wanted);
            self.push(&mut columns, &row);
        }
        columns
    }

    fn rows_of_cells(&self, slab: &Slab<'_>, cells: &[Cell], sums: &[Sums]) -> Vec<Values> {
        let mut columns: Vec<Values> = self.request.kinds.iter().map(|kind| kind.empty()).collect();
        let volume = self.rank.volume();
        let mut ready: Option<(u32, Nearest, surface::Patch<'_>)> = None;
        let voxels = slab.x.clone().flat_map(|x| {
            let columns = (0..volume.grid().dims()[1]).map(move |y| (x, y));
            columns.flat_map(|(x, y)| set_bits(volume.column(x, y)).map(move |z| [x, y, z]))
        });
        for (place, (voxel, cell)) in voxels.zip(cells).enumerate() {
            let mut row = Row::NOTHING;
            if let Some(triangle) = cell.winner() {
                // Neighbours along z mostly have the same winner.
                if ready.as_ref().is_none_or(|(ready, ..)| *ready != triangle) {
                    let corners = self.lattice.corners(triangle as usize);
                    let nearest = Nearest::new(&corners, self.pairs.reach());
                    ready = Some((triangle, nearest, self.surface.patch(triangle)));
                }
                if let Some((_, nearest, patch)) = &ready {
                    let weights = nearest.weights(voxel.map(i64::from));
                    row = combine::row(patch, triangle, self.surface.material(triangle), weights, self.wanted);
                }
                if let Some(sums) = sums.get(place) {
                    sums.finish(self.request.combine, &mut row);
                }
            }
            self.push(&mut columns, &row);
        }
        columns
    }

    fn push(&self, columns: &mut [Values], row: &Row) {
        for (column, &kind) in columns.iter_mut().zip(&self.request.kinds) {
            column.push(kind, row);
        }
    }
}
