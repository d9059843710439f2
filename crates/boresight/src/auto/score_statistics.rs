//! How detections score, targets' and false ones: what the score likelihood of the tracker needs.
//!
//! Source: our own; the densities are those of `track/score_likelihood.rs`. Of the tracks that a pass reports, the logarithm of each score less the mean of
//! those before (with the tracker's own gain) is a target's wander: its deviation is that of the middle half (1.349 σ apart for a normal law), and what lies farther than [`ODD`] of
//! them is odd. Scores of the detections that no such track holds are false: the exponent is the maximum-likelihood one (B. Hill, Annals of Statistics 3, 1975).
//! Counts of nothing are half a count; few scores are pulled towards the prior.
//! Limits: silent where a detector gives no scores above 0, or where too few are a target's.

use super::digits::round;
use crate::Scan;
use crate::track::ScoreLikelihoodConfig;
use std::collections::BTreeMap;

/// Steps of a target's score that are needed to know its wander.
const LEAST_STEPS: usize = 30;
/// A score is odd beyond so many deviations: of a normal law, 3 of 1000.
const ODD: f64 = 3.0;
/// Distance of the quartiles of a normal law, in deviations.
const QUARTILES: f64 = 1.349;
/// Steadier than this is nothing that is measured anew.
const LEAST_STD: f64 = 0.02;
/// The clutter's exponent before any false detection is seen, and how many that weighs.
const PRIOR_EXPONENT: f64 = 3.0;
const PRIOR_FALSE: f64 = 3.0;

/// Which detection of a scan a reported track holds.
#[derive(Clone, Copy, Debug)]
pub struct Held {
    /// The scan.
    pub scan: usize,
    /// The detection in it.
    pub detection: u32,
    /// The track.
    pub track: u64,
}

/// The law of the scores; `held` lists the detections of reported tracks in the order of time, `shared` those that several hold, whose scores are neither one target's nor false;
/// `gain` is that of the tracker's mean.
pub fn of(scans: &[Scan], held: &[Held], shared: &[Held], gain: f64) -> Option<ScoreLikelihoodConfig> {
    let all = || scans.iter().flat_map(|s| &s.detections).map(|d| f64::from(d.score));
    let (least, most) = all().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, m), s| (l.min(s), m.max(s)));
    if !(least > 0.0 && most > least && most.is_finite()) {
        return None;
    }
    let mut is_false: Vec<Vec<bool>> = scans.iter().map(|s| vec![true; s.detections.len()]).collect();
    for h in shared {
        is_false[h.scan][h.detection as usize] = false;
    }
    let mut means = BTreeMap::<u64, (usize, f64)>::new();
    let mut steps = Vec::new();
    for h in held {
        is_false[h.scan][h.detection as usize] = false;
        let log_score = f64::from(scans[h.scan].detections[h.detection as usize].score).ln();
        let (last, mean) = means.entry(h.track).or_insert((h.scan, log_score));
        if *last < h.scan {
            let step = log_score - *mean;
            steps.push((step, h.scan > *last + 1));
            *mean += gain * step;
            *last = h.scan;
        }
    }
    if steps.len() < LEAST_STEPS {
        return None;
    }
    steps.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let quartile = |q: usize| steps[q * (steps.len() - 1) / 4].0;
    let std = ((quartile(3) - quartile(1)) / QUARTILES).max(LEAST_STD);
    let half = |n: f64, of: f64| (n + 0.5) / (of + 1.0);
    let odd = |missed: bool| {
        let of = || steps.iter().filter(|s| s.1 == missed);
        round(half(of().filter(|s| s.0.abs() > ODD * std).count() as f64, of().count() as f64))
    };
    let (mut n_false, mut sum) = (0.0, 0.0);
    for (s, f) in scans.iter().zip(&is_false) {
        for (d, _) in s.detections.iter().zip(f).filter(|(_, f)| **f) {
            n_false += 1.0;
            sum += (f64::from(d.score) / least).ln();
        }
    }
    Some(ScoreLikelihoodConfig {
        least_score: round(least),
        clutter_exponent: round((n_false + PRIOR_FALSE) / (sum + PRIOR_FALSE / PRIOR_EXPONENT)),
        clutter_outlier_share: round(half(0.0, n_false)),
        target_log_std: round(std),
        target_outlier_share: odd(false),
        target_outlier_share_after_miss: odd(true),
        log_range: round((most / least).ln()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Detection, FrameIndex, Timestamp};
    use nalgebra::{Matrix2, Vector2};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// 300 scans of four targets with levels of their own, whose scores wander by `std`, `odd` of them anywhere, and ten false detections by a power law.
    fn scans(std: f64, odd: f64, exponent: f64) -> (Vec<Scan>, Vec<Held>) {
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let mut held = Vec::new();
        let scan = |k: usize, rng: &mut ChaCha8Rng, held: &mut Vec<Held>| {
            let detection = |log_score: f64| {
                Detection::at(Vector2::zeros(), Matrix2::identity()).with_score(log_score.exp() as f32)
            };
            let mut all: Vec<Detection> = Vec::new();
            for track in 0..4u64 {
                let log_score = match rng.random::<f64>() < odd {
                    true => 1.0 + 3.0 * rng.random::<f64>(),
                    false => 2.0 + 0.4 * track as f64 + std * rng.sample::<f64, _>(StandardNormal),
                };
                held.push(Held { scan: k, detection: all.len() as u32, track });
                all.push(detection(log_score));
            }
            all.extend((0..10).map(|_| detection(1.0 - rng.random::<f64>().ln() / exponent)));
            Scan::at(FrameIndex(k as u64), Timestamp::from_secs_f64(0.04 * k as f64)).with_detections(all)
        };
        ((0..300).map(|k| scan(k, &mut rng, &mut held)).collect(), held)
    }

    #[test]
    fn the_law_that_made_the_scores_is_found() {
        for (std, odd, exponent) in [(0.1, 0.0, 4.0), (0.2, 0.03, 2.0), (0.05, 0.02, 8.0)] {
            let (scans, held) = scans(std, odd, exponent);
            let gain = 0.3;
            let found = of(&scans, &held, &[], gain).unwrap();
            // About an exponential mean of white scores the deviation is √(1 + g / (2 − g)) of their own: 1.08.
            let expected = std * (1.0f64 + gain / (2.0 - gain)).sqrt();
            assert!((found.target_log_std / expected - 1.0).abs() < 0.2, "{std} {odd}: {found:?}");
            assert!((found.clutter_exponent / exponent - 1.0).abs() < 0.05, "{exponent}: {found:?}");
            // An odd score also draws the mean away for some scans after it.
            assert!(
                found.target_outlier_share >= 0.5 * odd && found.target_outlier_share < 0.02 + 4.0 * odd,
                "{odd}: {found:?}"
            );
            assert!((found.least_score / 1f64.exp() - 1.0).abs() < 0.01);
        }
    }

    #[test]
    fn nothing_is_said_of_scores_that_are_alike_or_missing_or_of_hardly_any_target() {
        let (mut scans, held) = scans(0.1, 0.0, 4.0);
        assert_eq!(of(&scans, &held[..20], &[], 0.3), None);
        for d in scans.iter_mut().flat_map(|s| &mut s.detections) {
            d.score = 1.0;
        }
        assert_eq!(of(&scans, &held, &[], 0.3), None);
        scans[7].detections[0].score = 0.0;
        assert_eq!(of(&scans, &held, &[], 0.3), None);
        assert_eq!(of(&[], &[], &[], 0.3), None);
    }
}
