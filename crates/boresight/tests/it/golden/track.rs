//! Golden vectors of association and tracking: tracker, gnn, gate_nn, pda.

use super::file::{load, number, numbers, rows};
use boresight::associate::{Assignment, AssociatorConfig, Gates, Pair, Prior};
use boresight::track::{
    self, ConfirmationConfig, MOfNConfig, TrackerConfig,
    filter::{AccelerationNoise, ConstantVelocityKf},
};
use boresight::{Detection, FrameIndex, Scan, Timestamp, TrackStatus};
use boresight_filters::{Filter, Gaussian, Measurement, Weighted};
use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};

fn detection(x: f64, y: f64, cov: Matrix2<f64>) -> Detection {
    Detection::at(Vector2::new(x, y), cov)
}

#[test]
fn the_tracker_keeps_the_golden_tracks() {
    let golden = load("tracker");
    for (n, case) in golden.cases.iter().enumerate() {
        let i = &case["inputs"];
        let get = |key: &str| number(&i[key]);
        let (dt, r) = (get("T"), get("R"));
        let associator = match i["mode"].as_str().unwrap() {
            "pda" => AssociatorConfig::Pda(Default::default()),
            "gnn" | "nn" => AssociatorConfig::GlobalNearest(Default::default()),
            other => panic!("mode {other}"),
        };
        let config = TrackerConfig {
            acceleration_std_px_per_s2: Some(get("q").sqrt()),
            extra_noise_px: 0.0,
            gate_probability: 1.0 - (-0.5 * get("gamma")).exp(),
            max_speed_px_per_s: get("vmax") / dt,
            // The golden tracker does not cut its gates.
            gate_within_max_speed: false,
            detection_probability: get("pd"),
            clutter_density_per_px2: get("lam"),
            associator,
            confirmation: ConfirmationConfig::MOfN(MOfNConfig {
                hits: get("M") as u32,
                scans: get("N") as u32,
                ..MOfNConfig::default()
            }),
            coast_s: get("max_miss") * dt,
            coast_scans: 1,
            ..TrackerConfig::default()
        };
        let mut tracker = track::build(&config).unwrap();
        assert_eq!(i["scans"].as_array().unwrap().len(), case["outputs"].as_array().unwrap().len(), "case {n}: scans");
        for (k, points) in i["scans"].as_array().unwrap().iter().enumerate() {
            let scan = Scan::at(FrameIndex(k as u64), Timestamp::from_secs_f64(k as f64 * dt))
                .with_detections(rows(points).iter().map(|p| detection(p[0], p[1], Matrix2::identity() * r)).collect());
            let states = tracker.step(&scan).unwrap();
            let expected = case["outputs"][k].as_array().unwrap();
            let place = format!("case {n}, scan {k}");
            assert_eq!(states.len(), expected.len(), "{place}: number of tracks");
            for (ours, golden_track) in states.iter().zip(expected) {
                assert_eq!(ours.id.0 - 1, golden_track["id"].as_u64().unwrap(), "{place}");
                let confirmed = golden_track["status"] == "confirmed";
                assert_eq!(ours.status != TrackStatus::Tentative, confirmed, "{place}, track {}", ours.id.0);
                golden.all_close(ours.kinematics.mean.as_slice(), &numbers(&golden_track["x"]), &place);
            }
        }
    }
}

#[test]
fn global_nearest_finds_the_golden_pairs() {
    let golden = load("gnn");
    for (n, case) in golden.cases.iter().enumerate() {
        let d2 = rows(&case["inputs"]["D2"]);
        let gate = number(&case["inputs"]["gamma"]);
        let mut gates = Gates::new();
        gates.reset(d2.first().map_or(0, Vec::len), 1.0);
        for row in &d2 {
            for (j, d) in row.iter().enumerate().filter(|(_, d)| **d <= gate) {
                gates.push(Pair { detection: j as u32, cost: *d, log_likelihood: 0.0 });
            }
            gates.end_row(Prior { p_detection: 0.9, p_gate: 0.99, existence: 1.0, miss_cost: gate });
        }
        let mut answer = Assignment::new();
        AssociatorConfig::default().build().associate(&gates, &mut answer);
        let ours: Vec<f64> =
            (0..d2.len()).map(|i| answer.row(i).first().map_or(-1.0, |s| f64::from(s.detection))).collect();
        assert_eq!(ours, numbers(&case["outputs"]["assign"]), "case {n}");
    }
}

fn belief(i: &serde_json::Value) -> Gaussian<4> {
    let p: Vec<f64> = rows(&i["P"]).concat();
    Gaussian { mean: Vector4::from_vec(numbers(&i["x"])), cov: Matrix4::from_row_slice(&p) }
}

fn square(v: &serde_json::Value) -> Matrix2<f64> {
    Matrix2::from_row_slice(&rows(v).concat())
}

#[test]
fn probabilistic_data_association_agrees_with_the_golden_vectors() {
    let golden = load("pda");
    for (n, case) in golden.cases.iter().enumerate() {
        let i = &case["inputs"];
        let r = square(&i["R"]);
        let z: Vec<Vector2<f64>> = rows(&i["Z"]).iter().map(|z| Vector2::new(z[0], z[1])).collect();
        let mut filter = ConstantVelocityKf::new(&belief(i), AccelerationNoise::Discrete(1.0));
        let p = filter.predicted();
        let s = p.cov + r;
        let mut gates = Gates::new();
        gates.reset(z.len(), number(&i["lam"]));
        for (j, z) in z.iter().enumerate() {
            let d2 = s.cholesky().unwrap().solve(&(z - p.mean)).dot(&(z - p.mean));
            if d2 <= number(&i["gamma"]) {
                let log_likelihood = -0.5 * d2 - (std::f64::consts::TAU * s.determinant().sqrt()).ln();
                gates.push(Pair { detection: j as u32, cost: d2, log_likelihood });
            }
        }
        gates.end_row(Prior {
            p_detection: number(&i["pd"]),
            p_gate: number(&i["pg"]),
            existence: 1.0,
            miss_cost: 9.21,
        });
        let mut answer = Assignment::new();
        AssociatorConfig::Pda(Default::default()).build().associate(&gates, &mut answer);
        let o = &case["outputs"];
        let gated: Vec<f64> = gates.row(0).iter().map(|p| f64::from(p.detection)).collect();
        assert_eq!(gated, numbers(&o["gated"]), "case {n}");
        let weights: Vec<f64> = answer.row(0).iter().map(|s| s.weight).collect();
        let golden_p = numbers(&o["p"]);
        golden.all_close(&weights, &golden_p[1..], &format!("case {n}: p"));
        golden.close(1.0 - weights.iter().sum::<f64>(), golden_p[0], &format!("case {n}: p0"));
        let weighted: Vec<Weighted> = answer
            .row(0)
            .iter()
            .map(|s| Weighted {
                measurement: Measurement { position: z[s.detection as usize], cov: r },
                weight: s.weight,
            })
            .collect();
        filter.update(&weighted).unwrap();
        let k = filter.kinematics();
        golden.all_close(k.mean.as_slice(), &numbers(&o["x"]), &format!("case {n}: x"));
        golden.all_close(k.cov.transpose().as_slice(), &rows(&o["P"]).concat(), &format!("case {n}: P"));
    }
}
