//! A shaded picture of a voxel volume, made to sit well on a slide.
//!
//! Rays march the bits ([`pyramid`]) from a camera fitted to the set voxels ([`camera`]); each hit is lit by a soft key
//! light with shadows and by an occluded sky ([`shade`]). No random numbers and no order of threads enter: the same
//! volume and options give the same bytes.

mod camera;
mod pyramid;
mod resolve;
mod shade;

use rayon::prelude::*;
use trixel::{UpAxis, Volume};

use crate::picture::Picture;

/// How a preview is taken. Start from the default and change what matters.
///
/// ```
/// use trixel_render::PreviewOptions;
/// let options = PreviewOptions { size: [640, 480], azimuth: 60.0, ..PreviewOptions::default() };
/// assert_eq!(options.samples_per_pixel, 4);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct PreviewOptions {
    /// Width and height in pixels, each 1 to 16384.
    pub size: [u32; 2],
    /// The axis of the volume that points up in the picture.
    pub up: UpAxis,
    /// Rays a pixel, 1 to 64.
    pub samples_per_pixel: u32,
    /// Degrees that the camera walks round the object, from its front towards its right side. The front faces -y when z
    /// is up, and +z when x or y is.
    pub azimuth: f64,
    /// Degrees of the camera above the horizon, -90 to 90.
    pub elevation: f64,
    /// Degrees across the picture's shorter side, 0 to 120; 0 makes the picture orthographic.
    pub field_of_view: f64,
    /// What is behind the object.
    pub background: Background,
    /// Whether the object stands on a ground that takes its shadow (never seen from below).
    pub ground: bool,
    /// The object's colour, 8-bit sRGB, where voxels have none of their own.
    pub color: [u8; 3],
    /// Whether the edges of voxels are drawn where voxels are large enough in the picture.
    pub voxel_edges: bool,
}

/// What is behind the object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Background {
    /// A seamless light backdrop of this 8-bit sRGB colour, a little darker towards the corners.
    Backdrop([u8; 3]),
    /// One 8-bit sRGB colour.
    Plain([u8; 3]),
    /// Nothing: alpha is 0 there, and the shadow on the ground is black with partial alpha.
    Transparent,
}

impl Default for PreviewOptions {
    fn default() -> Self {
        Self {
            size: [1280, 960],
            up: UpAxis::Z,
            samples_per_pixel: 4,
            azimuth: 32.0,
            elevation: 26.0,
            field_of_view: 24.0,
            background: Background::Backdrop([240, 240, 238]),
            ground: true,
            color: [110, 140, 172],
            voxel_edges: true,
        }
    }
}

impl PreviewOptions {
    /// The most pixels along one side.
    pub const MAX_SIDE: u32 = 16_384;
    /// The most rays a pixel.
    pub const MAX_SAMPLES: u32 = 64;

    fn check(&self) -> Result<(), PreviewError> {
        if self.size.iter().any(|s| !(1..=Self::MAX_SIDE).contains(s)) {
            return Err(PreviewError::Size(self.size));
        }
        let ranges = [
            ("samples_per_pixel", f64::from(self.samples_per_pixel), 1.0, f64::from(Self::MAX_SAMPLES)),
            ("azimuth", self.azimuth, -360.0, 360.0),
            ("elevation", self.elevation, -90.0, 90.0),
            ("field_of_view", self.field_of_view, 0.0, 120.0),
        ];
        for (option, value, min, max) in ranges {
            if !(min..=max).contains(&value) {
                return Err(PreviewError::Range { option, value, min, max });
            }
        }
        Ok(())
    }
}

/// Why a preview could not be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PreviewError {
    /// A side of the picture is out of range.
    #[error("a picture of {} x {} pixels is out of range: each side takes 1 to {max}", .0[0], .0[1], max = PreviewOptions::MAX_SIDE)]
    Size([u32; 2]),
    /// An option is out of range or not a number.
    #[error("preview option {option} = {value} is out of range: it takes {min} to {max}")]
    Range {
        /// The field of [`PreviewOptions`].
        option: &'static str,
        /// Its value.
        value: f64,
        /// The least it takes.
        min: f64,
        /// The most it takes.
        max: f64,
    },
}

/// Rows that are shaded before they are resolved, which bounds the memory of a large picture.
const BAND: u32 = 128;

/// Takes a picture of the set voxels of `volume`; an empty volume gives a picture of the background.
///
/// The camera is fitted to the set voxels, not to the grid, and voxels keep their proportions. The work is spread over
/// rayon's threads; their number does not change a byte.
///
/// # Errors
/// When an option is out of range.
///
/// ```
/// use trixel::{Grid, Volume};
/// use trixel_render::{PreviewOptions, render_preview};
/// let mut volume = Volume::new(Grid::new([0.0; 3], [1.0; 3], [8, 8, 8])?)?;
/// volume.set([1, 2, 3]);
/// let picture = render_preview(&volume, &PreviewOptions { size: [64, 48], ..PreviewOptions::default() })?;
/// assert_eq!(picture.rgba.len(), 64 * 48 * 4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn render_preview(volume: &Volume, options: &PreviewOptions) -> Result<Picture, PreviewError> {
    render(volume, None, options)
}

/// The sRGB colour of a set voxel; `None` for [`PreviewOptions::color`].
pub type VoxelColor<'a> = dyn Fn([u32; 3]) -> Option<[u8; 3]> + Sync + 'a;

/// [`render_preview`] with a colour for each voxel.
///
/// # Errors
/// When an option is out of range.
///
/// ```
/// use trixel::{Grid, Volume};
/// use trixel_render::{PreviewOptions, render_colored_preview};
/// let mut volume = Volume::new(Grid::new([0.0; 3], [1.0; 3], [8, 8, 8])?)?;
/// volume.set([1, 2, 3]);
/// let options = PreviewOptions { size: [64, 48], ..PreviewOptions::default() };
/// let picture = render_colored_preview(&volume, &|_| Some([200, 0, 0]), &options)?;
/// let [red, green, ..] = picture.pixel(32, 24).ok_or("no pixel")?;
/// assert!(red > 2 * green);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn render_colored_preview(
    volume: &Volume,
    colors: &VoxelColor<'_>,
    options: &PreviewOptions,
) -> Result<Picture, PreviewError> {
    render(volume, Some(colors), options)
}

fn render(volume: &Volume, colors: Option<&VoxelColor<'_>>, options: &PreviewOptions) -> Result<Picture, PreviewError> {
    options.check()?;
    let [width, height] = options.size;
    let row_bytes = width as usize * 4;
    let mut rgba = vec![0; row_bytes * height as usize];
    let scene =
        pyramid::Pyramid::build(volume).map(|pyramid| shade::Scene::new(volume.grid(), pyramid, colors, options));
    let backdrop = resolve::Backdrop::new(options);
    for top in (0..height).step_by(BAND as usize) {
        let bottom = height.min(top + BAND);
        let (first, last) = resolve::rows_needed(top, bottom, height);
        let mut pixels = vec![shade::Pixel::default(); (last - first) as usize * width as usize];
        if let Some(scene) = &scene {
            pixels.par_chunks_mut(width as usize).zip(first..last).for_each(|(row, y)| {
                for (pixel, x) in row.iter_mut().zip(0..width) {
                    *pixel = scene.first_sample(x, y);
                }
            });
            if options.samples_per_pixel > 1 {
                let refined = refine(scene, &resolve::Band { pixels: &pixels, width, first, last }, top..bottom);
                let start = (top - first) as usize * width as usize;
                pixels[start..start + refined.len()].copy_from_slice(&refined);
            }
        }
        let band = resolve::Band { pixels: &pixels, width, first, last };
        let tolerance = scene.as_ref().map_or(0.0, shade::Scene::plane_tolerance);
        let bytes = &mut rgba[top as usize * row_bytes..bottom as usize * row_bytes];
        bytes.par_chunks_mut(row_bytes).zip(top..bottom).for_each(|(row, y)| {
            for (out, x) in row.chunks_exact_mut(4).zip(0..width) {
                out.copy_from_slice(&resolve::resolve(&band, &backdrop, tolerance, x, y));
            }
        });
    }
    Ok(Picture { width, height, rgba })
}

/// Rows `rows` of a band, with all samples in the pixels where one is not enough.
fn refine(scene: &shade::Scene<'_>, band: &resolve::Band<'_>, rows: std::ops::Range<u32>) -> Vec<shade::Pixel> {
    let row = |y: u32| {
        (0..band.width).map(move |x| {
            let mut pixel = *band.at(x, y);
            let differs = |&(nx, ny): &(u32, u32)| scene.needs_more(&pixel, band.at(nx, ny));
            if band.around(x, y, 1, 1).any(|neighbour| differs(&neighbour)) {
                scene.more_samples(&mut pixel, x, y);
            }
            pixel
        })
    };
    rows.into_par_iter().flat_map_iter(row).collect()
}

#[cfg(test)]
mod tests;
