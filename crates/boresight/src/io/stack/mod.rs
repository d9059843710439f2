//! Files that hold several frames: animated GIF, pages of TIFF.

pub mod gif;
pub(crate) mod tiff;
