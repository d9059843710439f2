//! What a radar's biases are found from: ships' own reports (AIS) as tracks, and the plots that a radar's tracks took.
//!
//! Source: our own. A report is taken as right to [`REPORT_STD_M`]; between two reports of a ship that lie no farther apart, it was where they say.
//! Plots have independent errors, the states of a track have not: biases are found from plots.
//! Limits: velocities between reports are straight lines.

use super::timeline::Timeline;
use crate::{Scan, TrackId, TrackState, TrackStatus};
use boresight_filters::Gaussian;
use nalgebra::{Matrix4, Vector4};

/// Standard deviation of a ship's report: the length of a ship, and a second of its way, m.
pub const REPORT_STD_M: f64 = 30.0;

/// Reports of a ship that hardly moved come every few minutes: it was there in between, at every so many seconds.
const BERTH_S: f64 = 20.0;

/// Reports with those added between two that lie no further apart than they are right.
fn with_berths(reports: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let mut out = Vec::with_capacity(reports.len());
    for (i, b) in reports.iter().enumerate() {
        if let Some(a) = i.checked_sub(1).map(|i| reports[i])
            && (b[1] - a[1]).hypot(b[2] - a[2]) < REPORT_STD_M
            && b[0] - a[0] < 600.0
        {
            let n = ((b[0] - a[0]) / BERTH_S).ceil().max(1.0);
            out.extend((1..n as u32).map(|k| [0, 1, 2].map(|j| a[j] + (b[j] - a[j]) * f64::from(k) / n)));
        }
        out.push(*b);
    }
    out
}

/// A ship's reports (time s, x, y m; in order of time) as a track.
pub fn timeline_of_reports(id: TrackId, reports: &[[f64; 3]]) -> Timeline {
    let r = with_berths(reports);
    let velocity = |i: usize| {
        let (a, b) = (r[i.saturating_sub(1)], r[(i + 1).min(r.len() - 1)]);
        if b[0] > a[0] { [(b[1] - a[1]) / (b[0] - a[0]), (b[2] - a[2]) / (b[0] - a[0])] } else { [0.0; 2] }
    };
    let cov = Matrix4::from_diagonal(&Vector4::new(REPORT_STD_M.powi(2), 1.0, REPORT_STD_M.powi(2), 1.0));
    let point = |(i, at): (usize, &[f64; 3])| {
        let v = velocity(i);
        (at[0], Gaussian { mean: Vector4::new(at[1], v[0], at[2], v[1]), cov })
    };
    Timeline { id, points: r.iter().enumerate().map(point).collect(), size: [0.0; 2] }
}

/// The plots that each track took while it was confirmed, with the covariances that the tracker gave them.
pub fn plots_taken(
    tracks: &[Timeline],
    states: &[(f64, Vec<TrackState>)],
    scans: &[Scan],
    scale: f64,
) -> Vec<Timeline> {
    let of = |track: &Timeline| {
        let mut plots = Timeline { id: track.id, points: Vec::new(), size: [0.0; 2] };
        for ((time_s, now), scan) in states.iter().zip(scans) {
            let Some(s) = now.iter().find(|s| s.id == track.id && s.status != TrackStatus::Tentative) else { continue };
            let Some(d) = s.detection.and_then(|j| scan.detections.get(j as usize)) else { continue };
            let mut belief = s.kinematics;
            (belief.mean[0], belief.mean[2]) = (d.position.x, d.position.y);
            for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                belief.cov[(2 * i, 2 * j)] = scale * d.cov[(i, j)];
            }
            plots.points.push((*time_s - d.age_ns as f64 * 1e-9, belief));
        }
        plots
    };
    tracks.iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ship_at_its_berth_is_there_between_its_reports_and_one_that_sails_is_not() {
        let lies = timeline_of_reports(TrackId(1), &[[0.0, 5.0, 5.0], [100.0, 15.0, 5.0]]);
        let at: Vec<[f64; 2]> = lies.points.iter().map(|(t, b)| [*t, b.mean[0]]).collect();
        assert_eq!(at, [[0.0, 5.0], [20.0, 7.0], [40.0, 9.0], [60.0, 11.0], [80.0, 13.0], [100.0, 15.0]]);
        assert!(lies.points.iter().all(|(_, b)| (b.mean[1] - 0.1).abs() < 1e-12), "10 m in 100 s");
        let sails = timeline_of_reports(TrackId(1), &[[0.0, 0.0, 0.0], [100.0, 500.0, 0.0]]);
        assert_eq!(sails.points.len(), 2);
        assert!(timeline_of_reports(TrackId(1), &[]).points.is_empty());
    }
}
