//! Video through an `ffmpeg` program: what it writes to its pipe, and what it says of its input.

mod log;
mod nut;
mod pictures;
mod source;

pub(in crate::io::video) use source::{INSTALL, open};
