//! Mesh readers and volume writers, one file a format.
//!
//! [`read::read_mesh`] picks the reader by the file's extension or first bytes.

pub mod read;
pub mod write;
