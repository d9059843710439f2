//! What every form must do: the identity at dt 0, no change without measurements, agreement with Joseph, definiteness
//! over a million steps, refusal of NaN, honest covariances.

use crate::forms::{ACCELERATION_STD, all_forms, exact_forms, forms};
use boresight_filters::consistency::{Consistency, Verdict, normalized_error2};
use boresight_filters::{Filter, FilterError, Gaussian, Measurement, Weighted};
use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

fn belief() -> Gaussian<4> {
    let mut cov = Matrix4::from_diagonal(&Vector4::new(0.5, 0.3, 0.6, 0.2));
    (cov[(0, 1)], cov[(1, 0)], cov[(2, 3)], cov[(3, 2)]) = (0.1, 0.1, -0.1, -0.1);
    Gaussian { mean: Vector4::new(10.0, 1.0, 20.0, -2.0), cov }
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    rng.sample(StandardNormal)
}

fn sure(x: f64, y: f64, cov: Matrix2<f64>) -> Weighted {
    Weighted { measurement: Measurement { position: Vector2::new(x, y), cov }, weight: 1.0 }
}

/// Two filters show the same face: bit by bit, NaN never.
fn face(f: &dyn Filter) -> (Gaussian<2>, Gaussian<4>) {
    (f.predicted(), f.kinematics())
}

#[test]
fn a_step_of_no_time_is_the_identity_for_every_form() {
    for (name, mut f) in all_forms(&belief()) {
        let before = face(f.as_ref());
        f.predict(0.0).unwrap();
        assert_eq!(before, face(f.as_ref()), "{name}");
    }
}

#[test]
fn a_missed_scan_leaves_every_form_unchanged() {
    for (name, mut f) in all_forms(&belief()) {
        f.predict(0.7).unwrap();
        let before = face(f.as_ref());
        f.update(&[]).unwrap();
        f.update(&[Weighted { weight: 0.0, ..sure(3.0, 4.0, Matrix2::identity()) }]).unwrap();
        assert_eq!(before, face(f.as_ref()), "{name}");
    }
}

#[test]
fn bad_input_is_refused_and_leaves_every_form_unchanged() {
    let one = Matrix2::identity();
    for (name, mut f) in all_forms(&belief()) {
        f.predict(0.5).unwrap();
        let before = face(f.as_ref());
        for dt in [f64::NAN, f64::INFINITY, -0.1, f64::NEG_INFINITY] {
            assert!(f.predict(dt).is_err(), "{name}: dt {dt}");
            assert_eq!(before, face(f.as_ref()), "{name}: dt {dt}");
        }
        let bad = [
            sure(f64::NAN, 1.0, one),
            sure(1.0, f64::INFINITY, one),
            sure(1.0, 1.0, one * f64::NAN),
            sure(1.0, 1.0, one * f64::INFINITY),
            sure(1.0, 1.0, -one),
            sure(1.0, 1.0, Matrix2::new(1.0, 2.0, 2.0, 1.0)),
            sure(1.0, 1.0, Matrix2::new(1.0, 0.5, -0.5, 1.0)),
            Weighted { weight: f64::NAN, ..sure(1.0, 1.0, one) },
            Weighted { weight: -0.1, ..sure(1.0, 1.0, one) },
            Weighted { weight: 1.1, ..sure(1.0, 1.0, one) },
        ];
        for h in bad {
            assert!(f.update(&[h]).is_err(), "{name}: {h:?}");
            assert!(f.update(&[Weighted { weight: 0.3, ..sure(10.0, 20.0, one) }, h]).is_err(), "{name}: {h:?}");
            assert_eq!(before, face(f.as_ref()), "{name}: {h:?}");
        }
        let many = [Weighted { weight: 0.6, ..sure(10.0, 20.0, one) }; 2];
        assert!(matches!(f.update(&many), Err(FilterError::OutOfRange(_))), "{name}: weights of 1.2");
        assert_eq!(before, face(f.as_ref()), "{name}");
        // A step that overflows is refused as well; a model that does not overflow may take it.
        if f.predict(f64::MAX).is_ok() {
            assert!(face(f.as_ref()).1.cov.iter().all(|v| v.is_finite()), "{name} took a step to infinity");
        } else {
            assert_eq!(before, face(f.as_ref()), "{name}");
        }
    }
}

#[test]
fn every_exact_form_agrees_with_joseph_on_a_thousand_random_problems() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for problem in 0..1000 {
        let a = Matrix4::from_fn(|_, _| normal(&mut rng));
        let mut start = Gaussian {
            mean: Vector4::from_fn(|_, _| 10.0 * normal(&mut rng)),
            cov: a * a.transpose() + Matrix4::identity() * 0.05,
        };
        // Every second problem starts with uncorrelated axes, which the forms treat on a path of their own.
        if problem % 2 == 0 {
            start.cov.fixed_view_mut::<2, 2>(0, 2).fill(0.0);
            start.cov.fixed_view_mut::<2, 2>(2, 0).fill(0.0);
        }
        let b = Matrix2::from_fn(|_, _| normal(&mut rng));
        // Every third problem has a full measurement covariance, every third a hypothesis that may be clutter.
        let full = if problem % 3 == 0 { b * b.transpose() } else { Matrix2::zeros() };
        let r = full + Matrix2::from_diagonal(&Vector2::new(0.1 + normal(&mut rng).abs(), 0.3));
        let dt = 0.02 + 2.0 * rng.random::<f64>();
        let z: Vec<Weighted> = (0..3).map(|_| sure(10.0 * normal(&mut rng), 10.0 * normal(&mut rng), r)).collect();
        let mut all = exact_forms(&start);
        for (_, f) in &mut all {
            for z in &z {
                f.predict(dt).unwrap();
                let weight = if problem % 3 == 1 { 0.6 } else { 1.0 };
                f.update(&[Weighted { weight, ..*z }]).unwrap();
            }
        }
        let joseph = all[0].1.kinematics();
        for (name, f) in &all[1..] {
            let k = f.kinematics();
            let tolerance = 1e-10;
            let (dx, dp) = ((k.mean - joseph.mean).norm(), (k.cov - joseph.cov).norm());
            assert!(dx <= tolerance * (1.0 + joseph.mean.norm()), "{name}, problem {problem}: mean off by {dx:e}");
            assert!(dp <= tolerance * (1.0 + joseph.cov.norm()), "{name}, problem {problem}: covariance off by {dp:e}");
        }
    }
}

/// A million steps of each form: long enough to reach the steady state and to let rounding errors drift if they do.
#[test]
fn every_form_stays_symmetric_and_positive_definite_over_a_million_steps() {
    let n = forms(&belief()).len();
    let next = std::sync::atomic::AtomicUsize::new(0);
    let workers = std::thread::available_parallelism().map_or(1, usize::from).min(n);
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                loop {
                    let at = next.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                    let Some((name, f)) = forms(&belief()).into_iter().nth(at) else { break };
                    a_million_steps(name, f);
                }
            });
        }
    });
}

fn a_million_steps(name: &str, mut f: Box<dyn Filter>) {
    const STEPS: u32 = 1_000_000;
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    for k in 0..STEPS {
        f.predict(0.04).unwrap();
        if k % 7 != 0 {
            let (x, y) = (rng.random::<f64>() * 10.0, rng.random::<f64>() * 10.0);
            f.update(&[sure(x, y, Matrix2::new(0.3, 0.05, 0.05, 0.2))]).unwrap();
        }
        if k % 1000 == 0 || k + 1 == STEPS {
            let p = f.kinematics().cov;
            assert_eq!(p, p.transpose(), "{name} at step {k}");
            assert!(p.cholesky().is_some(), "{name} at step {k}: {p}");
        }
    }
}

/// Bits of two runs are the same: nothing hidden in the state.
#[test]
fn the_same_input_gives_the_same_bits() {
    let run = || -> Vec<(&'static str, Gaussian<4>)> {
        all_forms(&belief())
            .into_iter()
            .map(|(name, mut f)| {
                for k in 0..20 {
                    f.predict(0.1).unwrap();
                    f.update(&[sure(10.0 + f64::from(k), 20.0, Matrix2::identity())]).unwrap();
                }
                (name, f.kinematics())
            })
            .collect()
    };
    assert_eq!(run(), run());
}

#[test]
fn nees_of_every_exact_form_lies_within_its_99_percent_bounds() {
    const RUNS: usize = 200;
    const STEPS: usize = 20;
    let dt = 0.5;
    let r_std = 0.8;
    let start = belief();
    let root = start.cov.cholesky().unwrap().l();
    let names: Vec<&str> = exact_forms(&start).iter().map(|(n, _)| *n).collect();
    let mut nees = vec![Consistency::new(4); names.len()];
    let mut nis = vec![Consistency::new(2); names.len()];
    let mut rng = ChaCha8Rng::seed_from_u64(21);
    for _ in 0..RUNS {
        let mut truth = start.mean + root * Vector4::from_fn(|_, _| normal(&mut rng));
        let mut filters = exact_forms(&start);
        for _ in 0..STEPS {
            for axis in [0, 2] {
                let a = ACCELERATION_STD * normal(&mut rng);
                truth[axis] += dt * truth[axis + 1] + 0.5 * dt * dt * a;
                truth[axis + 1] += dt * a;
            }
            let z = sure(
                truth[0] + r_std * normal(&mut rng),
                truth[2] + r_std * normal(&mut rng),
                Matrix2::identity() * (r_std * r_std),
            );
            for ((_, f), nis) in filters.iter_mut().zip(&mut nis) {
                f.predict(dt).unwrap();
                let p = f.predicted();
                nis.add(normalized_error2(&(z.measurement.position - p.mean), &(p.cov + z.measurement.cov)).unwrap());
                f.update(&[z]).unwrap();
            }
        }
        // One sample a run: the errors of one run are correlated in time.
        for ((_, f), nees) in filters.iter().zip(&mut nees) {
            let k = f.kinematics();
            nees.add(normalized_error2(&(truth - k.mean), &k.cov).unwrap());
        }
    }
    for ((name, nees), nis) in names.iter().zip(&nees).zip(&nis) {
        assert_eq!(nees.is_consistent(0.99).unwrap(), Verdict::Consistent, "{name}: mean NEES {}", nees.mean());
        assert_eq!(nis.is_consistent(0.99).unwrap(), Verdict::Consistent, "{name}: mean NIS {}", nis.mean());
    }
}
