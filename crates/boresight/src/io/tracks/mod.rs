//! Tables of tracks in the formats of the field: MOTChallenge, KITTI, CSV with named columns, Cell Tracking Challenge.
//!
//! [`read`] finds the format by the look of the file; [`write()`] and [`write_path`] say what the target cannot hold.

pub mod ctc;
#[cfg(feature = "images")]
pub mod ctc_write;
mod export;
mod format;
mod measured;
mod options;
mod parents;
mod read;
mod rows;
mod write;

pub use crate::io::tables::Dialect;
#[cfg(feature = "parquet")]
pub use export::parquet::write_parquet;
pub use export::xml::escaped as escaped_xml;
pub use format::Format;
pub use measured::{add_mass, measured_rows};
pub use options::{BadRows, ReadOptions};
pub use read::{TrackFile, read, sniff};
pub use write::{write, write_path};
