//! Local threshold: pixel is target iff it lies at least k robust deviations above (or below) its local background.
//!
//! The background is [`super::grid::BackgroundGrid`]; the level of a row is interpolated between the grid's nodes.

use super::LocalConfig;
use super::bits::level_bits;
use super::grid::BackgroundGrid;
use crate::vision::pixel::Pixel;

/// Scratch of the local threshold.
#[derive(Clone, Debug, Default)]
pub struct LocalThreshold {
    level: Vec<f32>,
    states: Vec<u8>,
}

impl LocalThreshold {
    /// Writes the bits of one row for bright (`ABOVE`) or dark targets.
    pub fn bits<T: Pixel, const ABOVE: bool>(
        &mut self,
        config: &LocalConfig,
        grid: &BackgroundGrid,
        y: usize,
        row: &[T],
        bits: &mut [u64],
    ) {
        let sign = if ABOVE { 1.0 } else { -1.0 };
        grid.level_row(y, config.k as f32, config.min_contrast as f32, sign, &mut self.level);
        level_bits(row, &self.level, ABOVE, &mut self.states, bits);
    }
}
