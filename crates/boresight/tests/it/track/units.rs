//! A tracker must not know what a pixel or a second is: in other units, and elsewhere, it does the same.

use super::associators;
use boresight::track::{
    ConfirmationConfig, ExistenceConfig, InitiationConfig, MergedMeasurementsConfig, MhtConfig, OnePointConfig,
    SprtConfig, TrackerConfig, build,
};
use boresight::{FrameIndex, Scan, Timestamp, TrackStatus};
use nalgebra::{Matrix2, Vector2};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Units of length and time, and where the origin lies (in the units of length).
#[derive(Clone, Copy, Debug)]
struct Units {
    length: f64,
    time: f64,
    origin: f64,
}

/// Two targets that meet, missed now and then, among four false detections a scan; all noise correlated between the axes.
fn scans(u: Units) -> Vec<Scan> {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let cov = Matrix2::new(0.25, 0.1, 0.1, 0.3) * (u.length * u.length);
    let one = |k: u64| {
        let t = k as f64;
        let mut noise = || Vector2::from_fn(|_, _| 1.7 * rng.random::<f64>() - 0.85);
        let targets = [Vector2::new(20.0 + 3.0 * t, 30.0 + t), Vector2::new(80.0 - 3.0 * t, 34.0 + t)];
        let mut places: Vec<Vector2<f64>> = targets.iter().map(|p| p + noise()).collect();
        if k % 7 == 3 {
            places.remove((k % 2) as usize);
        }
        places.extend((0..4).map(|_| Vector2::from_fn(|_, _| 100.0 * rng.random::<f64>())));
        let detection = |p: &Vector2<f64>| {
            let at = (p + Vector2::repeat(u.origin)) * u.length;
            let mut d = super::detection(at.x, at.y);
            d.cov = cov;
            d
        };
        Scan::at(FrameIndex(k), Timestamp::from_secs_f64(t * u.time))
            .with_detections(places.iter().map(detection).collect())
    };
    (0..30).map(one).collect()
}

fn configs(u: Units) -> Vec<TrackerConfig> {
    let (speed, new_target_density_per_px2) = (u.length / u.time, 1e-4 / (u.length * u.length));
    let base = TrackerConfig {
        acceleration_std_px_per_s2: Some(0.1 * speed / u.time),
        extra_noise_px: 0.1 * u.length,
        max_speed_px_per_s: 8.0 * speed,
        clutter_density_per_px2: 4e-4 / (u.length * u.length),
        coast_s: 0.0,
        duplicate_s: 4.5 * u.time,
        merged_measurements: MergedMeasurementsConfig::off(),
        ..TrackerConfig::default()
    };
    let rules = [
        ConfirmationConfig::default(),
        ConfirmationConfig::Sprt(SprtConfig { new_target_density_per_px2, ..SprtConfig::default() }),
        ConfirmationConfig::Existence(ExistenceConfig {
            new_target_density_per_px2,
            mean_target_lifetime_s: 100.0 * u.time,
            ..ExistenceConfig::default()
        }),
    ];
    let initiations = [
        InitiationConfig::default(),
        InitiationConfig::OnePoint(OnePointConfig { velocity_std_px_per_s: 3.0 * speed }),
    ];
    let mut out = Vec::new();
    for rule in &rules {
        for initiation in &initiations {
            let with = TrackerConfig { confirmation: rule.clone(), initiation: initiation.clone(), ..base.clone() };
            out.extend(associators().into_iter().map(|associator| TrackerConfig { associator, ..with.clone() }));
            out.push(TrackerConfig {
                mht: Some(MhtConfig { new_target_density_per_px2, ..MhtConfig::default() }),
                ..with
            });
        }
    }
    out
}

/// Number, status and detection of each track in each scan, with its place in units of length.
fn run(config: &TrackerConfig, u: Units) -> Vec<(u64, TrackStatus, Option<u32>, [f64; 2])> {
    let mut tracker = build(config).unwrap();
    let mut out = Vec::new();
    for scan in scans(u) {
        out.extend(tracker.step(&scan).unwrap().iter().map(|s| {
            let place = [s.kinematics.mean[0], s.kinematics.mean[2]].map(|v| v / u.length - u.origin);
            (s.id.0, s.status, s.detection, place)
        }));
    }
    out
}

#[test]
fn other_units_of_length_and_time_and_another_origin_change_nothing() {
    let plain = Units { length: 1.0, time: 1.0, origin: 0.0 };
    // Powers of two: lengths stay exact. Times do not: 1/1024 s is no whole number of nanoseconds.
    let others = [
        Units { length: 1048576.0, ..plain },
        Units { length: 1.0 / 1048576.0, ..plain },
        Units { time: 1024.0, ..plain },
        Units { time: 1.0 / 1024.0, ..plain },
        Units { origin: 4096.0, ..plain },
    ];
    let wanted: Vec<_> = configs(plain).iter().map(|c| run(c, plain)).collect();
    for u in others {
        for (want, config) in wanted.iter().zip(configs(u)) {
            let got = run(&config, u);
            assert_eq!(want.len(), got.len(), "{u:?}: {config:?}");
            for (a, b) in want.iter().zip(&got) {
                // The rounding of a time stamp to 1 ns is a millionth of the shortest interval.
                let near = (0..2).all(|i| (a.3[i] - b.3[i]).abs() < 1e-4);
                assert!((a.0, a.1, a.2) == (b.0, b.1, b.2) && near, "{u:?}: {config:?}\n{a:?}\n{b:?}");
            }
        }
    }
    assert!(wanted.iter().all(|w| w.iter().filter(|s| s.1 == TrackStatus::Confirmed).count() > 30));
}
