//! Mesh readers and volume writers, one file a format.
//!
//! [`read::read_mesh`] picks the reader by the file's extension or first bytes; [`write::write_volume`] and
//! [`volume_read::read_volume`] pick by the extension.

pub mod atomic_file;
mod bits;
mod extension;
mod numbers;
pub mod read;
mod volume_format;
pub mod volume_read;
pub mod write;
mod xml;

pub use volume_format::VolumeFormat;
