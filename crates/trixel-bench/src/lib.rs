//! Measuring trixel as the papers measured themselves: \[HCV\] table 4.1 and its figures, \[CL\] table 1, on any adapter
//! and on the CPU, with the wrong voxels counted beside every time.
//!
//! [`measure`] fills [`Results`]; [`text`] and [`html`] show them, [`compare`] sets them beside older ones, and [`published`]
//! holds the papers' own numbers. Results are plain data for `serde`.

mod cpu_name;
mod subjects;
mod timing;

pub mod compare;
pub mod fills;
pub mod html;
pub mod lists;
pub mod measure;
pub mod plot;
pub mod published;
pub mod results;
pub mod text;

pub use results::{Adapter, Cell, ListCell, Machine, Results, Sweep};
pub use subjects::{MODELS, SCENES, asked_for, inputs, load, models_folder};
pub use timing::{median, second_run_ms};
