//! What light meets inside a material.

use trixel::Material;

/// How a material absorbs and refracts light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Medium {
    /// Absorption per world unit of length: of light that travels d, exp(-absorption d) is left. \[CL\]'s α and σ.
    pub absorption: f32,
    /// Index of refraction; air has 1.
    pub refraction_index: f32,
}

impl Medium {
    /// What is between things.
    pub const AIR: Self = Self { absorption: 0.0, refraction_index: 1.0 };

    /// The share of light below which a material counts as opaque, so that its absorption stays finite.
    const OPAQUE: f32 = 1e-3;

    /// What a material is like when `thickness` of it, in world units, lets pass what its transmission and alpha say; at
    /// least a thousandth.
    #[must_use]
    pub fn of(material: &Material, thickness: f32) -> Self {
        let clear = match material.alpha_mode {
            trixel::AlphaMode::Blend => 1.0 - material.base_color[3],
            trixel::AlphaMode::Opaque | trixel::AlphaMode::Mask { .. } => 0.0,
        };
        let passes = material.transmission.max(clear).clamp(Self::OPAQUE, 1.0);
        Self {
            absorption: -passes.ln() / thickness.max(f32::MIN_POSITIVE),
            refraction_index: material.index_of_refraction,
        }
    }
}

/// The media of a mesh's materials.
#[derive(Clone, Debug, PartialEq)]
pub struct Media {
    /// By the material's number.
    pub of_materials: Vec<Medium>,
    /// Of triangles without one of these materials.
    pub other: Medium,
}

impl Media {
    /// The same everywhere.
    #[must_use]
    pub fn uniform(medium: Medium) -> Self {
        Self { of_materials: vec![], other: medium }
    }

    /// [`Medium::of`] each material; `other` for the rest.
    #[must_use]
    pub fn of(materials: &[Material], thickness: f32, other: Medium) -> Self {
        Self { of_materials: materials.iter().map(|material| Medium::of(material, thickness)).collect(), other }
    }

    /// The medium of a material.
    #[must_use]
    pub fn get(&self, material: u32) -> Medium {
        self.of_materials.get(material as usize).copied().unwrap_or(self.other)
    }

    /// All of them.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &Medium> {
        self.of_materials.iter().chain([&self.other])
    }
}
