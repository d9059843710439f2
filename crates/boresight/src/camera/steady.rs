//! Steady ground: positions turned into the coordinates of the first scan's background, and back into the image's.
//!
//! The offset is the sum of the background's shifts since the first scan (px); it is taken from every detection before tracking and given
//! back to every track after.
//! Departures: velocities stay relative to the background (px/s); the shift's own error is not added to any covariance.
//! Limits: translation only; an unknown shift (`None`, or one that is not finite) counts as none.

use crate::{Scan, TrackState};
use nalgebra::Vector2;

/// Where the first scan's background lies in the image now.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SteadyGround {
    offset_px: Vector2<f64>,
    moved: bool,
}

impl SteadyGround {
    /// Returns the ground as it lies in `scan`, the next one.
    pub fn after(self, scan: &Scan) -> Self {
        let shift = scan.camera_shift_px.filter(|s| s.iter().all(|v| v.is_finite())).unwrap_or_default();
        Self { offset_px: self.offset_px + shift, moved: self.moved || shift != Vector2::zeros() }
    }

    /// Whether the camera was ever seen to move; until then the ground's coordinates are the image's, bit by bit.
    pub fn has_moved(self) -> bool {
        self.moved
    }

    /// Replaces `on_ground` by `scan` with the ground's positions and boxes, keeping its memory.
    pub fn scan_on_ground(self, scan: &Scan, on_ground: &mut Scan) {
        on_ground.index = scan.index;
        on_ground.time = scan.time;
        on_ground.camera_shift_px = scan.camera_shift_px;
        on_ground.detections.clone_from(&scan.detections);
        for d in &mut on_ground.detections {
            d.position -= self.offset_px;
            d.extent.left_px -= self.offset_px.x;
            d.extent.top_px -= self.offset_px.y;
        }
    }

    /// Turns the positions and boxes of tracks on the ground into the image's.
    pub fn tracks_in_image(self, tracks: &mut [TrackState]) {
        for t in tracks {
            t.kinematics.mean[0] += self.offset_px.x;
            t.kinematics.mean[2] += self.offset_px.y;
            t.extent.left_px += self.offset_px.x;
            t.extent.top_px += self.offset_px.y;
        }
    }
}
