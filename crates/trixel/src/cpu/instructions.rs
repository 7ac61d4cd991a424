//! The vector instructions that the kernel is compiled for; one set is picked at run time.

use fearless_simd::{Level, Simd};

/// The newest vector instructions that a [`CpuBackend`](super::CpuBackend) may use. Every set gives the same voxels, so
/// this is for tests and comparisons. A set that the processor or the architecture lacks means the best that it has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Instructions {
    /// The best that the processor has.
    #[default]
    Best,
    /// AVX2 and FMA, on x86.
    Avx2,
    /// SSE4.2, on x86.
    Sse42,
    /// SSE2, on x86: what every 64-bit processor has.
    Sse2,
}

impl Instructions {
    /// All of them.
    #[cfg(test)]
    pub(super) const ALL: [Self; 4] = [Self::Best, Self::Avx2, Self::Sse42, Self::Sse2];

    pub(super) fn level(self) -> Level {
        let best = Level::new();
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        return match self {
            Self::Best => best,
            Self::Avx2 => best.as_avx2().map_or(best, Level::Avx2),
            Self::Sse42 => best.as_sse4_2().map_or(best, Level::Sse4_2),
            Self::Sse2 => best.as_sse2().map_or(best, Level::Sse2),
        };
        #[cfg(not(any(target_arch = "x86", target_arch = "x86_64")))]
        best
    }
}

/// Whether `mul_add` rounds once.
#[inline(always)]
pub(super) fn fuses<V: Simd>(simd: V) -> bool {
    let level = simd.level();
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    return level.as_avx2().is_some();
    #[cfg(target_arch = "aarch64")]
    return level.as_neon().is_some();
    #[cfg(not(any(target_arch = "x86", target_arch = "x86_64", target_arch = "aarch64")))]
    false
}

/// Whether `compress` is quicker than moving lanes one by one: measured on x86, and not elsewhere.
#[inline(always)]
pub(super) fn compresses<V: Simd>(simd: V) -> bool {
    cfg!(any(target_arch = "x86", target_arch = "x86_64")) && fuses(simd)
}
