//! Video out: H.264 in MP4.

mod encoding;
mod i420;
mod mp4;
mod options;

pub use mp4::{MAX_SIZE, Mp4Writer};
pub use options::Mp4Options;
