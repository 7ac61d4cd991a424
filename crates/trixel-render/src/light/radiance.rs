//! A picture of linear light, and how alike two are.

use crate::picture::{Picture, srgb_from_linear};

/// A picture of linear light.
#[derive(Clone, Debug, PartialEq)]
pub struct Radiance {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Red, green and blue, rows from the top.
    pub pixels: Vec<[f32; 3]>,
}

impl Radiance {
    /// The picture as a screen shows it: light above 1 is cut off.
    #[must_use]
    pub fn to_picture(&self) -> Picture {
        let rgba = self.pixels.iter().flat_map(|p| {
            let [r, g, b] = p.map(srgb_from_linear);
            [r, g, b, u8::MAX]
        });
        Picture { width: self.size[0], height: self.size[1], rgba: rgba.collect() }
    }
}

/// The peak signal-to-noise ratio of two pictures in decibels, over red, green and blue; infinite for equal ones, `None` for
/// pictures of different sizes.
#[must_use]
pub fn psnr(a: &Picture, b: &Picture) -> Option<f64> {
    if (a.width, a.height, a.rgba.len()) != (b.width, b.height, b.rgba.len()) || a.rgba.is_empty() {
        return None;
    }
    let colors = |picture: &Picture| picture.rgba.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect::<Vec<_>>();
    let (a, b) = (colors(a), colors(b));
    let sum: f64 = a.iter().zip(&b).map(|(&a, &b)| (f64::from(a) - f64::from(b)).powi(2)).sum();
    #[expect(clippy::cast_precision_loss, reason = "a mean")]
    let mean = sum / a.len() as f64;
    Some(10.0 * (255.0 * 255.0 / mean).log10())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn psnr_of_known_differences() {
        let gray =
            |value: u8| Picture { width: 2, height: 1, rgba: vec![value, value, value, 255, value, value, value, 255] };
        assert_eq!(psnr(&gray(7), &gray(7)), Some(f64::INFINITY));
        assert_eq!(psnr(&gray(0), &gray(255)), Some(0.0));
        assert!((psnr(&gray(100), &gray(110)).unwrap() - 28.1308).abs() < 1e-3);
        assert_eq!(psnr(&gray(0), &Picture { width: 1, height: 1, rgba: vec![0; 4] }), None);
    }
}
