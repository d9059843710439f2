//! Frames without a container, or in one that is a plain stream: raw pixels, YUV4MPEG2.

pub mod raw;
pub mod y4m;
