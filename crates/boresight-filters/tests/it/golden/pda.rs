//! Golden vectors of gating and probabilistic data association (`docs/theory/association.md`).

use super::{golden, list, matrix, num, rows, vector};
use crate::forms::{each_form, exact_forms};
use boresight_filters::linalg::invert_pair;
use boresight_filters::pda::{Clutter, association_probabilities};
use boresight_filters::{Gaussian, Measurement, Weighted};
use nalgebra::{Matrix2, Vector2};
use serde_json::Value;

fn measurements(inp: &Value) -> Vec<Measurement> {
    let cov: Matrix2<f64> = matrix(&inp["R"]);
    inp["Z"].as_array().unwrap().iter().map(|z| Measurement { position: vector(z), cov }).collect()
}

#[test]
fn every_form_gives_the_golden_pda_update() {
    let g = golden("pda");
    for (i, (inp, out)) in g.cases.iter().enumerate() {
        let belief = Gaussian { mean: vector(&inp["x"]), cov: matrix(&inp["P"]) };
        for (name, mut filter) in exact_forms(&belief) {
            let predicted = filter.predicted();
            let z = measurements(inp);
            let gated: Vec<usize> = (0..z.len())
                .filter(|&j| {
                    let s = invert_pair(&(predicted.cov + z[j].cov), "S").unwrap();
                    s.distance2(&(z[j].position - predicted.mean)) <= num(&inp["gamma"])
                })
                .collect();
            let expected: Vec<usize> = list(&out["gated"]).iter().map(|&v| v as usize).collect();
            assert_eq!(gated, expected, "case {i}: gated");
            let inside: Vec<Measurement> = gated.iter().map(|&j| z[j]).collect();
            let clutter = Clutter {
                density: num(&inp["lam"]),
                detection_probability: num(&inp["pd"]),
                gate_probability: num(&inp["pg"]),
            };
            let mut p = vec![0.0; inside.len()];
            let p0 = association_probabilities(&predicted, &inside, &clutter, &mut p).unwrap();
            let want = list(&out["p"]);
            assert_eq!(want.len(), p.len() + 1, "case {i}: probabilities");
            g.close(i, "p0", p0, want[0]);
            for (j, p) in p.iter().enumerate() {
                g.close(i, "p", *p, want[j + 1]);
            }
            let hypotheses: Vec<Weighted> =
                inside.iter().zip(&p).map(|(m, &weight)| Weighted { measurement: *m, weight }).collect();
            filter.update(&hypotheses).unwrap();
            let k = filter.kinematics();
            g.same(i, &format!("{name}: x"), &k.mean, &out["x"]);
            g.same(i, &format!("{name}: P"), &k.cov, &out["P"]);
        }
    }
}

#[test]
fn gate_distances_and_the_nearest_are_the_golden_ones() {
    let g = golden("gate_nn");
    for (i, (inp, out)) in g.cases.iter().enumerate() {
        let belief = Gaussian { mean: vector(&inp["x"]), cov: matrix(&inp["P"]) };
        each_form(&belief, |_, filter| {
            let predicted = filter.predicted();
            let d2: Vec<f64> = measurements(inp)
                .iter()
                .map(|m| {
                    let s = predicted.cov + m.cov;
                    g.same(i, "S", &s, &out["S"]);
                    let nu: Vector2<f64> = m.position - predicted.mean;
                    invert_pair(&s, "S").unwrap().distance2(&nu)
                })
                .collect();
            assert_eq!(d2.len(), rows(&out["d2"]), "case {i}: distances");
            for (a, b) in d2.iter().zip(list(&out["d2"])) {
                g.close(i, "d2", *a, b);
            }
            let best = (0..d2.len()).filter(|&j| d2[j] <= num(&inp["gamma"])).min_by(|&a, &b| d2[a].total_cmp(&d2[b]));
            assert_eq!(best.map_or(-1.0, |b| b as f64), num(&out["nearest"]), "case {i}: nearest");
        });
    }
}
