//! The reason for square roots: in f32 with P0 = 1e6 and R = 1e-6 the covariance forms lose all digits, factors hold.
//!
//! `docs/theory/filters.md` (independent reference, 200 steps): relative error 0.99 conventional, 0.74 Joseph, 1.2e-6
//! U-D.

use boresight_filters::model::{ConstantAcceleration, ConstantVelocity, Dense};
use boresight_filters::{CovarianceForm, Gaussian, GaussianFilter, Kf, Measurement, SquareRoot, Srif, Start, Ud};
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

#[test]
fn three_states_an_axis_by_factors_are_those_of_joseph() {
    let model = ConstantAcceleration::discrete(3.0, 5.0).unwrap();
    let cov = SMatrix::<f64, 6, 6>::from_diagonal(&SVector::from([4.0, 9.0, 25.0, 1.0, 16.0, 9.0]));
    let belief = Gaussian { mean: SVector::zeros(), cov };
    let mut ud = Ud::<_, 6>::start(model, belief).unwrap();
    let mut kf = Kf::<_, 6>::start(model, belief).unwrap();
    for k in 0..60 {
        let t = f64::from(k) * 0.1;
        // Uncorrelated axes of different noise: the way of two axes side by side.
        let z = Measurement { position: Vector2::new(t * t, 3.0 * t), cov: Matrix2::new(0.7, 0.0, 0.0, 1.9) };
        ud.predict(0.1).unwrap();
        kf.predict(0.1).unwrap();
        ud.correct(&z).unwrap();
        kf.correct(&z).unwrap();
        let scale = kf.belief().cov.amax();
        assert!((ud.belief().cov - kf.belief().cov).amax() < 1e-10 * scale, "scan {k}");
        assert!((ud.belief().mean - kf.belief().mean).amax() < 1e-9, "scan {k}");
    }
}
