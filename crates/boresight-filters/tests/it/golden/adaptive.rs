//! Golden vectors of the LMS filter, the AR(1) recursion and the displacement model (`docs/theory/adaptive.md`).

use super::{Golden, golden, list, matrix, num, rows};
use boresight_filters::ar1::Ar1Axis;
use boresight_filters::lms::{LmsAxis, LmsRule, lms_measured, lms_step, lms_transition};
use boresight_filters::{Displacement, Gaussian, GaussianFilter, Measurement};
use nalgebra::{Matrix2, Matrix4, SMatrix, SVector, Vector2, Vector4};
use serde_json::Value;

/// Calls a function generic over the number of states with that of a case.
macro_rules! by_states {
    ($s:expr, $f:ident $args:tt) => {
        match $s {
            5 => $f::<5> $args,
            6 => $f::<6> $args,
            7 => $f::<7> $args,
            8 => $f::<8> $args,
            other => panic!("add {other} states to by_states"),
        }
    };
}

/// Puts a matrix of acceleration weights into the corner where the filter keeps it.
fn corner<const S: usize>(v: &Value) -> SMatrix<f64, S, S> {
    let mut w = SMatrix::identity();
    for (i, row) in v.as_array().unwrap().iter().enumerate() {
        for (j, x) in list(row).into_iter().enumerate() {
            w[(i + 2, j + 2)] = x;
        }
    }
    w
}

fn accelerations<const S: usize>(v: &Value) -> SVector<f64, S> {
    let mut a = SVector::zeros();
    for (i, x) in list(v).into_iter().enumerate() {
        a[i + 2] = x;
    }
    a
}

fn step<const S: usize>(g: &Golden, i: usize, inp: &Value, out: &Value) {
    let mut w = corner::<S>(&inp["W"]);
    let e = lms_step(&mut w, &accelerations(&inp["a_in"]), &accelerations(&inp["a_out"]), num(&inp["eta"]));
    assert_eq!(rows(&out["e"]), S - 2, "case {i}: length of e");
    for (k, want) in list(&out["e"]).into_iter().enumerate() {
        g.close(i, "e", e[k + 2], want);
    }
    g.same(i, "A", &lms_transition(&w, 0.5), &out["A"]);
    let want = corner::<S>(&out["W"]);
    for r in 2..S {
        for c in r..S {
            g.close(i, "W", w[(r, c)], want[(r, c)]);
        }
    }
    let measured: Vec<usize> = (0..S).filter(|&k| lms_measured::<S>()[k]).collect();
    let c_rows: Vec<usize> =
        out["C"].as_array().unwrap().iter().map(|row| list(row).iter().position(|v| *v == 1.0).unwrap()).collect();
    assert_eq!(measured, c_rows, "case {i}: measured states");
}

#[test]
fn the_weight_update_and_matrices_are_the_golden_ones() {
    let g = golden("lms_step");
    for (i, (inp, out)) in g.cases.iter().enumerate() {
        by_states!(rows(&inp["W"]) + 2, step(&g, i, inp, out));
    }
}

fn sequence<const S: usize>(g: &Golden, i: usize, inp: &Value, out: &Value) {
    let (sigma, dt, z) = (num(&inp["sigma"]), num(&inp["T"]), list(&inp["z"]));
    let rule = if inp["guarded"].as_bool().unwrap() {
        LmsRule::Guarded
    } else {
        LmsRule::AsPrinted { alpha: num(&inp["alpha"]) }
    };
    let mut axis = LmsAxis::<S>::from_samples([z[0], z[1], z[2]], dt, sigma, rule).unwrap();
    let want = out["x"].as_array().unwrap();
    assert!(want.len() == z.len() && want[0].is_null() && want[1].is_null());
    g.same(i, "x[2]", &axis.state, &want[2]);
    for k in 3..z.len() {
        axis.predict(dt).unwrap();
        axis.correct(z[k], sigma * sigma, dt).unwrap();
        g.same(i, &format!("x[{k}]"), &axis.state, &want[k]);
    }
    g.same(i, "P", &axis.cov, &out["P"]);
    g.same(i, "Q", &axis.noise, &out["Q"]);
    let w = corner::<S>(&out["W"]);
    for r in 2..S {
        for c in r..S {
            g.close(i, "W", axis.weights[(r, c)], w[(r, c)]);
        }
    }
    assert_eq!(f64::from(axis.trips), num(&out["trips"]), "case {i}: trips of the watchdog");
}

#[test]
fn the_lms_filter_follows_the_golden_sequence_as_printed_and_guarded() {
    let g = golden("lms_kf_sequence");
    for (i, (inp, out)) in g.cases.iter().enumerate() {
        by_states!(num(&inp["N"]) as usize + 3, sequence(&g, i, inp, out));
    }
}

/// The worked example of `docs/theory/adaptive.md`: σ = 2, T = 1, N = 2, α = 1e-3.
#[test]
fn the_worked_lms_example() {
    let z = [10.0, 12.5, 14.0, 17.0, 21.5, 24.0];
    let mut axis =
        LmsAxis::<5>::from_samples([z[0], z[1], z[2]], 1.0, 2.0, LmsRule::AsPrinted { alpha: 1e-3 }).unwrap();
    for z in &z[3..] {
        axis.predict(1.0).unwrap();
        axis.correct(*z, 4.0, 1.0).unwrap();
    }
    let x = [24.283878504673, 4.0934579439252, 0.39317491944783, 0.0, 0.23377936169522];
    for (a, b) in axis.state.iter().zip(x) {
        assert!((a - b).abs() < 1e-11, "{a} {b}");
    }
    assert!((axis.rate - 0.0020326054739616).abs() < 1e-15);
    let w = [[0.99597796038828, 0.0, 0.00020745511886141], [0.0, 1.0, 0.0], [0.0, 0.0, 0.99884728257779]];
    for r in 0..3 {
        for c in r..3 {
            assert!((axis.weights[(r + 2, c + 2)] - w[r][c]).abs() < 1e-13, "W[{r}][{c}]");
        }
    }
    for (i, q) in [0.0, 0.0, 1.5004952345772, 0.0, 0.59961732856344].into_iter().enumerate() {
        assert!((axis.noise[i] - q).abs() < 1e-12, "Q[{i}]");
    }
}

#[test]
fn the_ar1_recursion_is_the_golden_one() {
    let g = golden("ar1_recursion");
    for (i, (inp, out)) in g.cases.iter().enumerate() {
        let z = list(&inp["z"]);
        let mut axis = Ar1Axis::new(z[0]);
        assert_eq!(rows(out) + 1, z.len(), "case {i}: steps");
        for (k, want) in out.as_array().unwrap().iter().enumerate() {
            let prediction = axis.observe(z[k + 1]);
            g.close(i, "prediction", prediction, num(&want["prediction"]));
            g.close(i, "alpha", axis.alpha, num(&want["alpha"]));
            g.close(i, "P", axis.p, num(&want["P"]));
        }
    }
}

/// Puts one coordinate of the displacement model on both axes of the filter.
fn displacement(s: [f64; 2], p0: &Matrix2<f64>, q: f64) -> Displacement {
    let mut cov = Matrix4::zeros();
    for at in [0, 2] {
        cov.fixed_view_mut::<2, 2>(at, at).copy_from(p0);
    }
    Displacement::start(Gaussian { mean: Vector4::new(s[0], s[1], s[0], s[1]), cov }, q, 1.0).unwrap()
}

#[test]
fn the_displacement_model_follows_the_golden_sequence() {
    let g = golden("displacement2");
    for (i, (inp, out)) in g.cases.iter().enumerate() {
        let z = list(&inp["z"]);
        assert_eq!(rows(out) + 2, z.len(), "case {i}: steps");
        let missed: Vec<usize> = list(&inp["missed"]).iter().map(|v| *v as usize).collect();
        let mut filter = displacement([z[1], z[0]], &matrix(&inp["P0"]), num(&inp["q"]));
        for (n, want) in out.as_array().unwrap().iter().enumerate() {
            let k = n + 2;
            filter.predict(1.0).unwrap();
            g.close(i, "predicted", filter.predicted().mean[0], num(&want["predicted"]));
            if !missed.contains(&k) {
                let cov = Matrix2::identity() * num(&inp["r"]);
                filter.correct(&Measurement { position: Vector2::new(z[k], z[k]), cov }).unwrap();
            }
            let b = filter.belief();
            g.close(i, "filtered", b.mean[0], num(&want["filtered"]));
            g.same(i, "s", &b.mean.fixed_rows::<2>(2).into_owned(), &want["s"]);
            g.same(i, "P", &b.cov.fixed_view::<2, 2>(0, 0).into_owned(), &want["P"]);
        }
    }
}

/// The worked example of `docs/theory/adaptive.md`, with a missed frame.
#[test]
fn the_worked_displacement_example() {
    let mut filter = displacement([104.0, 100.0], &Matrix2::identity(), 1.0);
    for (z, predicted, filtered) in [
        (Some(108.5), 108.0, 108.42857142857),
        (Some(112.0), 112.71428571429, 112.15151515152),
        (None, 116.09090909091, 116.09090909091),
        (Some(120.0), 120.0303030303, 120.0027173913),
    ] {
        filter.predict(1.0).unwrap();
        assert!((filter.predicted().mean[0] - predicted).abs() < 1e-10);
        if let Some(z) = z {
            filter.correct(&Measurement::isotropic(z, z, 1.0)).unwrap();
        }
        assert!((filter.belief().mean[2] - filtered).abs() < 1e-10);
    }
}
