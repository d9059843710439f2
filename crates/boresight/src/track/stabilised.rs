//! A tracker that stands still while the camera moves: tracks live in the coordinates of the first scan's background.
//!
//! Source: our own. [`SteadyGround`] turns every scan into those coordinates before the tracker inside sees it, and its tracks back into the image's.
//! Filters, gates, initiation and confirmation then see targets against the ground, whatever the camera does.
//! Where the image's size is known, tracks that have left it are no longer reported (they may come back while they coast).
//! Limits: those of [`SteadyGround`]. Scans pass through untouched, bit by bit, until the first one with a motion.

use super::backward::Backward;
use super::parameters::TrackerParameters;
use super::tracking::{Tracking, renumber_states};
use crate::camera::SteadyGround;
use crate::{Result, Scan, TrackId, TrackState};

/// Keeps the tracker inside on steady ground.
pub struct Stabilised {
    inner: Box<dyn Tracking>,
    field_px: Option<[f64; 2]>,
    ground: SteadyGround,
    on_ground: Scan,
    states: Vec<TrackState>,
}

opaque_debug!(Stabilised);

impl Stabilised {
    /// Puts a tracker on steady ground; `field_px` is the image's width and height.
    pub fn new(inner: Box<dyn Tracking>, field_px: Option<[f64; 2]>) -> Self {
        Self { inner, field_px, ground: SteadyGround::default(), on_ground: Scan::default(), states: Vec::new() }
    }
}

impl Tracking for Stabilised {
    fn step(&mut self, scan: &Scan) -> Result<&[TrackState]> {
        let ground = self.ground.after(scan);
        if !ground.has_moved() && self.field_px.is_none() {
            return self.inner.step(scan);
        }
        ground.scan_on_ground(scan, &mut self.on_ground);
        self.states.clear();
        self.states.extend_from_slice(self.inner.step(&self.on_ground)?);
        // Only now: a scan that was refused has not moved the ground.
        self.ground = ground;
        ground.tracks_in_image(&mut self.states);
        if let Some([width, height]) = self.field_px {
            self.states.retain(|s| {
                let (x, y) = (s.kinematics.mean[0], s.kinematics.mean[2]);
                x >= -0.5 && y >= -0.5 && x <= width - 0.5 && y <= height - 0.5
            });
        }
        Ok(&self.states)
    }

    fn adapt(&mut self, parameters: &TrackerParameters) -> Result<bool> {
        self.inner.adapt(parameters)
    }

    fn renamed(&self) -> &[(TrackId, TrackId)] {
        self.inner.renamed()
    }

    fn twin(&self) -> Option<Box<dyn Tracking>> {
        let twin = Self::new(self.inner.twin()?, self.field_px);
        Some(Box::new(Self { ground: self.ground, ..twin }))
    }

    fn next_id(&self) -> TrackId {
        self.inner.next_id()
    }

    fn renumber(&mut self, next: TrackId, pairs: &[(TrackId, TrackId)]) -> &[TrackState] {
        renumber_states(&mut self.states, pairs);
        let inner = self.inner.renumber(next, pairs);
        // As in a step: a tracker that was not steadied has the states itself.
        if self.ground.has_moved() || self.field_px.is_some() { &self.states } else { inner }
    }

    fn retrospective_s(&self) -> f64 {
        self.inner.retrospective_s()
    }

    fn backward(&self) -> Option<Backward> {
        self.inner.backward()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::track::{InitialTrackConfig, Tracker, TrackerConfig};
    use crate::{CameraMotion, Detection, Extent, FrameIndex, Timestamp};
    use nalgebra::{Matrix2, Vector2};

    fn scan(k: u64, points: &[(f64, f64)], shift: Option<(f64, f64)>) -> Scan {
        let detections = points
            .iter()
            .map(|&(x, y)| {
                Detection::at(Vector2::new(x, y), Matrix2::identity() * 0.1)
                    .with_extent(Extent { left_px: x - 2.0, top_px: y - 2.0, width_px: 4.0, height_px: 4.0 })
                    .with_area_px(16)
                    .with_sum(16.0)
                    .with_score(10.0)
            })
            .collect();
        Scan::at(FrameIndex(k), Timestamp::from_secs_f64(k as f64 * 0.04))
            .with_detections(detections)
            .with_camera_motion(shift.map(|(x, y)| CameraMotion::exact_shift(Vector2::new(x, y))))
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
    fn where_another_view_begins_all_tracks_end() {
        // Another thing comes to lie where the first one would be, at rest in a view that has nothing to do with the first.
        let config = TrackerConfig {
            reidentification: crate::track::ReidentificationConfig { max_gap_s: 2.0 },
            ..TrackerConfig::default()
        };
        let trackers: [Box<dyn Tracking>; 2] = [
            Box::new(Tracker::new(&config).unwrap()),
            Box::new(crate::track::Mht::new(&config, &crate::track::MhtConfig::default()).unwrap()),
        ];
        for inner in trackers {
            let mut steady = Stabilised::new(inner, Some([640.0, 480.0]));
            let mut ids = [std::collections::BTreeSet::new(), std::collections::BTreeSet::new()];
            for k in 0..20u64 {
                let mut now = scan(k, &[(100.0 + k as f64, 20.0)], Some((0.5, 0.0)));
                if let Some(motion) = now.camera_motion.as_mut().filter(|_| k == 10) {
                    (motion.basis, motion.now_from_before) = (crate::MotionBasis::Cut, crate::Homography::identity());
                }
                let states = steady.step(&now).unwrap();
                ids[usize::from(k >= 10)].extend(states.iter().map(|s| s.id));
            }
            assert!(ids.iter().all(|i| i.len() == 1) && ids[0] != ids[1], "{ids:?}");
        }
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

    #[test]
    fn what_has_left_the_image_is_not_reported() {
        // Pixels end half a pixel beyond their centres: −0.5 .. 639.5 and −0.5 .. 511.5.
        let places = [
            ([-0.4, 9.0], true),
            ([-0.6, 9.0], false),
            ([639.4, 9.0], true),
            ([639.6, 9.0], false),
            ([9.0, -0.4], true),
            ([9.0, -0.6], false),
            ([9.0, 511.4], true),
            ([9.0, 511.6], false),
        ];
        let at = |(position_px, _)| InitialTrackConfig { position_px, ..InitialTrackConfig::default() };
        let config = TrackerConfig { initial_tracks: places.into_iter().map(at).collect(), ..TrackerConfig::default() };
        for field_px in [Some([640.0, 512.0]), None] {
            let mut steady = Stabilised::new(Box::new(Tracker::new(&config).unwrap()), field_px);
            let states = steady.step(&scan(0, &[], None)).unwrap();
            let reported = places.map(|(p, _)| states.iter().any(|s| s.position() == Vector2::from(p)));
            assert_eq!(reported, places.map(|(_, is_inside)| is_inside || field_px.is_none()));
        }
    }

    #[test]
    fn a_detection_with_its_velocity_starts_a_track_at_once_in_a_field_and_without() {
        for field_px in [Some([640.0, 512.0]), None] {
            let mut steady = Stabilised::new(Box::new(Tracker::new(&TrackerConfig::default()).unwrap()), field_px);
            let mut first = scan(0, &[(30.0, 40.0)], None);
            let velocity = Vector2::new(12.0, -3.0);
            let (cov, with_position) = (Matrix2::identity(), Matrix2::zeros());
            first.detections[0].velocity = Some(crate::DetectedVelocity { mean: velocity, cov, with_position });
            let states = steady.step(&first).unwrap();
            let mean = states.first().map(|s| s.kinematics.mean);
            assert_eq!(mean.map(|m| [m[1], m[3]]), Some([12.0, -3.0]), "{field_px:?}");
        }
    }
}
