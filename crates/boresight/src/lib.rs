//! boresight turns image sequences into tracks one can trust.
//!
//! The way of the data: [`io`] reads frames, [`vision`] turns a frame into detections, [`track`] (with [`associate`])
//! turns detections into tracks, [`metrics`] says how good they are. `ARCHITECTURE.md` holds the map and the rules.

pub mod associate;
pub mod auto;
pub mod config;
pub mod detection;
pub mod draw;
pub mod error;
pub mod frame;
pub mod fuse;
pub mod image;
pub mod io;
pub mod metrics;
pub mod pipeline;
pub mod record;
pub mod report;
pub mod reproduce;
pub mod sim;
pub mod time;
pub mod track;
pub mod tracks;
pub mod view;
pub mod vision;

pub use config::Config;
pub use detection::{ClassId, Detection, Extent, Scan};
pub use error::{Error, ErrorKind, Result};
pub use frame::{Frame, FrameSource, PixelKind, Pixels, SourceInfo};
pub use image::Image;
pub use record::{TrackFrame, TrackId, TrackState, TrackStatus};
pub use time::{FrameIndex, Timestamp};
pub use tracks::{PixelOrigin, TrackRow, TrackTable, TrackTableBuilder};
pub use view::{Sink, View};

/// The README's and the chapters' examples are compiled and run with the tests.
#[cfg(doctest)]
mod chapters {
    #[doc = include_str!("../../../README.md")]
    mod readme {}
}
