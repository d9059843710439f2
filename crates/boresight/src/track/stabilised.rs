//! A tracker that stands still while the camera moves: tracks live in the coordinates of the first scan's background.
//!
//! Source: our own. Each scan says how far the background moved since the scan before ([`Scan::camera_shift_px`]); the sum is taken
//! from every detection before the tracker inside sees it and given back to every track after. Filters, gates, starts and proofs
//! then see targets against the ground, whatever the camera does. Positions and boxes that leave are the image's again.
//! Where the image's size is known, tracks that have left it are no longer reported (they may come back while they coast).
//! Departures: velocities stay relative to the background (px/s); the shift's own error is not added to any covariance.
//! Limits: translation only. Scans without a shift (`None`) pass through untouched, bit by bit, until the first one with a shift.

use super::Tracking;
use crate::{Result, Scan, TrackState};
use nalgebra::Vector2;

/// Keeps the tracker inside on steady ground.
pub struct Stabilised {
    inner: Box<dyn Tracking>,
    field_px: Option<[f64; 2]>,
    camera: Vector2<f64>,
    /// Whether the camera was ever seen to move: only then are scans copied.
    moved: bool,
    steady: Scan,
    states: Vec<TrackState>,
}

opaque_debug!(Stabilised);

impl Stabilised {
    /// Puts a tracker on steady ground.
    pub fn new(inner: Box<dyn Tracking>, field_px: Option<[f64; 2]>) -> Self {
        Self { inner, field_px, camera: Vector2::zeros(), moved: false, steady: Scan::default(), states: Vec::new() }
    }
}

impl Tracking for Stabilised {
    fn step(&mut self, scan: &Scan) -> Result<&[TrackState]> {
        let shift = scan.camera_shift_px.filter(|s| s.iter().all(|v| v.is_finite())).unwrap_or_default();
        self.moved |= shift != Vector2::zeros();
        if !self.moved && self.field_px.is_none() {
            return self.inner.step(scan);
        }
        let camera = self.camera + shift;
        self.steady.index = scan.index;
        self.steady.time = scan.time;
        self.steady.camera_shift_px = scan.camera_shift_px;
        self.steady.detections.clone_from(&scan.detections);
        for d in &mut self.steady.detections {
            d.position -= camera;
            d.extent.left_px -= camera.x;
            d.extent.top_px -= camera.y;
        }
        self.states.clear();
        self.states.extend_from_slice(self.inner.step(&self.steady)?);
        // Only now: a scan that was refused has not moved the ground.
        self.camera = camera;
        for s in &mut self.states {
            s.kinematics.mean[0] += camera.x;
            s.kinematics.mean[2] += camera.y;
            s.extent.left_px += camera.x;
            s.extent.top_px += camera.y;
        }
        if let Some([width, height]) = self.field_px {
            self.states.retain(|s| {
                let (x, y) = (s.kinematics.mean[0], s.kinematics.mean[2]);
                x >= -0.5 && y >= -0.5 && x <= width - 0.5 && y <= height - 0.5
            });
        }
        Ok(&self.states)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::track::{Tracker, TrackerConfig};
    use crate::{Detection, Extent, FrameIndex, Timestamp};
    use nalgebra::Matrix2;

    fn scan(k: u64, points: &[(f64, f64)], shift: Option<(f64, f64)>) -> Scan {
        let detections = points
            .iter()
            .map(|&(x, y)| Detection {
                position: Vector2::new(x, y),
                cov: Matrix2::identity() * 0.1,
                extent: Extent { left_px: x - 2.0, top_px: y - 2.0, width_px: 4.0, height_px: 4.0 },
                area_px: 16,
                peak: 1.0,
                sum: 16.0,
                score: 10.0,
                class: None,
            })
            .collect();
        Scan {
            index: FrameIndex(k),
            time: Timestamp::from_secs_f64(k as f64 * 0.04),
            detections,
            camera_shift_px: shift.map(|(x, y)| Vector2::new(x, y)),
        }
    }

    #[test]
    fn a_jerk_of_the_camera_does_not_lose_the_target() {
        // The camera jumps by 40 px in scan 10; the target itself goes on by 1 px a scan.
        let config = TrackerConfig::default();
        let mut plain = Tracker::new(&config).unwrap();
        let mut steady = Stabilised::new(Box::new(Tracker::new(&config).unwrap()), None);
        let mut ids = (Vec::new(), Vec::new());
        for k in 0..20u64 {
            let jump = if k >= 10 { 40.0 } else { 0.0 };
            let points = [(10.0 + k as f64 + jump, 20.0)];
            let now = scan(k, &points, Some((if k == 10 { 40.0 } else { 0.0 }, 0.0)));
            ids.0.extend(plain.step(&now).unwrap().iter().filter(|t| t.detection.is_some()).map(|t| t.id));
            let states = steady.step(&now).unwrap();
            if k > 3 {
                let s = &states[0];
                assert!((s.kinematics.mean[0] - points[0].0).abs() < 0.5, "scan {k}: {}", s.kinematics.mean[0]);
                assert!((s.extent.left_px + 2.0 - points[0].0).abs() < 0.5);
            }
            ids.1.extend(states.iter().map(|t| t.id));
        }
        ids.0.dedup();
        ids.1.dedup();
        assert_eq!(ids.1.len(), 1, "one target, one track");
        assert!(ids.0.len() > 1, "without the shift the jump breaks the track");
    }

    #[test]
    fn without_shifts_nothing_changes() {
        let config = TrackerConfig::default();
        let mut plain = Tracker::new(&config).unwrap();
        let mut steady = Stabilised::new(Box::new(Tracker::new(&config).unwrap()), None);
        for k in 0..10u64 {
            let now = scan(k, &[(10.0 + k as f64, 20.0)], None);
            assert_eq!(plain.step(&now).unwrap(), steady.step(&now).unwrap());
        }
    }
}
