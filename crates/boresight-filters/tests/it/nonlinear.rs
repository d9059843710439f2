//! Radar measurements, smoothers, adaptive noise and tracks in clutter: what the wrappers must achieve, on seeded runs.

use boresight_filters::consistency::{Consistency, Verdict, normalized_error2};
use boresight_filters::converted::{Polar, converted};
use boresight_filters::ekf::correct_extended;
use boresight_filters::model::{ConstantVelocity, Model, Scaled};
use boresight_filters::sensor::{Bearing, RangeAzimuth};
use boresight_filters::smooth::{Filtered, FixedLag, rts, rts_square_root};
use boresight_filters::{Adaptive, AdaptiveConfig, Gaussian, GaussianFilter, Kf, Measurement, Memory, Start, Ukf};
use nalgebra::{Matrix1, Matrix2, Matrix4, Vector1, Vector2, Vector4};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

type Cv = ConstantVelocity<f64>;

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    rng.sample(StandardNormal)
}

#[test]
fn converted_measurements_are_unbiased_and_honest_where_plain_conversion_is_not() {
    let (range, azimuth, sr, sa) = (1000.0, 0.6_f64, 3.0, 0.15);
    let truth = Vector2::new(azimuth.cos(), azimuth.sin()) * range;
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let n = 40_000;
    let (mut mean, mut plain, mut nees) = (Vector2::zeros(), Vector2::zeros(), 0.0);
    for _ in 0..n {
        let p = Polar {
            range: range + sr * normal(&mut rng),
            azimuth_rad: azimuth + sa * normal(&mut rng),
            range_std: sr,
            azimuth_std_rad: sa,
        };
        let m = converted(&p, &Vector2::zeros()).unwrap();
        let e = m.position - truth;
        mean += e / f64::from(n);
        plain += (Vector2::new(p.azimuth_rad.cos(), p.azimuth_rad.sin()) * p.range - truth) / f64::from(n);
        nees += normalized_error2(&e, &m.cov).unwrap() / f64::from(n);
    }
    // The error of the mean is about 150/sqrt(40 000) = 0.75 across; the plain bias is r σ²/2 = 11 along.
    assert!(mean.norm() < 3.0, "converted bias {mean}");
    assert!(plain.norm() > 9.0, "plain bias {plain}");
    assert!((nees / 2.0 - 1.0).abs() < 0.1, "NEES/2 {}", nees / 2.0);
}

#[test]
fn radar_tracks_are_consistent_by_extended_and_unscented_updates() {
    let model = Cv::continuous(0.05).unwrap();
    let radar = RangeAzimuth { origin: Vector2::new(-50.0, 10.0), position_at: [0, 2] };
    let r = Matrix2::from_diagonal(&Vector2::new(0.5_f64.powi(2), 0.004_f64.powi(2)));
    let start_cov = Matrix4::from_diagonal(&Vector4::new(1.0, 0.25, 1.0, 0.25));
    let mut rng = ChaCha8Rng::seed_from_u64(77);
    let (mut ekf_nees, mut ukf_nees) = (Consistency::new(4), Consistency::new(4));
    for _ in 0..150 {
        let mut truth = Vector4::new(60.0, 1.0, 80.0, -1.0);
        let guess = truth + start_cov.map(f64::sqrt) * Vector4::from_fn(|_, _| normal(&mut rng));
        let belief = Gaussian { mean: guess, cov: start_cov };
        let mut ekf = Kf::<Cv, 4>::start(model, belief).unwrap();
        let mut ukf = Ukf::<Cv, 4>::start(model, belief).unwrap();
        let l = model.process_noise(1.0).cholesky().unwrap().l();
        for _ in 0..15 {
            truth = model.moved(1.0, &truth) + l * Vector4::from_fn(|_, _| normal(&mut rng));
            let d = Vector2::new(truth[0], truth[2]) - radar.origin;
            let z = Vector2::new(d.norm() + 0.5 * normal(&mut rng), d[1].atan2(d[0]) + 0.004 * normal(&mut rng));
            ekf.predict(1.0).unwrap();
            correct_extended(&mut ekf, &radar, &z, &r, 2).unwrap();
            ukf.predict(1.0).unwrap();
            ukf.correct_by(&radar, &z, &r).unwrap();
        }
        ekf_nees.add(normalized_error2(&(truth - ekf.belief().mean), &ekf.belief().cov).unwrap());
        ukf_nees.add(normalized_error2(&(truth - ukf.belief().mean), &ukf.belief().cov).unwrap());
    }
    assert_eq!(ekf_nees.is_consistent(0.99).unwrap(), Verdict::Consistent, "EKF {}", ekf_nees.mean());
    assert_eq!(ukf_nees.is_consistent(0.99).unwrap(), Verdict::Consistent, "UKF {}", ukf_nees.mean());
}

#[test]
fn two_bearings_find_a_target() {
    let model = Cv::continuous(0.01).unwrap();
    let first = Measurement::isotropic(8.0, 12.0, 3.0);
    let mut f = Kf::<Cv, 4>::from_point(model, &first, 0.5).unwrap();
    let target = Vector2::new(10.0, 10.0);
    for k in 0..20 {
        let origin = if k % 2 == 0 { Vector2::new(0.0, 0.0) } else { Vector2::new(20.0, 0.0) };
        let d: Vector2<f64> = target - origin;
        f.predict(0.1).unwrap();
        let sensor = Bearing { origin, position_at: [0, 2] };
        let z = Vector1::new(d[1].atan2(d[0]));
        correct_extended(&mut f, &sensor, &z, &Matrix1::new(1e-4), 3).unwrap();
    }
    assert!((f.predicted().mean - target).norm() < 0.05, "{}", f.predicted().mean);
}

/// A filtered run and the truth of each scan.
fn run(model: &Cv, seed: u64) -> (Vec<Filtered<4>>, Vec<Vector4<f64>>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut truth = Vector4::new(0.0, 1.0, 0.0, 2.0);
    let first = Measurement::isotropic(normal(&mut rng), normal(&mut rng), 1.0);
    let mut f = Kf::<Cv, 4>::from_point(*model, &first, 3.0).unwrap();
    let (mut scans, mut truths) = (vec![Filtered { dt_s: 0.0, belief: f.belief() }], vec![truth]);
    for k in 0..60 {
        let dt = if k % 3 == 0 { 0.2 } else { 0.5 };
        let l = model.process_noise(dt).cholesky().unwrap().l();
        truth = model.moved(dt, &truth) + l * Vector4::from_fn(|_, _| normal(&mut rng));
        f.predict(dt).unwrap();
        f.correct(&Measurement::isotropic(truth[0] + normal(&mut rng), truth[2] + normal(&mut rng), 1.0)).unwrap();
        scans.push(Filtered { dt_s: dt, belief: f.belief() });
        truths.push(truth);
    }
    (scans, truths)
}

#[test]
fn smoothers_agree_with_each_other_and_halve_the_error() {
    let model = Cv::continuous(0.3).unwrap();
    let (mut filtered2, mut smoothed2) = (0.0, 0.0);
    let mut nees = Consistency::new(4);
    for seed in 0..40 {
        let (scans, truth) = run(&model, seed);
        let (mut a, mut b) = (scans.clone(), scans.clone());
        rts(&model, &mut a).unwrap();
        rts_square_root(&model, &mut b).unwrap();
        for (x, y) in a.iter().zip(&b) {
            assert!((x.belief.mean - y.belief.mean).norm() < 1e-9 && (x.belief.cov - y.belief.cov).norm() < 1e-9);
        }
        assert_eq!(a.last(), scans.last(), "the newest scan has nothing to gain");
        for k in 5..55 {
            filtered2 += (scans[k].belief.mean - truth[k]).norm_squared();
            smoothed2 += (a[k].belief.mean - truth[k]).norm_squared();
            assert!(a[k].belief.cov.trace() <= scans[k].belief.cov.trace());
        }
        nees.add(normalized_error2(&(truth[30] - a[30].belief.mean), &a[30].belief.cov).unwrap());
    }
    assert!(smoothed2 < 0.6 * filtered2, "{smoothed2} of {filtered2}");
    assert_eq!(nees.is_consistent(0.99).unwrap(), Verdict::Consistent, "{}", nees.mean());
}

#[test]
fn the_fixed_lag_smoother_is_the_full_one_that_stops_at_the_newest_scan() {
    let model = Cv::continuous(0.3).unwrap();
    let (scans, _) = run(&model, 3);
    let mut lag = FixedLag::<4, 6>::default();
    for (k, s) in scans.iter().enumerate() {
        let got = lag.push(&model, &s.belief, s.dt_s).unwrap();
        if k < 5 {
            assert!(got.is_none());
            continue;
        }
        let mut part = scans[..=k].to_vec();
        rts(&model, &mut part).unwrap();
        let want = part[k - 5].belief;
        assert!((got.unwrap().mean - want.mean).norm() < 1e-12, "scan {k}");
    }
}

#[test]
fn adaptive_noise_finds_the_true_variances_and_scale() {
    let true_model = Cv::continuous(2.0).unwrap();
    let told = Scaled::new(Cv::continuous(0.2).unwrap());
    for windowed in [false, true] {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let memory = if windowed { Memory::Windowed } else { Memory::Recursive(400.0) };
        let first = Measurement::isotropic(0.0, 0.0, 1.0);
        // R alone, told four times too large; the process noise is told right.
        let right = Scaled::new(true_model);
        let config = AdaptiveConfig::measurement_noise(memory);
        let mut learns_r =
            Adaptive::<_, 400>::new(Kf::<_, 4>::from_point(right, &first, 2.0).unwrap(), config).unwrap();
        let config = AdaptiveConfig::process_noise(memory);
        let mut learns_q = Adaptive::<_, 400>::new(Kf::<_, 4>::from_point(told, &first, 2.0).unwrap(), config).unwrap();
        let mut truth = Vector4::new(0.0, 1.0, 0.0, 2.0);
        let l = true_model.process_noise(0.5).cholesky().unwrap().l();
        let mut ln_scale = 0.0;
        for k in 0..3000 {
            truth = true_model.moved(0.5, &truth) + l * Vector4::from_fn(|_, _| normal(&mut rng));
            let (x, y) = (truth[0] + 0.5 * normal(&mut rng), truth[2] + 0.5 * normal(&mut rng));
            learns_r.predict(0.5).unwrap();
            learns_r.correct(&Measurement::isotropic(x, y, 1.0)).unwrap();
            learns_q.predict(0.5).unwrap();
            learns_q.correct(&Measurement::isotropic(x, y, 0.5)).unwrap();
            if k >= 1000 {
                ln_scale += learns_q.learner().noise_scale().ln() / 2000.0;
            }
        }
        let r = learns_r.learner().measurement_noise().unwrap();
        assert!((0.12..0.5).contains(&r[(0, 0)]) && (0.12..0.5).contains(&r[(1, 1)]), "R {r}, truth 0.25");
        let scale = ln_scale.exp();
        assert!((5.0..20.0).contains(&scale), "scale {scale}, truth 10");
    }
}
