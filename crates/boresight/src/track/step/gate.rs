//! Gate: from a predicted track and a scan to the sparse row of detections that can be the track's.
//!
//! Source: docs/theory/association.md: d² = νᵀ S⁻¹ ν ≤ γ, S = H P Hᵀ + R, with the R of each detection.
//! Method: a grid over the detections hands out candidates in the rectangle that holds the gate's ellipse (pre-gate); the
//! ellipse decides. A gate that has grown while its track coasted is cut to what the largest speed allows.
//! Limits: [`MOST_LOOKED_AT`] candidates are looked at per track and the `max_gated` nearest kept, so that 10⁵ detections
//! in one pixel cost bounded time and memory.

use super::super::scan_table::{Cov2, MOST_LOOKED_AT, Predicted, ScanTable};
use crate::associate::{Gates, Pair};
use nalgebra::{Matrix2, Vector2};

/// ln 2π.
const LN_2PI: f64 = 1.837_877_066_409_345_5;

/// Adds the pairs of one track to the open row of `gates`: those with d² ≤ `gate` that `free` lets pass.
/// `extra_cost` returns what a pair of the predicted track and a detection costs beside position (0 if nothing).
#[inline]
pub fn gate_row(
    table: &ScanTable,
    track: &Predicted,
    gate: f64,
    max_gated: usize,
    likelihood: bool,
    free: impl Fn(u32) -> bool,
    extra_cost: impl Fn(&Predicted, u32) -> f64,
    gates: &mut Gates,
) {
    let (half_x, half_y) = table.half_sides(track, gate);
    let mut looked_at = 0;
    let mut gated = 0;
    table.grid().near(track.x, track.y, half_x, half_y, |p| {
        looked_at += 1;
        let (dx, dy) = (p.x - track.x, p.y - track.y);
        if dx.abs() <= half_x && dy.abs() <= half_y && free(p.index) {
            let (z, r) = table.measured(p.index, Vector2::new(p.x, p.y), track);
            if let Some(pair) = pair(track, [z.x - track.x, z.y - track.y], &r, p.index, gate, likelihood, &extra_cost)
            {
                gates.push(pair);
                gated += 1;
            }
        }
        looked_at < MOST_LOOKED_AT
    });
    keep_nearest(gates, gated, max_gated);
}

/// The pair of a track and a detection that lies `[dx, dy]` from it, if it is in the gate.
#[inline(always)]
pub(super) fn pair(
    track: &Predicted,
    [dx, dy]: [f64; 2],
    r: &Cov2,
    detection: u32,
    gate: f64,
    likelihood: bool,
    extra_cost: &impl Fn(&Predicted, u32) -> f64,
) -> Option<Pair> {
    let (sxx, sxy, syy) = (track.cov.xx + r.xx, track.cov.xy + r.xy, track.cov.yy + r.yy);
    let det = sxx * syy - sxy * sxy;
    let distance2 = (dx * (syy * dx - sxy * dy) + dy * (sxx * dy - sxy * dx)) / det;
    if distance2 <= gate && dx * dx + dy * dy <= track.reach * track.reach {
        let cost = distance2 + extra_cost(track, detection);
        if cost.is_infinite() {
            return None;
        }
        let log_likelihood = if likelihood { -0.5 * (cost + det.ln()) - LN_2PI } else { 0.0 };
        return Some(Pair { detection, cost, log_likelihood });
    }
    None
}

/// Ends the open row of `gated` pairs: the `max_gated` nearest in the order of the scan.
pub(super) fn keep_nearest(gates: &mut Gates, gated: usize, max_gated: usize) {
    if gated > 1 {
        let row = gates.open_row();
        if gated > max_gated {
            row.sort_unstable_by(|a, b| a.cost.total_cmp(&b.cost).then(a.detection.cmp(&b.detection)));
            gates.truncate_open_row(max_gated);
        }
        gates.open_row().sort_unstable_by_key(|p| p.detection);
    }
}

/// Innovation covariance of a track and a detection, px².
pub fn innovation_cov(track: &Predicted, r: &Cov2) -> Matrix2<f64> {
    track.cov.matrix() + r.matrix()
}

/// νᵀ S⁻¹ ν (no unit).
pub fn normalised_square(nu: &Vector2<f64>, s: &Matrix2<f64>) -> f64 {
    let det = s.determinant();
    (nu.x * (s[(1, 1)] * nu.x - s[(0, 1)] * nu.y) + nu.y * (s[(0, 0)] * nu.y - s[(0, 1)] * nu.x)) / det
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::associate::{Assignment, AssociatorConfig, Prior};
    use crate::golden_file::{load, number, numbers, rows};
    use crate::track::AccelerationNoise;
    use crate::track::filter::ConstantVelocityKf;
    use crate::{Detection, Scan};
    use boresight_filters::{Filter, Gaussian};
    use nalgebra::{Matrix4, Vector4};
    use std::cell::Cell;

    fn belief(i: &serde_json::Value) -> Gaussian<4> {
        let p: Vec<f64> = rows(&i["P"]).concat();
        Gaussian { mean: Vector4::from_vec(numbers(&i["x"])), cov: Matrix4::from_row_slice(&p) }
    }

    fn square(v: &serde_json::Value) -> Matrix2<f64> {
        Matrix2::from_row_slice(&rows(v).concat())
    }

    #[test]
    fn gate_and_nearest_neighbour_agree_with_the_golden_vectors() {
        let golden = load("gate_nn");
        for (n, case) in golden.cases.iter().enumerate() {
            let i = &case["inputs"];
            let r = square(&i["R"]);
            let scan = Scan {
                detections: rows(&i["Z"]).iter().map(|z| Detection::at(Vector2::new(z[0], z[1]), r)).collect(),
                ..Scan::default()
            };
            let p = ConstantVelocityKf::new(&belief(i), AccelerationNoise::Discrete(1.0)).predicted();
            let track = Predicted::of(&p, f64::INFINITY);
            let mut table = ScanTable::default();
            table.read(&scan, 1.0, 0.0, 0.0).unwrap();
            table.sort(&scan);
            let gamma = number(&i["gamma"]);
            let gates_to = |threshold: f64| {
                let mut gates = Gates::new();
                gates.reset(scan.detections.len(), 1.0);
                gate_row(&table, &track, threshold, 64, true, |_| true, |_, _| 0.0, &mut gates);
                gates.end_row(Prior { p_detection: 0.9, p_gate: 0.99, existence: 1.0, miss_cost: threshold });
                gates
            };
            let all = gates_to(1e9);
            let ours: Vec<f64> = all.row(0).iter().map(|p| p.cost).collect();
            golden.all_close(&ours, &numbers(&case["outputs"]["d2"]), &format!("case {n}: d2"));
            let s = innovation_cov(&track, &Cov2 { xx: r[(0, 0)], xy: r[(0, 1)], yy: r[(1, 1)] });
            golden.all_close(s.transpose().as_slice(), &rows(&case["outputs"]["S"]).concat(), &format!("case {n}: S"));
            let mut answer = Assignment::new();
            AssociatorConfig::Nearest(Default::default()).build().associate(&gates_to(gamma), &mut answer);
            let nearest = answer.row(0).first().map_or(-1.0, |s| f64::from(s.detection));
            assert_eq!(nearest, number(&case["outputs"]["nearest"]), "case {n}");
        }
    }

    /// The row of a track at the origin with variance 1 px² against detections at these places with variance 1 px².
    fn row(places: &[(f64, f64)], gate: f64, max_gated: usize, reach: f64) -> (Vec<Pair>, usize) {
        let detections =
            places.iter().map(|p| Detection::at(Vector2::new(p.0, p.1), Matrix2::identity())).collect::<Vec<_>>();
        let scan = Scan { detections, ..Scan::default() };
        let mut table = ScanTable::default();
        table.read(&scan, 1.0, 0.0, 0.0).unwrap();
        table.sort(&scan);
        let track = Predicted { x: 0.0, y: 0.0, cov: Cov2 { xx: 1.0, xy: 0.0, yy: 1.0 }, reach };
        let mut gates = Gates::new();
        gates.reset(places.len(), 1.0);
        let asked = Cell::new(0);
        let free = |_| {
            asked.set(asked.get() + 1);
            true
        };
        gate_row(&table, &track, gate, max_gated, true, free, |_, _| 0.0, &mut gates);
        gates.end_row(Prior { p_detection: 1.0, p_gate: 1.0, existence: 1.0, miss_cost: gate });
        (gates.row(0).to_vec(), asked.get())
    }

    #[test]
    fn the_ellipse_decides_and_the_largest_speed_cuts_it() {
        // S = 2 I: d² = r² / 2, so a gate of 8 reaches to 4 px.
        let places = [(3.99, 0.0), (4.01, 0.0), (0.0, -2.0), (2.9, 2.9)];
        let gated = |reach| row(&places, 8.0, 9, reach).0.iter().map(|p| (p.detection, p.cost)).collect::<Vec<_>>();
        assert_eq!(gated(f64::INFINITY).iter().map(|g| g.0).collect::<Vec<_>>(), [0, 2]);
        assert!((gated(f64::INFINITY)[1].1 - 2.0).abs() < 1e-12);
        assert_eq!(gated(3.0).iter().map(|g| g.0).collect::<Vec<_>>(), [2]);
    }

    #[test]
    fn the_log_likelihood_is_that_of_a_gaussian() {
        // −d²/2 − ln det S / 2 − ln 2π = −1 − ln 2 − 1.837877 for d² = 2, det S = 4.
        let (pairs, _) = row(&[(0.0, 2.0)], 8.0, 9, f64::INFINITY);
        assert!((pairs[0].log_likelihood + 1.0 + 2f64.ln() + 1.837_877_066).abs() < 1e-9);
    }

    #[test]
    fn the_nearest_are_kept_in_the_order_of_the_scan() {
        let places = [(1.0, 0.0), (0.1, 0.0), (0.5, 0.0), (0.2, 0.0)];
        let kept: Vec<u32> = row(&places, 9.0, 2, f64::INFINITY).0.iter().map(|p| p.detection).collect();
        assert_eq!(kept, [1, 3]);
    }

    #[test]
    fn a_hundred_thousand_detections_in_one_pixel_cost_a_bounded_search() {
        let places: Vec<_> = (0..100_000u32).map(|i| (f64::from(i % 7) * 0.1, 0.0)).collect();
        let (pairs, asked) = row(&places, 9.0, 64, f64::INFINITY);
        assert_eq!((pairs.len(), asked), (64, MOST_LOOKED_AT));
    }
}
