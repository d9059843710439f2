//! Tests of the adaptation: scenes of known noise, clutter and detection probability through the tracker.

use super::*;
use crate::track::{ClutterConfig, Tracking, build};
use crate::{Detection, FrameIndex};
use nalgebra::{Matrix2, Vector2};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

const RATE_HZ: f64 = 10.0;
const FIELD: [f64; 2] = [1000.0, 800.0];

fn config() -> TrackerConfig {
    TrackerConfig {
        extra_noise_px: 0.0,
        acceleration_density_px2_per_s3: 4.0,
        detection_probability: 0.9,
        redetection_probability: Some(0.9),
        clutter_density_per_px2: 2.0 / (FIELD[0] * FIELD[1]),
        clutter: ClutterConfig::Given,
        gate_probability: 0.9999,
        field_px: Some(FIELD),
        coast_s: 2.0,
        ..TrackerConfig::default()
    }
}

/// Three targets whose positions are held in the middle of the field by a weak spring, so that the noise of acceleration stays `4 px²/s³`; detections
/// deviate by `std`, state 1 px² and come with the probability `p`; `n_false` false ones a scan.
struct World {
    rng: ChaCha8Rng,
    targets: [[f64; 4]; 3],
    k: u64,
}

impl World {
    fn new(seed: u64) -> Self {
        let targets = [[250.0, 200.0, 0.0, 0.0], [700.0, 250.0, 0.0, 0.0], [500.0, 600.0, 0.0, 0.0]];
        Self { rng: ChaCha8Rng::seed_from_u64(seed), targets, k: 0 }
    }

    fn scan(&mut self, std: f64, p: f64, n_false: usize) -> Scan {
        let homes = Self::new(0).targets;
        let dt = 1.0 / RATE_HZ;
        let rng = &mut self.rng;
        let mut places = Vec::new();
        for (t, home) in self.targets.iter_mut().zip(homes) {
            for a in 0..2 {
                let dv = (4.0 * dt).sqrt() * rng.sample::<f64, _>(StandardNormal);
                t[a] += t[a + 2] * dt + 0.5 * dv * dt;
                t[a + 2] += dv - 0.01 * dt * (t[a] - home[a]) - 0.05 * dt * t[a + 2];
            }
            let error = Vector2::from_fn(|_, _| std * rng.sample::<f64, _>(StandardNormal));
            if rng.random::<f64>() < p {
                places.push(Vector2::new(t[0], t[1]) + error);
            }
        }
        let mut anywhere = || Vector2::new(FIELD[0] * rng.random::<f64>(), FIELD[1] * rng.random::<f64>());
        places.extend((0..n_false).map(|_| anywhere()));
        let d = places.iter().map(|p| Detection::at(*p, Matrix2::identity())).collect();
        let time = Timestamp::from_secs_f64(self.k as f64 * dt);
        self.k += 1;
        Scan::at(FrameIndex(self.k), time).with_detections(d)
    }
}

fn go(tracker: &mut dyn Tracking, adaptation: &mut Adaptation, scan: &Scan) -> Option<TrackerParameters> {
    let states = tracker.step(scan).unwrap();
    let next = adaptation.step(scan, states);
    if let Some(p) = &next {
        assert!(tracker.adapt(p).unwrap());
    }
    next
}

#[test]
fn noise_clutter_and_detection_probability_are_followed_and_the_nis_comes_back() {
    let (mut world, config) = (World::new(5), config());
    let (mut tracker, mut a) = (build(&config).unwrap(), Adaptation::of(&config).unwrap());
    let mut seconds = |n: u64, std: f64, p: f64, n_false: usize| {
        for _ in 0..n * RATE_HZ as u64 {
            go(&mut *tracker, &mut a, &world.scan(std, p, n_false));
        }
        (a.now, a.mean_nis().unwrap())
    };
    let (as_chosen, nis) = seconds(120, 1.0, 0.9, 2);
    // 3 targets, 60 s of weight: 1 600 innovations tell R to 3 %, NIS to 0.05, P_D to 0.01; clutter is 1 200 detections.
    assert!((as_chosen.detection_covariance_scale - 1.0).abs() < 0.15, "{as_chosen:?}");
    assert!((as_chosen.acceleration_density_px2_per_s3 / 4.0).ln().abs() < 0.5, "{as_chosen:?}");
    assert!((1.8..2.2).contains(&nis), "{nis}");
    let (worse, nis) = seconds(200, 2.0, 0.75, 6);
    assert!((worse.detection_covariance_scale / 4.0 - 1.0).abs() < 0.2, "{worse:?}");
    assert!((worse.detection_probability - 0.75).abs() < 0.05, "{worse:?}");
    let per_scan = worse.clutter_density_per_px2 * FIELD[0] * FIELD[1];
    assert!((per_scan - 6.0).abs() < 1.0, "{per_scan}");
    assert!((1.6..2.4).contains(&nis), "{nis}");
}

#[test]
fn nothing_leaves_its_bounds_whatever_comes_and_memory_is_bounded() {
    let config = config();
    let (mut tracker, mut a) = (build(&config).unwrap(), Adaptation::of(&config).unwrap());
    let mut world = World::new(6);
    for k in 0..6000 {
        // Noise that no factor explains, then none at all, then false detections only.
        let (std, p, n_false) = [(30.0, 0.5, 40), (1e-9, 1.0, 0), (1.0, 0.0, 60)][k / 2000];
        go(&mut *tracker, &mut a, &world.scan(std, p, n_false));
        let (f, now) = (&a.first, &a.now);
        let within = |v: f64, first: f64, most: f64| (first / most * 0.99..=first * most * 1.01).contains(&v);
        assert!(within(now.detection_covariance_scale, f.detection_covariance_scale, MOST_NOISE_FACTOR), "{now:?}");
        let q = |p: &TrackerParameters| p.acceleration_density_px2_per_s3;
        assert!(within(q(now), q(f), MOST_NOISE_FACTOR), "{now:?}");
        assert!(within(now.clutter_density_per_px2, f.clutter_density_per_px2, MOST_COUNT_FACTOR), "{now:?}");
        assert!((0.6..0.98).contains(&now.detection_probability), "odds of 9 within a factor of 4: {now:?}");
        let held: usize = a.tracks.values().map(|t| t.steps.len()).sum();
        assert!(held <= 2 * MOST_STEPS && a.tracks.len() <= 2 * MOST_STEPS + MOST_TRACKS, "{held}");
    }
}

#[test]
fn what_was_set_by_hand_stays() {
    let config = config();
    let (mut tracker, mut a) = (build(&config).unwrap(), Adaptation::of(&config).unwrap());
    a.freeze("tracker.extra-noise-px");
    a.freeze("tracker.detection-probability");
    let mut world = World::new(7);
    for _ in 0..1500 {
        go(&mut *tracker, &mut a, &world.scan(2.0, 0.7, 6));
    }
    assert_eq!(a.now.detection_covariance_scale, config.detection_covariance_scale);
    assert_eq!(a.now.detection_probability, config.detection_probability);
    // The errors are of twice the deviation that is held: what it does not hold of them is taken for motion.
    assert_eq!(a.factors[0], 1.0);
    let q = a.now.acceleration_density_px2_per_s3 / config.acceleration_density_px2_per_s3;
    assert!(q > 4.0, "{q}");
    assert!(a.now.clutter_density_per_px2 > 2.0 * config.clutter_density_per_px2, "the rest goes on");
}

#[test]
fn nothing_changes_before_there_is_enough() {
    let config = config();
    let (mut tracker, mut a) = (build(&config).unwrap(), Adaptation::of(&config).unwrap());
    let mut world = World::new(8);
    for _ in 0..(MEMORY_S * RATE_HZ) as usize {
        assert_eq!(go(&mut *tracker, &mut a, &world.scan(2.0, 0.9, 2)), None);
    }
    let (mut tracker, mut empty) = (build(&config).unwrap(), Adaptation::of(&config).unwrap());
    let changes = (0..200).filter_map(|k| {
        let scan = Scan::at(FrameIndex(k), Timestamp::from_secs_f64(k as f64)).with_blind(true);
        go(&mut *tracker, &mut empty, &scan)
    });
    assert_eq!(changes.count(), 0, "blind scans say nothing");
}

#[test]
fn what_the_innovations_hardly_tell_does_not_wander() {
    // 64 targets at 30 scans a second: the detections that are held are those of the last second, which hardly tell q.
    let config = TrackerConfig { acceleration_density_px2_per_s3: 0.3, ..config() };
    let (mut tracker, mut a) = (build(&config).unwrap(), Adaptation::of(&config).unwrap());
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let mut densities = vec![config.acceleration_density_px2_per_s3];
    for k in 0..2400u64 {
        let time_s = k as f64 / 30.0;
        let place = |i: u32| {
            let turn = 0.1 * time_s + f64::from(i);
            let home = Vector2::new(60.0 + 120.0 * f64::from(i % 8), 50.0 + 95.0 * f64::from(i / 8));
            let mut error = || 0.5 * rng.sample::<f64, _>(StandardNormal);
            home + Vector2::new(30.0 * turn.cos() + error(), 30.0 * turn.sin() + error())
        };
        let places: Vec<_> = (0..64).map(place).collect();
        let detections = places.iter().map(|p| Detection::at(*p, 0.25 * Matrix2::identity())).collect();
        let scan = Scan::at(FrameIndex(k), Timestamp::from_secs_f64(time_s)).with_detections(detections);
        let next = go(&mut *tracker, &mut a, &scan);
        densities.extend(next.map(|p| p.acceleration_density_px2_per_s3));
    }
    assert!(densities.len() > 3, "{densities:?}");
    let most = densities.windows(2).map(|w| (w[1] / w[0]).ln().abs()).fold(0.0, f64::max);
    assert!(most < 2f64.ln(), "a factor of two from one update to the next: {densities:?}");
}

#[test]
fn a_key_is_known_by_its_whole_name() {
    let config = config();
    let frozen_by = |key: &str| {
        let mut a = Adaptation::of(&config).unwrap();
        a.freeze(key);
        a.frozen
    };
    for (key, _) in TrackerParameters::of(&config).values() {
        assert_ne!(frozen_by(&format!("tracker.{key}")), Frozen::default(), "{key}");
    }
    for other in
        ["tracker.confirmation.existence.detection-probability", "detector.extra-noise-px", "tracker.coast-s", ""]
    {
        assert_eq!(frozen_by(other), Frozen::default(), "{other}");
    }
    let all = Frozen { measurement: true, motion: true, detection: true, clutter: true };
    assert_eq!(frozen_by("tracker"), all);
}

#[test]
fn of_velocities_that_are_forgotten_noise_and_motion_stay_and_the_counts_are_followed() {
    let model = ModelConfig::OrnsteinUhlenbeck(crate::track::OrnsteinUhlenbeckConfig {
        speed_std_px_per_s: 6.0,
        memory_s: 0.5,
    });
    let config = TrackerConfig { filter: crate::track::FilterConfig { model, ..Default::default() }, ..config() };
    let (mut world, mut tracker) = (World::new(4), build(&config).unwrap());
    let mut adaptation = Adaptation::of(&config).unwrap();
    let mut last = TrackerParameters::of(&config);
    for _ in 0..1000 {
        // Three times the deviation stated, and more false detections than assumed.
        let scan = world.scan(3.0, 0.9, 6);
        let states = tracker.step(&scan).unwrap();
        last = adaptation.step(&scan, states).unwrap_or(last);
    }
    let first = TrackerParameters::of(&config);
    assert!(last.clutter_density_per_px2 > 1.5 * first.clutter_density_per_px2, "{last:?}");
    let kept = TrackerParameters {
        detection_probability: first.detection_probability,
        redetection_probability: first.redetection_probability,
        clutter_density_per_px2: first.clutter_density_per_px2,
        ..last
    };
    assert_eq!(kept, first);
}
