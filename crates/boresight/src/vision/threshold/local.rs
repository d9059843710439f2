//! Local threshold: pixel is target iff it lies at least k robust deviations above (or below) its local background.
//!
//! The background is [`super::grid::BackgroundGrid`]; the level of a row is interpolated between the grid's nodes.

use super::bits::level_bits;
use super::grid::BackgroundGrid;
use super::{LocalConfig, Side};
use crate::Result;
use crate::vision::pixel::Pixel;
use crate::vision::segmenter::{PixelWeight, Regions, Segmenter};
use crate::vision::target_finder::TypedFrame;

/// The local threshold with its scratch.
#[derive(Clone, Debug)]
pub(crate) struct LocalThreshold {
    config: LocalConfig,
    level: Vec<f32>,
    states: Vec<u8>,
}

impl LocalThreshold {
    pub(crate) fn new(config: &LocalConfig) -> Self {
        Self { config: config.clone(), level: Vec::new(), states: Vec::new() }
    }
}

impl<T: Pixel> Segmenter<T> for LocalThreshold {
    fn weight(&self) -> PixelWeight {
        PixelWeight::AboveBackground
    }

    fn cell_px(&self) -> Option<u32> {
        Some(self.config.cell_px)
    }

    fn segment(
        &mut self,
        frame: &TypedFrame<T>,
        ground: &BackgroundGrid,
        regions: &mut Regions,
    ) -> Result<Option<f64>> {
        let (k, min_contrast) = (self.config.k as f32, self.config.min_contrast as f32);
        for y in 0..frame.image.height() {
            let row = frame.image.row(y);
            for (side, sign) in [(Side::Bright, 1.0), (Side::Dark, -1.0)] {
                if self.config.polarity.has(side) {
                    let clusters = if side == Side::Bright { &mut regions.bright } else { &mut regions.dark };
                    ground.level_row(y, k, min_contrast, sign, &mut self.level);
                    level_bits(row, &self.level, side == Side::Bright, &mut self.states, &mut regions.bits);
                    clusters.row(y, &regions.bits, row);
                }
            }
        }
        Ok(None)
    }

    fn level_at(&self, (median, deviation): (f64, f64), sign: f64) -> Option<f64> {
        Some(median + sign * (self.config.k * deviation).max(self.config.min_contrast))
    }
}
