//! What every part of a step reads and none changes: the scan, its table, the configuration.

use super::super::config::TrackerConfig;
use super::super::initiation::from_velocity;
use super::super::scan_table::{Cov2, Predicted, ScanTable};
use super::super::score_likelihood::LogScore;
use super::super::single_track::Track;
use super::gate::normalised_square;
use crate::{Scan, Timestamp};
use boresight_filters::Filter;
use nalgebra::{Matrix2, Vector2};

/// What every part of a step reads.
#[derive(Clone, Copy)]
pub(in crate::track) struct Context<'a> {
    pub scan: &'a Scan,
    pub table: &'a ScanTable,
    pub config: &'a TrackerConfig,
    /// Gate threshold γ on d² (no unit).
    pub gate: f64,
    /// Time since the scan before, s.
    pub dt_s: f64,
}

/// Share of the velocities that say nothing, since the target turned while they were measured: a pair that fits but for its velocity is still made where there is no other.
const ODD_VELOCITIES: f64 = 0.01;

/// Where places and velocities stand in `[x, vx, y, vy]`.
const PLACE: [usize; 2] = [0, 2];
const MOTION: [usize; 2] = [1, 3];

/// What a velocity that does not fit costs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::track) enum VelocityCost {
    /// The square of its deviation, χ² with 2 degrees of freedom.
    Square,
    /// −2 ln of its density over that of clutter.
    Likelihood,
}

impl Context<'_> {
    /// Time of the scan.
    pub fn now(&self) -> Timestamp {
        self.scan.time
    }

    /// How long before the scan's time detection `j` was seen, ns.
    #[inline]
    pub fn age_ns(&self, j: u32) -> u64 {
        if self.table.is_timed() { self.scan.detections[j as usize].age_ns } else { 0 }
    }

    /// Where detection `j` counts for a track predicted there (px), and with which noise.
    #[inline]
    pub fn measured(&self, j: u32, at: &Predicted) -> (Vector2<f64>, Cov2) {
        self.table.measured(j, self.scan.detections[j as usize].position, at)
    }

    /// −2 ln of the density of detection `j`'s score for a track; 0 where scores say nothing.
    #[inline]
    pub fn score_cost(&self, track: &Track, j: u32) -> f64 {
        match (&self.config.score_likelihood, self.table.scores.of(j)) {
            (Some(c), Some(score)) => -2.0 * c.target_density(track.log_score, track.history.misses > 0, score).ln(),
            _ => 0.0,
        }
    }

    /// −2 ln of how much likelier detection `j` moves as it does if it is the track's, whose filter stands at the scan, than if it is clutter, whose velocity is
    /// anything up to the largest speed: N(v; v̂, S) π v² with v̂ and S given where it is, but for [`ODD_VELOCITIES`]. 0 where a detection has no velocity.
    pub fn velocity_cost(&self, track: &Track, j: u32, measure: VelocityCost) -> f64 {
        let detection = &self.scan.detections[j as usize];
        let Some(velocity) = detection.velocity.as_ref().filter(|_| self.table.has_velocities()) else { return 0.0 };
        let belief = track.filter.kinematics();
        let noise = self.table.noise(j);
        let measured =
            from_velocity(&detection.position, &noise.matrix(), velocity, self.config.detection_covariance_scale);
        let (innovation, s) = (measured.mean - belief.mean, measured.cov + belief.cov);
        let block = |rows: [usize; 2], columns: [usize; 2]| Matrix2::from_fn(|a, b| s[(rows[a], columns[b])]);
        let at = |rows: [usize; 2]| Vector2::new(innovation[rows[0]], innovation[rows[1]]);
        let Some(inverse) = block(PLACE, PLACE).try_inverse() else { return 0.0 };
        let gain = block(MOTION, PLACE) * inverse;
        let (left, given) = (at(MOTION) - gain * at(PLACE), block(MOTION, MOTION) - gain * block(PLACE, MOTION));
        let d2 = normalised_square(&left, &given);
        let cost = match measure {
            VelocityCost::Square => d2.min(-2.0 * ODD_VELOCITIES.ln()),
            VelocityCost::Likelihood => {
                let cost = d2 + given.determinant().ln() - 2.0 * (0.5 * self.config.max_speed_px_per_s.powi(2)).ln();
                -2.0 * ((1.0 - ODD_VELOCITIES) * (-0.5 * cost).exp() + ODD_VELOCITIES).ln()
            }
        };
        if cost.is_finite() { cost } else { 0.0 }
    }

    /// What a pair may cost by its velocities: another gate of as many degrees of freedom.
    pub fn velocity_budget(&self) -> f64 {
        if self.table.has_velocities() { self.gate } else { 0.0 }
    }

    /// Likelihood ratio of detection `j`'s score for a target not known before the detection with the score `first`, if there is one; 1 where scores say
    /// nothing.
    pub fn new_target_score_ratio(&self, first: Option<LogScore>, j: u32) -> f64 {
        match (&self.config.score_likelihood, self.table.scores.of(j)) {
            (Some(c), Some(score)) => {
                first.map_or(1.0, |first| c.ratio(None, first)) * c.ratio(first.map(|f| f.ln), score)
            }
            _ => 1.0,
        }
    }

    /// Least score of a detection that may initiate a track or is assigned first: −∞ without the two-stage rule.
    pub fn high_score(&self) -> f32 {
        self.config.two_stage.as_ref().map_or(f32::NEG_INFINITY, |c| c.high_score)
    }
}

#[cfg(test)]
mod tests {
    use crate::track::{Tracker, TrackerConfig, Tracking};
    use crate::{DetectedVelocity, Detection, FrameIndex, Scan, Timestamp, TrackId};
    use nalgebra::{Matrix2, Vector2};

    #[test]
    fn where_two_meet_their_velocities_tell_whose_a_detection_is() {
        // They meet after two seconds, and noise has each where the other one is.
        let ids = |has_velocity: bool| {
            let mut tracker = Tracker::new(&TrackerConfig::default()).unwrap();
            let mut seen = Vec::new();
            for k in 0..=4 {
                let t = f64::from(k);
                let mut places = [(20.0 + 10.0 * t, 50.0, 10.0), (60.0 - 10.0 * t, 50.6, -10.0)];
                if k == 2 {
                    (places[0].1, places[1].1) = (50.6, 50.0);
                }
                let detection = |(x, y, v): (f64, f64, f64)| {
                    let mut d = Detection::at(Vector2::new(x, y), Matrix2::identity() * 0.05);
                    let (cov, with_position) = (Matrix2::identity() * 0.1, Matrix2::zeros());
                    // The first ones tell it in either case, so that tracks are as sure.
                    let tells = has_velocity || k == 0;
                    d.velocity = tells.then(|| DetectedVelocity { mean: Vector2::new(v, 0.0), cov, with_position });
                    d
                };
                let scan = Scan::at(FrameIndex(k as u64), Timestamp::from_secs_f64(t));
                let states = tracker.step(&scan.with_detections(places.map(detection).to_vec())).unwrap();
                let of = |j: u32| states.iter().find(|s| s.detection == Some(j)).map(|s| s.id);
                seen.push([of(0), of(1)]);
            }
            seen
        };
        let (first, second) = (Some(TrackId(1)), Some(TrackId(2)));
        assert!(ids(true).iter().all(|i| *i == [first, second]), "{:?}", ids(true));
        assert_eq!(ids(false)[2], [second, first], "without them the nearer one is taken");
    }
}
