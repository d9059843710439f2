//! Video in and out: H.264 in MP4 in process, everything else through an `ffmpeg` program, MP4 written.

#[cfg(feature = "video")]
mod ffmpeg;
#[cfg(feature = "video")]
mod ffmpeg_log;
#[cfg(feature = "video")]
mod ffmpeg_pictures;
#[cfg(feature = "video")]
mod h264;
#[cfg(feature = "encode")]
mod i420;
#[cfg(feature = "video")]
mod mp4;
#[cfg(feature = "encode")]
mod mp4_encoding;
#[cfg(feature = "video")]
mod mp4_source;
#[cfg(feature = "encode")]
mod mp4_writer;
#[cfg(feature = "video")]
mod nut;
#[cfg(feature = "video")]
mod open;
#[cfg(feature = "video")]
mod reorder;
#[cfg(feature = "video")]
mod yuv;

#[cfg(feature = "encode")]
pub use mp4_writer::{MAX_SIZE, Mp4Options, Mp4Writer};
#[cfg(feature = "video")]
pub use open::{open_ffmpeg, open_mp4};
