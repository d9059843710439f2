//! Image sequences in, trustworthy tracks out: detection, sub-pixel centroids, tracking, fusion, evaluation.
//!
//! The way of the data: a [`FrameSource`] gives [`Frame`]s, a [`vision::Detector`] makes a [`Scan`] of each, a [`track::Tracking`]
//! makes [`TrackState`]s of the scans, and [`Sink`]s write what they see. Uncertainty goes all the way: a detection has a
//! covariance, the filter uses it, the track reports its own, [`metrics`] tests it. Times are real ([`Timestamp`]); frames may be
//! missing or uneven. The same input and configuration give the same bits.
//!
//! # Detect and track
//!
//! A simulated scene stands in for a video here; [`io::open`] gives the frames of a file, a folder or a stream.
//!
//! ```
//! use boresight::{Config, FrameSource, Scan, TrackStatus, sim, track, vision};
//!
//! # fn main() -> boresight::Result<()> {
//! let config = Config::from_toml(
//!     "[detector.threshold.band]          # target pixels have values of 90 to 110
//!      low = 90
//!      high = 110
//!      [detector.cluster]
//!      min-area-px = 25
//!      [tracker]
//!      acceleration-std-px-per-s2 = 0.1
//!      max-speed-px-per-s = 8.0
//!      coast-s = 5.0",
//!     "example",
//! )?;
//! let mut frames = sim::named("ds2", sim::Seed::new(1))?.build(sim::Seed::new(1))?;
//! let mut detector = vision::build(&config.detector, frames.info())?;
//! let mut tracker = track::build(&config.tracker)?;
//! let mut scan = Scan::default();
//! let mut last = None;
//! while let Some(frame) = frames.next_frame()? {
//!     detector.detect(&frame, &mut scan)?;
//!     for t in tracker.step(&scan)?.iter().filter(|t| t.status == TrackStatus::Confirmed) {
//!         let (x, std) = (t.kinematics.mean[0], t.kinematics.cov[(0, 0)].sqrt()); // px
//!         last = Some((x - frames.truth()[0].kinematics.mean[0]) / std);
//!     }
//!     frames.recycle(frame);
//! }
//! assert!(last.is_some_and(|error| error.abs() < 4.0)); // in standard deviations
//! # Ok(())
//! # }
//! ```
//!
//! [`auto::open`] chooses the configuration from the first frames; [`pipeline::run`] drives frames, detector, tracker and sinks,
//! with times and a summary.
//!
//! # Where is what
//!
//! | to | see |
//! | --- | --- |
//! | read frames; read and write tables and video | [`io`], [`report`], [`draw`] |
//! | turn frames into detections | [`vision`], [`DetectorConfig`](vision::DetectorConfig) |
//! | turn detections into tracks; smooth and stitch them | [`track`], [`TrackerConfig`](track::TrackerConfig), [`associate`] |
//! | filter by hand, without std or heap | the crate [`boresight_filters`] |
//! | fuse several sensors | [`fuse`] |
//! | place tracks on Earth | [`world`] |
//! | judge tracks against a truth | [`metrics`], [`TrackTable`] |
//! | make scenes with a known truth | [`sim`] |
//! | configure all of it from one file | [`Config`], [`config`] |
//!
//! Positions are (x, y) = (column, row) in pixels, the centre of the top-left pixel is (0, 0); frames count from 0; states are
//! `[x, vx, y, vy]` in px and px/s. What can fail returns [`Error`], which says what, where and how to mend it.

#[macro_use]
mod macros;

pub mod associate;
pub mod auto;
pub mod camera;
mod camera_motion;
pub mod config;
mod cpu;
mod detection;
#[cfg(feature = "draw")]
pub mod draw;
mod error;
mod frame;
pub mod fuse;
mod geodesy;
mod homography;
mod image;
pub mod io;
mod length_unit;
mod memory_budget;
pub mod metrics;
#[cfg(any(feature = "draw", feature = "report"))]
mod palette;
pub mod pipeline;
mod record;
#[cfg(feature = "report")]
pub mod report;
pub mod sensor;
pub mod sim;
mod similarity;
mod tempo;
mod time;
pub mod track;
mod tracks;
mod union_find;
mod validate;
pub mod verdict;
mod view;
pub mod vision;
mod warp;
pub mod world;

pub(crate) use camera_motion::motion_jacobian;
pub use camera_motion::{CameraMotion, MotionBasis, MotionCov};
pub use config::Config;
pub use cpu::cpu_features;
pub use detection::{ClassId, DetectedVelocity, Detection, Extent, PositionFit, RadarPlot, Scan};
pub use error::{Error, ErrorKind, Result};
pub use frame::{Frame, FrameSource, PixelKind, Pixels, SourceInfo, Wanted};
pub use homography::Homography;
pub use image::Image;
pub use record::{TrackFrame, TrackId, TrackInnovation, TrackState, TrackStatus};
pub use similarity::Similarity;
pub use time::{ASSUMED_RATE_HZ, FrameIndex, Timestamp, shown_rate};
pub use tracks::{Column, PixelOrigin, RowState, StateColumns, TrackRow, TrackTable, TrackTableBuilder};
pub use view::{Sink, View};

/// The filters, and with them the matrices (`boresight_filters::nalgebra`), in the version that this crate is built with.
pub use boresight_filters;

/// Golden vectors, for the tests of parts that are not public.
#[cfg(test)]
#[path = "../tests/it/golden/file.rs"]
mod golden_file;

/// The README's examples are compiled with the tests.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;
