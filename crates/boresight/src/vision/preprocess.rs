//! What a detector keeps for the one pixel type of its frames: the smoothed frame and the memory of moving pixels.

use super::background::{Background, BitImage, FrameDifference};
use super::pixel::Pixel;
use super::spatial::{SpatialConfig, SpatialFilter};
use super::threshold::ThresholdConfig;
use crate::{Image, Result, Timestamp};

/// A spatial filter and its result.
pub(super) struct Smoother<T: Pixel> {
    filter: SpatialFilter<T>,
    out: Image<T>,
}

impl<T: Pixel> Smoother<T> {
    pub(super) fn apply(&mut self, image: &Image<T>) -> &Image<T> {
        self.filter.apply(image, &mut self.out);
        &self.out
    }
}

/// Finds the pixels that move.
pub(super) enum Motion<T: Pixel> {
    Background(Box<Background<T>>),
    Difference(Box<FrameDifference<T>>),
}

impl<T: Pixel> Motion<T> {
    /// Takes the next frame; `last` is the time of the one before.
    pub(super) fn update(&mut self, image: &Image<T>, time: Timestamp, last: Option<Timestamp>) -> Result<()> {
        match self {
            Self::Background(b) => b.update(image, last.map_or(0.0, |l| time.seconds_since(l))),
            Self::Difference(d) => d.update(image),
        }
    }

    /// The moving pixels.
    pub(super) fn bits(&self) -> &BitImage {
        match self {
            Self::Background(b) => b.moving(),
            Self::Difference(d) => d.moving(),
        }
    }
}

/// The parts of a detector that depend on the pixel type; nothing in them for the types that its frames do not have.
pub(super) struct Preprocessing<T: Pixel> {
    pub(super) smoother: Option<Smoother<T>>,
    pub(super) motion: Option<Motion<T>>,
}

impl<T: Pixel> Default for Preprocessing<T> {
    fn default() -> Self {
        Self { smoother: None, motion: None }
    }
}

impl<T: Pixel> Preprocessing<T> {
    pub(super) fn new(filter: SpatialConfig, threshold: &ThresholdConfig) -> Result<Self> {
        let smoother = match filter {
            SpatialConfig::None => None,
            _ => Some(Smoother { filter: SpatialFilter::new(filter)?, out: Image::default() }),
        };
        let motion = match threshold {
            ThresholdConfig::Moving(c) => Some(Motion::Background(Box::new(Background::new(c.clone())?))),
            ThresholdConfig::Difference(c) => Some(Motion::Difference(Box::new(FrameDifference::new(c.clone())?))),
            _ => None,
        };
        Ok(Self { smoother, motion })
    }
}
