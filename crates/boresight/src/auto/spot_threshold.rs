//! The threshold of the spot detector where targets stand apart from the noise.
//!
//! Source: our own. The threshold of particles lets some false detections through, for the sake of faint ones ([`super::particles`]), and counts on white noise. A codec makes noise last for
//! many frames, and a tracker that takes detections for independent believes it. Where targets are far brighter, nothing is lost without what scores less.
//! How: of the scores of the first scans a valley is looked for, around which lie next to no detections; the detections below it are noise if they score no higher than those of the other polarity do: what
//! a codec makes of noise is as often dark as bright. Rims of bright spots are dark, and do not count.
//! Symbols: s a threshold, N(s) how many detections score less; b(s) = N(s r) - N(s / r), r = [`WIDE`].
//! Limits: silent where a ground that is cut off at black has no dark spots; faint targets that are much fewer than the noise beside bright ones go with it.

use super::digits::round;
use super::looks;
use super::spread::spread;
use crate::vision::threshold::{Polarity, SpotConfig, ThresholdConfig};
use crate::{Config, Detection, Frame, Result, Scan, SourceInfo};

/// Frames looked at.
const LOOKS: usize = 12;
/// Half width of a valley, a factor: a score of few deviations wanders by a fifth.
const WIDE: f64 = 1.25;
/// Most detections in a valley for each of those on the side where there are fewer.
const MOST_BETWEEN: f64 = 0.02;
/// Fewest detections at each side of it, and of the other polarity.
const FEWEST: usize = 50;
/// The score that so many of them fall short of is compared with that of the other polarity, which it may exceed by as much as a valley is wide.
const COMPARED: f64 = 0.9;
/// Thresholds that are tried lie apart by this factor.
const STEP: f64 = 1.05;
/// Reach of the dark ring around a bright spot, in units of the spot's size, and how much brighter than the ring the spot is at least.
const RING_REACH: f64 = 1.5;
const RING_RATIO: f32 = 2.0;

/// The threshold in a valley above the noise, with the reason, if there is one; `scans` are what the detector made of `frames`.
/// # Errors
/// Frames of more than one size or pixel type.
pub(super) fn raised(
    frames: &[Frame],
    scans: &[Scan],
    config: &Config,
    info: &SourceInfo,
    n_threads: usize,
) -> Result<Option<(f64, String)>> {
    let ThresholdConfig::Spot(spot) = &config.detector.threshold else { return Ok(None) };
    let polarity = match spot.polarity {
        Polarity::Bright => Polarity::Dark,
        Polarity::Dark => Polarity::Bright,
        Polarity::Both => return Ok(None),
    };
    let places: Vec<usize> = (0..frames.len().min(scans.len())).collect();
    let places: Vec<usize> = spread(&places, LOOKS).copied().collect();
    let mut other = config.detector.clone();
    other.threshold = ThresholdConfig::Spot(SpotConfig { polarity, ..spot.clone() });
    let of_other = looks::scans(&other, places.iter().map(|&k| &frames[k]), info, n_threads)?;
    let own = || places.iter().map(|&k| &scans[k]);
    let scores = own().flat_map(|scan| scan.detections.iter().map(|d| d.score)).collect();
    let reach2 = (RING_REACH * spot.size_px).powi(2);
    let is_ring = |d: &Detection, scan: &Scan| {
        let of = |b: &Detection| b.score > RING_RATIO * d.score && (b.position - d.position).norm_squared() < reach2;
        scan.detections.iter().any(of)
    };
    let noise = own().zip(&of_other);
    let noise = noise.flat_map(|(own, other)| other.detections.iter().filter(|d| !is_ring(d, own)).map(|d| d.score));
    let Some((k, share)) = valley(rising(scores), &rising(noise.collect()), spot.k) else { return Ok(None) };
    let reason = format!(
        "Spots of less than {k} deviations (not {}) are left out: {:.0} % of all, which score as {} noise does; hardly one scores as much.",
        spot.k,
        100.0 * share,
        if polarity == Polarity::Dark { "dark" } else { "bright" },
    );
    Ok(Some((k, reason)))
}

/// The deepest valley of the scores from `least` on of which those below score as the noise does, and the share of these.
fn valley(scores: Vec<f32>, noise: &[f32], least: f64) -> Option<(f64, f64)> {
    let below = |s: f64| scores.partition_point(|v| f64::from(*v) < s);
    let most = f64::from(*scores.last()?);
    let at = |of: &[f32]| f64::from(of[(COMPARED * of.len() as f64) as usize]);
    let steps = (0..).map(|i| least * WIDE * STEP.powi(i)).take_while(|s| *s < most);
    let sides = steps.filter_map(|s| {
        let (n, between) = (below(s), below(s * WIDE) - below(s / WIDE));
        let fewer = n.min(scores.len() - n);
        let is_noise = || at(&scores[..n]) <= WIDE * at(noise);
        let counts = fewer >= FEWEST && noise.len() >= FEWEST && between as f64 <= MOST_BETWEEN * fewer as f64;
        (counts && is_noise()).then_some((s, n, between as f64 / fewer as f64))
    });
    let (s, n, _) = sides.min_by(|a, b| a.2.total_cmp(&b.2))?;
    Some((round(s), n as f64 / scores.len() as f64))
}

fn rising(mut scores: Vec<f32>) -> Vec<f32> {
    scores.sort_unstable_by(f32::total_cmp);
    scores
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Scores whose excess over `from` falls off exponentially, with a mean of `mean`.
    fn tail(rng: &mut ChaCha8Rng, n: usize, from: f32, mean: f32) -> Vec<f32> {
        (0..n).map(|_| from - mean * (1.0 - rng.random::<f32>()).ln()).collect()
    }

    fn even(rng: &mut ChaCha8Rng, n: usize, from: f32, to: f32) -> Vec<f32> {
        (0..n).map(|_| from + (to - from) * rng.random::<f32>()).collect()
    }

    #[test]
    fn a_valley_lies_between_noise_and_targets_that_stand_apart() {
        let rng = &mut ChaCha8Rng::seed_from_u64(8);
        let dark = rising(tail(rng, 600, 2.5, 0.6));
        let noise = tail(rng, 3000, 2.5, 0.6);
        let bright = even(rng, 5000, 30.0, 80.0);
        let (k, share) = valley(rising([&noise[..], &bright].concat()), &dark, 2.5).unwrap();
        assert!(k > 7.0 && k < 30.0, "{k}");
        assert!((share - 0.375).abs() < 0.01, "{share}");
    }

    #[test]
    fn there_is_none_where_targets_begin_in_the_noise_and_none_above_faint_targets() {
        let rng = &mut ChaCha8Rng::seed_from_u64(9);
        let dark = rising(tail(rng, 600, 2.5, 0.6));
        let noise = tail(rng, 3000, 2.5, 0.6);
        let faint = even(rng, 5000, 2.5, 40.0);
        assert_eq!(valley(rising([&noise[..], &faint].concat()), &dark, 2.5), None);
        // Faint targets as many as the noise, and bright ones: what lies below the valley is no noise.
        let (faint, bright) = (even(rng, 3000, 2.5, 9.0), even(rng, 5000, 40.0, 80.0));
        assert_eq!(valley(rising([&noise[..], &faint, &bright].concat()), &dark, 2.5), None);
        // Without anything of the other polarity nothing is known of the noise.
        assert_eq!(valley(rising([&noise[..], &bright].concat()), &[], 2.5), None);
        assert_eq!(valley(Vec::new(), &dark, 2.5), None);
    }
}
