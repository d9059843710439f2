//! What every way of finding targets has in common: a frame of one pixel type goes in, detections come out.
//!
//! One struct for each way implements [`TargetFinder`]: those that join pixels to regions through [`super::region_finder`], the
//! others (`isolated`, `threshold::spot`, `cfar`, `integrate`) by themselves. `super::detector` builds the one that the configuration names.

use super::config::{DetectorConfig, NoiseConfig};
use super::noise_level::noise_level;
use super::pixel::Pixel;
use crate::{Detection, Image, Result};

/// Frames of the first seconds that a detector is shown beforehand, evenly spread: a median that five of them do not move.
pub(super) const PRIME_FRAMES: usize = 11;

/// A frame as a finder sees it.
pub(super) struct TypedFrame<'a, T> {
    /// The pixels as they came.
    pub(super) raw: &'a Image<T>,
    /// The pixels after the spatial filter; `raw` without one.
    pub(super) image: &'a Image<T>,
    /// The colours, where the frame has them.
    pub(super) colours: Option<&'a Image<[u8; 3]>>,
    /// Time since the frame before, s; 0 at the first.
    pub(super) dt_s: f64,
}

/// Finds targets in frames of one pixel type; keeps its memory between frames.
pub(super) trait TargetFinder<T: Pixel>: Send {
    /// Appends the detections of a frame to `out`, with the covariance that its pixels' noise explains.
    /// # Errors
    /// A frame that does not go with the frames before.
    fn find(&mut self, frame: &TypedFrame<T>, config: &DetectorConfig, out: &mut Vec<Detection>) -> Result<()>;

    /// Whether what is found in a frame depends on the frames before.
    fn remembers(&self) -> bool;

    /// Time from the first frame on that it is well to be shown beforehand, s.
    fn prime_s(&self) -> f64 {
        0.0
    }

    /// Learns from some of the first frames, evenly spread; `times_s` are theirs since the first of them.
    /// # Errors
    /// Frames of different sizes.
    fn prime(&mut self, _times_s: &[f64], _frames: &[&Image<T>]) -> Result<()> {
        Ok(())
    }

    /// Whether nothing could be found in the last frame, whatever it shows.
    fn is_blind(&self) -> bool {
        false
    }
}

/// Says how noisy a pixel is, as the configuration wants it.
#[derive(Clone, Debug, Default)]
pub(super) struct PixelNoise {
    samples: Vec<f32>,
}

impl PixelNoise {
    /// Variance of one pixel at intensity 0, counts², and its growth with intensity, counts; the first may be below 0 where black is not 0.
    ///
    /// Taken from the unfiltered pixels: a weighted sum over a cluster of smoothed pixels is nearly the same sum over the pixels
    /// before smoothing, whose noise is white.
    pub(super) fn of<T: Pixel>(&mut self, raw: &Image<T>, config: &NoiseConfig) -> (f64, f64) {
        match config {
            // The rounding to whole counts is noise as well.
            NoiseConfig::Given(g) => {
                (g.read_counts * g.read_counts - g.gain * g.offset_counts + f64::from(T::STEP) / 12.0, g.gain)
            }
            NoiseConfig::Estimated => (noise_level(raw, &mut self.samples).powi(2), 0.0),
        }
    }
}
