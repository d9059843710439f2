//! Golden vectors of the fuzzy correlator and the fuzzy SRIF (`docs/theory/adaptive.md`).

use super::{golden, list, num, rows, vector};
use boresight_filters::fuzzy::Correlator;
use boresight_filters::model::ConstantVelocity;
use boresight_filters::{Fuzzy, Gaussian, GaussianFilter, Measurement, Srif, Start};
use nalgebra::{Matrix2, Matrix4, Vector4};

#[test]
fn memberships_and_output_are_the_golden_ones() {
    let g = golden("fuzzy_inference");
    let c = Correlator::default();
    for (i, (inp, out)) in g.cases.iter().enumerate() {
        let (u1, u2) = (num(&inp["u1"]), num(&inp["u2"]));
        for (name, u) in [("m1", u1), ("m2", u2)] {
            assert_eq!(rows(&out[name]), 7, "case {i}: memberships");
            for (got, want) in Correlator::degrees(&c.innovation_sets, u).iter().zip(list(&out[name])) {
                g.close(i, name, *got, want);
            }
        }
        g.close(i, "out", c.infer(u1, u2), num(&out["out"]));
    }
}

#[test]
fn the_fuzzy_srif_follows_the_golden_sequence() {
    let g = golden("fsrif_sequence");
    for (i, (inp, out)) in g.cases.iter().enumerate() {
        let cv = ConstantVelocity::discrete(num(&inp["Q"]).sqrt()).unwrap();
        let p0: Vector4<f64> = vector(&inp["P0diag"]);
        let belief = Gaussian { mean: vector(&inp["x0"]), cov: Matrix4::from_diagonal(&p0) };
        let correlator = Correlator {
            innovation_scale: num(&inp["ke"]),
            difference_scale: num(&inp["kd"]),
            output_scale: num(&inp["ko"]),
            ..Correlator::default()
        };
        let mut filter = Fuzzy::new(Srif::start(cv, belief).unwrap(), correlator).unwrap();
        assert_eq!(rows(&inp["Z"]), rows(out), "case {i}: steps");
        for (z, want) in inp["Z"].as_array().unwrap().iter().zip(out.as_array().unwrap()) {
            filter.predict(1.0).unwrap();
            let m = Measurement { position: vector(z), cov: Matrix2::identity() * num(&inp["Rm"]) };
            g.same(i, "nu", &(m.position - filter.predicted().mean), &want["nu"]);
            g.same(i, "r_flc", &filter.corrected_innovation(&m).unwrap(), &want["r_flc"]);
            filter.correct(&m).unwrap();
            g.same(i, "x", &filter.belief().mean, &want["x"]);
        }
    }
}
