//! Golden vectors of the room `fuse`: track-to-track fusion.

use super::file::{Golden, load, numbers, rows};
use boresight::fuse::{fuse_correlated, fuse_independent};
use boresight_filters::Gaussian;
use nalgebra::{Matrix4, Vector4};
use serde_json::Value;

fn matrix(v: &Value) -> Matrix4<f64> {
    Matrix4::from_row_slice(&rows(v).concat())
}

fn compare(g: &Golden, ours: &Gaussian<4>, x: &Value, p: &Value, what: &str) {
    g.all_close(ours.mean.as_slice(), &numbers(x), what);
    g.all_close(ours.cov.transpose().as_slice(), &rows(p).concat(), what);
}

#[test]
fn track_fusion_agrees_with_the_golden_vectors() {
    let g = load("track_fusion");
    for case in &g.cases {
        let (i, o) = (&case["inputs"], &case["outputs"]);
        let belief = |x: &str, p: &str| Gaussian { mean: Vector4::from_vec(numbers(&i[x])), cov: matrix(&i[p]) };
        let (a, b) = (belief("xi", "Pi"), belief("xj", "Pj"));
        compare(&g, &fuse_independent(&a, &b).unwrap(), &o["x"], &o["P"], "independent");
        let cross = matrix(&i["Pcross"]);
        compare(&g, &fuse_correlated(&a, &b, &cross).unwrap(), &o["x_cross"], &o["P_cross"], "with cross covariance");
    }
}
