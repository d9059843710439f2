//! Video through an `ffmpeg` program: what it writes to its pipe, and what it says of its input.

mod log;
mod nut;
mod pictures;
mod source;

#[doc(hidden)] // For the fuzz target alone.
pub use nut::read_all as read_nut;
pub(in crate::io::video) use source::{INSTALL, open};
