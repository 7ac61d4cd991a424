//! Which targets shaders blend, and the tile whose values fit a workgroup's memory.

use std::fmt::Write;

use super::{Blend, Source, Target};
use crate::limits::TARGET_TILES;

/// The most targets of any plan.
pub(crate) const MOST_TARGETS: usize = 16;

/// Where a target's values come from, as shaders know it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Painted {
    Triangle,
    One,
    Given,
}

/// What stages and kernels that blend are specialized for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Plan {
    targets: [Option<(Blend, Painted)>; MOST_TARGETS],
    /// Voxels along each axis of a tile, as logarithms.
    tile: [u32; 3],
}

/// Bytes of workgroup memory that so many targets take in a tile: `tile_memory.wgsl`, `targets.wgsl` and `lanes.wgsl`.
fn tile_bytes([x, y, z]: [u32; 3], targets: usize) -> u64 {
    let columns = 1u64 << (x + y);
    columns * (4 + 4 * (1 << z) * targets as u64) + 256
}

/// How many targets fit so many bytes of workgroup memory.
pub(crate) fn most_targets(memory: u32) -> usize {
    let fits = |targets: &usize| TARGET_TILES.iter().any(|tile| tile_bytes(*tile, *targets) <= u64::from(memory));
    (1..=MOST_TARGETS).rev().find(fits).unwrap_or(0)
}

impl Plan {
    /// With the largest tile that fits so many bytes of workgroup memory; `None` if there are no targets or too many.
    pub(crate) fn new(targets: &[Target<'_>], memory: u32) -> Option<Self> {
        if !(1..=most_targets(memory)).contains(&targets.len()) {
            return None;
        }
        let fits = |tile: &[u32; 3]| tile_bytes(*tile, targets.len()) <= u64::from(memory);
        let tile = TARGET_TILES.into_iter().find(fits)?;
        let mut kinds = [None; MOST_TARGETS];
        for (kind, target) in kinds.iter_mut().zip(targets) {
            let painted = match target.source {
                Source::Triangle => Painted::Triangle,
                Source::One => Painted::One,
                Source::Values(_) => Painted::Given,
            };
            *kind = Some((target.blend, painted));
        }
        Some(Self { targets: kinds, tile })
    }

    pub(crate) fn tile(&self) -> [u32; 3] {
        self.tile
    }

    fn targets(&self) -> impl Iterator<Item = (Blend, Painted)> {
        self.targets.iter().copied().flatten()
    }

    /// How many targets there are.
    pub(crate) fn len(&self) -> usize {
        self.targets().count()
    }

    /// How many values the caller gives for each triangle.
    pub(crate) fn given(&self) -> usize {
        self.targets().filter(|(_, painted)| *painted == Painted::Given).count()
    }

    /// The WGSL that blends words of `values`, an array of atomics.
    pub(crate) fn blending(&self) -> String {
        let (mut begin, mut blend) = (String::new(), String::new());
        for (i, (rule, _)) in self.targets().enumerate() {
            let (neutral, function) = match rule {
                Blend::Min => ("0xffffffffu", "atomicMin"),
                Blend::Max => ("0u", "atomicMax"),
                Blend::Add => ("0u", "atomicAdd"),
            };
            // A String takes everything.
            let _ = writeln!(begin, "    atomicStore(&values[at + {i}u], {neutral});");
            let _ = writeln!(blend, "    {function}(&values[at + {i}u], painted[{i}]);");
        }
        let targets = self.len();
        format!(
            "const TARGETS: u32 = {targets}u;\nalias Painted = array<u32, TARGETS>;\n\
             fn begin_values(at: u32) {{\n{begin}}}\n\
             fn blend_values(at: u32, painted: Painted) {{\n{blend}}}\n"
        )
    }

    /// The WGSL that tells what a triangle paints.
    pub(crate) fn painting(&self) -> String {
        let width = self.given();
        let mut given = 0..;
        let words = self.targets().map(|(_, painted)| match painted {
            Painted::Triangle => "triangle".to_owned(),
            Painted::One => "1u".to_owned(),
            Painted::Given => format!("given[{width}u * triangle + {}u]", given.next().unwrap_or(0)),
        });
        let words = words.collect::<Vec<_>>().join(", ");
        format!("fn painted_by(triangle: u32) -> Painted {{\n    return Painted({words});\n}}\n")
    }
}

#[cfg(test)]
impl Plan {
    /// All blends and sources at once, and one target alone.
    pub(crate) fn samples() -> [Self; 2] {
        let all = [
            (Blend::Min, Painted::Triangle),
            (Blend::Add, Painted::One),
            (Blend::Max, Painted::Given),
            (Blend::Add, Painted::Given),
        ];
        let mut targets = [None; MOST_TARGETS];
        targets[0] = Some(all[0]);
        let one = Self { targets, tile: TARGET_TILES[0] };
        for (target, kind) in targets.iter_mut().zip(all) {
            *target = Some(kind);
        }
        [one, Self { targets, tile: TARGET_TILES[1] }]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_shrink_until_their_values_fit() {
        let targets = [Target::ID; MOST_TARGETS + 1];
        let tile = |count: usize, memory| Plan::new(&targets[..count], memory).map(|plan| plan.tile());
        // WebGPU's least.
        assert_eq!(tile(1, 16 << 10), Some([3, 3, 5]));
        assert_eq!(tile(2, 16 << 10), Some([3, 2, 5]));
        assert_eq!(tile(3, 16 << 10), Some([3, 2, 5]));
        assert_eq!(tile(7, 16 << 10), Some([2, 2, 5]));
        assert_eq!(tile(8, 16 << 10), None);
        assert_eq!(most_targets(16 << 10), 7);
        assert_eq!(tile(3, 32 << 10), Some([3, 3, 5]));
        assert_eq!(most_targets(32 << 10), 15);
        assert_eq!(tile(0, 32 << 10), None);
        assert_eq!(tile(MOST_TARGETS + 1, 1 << 20), None);
        assert_eq!(most_targets(1 << 20), MOST_TARGETS);
        assert_eq!(most_targets(1 << 10), 0);
    }
}
