//! The confirmation gate: what a track must show, beside its confirmation rule, before it is reported as confirmed.
//!
//! Source: our own; docs/theory/track-management.md. Clutter in real scenes persists: a lamp post or a hole in a tree passes every
//! M-of-N. Two things tell a target from it: it stands out more clearly (the detector's score), or it moves. A track passes once it
//! has travelled `min-travel-px` from where it began, or `strong-min-travel-px` if its mean score reaches `strong-score`, and a share
//! of its own size, and was then seen in some scans in a row. Once passed it stays passed.
//! Symbols: score, the detector's own scale; travel, distance of the estimate from the first one (px).
//! Limits: travel is measured in the tracker's coordinates: the ground's (`stabilised.rs`) where the camera's motion is known, else
//! the image's, where clutter travels with a panning camera.

use crate::Result;
use crate::camera::CameraPath;
use crate::validate::not_negative;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a new track must show before it is reported as confirmed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct ConfirmationGateConfig {
    /// Distance from its start that a track must travel, px, 0 or more; 0 opens the gate for every track.
    pub min_travel_px: f64,
    /// Mean score of a track's detections from which it is strong, 0 or more; a strong track needs to travel less.
    pub strong_score: f64,
    /// Distance from its start that a strong track must travel, px, 0 or more, at most `min-travel-px`.
    pub strong_min_travel_px: f64,
    /// What the camera's path since a track's start adds to these distances, times that path, 0 or more: where the camera
    /// turns, its motion is known less exactly, and near things pass far ones.
    pub camera_travel_share: f64,
    /// Scans in a row with a detection that the track must have when it passes, 0 or more: a track that coasted may have taken up
    /// something else.
    pub consecutive_hits: u32,
    /// Share of its longest side that a track must travel at least, 0 or more: the middle of a large thing wanders with its
    /// outline, as clouds and lamp posts do.
    pub size_share: f64,
}

impl ConfirmationGateConfig {
    /// Checks all values; `at` names the place in the configuration.
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        not_negative(at, "strong-score", self.strong_score, "0 takes every track for strong")?;
        not_negative(at, "strong-min-travel-px", self.strong_min_travel_px, "0 opens the gate for strong tracks")?;
        let mend = "0.05 allows for the error of the camera's motion";
        not_negative(at, "camera-travel-share", self.camera_travel_share, mend)?;
        not_negative(at, "size-share", self.size_share, "0.2 asks a thing of 30 px for 6 px")?;
        not_negative(at, "min-travel-px", self.min_travel_px, "0 opens the gate for every track")
    }
}

/// What a track has shown so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GateProgress {
    start: [f64; 2],
    camera: CameraPath,
    score_sum: f64,
    hits: u32,
    consecutive_hits: u32,
    passed: bool,
}

impl GateProgress {
    /// Begins at a position (px) with the first detection's score; `camera` is what the camera did before.
    pub fn begin(position: [f64; 2], camera: CameraPath, score: f32) -> Self {
        Self { start: position, camera, score_sum: f64::from(score), hits: 1, consecutive_hits: 0, passed: false }
    }

    /// Passed from the first: the target was known before.
    pub fn passed() -> Self {
        Self { passed: true, ..Self::default() }
    }

    /// Takes the score of a detection of the track in.
    #[inline]
    pub fn add_score(&mut self, score: f32) {
        self.score_sum += f64::from(score);
        self.hits = self.hits.saturating_add(1);
    }

    /// Whether the track has passed the gate; `position` is the estimate (px) after a scan with (`hit`) or without a detection,
    /// `size` the width and height of its box (px), `camera` what the camera did by then.
    #[inline]
    pub fn passes(
        &mut self,
        config: &ConfirmationGateConfig,
        position: [f64; 2],
        size: [f64; 2],
        camera: CameraPath,
        hit: bool,
    ) -> bool {
        if config.min_travel_px <= 0.0 {
            self.passed = true;
        }
        if hit && self.camera.cuts != camera.cuts {
            // What is seen now may be another thing at another place.
            (self.start, self.camera) = (position, camera);
        }
        self.consecutive_hits = if hit { self.consecutive_hits.saturating_add(1) } else { 0 };
        if !self.passed && hit && self.consecutive_hits >= config.consecutive_hits {
            let travel = (position[0] - self.start[0]).hypot(position[1] - self.start[1]);
            let strong = self.score_sum >= config.strong_score * f64::from(self.hits);
            let least =
                if strong { config.strong_min_travel_px.min(config.min_travel_px) } else { config.min_travel_px };
            let least = least.max(config.size_share * size[0].max(size[1]));
            self.passed = travel >= least + config.camera_travel_share * (camera.length_px - self.camera.length_px);
        }
        self.passed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    fn path(length_px: f64) -> CameraPath {
        let mut path = CameraPath::default();
        path.length_px = length_px;
        path
    }

    #[test]
    fn after_a_cut_the_travel_is_counted_anew() {
        let config = ConfirmationGateConfig {
            strong_score: 9.0,
            strong_min_travel_px: 0.5,
            min_travel_px: 3.0,
            ..ConfirmationGateConfig::default()
        };
        let mut camera = CameraPath::default();
        let mut lamp = GateProgress::begin([10.0, 10.0], camera, 20.0);
        (0..12).for_each(|_| camera.step(Some(Vector2::zeros())));
        assert!(!lamp.passes(&config, [10.1, 10.0], [3.0, 2.0], camera, true));
        camera.step(None);
        assert!(!lamp.passes(&config, [40.0, 10.0], [3.0, 2.0], camera, true), "another lamp in another view");
        assert!(lamp.passes(&config, [40.9, 10.0], [3.0, 2.0], camera, true));
    }

    #[test]
    fn a_strong_track_passes_by_a_small_step_and_a_weak_one_by_a_longer_path() {
        let config = ConfirmationGateConfig {
            strong_score: 9.0,
            strong_min_travel_px: 0.5,
            camera_travel_share: 0.1,
            min_travel_px: 3.0,
            ..ConfirmationGateConfig::default()
        };
        let mut strong = GateProgress::begin([10.0, 10.0], path(7.0), 12.0);
        strong.add_score(11.0);
        assert!(
            !strong.passes(&config, [10.0, 10.0], [3.0, 2.0], path(7.0), true),
            "a lamp is strong, but stands still"
        );
        assert!(strong.passes(&config, [10.6, 10.0], [3.0, 2.0], path(7.0), true));
        let mut weak = GateProgress::begin([10.0, 10.0], path(7.0), 6.0);
        weak.add_score(6.0);
        assert!(!weak.passes(&config, [11.0, 10.0], [3.0, 2.0], path(7.0), true));
        assert!(!weak.passes(&config, [13.5, 10.0], [3.0, 2.0], path(7.0), false), "a prediction shows nothing");
        assert!(weak.passes(&config, [13.5, 10.0], [3.0, 2.0], path(7.0), true));
        assert!(weak.passes(&config, [10.0, 10.0], [3.0, 2.0], path(7.0), true), "passed is passed");
        let mut turned = GateProgress::begin([10.0, 10.0], path(7.0), 12.0);
        assert!(
            !turned.passes(&config, [10.6, 10.0], [3.0, 2.0], path(27.0), true),
            "the camera turned by 20 px: its motion may be 2 px wrong"
        );
        assert!(turned.passes(&config, [12.6, 10.0], [3.0, 2.0], path(27.0), true));
    }

    #[test]
    fn a_large_thing_travels_a_share_of_its_size() {
        let config = ConfirmationGateConfig {
            size_share: 0.15,
            min_travel_px: 2.5,
            strong_min_travel_px: 1.2,
            strong_score: 11.0,
            ..ConfirmationGateConfig::default()
        };
        let (mut cloud, mut bird) =
            (GateProgress::begin([0.0; 2], path(0.0), 30.0), GateProgress::begin([0.0; 2], path(0.0), 30.0));
        assert!(!cloud.passes(&config, [3.0, 0.0], [60.0, 20.0], path(0.0), true), "its outline changes by more");
        assert!(bird.passes(&config, [3.0, 0.0], [6.0, 5.0], path(0.0), true));
        assert!(cloud.passes(&config, [9.1, 0.0], [60.0, 20.0], path(0.0), true));
    }

    #[test]
    fn the_gate_is_passed_with_detections_in_a_row() {
        let config =
            ConfirmationGateConfig { consecutive_hits: 2, min_travel_px: 2.5, ..ConfirmationGateConfig::default() };
        let mut lamp = GateProgress::begin([0.0; 2], path(0.0), 5.0);
        assert!(!lamp.passes(&config, [0.1, 0.0], [3.0; 2], path(0.0), true));
        assert!(!lamp.passes(&config, [4.0, 0.0], [3.0; 2], path(0.0), false), "coasting");
        assert!(!lamp.passes(&config, [5.0, 0.0], [3.0; 2], path(0.0), true), "it may have taken up another lamp");
        assert!(lamp.passes(&config, [5.0, 0.0], [3.0; 2], path(0.0), true));
    }

    #[test]
    fn without_demands_every_track_passes() {
        let config = ConfirmationGateConfig::default();
        assert!(GateProgress::begin([0.0, 0.0], path(0.0), 0.0).passes(
            &config,
            [0.0, 0.0],
            [3.0, 2.0],
            path(5.0),
            false
        ));
    }
}
