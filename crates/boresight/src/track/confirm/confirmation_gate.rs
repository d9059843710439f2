//! Proof: what a track must show, beside its life's rule, before it is reported as confirmed.
//!
//! Source: our own. Clutter in real scenes persists: a lamp post or a hole in a tree passes every M-of-N. Two things tell a target
//! from it: it stands out more clearly (the detector's score), or it moves. A track is proven once it has travelled
//! `travel-px` from where it began, or `sure-travel-px` if its mean score reaches `sure-score`, and a share of its own size,
//! and was then seen in some scans in a row; until then it is tentative for everyone outside, while it is associated and
//! kept like a confirmed one.
//! Symbols: score, the detector's own scale; travel distance of the estimate from the first one (px).
//! Limits: travel is measured in the tracker's coordinates: steadied ones (`stabilised.rs`) where the camera's motion is known, else the
//! image's, where clutter travels with a panning camera.

use crate::Result;
use crate::camera::CameraPath;
use crate::validate::not_negative;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a new track must show before it is reported as confirmed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct ProofConfig {
    /// Least score of a detection that starts a track, 0 or more; weaker ones only continue tracks. 0 asks for no score: some
    /// detectors give negative ones.
    pub start_score: f64,
    /// Mean score of a track's detections from which it is sure to be a thing, 0 or more; it then needs to travel less.
    pub sure_score: f64,
    /// Distance from its start that proves a sure track, px, 0 or more, at most `travel-px`.
    pub sure_travel_px: f64,
    /// What the camera's way since a track's start adds to the distances asked for, times that way, 0 or more: where the camera
    /// turns, its motion is known less exactly, and near things pass far ones.
    pub camera_share: f64,
    /// Scans in a row with a detection by which a proof must end, 0 or more: a track that coasted may take up another thing.
    pub hits_in_a_row: u32,
    /// Share of its longest side that a track must travel at least, 0 or more: the middle of a large thing wanders with its
    /// outline, as clouds and lamp posts do.
    pub size_share: f64,
    /// Distance from its start that proves any other track, px, 0 or more; 0 asks for no proof.
    pub travel_px: f64,
}

impl ProofConfig {
    /// Checks all values; `at` names the place in the configuration.
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        not_negative(at, "start-score", self.start_score, "0 lets every detection start a track")?;
        not_negative(at, "sure-score", self.sure_score, "0 proves every track at once")?;
        not_negative(at, "sure-travel-px", self.sure_travel_px, "0 proves sure tracks at once")?;
        not_negative(at, "camera-share", self.camera_share, "0.05 allows for the error of the camera's motion")?;
        not_negative(at, "size-share", self.size_share, "0.2 asks a thing of 30 px for 6 px")?;
        not_negative(at, "travel-px", self.travel_px, "0 asks for no proof")
    }

    /// Whether a detection of this score may start a track.
    #[inline]
    pub fn may_start(&self, score: f32) -> bool {
        self.start_score <= 0.0 || f64::from(score) >= self.start_score
    }
}

/// What a track has shown so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Proof {
    start: [f64; 2],
    camera: CameraPath,
    score_sum: f64,
    hits: u32,
    in_a_row: u32,
    proven: bool,
}

impl Proof {
    /// Begins at a position (px) with the first detection's score; `camera` is what the camera did before.
    pub fn begin(position: [f64; 2], camera: CameraPath, score: f32) -> Self {
        Self { start: position, camera, score_sum: f64::from(score), hits: 1, in_a_row: 0, proven: false }
    }

    /// Nothing to prove: the target was known before.
    pub fn given() -> Self {
        Self { proven: true, ..Self::default() }
    }

    /// Takes the score of a detection of the track in.
    #[inline]
    pub fn seen(&mut self, score: f32) {
        self.score_sum += f64::from(score);
        self.hits = self.hits.saturating_add(1);
    }

    /// Whether the track is proven; `position` is the estimate (px) after a scan with (`hit`) or without a detection,
    /// `size` the width and height of its box (px), `camera` what the camera did by then.
    #[inline]
    pub fn holds(
        &mut self,
        config: &ProofConfig,
        position: [f64; 2],
        size: [f64; 2],
        camera: CameraPath,
        hit: bool,
    ) -> bool {
        if config.travel_px <= 0.0 {
            self.proven = true;
        }
        if hit && self.camera.cuts != camera.cuts {
            // What is seen now may be another thing at another place.
            (self.start, self.camera) = (position, camera);
        }
        self.in_a_row = if hit { self.in_a_row.saturating_add(1) } else { 0 };
        if !self.proven && hit && self.in_a_row >= config.hits_in_a_row {
            let travel = (position[0] - self.start[0]).hypot(position[1] - self.start[1]);
            let sure = self.score_sum >= config.sure_score * f64::from(self.hits);
            let least = if sure { config.sure_travel_px.min(config.travel_px) } else { config.travel_px };
            let least = least.max(config.size_share * size[0].max(size[1]));
            self.proven = travel >= least + config.camera_share * (camera.length_px - self.camera.length_px);
        }
        self.proven
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    fn way(length_px: f64) -> CameraPath {
        let mut path = CameraPath::default();
        path.length_px = length_px;
        path
    }

    #[test]
    fn without_a_least_score_every_detection_starts_a_track() {
        // Scores of the public MOT17 detections by DPM go below 0.
        assert!(ProofConfig::default().may_start(-0.3));
        assert!(!ProofConfig { start_score: 0.1, ..ProofConfig::default() }.may_start(-0.3));
    }

    #[test]
    fn a_cut_asks_for_the_proof_anew() {
        let config = ProofConfig { sure_score: 9.0, sure_travel_px: 0.5, travel_px: 3.0, ..ProofConfig::default() };
        let mut camera = CameraPath::default();
        let mut lamp = Proof::begin([10.0, 10.0], camera, 20.0);
        (0..12).for_each(|_| camera.step(Some(Vector2::zeros())));
        assert!(!lamp.holds(&config, [10.1, 10.0], [3.0, 2.0], camera, true));
        camera.step(None);
        assert!(!lamp.holds(&config, [40.0, 10.0], [3.0, 2.0], camera, true), "another lamp in another view");
        assert!(lamp.holds(&config, [40.9, 10.0], [3.0, 2.0], camera, true));
    }

    #[test]
    fn a_clear_target_is_proven_by_a_small_step_and_a_dim_one_by_a_longer_way() {
        let config = ProofConfig {
            start_score: 5.0,
            sure_score: 9.0,
            sure_travel_px: 0.5,
            camera_share: 0.1,
            travel_px: 3.0,
            ..ProofConfig::default()
        };
        let mut clear = Proof::begin([10.0, 10.0], way(7.0), 12.0);
        clear.seen(11.0);
        assert!(!clear.holds(&config, [10.0, 10.0], [3.0, 2.0], way(7.0), true), "a lamp is clear, but stands still");
        assert!(clear.holds(&config, [10.6, 10.0], [3.0, 2.0], way(7.0), true));
        let mut dim = Proof::begin([10.0, 10.0], way(7.0), 6.0);
        dim.seen(6.0);
        assert!(!dim.holds(&config, [11.0, 10.0], [3.0, 2.0], way(7.0), true));
        assert!(!dim.holds(&config, [13.5, 10.0], [3.0, 2.0], way(7.0), false), "a prediction proves nothing");
        assert!(dim.holds(&config, [13.5, 10.0], [3.0, 2.0], way(7.0), true));
        assert!(dim.holds(&config, [10.0, 10.0], [3.0, 2.0], way(7.0), true), "a proof is kept");
        let mut turned = Proof::begin([10.0, 10.0], way(7.0), 12.0);
        assert!(
            !turned.holds(&config, [10.6, 10.0], [3.0, 2.0], way(27.0), true),
            "the camera turned by 20 px: its motion may be 2 px wrong"
        );
        assert!(turned.holds(&config, [12.6, 10.0], [3.0, 2.0], way(27.0), true));
        assert!(config.may_start(5.0) && !config.may_start(4.9));
    }

    #[test]
    fn a_large_thing_travels_a_share_of_its_size() {
        let config = ProofConfig {
            size_share: 0.15,
            travel_px: 2.5,
            sure_travel_px: 1.2,
            sure_score: 11.0,
            ..ProofConfig::default()
        };
        let (mut cloud, mut bird) = (Proof::begin([0.0; 2], way(0.0), 30.0), Proof::begin([0.0; 2], way(0.0), 30.0));
        assert!(!cloud.holds(&config, [3.0, 0.0], [60.0, 20.0], way(0.0), true), "its outline changes by more");
        assert!(bird.holds(&config, [3.0, 0.0], [6.0, 5.0], way(0.0), true));
        assert!(cloud.holds(&config, [9.1, 0.0], [60.0, 20.0], way(0.0), true));
    }

    #[test]
    fn a_proof_ends_with_detections_in_a_row() {
        let config = ProofConfig { hits_in_a_row: 2, travel_px: 2.5, ..ProofConfig::default() };
        let mut lamp = Proof::begin([0.0; 2], way(0.0), 5.0);
        assert!(!lamp.holds(&config, [0.1, 0.0], [3.0; 2], way(0.0), true));
        assert!(!lamp.holds(&config, [4.0, 0.0], [3.0; 2], way(0.0), false), "coasting");
        assert!(!lamp.holds(&config, [5.0, 0.0], [3.0; 2], way(0.0), true), "it may have taken up another lamp");
        assert!(lamp.holds(&config, [5.0, 0.0], [3.0; 2], way(0.0), true));
    }

    #[test]
    fn without_demands_every_track_is_proven() {
        let config = ProofConfig::default();
        assert!(Proof::begin([0.0, 0.0], way(0.0), 0.0).holds(&config, [0.0, 0.0], [3.0, 2.0], way(5.0), false));
    }
}
