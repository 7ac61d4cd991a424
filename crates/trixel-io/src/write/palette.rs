//! Palettes of at most 255 colours: the voxels' own as long as they suffice.

use std::collections::BTreeMap;

use color_quant::NeuQuant;
use trixel::Volume;
use trixel::attributes::Described;

/// The most colours of a palette; voxels name them by a byte from 1 on.
const MOST_COLORS: usize = 255;
/// How many colours are skipped for each that the quantizer learns from: 1 is slowest and best.
const SAMPLING: i32 = 3;

/// The colours of a volume's voxels, numbered.
pub(super) struct Palette {
    /// Red, green, blue, and opaque.
    pub(super) entries: Vec<[u8; 4]>,
    numbers: BTreeMap<[u8; 3], u8>,
}

impl Palette {
    /// The palette of the voxels of `volume`, which may be part of what is described. Colours are their own as long as
    /// there are at most 255 of them.
    pub(super) fn new(volume: &Volume, described: &Described<'_>) -> Self {
        let mut counts: BTreeMap<[u8; 3], u64> = BTreeMap::new();
        for voxel in volume.iter() {
            *counts.entry(opaque(described.color(voxel))).or_default() += 1;
        }
        if counts.len() <= MOST_COLORS {
            let entries = counts.keys().map(|&[r, g, b]| [r, g, b, u8::MAX]).collect();
            let numbers = counts.keys().zip(1..=u8::MAX).map(|(&color, number)| (color, number)).collect();
            return Self { entries, numbers };
        }
        // Frequent colours count for more, by their logarithm: small things keep their colours.
        let samples: Vec<u8> = counts
            .iter()
            .flat_map(|(&[r, g, b], &count)| {
                std::iter::repeat_n([r, g, b, u8::MAX], count.ilog2() as usize + 1).flatten()
            })
            .collect();
        let quantizer = NeuQuant::new(SAMPLING, MOST_COLORS, &samples);
        let entries = quantizer.color_map_rgba().as_chunks().0.to_vec();
        let numbers = counts.keys().map(|&color| {
            let [r, g, b] = color;
            let index = quantizer.index_of(&[r, g, b, u8::MAX]).min(entries.len().saturating_sub(1));
            // Below 255.
            (color, u8::try_from(index + 1).unwrap_or(u8::MAX))
        });
        Self { numbers: numbers.collect(), entries }
    }

    /// The number of a voxel's colour.
    pub(super) fn number(&self, color: Option<[u8; 4]>) -> u8 {
        self.numbers.get(&opaque(color)).copied().unwrap_or(1)
    }
}

/// The colour without alpha; voxels without one, deep inside a solid, are white.
fn opaque(color: Option<[u8; 4]>) -> [u8; 3] {
    color.map_or([u8::MAX; 3], |[r, g, b, _]| [r, g, b])
}
