//! From a frame to detections: spatial filters, thresholds, clusters, centroids; never sees tracks.
//!
//! A threshold turns one row of pixels into one row of bits (`&[u64]`, bit `x % 64` of word `x / 64` is pixel `x`, bits past
//! the width are 0); the clusterer turns bit rows into regions with their moments. There is no mask or label image.

pub mod background;
pub mod centroid;
pub mod cfar;
pub mod cluster;
pub mod colour;
pub mod config;
pub mod detector;
pub mod isolated;
pub mod llr;
pub mod noise;
pub mod noise_level;
pub mod pixel;
mod polarity;
pub mod probability;
pub mod region;
mod runs;
pub mod spatial;
mod stage;
mod strongest;
pub mod tbd;
pub mod threshold;
pub mod window;

pub use config::DetectorConfig;
pub use detector::build;

use crate::{Frame, Result, Scan};

/// Turns frames into detections.
pub trait Detector: Send {
    /// Replaces `scan` by the detections of `frame`, keeping its memory.
    /// # Errors
    /// A frame whose size or pixel type is not the one the detector was built for.
    fn detect(&mut self, frame: &Frame, scan: &mut Scan) -> Result<()>;
}
