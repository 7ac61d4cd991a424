//! What a device may have beyond WebGPU's portable part, where a measurement shows that it pays.

/// The named tiers of shaders. All give the same voxels.
///
/// Measured and left out: nothing yet on real GPUs, so there is no tier for subgroups, conservative rasterization or texture
/// atomics.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Tier {
    /// What WebGPU has everywhere.
    Portable,
    /// 64-bit integers in shaders: one multiplication where the portable tier needs four and their carries. About a tenth
    /// faster on lavapipe (docs/gpu.md).
    Int64,
}

impl Tier {
    /// Every tier, the best last.
    pub const ALL: [Self; 2] = [Self::Portable, Self::Int64];

    /// The name in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Portable => "portable",
            Self::Int64 => "int64",
        }
    }

    /// What a device must have for it.
    #[must_use]
    pub fn features(self) -> wgpu::Features {
        match self {
            Self::Portable => wgpu::Features::empty(),
            Self::Int64 => wgpu::Features::SHADER_INT64,
        }
    }

    /// The best that these features allow.
    pub(crate) fn best(features: wgpu::Features) -> Self {
        let mut tiers = Self::ALL.into_iter().rev();
        tiers.find(|tier| features.contains(tier.features())).unwrap_or(Self::Portable)
    }
}
