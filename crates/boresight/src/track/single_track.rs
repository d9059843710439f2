//! One living track: what it carries from scan to scan, and what is said of it after each.

use super::association_cost::Look;
use super::config::TrackerConfig;
use super::confirm::confirmation_gate::Proof;
use super::confirm::rule::Life;
use super::filter::Belief;
use super::step::gate::Noise;
use crate::camera::CameraPath;
use crate::record::Innovation;
use crate::{Detection, Extent, Timestamp, TrackId, TrackState, TrackStatus};
use boresight_filters::{Filter, Gaussian};

/// One living track.
#[derive(Clone)]
pub(super) struct Track {
    pub id: u64,
    pub belief: Belief,
    pub life: Life,
    pub look: Look,
    /// Since when it follows the same detections as an older track, ns.
    pub twin_since_ns: Option<i64>,
    /// Where it was at its last detection, and how sure (standard deviation), px: the centre of its possible reach.
    pub anchor: [f64; 3],
    /// What it has shown beside its life's rule.
    pub proof: Proof,
}

/// What one scan brought a track.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Outcome {
    pub hit: bool,
    /// The detection is shared with other tracks.
    pub shared: bool,
    /// And another of them fits it better.
    pub guest: bool,
    /// The detection of the largest weight.
    pub detection: Option<u32>,
    /// Λ of the scan.
    pub ratio: f64,
    pub innovation: Option<Innovation>,
}

impl Track {
    /// Whether the track has followed the same detections as an older one for `longest_s`.
    pub(super) fn is_lasting_twin(
        &mut self,
        owner: &mut [bool],
        outcome: &Outcome,
        now: Timestamp,
        longest_s: f64,
    ) -> bool {
        let Some(j) = outcome.detection else { return false };
        if !std::mem::replace(&mut owner[j as usize], true) {
            self.twin_since_ns = None;
            return false;
        }
        let since = *self.twin_since_ns.get_or_insert(now.ns);
        now.seconds_since(Timestamp::from_ns(since)) >= longest_s
    }

    /// Takes in the box and place of a detection that is (most likely) its own.
    #[inline]
    pub(super) fn seen(&mut self, d: &Detection, noise: &Noise, look_gain: f64) {
        self.look.follow(d, look_gain);
        self.anchor = [d.position.x, d.position.y, noise.xx.max(noise.yy).sqrt()];
        self.proof.seen(d.score);
    }

    /// What is said of the track after a scan.
    #[inline]
    pub(super) fn state(&mut self, outcome: &Outcome, config: &TrackerConfig, camera: CameraPath) -> TrackState {
        let kinematics = self.belief.kinematics();
        let at = [kinematics.mean[0], kinematics.mean[2]];
        let proven = self.proof.holds(&config.proof, at, self.look.size, camera, outcome.hit);
        state_of(self.id, kinematics, &self.look, &self.life, proven, outcome, config)
    }
}

/// The record of a track after a scan; `proven` says whether it has shown what it must beside its life's rule.
#[inline]
pub(super) fn state_of(
    id: u64,
    kinematics: Gaussian<4>,
    look: &Look,
    life: &Life,
    proven: bool,
    outcome: &Outcome,
    config: &TrackerConfig,
) -> TrackState {
    let [width_px, height_px] = look.size;
    TrackState {
        id: TrackId(id),
        status: match (life.confirmed && proven, outcome.hit) {
            (false, _) => TrackStatus::Tentative,
            (true, true) => TrackStatus::Confirmed,
            (true, false) => TrackStatus::Coasting,
        },
        extent: Extent {
            left_px: kinematics.mean[0] - 0.5 * width_px,
            top_px: kinematics.mean[2] - 0.5 * height_px,
            width_px,
            height_px,
        },
        kinematics,
        detection: outcome.detection,
        innovation: outcome.innovation,
        score: config.life.confidence(life),
    }
}
