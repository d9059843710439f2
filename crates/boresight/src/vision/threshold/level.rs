//! A band or a fixed level over a whole frame: every row's bits go to the clusterer as they come
//! (`docs/theory/segmentation.md`).

use super::bits::band_bits;
use super::{LevelConfig, Side};
use crate::Image;
use crate::vision::cluster::Clusterer;
use crate::vision::pixel::Pixel;

/// The edge of a band towards the background: the lower one, or the upper one if the band has no lower end. Whole-number
/// pixels join half a count before it.
pub(crate) fn band_edge<T: Pixel>(low: T, high: T) -> f64 {
    let half = 0.5 * f64::from(T::STEP);
    if T::band(f64::NEG_INFINITY, f64::INFINITY).is_some_and(|(least, _)| low <= least) {
        high.value() + half
    } else {
        low.value() - half
    }
}

/// Gives the rows of a frame inside a band to the clusterer; no band, no pixels.
pub(crate) fn one_band<T: Pixel>(image: &Image<T>, band: Option<(T, T)>, bits: &mut [u64], clusters: &mut Clusterer) {
    let Some((low, high)) = band else { return };
    for y in 0..image.height() {
        let row = image.row(y);
        band_bits(row, low, high, bits);
        clusters.row(y, bits, row);
    }
}

/// A level is a band with one open end; returns the edge.
pub(crate) fn one_side<T: Pixel>(
    image: &Image<T>,
    c: &LevelConfig,
    bits: &mut [u64],
    bright: &mut Clusterer,
    dark: &mut Clusterer,
) -> Option<f64> {
    let (band, clusters) = match c.side {
        Side::Bright => {
            let low = if c.exclusive { c.level.next_up() } else { c.level };
            (T::band(low, f64::INFINITY), bright)
        }
        Side::Dark => {
            let high = if c.exclusive { c.level.next_down() } else { c.level };
            (T::band(f64::NEG_INFINITY, high), dark)
        }
    };
    one_band(image, band, bits, clusters);
    band.map(|(low, high)| band_edge(low, high))
}
