//! Pictures that follow one another, as animated GIF or PNG.

use std::io::Write;

use super::picture::{Picture, PictureError};

/// How a [`Film`] is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilmFormat {
    /// Animated GIF: each frame has the 256 colours that suit it best.
    Gif,
    /// Animated PNG, lossless.
    Apng,
}

/// Writes an animated picture that repeats for ever, frame by frame.
///
/// ```
/// use trixel_render::{Film, FilmFormat, Picture};
/// let red = Picture { width: 1, height: 1, rgba: vec![255, 0, 0, 255] };
/// let mut file = Vec::new();
/// let mut film = Film::new(FilmFormat::Gif, [1, 1], 2, 0.1, &mut file)?;
/// film.add(&red)?;
/// film.add(&red)?;
/// film.finish()?;
/// assert_eq!(&file[..6], b"GIF89a");
/// # Ok::<(), trixel_render::PictureError>(())
/// ```
pub struct Film<W: Write> {
    size: [u32; 2],
    left: u32,
    writer: Writer<W>,
}

enum Writer<W: Write> {
    Gif { encoder: Box<gif::Encoder<W>>, clock: Clock },
    Apng(Box<png::Writer<W>>),
}

/// Spreads delays in hundredths of a second, of which GIF knows no part, so that the film as a whole is as long as asked.
struct Clock {
    seconds: f64,
    shown: u32,
    spent: u16,
}

impl Clock {
    /// Programs show a frame of less than this many hundredths for a tenth of a second.
    const LEAST: u16 = 2;

    fn tick(&mut self) -> u16 {
        self.shown += 1;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let until = (f64::from(self.shown) * self.seconds * 100.0).round() as u16;
        let delay = until.saturating_sub(self.spent).max(Self::LEAST);
        self.spent = self.spent.saturating_add(delay);
        delay
    }
}

impl<W: Write> Film<W> {
    /// The most pixels along a side: GIF's.
    pub const MAX_SIDE: u32 = 65_535;

    /// Begins a film of `frames` pictures of `size` pixels, each shown for `seconds`.
    ///
    /// # Errors
    /// When the size is 0 or more than [`Film::MAX_SIDE`], there is no frame, or `out` fails.
    pub fn new(format: FilmFormat, size: [u32; 2], frames: u32, seconds: f64, out: W) -> Result<Self, PictureError> {
        let [width, height] = size;
        let (Ok(columns), Ok(rows), 1..) = (u16::try_from(width), u16::try_from(height), frames) else {
            return Err(PictureError::Film { width, height, frames });
        };
        let writer = match format {
            FilmFormat::Gif => {
                let mut encoder = gif::Encoder::new(out, columns, rows, &[])?;
                encoder.set_repeat(gif::Repeat::Infinite)?;
                Writer::Gif { encoder: Box::new(encoder), clock: Clock { seconds, shown: 0, spent: 0 } }
            }
            FilmFormat::Apng => {
                let mut encoder = png::Encoder::new(out, width, height);
                encoder.set_depth(png::BitDepth::Eight);
                encoder.set_color(png::ColorType::Rgba);
                encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
                encoder.set_animated(frames, 0)?;
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
                let milliseconds = (seconds * 1e3).round() as u16;
                encoder.set_frame_delay(milliseconds.max(1), 1000)?;
                Writer::Apng(Box::new(encoder.write_header()?))
            }
        };
        Ok(Self { size, left: frames, writer })
    }

    /// Adds the next picture.
    ///
    /// # Errors
    /// When it is of another size, there are more than was said, or the output fails.
    pub fn add(&mut self, picture: &Picture) -> Result<(), PictureError> {
        let (width, height, found) = (picture.width, picture.height, picture.rgba.len());
        let needed = u64::from(self.size[0]) * u64::from(self.size[1]) * 4;
        if [width, height] != self.size || found as u64 != needed || self.left == 0 {
            return Err(PictureError::Length { width, height, needed, found });
        }
        self.left -= 1;
        match &mut self.writer {
            Writer::Gif { encoder, clock } => {
                /// 1 is best and 30 is fastest.
                const SPEED: i32 = 10;
                let [columns, rows] = self.size.map(|side| u16::try_from(side).unwrap_or(u16::MAX));
                let mut frame = gif::Frame::from_rgba_speed(columns, rows, &mut picture.rgba.clone(), SPEED);
                frame.delay = clock.tick();
                encoder.write_frame(&frame)?;
            }
            Writer::Apng(writer) => writer.write_image_data(&picture.rgba)?,
        }
        Ok(())
    }

    /// Ends the file.
    ///
    /// # Errors
    /// When frames are missing or the output fails.
    pub fn finish(self) -> Result<(), PictureError> {
        if self.left > 0 {
            let [width, height] = self.size;
            return Err(PictureError::Film { width, height, frames: self.left });
        }
        match self.writer {
            Writer::Gif { encoder, .. } => drop(encoder.into_inner()?),
            Writer::Apng(writer) => writer.finish()?,
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plain(color: [u8; 4]) -> Picture {
        Picture { width: 3, height: 2, rgba: color.repeat(6) }
    }

    fn film(format: FilmFormat) -> Vec<u8> {
        let mut file = Vec::new();
        let mut film = Film::new(format, [3, 2], 3, 0.125, &mut file).unwrap();
        for color in [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255]] {
            film.add(&plain(color)).unwrap();
        }
        assert!(film.add(&plain([0; 4])).is_err(), "a fourth of three");
        film.finish().unwrap();
        file
    }

    #[test]
    fn gif_is_read_back_with_its_colours_and_its_length() {
        let file = film(FilmFormat::Gif);
        let mut options = gif::DecodeOptions::new();
        options.set_color_output(gif::ColorOutput::RGBA);
        let mut decoder = options.read_info(file.as_slice()).unwrap();
        let mut frames = vec![];
        while let Some(frame) = decoder.read_next_frame().unwrap() {
            frames.push((frame.delay, frame.buffer[..4].to_vec()));
        }
        assert_eq!(decoder.repeat(), gif::Repeat::Infinite);
        // Eighths of a second: 12.5 hundredths, in turns rounded up and down.
        assert_eq!(frames, [(13, vec![255, 0, 0, 255]), (12, vec![0, 255, 0, 255]), (13, vec![0, 0, 255, 255])]);
    }

    #[test]
    fn apng_is_read_back_with_its_colours() {
        let file = film(FilmFormat::Apng);
        let mut reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().unwrap();
        assert_eq!(reader.info().animation_control().map(|a| (a.num_frames, a.num_plays)), Some((3, 0)));
        for color in [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255]] {
            let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
            reader.next_frame(&mut pixels).unwrap();
            assert_eq!(pixels, color.repeat(6));
            assert_eq!(reader.info().frame_control().map(|f| (f.delay_num, f.delay_den)), Some((125, 1000)));
        }
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        assert!(Film::new(FilmFormat::Gif, [70_000, 2], 1, 0.1, vec![]).is_err());
        assert!(Film::new(FilmFormat::Apng, [0, 2], 1, 0.1, vec![]).is_err());
        assert!(Film::new(FilmFormat::Apng, [2, 2], 0, 0.1, vec![]).is_err());
        let mut film = Film::new(FilmFormat::Apng, [2, 2], 1, 0.1, vec![]).unwrap();
        assert!(film.add(&plain([0; 4])).is_err());
        assert!(film.finish().is_err(), "a frame is missing");
    }
}
