//! What is said of a track at one time: the record that sinks write and metrics read.

use crate::{Extent, FrameIndex, Timestamp};
use boresight_filters::Gaussian;
use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};

/// A track's number, from 1, never used twice in a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct TrackId(pub u64);

/// Whether a track is confirmed, and whether it was detected in this scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TrackStatus {
    /// Initiated, not yet confirmed.
    Tentative,
    /// Confirmed, with a detection in this scan.
    Confirmed,
    /// Confirmed, predicted only: no detection in this scan.
    Coasting,
}

/// The innovation of one update: measured minus predicted position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackInnovation {
    /// Measured minus predicted (weighted by the hypotheses), px.
    pub innovation: Vector2<f64>,
    /// Its covariance S = H P Hᵀ + R, px².
    pub cov: Matrix2<f64>,
    /// Normalised square νᵀ S⁻¹ ν (no unit; χ² with 2 degrees of freedom if the filter is consistent).
    pub nis: f64,
}

/// A track at one scan.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackState {
    /// The track.
    pub id: TrackId,
    /// Its status after this scan.
    pub status: TrackStatus,
    /// Mean and covariance of `[x, vx, y, vy]` (px, px/s).
    pub kinematics: Gaussian<4>,
    /// Smoothed bounding box, centred on the estimate.
    pub extent: Extent,
    /// Number of the detection in this scan that the track took, if one was taken.
    pub detection: Option<u32>,
    /// Innovation of this scan's update, if there was one.
    pub innovation: Option<TrackInnovation>,
    /// Confidence (existence probability or score mapped to 0..=1).
    pub score: f32,
}

impl TrackState {
    /// Position (x, y), px.
    pub fn position(&self) -> Vector2<f64> {
        Vector2::new(self.kinematics.mean[0], self.kinematics.mean[2])
    }

    /// Velocity (x, y), px/s.
    pub fn velocity(&self) -> Vector2<f64> {
        Vector2::new(self.kinematics.mean[1], self.kinematics.mean[3])
    }

    /// Covariance of the position, px².
    pub fn position_cov(&self) -> Matrix2<f64> {
        let p = &self.kinematics.cov;
        Matrix2::new(p[(0, 0)], p[(0, 2)], p[(2, 0)], p[(2, 2)])
    }
}

/// All tracks of one frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrackFrame {
    /// Number of the frame, from 0.
    pub index: FrameIndex,
    /// Its time.
    pub time: Timestamp,
    /// The tracks, in the order of the tracker or table.
    pub tracks: Vec<TrackState>,
}
