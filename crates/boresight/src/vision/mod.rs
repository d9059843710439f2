//! From a frame to detections: spatial filters, thresholds, clusters, centroids; never sees tracks.
//!
//! A threshold turns one row of pixels into one row of bits (`&[u64]`, bit `x % 64` of word `x / 64` is pixel `x`, bits past
//! the width are 0); the clusterer turns bit rows into regions with their moments. There is no mask or label image.

pub mod background;
pub(crate) mod centroid;
pub mod cfar;
pub(crate) mod cluster;
pub mod colour;
pub(crate) mod config;
pub(crate) mod detector;
pub mod fit;
pub mod integrate;
pub(crate) mod isolated;
pub(crate) mod llr;
pub mod noise;
pub(crate) mod noise_level;
pub(crate) mod pixel;
mod polarity;
pub mod probability;
pub(crate) mod region;
mod region_finder;
mod runs;
mod segmenter;
pub mod spatial;
mod strongest;
mod target_finder;
pub(crate) mod tbd;
pub mod threshold;
pub(crate) mod window;
pub use centroid::{Centroid, Surroundings, centroid};
pub use cluster::{Clusterer, segment};
pub use config::{CentroidConfig, CentroidMethod, ClusterConfig, GivenNoise, NoiseConfig, Weight};
pub use isolated::IsolatedConfig;
pub use llr::{LlrTable, ScoreImage};
pub use pixel::Pixel;
pub use region::Region;
pub use tbd::{GridEstimate, TrackBeforeDetect};
pub use window::{FollowConfig, Follower, dark_box, search_window};

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
