//! How likely a pixel passes a band, the range of d_p that follows, and a band proposed from what target and surroundings show.
//!
//! Source: `docs/theory/segmentation.md` (thesis eqs 4.14, 4.15). Symbols: p_t, p_v share of target and background
//! pixels inside the band; d_p proximity distance (px), which should lie between √(1/p_t) (else the target falls apart)
//! and √(1/p_v) (else clutter grows together). Proposal: the contiguous band with the largest p_t - p_v of the two
//! histograms (exact, one pass).

use super::pixel::Pixel;
use crate::{Error, ErrorKind, Image, Result};
use std::f64::consts::SQRT_2;

/// Mean and standard deviation of the pixels of a target or of the background, counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// Mean, counts.
    pub mean: f64,
    /// Standard deviation, counts, 0 or more.
    pub sd: f64,
}

/// Probability that normal noise lies in [`low`, `high`] (eq. 4.14); for pixels rounded to whole counts see
/// [`rounded_probability`].
///
/// ```
/// use boresight::vision::probability::{Level, pixel_probability, proximity_range, rounded_probability};
/// let (target, background) = (Level { mean: 100.0, sd: 10.0 }, Level { mean: 50.0, sd: 50.0 });
/// let p_t = pixel_probability(90.0, 110.0, target);
/// let p_v = pixel_probability(90.0, 110.0, background);
/// assert!((p_t - 0.68268949213709).abs() < 1e-13);
/// assert!((p_v - 0.096785728361688).abs() < 1e-13);
/// assert!((rounded_probability(90.0, 110.0, target) - 0.70628188724821).abs() < 1e-13);
/// assert!((rounded_probability(90.0, 110.0, background) - 0.10162443771966).abs() < 1e-13);
/// let (low, high) = proximity_range(p_t, p_v);
/// assert!((low - 1.2102870624325).abs() < 1e-12 && (high - 3.2143586947306).abs() < 1e-12);
/// ```
pub fn pixel_probability(low: f64, high: f64, level: Level) -> f64 {
    if level.sd == 0.0 {
        return f64::from(u8::from(low <= level.mean && level.mean <= high));
    }
    interval((low - level.mean) / level.sd, (high - level.mean) / level.sd)
}

/// Probability that a normal value rounded to whole counts lies in [`low`, `high`].
pub fn rounded_probability(low: f64, high: f64, level: Level) -> f64 {
    pixel_probability(low - 0.5, high + 0.5, level)
}

/// Φ(b) - Φ(a), from whichever tails are small, so that rare events keep their digits.
pub(crate) fn interval(a: f64, b: f64) -> f64 {
    // Not statrs' erfc: it is good to 1e-10 only.
    let upper = |z: f64| 0.5 * libm::erfc(z / SQRT_2);
    if a > 0.0 { upper(a) - upper(b) } else { upper(-b) - upper(-a) }
}

/// The range (low, high) that the proximity distance should lie in, px (eq. 4.15); empty if p_t <= p_v.
pub fn proximity_range(p_target: f64, p_background: f64) -> (f64, f64) {
    ((1.0 / p_target).sqrt(), (1.0 / p_background).sqrt())
}

/// Says what to expect if `distance_px` lies outside the range that the probabilities give, or `None` if it lies inside.
pub fn distance_warning(distance_px: f64, p_target: f64, p_background: f64) -> Option<String> {
    let (low, high) = proximity_range(p_target, p_background);
    if p_target <= p_background {
        return Some(format!(
            "the band holds {:.1} % of the target's pixels but {:.1} % of the background's: no proximity distance can tell \
             them apart; choose another band",
            100.0 * p_target,
            100.0 * p_background
        ));
    }
    let range = format!("the range {low:.2} to {high:.2} px that eq. 4.15 gives for this band");
    if distance_px <= low {
        Some(format!(
            "proximity distance {distance_px} px is below {range}: the target may fall apart into several clusters"
        ))
    } else if distance_px >= high {
        Some(format!("proximity distance {distance_px} px is above {range}: clutter may grow together with the target"))
    } else {
        None
    }
}

/// A rectangle of whole pixels, all four sides included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelRect {
    /// First column.
    pub left: usize,
    /// First row.
    pub top: usize,
    /// Last column.
    pub right: usize,
    /// Last row.
    pub bottom: usize,
}

/// A band and what it lets through.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BandProposal {
    /// Lowest kept value, counts.
    pub low: f64,
    /// Highest kept value, counts.
    pub high: f64,
    /// Share of the target's pixels inside the band.
    pub p_target: f64,
    /// Share of the surroundings' pixels inside the band.
    pub p_background: f64,
    /// The target's pixels.
    pub target: Level,
    /// The surroundings' pixels.
    pub background: Level,
}

/// Bins of the histogram, for 8 bits a level each.
const BINS: usize = 256;

/// Proposes the band that separates a target from the ring of `margin_px` around it.
/// # Errors
/// A rectangle outside the image or without a ring; values that are all the same.
pub fn propose_band<T: Pixel>(image: &Image<T>, target: PixelRect, margin_px: usize) -> Result<BandProposal> {
    let bad = |what: &str| Error::new(ErrorKind::Config, what).at(format!("target {target:?}"));
    let PixelRect { left, top, right, bottom } = target;
    if left > right || top > bottom || right >= image.width() || bottom >= image.height() {
        return Err(bad(&format!("expected a rectangle inside the {} x {} image", image.width(), image.height())));
    }
    let (mut inside, mut around) = (Vec::new(), Vec::new());
    for y in top.saturating_sub(margin_px)..=bottom.saturating_add(margin_px).min(image.height() - 1) {
        for x in left.saturating_sub(margin_px)..=right.saturating_add(margin_px).min(image.width() - 1) {
            let v = image.row(y)[x].value();
            let is_target = (left..=right).contains(&x) && (top..=bottom).contains(&y);
            if v.is_finite() {
                if is_target { inside.push(v) } else { around.push(v) }
            }
        }
    }
    if inside.is_empty() || around.is_empty() {
        return Err(bad("found no pixels inside or around it").hint("give a margin of a few pixels"));
    }
    let min = inside.iter().chain(&around).copied().fold(f64::INFINITY, f64::min);
    let max = inside.iter().chain(&around).copied().fold(f64::NEG_INFINITY, f64::max);
    if min == max {
        return Err(
            bad("target and surroundings hold one and the same value").hint("give a rectangle that holds the target")
        );
    }
    // Whole counts where they fit the bins; else equal bins.
    let width = if T::STEP > 0.0 { ((max - min + 1.0) / BINS as f64).ceil() } else { (max - min) / BINS as f64 };
    let bin = |v: f64| (((v - min) / width) as usize).min(BINS - 1);
    let mut gain = [0.0f64; BINS];
    inside.iter().for_each(|&v| gain[bin(v)] += 1.0 / inside.len() as f64);
    around.iter().for_each(|&v| gain[bin(v)] -= 1.0 / around.len() as f64);
    let (first, last) = best_stretch(&gain);
    let low = min + first as f64 * width;
    let high =
        if T::STEP > 0.0 { low.max(min + (last + 1) as f64 * width - 1.0) } else { min + (last + 1) as f64 * width };
    let share = |v: &[f64]| v.iter().filter(|v| (low..=high).contains(*v)).count() as f64 / v.len() as f64;
    Ok(BandProposal {
        low,
        high,
        p_target: share(&inside),
        p_background: share(&around),
        target: level_of(&inside),
        background: level_of(&around),
    })
}

fn level_of(values: &[f64]) -> Level {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    Level { mean, sd: (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt() }
}

/// First and last bin of the stretch with the largest sum (one pass; the earliest and shortest of equals).
fn best_stretch(gain: &[f64]) -> (usize, usize) {
    let (mut best, mut stretch) = (f64::NEG_INFINITY, (0, 0));
    let (mut sum, mut start) = (0.0, 0);
    for (i, g) in gain.iter().enumerate() {
        if sum <= 0.0 {
            (sum, start) = (0.0, i);
        }
        sum += g;
        if sum > best {
            (best, stretch) = (sum, (start, i));
        }
    }
    stretch
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_distance_outside_the_range_is_warned_of() {
        // docs/theory/segmentation.md: data set II allows 1.2103 to 3.2144.
        assert_eq!(distance_warning(2.0, 0.682689, 0.096786), None);
        assert!(distance_warning(1.2, 0.682689, 0.096786).unwrap().contains("below the range 1.21 to 3.21 px"));
        assert!(distance_warning(3.3, 0.682689, 0.096786).unwrap().contains("above the range"));
        assert!(distance_warning(2.0, 0.1, 0.2).unwrap().contains("choose another band"));
    }

    #[test]
    fn without_noise_a_pixel_is_in_the_band_or_not() {
        assert_eq!(pixel_probability(90.0, 110.0, Level { mean: 110.0, sd: 0.0 }), 1.0);
        assert_eq!(pixel_probability(90.0, 110.0, Level { mean: 110.5, sd: 0.0 }), 0.0);
    }

    #[test]
    fn the_proposed_band_holds_the_target_and_leaves_the_ground() {
        let mut image = Image::filled(30, 30, 40u8);
        for y in 10..19 {
            for x in 10..19 {
                image.row_mut(y)[x] = (95 + (x * 7 + y * 3) % 11) as u8;
            }
        }
        let rect = PixelRect { left: 10, top: 10, right: 18, bottom: 18 };
        let band = propose_band(&image, rect, 6).unwrap();
        assert_eq!((band.low, band.high, band.p_target, band.p_background), (95.0, 105.0, 1.0, 0.0));
        assert_eq!(band.background, Level { mean: 40.0, sd: 0.0 });
        assert!(propose_band(&image, PixelRect { right: 30, ..rect }, 6).is_err());
        assert!(propose_band(&Image::filled(30, 30, 1u8), rect, 6).is_err());
    }
}
