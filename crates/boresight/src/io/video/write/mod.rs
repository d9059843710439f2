//! Video out: H.264 in MP4, whole or in fragments.

mod coder;
mod encoding;
mod fragments;
mod i420;
mod mp4;
mod options;

pub use coder::{CodedPicture, H264Coder};
pub use fragments::Mp4Fragments;
pub use mp4::Mp4Writer;
pub use options::{MAX_SIZE, Mp4Options};
