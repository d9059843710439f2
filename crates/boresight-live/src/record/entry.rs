//! What the manifest says of a segment, and the names of its files.

use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// What became of a segment's pictures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Filmed {
    /// Frames in the file.
    pub frames: u64,
    /// Frames that were left out.
    pub left_out: u64,
    /// Bytes of the file.
    #[serde(skip)]
    pub bytes: u64,
}

/// Endings of a segment's files.
pub const ENDINGS: [&str; 5] = ["jsonl", "detections.csv", "tracks.csv", "config.toml", "mp4"];

/// What the manifest says of a segment.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Its number.
    pub number: u64,
    /// Bytes of its files.
    pub bytes: u64,
    /// Whether it is still written.
    pub open: bool,
    /// First and last frame and time of the run; absent if nothing is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frames: Option<[u64; 2]>,
    /// See `frames`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub times_s: Option<[f64; 2]>,
    /// When its first and last frame arrived, s since 1970.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub arrived_unix_s: Option<[f64; 2]>,
    /// What became of its pictures, where they are recorded.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub video: Option<Filmed>,
}

/// The file of a segment.
pub fn path(dir: &Path, number: u64, ending: &str) -> PathBuf {
    dir.join(format!("{number:06}.{ending}"))
}
