//! Palettes of at most 255 colours: the voxels' own as long as they suffice, otherwise cut from their colours.
//!
//! Own code, because the colour quantizers to be had either learn from samples and miss rare colours by far, or bring a
//! colour science library along. Boxes of colours are cut at their mean along their most varied channel, the most varied
//! box first (X. Wu, *Efficient Statistical Computations for Optimal Color Quantization*, 1991, without its tables), in
//! integers, so that equal volumes give equal files.

use std::collections::BTreeMap;

use rayon::prelude::*;
use trixel::attributes::Described;
use trixel::{Occupancy, set_bits};

/// The most colours of a palette; voxels name them by a byte from 1 on.
const MOST_COLORS: usize = 255;

/// The colours of a volume's voxels, numbered.
pub(super) struct Palette {
    /// Red, green, blue, and opaque.
    pub(super) entries: Vec<[u8; 4]>,
    /// Each colour's number, sorted by colour.
    numbers: Vec<([u8; 3], u8)>,
}

/// A colour, and how much it counts.
type Weighted = ([u8; 3], u64);

impl Palette {
    /// The palette of the voxels of `volume`, which may be part of what is described. Colours are their own as long as
    /// there are at most 255 of them.
    pub(super) fn new(volume: &impl Occupancy, described: &Described<'_>) -> Self {
        let mut counts: BTreeMap<[u8; 3], u64> = BTreeMap::new();
        volume.for_each_word(&volume.grid().dims().map(|n| 0..n), |[x, y, z], word| {
            for i in set_bits(&[word]) {
                *counts.entry(opaque(described.color([x, y, z + i]))).or_default() += 1;
            }
        });
        Self::of(&counts)
    }

    fn of(counts: &BTreeMap<[u8; 3], u64>) -> Self {
        let entries: Vec<[u8; 3]> =
            if counts.len() <= MOST_COLORS { counts.keys().copied().collect() } else { quantized(counts) };
        let colors: Vec<_> = counts.keys().copied().collect();
        let number = |color: [u8; 3]| {
            let nearest = (1..=u8::MAX).zip(&entries).min_by_key(|(_, entry)| distance(color, **entry));
            (color, nearest.map_or(1, |(number, _)| number))
        };
        let numbers = colors.into_par_iter().map(number).collect();
        Self { entries: entries.into_iter().map(|[r, g, b]| [r, g, b, u8::MAX]).collect(), numbers }
    }

    /// The number of a voxel's colour.
    pub(super) fn number(&self, color: Option<[u8; 4]>) -> u8 {
        let found = self.numbers.binary_search_by_key(&opaque(color), |(color, _)| *color);
        found.ok().and_then(|place| self.numbers.get(place)).map_or(1, |(_, number)| *number)
    }
}

/// The colour without alpha; voxels without one, deep inside a solid, are white.
fn opaque(color: Option<[u8; 4]>) -> [u8; 3] {
    color.map_or([u8::MAX; 3], |[r, g, b, _]| [r, g, b])
}

fn distance(a: [u8; 3], b: [u8; 3]) -> u32 {
    a.into_iter().zip(b).map(|(a, b)| u32::from(a.abs_diff(b)).pow(2)).sum()
}

/// At most [`MOST_COLORS`] colours for more than that.
fn quantized(counts: &BTreeMap<[u8; 3], u64>) -> Vec<[u8; 3]> {
    // Frequent colours count for more, but only by their logarithm: small things keep their colours.
    let mut colors: Vec<Weighted> =
        counts.iter().map(|(&color, &count)| (color, u64::from(count.ilog2()) + 1)).collect();
    let mut boxes = vec![(Statistics::of(&colors), 0..colors.len())];
    while boxes.len() < MOST_COLORS {
        let most = boxes.iter().enumerate().max_by_key(|(index, (statistics, _))| {
            // Of equals the first.
            (statistics.spread(), usize::MAX - index)
        });
        let Some((index, (statistics, range))) = most.filter(|(_, (statistics, _))| statistics.spread() > 0) else {
            break;
        };
        let (channel, mean, range) = (statistics.channel(), statistics.mean(), range.clone());
        let Some(members) = colors.get_mut(range.clone()) else { break };
        members.sort_unstable_by_key(|(color, _)| (color[channel], *color));
        // Never empty on either side: the channel varies, so some are at or below the mean and some above.
        let cut = members.partition_point(|(color, _)| color[channel] <= mean[channel]).clamp(1, members.len() - 1);
        let (low, high) = members.split_at(cut);
        let high = (Statistics::of(high), range.start + cut..range.end);
        boxes[index] = (Statistics::of(low), range.start..range.start + cut);
        boxes.push(high);
    }
    boxes.iter().map(|(statistics, _)| statistics.rounded_mean()).collect()
}

/// Weighted sums over colours.
#[derive(Clone, Copy, Default)]
struct Statistics {
    weight: u64,
    sums: [u64; 3],
    squares: [u64; 3],
}

impl Statistics {
    fn of(colors: &[Weighted]) -> Self {
        colors.iter().fold(Self::default(), |mut all, (color, weight)| {
            all.weight += weight;
            for (channel, value) in color.iter().enumerate() {
                all.sums[channel] += u64::from(*value) * weight;
                all.squares[channel] += u64::from(*value).pow(2) * weight;
            }
            all
        })
    }

    /// The sum of squared differences from the mean along a channel, times the weight.
    fn spread_along(&self, channel: usize) -> u128 {
        let (weight, sum) = (u128::from(self.weight), u128::from(self.sums[channel]));
        (weight * u128::from(self.squares[channel])).saturating_sub(sum * sum)
    }

    fn channel(&self) -> usize {
        (0..3).max_by_key(|&channel| (self.spread_along(channel), 3 - channel)).unwrap_or(0)
    }

    /// The sum of squared differences along the most varied channel.
    fn spread(&self) -> u128 {
        self.spread_along(self.channel()) / u128::from(self.weight.max(1))
    }

    fn rounded_mean(&self) -> [u8; 3] {
        self.sums.map(|sum| u8::try_from((sum + self.weight / 2) / self.weight.max(1)).unwrap_or(u8::MAX))
    }

    /// The mean, rounded down, so that what varies has colours above it.
    fn mean(&self) -> [u8; 3] {
        self.sums.map(|sum| u8::try_from(sum / self.weight.max(1)).unwrap_or(u8::MAX))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(colors: impl Iterator<Item = [u8; 3]>) -> (usize, u32) {
        let counts: BTreeMap<[u8; 3], u64> = colors.map(|color| (color, 3)).collect();
        let palette = Palette::of(&counts);
        let worst = counts.keys().map(|&[r, g, b]| {
            let [x, y, z, _] = palette.entries[usize::from(palette.number(Some([r, g, b, 9]))) - 1];
            distance([r, g, b], [x, y, z])
        });
        (palette.entries.len(), worst.max().unwrap())
    }

    #[test]
    fn few_colours_stay_and_many_come_close() {
        let grid = |step: usize| {
            let axis = move || (0..=255u8).step_by(step);
            axis().flat_map(move |r| axis().flat_map(move |g| axis().map(move |b| [r, g, b])))
        };
        assert_eq!(error(grid(51)), (216, 0));
        assert_eq!(error((0..255).map(|r| [r, 0, 7])), (255, 0));
        let (entries, worst) = error((0..=255).map(|r| [r, 0, 7]));
        assert!(entries <= 255 && worst <= 1, "{entries} {worst}");
        let (entries, worst) = error(grid(17));
        assert!(entries == 255 && worst < 60 * 60, "{entries} {worst}");
        assert_eq!(Palette::of(&BTreeMap::new()).number(None), 1);
    }
}
