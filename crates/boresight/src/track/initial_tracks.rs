//! Cues: targets known before the first scan become confirmed tracks at once.
//!
//! Source: our own; the papers' trackers start from a known state. A cue is a state with its standard deviations some
//! time before the first scan (an operator's designation, a radar's hand-over); it is predicted to the first scan and then lives
//! like any confirmed track: gated, corrected, coasting, deleted.
//! Symbols: state `[x, vx, y, vy]` px, px/s. Limits: the plain tracker only, not multiple hypotheses; errors of a cue are taken as
//! independent between axes, position and velocity.

use super::association_cost::Look;
use super::config::TrackerConfig;
use super::confirm::confirmation_gate::Proof;
use super::single_track::Track;
use super::tracker::Tracker;
use crate::validate::{not_negative, positive};
use crate::{Error, ErrorKind, Result, Timestamp};
use boresight_filters::{Filter, Gaussian};
use nalgebra::{Matrix4, Vector4};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A target known before the first scan.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct CueConfig {
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

impl Default for CueConfig {
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

impl CueConfig {
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

    fn belief(&self) -> Gaussian<4> {
        let ([x, y], [vx, vy]) = (self.position_px, self.velocity_px_per_s);
        let (p, v) = (self.position_std_px.powi(2), self.velocity_std_px_per_s.powi(2));
        Gaussian { mean: Vector4::new(x, vx, y, vy), cov: Matrix4::from_diagonal(&Vector4::new(p, v, p, v)) }
    }
}

/// Refuses cues that the configured tracker cannot take; `at` names the place in the configuration (`tracker`).
pub(super) fn validate(config: &TrackerConfig, at: &str) -> Result<()> {
    for (i, cue) in config.cues.iter().enumerate() {
        cue.validate(&format!("{at}.cues[{i}]"))?;
    }
    if config.mht.is_some() && !config.cues.is_empty() {
        let e = Error::new(ErrorKind::Config, "multiple hypotheses take no cues").at(format!("{at}.cues"));
        return Err(e.hint("leave out `mht`, or the cues"));
    }
    Ok(())
}

impl Tracker {
    /// Makes the cues confirmed tracks at the time of the first scan.
    pub(super) fn take_cues(&mut self, now: Timestamp) -> Result<()> {
        for cue in &self.config.cues {
            let mut belief = self.config.belief(&cue.belief(), cue.size_px[1])?;
            belief.predict(cue.age_s)?;
            let k = belief.kinematics();
            let mut life = self.config.life.begin(2, now.ns, self.config.clutter_density_per_px2, 1.0);
            life.confirmed = true;
            // Reach of the first gate: where it can be, and where its detection can then lie.
            let spread = k.cov[(0, 0)].max(k.cov[(2, 2)]).sqrt() + self.config.extra_noise_px;
            self.tracks.push(Track {
                id: self.next_id,
                belief,
                life,
                look: Look { size: cue.size_px, sum: 0.0, class: None },
                twin_since_ns: None,
                anchor: [k.mean[0], k.mean[2], spread],
                proof: Proof::given(),
            });
            self.next_id += 1;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::track::{MhtConfig, build};
    use crate::{Detection, Extent, Scan, TrackStatus};
    use nalgebra::{Matrix2, Vector2};

    fn scan(k: i64, at: Option<f64>) -> Scan {
        let detections = at.map(|x| Detection {
            position: Vector2::new(x, 5.0),
            cov: Matrix2::identity() * 0.1,
            extent: Extent { left_px: x - 2.0, top_px: 3.0, width_px: 4.0, height_px: 4.0 },
            area_px: 16,
            peak: 1.0,
            sum: 1.0,
            score: 1.0,
            class: None,
        });
        Scan {
            time: Timestamp::from_ns(k * 1_000_000_000),
            detections: detections.into_iter().collect(),
            ..Scan::default()
        }
    }

    fn config() -> TrackerConfig {
        let cue =
            CueConfig { position_px: [8.0, 5.0], velocity_px_per_s: [1.0, 0.0], age_s: 2.0, ..CueConfig::default() };
        TrackerConfig { acceleration_std_px_per_s2: 0.1, cues: vec![cue], ..TrackerConfig::default() }
    }

    #[test]
    fn a_cue_is_a_confirmed_track_in_the_first_scan() {
        let mut tracker = build(&config()).unwrap();
        let first = tracker.step(&scan(0, Some(10.3))).unwrap();
        assert_eq!((first.len(), first[0].id.0, first[0].status), (1, 1, TrackStatus::Confirmed));
        assert!((first[0].kinematics.mean[0] - 10.3).abs() < 0.1, "{:?}", first[0].kinematics.mean);
    }

    #[test]
    fn a_cue_without_a_detection_coasts_from_where_it_was_predicted_and_ends_as_any_track() {
        let mut tracker = build(&config()).unwrap();
        let first = tracker.step(&scan(0, None)).unwrap();
        assert_eq!(first[0].status, TrackStatus::Coasting);
        assert!((first[0].kinematics.mean[0] - 10.0).abs() < 1e-9);
        let last = (1..30).map(|k| tracker.step(&scan(k, None)).unwrap().len()).last();
        assert_eq!(last, Some(0));
    }

    #[test]
    fn a_wrong_cue_is_refused_with_its_place() {
        let mut c = config();
        c.cues[0].position_std_px = 0.0;
        assert!(c.validate("tracker").unwrap_err().to_string().contains("tracker.cues[0].position-std-px"));
        let c = TrackerConfig { mht: Some(MhtConfig::default()), ..config() };
        assert!(c.validate("tracker").unwrap_err().to_string().contains("tracker.cues"));
    }
}
