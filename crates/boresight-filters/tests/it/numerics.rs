//! The reason for square roots: in f32 with P0 = 1e6 and R = 1e-6 the covariance forms lose all digits, factors hold.
//!
//! `docs/theory/filters.md` (independent reference, 200 steps): relative error 0.99 conventional, 0.74 Joseph, 1.2e-6
//! U-D.

use boresight_filters::model::{ConstantAcceleration, ConstantVelocity, Dense, Model, OrnsteinUhlenbeck, Singer};
use boresight_filters::{
    CovarianceForm, FilterError, Gaussian, GaussianFilter, Kf, Measurement, SquareRoot, Srif, Start, Ud,
};
use nalgebra::{Matrix2, Matrix4, SMatrix, SVector, Vector2, Vector4};

type Cv = Dense<ConstantVelocity<f32>>;

fn start() -> Gaussian<4> {
    Gaussian { mean: Vector4::zeros(), cov: Matrix4::identity() * 1e6 }
}

fn run<F: GaussianFilter<4>>(mut f: F) -> Gaussian<4> {
    use boresight_filters::Real;
    for _ in 0..200 {
        // What a broken covariance refuses leaves the filter as it was: the error then stays.
        let _ = f.predict(F::Real::of(1.0));
        let _ = f.correct(&Measurement::isotropic(F::Real::of(0.0), F::Real::of(0.0), F::Real::of(1e-3)));
    }
    f.belief().cast()
}

#[test]
fn in_f32_the_covariance_forms_fail_where_factors_hold() {
    let exact = run(Ud::start(ConstantVelocity::discrete(0.0_f64).unwrap(), start()).unwrap());
    let (model, b) = (Dense(ConstantVelocity::<f32>::discrete(0.0).unwrap()), start().cast::<f32>());
    let error = |belief: Gaussian<4>| {
        (0..4).map(|i| (belief.cov[(i, i)] - exact.cov[(i, i)]).abs() / exact.cov[(i, i)]).fold(0.0, f64::max)
    };
    let kf = Kf::<Cv, 4, f32>::start(model, b).unwrap();
    let short = error(run(kf.with_form(CovarianceForm::Short)));
    let joseph = error(run(kf));
    let ud = error(run(Ud::<Cv, 4, f32>::start(model, b).unwrap()));
    let srif = error(run(Srif::<Cv, 4, f32>::start(model, b).unwrap()));
    let root = error(run(SquareRoot::<Cv, 4, f32>::start(model, b).unwrap()));
    assert!(short > 0.5 && joseph > 0.5, "short {short:e}, Joseph {joseph:e}");
    assert!(ud < 1e-5 && srif < 1e-5, "U-D {ud:e}, SRIF {srif:e}");
    assert!(root < 1e-2, "square root {root:e}");
}

#[test]
fn in_f64_the_factored_forms_agree_on_the_same_problem_and_joseph_keeps_three_digits() {
    let model = Dense(ConstantVelocity::discrete(0.0).unwrap());
    let exact = run(Ud::start(model, start()).unwrap());
    for other in [run(Srif::start(model, start()).unwrap()), run(SquareRoot::start(model, start()).unwrap())] {
        assert!((other.cov - exact.cov).norm() < 1e-9 * exact.cov.norm());
    }
    // Joseph's form keeps some four digits even here: 1e12 between prior and noise, squared by the product.
    assert!((run(Kf::start(model, start()).unwrap()).cov - exact.cov).norm() < 1e-3 * exact.cov.norm());
}

/// Sixty scans by the factored forms beside Joseph's without the way of two axes side by side.
fn factors_beside_joseph<const N: usize, M: Model<N> + Copy>(name: &str, model: M, variances: SVector<f64, N>) {
    let belief = Gaussian { mean: SVector::zeros(), cov: SMatrix::from_diagonal(&variances) };
    let mut kf = Kf::<_, N>::start(Dense(model), belief).unwrap();
    let mut apart = Kf::<_, N>::start(model, belief).unwrap();
    let mut ud = Ud::<_, N>::start(model, belief).unwrap();
    let mut srif = Srif::<_, N>::start(model, belief).unwrap();
    let mut root = SquareRoot::<_, N>::start(model, belief).unwrap();
    for k in 0..60 {
        let t = f64::from(k) * 0.1;
        // Uncorrelated axes of different noise: the way of two axes side by side.
        let z = Measurement { position: Vector2::new(t * t, 3.0 * t), cov: Matrix2::new(0.7, 0.0, 0.0, 1.9) };
        fn step<const N: usize>(f: &mut impl GaussianFilter<N, Real = f64>, z: &Measurement) -> Gaussian<N> {
            f.predict(0.1).unwrap();
            f.correct(z).unwrap();
            f.belief()
        }
        let want = step(&mut kf, &z);
        let [a, b] = [step(&mut apart, &z), step(&mut ud, &z)];
        let [c, d] = [step(&mut srif, &z), step(&mut root, &z)];
        for (form, got) in [("kf", a), ("ud", b), ("srif", c), ("root", d)] {
            assert!((got.cov - want.cov).amax() < 1e-10 * want.cov.amax(), "{name} by {form}, scan {k}");
            assert!((got.mean - want.mean).amax() < 1e-9, "{name} by {form}, scan {k}");
        }
    }
}

/// One, two and three columns of noise an axis, two and three states.
#[test]
fn every_count_of_states_and_of_noise_by_factors_is_that_of_joseph() {
    let four = SVector::from([4.0, 9.0, 1.0, 16.0]);
    let six = SVector::from([4.0, 9.0, 25.0, 1.0, 16.0, 9.0]);
    factors_beside_joseph("velocity, steps", ConstantVelocity::discrete(3.0).unwrap(), four);
    factors_beside_joseph("velocity, white", ConstantVelocity::continuous(3.0).unwrap(), four);
    factors_beside_joseph("forgetting velocity", OrnsteinUhlenbeck::new(3.0, 0.8).unwrap(), four);
    factors_beside_joseph("acceleration, steps", ConstantAcceleration::discrete(3.0, 5.0).unwrap(), six);
    factors_beside_joseph("acceleration, white", ConstantAcceleration::continuous(3.0, 5.0).unwrap(), six);
    factors_beside_joseph("singer", Singer::new(3.0, 0.8).unwrap(), six);
}

/// The largest number plus a step is none; factors and covariance stay numbers.
#[test]
fn a_mean_that_overflows_is_an_error_and_leaves_the_belief() {
    fn overflows<F: GaussianFilter<4, Real = f64>>(mut f: F) {
        let before = f.belief();
        assert!(matches!(f.predict(1.0), Err(FilterError::NotFinite(_))));
        assert_eq!(f.belief(), before);
    }
    let model = ConstantVelocity::discrete(1.0).unwrap();
    let belief = Gaussian { mean: Vector4::new(1.5e308, 1.5e308, 0.0, 0.0), cov: Matrix4::identity() };
    overflows(Kf::start(model, belief).unwrap());
    overflows(Kf::start(Dense(model), belief).unwrap());
    overflows(Ud::start(model, belief).unwrap());
    overflows(Ud::start(Dense(model), belief).unwrap());
    overflows(SquareRoot::start(model, belief).unwrap());
}
