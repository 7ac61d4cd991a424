//! What a mesh's surface is like at a point of a triangle: colour, normals, emission and the rest, in integers.

use super::device::MATERIAL_WORDS;
use super::light::{FULL, multiply, quantize};
use super::nearest::{WEIGHT_BITS, Weights};
use super::texture::{Encoding, Placement, Texels};
use super::vector;
use crate::grid::Grid;
use crate::material::{AlphaMode, Material, TextureRef};
use crate::mesh::Mesh;

/// Emission of 1, and the steps of a texture coordinate in one.
pub(super) const EMISSION_ONE: u32 = FULL as u32;
/// Bits of a texture coordinate below 1.
pub(super) const COORDINATE_BITS: u32 = 16;

/// A mesh made ready to be asked.
pub(super) struct Surface<'a> {
    mesh: &'a Mesh,
    voxel_size: [f64; 3],
    /// The mesh's vertex colours and normals, quantized, entry by entry.
    colors: Vec<[u16; 4]>,
    normals: Vec<Option<[i64; 3]>>,
    materials: Vec<Prepared<'a>>,
    /// What triangles without a material have: white.
    plain: Prepared<'a>,
}

/// A material, quantized, with its textures.
struct Prepared<'a> {
    color: [u16; 4],
    color_texture: Option<Slot<'a>>,
    opacity_texture: Option<Slot<'a>>,
    emission: [u32; 3],
    emission_texture: Option<Slot<'a>>,
    metallic_roughness: [u16; 2],
    metallic_roughness_texture: Option<Slot<'a>>,
    alpha_mode: AlphaMode,
}

/// A texture that a material uses.
pub(super) struct Slot<'a> {
    used: TextureRef,
    pub(super) texels: &'a Texels<'a>,
}

/// The textures of a mesh that can be sampled.
pub(super) struct Textures<'a> {
    /// By texture of the mesh: as colours and as numbers, each only where a material needs it.
    srgb: Vec<Option<Texels<'a>>>,
    linear: Vec<Option<Texels<'a>>>,
}

impl<'a> Textures<'a> {
    pub(super) fn new(mesh: &'a Mesh) -> Self {
        let wanted = |refs: &dyn Fn(&Material) -> [Option<TextureRef>; 2], encoding| {
            let mut texels: Vec<Option<Texels<'a>>> = Vec::new();
            texels.resize_with(mesh.textures.len(), || None);
            for used in mesh.materials.iter().flat_map(refs).flatten() {
                let index = used.texture as usize;
                if let (Some(slot @ None), Some(&texture)) = (texels.get_mut(index), mesh.textures.get(index)) {
                    let image = mesh.images.get(texture.image as usize);
                    *slot = image.and_then(|image| Texels::new(texture, image, encoding));
                }
            }
            texels
        };
        Self {
            srgb: wanted(&|m| [m.base_color_texture, m.emissive_texture], Encoding::Srgb),
            linear: wanted(&|m| [m.opacity_texture, m.metallic_roughness_texture], Encoding::Linear),
        }
    }
}

/// One triangle, made ready.
pub(super) struct Patch<'s> {
    material: &'s Prepared<'s>,
    colors: Option<[[u16; 4]; 3]>,
    normals: Option<[[i64; 3]; 3]>,
    /// The geometric normal; 0 for a triangle without area.
    normal: [i64; 3],
    color: Option<Placement>,
    opacity: Option<Placement>,
    emission: Option<Placement>,
    metallic_roughness: Option<Placement>,
    uvs: Option<[[i64; 2]; 3]>,
}

impl<'a> Surface<'a> {
    pub(super) fn new(mesh: &'a Mesh, textures: &'a Textures<'a>, grid: &Grid) -> Self {
        let prepare = |material: &Material| {
            let slot = |used: Option<TextureRef>, from: &'a [Option<Texels<'a>>]| {
                used.and_then(|used| Some(Slot { used, texels: from.get(used.texture as usize)?.as_ref()? }))
            };
            Prepared {
                color: material.base_color.map(quantize),
                color_texture: slot(material.base_color_texture, &textures.srgb),
                opacity_texture: slot(material.opacity_texture, &textures.linear),
                emission: material.emissive.map(quantize_emission),
                emission_texture: slot(material.emissive_texture, &textures.srgb),
                metallic_roughness: [quantize(material.metallic), quantize(material.roughness)],
                metallic_roughness_texture: slot(material.metallic_roughness_texture, &textures.linear),
                alpha_mode: material.alpha_mode,
            }
        };
        let quantize_normal = |normal: &[f32; 3]| vector::quantized(normal.map(f64::from));
        Self {
            mesh,
            voxel_size: grid.voxel_size(),
            colors: mesh.colors.iter().flat_map(|colors| &colors.values).map(|color| color.map(quantize)).collect(),
            normals: mesh.normals.iter().flat_map(|normals| &normals.values).map(quantize_normal).collect(),
            materials: mesh.materials.iter().map(prepare).collect(),
            plain: prepare(&Material::default()),
        }
    }

    /// The number of the material of triangle `triangle`; [`Mesh::NO_MATERIAL`] when it has none.
    pub(super) fn material(&self, triangle: u32) -> u32 {
        let material = self.mesh.triangle_materials.get(triangle as usize).copied().unwrap_or(Mesh::NO_MATERIAL);
        if (material as usize) < self.materials.len() { material } else { Mesh::NO_MATERIAL }
    }

    /// The row of that material in [`Self::material_words`].
    pub(super) fn material_row(&self, triangle: u32) -> u32 {
        let rows = u32::try_from(self.materials.len()).unwrap_or(Mesh::NO_MATERIAL);
        self.material(triangle).min(rows)
    }

    /// The materials as [`super::device::DeviceSurface::materials`] has them, with each one's priority.
    pub(super) fn material_words(&self, priority: impl Fn(usize) -> u32) -> Vec<u32> {
        let rows = self.materials.iter().chain([&self.plain]).enumerate();
        let words = rows.flat_map(|(i, material)| {
            let there = i < self.materials.len();
            let number = if there { u32::try_from(i).unwrap_or(Mesh::NO_MATERIAL) } else { Mesh::NO_MATERIAL };
            material.words(if there { priority(i) } else { 0 }, number)
        });
        words.collect()
    }

    /// Whether fragments of a triangle may be cut out by the alpha test.
    pub(super) fn is_masked(&self, triangle: u32) -> bool {
        let material = self.materials.get(self.material(triangle) as usize);
        material.is_some_and(|material| matches!(material.alpha_mode, AlphaMode::Mask { .. }))
    }

    /// Makes a triangle ready. Its index must be in range.
    pub(super) fn patch(&self, triangle: u32) -> Patch<'_> {
        let index = triangle as usize;
        let vertices = self.mesh.triangles.get(index).copied().unwrap_or_default();
        let material = self.materials.get(self.material(triangle) as usize).unwrap_or(&self.plain);
        let colors = self.mesh.colors.as_ref().and_then(|colors| {
            let corners = colors.corners_of(index, vertices)?;
            Some([self.color(corners[0])?, self.color(corners[1])?, self.color(corners[2])?])
        });
        let normals = self.mesh.normals.as_ref().and_then(|normals| {
            let corners = normals.corners_of(index, vertices)?;
            Some([self.normal(corners[0])?, self.normal(corners[1])?, self.normal(corners[2])?])
        });
        let (normal, area) = self.plane(vertices);
        let uvs = |set: u32| self.mesh.uvs.get(set as usize).and_then(|uvs| uvs.on_triangle(index, vertices));
        let place = |slot: &Option<Slot<'_>>| {
            let slot = slot.as_ref()?;
            Some(slot.texels.place(&slot.used, uvs(slot.used.uv_set)?, area))
        };
        Patch {
            material,
            colors,
            normals,
            normal,
            color: place(&material.color_texture),
            opacity: place(&material.opacity_texture),
            emission: place(&material.emission_texture),
            metallic_roughness: place(&material.metallic_roughness_texture),
            uvs: uvs(0).map(|corners| corners.map(|uv| uv.map(quantize_coordinate))),
        }
    }

    fn color(&self, entry: u32) -> Option<[u16; 4]> {
        self.colors.get(entry as usize).copied()
    }

    fn normal(&self, entry: u32) -> Option<[i64; 3]> {
        self.normals.get(entry as usize).copied().flatten()
    }

    /// The geometric normal, and the area in voxels squared.
    fn plane(&self, vertices: [u32; 3]) -> ([i64; 3], f64) {
        let corner = |vertex: u32| self.mesh.positions.get(vertex as usize).copied().unwrap_or_default();
        let [a, b, c] = vertices.map(corner);
        let cross = |scale: [f64; 3]| {
            let edge = |w: [f64; 3]| -> [f64; 3] { std::array::from_fn(|i| (w[i] - a[i]) / scale[i]) };
            let (u, v) = (edge(b), edge(c));
            [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
        };
        let [x, y, z] = cross(self.voxel_size);
        let area = 0.5 * (x * x + y * y + z * z).sqrt();
        // One scale for all axes keeps directions and avoids overflow far from unit size.
        let scale = self.voxel_size.iter().fold(0.0, |largest: f64, &size| largest.max(size));
        (vector::quantized(cross([scale; 3])).unwrap_or([0; 3]), area)
    }
}

impl Prepared<'_> {
    fn words(&self, priority: u32, number: u32) -> [u32; MATERIAL_WORDS] {
        let [r, g, b, a] = self.color.map(u32::from);
        let [metallic, roughness] = self.metallic_roughness.map(u32::from);
        let (mode, cutoff) = match self.alpha_mode {
            AlphaMode::Opaque => (0, 0),
            AlphaMode::Mask { cutoff } => (1, u32::from(quantize(cutoff))),
            AlphaMode::Blend => (2, 0),
        };
        let [er, eg, eb] = self.emission;
        [r | g << 16, b | a << 16, er, eg, eb, metallic | roughness << 16, mode, cutoff, priority, number]
    }
}

impl<'s> Patch<'s> {
    /// The vertex colours of the corners.
    pub(super) fn colors(&self) -> Option<&[[u16; 4]; 3]> {
        self.colors.as_ref()
    }

    /// The shading normals of the corners.
    pub(super) fn normals(&self) -> Option<&[[i64; 3]; 3]> {
        self.normals.as_ref()
    }

    /// The texture coordinates of the corners.
    pub(super) fn coordinates(&self) -> Option<&[[i64; 2]; 3]> {
        self.uvs.as_ref()
    }

    /// The textures of colour, opacity, emission, and metalness and roughness, with the corners' places in them.
    pub(super) fn placed(&self) -> [Option<(&'s Slot<'s>, &Placement)>; 4] {
        let material = self.material;
        [
            material.color_texture.as_ref().zip(self.color.as_ref()),
            material.opacity_texture.as_ref().zip(self.opacity.as_ref()),
            material.emission_texture.as_ref().zip(self.emission.as_ref()),
            material.metallic_roughness_texture.as_ref().zip(self.metallic_roughness.as_ref()),
        ]
    }
}

impl Patch<'_> {
    /// The linear colour with its alpha; `None` where the alpha test says that there is nothing.
    pub(super) fn color(&self, weights: Weights) -> Option<[u16; 4]> {
        let mut color = self.material.color;
        if let Some(corners) = &self.colors {
            color = times(color, interpolated(corners, weights));
        }
        if let (Some(slot), Some(placement)) = (&self.material.color_texture, &self.color) {
            color = times(color, slot.texels.sample(placement, weights));
        }
        if let (Some(slot), Some(placement)) = (&self.material.opacity_texture, &self.opacity) {
            color[3] = multiply(color[3], slot.texels.sample(placement, weights)[0]);
        }
        match self.material.alpha_mode {
            AlphaMode::Opaque => color[3] = FULL,
            AlphaMode::Mask { cutoff } if color[3] < quantize(cutoff) => return None,
            AlphaMode::Mask { .. } => color[3] = FULL,
            AlphaMode::Blend => {}
        }
        Some(color)
    }

    /// The shading normal: the mesh's where it has one there, otherwise the geometric one.
    pub(super) fn shading_normal(&self, weights: Weights) -> [i64; 3] {
        let interpolated = self.normals.as_ref().map(|corners| -> [i64; 3] {
            std::array::from_fn(|i| (0..3).map(|k| i64::from(weights[k]) * corners[k][i]).sum())
        });
        interpolated.and_then(vector::normalized).unwrap_or(self.normal)
    }

    pub(super) fn geometric_normal(&self) -> [i64; 3] {
        self.normal
    }

    /// The texture coordinate of the first set, in `2^-COORDINATE_BITS`; 0 where there is none.
    pub(super) fn coordinate(&self, weights: Weights) -> [i64; 2] {
        let Some(corners) = &self.uvs else { return [0; 2] };
        std::array::from_fn(|i| {
            let sum: i64 = (0..3).map(|k| i64::from(weights[k]) * corners[k][i]).sum();
            (sum + (1 << (WEIGHT_BITS - 1))) >> WEIGHT_BITS
        })
    }

    /// Emitted light, as a multiple of `1 / EMISSION_ONE`.
    pub(super) fn emission(&self, weights: Weights) -> [u32; 3] {
        let (Some(slot), Some(placement)) = (&self.material.emission_texture, &self.emission) else {
            return self.material.emission;
        };
        let texel = slot.texels.sample(placement, weights);
        std::array::from_fn(|i| {
            let product = u64::from(self.material.emission[i]) * u64::from(texel[i]);
            u32::try_from((product + u64::from(FULL / 2)) / u64::from(FULL)).unwrap_or(u32::MAX)
        })
    }

    /// Metalness and roughness.
    pub(super) fn metallic_roughness(&self, weights: Weights) -> [u16; 2] {
        let [metallic, roughness] = self.material.metallic_roughness;
        match (&self.material.metallic_roughness_texture, &self.metallic_roughness) {
            (Some(slot), Some(placement)) => {
                let [_, green, blue, _] = slot.texels.sample(placement, weights);
                [multiply(metallic, blue), multiply(roughness, green)]
            }
            _ => [metallic, roughness],
        }
    }
}

fn times(a: [u16; 4], b: [u16; 4]) -> [u16; 4] {
    std::array::from_fn(|i| multiply(a[i], b[i]))
}

/// Colours between corners: `(sum of weight * colour + half) >> 16`, which fits 32 bits.
fn interpolated(corners: &[[u16; 4]; 3], weights: Weights) -> [u16; 4] {
    std::array::from_fn(|i| {
        let sum: u64 = (0..3).map(|k| u64::from(weights[k]) * u64::from(corners[k][i])).sum();
        u16::try_from((sum + (1 << (WEIGHT_BITS - 1))) >> WEIGHT_BITS).unwrap_or(FULL)
    })
}

fn quantize_emission(value: f32) -> u32 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let quantized = (f64::from(value) * f64::from(EMISSION_ONE)).round_ties_even() as u32;
    quantized
}

fn quantize_coordinate(value: f32) -> i64 {
    const LIMIT: f64 = (1u64 << 46) as f64;
    #[expect(clippy::cast_possible_truncation, reason = "limited; NaN becomes 0")]
    let quantized =
        (f64::from(value) * f64::from(1u32 << COORDINATE_BITS)).round_ties_even().clamp(-LIMIT, LIMIT) as i64;
    quantized
}
