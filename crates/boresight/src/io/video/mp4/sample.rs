//! One coded picture of a file and how its track is coded: what the readers of the tables share.

use crate::{Error, ErrorKind};

/// One coded picture (an access unit) in the file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sample {
    /// First byte in the file.
    pub offset: u64,
    /// Number of bytes.
    pub size: u32,
    /// Composition time, media ticks.
    pub cts: i64,
    /// Decoding time, media ticks.
    pub dts: i64,
    /// Duration, media ticks.
    pub duration: u32,
    /// Whether decoding can start here.
    pub sync: bool,
    /// Number of the sample description, from 0.
    pub description: u16,
}

/// How a track's pictures are coded.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Codec {
    /// H.264; holds the decoder configuration (`avcC`) of each sample description.
    H264(Vec<Vec<u8>>),
    /// Anything else, by the name in the file.
    Other(String),
}

/// An error of damaged tables.
pub(super) fn damaged(what: impl Into<String>) -> Error {
    Error::new(ErrorKind::Damaged, what)
}
