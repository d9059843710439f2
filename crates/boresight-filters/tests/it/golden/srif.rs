//! Golden vectors of the square-root information filter (`docs/theory/filters.md`), of every size in the files.

use super::linear::{Written, step_of};
use super::{Golden, by_size, columns, golden, list, matrix, num, rows, vector};
use boresight_filters::linalg::Cholesky;
use boresight_filters::srif::InformationPair;
use boresight_filters::{Gaussian, GaussianFilter, Information, Measurement, SquareRoot, Srif, Start};
use nalgebra::{Matrix4, SMatrix, SVector};
use serde_json::Value;

fn pair<const N: usize>(v: &Value) -> InformationPair<N> {
    InformationPair { r: matrix(&v["R"]), y: vector(&v["y"]) }
}

fn measurement<const N: usize, const M: usize>(g: &Golden, i: usize, inp: &Value, out: &Value) {
    let mut p = pair::<N>(inp);
    let l = Cholesky::<M>::new(&matrix(&inp["Rm"]), "Rm").unwrap();
    let e = p.measure(&l.whiten(&matrix::<M, N>(&inp["H"])), &l.whiten(&vector::<M>(&inp["z"])));
    g.same(i, "R", &p.r, &out["R"]);
    g.same(i, "y", &p.y, &out["y"]);
    g.close(i, "|e|²", e.norm_squared(), num(&out["e_norm2"]));
    g.same(i, "x", &p.belief().mean, &out["x"]);
    g.same(i, "P", &p.belief().cov, &out["P"]);
}

#[test]
fn the_measurement_update_is_the_golden_one() {
    let g = golden("srif_measurement");
    for (i, (inp, out)) in g.cases.iter().enumerate() {
        by_size!(rows(&inp["y"]), rows(&inp["H"]), measurement(&g, i, inp, out));
    }
}

fn time<const N: usize, const W: usize>(g: &Golden, i: usize, inp: &Value, out: &Value) {
    let mut p = pair::<N>(inp);
    let phi: SMatrix<f64, N, N> = matrix(&inp["Phi"]);
    let l = Cholesky::<W>::semi_definite(&matrix(&inp["Q"]), "Q").unwrap().l;
    p.propagate(&phi.try_inverse().unwrap(), &(matrix::<N, W>(&inp["G"]) * l));
    g.same(i, "R", &p.r, &out["R"]);
    g.same(i, "y", &p.y, &out["y"]);
    g.same(i, "x", &p.belief().mean, &out["x"]);
    g.same(i, "P", &p.belief().cov, &out["P"]);
}

#[test]
fn the_time_update_is_the_golden_one_also_for_singular_noise() {
    let g = golden("srif_time");
    for (i, (inp, out)) in g.cases.iter().enumerate() {
        by_size!(rows(&inp["y"]), columns(&inp["G"]), time(&g, i, inp, out));
    }
}

fn fused<const N: usize, const M: usize>(g: &Golden, i: usize, inp: &Value, out: &Value) {
    let mut p = pair::<N>(inp);
    let mut e2 = 0.0;
    for s in ["1", "2"] {
        let l = Cholesky::<M>::new(&matrix(&inp[format!("Rm{s}")]), "Rm").unwrap();
        let h: SMatrix<f64, M, N> = matrix(&inp[format!("H{s}")]);
        let z: SVector<f64, M> = vector(&inp[format!("z{s}")]);
        e2 += p.measure(&l.whiten(&h), &l.whiten(&z)).norm_squared();
    }
    g.same(i, "R", &p.r, &out["R"]);
    g.same(i, "y", &p.y, &out["y"]);
    g.close(i, "|e|²", e2, num(&out["e_norm2"]));
}

/// Both sensors in one triangularisation of `BOTH` rows.
fn stacked<const N: usize, const BOTH: usize>(g: &Golden, i: usize, inp: &Value, out: &Value) {
    let mut p = pair::<N>(inp);
    let (mut h, mut z) = (SMatrix::<f64, BOTH, N>::zeros(), SVector::<f64, BOTH>::zeros());
    let m = BOTH / 2;
    let mut noise = SMatrix::<f64, BOTH, BOTH>::zeros();
    for (at, s) in [(0, "1"), (m, "2")] {
        for (k, row) in inp[format!("H{s}")].as_array().unwrap().iter().enumerate() {
            for (l, v) in list(row).into_iter().enumerate() {
                h[(at + k, l)] = v;
            }
            z[at + k] = num(&inp[format!("z{s}")][k]);
            for (l, v) in list(&inp[format!("Rm{s}")][k]).into_iter().enumerate() {
                noise[(at + k, at + l)] = v;
            }
        }
    }
    let l = Cholesky::<BOTH>::new(&noise, "Rm").unwrap();
    let e = p.measure(&l.whiten(&h), &l.whiten(&z));
    g.same(i, "R, stacked", &p.r, &out["R"]);
    g.same(i, "y, stacked", &p.y, &out["y"]);
    g.close(i, "|e|², stacked", e.norm_squared(), num(&out["e_norm2"]));
}

#[test]
fn two_sensors_fuse_to_the_golden_pair_one_after_the_other_and_at_once() {
    let g = golden("srif_fused");
    for (i, (inp, out)) in g.cases.iter().enumerate() {
        by_size!(rows(&inp["y"]), rows(&inp["H1"]), fused(&g, i, inp, out));
        by_size!(rows(&inp["y"]), 2 * rows(&inp["H1"]), stacked(&g, i, inp, out));
    }
}

/// The worked example of `docs/theory/filters.md`: one triangularisation of both sensors gives the printed fused mean.
#[test]
fn one_triangularisation_of_two_sensors_gives_the_worked_example() {
    let mut cov = Matrix4::from_diagonal(&vector::<4>(&serde_json::json!([0.5, 0.03, 0.5, 0.03])));
    (cov[(0, 1)], cov[(1, 0)]) = (0.05, 0.05);
    let still = Written { phi: Matrix4::identity(), process_noise: Matrix4::zeros() };
    let belief = Gaussian { mean: SVector::<f64, 4>::new(11.0, 1.0, 11.0, 1.0), cov };
    let mut srif = Srif::start(still, belief).unwrap();
    let first = Measurement::isotropic(11.4, 10.8, 0.5_f64.sqrt());
    let second = Measurement::isotropic(11.1, 11.3, 0.25_f64.sqrt());
    srif.correct_both(&first, &second).unwrap();
    assert!((srif.belief().mean - SVector::<f64, 4>::new(11.15, 1.015, 11.1, 1.0)).norm() < 1e-12);
}

#[test]
fn every_square_root_form_gives_the_golden_kalman_step() {
    let g = golden("kalman");
    let selector = SMatrix::<f64, 2, 4>::new(1., 0., 0., 0., 0., 0., 1., 0.);
    let mut n = 0;
    for (i, (inp, out)) in g.cases.iter().enumerate() {
        let Some(model) = Written::read(inp) else { continue };
        if rows(&inp["H"]) == 2 && matrix::<2, 4>(&inp["H"]) == selector {
            step_of::<Srif<Written, 4>>(&g, i, inp, out, model);
            step_of::<SquareRoot<Written, 4>>(&g, i, inp, out, model);
            step_of::<Information<Written, 4>>(&g, i, inp, out, model);
            n += 1;
        }
    }
    assert!(n > 0, "no case measures positions");
}
