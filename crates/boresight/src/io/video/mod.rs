//! Video in and out: H.264 in MP4 in process, everything else through an `ffmpeg` program, MP4 written.

#[cfg(feature = "video")]
mod ffmpeg;
#[cfg(feature = "video")]
mod mp4;
#[cfg(feature = "video")]
mod open;
#[cfg(feature = "encode")]
mod write;
#[cfg(feature = "video")]
mod yuv;

#[cfg(feature = "video")]
#[doc(hidden)] // For the fuzz target alone: a NUT stream reaches the library through ffmpeg's pipe only.
pub use ffmpeg::read_nut;
#[cfg(feature = "video")]
pub use open::{open_ffmpeg, open_mp4};
#[cfg(feature = "encode")]
pub use write::{CodedPicture, H264Coder, MAX_SIZE, Mp4Fragments, Mp4Options, Mp4Writer};
