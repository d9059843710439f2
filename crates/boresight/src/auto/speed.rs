//! How fast targets are, before any tracker has run: the steps of chains of detections beyond those that chance makes.
//!
//! Source: our own; the chains are those of [`super::chains`], in the detections of the first pass, on steady ground. A tracker that is told too small a largest
//! speed never begins a track, and nothing that is learnt from its tracks can mend that.
//! Limits: raises the largest speed only: that none was seen so fast is no reason that none comes.

use super::digits::round;
use super::evidence::Evidence;
use crate::Config;
use crate::io::LengthUnit;

/// The largest speed over that which hardly a step exceeds: a target speeds up, another one is faster.
const RESERVE: f64 = 1.5;

/// Raises the largest speed to what the chains of detections show; `unit` is what their positions are in.
pub fn learn(evidence: &Evidence, unit: LengthUnit, config: &mut Config, reasons: &mut Vec<String>) {
    // Scans of one time (two sensors') would make any step infinitely fast.
    let of_all = evidence.fastest_px_per_s().filter(|f| f.is_finite());
    let fastest = of_all.into_iter().chain(evidence.fastest_chain_px_per_s()).max_by(f64::total_cmp);
    let Some(fastest) = fastest else { return };
    let (speed, px) = (round(RESERVE * fastest), unit.sign());
    if speed > config.tracker.max_speed_px_per_s {
        reasons.push(format!(
            "Chains of detections move by up to {fastest:.0} {px}/s: the largest speed is {speed} {px}/s, not {}.",
            config.tracker.max_speed_px_per_s
        ));
        config.tracker.max_speed_px_per_s = speed;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Detection, FrameIndex, Scan, Timestamp};
    use nalgebra::{Matrix2, Vector2};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// The largest speed after 60 scans of 25 a second of a target that crosses at so many px a scan every 20 scans, with five false detections a scan.
    fn learnt(step_px: f64) -> (f64, usize) {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let scans: Vec<Scan> = (0..60u64)
            .map(|k| {
                let mut at = vec![Vector2::new(5.0 + step_px * (k % 20) as f64, 120.0)];
                at.extend((0..5).map(|_| Vector2::new(320.0 * rng.random::<f64>(), 240.0 * rng.random::<f64>())));
                let all = at.into_iter().map(|at| Detection::at(at, Matrix2::identity() * 0.05)).collect();
                Scan::at(FrameIndex(k), Timestamp::from_secs_f64(0.04 * k as f64)).with_detections(all)
            })
            .collect();
        let (mut config, mut reasons) = (Config::default(), Vec::new());
        config.tracker.max_speed_px_per_s = 160.0;
        let evidence = Evidence::of_scans(&scans, 320.0 * 240.0);
        learn(&evidence, LengthUnit::Pixel, &mut config, &mut reasons);
        (config.tracker.max_speed_px_per_s, reasons.len())
    }

    #[test]
    fn what_is_faster_than_assumed_raises_the_largest_speed_and_what_is_slower_leaves_it() {
        let (fast, said) = learnt(14.0);
        // 350 px/s and half as much in reserve; its velocity is not known to less than 10 px/s from places of 0.3 px.
        assert!((525.0..560.0).contains(&fast) && said == 1, "{fast}");
        assert_eq!(learnt(2.0), (160.0, 0));
    }

    #[test]
    fn one_fast_target_before_many_slow_ones_raises_it_too() {
        // One in 141 of the steps is the fast one's.
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let mut place = || Vector2::new(640.0 * rng.random::<f64>(), 400.0 * rng.random::<f64>());
        let slow: Vec<Vector2<f64>> = (0..140).map(|_| place()).collect();
        let scans: Vec<Scan> = (0..60u64)
            .map(|k| {
                let mut all: Vec<_> = slow.iter().map(|p| p + Vector2::new(1.5 * k as f64, 0.0)).collect();
                all.push(Vector2::new(40.0 + 8.0 * k as f64, 37.0));
                let all = all.into_iter().map(|at| Detection::at(at, Matrix2::identity() * 0.01)).collect();
                Scan::at(FrameIndex(k), Timestamp::from_secs_f64(0.04 * k as f64)).with_detections(all)
            })
            .collect();
        let (mut config, mut reasons) = (Config::default(), Vec::new());
        config.tracker.max_speed_px_per_s = 60.0;
        learn(&Evidence::of_scans(&scans, 740.0 * 420.0), LengthUnit::Pixel, &mut config, &mut reasons);
        let fast = config.tracker.max_speed_px_per_s;
        assert!((290.0..=310.0).contains(&fast), "200 px/s and half as much in reserve: {fast}");
    }
}
