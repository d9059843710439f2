//! Report: the record of a track after a scan, as everyone outside sees it.

use super::super::appearance::Appearance;
use super::super::config::TrackerConfig;
use super::super::confirm::history::History;
use super::super::confirm::status::status;
use super::super::correlated_error;
use super::super::single_track::{Outcome, Track};
use crate::camera::CameraPath;
use crate::{Extent, TrackId, TrackState};
use boresight_filters::{Filter, Gaussian};

/// Takes the scan's estimate through the motion test and returns the track's record.
#[inline]
pub(in crate::track) fn report(
    track: &mut Track,
    outcome: &Outcome,
    config: &TrackerConfig,
    camera: CameraPath,
) -> TrackState {
    let kinematics = track.filter.kinematics();
    let at = [kinematics.mean[0], kinematics.mean[2]];
    let variance = [kinematics.cov[(0, 0)], kinematics.cov[(2, 2)]];
    let passed = track.motion.passes(&config.motion_test, at, variance, camera, outcome.hit);
    state_of(track.id, kinematics, &track.appearance, &track.history, passed, outcome, config)
}

/// The record of a track after a scan; `may_report` says whether it moves, where only that is reported.
#[inline]
pub(in crate::track) fn state_of(
    id: u64,
    mut kinematics: Gaussian<4>,
    appearance: &Appearance,
    history: &History,
    may_report: bool,
    outcome: &Outcome,
    config: &TrackerConfig,
) -> TrackState {
    let [width_px, height_px] = appearance.size;
    correlated_error::add_to(&mut kinematics, config.correlated_error_px);
    TrackState {
        id: TrackId(id),
        status: status(history, may_report, outcome.hit),
        extent: Extent {
            left_px: kinematics.mean[0] - 0.5 * width_px,
            top_px: kinematics.mean[2] - 0.5 * height_px,
            width_px,
            height_px,
        },
        kinematics,
        detection: outcome.detection,
        innovation: outcome.innovation,
        score: config.confirmation.score(history),
    }
}
