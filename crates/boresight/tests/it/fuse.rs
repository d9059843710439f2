//! Fusion of two sensors: never worse than the better one, consistent without known correlation, registration recovered.

use boresight::fuse::covariance_intersection;
use boresight::fuse::fuse_independent;
use boresight::fuse::{FuseConfig, RegistrationConfig, Rule, Timeline, fuse_tables};
use boresight::sim::Purpose;
use boresight::sim::Seed;
use boresight::{TrackId, TrackStatus};
use boresight_filters::model::ConstantVelocity;
use boresight_filters::{Gaussian, GaussianFilter, Kf, Measurement, Start};
use nalgebra::{Matrix2, Matrix4, Rotation2, Vector2, Vector4};
use rand_distr::{Distribution, StandardNormal};
use std::slice::from_ref;

/// A turning, accelerating path: a registration can tell its time from its place.
fn truth(t: f64) -> Vector4<f64> {
    let (a, b) = (0.11 * t, 0.07 * t);
    Vector4::new(100.0 + 40.0 * a.sin(), 4.4 * a.cos(), 80.0 + 30.0 * b.cos(), -2.1 * b.sin())
}

/// Tracks the truth seen at times `t` with noise, by a Kalman filter; positions and clock as this sensor gives them.
fn sensed(
    id: u64,
    seed: Seed,
    times: impl Iterator<Item = f64>,
    noise: f64,
    see: impl Fn(f64) -> Vector2<f64>,
    clock: f64,
) -> Timeline {
    let mut rng = seed.stream(Purpose::Radar, id);
    let cov = Matrix2::identity() * noise * noise;
    let mut filter: Option<(f64, Kf<ConstantVelocity, 4>)> = None;
    let mut points = Vec::new();
    for t in times {
        let z: [f64; 2] = std::array::from_fn(|_| StandardNormal.sample(&mut rng));
        let position = see(t) + noise * Vector2::from(z);
        let (last, mut f) = filter.take().unwrap_or_else(|| {
            let start = Gaussian {
                mean: Vector4::new(position.x, 0.0, position.y, 0.0),
                cov: Matrix4::from_diagonal(&Vector4::new(1.0, 25.0, 1.0, 25.0)),
            };
            (t, Kf::start(ConstantVelocity::continuous(0.5).unwrap(), start).unwrap())
        });
        f.predict(t - last).unwrap();
        f.correct(&Measurement { position, cov }).unwrap();
        points.push((t + clock, f.belief()));
        filter = Some((t, f));
    }
    Timeline { id: TrackId(id), points, size: [9.0, 9.0] }
}

fn place(t: f64) -> Vector2<f64> {
    let s = truth(t);
    Vector2::new(s[0], s[2])
}

/// Root mean square position error over the scans.
fn rmse(points: impl Iterator<Item = (f64, Vector4<f64>)>) -> f64 {
    let (mut sum, mut n) = (0.0, 0.0);
    for (t, x) in points {
        let d = x - truth(t);
        sum += d[0] * d[0] + d[2] * d[2];
        n += 1.0;
    }
    (sum / n).sqrt()
}

#[test]
fn fusing_two_unbiased_independent_sensors_is_never_worse_than_the_better_one_on_average() {
    let (mut a, mut b, mut independent, mut intersection) = (0.0, 0.0, 0.0, 0.0);
    for run in 0..200 {
        let seed = Seed::new(4).of_run(run);
        let times = || (0..50).map(f64::from);
        let (x, y) = (sensed(1, seed, times(), 1.5, place, 0.0), sensed(2, seed, times(), 1.0, place, 0.0));
        let error = |t: &Timeline| rmse(t.points.iter().map(|p| (p.0, p.1.mean)));
        a += error(&x);
        b += error(&y);
        for (rule, sum) in [(Rule::Independent, &mut independent), (Rule::CovarianceIntersection, &mut intersection)] {
            let f = fuse_tables(from_ref(&x), from_ref(&y), &FuseConfig { rule, ..FuseConfig::default() }).unwrap();
            assert_eq!(f.pairs, [(TrackId(1), TrackId(2))]);
            *sum += rmse(f.frames.iter().map(|(t, s)| (*t, s[0].kinematics.mean)));
        }
    }
    assert!(independent < 0.95 * a.min(b), "independent {independent}, sensors {a} {b}");
    assert!(intersection <= 1.02 * a.min(b), "intersection {intersection}, sensors {a} {b}");
}

#[test]
fn intersection_stays_consistent_under_unknown_correlation_where_naive_fusion_does_not() {
    // Two estimates that share 80 % of their error: mean normalised squared error against its expectation of 4.
    let mut rng = Seed::new(8).stream(Purpose::Scenario, 0);
    let (mut naive, mut ci, n) = (0.0, 0.0, 2000);
    for _ in 0..n {
        let mut draw = || Vector4::<f64>::from_fn(|_, _| StandardNormal.sample(&mut rng));
        let (common, own_a, own_b) = (draw() * 0.8f64.sqrt(), draw() * 0.2f64.sqrt(), draw() * 0.2f64.sqrt());
        let p = Matrix4::identity();
        let (a, b) = (Gaussian { mean: common + own_a, cov: p }, Gaussian { mean: common + own_b, cov: p });
        let nees = |g: &Gaussian<4>| g.mean.dot(&(g.cov.try_inverse().unwrap() * g.mean)) / f64::from(n);
        naive += nees(&fuse_independent(&a, &b).unwrap());
        ci += nees(&covariance_intersection(&a, &b).unwrap().belief);
    }
    // χ² with 4 n degrees of freedom: 4 ± 0.13 at 99.9 %... the naive form expects 2 x 0.9 x 4 = 7.2, intersection at most 4.
    assert!(naive > 6.5, "naive {naive}");
    assert!((2.5..=4.2).contains(&ci), "intersection {ci}");
}

#[test]
fn registration_finds_offset_rotation_and_time_and_fusion_then_agrees() {
    let seed = Seed::new(2);
    let (offset, turn, lead) = (Vector2::new(3.0, -2.0), 0.02, 0.35);
    // What sensor b sees: turned and moved away from a's frame, its clock ahead.
    let away = |t: f64| Rotation2::new(-turn) * (place(t) - offset);
    let a = [sensed(1, seed, (0..120).map(|k| 0.5 * f64::from(k)), 0.2, place, 0.0)];
    let b = [sensed(7, seed, (0..170).map(|k| 0.1 + 0.35 * f64::from(k)), 0.2, away, lead)];
    let all = RegistrationConfig { offset: true, rotation: true, time: true, pivot_px: None };
    let f = fuse_tables(&a, &b, &FuseConfig { registration: Some(all), ..FuseConfig::default() }).unwrap();
    let r = f.registration;
    assert!((r.rotation_rad - turn).abs() < 0.004, "{r:?}");
    assert!((r.time_s - lead).abs() < 0.06, "{r:?}");
    let centre = Vector2::from(r.centre_px);
    let moved = Rotation2::new(r.rotation_rad) * (away(20.0) - centre) + centre + Vector2::from(r.offset_px);
    assert!((moved - place(20.0)).norm() < 0.25, "{moved} {}", place(20.0));
    assert!(r.mean_d2[1] < 0.1 * r.mean_d2[0], "{r:?}");
    assert!(f.warnings.is_empty(), "{:?}", f.warnings);
    // Without registration the bias is seen and said.
    let blind = fuse_tables(&a, &b, &FuseConfig { gate: 1e6, ..FuseConfig::default() }).unwrap();
    assert!(blind.warnings.iter().any(|w| w.contains("disagree")), "{:?}", blind.warnings);
}

#[test]
fn one_straight_path_cannot_tell_time_from_offset_and_is_refused() {
    let straight = |clock: f64, id| Timeline {
        id: TrackId(id),
        points: (0..40)
            .map(|k| {
                (
                    f64::from(k) + clock,
                    Gaussian { mean: Vector4::new(f64::from(k), 1.0, 0.0, 0.0), cov: Matrix4::identity() },
                )
            })
            .collect(),
        size: [1.0; 2],
    };
    let all = RegistrationConfig { offset: true, rotation: false, time: true, pivot_px: None };
    let config = FuseConfig { registration: Some(all), ..FuseConfig::default() };
    let e = fuse_tables(&[straight(0.0, 1)], &[straight(0.5, 2)], &config).unwrap_err().to_string();
    assert!(e.contains("cannot tell") && e.contains("hint"), "{e}");
}

#[test]
fn loss_of_a_sensor_is_bridged_by_the_other_and_by_coasting() {
    // The papers' losses: imaging in scans 15-25, radar in 30-45; and both in 47, 48.
    let times = |blind: fn(u32) -> bool| (1..=50).filter(move |k| !blind(*k)).map(f64::from);
    let imaging = sensed(1, Seed::new(1), times(|k| (15..=25).contains(&k) || (47..=48).contains(&k)), 0.5, place, 0.0);
    let radar = sensed(1, Seed::new(2), times(|k| (30..=45).contains(&k) || (47..=48).contains(&k)), 0.5, place, 0.0);
    let f = fuse_tables(&[imaging], &[radar], &FuseConfig { max_gap_s: 20.0, ..FuseConfig::default() }).unwrap();
    assert_eq!(f.frames.len(), 48);
    assert!(f.frames.iter().all(|(_, s)| s.len() == 1 && s[0].status == TrackStatus::Confirmed));
    assert!(rmse(f.frames.iter().map(|(t, s)| (*t, s[0].kinematics.mean))) < 1.0);
}

#[test]
fn tracks_of_different_targets_are_paired_by_the_least_total_distance() {
    let at = |id: u64, x: f64| Timeline {
        id: TrackId(id),
        points: (0..10)
            .map(|k| (f64::from(k), Gaussian { mean: Vector4::new(x, 0.0, 0.0, 0.0), cov: Matrix4::identity() }))
            .collect(),
        size: [1.0; 2],
    };
    let f = fuse_tables(
        &[at(1, 0.0), at(2, 3.0), at(3, 90.0)],
        &[at(5, 2.0), at(6, -0.5), at(8, 50.0)],
        &FuseConfig::default(),
    )
    .unwrap();
    assert_eq!(f.pairs, [(TrackId(1), TrackId(6)), (TrackId(2), TrackId(5))]);
    let ids: Vec<u64> = f.frames[9].1.iter().map(|t| t.id.0).collect();
    assert_eq!(ids, [1, 2, 3, 6], "b's lone track gets a number of its own");
}
