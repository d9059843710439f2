//! Golden vectors of the Kalman and U-D filters (`docs/theory/filters.md`), of every size in the files.

use super::{Golden, by_size, columns, golden, matrix, num, rows, vector};
use boresight_filters::linalg::{UdFactors, mwgs, ud_factorize};
use boresight_filters::linear::{correct_linear, predict_linear};
use boresight_filters::model::Model;
use boresight_filters::ud::ud_scalar_update;
use boresight_filters::{Gaussian, GaussianFilter, Kf, Measurement, Start, Ud};
use nalgebra::{Matrix4, SMatrix, SVector, Vector4};
use serde_json::Value;

/// The model of a golden case: Phi, G and Q as written there, for a step of 1 s.
#[derive(Clone, Copy)]
pub struct Written {
    pub phi: Matrix4<f64>,
    pub process_noise: Matrix4<f64>,
}

impl Written {
    pub fn read(v: &Value) -> Option<Self> {
        if rows(&v["Phi"]) != 4 || columns(&v["G"]) != 2 {
            return None;
        }
        let (g, q): (SMatrix<f64, 4, 2>, SMatrix<f64, 2, 2>) = (matrix(&v["G"]), matrix(&v["Q"]));
        Some(Self { phi: matrix(&v["Phi"]), process_noise: g * q * g.transpose() })
    }
}

impl Model<4, f64> for Written {
    const POSITION: [usize; 2] = [0, 2];
    const VELOCITY: Option<[usize; 2]> = Some([1, 3]);
    fn transition(&self, dt_s: f64, _: &Vector4<f64>) -> Matrix4<f64> {
        assert_eq!(dt_s, 1.0);
        self.phi
    }
    fn process_noise(&self, _: f64) -> Matrix4<f64> {
        self.process_noise
    }
    fn lift(&self, k: &Gaussian<4>) -> Gaussian<4> {
        *k
    }
}

fn kalman_predict<const N: usize, const W: usize>(g: &Golden, i: usize, inp: &Value, out: &Value) {
    let (gm, q): (SMatrix<f64, N, W>, SMatrix<f64, W, W>) = (matrix(&inp["G"]), matrix(&inp["Q"]));
    let b = Gaussian::<N> { mean: vector(&inp["x"]), cov: matrix(&inp["P"]) };
    let p = predict_linear(&b, &matrix(&inp["Phi"]), &(gm * q * gm.transpose()));
    g.same(i, "x_pred", &p.mean, &out["x_pred"]);
    g.same(i, "P_pred", &p.cov, &out["P_pred"]);
}

fn kalman_correct<const N: usize, const M: usize>(g: &Golden, i: usize, inp: &Value, out: &Value) {
    let b = Gaussian::<N> { mean: vector(&out["x_pred"]), cov: matrix(&out["P_pred"]) };
    let h: SMatrix<f64, M, N> = matrix(&inp["H"]);
    let z: SVector<f64, M> = vector(&inp["z"]);
    let u = correct_linear(&b, &h, &(z - h * b.mean), &matrix(&inp["R"])).unwrap();
    g.same(i, "innovation", &u.innovation, &out["innovation"]);
    g.same(i, "S", &u.innovation_cov, &out["S"]);
    g.same(i, "K", &u.gain, &out["K"]);
    g.same(i, "x_upd", &u.belief.mean, &out["x_upd"]);
    g.same(i, "P_upd", &u.belief.cov, &out["P_upd"]);
}

#[test]
fn the_kalman_filter_gives_the_golden_step() {
    let g = golden("kalman");
    for (i, (inp, out)) in g.cases.iter().enumerate() {
        by_size!(rows(&inp["Phi"]), columns(&inp["G"]), kalman_predict(&g, i, inp, out));
        by_size!(rows(&inp["Phi"]), rows(&inp["H"]), kalman_correct(&g, i, inp, out));
    }
}

/// Runs one golden step through a filter and compares with the golden outputs.
pub fn step_of<F: GaussianFilter<4, Real = f64> + Start<Written, 4>>(
    g: &Golden,
    i: usize,
    inp: &Value,
    out: &Value,
    model: Written,
) {
    let belief = Gaussian { mean: vector(&inp["x"]), cov: matrix(&inp["P"]) };
    let m = Measurement { position: vector(&inp["z"]), cov: matrix(&inp["R"]) };
    let mut filter = F::start(model, belief).unwrap();
    filter.predict(1.0).unwrap();
    g.same(i, "x_pred", &filter.belief().mean, &out["x_pred"]);
    g.same(i, "P_pred", &filter.belief().cov, &out["P_pred"]);
    g.same(i, "innovation", &(m.position - filter.predicted().mean), &out["innovation"]);
    g.same(i, "S", &(filter.predicted().cov + m.cov), &out["S"]);
    filter.correct(&m).unwrap();
    g.same(i, "x_upd", &filter.belief().mean, &out["x_upd"]);
    g.same(i, "P_upd", &filter.belief().cov, &out["P_upd"]);
}

#[test]
fn kalman_and_ud_give_the_golden_step_where_positions_are_measured() {
    let g = golden("kalman");
    let mut n = 0;
    for (i, (inp, out)) in g.cases.iter().enumerate() {
        let Some(model) = Written::read(inp) else { continue };
        let selector = SMatrix::<f64, 2, 4>::new(1., 0., 0., 0., 0., 0., 1., 0.);
        if rows(&inp["H"]) != 2 || matrix::<2, 4>(&inp["H"]) != selector {
            continue;
        }
        step_of::<Kf<Written, 4>>(&g, i, inp, out, model);
        step_of::<Ud<Written, 4>>(&g, i, inp, out, model);
        n += 1;
    }
    assert!(n > 0, "no case measures positions");
}

fn factorize<const N: usize, const M: usize>(g: &Golden, i: usize, inp: &Value, out: &Value) {
    let f = ud_factorize::<f64, N>(&matrix(&inp["P"])).unwrap();
    g.same(i, "U", &f.u, &out["U"]);
    g.same(i, "d", &f.d, &out["d"]);
}

#[test]
fn ud_factors_are_the_golden_ones() {
    let g = golden("ud_factorize");
    for (i, (inp, out)) in g.cases.iter().enumerate() {
        by_size!(rows(&inp["P"]), 1, factorize(&g, i, inp, out));
    }
}

fn scalar_update<const N: usize, const M: usize>(g: &Golden, i: usize, inp: &Value, out: &Value) {
    let mut x: SVector<f64, N> = vector(&inp["x"]);
    let mut f = UdFactors { u: matrix(&inp["U"]), d: vector(&inp["d"]) };
    let done = ud_scalar_update(&mut x, &mut f, &vector(&inp["a"]), num(&inp["z"]), num(&inp["r"]));
    g.same(i, "x", &x, &out["x"]);
    g.same(i, "U", &f.u, &out["U"]);
    g.same(i, "d", &f.d, &out["d"]);
    g.same(i, "K", &done.gain, &out["K"]);
    g.close(i, "alpha", done.alpha, num(&out["alpha"]));
}

#[test]
fn the_scalar_ud_update_is_the_golden_one() {
    let g = golden("ud_measurement");
    for (i, (inp, out)) in g.cases.iter().enumerate() {
        by_size!(rows(&inp["x"]), 1, scalar_update(&g, i, inp, out));
    }
}

fn vector_update<const N: usize, const M: usize>(g: &Golden, i: usize, inp: &Value, out: &Value) {
    let mut x: SVector<f64, N> = vector(&inp["x"]);
    let mut f = UdFactors { u: matrix(&inp["U"]), d: vector(&inp["d"]) };
    let h: SMatrix<f64, M, N> = matrix(&inp["H"]);
    let (z, r): (SVector<f64, M>, SVector<f64, M>) = (vector(&inp["z"]), vector(&inp["r"]));
    for row in 0..M {
        ud_scalar_update(&mut x, &mut f, &h.row(row).transpose(), z[row], r[row]);
    }
    g.same(i, "x", &x, &out["x"]);
    g.same(i, "U", &f.u, &out["U"]);
    g.same(i, "d", &f.d, &out["d"]);
}

#[test]
fn the_vector_ud_update_is_the_golden_one() {
    let g = golden("ud_vector_measurement");
    for (i, (inp, out)) in g.cases.iter().enumerate() {
        by_size!(rows(&inp["x"]), rows(&inp["H"]), vector_update(&g, i, inp, out));
    }
}

fn time_update<const N: usize, const W: usize>(g: &Golden, i: usize, inp: &Value, out: &Value) {
    let (w, dbar) = (inp["W"].as_array().unwrap(), inp["Dbar"].as_array().unwrap());
    let part = |from: usize, to: usize| -> Value {
        w.iter().map(|row| Value::from(row.as_array().unwrap()[from..to].to_vec())).collect::<Vec<_>>().into()
    };
    let f = mwgs(
        &matrix::<N, N>(&part(0, N)),
        &vector(&dbar[..N].to_vec().into()),
        &matrix::<N, W>(&part(N, N + W)),
        &vector(&dbar[N..].to_vec().into()),
    );
    g.same(i, "U", &f.u, &out["U"]);
    g.same(i, "d", &f.d, &out["d"]);

    let phi: SMatrix<f64, N, N> = matrix(&inp["Phi"]);
    let u: SMatrix<f64, N, N> = matrix(&inp["U"]);
    let f = mwgs(&(phi * u), &vector(&inp["d"]), &matrix::<N, W>(&inp["G"]), &vector(&inp["q"]));
    g.same(i, "U_pred", &f.u, &out["U_pred"]);
    g.same(i, "d_pred", &f.d, &out["d_pred"]);
    g.same(i, "x_pred", &(phi * vector::<N>(&inp["x"])), &out["x_pred"]);
}

#[test]
fn the_ud_time_update_is_the_golden_one() {
    let g = golden("ud_time");
    for (i, (inp, out)) in g.cases.iter().enumerate() {
        by_size!(rows(&inp["x"]), columns(&inp["G"]), time_update(&g, i, inp, out));
    }
}
