//! Sums of simulated frames: below the noise, with gaps, crossing, still.

use super::*;
use crate::Image;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Standard normal numbers.
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let u: f64 = 1.0 - rng.random::<f64>();
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * rng.random::<f64>()).cos()
}

/// A spot: place at time 0, px; velocity, px/s; peak, counts.
type Spot = ([f64; 2], [f64; 2], f64);

/// A frame of noise of deviation `noise` about 1000, with spots of σ = 1.3 px.
fn frame(size: (usize, usize), noise: f64, time_s: f64, spots: &[Spot], rng: &mut ChaCha8Rng) -> Image<u16> {
    let pixels = (0..size.0 * size.1).map(|i| {
        let (x, y) = ((i % size.0) as f64, (i / size.0) as f64);
        let sum: f64 = spots
            .iter()
            .map(|(p, v, peak)| {
                let (dx, dy) = (x - p[0] - v[0] * time_s, y - p[1] - v[1] * time_s);
                peak * (-(dx * dx + dy * dy) / (2.0 * 1.3 * 1.3)).exp()
            })
            .sum();
        (1000.0 + sum + noise * normal(rng)).round() as u16
    });
    Image::from_vec(size.0, size.1, pixels.collect()).unwrap()
}

/// Detections of each report, with its time.
fn run(
    config: &IntegrateConfig,
    times_s: &[f64],
    size: (usize, usize),
    spots: &[Spot],
    seed: u64,
) -> Vec<(f64, Vec<Detection>)> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut detector = IntegrateDetector::new(config);
    let mut reports = Vec::new();
    let mut before = times_s[0];
    for &t in times_s {
        let image = frame(size, 20.0, t, spots, &mut rng);
        let mut out = Vec::new();
        let typed = TypedFrame { raw: &image, image: &image, colours: None, dt_s: t - before };
        detector.find(&typed, &DetectorConfig::default(), &mut out).unwrap();
        before = t;
        if TargetFinder::<u16>::is_blind(&detector) {
            assert!(out.is_empty());
        } else {
            reports.push((t, out));
        }
    }
    reports
}

fn even(n: usize) -> Vec<f64> {
    (0..n).map(|k| 0.04 * k as f64).collect()
}

/// Whether a detection lies at a spot, within 3 px.
fn at(d: &Detection, spot: &Spot, t: f64) -> bool {
    let (p, v, _) = spot;
    (d.position - Vector2::new(p[0] + v[0] * t, p[1] + v[1] * t)).norm() < 3.0
}

#[test]
fn a_target_below_the_noise_of_every_frame_is_found_with_its_velocity() {
    let config =
        IntegrateConfig { false_alarms_per_frame: 1e-4, frames: 32, max_speed_px_per_s: 30.0, ..Default::default() };
    // Peak / noise 0.9: 2.1 in a filtered frame, 11.7 over 32.
    let spot = ([20.0, 70.0], [17.0, -9.0], 18.0);
    let reports = run(&config, &even(112), (120, 90), &[spot], 1);
    assert_eq!(reports.len(), 6, "one every 16 frames from the 32nd on");
    for (t, detections) in &reports {
        assert_eq!(detections.len(), 1, "{t}: {detections:?}");
        let d = &detections[0];
        let v = d.velocity.unwrap();
        assert!(at(d, &spot, *t), "{t}: {d:?}");
        assert!((v.mean - Vector2::new(17.0, -9.0)).norm() < 5.0 * v.cov[(0, 0)].sqrt(), "{v:?}");
        assert!((d.peak - 18.0).abs() < 8.0 && d.score >= 4.0, "{d:?}");
    }
}

#[test]
fn missing_frames_and_uneven_times_change_nothing_but_the_times() {
    let config =
        IntegrateConfig { false_alarms_per_frame: 1e-4, frames: 32, max_speed_px_per_s: 30.0, ..Default::default() };
    let spot = ([20.0, 70.0], [14.0, -7.0], 18.0);
    // Every seventh frame is missing, the others jitter.
    let times: Vec<f64> =
        (0..130).filter(|k| k % 7 != 3).map(|k| 0.04 * f64::from(k) + 0.008 * f64::from(k * k % 5)).collect();
    let reports = run(&config, &times, (120, 90), &[spot], 2);
    assert!(reports.len() >= 5);
    for (t, detections) in &reports {
        assert!(detections.len() == 1 && at(&detections[0], &spot, *t), "{t}: {detections:?}");
    }
}

#[test]
fn two_targets_that_cross_and_a_dark_one_are_each_found() {
    let config = IntegrateConfig {
        frames: 32,
        max_speed_px_per_s: 30.0,
        polarity: crate::vision::polarity::Polarity::Both,
        ..Default::default()
    };
    let spots =
        [([20.0, 30.0], [15.0, 8.0], 22.0), ([20.0, 62.0], [15.0, -8.0], 22.0), ([100.0, 20.0], [-12.0, 10.0], -22.0)];
    for (t, detections) in run(&config, &even(112), (120, 90), &spots, 3) {
        // Where the paths of the first two meet they are one spot of twice the height.
        let apart = ((20.0 + 15.0 * t) - (20.0 + 15.0 * t), (30.0 + 8.0 * t) - (62.0 - 8.0 * t));
        let least = if f64::hypot(apart.0, apart.1) > 2.0 { 3 } else { 2 };
        assert!(detections.len() >= least, "{t}: {detections:?}");
        assert!(detections.iter().all(|d| spots.iter().any(|s| at(d, s, t))), "{t}: {detections:?}");
        assert!(detections.iter().any(|d| at(d, &spots[2], t) && d.peak < 0.0), "{t}: {detections:?}");
    }
}

#[test]
fn a_still_scene_and_a_gap_give_nothing() {
    let config = IntegrateConfig { false_alarms_per_frame: 1e-3, ..Default::default() };
    let still = [([30.0, 30.0], [0.0, 0.0], 400.0), ([60.0, 50.0], [0.0, 0.0], -300.0)];
    for (t, detections) in run(&config, &even(96), (96, 80), &still, 4) {
        assert!(detections.is_empty(), "{t}: {detections:?}");
    }
    let mut times = even(16);
    times.extend(even(20).iter().map(|t| t + 60.0));
    let reports = run(&config, &times, (40, 40), &[], 5);
    assert_eq!(reports.len(), 2, "the memory is filled anew after the gap");
}
