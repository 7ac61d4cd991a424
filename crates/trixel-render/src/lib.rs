//! Pictures of voxel volumes, and of light that passes through them.

mod film;
pub mod light;
mod picture;
mod preview;

pub use film::{Film, FilmFormat};
pub use picture::{Picture, PictureError};
pub use preview::{Background, PreviewError, PreviewOptions, VoxelColor, render_colored_preview, render_preview};
