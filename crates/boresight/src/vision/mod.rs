//! From a frame to detections: spatial filters, thresholds, clusters, centroids; never sees tracks.
//!
//! A threshold turns one row of pixels into one row of bits (`&[u64]`, bit `x % 64` of word `x / 64` is pixel `x`, bits past
//! the width are 0); the clusterer turns bit rows into regions with their moments. There is no label image, and a mask only of
//! what moves or has a colour ([`background`], [`colour`]).

mod at_once;
pub mod background;
pub mod bernoulli;
pub(crate) mod centroid;
pub mod cfar;
pub(crate) mod cluster;
pub mod colour;
pub(crate) mod config;
mod cut_off;
pub(crate) mod detector;
mod distance;
pub mod fit;
pub(crate) mod gaussian;
pub mod integrate;
pub(crate) mod isolated;
pub(crate) mod llr;
mod matched;
mod middle;
mod necks;
pub mod noise;
pub(crate) mod noise_level;
pub(crate) mod pixel;
mod polarity;
pub mod probability;
mod ranks;
pub(crate) mod region;
mod region_finder;
mod repeated;
mod runs;
mod segmenter;
mod shaking;
pub mod spatial;
pub mod steadied;
mod strongest;
mod target_finder;
pub(crate) mod tbd;
pub mod threshold;
mod whole;
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

pub(crate) use at_once::AtOnce;
pub use config::DetectorConfig;
pub use detector::build;

use crate::{Frame, Result, Scan};

/// Turns frames into detections.
///
/// One of one's own, which finds the brightest pixel:
/// ```
/// use boresight::vision::Detector;
/// use boresight::{Detection, Frame, Image, Pixels, Result, Scan};
///
/// struct Brightest;
///
/// impl Detector for Brightest {
///     fn detect(&mut self, frame: &Frame, scan: &mut Scan) -> Result<()> {
///         *scan = Scan::at(frame.index, frame.time);
///         let Pixels::Gray8(image) = &frame.pixels else { return Ok(()) };
///         let brightest = image.as_slice().iter().enumerate().max_by_key(|(_, v)| **v);
///         let place = |i: usize| ((i % image.width()) as f64, (i / image.width()) as f64);
///         scan.detections.extend(brightest.map(|(i, _)| place(i)).map(|(x, y)| Detection::point(x, y, 0.3)));
///         Ok(())
///     }
/// }
///
/// let mut image = Image::filled(8, 6, 10_u8);
/// image.as_mut_slice()[3 * 8 + 5] = 200;
/// let frame = Frame { index: Default::default(), time: Default::default(), pixels: Pixels::Gray8(image) };
/// let mut scan = Scan::at(frame.index, frame.time);
/// Brightest.detect(&frame, &mut scan)?;
/// assert_eq!(scan.detections, [Detection::point(5.0, 3.0, 0.3)]);
/// # Ok::<(), boresight::Error>(())
/// ```
pub trait Detector: Send {
    /// Replaces `scan` by the detections of `frame`, keeping its memory.
    /// # Errors
    /// A frame whose size or pixel type is not the one the detector was built for.
    fn detect(&mut self, frame: &Frame, scan: &mut Scan) -> Result<()>;

    /// Time from the first frame on that it is well to be shown before any of it is detected in, s; 0 for a detector that learns nothing from it.
    fn prime_s(&self) -> f64 {
        0.0
    }

    /// Learns from the first frames.
    /// # Errors
    /// As [`Detector::detect`].
    fn prime(&mut self, _frames: &[Frame]) -> Result<()> {
        Ok(())
    }

    /// Does of [`Detector::detect`] what must be done frame after frame; whether that was all. If not, [`Detector::finish`] of a [`Detector::twin`] does the rest.
    /// # Errors
    /// As [`Detector::detect`].
    fn begin(&mut self, frame: &Frame, scan: &mut Scan) -> Result<bool> {
        self.detect(frame, scan).map(|()| true)
    }

    /// Leaves out regions smaller than this from now on, as one whose configuration says so (`cluster.min-area-px`); `false`, and nothing changed, where a detector cannot.
    fn leave_out_below(&mut self, _area_px: u32) -> bool {
        false
    }

    /// One more detector that finds the same, for another thread and any of the frames; `None` if what is found in a frame depends on those before.
    fn twin(&self) -> Option<Box<dyn Detector>> {
        None
    }

    /// Does what [`Detector::begin`] left to be done.
    /// # Errors
    /// As [`Detector::detect`].
    fn finish(&mut self, frame: &Frame, scan: &mut Scan) -> Result<()> {
        let motion = scan.camera_motion.take();
        self.detect(frame, scan)?;
        scan.camera_motion = motion;
        Ok(())
    }
}
