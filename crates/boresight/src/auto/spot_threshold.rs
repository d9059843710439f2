//! The threshold of the spot detector where targets stand apart from the noise.
//!
//! Source: our own. The threshold of particles lets some false detections through, for the sake of faint ones ([`super::particles`]), and counts on white noise. A codec makes noise last for
//! many frames, and a tracker that takes detections for independent believes it. Where targets are far brighter, nothing is lost without what scores less.
//! How: of the scores of the first scans a valley is looked for, around which lie next to no detections. Those below it are noise if they score no higher than those of the other polarity do: what a codec
//! makes of noise is as often dark as bright. Rims of bright spots are dark, and do not count. Where too few are left, as between many spots, those below are noise, or what a codec leaves behind a spot
//! that moves, if they are the fewer the higher they score: other targets, fainter ones, are a hill of their own.
//! Symbols: s a threshold, N(s) how many detections score less; b(s) = N(s r) - N(s / r), r = [`WIDE`].
//! Limits: faint targets of which most score less than the first threshold, or that are much fewer than the noise, go with it where there are bright ones.

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
const MOST_BETWEEN: f64 = 0.05;
/// Fewest detections at each side of it, and of the other polarity so that they can be compared.
const FEWEST: usize = 50;
/// The score that so many of them fall short of is compared with that of the other polarity, which it may exceed by as much as a valley is wide.
const COMPARED: f64 = 0.9;
/// Deviations by which a number may exceed the one before by chance.
const BY_CHANCE: f64 = 2.0;
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
    let noise = own().zip(&of_other).flat_map(|(own, other)| without_rings(other, own, RING_REACH * spot.size_px));
    let Some((k, share)) = valley(rising(scores), &rising(noise.collect()), spot.k) else { return Ok(None) };
    let reason = format!(
        "Spots of less than {k} deviations (not {}) are left out: {:.0} % of all, which score as noise does; hardly one scores as much.",
        spot.k,
        100.0 * share,
    );
    Ok(Some((k, reason)))
}

/// The scores of a scan's detections but those within `reach_px` of a stronger one of the other polarity: its rim.
fn without_rings(scan: &Scan, other: &Scan, reach_px: f64) -> Vec<f32> {
    let mut others: Vec<&Detection> = other.detections.iter().collect();
    others.sort_by(|a, b| a.position.y.total_cmp(&b.position.y));
    let is_ring = |d: &Detection| {
        let from = others.partition_point(|o| o.position.y < d.position.y - reach_px);
        let mut near = others[from..].iter().take_while(|o| o.position.y <= d.position.y + reach_px);
        near.any(|o| o.score > RING_RATIO * d.score && (o.position - d.position).norm() <= reach_px)
    };
    scan.detections.iter().filter(|d| !is_ring(d)).map(|d| d.score).collect()
}

/// The deepest valley of the scores from `least` on, above 0, of which those below are noise by that of the other polarity, or by themselves where there is little, and the share of these.
fn valley(scores: Vec<f32>, noise: &[f32], least: f64) -> Option<(f64, f64)> {
    let below = |s: f64| scores.partition_point(|v| f64::from(*v) < s);
    let most = f64::from(*scores.last().filter(|_| least > 0.0)?);
    let at = |of: &[f32]| f64::from(of[(COMPARED * of.len() as f64) as usize]);
    let steps = (0..).map(|i| least * WIDE * STEP.powi(i)).take_while(|s| *s < most);
    let sides = steps.filter_map(|s| {
        let (n, between) = (below(s), below(s * WIDE) - below(s / WIDE));
        let fewer = n.min(scores.len() - n);
        let compares = noise.len() >= FEWEST;
        let is_noise = || if compares { at(&scores[..n]) <= WIDE * at(noise) } else { falls(&scores[..n], least) };
        let is_valley = fewer >= FEWEST && between as f64 <= MOST_BETWEEN * fewer as f64;
        (is_valley && is_noise()).then_some((s, n, between as f64 / fewer as f64))
    });
    let (s, n, _) = sides.min_by(|a, b| a.2.total_cmp(&b.2))?;
    Some((round(s), n as f64 / scores.len() as f64))
}

/// Whether rising scores from `least` on are the fewer the higher they are, in steps of [`WIDE`] squared, but for chance.
fn falls(scores: &[f32], least: f64) -> bool {
    let below = |s: f64| scores.partition_point(|v| f64::from(*v) < s);
    let most = scores.last().map_or(0.0, |s| f64::from(*s));
    let edges = (0..).map(|i| least * (WIDE * WIDE).powi(i)).take_while(|s| *s <= most);
    let edges: Vec<usize> = edges.map(below).chain([scores.len()]).collect();
    let counts: Vec<f64> = edges.windows(2).map(|e| (e[1] - e[0]) as f64).collect();
    counts.windows(2).all(|c| c[1] <= c[0] + BY_CHANCE * c[0].max(1.0).sqrt())
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
    fn a_rim_is_left_out_and_what_lies_farther_away_or_is_as_strong_is_not() {
        let of = |places: &[(f64, f64, f32)]| {
            let detection = |&(x, y, score): &(f64, f64, f32)| Detection {
                score,
                ..Detection::at(nalgebra::Vector2::new(x, y), nalgebra::Matrix2::identity())
            };
            Scan::default().with_detections(places.iter().map(detection).collect())
        };
        let bright = of(&[(50.0, 90.0, 30.0), (50.0, 20.0, 30.0), (100.0, 50.0, 4.0)]);
        let dark = of(&[(60.0, 20.0, 5.0), (50.0, 31.0, 6.0), (50.0, 81.0, 7.0), (100.0, 52.0, 3.0)]);
        assert_eq!(without_rings(&dark, &bright, 10.0), [6.0, 3.0]);
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
        // The noise is told without the other polarity as well; what scores higher than that does is none, though it falls.
        assert!(valley(rising([&noise[..], &bright].concat()), &[], 2.5).is_some());
        assert_eq!(valley(rising([&noise[..], &bright].concat()), &rising(even(rng, 100, 2.5, 2.7)), 2.5), None);
        // A hill of faint targets alone.
        assert!(valley(rising([&bright[..], &even(rng, 1000, 6.0, 9.0)].concat()), &[], 2.5).is_none());
        assert_eq!(valley(Vec::new(), &dark, 2.5), None);
        assert_eq!(valley(rising([&noise[..], &bright].concat()), &dark, 0.0), None);
    }
}
