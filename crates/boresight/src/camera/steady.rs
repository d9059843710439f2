//! Steady ground: positions turned into the coordinates of the first scan's background, and back into the image's.
//!
//! Source: composition of the scans' motions; covariances to first order.
//! Detections go to the ground before tracking: position, box, and R = A⁻¹ (R + C) A⁻ᵀ, where C is the covariance of where the background lies
//! at that place ([`CameraMotion::cov_at`]). Tracks come back into the image after it, wholly: position, velocity, covariance, box, innovation.
//! Symbols: x = H g (image from ground), A = dx/dg there; S, the motion since the scan before; u = (x - S⁻¹ x) / dt, the ground's own velocity in the image there (px/s);
//! v_image = A v_ground + u; B = du/dx.
//! Where another view begins, its first image is the ground from then on.
//! Limits: what a perspective adds to a velocity's covariance within that of its position is left out; boxes keep their sides along the image's axes; numbers of the tracker's configuration in px are px of the first scan (at a zoom of 2 they are 2 px
//! of the image); where the motion is unknown the ground is taken to stand still in the image.

use crate::{CameraMotion, Detection, Extent, Homography, MotionCov, Scan, Timestamp, TrackState};
use nalgebra::{Matrix2, Matrix4, Vector2};

/// Where the first scan's background lies in the image now.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SteadyGround {
    image_from_ground: Homography,
    /// The last scan's motion, and the time it took, s.
    motion: Option<CameraMotion>,
    dt_s: f64,
    time: Option<Timestamp>,
    moved: bool,
}

impl SteadyGround {
    /// Returns the ground as it lies in `scan`, the next one.
    pub fn after(self, scan: &Scan) -> Self {
        let motion = scan.camera_motion.filter(CameraMotion::is_finite);
        let step = motion.map_or(Homography::identity(), |m| m.now_from_before);
        Self {
            // Of another view nobody knows where it lies: its first image is the ground.
            image_from_ground: if scan.is_cut() { Homography::identity() } else { self.image_from_ground.then(&step) },
            motion,
            dt_s: self.time.map_or(0.0, |before| scan.time.seconds_since(before)),
            time: Some(scan.time),
            moved: self.moved || !step.is_identity(),
        }
    }

    /// Whether the camera was ever seen to move; until then the ground's coordinates are the image's, bit by bit.
    pub fn has_moved(self) -> bool {
        self.moved
    }

    /// Replaces `on_ground` by `scan` with the ground's positions, covariances and boxes, keeping its memory.
    pub fn scan_on_ground(self, scan: &Scan, on_ground: &mut Scan) {
        on_ground.index = scan.index;
        on_ground.time = scan.time;
        on_ground.camera_motion = scan.camera_motion;
        on_ground.blind = scan.blind;
        on_ground.detections.clone_from(&scan.detections);
        let (ground, motion) = self.way_to_ground();
        for d in &mut on_ground.detections {
            // Where the camera has not moved a velocity in the image is that on the ground; else it was measured over frames between which the ground moved.
            d.velocity = d.velocity.filter(|_| !self.moved);
            to_ground(d, &ground, motion.as_ref());
        }
    }

    /// A detection of the scan with the ground's position, covariance and box.
    pub(crate) fn detection_on_ground(self, d: &Detection) -> Detection {
        let mut d = d.clone();
        if self.moved {
            d.velocity = None;
            let (ground, motion) = self.way_to_ground();
            to_ground(&mut d, &ground, motion.as_ref());
        }
        d
    }

    /// Where a place on the ground lies in the image, px.
    pub(crate) fn in_image(self, on_ground: Vector2<f64>) -> Vector2<f64> {
        self.image_from_ground.apply(on_ground)
    }

    /// How much larger the ground looks at a place on it than in the first scan.
    pub(crate) fn zoom_at(self, on_ground: Vector2<f64>) -> f64 {
        self.image_from_ground.zoom_at(on_ground)
    }

    /// From the image to the ground, and the motion whose uncertainty counts.
    fn way_to_ground(self) -> (Homography, Option<CameraMotion>) {
        // Exactly known motions change no covariance, not even in the last bit.
        (self.image_from_ground.inverse(), self.motion.filter(|m| m.cov != MotionCov::zeros()))
    }

    /// Turns tracks on the ground into the image's.
    pub fn tracks_in_image(self, tracks: &mut [TrackState]) {
        for t in tracks {
            self.track_in_image(t);
        }
    }

    fn track_in_image(&self, t: &mut TrackState) {
        let (mean, cov) = (&mut t.kinematics.mean, &mut t.kinematics.cov);
        let image = &self.image_from_ground;
        let on_ground = Vector2::new(mean[0], mean[2]);
        let at = image.apply(on_ground);
        let mut velocity = image.turn_at(on_ground, Vector2::new(mean[1], mean[3]));
        let step = self.motion.filter(|_| self.dt_s > 0.0);
        let mut of_place = Matrix2::zeros();
        if let Some(m) = step.filter(|m| !m.now_from_before.is_identity()) {
            let back = m.now_from_before.inverse();
            velocity -= back.shift_at(at) / self.dt_s;
            of_place = (Matrix2::identity() - back.linear_at(at)) / self.dt_s;
        }
        if !(image.is_shift() && of_place == Matrix2::zeros()) {
            let a = image.linear_at(on_ground);
            let mut transform = by_axis(&a, &a);
            let coupled = of_place * a;
            for i in 0..2 {
                for j in 0..2 {
                    transform[(2 * i + 1, 2 * j)] += coupled[(i, j)];
                }
            }
            let turned = transform * *cov * transform.transpose();
            *cov = 0.5 * (turned + turned.transpose());
        }
        if let Some(m) = step.filter(|m| m.cov != MotionCov::zeros()) {
            let c = m.cov_at(at);
            *cov += by_axis(&Matrix2::zeros(), &(c / (self.dt_s * self.dt_s)));
            if t.detection.is_none() {
                // A detection was seen in the image itself; a prediction is only as good as the ground.
                *cov += by_axis(&c, &Matrix2::zeros());
            }
        }
        (mean[0], mean[1], mean[2], mean[3]) = (at.x, velocity.x, at.y, velocity.y);
        t.extent = moved(t.extent, image);
        if let Some(i) = t.innovation.as_mut().filter(|_| !image.is_shift()) {
            i.innovation = image.turn_at(on_ground, i.innovation);
            i.cov = image.turn_cov_at(on_ground, &i.cov);
        }
    }
}

/// Turns a detection to the ground.
#[inline]
fn to_ground(d: &mut Detection, ground: &Homography, motion: Option<&CameraMotion>) {
    if let Some(m) = motion {
        d.cov += m.cov_at(d.position);
    }
    d.cov = ground.turn_cov_at(d.position, &d.cov);
    d.position = ground.apply(d.position);
    d.extent = moved(d.extent, ground);
}

/// The matrix over `[x, vx, y, vy]` of a block for positions and one for velocities.
fn by_axis(position: &Matrix2<f64>, velocity: &Matrix2<f64>) -> Matrix4<f64> {
    let mut out = Matrix4::zeros();
    for i in 0..2 {
        for j in 0..2 {
            out[(2 * i, 2 * j)] = position[(i, j)];
            out[(2 * i + 1, 2 * j + 1)] = velocity[(i, j)];
        }
    }
    out
}

/// A box around the place where its middle comes to lie, zoomed, its sides along the axes.
fn moved(e: Extent, by: &Homography) -> Extent {
    if by.is_shift() {
        let corner = by.apply(Vector2::new(e.left_px, e.top_px));
        return Extent { left_px: corner.x, top_px: corner.y, ..e };
    }
    let middle = Vector2::new(e.left_px + 0.5 * e.width_px, e.top_px + 0.5 * e.height_px);
    let zoom = by.zoom_at(middle);
    Extent::around(by.apply(middle), zoom * e.width_px, zoom * e.height_px)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DetectedVelocity;
    use crate::{Detection, FrameIndex, MotionBasis, Similarity, TrackId, TrackStatus};
    use boresight_filters::Gaussian;
    use nalgebra::Vector4;

    fn scan(k: u64, position: Vector2<f64>, motion: Option<CameraMotion>) -> Scan {
        let seen =
            Detection::at(position, Matrix2::new(0.2, 0.05, 0.05, 0.1)).with_extent(Extent::around(position, 6.0, 4.0));
        Scan::at(FrameIndex(k), Timestamp::from_secs_f64(0.04 * k as f64))
            .with_detections(vec![seen])
            .with_camera_motion(motion)
    }

    fn track(mean: Vector4<f64>, cov: Matrix4<f64>, extent: Extent, detection: Option<u32>) -> TrackState {
        TrackState {
            id: TrackId(1),
            status: TrackStatus::Confirmed,
            kinematics: Gaussian { mean, cov },
            extent,
            detection,
            innovation: None,
            score: 1.0,
        }
    }

    fn turning() -> CameraMotion {
        CameraMotion {
            now_from_before: Homography::of_similarity(&Similarity::about(
                Vector2::new(160.0, 120.0),
                Vector2::new(3.0, -1.0),
                0.02,
                1.01,
            )),
            centre_px: Vector2::new(160.0, 120.0),
            cov: MotionCov::zeros(),
            basis: MotionBasis::Measured,
        }
    }

    #[test]
    fn what_lies_on_the_ground_moves_in_the_image_as_the_ground_does() {
        let motion = turning();
        let mut ground = SteadyGround::default().after(&scan(0, Vector2::zeros(), None));
        let mut at = Vector2::new(40.0, 200.0);
        let first = at;
        for k in 1..30 {
            let before = at;
            at = motion.now_from_before.apply(at);
            let now = scan(k, at, Some(motion));
            ground = ground.after(&now);
            let mut on_ground = Scan::default();
            ground.scan_on_ground(&now, &mut on_ground);
            let d = &on_ground.detections[0];
            assert!((d.position - first).norm() < 1e-9 && ground.has_moved());
            // A track that stands still on the ground has the ground's velocity in the image, and its box the image's size.
            let cov = by_axis(&d.cov, &Matrix2::identity());
            let mut states = [track(Vector4::new(d.position.x, 0.0, d.position.y, 0.0), cov, d.extent, Some(0))];
            ground.tracks_in_image(&mut states);
            let (mean, cov) = (states[0].kinematics.mean, states[0].kinematics.cov);
            assert!((Vector2::new(mean[0], mean[2]) - at).norm() < 1e-9);
            assert!((Vector2::new(mean[1], mean[3]) - (at - before) / 0.04).norm() < 1e-6, "scan {k}");
            assert!((states[0].extent.width_px - 6.0).abs() < 1e-9);
            let position = Matrix2::new(cov[(0, 0)], cov[(0, 2)], cov[(2, 0)], cov[(2, 2)]);
            assert!((position - Matrix2::new(0.2, 0.05, 0.05, 0.1)).norm() < 1e-9, "there and back: {position}");
        }
    }

    #[test]
    fn an_uncertain_motion_widens_detections_and_what_is_only_predicted() {
        let motion = CameraMotion {
            cov: MotionCov::from_diagonal(&[0.5, 0.5, 1e-4, 0.0, 0.0, 0.0, 0.0, 0.0].into()),
            basis: MotionBasis::Held,
            ..turning()
        };
        let at = Vector2::new(260.0, 120.0);
        let now = scan(1, at, Some(motion));
        let ground = SteadyGround::default().after(&scan(0, at, None)).after(&now);
        let mut on_ground = Scan::default();
        ground.scan_on_ground(&now, &mut on_ground);
        // 100 px to the right a turn moves along y: 0.1 + 0.5 + 1e-4 x 100².
        let back = motion.now_from_before.turn_cov_at(on_ground.detections[0].position, &on_ground.detections[0].cov);
        assert!((back - Matrix2::new(0.7, 0.05, 0.05, 1.6)).norm() < 1e-9, "{back}");
        let still = track(Vector4::new(260.0, 0.0, 120.0, 0.0), Matrix4::zeros(), Extent::default(), None);
        let mut states = [still.clone(), TrackState { detection: Some(0), ..still }];
        ground.tracks_in_image(&mut states);
        assert!(states[0].kinematics.cov[(0, 0)] > 0.4 && states[1].kinematics.cov[(0, 0)] == 0.0);
        assert!(states[1].kinematics.cov[(1, 1)] > 0.4 / (0.04 * 0.04));
    }

    #[test]
    fn a_camera_bridged_at_rest_adds_what_is_not_known_of_it_and_leaves_velocities() {
        let at = Vector2::new(30.0, 40.0);
        let held = CameraMotion {
            cov: MotionCov::from_diagonal(&[0.4, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0].into()),
            basis: MotionBasis::Held,
            ..CameraMotion::exact_shift(Vector2::zeros())
        };
        let velocity = DetectedVelocity {
            mean: Vector2::new(3.0, 4.0),
            cov: Matrix2::identity(),
            with_position: Matrix2::zeros(),
        };
        let moves = |mut scan: Scan| {
            scan.detections[0].velocity = Some(velocity);
            scan
        };
        let now = moves(scan(1, at, Some(held)));
        let mut on_ground = Scan::default();
        SteadyGround::default().after(&scan(0, at, None)).after(&now).scan_on_ground(&now, &mut on_ground);
        let added = on_ground.detections[0].cov - now.detections[0].cov;
        assert!((added - Matrix2::new(0.4, 0.0, 0.0, 0.5)).norm() < 1e-9, "{added}");
        assert_eq!(on_ground.detections[0].velocity, Some(velocity));
        let pan = moves(scan(1, at, Some(CameraMotion::exact_shift(Vector2::new(2.0, 0.0)))));
        SteadyGround::default().after(&scan(0, at, None)).after(&pan).scan_on_ground(&pan, &mut on_ground);
        assert_eq!(on_ground.detections[0].velocity, None, "of the image, not of the ground");
    }

    #[test]
    fn until_the_camera_moves_nothing_changes_not_a_bit() {
        let at = Vector2::new(0.1 + 0.2, 1.0 / 3.0);
        let still = Some(CameraMotion::exact_shift(Vector2::zeros()));
        let ground = SteadyGround::default().after(&scan(0, at, None)).after(&scan(1, at, still));
        let mut on_ground = Scan::default();
        ground.scan_on_ground(&scan(1, at, still), &mut on_ground);
        assert!(!ground.has_moved());
        assert_eq!(on_ground, scan(1, at, still));
        let cov = Matrix4::identity() * 0.1;
        let before = [track(Vector4::new(at.x, 0.7, at.y, 0.1), cov, on_ground.detections[0].extent, None)];
        let mut after = before.clone();
        ground.tracks_in_image(&mut after);
        assert_eq!(after, before);
    }

    #[test]
    fn a_motion_that_is_no_number_is_unknown() {
        let motion = CameraMotion::exact_shift(Vector2::new(f64::NAN, 0.0));
        let ground = SteadyGround::default().after(&scan(0, Vector2::zeros(), Some(motion)));
        assert!(!ground.has_moved());
    }
}
