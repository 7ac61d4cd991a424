//! Textures in integers: texel coordinates with 8 bits below a texel, bilinear filtering, and coarser levels for
//! textures that are finer than the voxels (L. Williams, *Pyramidal Parametrics*, 1983).

use super::device::DeviceLevel;
use super::light::{FULL, linear_of_srgb, narrow, widen};
use super::nearest::{WEIGHT_BITS, Weights};
use crate::material::{Filter, Image, ImageSource, Texture, TextureRef, Wrap};

/// Bits of a texel coordinate below one texel.
const TEXEL_BITS: u32 = 8;
const TEXEL: i64 = 1 << TEXEL_BITS;
/// The farthest texel coordinate that is kept; differences of two then fit 32 bits.
const FARTHEST: f64 = (1u32 << 29) as f64;

/// What an image's colour channels hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Srgb,
    Linear,
}

/// A decoded texture and its coarser levels.
pub(super) struct Texels<'a> {
    pixels: &'a [u8],
    size: [u32; 2],
    encoding: Encoding,
    /// From half the size down to one texel.
    levels: Vec<Level>,
    wrap: [Wrap; 2],
    filter: Filter,
}

/// A coarser level in linear light.
struct Level {
    size: [u32; 2],
    texels: Vec<[u16; 4]>,
}

/// Where the corners of one triangle lie in a texture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placement {
    /// Texel coordinates of the corners.
    pub(super) corners: [[i64; 2]; 3],
    pub(super) level: usize,
}

impl<'a> Texels<'a> {
    /// The texture of an image; `None` when the image is not decoded, or not whole.
    pub(super) fn new(texture: Texture, image: &'a Image, encoding: Encoding) -> Option<Self> {
        let ImageSource::Rgba8 { width, height, pixels } = &image.source else { return None };
        let size = [*width, *height];
        let needed = (*width as usize).checked_mul(*height as usize)?.checked_mul(4)?;
        if size.contains(&0) || pixels.len() != needed {
            return None;
        }
        let mut texels =
            Self { pixels, size, encoding, levels: Vec::new(), wrap: texture.wrap, filter: texture.filter };
        if texture.mipmaps {
            while let Some(level) = texels.coarser() {
                texels.levels.push(level);
            }
        }
        Some(texels)
    }

    /// The level above the last one, unless that has one texel.
    fn coarser(&self) -> Option<Level> {
        let below = self.levels.len();
        let size = self.size_of(below);
        if size == [1, 1] {
            return None;
        }
        let smaller = size.map(|n| (n / 2).max(1));
        let mut texels = Vec::with_capacity(smaller[0] as usize * smaller[1] as usize);
        for y in 0..smaller[1] {
            for x in 0..smaller[0] {
                let at = |dx: u32, dy: u32| {
                    self.fetch(below, [(2 * x + dx).min(size[0] - 1), (2 * y + dy).min(size[1] - 1)])
                };
                texels.push(average([at(0, 0), at(1, 0), at(0, 1), at(1, 1)]));
            }
        }
        Some(Level { size: smaller, texels })
    }

    fn size_of(&self, level: usize) -> [u32; 2] {
        match level.checked_sub(1).and_then(|above| self.levels.get(above)) {
            Some(level) => level.size,
            None => self.size,
        }
    }

    /// The linear colour of one texel.
    fn fetch(&self, level: usize, [x, y]: [u32; 2]) -> [u16; 4] {
        let index = |width: u32| y as usize * width as usize + x as usize;
        if let Some(level) = level.checked_sub(1).and_then(|above| self.levels.get(above)) {
            return level.texels.get(index(level.size[0])).copied().unwrap_or_default();
        }
        let start = index(self.size[0]) * 4;
        let Some(&[r, g, b, a]) = self.pixels.get(start..).and_then(|pixels| pixels.first_chunk()) else {
            return [0; 4];
        };
        match self.encoding {
            Encoding::Srgb => [linear_of_srgb(r), linear_of_srgb(g), linear_of_srgb(b), widen(a)],
            Encoding::Linear => [r, g, b, a].map(widen),
        }
    }

    /// A level as a device reads it.
    pub(super) fn device_level(&self, level: usize) -> DeviceLevel {
        let size = self.size_of(level);
        let wrap = self.wrap.map(|wrap| match wrap {
            Wrap::Repeat => 0,
            Wrap::Mirror => 1,
            Wrap::Clamp => 2,
        });
        let (format, texels) = match (level.checked_sub(1).and_then(|above| self.levels.get(above)), self.encoding) {
            (Some(level), _) => {
                let words = level.texels.iter().flat_map(|texel| {
                    let [r, g, b, a] = texel.map(u32::from);
                    [r | g << 16, b | a << 16]
                });
                (2, words.collect())
            }
            (None, encoding) => {
                let words = self.pixels.as_chunks::<4>().0.iter().map(|texel| u32::from_le_bytes(*texel));
                (u32::from(encoding == Encoding::Linear), words.collect())
            }
        };
        let nearest = u32::from(self.filter == Filter::Nearest);
        let flags = wrap[0] | wrap[1] << 2 | nearest << 4 | format << 5;
        DeviceLevel { size, base: self.size, flags, texels }
    }

    /// Places a triangle whose corners have the texture coordinates `uvs` and whose area is `area` voxels squared.
    pub(super) fn place(&self, used: &TextureRef, uvs: [[f32; 2]; 3], area: f64) -> Placement {
        let [row_u, row_v] = used.transform.map(|row| row.map(f64::from));
        let mapped = uvs.map(|uv| {
            let [u, v] = uv.map(f64::from);
            [row_u, row_v].map(|row| {
                let mapped = row[0] * u + row[1] * v + row[2];
                if mapped.is_finite() { mapped } else { 0.0 }
            })
        });
        let mut corners = [[0; 2]; 3];
        for axis in 0..2 {
            let values = mapped.map(|uv| uv[axis]);
            // Whole periods, of two images for `Mirror`, change nothing but the size of the numbers.
            let periods = match self.wrap[axis] {
                Wrap::Clamp => 0.0,
                Wrap::Repeat | Wrap::Mirror => (values[0].min(values[1]).min(values[2]) / 2.0).floor() * 2.0,
            };
            for (corner, value) in corners.iter_mut().zip(values) {
                let texels = ((value - periods) * f64::from(self.size[axis]) * TEXEL as f64).round_ties_even();
                #[expect(clippy::cast_possible_truncation, reason = "limited")]
                let texels = texels.clamp(-FARTHEST, FARTHEST) as i64;
                corner[axis] = texels;
            }
        }
        Placement { corners, level: self.level(&corners, area) }
    }

    /// The level whose texels are about as large as voxels: the highest on which a voxel's face still has at least half a
    /// texel's area.
    fn level(&self, corners: &[[i64; 2]; 3], area: f64) -> usize {
        let edge = |k: usize, i: usize| corners[k][i] - corners[0][i];
        let doubled = i128::from(edge(1, 0)) * i128::from(edge(2, 1)) - i128::from(edge(1, 1)) * i128::from(edge(2, 0));
        #[expect(clippy::cast_precision_loss, reason = "a ratio of areas")]
        let mut texels = doubled.unsigned_abs() as f64 / (2 * TEXEL * TEXEL) as f64;
        let mut level = 0;
        while level < self.levels.len() && texels > 2.0 * area {
            texels *= 0.25;
            level += 1;
        }
        level
    }

    /// The linear colour, or fractions of [`FULL`], at a point of a placed triangle.
    pub(super) fn sample(&self, placement: &Placement, weights: Weights) -> [u16; 4] {
        let level = placement.level;
        let size = self.size_of(level);
        let [a, b, c] = placement.corners;
        let [_, wb, wc] = weights.map(i64::from);
        let mut at = [0; 2];
        for axis in 0..2 {
            let moved = wb * (b[axis] - a[axis]) + wc * (c[axis] - a[axis]);
            let fine = a[axis] + ((moved + (1 << (WEIGHT_BITS - 1))) >> WEIGHT_BITS);
            at[axis] = (fine * i64::from(size[axis])).div_euclid(i64::from(self.size[axis]));
        }
        let texel =
            |x: i64, y: i64| self.fetch(level, [wrapped(x, size[0], self.wrap[0]), wrapped(y, size[1], self.wrap[1])]);
        if self.filter == Filter::Nearest {
            return texel(at[0] >> TEXEL_BITS, at[1] >> TEXEL_BITS);
        }
        // Texel centres are half a texel from the corner.
        let [x, y] = at.map(|t| t - TEXEL / 2);
        let [fx, fy] = [x, y].map(|t| t & (TEXEL - 1));
        let (x, y) = (x >> TEXEL_BITS, y >> TEXEL_BITS);
        let corners = [texel(x, y), texel(x + 1, y), texel(x, y + 1), texel(x + 1, y + 1)];
        let shares = [(TEXEL - fx) * (TEXEL - fy), fx * (TEXEL - fy), (TEXEL - fx) * fy, fx * fy];
        std::array::from_fn(|channel| {
            let sum: i64 = corners.iter().zip(shares).map(|(c, share)| i64::from(c[channel]) * share).sum();
            u16::try_from((sum + (1 << (2 * TEXEL_BITS - 1))) >> (2 * TEXEL_BITS)).unwrap_or(FULL)
        })
    }
}

/// The texel that index `i` stands for in a row of `n`.
fn wrapped(i: i64, n: u32, wrap: Wrap) -> u32 {
    let length = i64::from(n);
    let index = match wrap {
        Wrap::Repeat => i.rem_euclid(length),
        Wrap::Mirror => {
            let there = i.rem_euclid(2 * length);
            if there < length { there } else { 2 * length - 1 - there }
        }
        Wrap::Clamp => i.clamp(0, length - 1),
    };
    u32::try_from(index).unwrap_or(0)
}

/// The mean of four texels; colours count by their alpha, so that what cannot be seen does not bleed in.
fn average(texels: [[u16; 4]; 4]) -> [u16; 4] {
    let alpha: u64 = texels.iter().map(|t| u64::from(t[3])).sum();
    let channel = |i: usize| {
        let (sum, whole) = if alpha == 0 {
            (texels.iter().map(|t| u64::from(t[i])).sum::<u64>(), 4)
        } else {
            (texels.iter().map(|t| u64::from(t[i]) * u64::from(t[3])).sum(), alpha)
        };
        narrow(u32::try_from((sum + whole / 2) / whole).unwrap_or(u32::MAX))
    };
    [channel(0), channel(1), channel(2), narrow(u32::try_from((alpha + 2) / 4).unwrap_or(u32::MAX))]
}

#[cfg(test)]
mod tests {
    use super::*;

    const W: u32 = 1 << WEIGHT_BITS;

    fn image(width: u32, height: u32, gray: impl Fn(u32, u32) -> u8) -> Image {
        let pixels =
            (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).flat_map(|(x, y)| [gray(x, y), 0, 0, 255]);
        Image { name: String::new(), source: ImageSource::Rgba8 { width, height, pixels: pixels.collect() } }
    }

    fn texture(wrap: Wrap, filter: Filter) -> Texture {
        Texture { image: 0, wrap: [wrap; 2], filter, mipmaps: false }
    }

    /// The red byte at (u, v).
    fn red(texels: &Texels<'_>, u: f32, v: f32) -> u8 {
        let placement = texels.place(&TextureRef::new(0), [[u, v], [5.0, 7.0], [0.5, 0.25]], 1e9);
        u8::try_from(texels.sample(&placement, [W, 0, 0])[0] / 257).unwrap()
    }

    #[test]
    fn odd_sizes_wrap_as_their_sampler_says() {
        let image = image(5, 3, |x, y| u8::try_from(10 * x + 100 * (y % 2)).unwrap());
        let sample =
            |wrap, u, v| red(&Texels::new(texture(wrap, Filter::Nearest), &image, Encoding::Linear).unwrap(), u, v);
        let centre = |i: i32, n: f32| (i as f32 + 0.5) / n;
        for i in -12..17 {
            let u = centre(i, 5.0);
            let expected = |x: i32| u8::try_from(10 * x).unwrap();
            assert_eq!(sample(Wrap::Repeat, u, 0.1), expected(i.rem_euclid(5)));
            assert_eq!(sample(Wrap::Clamp, u, 0.1), expected(i.clamp(0, 4)));
            let there = i.rem_euclid(10);
            assert_eq!(sample(Wrap::Mirror, u, 0.1), expected(there.min(9 - there)));
        }
        assert_eq!([sample(Wrap::Repeat, 0.1, 0.5), sample(Wrap::Repeat, 0.1, -0.5)], [100, 100]);
    }

    #[test]
    fn linear_filtering_meets_texel_centres_and_middles() {
        let image = image(4, 1, |x, _| [0, 100, 200, 40][x as usize]);
        let texels = Texels::new(texture(Wrap::Repeat, Filter::Linear), &image, Encoding::Linear).unwrap();
        assert_eq!([0.125, 0.375, 0.625, 0.875].map(|u| red(&texels, u, 0.3)), [0, 100, 200, 40]);
        assert_eq!([0.25, 0.5, 0.0, 1.0].map(|u| red(&texels, u, 0.3)), [50, 150, 20, 20]);
    }

    #[test]
    fn fine_textures_are_averaged_over_a_voxel() {
        let image = image(64, 64, |x, y| if (x + y) % 2 == 0 { 255 } else { 0 });
        let used = Texture { mipmaps: true, ..texture(Wrap::Repeat, Filter::Linear) };
        let texels = Texels::new(used, &image, Encoding::Srgb).unwrap();
        assert_eq!(texels.levels.len(), 6);
        let uvs = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
        // Half of the texture over the area of 512 voxels: 4 texels each, the next level.
        let placement = texels.place(&TextureRef::new(0), uvs, 512.0);
        assert_eq!(placement.level, 1);
        assert!(texels.sample(&placement, [W / 2, W / 4, W / 4])[0].abs_diff(FULL / 2) <= 1, "half of the light");
        let coarse = texels.place(&TextureRef::new(0), uvs, 2048.0);
        assert_eq!(coarse.level, 0);
        assert_eq!(texels.place(&TextureRef::new(0), uvs, 0.0).level, 6);
    }

    #[test]
    fn nonsense_coordinates_are_harmless() {
        let image = image(3, 7, |x, _| u8::try_from(x).unwrap());
        let texels = Texels::new(texture(Wrap::Mirror, Filter::Linear), &image, Encoding::Srgb).unwrap();
        let used = TextureRef { transform: [[f32::MAX, f32::MAX, 1.0], [f32::NAN, 0.0, 0.0]], ..TextureRef::new(0) };
        for bad in [f32::NAN, f32::INFINITY, f32::MAX, -1e30] {
            let placement = texels.place(&used, [[bad, 1.0], [2.0, bad], [bad, bad]], f64::NAN);
            texels.sample(&placement, [W / 3, W / 3, W - 2 * (W / 3)]);
        }
        let short =
            Image { name: String::new(), source: ImageSource::Rgba8 { width: 9, height: 9, pixels: vec![0; 3] } };
        assert!(Texels::new(texture(Wrap::Clamp, Filter::Linear), &short, Encoding::Srgb).is_none());
    }
}
