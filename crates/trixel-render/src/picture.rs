//! A finished picture: 8-bit sRGB pixels, and PNG files of them.

use std::io::Write;

/// An 8-bit sRGB picture with straight (not premultiplied) alpha.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Rows from the top, each from the left, four bytes (red, green, blue, alpha) a pixel.
    pub rgba: Vec<u8>,
}

/// Why a picture could not be written or read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PictureError {
    /// The file is no picture, or too large a one.
    #[error("reading a picture failed: {0}")]
    Decode(#[from] image::ImageError),
    /// `rgba` does not hold four bytes for each pixel.
    #[error("a picture of {width} x {height} pixels needs {needed} bytes of RGBA, but has {found}")]
    Length {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// Bytes that the size asks for.
        needed: u64,
        /// Bytes that there are.
        found: usize,
    },
    /// A film without frames, or of a size that no format holds.
    #[error("a film of {frames} frames of {width} x {height} pixels cannot be written; a side takes 1 to 65535")]
    Film {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// Frames, or those still missing.
        frames: u32,
    },
    /// The GIF encoder or its output failed.
    #[error("writing a GIF failed: {0}")]
    Gif(#[from] gif::EncodingError),
    /// The encoder or the output failed.
    #[error("writing a PNG picture failed: {0}")]
    Encode(#[from] png::EncodingError),
}

impl Picture {
    /// The red, green, blue and alpha of pixel (`x`, `y`), counted from the top left; `None` outside.
    #[must_use]
    pub fn pixel(&self, x: u32, y: u32) -> Option<[u8; 4]> {
        if x >= self.width || y >= self.height {
            return None;
        }
        let start = (y as usize * self.width as usize + x as usize) * 4;
        self.rgba.get(start..start + 4)?.try_into().ok()
    }

    /// Reads a PNG file of at most 8192 x 8192 pixels.
    ///
    /// # Errors
    /// When it is damaged or too large.
    pub fn decode_png(bytes: &[u8]) -> Result<Self, PictureError> {
        let rgba = decode(bytes, Some(image::ImageFormat::Png))?.into_rgba8();
        Ok(Self { width: rgba.width(), height: rgba.height(), rgba: rgba.into_raw() })
    }

    /// Writes the picture as a PNG file, tagged as sRGB; without an alpha channel when every pixel is opaque.
    ///
    /// # Errors
    /// When `rgba` has the wrong length or `out` fails.
    ///
    /// ```
    /// let picture = trixel_render::Picture { width: 1, height: 1, rgba: vec![255, 0, 0, 255] };
    /// let mut file = Vec::new();
    /// picture.encode_png(&mut file)?;
    /// assert_eq!(&file[1..4], b"PNG");
    /// # Ok::<(), trixel_render::PictureError>(())
    /// ```
    pub fn encode_png(&self, out: impl Write) -> Result<(), PictureError> {
        let needed = u64::from(self.width) * u64::from(self.height) * 4;
        if self.rgba.len() as u64 != needed {
            let (width, height, found) = (self.width, self.height, self.rgba.len());
            return Err(PictureError::Length { width, height, needed, found });
        }
        let opaque = self.rgba.chunks_exact(4).all(|p| p[3] == u8::MAX);
        let mut encoder = png::Encoder::new(out, self.width, self.height);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_color(if opaque { png::ColorType::Rgb } else { png::ColorType::Rgba });
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let mut writer = encoder.write_header()?;
        if opaque {
            let rgb: Vec<u8> = self.rgba.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
            writer.write_image_data(&rgb)?;
        } else {
            writer.write_image_data(&self.rgba)?;
        }
        writer.finish()?;
        Ok(())
    }
}

/// Decodes an image file of at most 8192 x 8192 pixels, of a format or of the one that its first bytes say.
pub(crate) fn decode(
    bytes: &[u8],
    format: Option<image::ImageFormat>,
) -> Result<image::DynamicImage, image::ImageError> {
    const MOST_SIDE: u32 = 8192;
    let mut reader = image::ImageReader::new(std::io::Cursor::new(bytes));
    match format {
        Some(format) => reader.set_format(format),
        None => reader = reader.with_guessed_format()?,
    }
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(MOST_SIDE);
    limits.max_image_height = Some(MOST_SIDE);
    // 16 bytes a pixel.
    limits.max_alloc = Some(1 << 31);
    reader.limits(limits);
    reader.decode()
}

/// The linear light of an 8-bit sRGB value (IEC 61966-2-1).
pub(crate) fn linear_from_srgb(value: u8) -> f32 {
    let v = f32::from(value) / 255.0;
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// The 8-bit sRGB value of linear light, clamped to [0, 1].
pub(crate) fn srgb_from_linear(value: f32) -> u8 {
    let v = value.clamp(0.0, 1.0);
    let encoded = if v <= 0.003_130_8 { v * 12.92 } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    byte(encoded)
}

/// `[0, 1]` to `0..=255`, rounded.
pub(crate) fn byte(value: f32) -> u8 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let byte = (value * 255.0).round() as u8;
    byte
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_round_trips_every_value() {
        for value in 0..=u8::MAX {
            assert_eq!(srgb_from_linear(linear_from_srgb(value)), value);
        }
    }

    #[test]
    fn png_decodes_to_the_same_pixels() {
        let mut picture = Picture { width: 3, height: 2, rgba: (0..24).map(|i| i * 10).collect() };
        for (alpha, channels) in [(200, 4), (255, 3)] {
            picture.rgba.chunks_exact_mut(4).for_each(|p| p[3] = alpha);
            let mut file = Vec::new();
            picture.encode_png(&mut file).unwrap();
            let mut reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().unwrap();
            let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
            reader.next_frame(&mut bytes).unwrap();
            let expected: Vec<u8> = picture.rgba.chunks_exact(4).flat_map(|p| p[..channels].iter().copied()).collect();
            assert_eq!(bytes, expected);
        }
    }

    #[test]
    fn a_picture_of_the_wrong_length_is_refused() {
        let picture = Picture { width: 2, height: 2, rgba: vec![0; 15] };
        let message = picture.encode_png(Vec::new()).unwrap_err().to_string();
        assert_eq!(message, "a picture of 2 x 2 pixels needs 16 bytes of RGBA, but has 15");
    }
}
