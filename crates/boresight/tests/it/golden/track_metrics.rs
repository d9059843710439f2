//! PFE, RMSPE, RMSVE and their halved variants; the posterior bounds.

use super::file::{load, number, numbers, rows};
use boresight::metrics::pcrlb::{LinearModel, pcrlb, rmspe_without_prior};
use boresight::metrics::state::state_errors;
use nalgebra::{Matrix1, Matrix1x2, Matrix2};

fn states(v: &serde_json::Value) -> Vec<[f64; 4]> {
    rows(v).iter().map(|r| [r[0], r[1], r[2], r[3]]).collect()
}

#[test]
fn errors_of_states_are_the_golden_ones() {
    let g = load("track_metrics");
    for (i, case) in g.cases.iter().enumerate() {
        let e = state_errors(&states(&case["inputs"]["truth"]), &states(&case["inputs"]["estimate"])).unwrap();
        let ours = [
            ("pfe_x", e.pfe_x),
            ("pfe_y", e.pfe_y),
            ("rmspe", e.rmspe),
            ("rmsve", e.rmsve),
            ("rmspe_halved", e.rmspe_halved),
            ("rmsve_halved", e.rmsve_halved),
        ];
        for (name, v) in ours {
            g.close(v, number(&case["outputs"][name]), &format!("case {i} {name}"));
        }
    }
}

#[test]
fn posterior_bounds_are_the_golden_ones() {
    let g = load("bounds");
    for (i, case) in g.cases.iter().enumerate() {
        let v = |name: &str| number(&case["inputs"][name]);
        let (q, n) = (v("q"), numbers(&case["inputs"]["n"]).len());
        let model = LinearModel {
            transition: Matrix2::new(1.0, 1.0, 0.0, 1.0),
            process_noise: Matrix2::new(0.25, 0.5, 0.5, 1.0) * q,
            observation: Matrix1x2::new(1.0, 0.0),
            measurement_noise: Matrix1::new(v("r")),
            detection_probability: 1.0,
        };
        let golden = rows(&case["outputs"]["pcrlb"]);
        let ours = pcrlb(&model, &Matrix2::new(v("p0"), 0.0, 0.0, v("v0")), n).unwrap();
        assert_eq!(ours.len(), golden.len(), "case {i}: scans");
        for (k, (b, row)) in ours.iter().zip(&golden).enumerate() {
            g.all_close(&[b[(0, 0)], b[(1, 1)]], row, &format!("case {i} scan {k}"));
        }
        let expected = number(&case["outputs"]["rmspe_no_prior"]);
        g.close(rmspe_without_prior(v("r"), n), expected, &format!("case {i} without prior"));
    }
}
