//! What is kept of a run: rolling tables and lines.

mod entry;
mod film;
mod folder;
mod segment;

pub use folder::{Record, RecordOptions};
