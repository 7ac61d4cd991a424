//! The readers of the polygon formats (OBJ, STL, PLY, OFF) and the frame that all readers share.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test fails by panicking, and says what it skipped")]

mod framework;
mod hostile;
mod models;
mod obj;
mod off;
mod ply;
#[path = "../common/models.rs"]
mod real;
mod stl;

use trixel_io::read::{Loaded, MeshFormat, ReadError, ReadOptions, read_mesh_bytes};

/// Reads bytes that must be fine.
fn read(format: MeshFormat, bytes: impl AsRef<[u8]>) -> Loaded {
    read_mesh_bytes(format, bytes.as_ref(), &ReadOptions::default()).unwrap()
}

/// Reads bytes that must not be fine; returns the message.
fn error(format: MeshFormat, bytes: impl AsRef<[u8]>) -> String {
    read_mesh_bytes(format, bytes.as_ref(), &ReadOptions::default()).unwrap_err().to_string()
}

/// Whether there is no triangle in the bytes, but nothing wrong either.
fn is_empty(format: MeshFormat, bytes: impl AsRef<[u8]>) -> bool {
    matches!(read_mesh_bytes(format, bytes.as_ref(), &ReadOptions::default()), Err(ReadError::Empty { .. }))
}
