//! What a device needs to compute attributes by the [definition](super): a mesh's surface as words of integers, and how the
//! rows that it gives back are read.
//!
//! All that the definition does in f64 happens here, once a triangle or vertex; what follows is integer arithmetic on these
//! words, on the CPU and elsewhere alike.

use std::collections::HashMap;
use std::ops::Range;

use super::light;
use super::surface::{Patch, Surface, Textures};
use super::texture::Placement;
use super::{AttributeKind, AttributeRequest, Combine, Values, VoxelAttributes};
use crate::grid::Grid;
use crate::lattice::LatticeMesh;
use crate::mesh::Mesh;

/// Marks what is not there: a triangle, a material.
pub const NOTHING: u32 = u32::MAX;

/// A mesh's surface as words.
///
/// One *patch* a triangle, each of [`PatchLayout::stride`] words: flags ([`PatchLayout`] names the bits), the row of its
/// material, three corners of three `i32` in lattice steps, the geometric normal as three `i32` of 15 bits, and then the
/// parts that any triangle has, each at its own place.
#[derive(Clone, Debug, Default)]
pub struct DeviceSurface {
    /// The patches, those of the triangles that were asked for.
    pub patches: Vec<u32>,
    /// Where the parts of a patch are.
    pub layout: PatchLayout,
    /// [`MATERIAL_WORDS`] words a material, and after the last the row of triangles that have none: linear colour (four
    /// 16-bit numbers), emission (3 words), metalness and roughness (16 bits each), alpha mode (0 opaque, 1 masked,
    /// 2 blended), cutoff, priority, and the material's number.
    pub materials: Vec<u32>,
    /// The levels of textures that any patch reads.
    pub levels: Vec<DeviceLevel>,
}

/// Words of a material's row.
pub const MATERIAL_WORDS: usize = 10;

/// Where the parts of a patch begin; a part that no triangle has is at 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PatchLayout {
    /// Words of a patch.
    pub stride: u32,
    /// Vertex colours: four 16-bit numbers a corner. Flag 1.
    pub colors: u32,
    /// Shading normals: three `i32` a corner. Flag 2.
    pub normals: u32,
    /// Texture coordinates: two 64-bit numbers a corner, in 2^-16. Flag 4.
    pub coordinates: u32,
    /// Where the corners lie in the textures of colour, opacity, emission, and metalness and roughness: two `i32` a corner
    /// in 2^-8 texels, then the row in [`DeviceSurface::levels`]. Flags 8, 16, 32 and 64.
    pub placements: [u32; 4],
}

impl PatchLayout {
    /// Words before the first part.
    const HEAD: u32 = 14;
}

/// One level of a texture.
#[derive(Clone, Debug)]
pub struct DeviceLevel {
    /// Texels of the level, and of the whole image.
    pub size: [u32; 2],
    /// Of the level that corners are placed in.
    pub base: [u32; 2],
    /// How to read it: wrap along u in bits 0 and 1 and along v in bits 2 and 3 (0 repeat, 1 mirror, 2 clamp); bit 4 takes
    /// the nearest texel; in bits 5 and 6, 0 for bytes of sRGB, 1 for linear bytes, 2 for 16 bits, linear.
    pub flags: u32,
    /// One word a texel, or two of 16-bit numbers; red in the lowest bits, rows one after the other.
    pub texels: Vec<u32>,
}

/// The two tables between light and bytes: 256 linear values of 16 bits, two a word, and 65536 sRGB bytes, four a word.
#[must_use]
pub fn light_tables() -> [Vec<u32>; 2] {
    let linear: Vec<u16> = (0..=u8::MAX).map(light::linear_of_srgb).collect();
    let srgb: Vec<u8> = (0..=u16::MAX).map(light::srgb_of_linear).collect();
    let linear = linear.as_chunks::<2>().0.iter().map(|&[low, high]| pair(low, high)).collect();
    [linear, srgb.as_chunks::<4>().0.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect()]
}

/// Two halves of a word.
fn pair(low: u16, high: u16) -> u32 {
    u32::from(low) | u32::from(high) << 16
}

fn color_words([r, g, b, a]: [u16; 4]) -> [u32; 2] {
    [pair(r, g), pair(b, a)]
}

/// The lowest bits of a coordinate that fits them, or of a number that wraps on the device as it does here.
fn word(value: i64) -> u32 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "two's complement")]
    let word = value as u32;
    word
}

impl DeviceSurface {
    /// The patches of the triangles `range` of a mesh, whose lattice positions must fit `i32`, and everything that they
    /// refer to.
    #[must_use]
    pub fn new(
        mesh: &Mesh,
        lattice: &LatticeMesh<'_>,
        range: Range<u32>,
        grid: &Grid,
        request: &AttributeRequest,
    ) -> Self {
        let textures = Textures::new(mesh);
        let surface = Surface::new(mesh, &textures, grid);
        let priority = |material: usize| request.priorities.get(material).copied().unwrap_or(0);
        let mut out = Self { materials: surface.material_words(priority), ..Self::default() };
        let masks = range.clone().any(|triangle| surface.is_masked(triangle));
        let asked = Asked::by(request, masks);
        out.layout = asked.layout(mesh);
        let stride = out.layout.stride as usize;
        out.patches.reserve(range.len() * stride);
        let mut levels = HashMap::new();
        for triangle in range {
            let start = out.patches.len();
            out.patches.resize(start + stride, 0);
            let patch = surface.patch(triangle);
            let mut writer = Writer { words: &mut out.patches[start..], flags: 0 };
            writer.head(&surface, triangle, &lattice.corners(triangle as usize), &patch);
            writer.parts(&out.layout, &patch, &asked, &mut |slot, placement| {
                let key = (std::ptr::from_ref(slot.texels).cast::<()>(), placement.level);
                *levels.entry(key).or_insert_with(|| {
                    out.levels.push(slot.texels.device_level(placement.level));
                    u32::try_from(out.levels.len() - 1).unwrap_or(NOTHING)
                })
            });
            let flags = writer.flags;
            out.patches[start] = flags;
        }
        out
    }

    /// The most words that a patch of a mesh has, for a request.
    #[must_use]
    pub fn most_patch_words(mesh: &Mesh, request: &AttributeRequest) -> u32 {
        Asked::by(request, true).layout(mesh).stride
    }
}

/// Which parts of patches anything will read.
struct Asked {
    color: bool,
    normal: bool,
    coordinates: bool,
    emission: bool,
    metallic_roughness: bool,
}

impl Asked {
    /// `masks` says whether there is an alpha test, which looks at colours as well.
    fn by(request: &AttributeRequest, masks: bool) -> Self {
        let wanted = request.wanted();
        Self {
            color: wanted.color || masks,
            normal: wanted.normal,
            coordinates: request.kinds.contains(&AttributeKind::Texcoord),
            emission: wanted.emission,
            metallic_roughness: wanted.metallic_roughness,
        }
    }

    fn layout(&self, mesh: &Mesh) -> PatchLayout {
        let mut layout = PatchLayout { stride: PatchLayout::HEAD, ..PatchLayout::default() };
        let mut part = |there: bool, words: u32| {
            let at = layout.stride;
            layout.stride += if there { words } else { 0 };
            if there { at } else { 0 }
        };
        let any = |used: &dyn Fn(&crate::material::Material) -> bool| mesh.materials.iter().any(used);
        layout = PatchLayout {
            colors: part(self.color && mesh.colors.is_some(), 6),
            normals: part(self.normal && mesh.normals.is_some(), 9),
            coordinates: part(self.coordinates && !mesh.uvs.is_empty(), 12),
            placements: [
                part(self.color && any(&|m| m.base_color_texture.is_some()), 7),
                part(self.color && any(&|m| m.opacity_texture.is_some()), 7),
                part(self.emission && any(&|m| m.emissive_texture.is_some()), 7),
                part(self.metallic_roughness && any(&|m| m.metallic_roughness_texture.is_some()), 7),
            ],
            stride: layout.stride,
        };
        layout
    }
}

/// Writes one patch.
struct Writer<'a> {
    words: &'a mut [u32],
    flags: u32,
}

impl Writer<'_> {
    fn put(&mut self, at: u32, words: impl IntoIterator<Item = u32>) {
        for (slot, word) in self.words.iter_mut().skip(at as usize).zip(words) {
            *slot = word;
        }
    }

    fn head(&mut self, surface: &Surface<'_>, triangle: u32, corners: &[[i64; 3]; 3], patch: &Patch<'_>) {
        self.put(1, [surface.material_row(triangle)]);
        self.put(2, corners.as_flattened().iter().copied().map(word));
        self.put(11, patch.geometric_normal().map(word));
    }

    fn parts(
        &mut self,
        layout: &PatchLayout,
        patch: &Patch<'_>,
        asked: &Asked,
        level: &mut impl FnMut(&super::surface::Slot<'_>, &Placement) -> u32,
    ) {
        if let Some(colors) = patch.colors().filter(|_| layout.colors > 0) {
            self.flags |= 1;
            self.put(layout.colors, colors.map(color_words).into_iter().flatten());
        }
        if let Some(normals) = patch.normals().filter(|_| layout.normals > 0) {
            self.flags |= 2;
            self.put(layout.normals, normals.as_flattened().iter().copied().map(word));
        }
        if let Some(coordinates) = patch.coordinates().filter(|_| layout.coordinates > 0) {
            self.flags |= 4;
            self.put(layout.coordinates, coordinates.as_flattened().iter().flat_map(|&c| [word(c), word(c >> 32)]));
        }
        let wanted = [asked.color, asked.color, asked.emission, asked.metallic_roughness];
        for (i, ((at, placed), wanted)) in layout.placements.into_iter().zip(patch.placed()).zip(wanted).enumerate() {
            let Some((slot, placement)) = placed.filter(|_| wanted && at > 0) else { continue };
            self.flags |= 8 << i;
            let corners = placement.corners;
            self.put(at, corners.as_flattened().iter().copied().map(word));
            self.put(at + 6, [level(slot, placement)]);
        }
    }
}

impl AttributeKind {
    /// Words that a device gives for one row: those of [`VoxelAttributes::from_device`].
    #[must_use]
    pub fn device_words(self) -> u32 {
        match self {
            Self::Color | Self::Material | Self::Triangle | Self::MetallicRoughness => 1,
            Self::Normal | Self::GeometricNormal | Self::Barycentric | Self::Emission => 3,
            Self::Texcoord => 4,
        }
    }
}

impl Values {
    /// Appends what the words of a row say.
    fn push_words(&mut self, kind: AttributeKind, words: &[u32]) {
        let word = |i: usize| words.get(i).copied().unwrap_or(0);
        let long = |i: usize| i64::from(word(2 * i)) | i64::from(word(2 * i + 1)) << 32;
        match self {
            Self::U8x4(values) => values.push(word(0).to_le_bytes()),
            Self::U32(values) => values.push(word(0)),
            Self::F32x2(values) if kind == AttributeKind::Texcoord => {
                values.push([0, 1].map(|i| super::coordinate_float(long(i))));
            }
            Self::F32x2(values) => {
                let [low, high] = [word(0) & 0xffff, word(0) >> 16].map(light::narrow);
                values.push([low, high].map(super::fraction_float));
            }
            Self::F32x3(values) if kind == AttributeKind::Emission => {
                values.push([0, 1, 2].map(|i| super::emission_float(word(i))));
            }
            Self::F32x3(values) => values.push([0, 1, 2].map(|i| f32::from_bits(word(i)))),
        }
    }
}

/// Rows as a device gives them.
#[derive(Clone, Copy, Debug)]
pub struct DeviceRows<'a> {
    /// Row after row, the words of each kind of the request after each other ([`AttributeKind::device_words`]): colours as
    /// bytes, directions and weights as the bits of f32, ids as they are; emission in 1/65535 (`u32`), metalness and
    /// roughness likewise (16 bits each), texture coordinates in 2^-16 (64 bits each, low word first).
    pub words: &'a [u32],
    /// How many triangles each voxel has.
    pub counts: &'a [u32],
}

impl VoxelAttributes {
    /// Attributes that a device computed for a request: one row a voxel, or with [`Combine::All`] one a triangle of each.
    /// `surface` is false for a solid.
    #[must_use]
    pub fn from_device(mesh: &Mesh, request: &AttributeRequest, surface: bool, rows: &DeviceRows<'_>) -> Self {
        let stride: usize = request.kinds.iter().map(|kind| kind.device_words() as usize).sum();
        let mut at = 0;
        let columns = request.kinds.iter().map(|&kind| {
            let mut values = kind.empty();
            let length = kind.device_words() as usize;
            for row in rows.words.chunks_exact(stride.max(1)) {
                values.push_words(kind, row.get(at..at + length).unwrap_or(&[]));
            }
            at += length;
            (kind, values)
        });
        let columns = columns.collect();
        let (mut covered, mut offsets) = (vec![0u64; rows.counts.len().div_ceil(64)], vec![0u64]);
        let mut sum = 0;
        for (place, &count) in rows.counts.iter().enumerate() {
            covered[place / 64] |= u64::from(count > 0) << (place % 64);
            if request.combine == Combine::All {
                sum += u64::from(count);
                offsets.push(sum);
            }
        }
        Self {
            columns,
            combine: request.combine,
            offsets: (request.combine == Combine::All).then_some(offsets),
            covered,
            voxels: rows.counts.len(),
            surface,
            material_names: super::material_names(mesh, request),
        }
    }
}
