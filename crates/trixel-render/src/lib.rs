//! Pictures of voxel volumes.

mod picture;
mod preview;

pub use picture::{Picture, PictureError};
pub use preview::{Background, PreviewError, PreviewOptions, VoxelColor, render_colored_preview, render_preview};
