//! What every segmentation has in common: rows of pixels become rows of bits, and those become regions.

use super::cluster::Clusterer;
use super::config::ClusterConfig;
use super::pixel::Pixel;
use super::target_finder::TypedFrame;
use super::threshold::BackgroundGrid;
use super::threshold::band::words;
use crate::{Image, Result};

/// What the value of a segmented pixel says about the target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PixelWeight {
    /// The brighter, the surer.
    Intensity,
    /// The further from the ground, the surer.
    AboveBackground,
    /// Nothing: the pixel may be brighter or darker than the ground, so all count alike.
    Alike,
}

/// The regions of a frame as they grow, row by row.
pub(super) struct Regions {
    /// One row of bits.
    pub(super) bits: Vec<u64>,
    /// Regions brighter than their surroundings, or of either sign.
    pub(super) bright: Clusterer,
    /// Regions darker than their surroundings.
    pub(super) dark: Clusterer,
}

impl Regions {
    pub(super) fn new(config: &ClusterConfig) -> Self {
        Self { bits: Vec::new(), bright: Clusterer::new(config), dark: Clusterer::new(config) }
    }

    /// Forgets the last frame's regions.
    pub(super) fn begin(&mut self, width: usize) {
        self.bits.resize(words(width), 0);
        self.bright.begin(width);
        self.dark.begin(width);
    }
}

/// Says which pixels belong to targets; keeps its memory between frames.
pub(super) trait Segmenter<T: Pixel>: Send {
    /// What a segmented pixel's value says, where the configuration leaves it to the segmentation.
    fn weight(&self) -> PixelWeight;

    /// Whether what is segmented in a frame depends on the frames before.
    fn remembers(&self) -> bool {
        false
    }

    /// As [`super::target_finder::TargetFinder::is_blind`].
    fn is_blind(&self) -> bool {
        false
    }

    /// As [`super::target_finder::TargetFinder::prime_s`].
    fn prime_s(&self) -> f64 {
        0.0
    }

    /// As [`super::target_finder::TargetFinder::prime`].
    /// # Errors
    /// Frames of different sizes.
    fn prime(&mut self, _times_s: &[f64], _frames: &[&Image<T>]) -> Result<()> {
        Ok(())
    }

    /// Side of the cells of the local background that [`Self::segment`] compares with, px; nothing if it needs none.
    fn cell_px(&self) -> Option<u32> {
        None
    }

    /// Gives the rows of a frame to `regions`; returns the level at which pixels join, counts, where it is one for the whole frame.
    /// # Errors
    /// A frame that does not go with the frames before.
    fn segment(&mut self, frame: &TypedFrame<T>, ground: &BackgroundGrid, regions: &mut Regions)
    -> Result<Option<f64>>;

    /// The level at which pixels joined at a place, counts, given the ground's median and deviation there; `sign` is -1 for dark regions.
    fn level_at(&self, _ground: (f64, f64), _sign: f64) -> Option<f64> {
        None
    }
}
