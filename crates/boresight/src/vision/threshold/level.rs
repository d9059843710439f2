//! A band or a fixed level over a whole frame: every row's bits go to the clusterer as they come
//! (`docs/theory/segmentation.md`).

use super::bits::band_bits;
use super::grid::BackgroundGrid;
use super::{BandConfig, LevelConfig, Side};
use crate::vision::cluster::Clusterer;
use crate::vision::pixel::Pixel;
use crate::vision::segmenter::{PixelWeight, Regions, Segmenter};
use crate::vision::target_finder::TypedFrame;
use crate::{Image, Result};

/// The edge of a band towards the background: the lower one, or the upper one if the band has no lower end. Whole-number
/// pixels join half a count before it.
fn band_edge<T: Pixel>(low: T, high: T) -> f64 {
    let half = 0.5 * f64::from(T::STEP);
    if T::band(f64::NEG_INFINITY, f64::INFINITY).is_some_and(|(least, _)| low <= least) {
        high.value() + half
    } else {
        low.value() - half
    }
}

/// Gives the rows of a frame inside a band to the clusterer; no band, no pixels.
fn one_band<T: Pixel>(image: &Image<T>, band: Option<(T, T)>, bits: &mut [u64], clusters: &mut Clusterer) {
    let Some((low, high)) = band else { return };
    for y in 0..image.height() {
        let row = image.row(y);
        band_bits(row, low, high, bits);
        clusters.row(y, bits, row);
    }
}

/// A level is a band with one open end; returns the edge.
pub(super) fn one_side<T: Pixel>(image: &Image<T>, c: &LevelConfig, regions: &mut Regions) -> Option<f64> {
    let (band, clusters) = match c.side {
        Side::Bright => {
            let low = if c.exclusive { c.level.next_up() } else { c.level };
            (T::band(low, f64::INFINITY), &mut regions.bright)
        }
        Side::Dark => {
            let high = if c.exclusive { c.level.next_down() } else { c.level };
            (T::band(f64::NEG_INFINITY, high), &mut regions.dark)
        }
    };
    one_band(image, band, &mut regions.bits, clusters);
    band.map(|(low, high)| band_edge(low, high))
}

/// What the values of pixels on one side of a level say.
pub(super) fn weight_of(side: Side) -> PixelWeight {
    match side {
        Side::Bright => PixelWeight::Intensity,
        Side::Dark => PixelWeight::AboveBackground,
    }
}

impl<T: Pixel> Segmenter<T> for BandConfig {
    fn weight(&self) -> PixelWeight {
        PixelWeight::Intensity
    }

    fn segment(&mut self, frame: &TypedFrame<T>, _: &BackgroundGrid, regions: &mut Regions) -> Result<Option<f64>> {
        let band = T::band(self.low, self.high);
        one_band(frame.image, band, &mut regions.bits, &mut regions.bright);
        Ok(band.map(|(low, high)| band_edge(low, high)))
    }
}

impl<T: Pixel> Segmenter<T> for LevelConfig {
    fn weight(&self) -> PixelWeight {
        weight_of(self.side)
    }

    fn segment(&mut self, frame: &TypedFrame<T>, _: &BackgroundGrid, regions: &mut Regions) -> Result<Option<f64>> {
        Ok(one_side(frame.image, self, regions))
    }
}
