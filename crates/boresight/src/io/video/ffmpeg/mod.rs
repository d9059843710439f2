//! Video through an `ffmpeg` program: what it writes to its pipe, and what it says of its input.

mod log;
mod nut;
mod pictures;
mod source;

/// For the fuzz target: all pictures of a NUT stream.
#[cfg(fuzzing)]
pub use nut::read_all as read_nut;
pub(in crate::io::video) use source::{INSTALL, open};
