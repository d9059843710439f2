//! Initial tracks: targets known before the first scan are confirmed tracks at once (designation).
//!
//! Source: our own; the papers' trackers start from a known state (docs/theory/papers.md). An initial track is a state with its standard
//! deviations some time before the first scan (an operator's designation, a radar's hand-over); it is predicted to the first scan and
//! from then on treated like any confirmed track: gated, updated, coasting, deleted.
//! Symbols: state `[x, vx, y, vy]` px, px/s. Limits: the plain tracker only, not multiple hypotheses; errors of a designation are taken
//! as independent between axes, position and velocity.

use crate::validate::{not_negative, positive};
use crate::{Error, ErrorKind, Result};
use boresight_filters::Gaussian;
use nalgebra::{Matrix4, Vector4};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A target known before the first scan.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct InitialTrackConfig {
    /// Position (x, y), px.
    pub position_px: [f64; 2],
    /// Velocity (x, y), px/s.
    pub velocity_px_per_s: [f64; 2],
    /// Standard deviation of the position, each axis, px, above 0; larger widens the first gate.
    pub position_std_px: f64,
    /// Standard deviation of the velocity, each axis, px/s, above 0.
    pub velocity_std_px_per_s: f64,
    /// How long before the first scan this was true, s, 0 or more.
    pub age_s: f64,
    /// Width and height of the target, px, 0 or more.
    pub size_px: [f64; 2],
}

impl Default for InitialTrackConfig {
    fn default() -> Self {
        Self {
            position_px: [0.0; 2],
            velocity_px_per_s: [0.0; 2],
            position_std_px: 3.0,
            velocity_std_px_per_s: 10.0,
            age_s: 0.0,
            size_px: [10.0; 2],
        }
    }
}

impl InitialTrackConfig {
    /// Checks all values; `at` names the place in the configuration.
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        for v in self.position_px.iter().chain(&self.velocity_px_per_s) {
            if !v.is_finite() {
                let e = Error::new(ErrorKind::Config, "expected a finite number");
                return Err(e.at(format!("{at} = {v}")).hint("position-px = [x, y], velocity-px-per-s = [vx, vy]"));
            }
        }
        positive(at, "position-std-px", self.position_std_px, "3 px is a careful click")?;
        positive(at, "velocity-std-px-per-s", self.velocity_std_px_per_s, "the target's speed, if nothing is known")?;
        not_negative(at, "age-s", self.age_s, "0: true at the first scan")?;
        for side in self.size_px {
            not_negative(at, "size-px", side, "the target's width and height")?;
        }
        Ok(())
    }

    /// The state as a Gaussian.
    pub(super) fn belief(&self) -> Gaussian<4> {
        let ([x, y], [vx, vy]) = (self.position_px, self.velocity_px_per_s);
        let (p, v) = (self.position_std_px.powi(2), self.velocity_std_px_per_s.powi(2));
        Gaussian { mean: Vector4::new(x, vx, y, vy), cov: Matrix4::from_diagonal(&Vector4::new(p, v, p, v)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::track::{MhtConfig, TrackerConfig, build};
    use crate::{Detection, Extent, FrameIndex, Scan, Timestamp, TrackStatus};
    use nalgebra::{Matrix2, Vector2};

    fn scan(k: i64, at: Option<f64>) -> Scan {
        let detections = at.map(|x| {
            Detection::at(Vector2::new(x, 5.0), Matrix2::identity() * 0.1)
                .with_extent(Extent { left_px: x - 2.0, top_px: 3.0, width_px: 4.0, height_px: 4.0 })
                .with_area_px(16)
        });
        Scan::at(FrameIndex::default(), Timestamp::from_ns(k * 1_000_000_000))
            .with_detections(detections.into_iter().collect())
    }

    fn config() -> TrackerConfig {
        let initial = InitialTrackConfig {
            position_px: [8.0, 5.0],
            velocity_px_per_s: [1.0, 0.0],
            age_s: 2.0,
            ..InitialTrackConfig::default()
        };
        TrackerConfig {
            acceleration_std_px_per_s2: Some(0.1),
            initial_tracks: vec![initial],
            ..TrackerConfig::default()
        }
    }

    #[test]
    fn an_initial_track_is_a_confirmed_track_in_the_first_scan() {
        let mut tracker = build(&config()).unwrap();
        let first = tracker.step(&scan(0, Some(10.3))).unwrap();
        assert_eq!((first.len(), first[0].id.0, first[0].status), (1, 1, TrackStatus::Confirmed));
        assert!((first[0].kinematics.mean[0] - 10.3).abs() < 0.1, "{:?}", first[0].kinematics.mean);
    }

    #[test]
    fn an_initial_track_without_a_detection_coasts_from_where_it_was_predicted_and_ends_as_any_track() {
        let mut tracker = build(&config()).unwrap();
        let first = tracker.step(&scan(0, None)).unwrap();
        assert_eq!(first[0].status, TrackStatus::Coasting);
        assert!((first[0].kinematics.mean[0] - 10.0).abs() < 1e-9);
        let last = (1..30).map(|k| tracker.step(&scan(k, None)).unwrap().len()).last();
        assert_eq!(last, Some(0));
    }

    #[test]
    fn a_wrong_initial_track_is_refused_with_its_place() {
        let mut c = config();
        c.initial_tracks[0].position_std_px = 0.0;
        assert!(c.validate("tracker").unwrap_err().to_string().contains("tracker.initial-tracks[0].position-std-px"));
        let c = TrackerConfig { mht: Some(MhtConfig::default()), ..config() };
        assert!(c.validate("tracker").unwrap_err().to_string().contains("tracker.initial-tracks"));
    }
}
