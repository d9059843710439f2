//! A camera that stays in its place but shakes or nods: each frame is brought to where the first one's ground lies, and what is found there is put back into the frame.
//!
//! Source: our own; a background model on frames that were steadied, as before surveillance cameras on masts.
//! How: the estimator's motions are added up (against a key frame, so that errors do not), and the frame is drawn onto a canvas of the first one's view. What of the view the frame does not show stays on the canvas as it was last
//! seen, so that nothing moves there, and what is detected there is left out. The detector sees the canvas alone; its detections are moved to where they lie in the frame, and the tracker steadies them once more.
//! Symbols: image_from_ground, from a place of the canvas to the frame. Limits: one plane; what lies beyond the first view is not seen. Where the view is farther away than [`MOST_AWAY`], another one begins, or its place was lost, all is learnt
//! anew. Frames whose motion is not measured are no look at the scene once one was.

use super::Detector;
use super::target_finder::PRIME_FRAMES;
use crate::camera::CameraMotionEstimator;
use crate::warp::draw_onto;
use crate::{CameraMotion, Frame, Homography, Image, MotionBasis, Pixels, Result, Scan};
use nalgebra::Vector2;

/// Share of the view's width and height that the frame's middle may come away from the view's: more is no shake.
const MOST_AWAY: f64 = 0.25;

/// A detector behind a camera that shakes.
pub(super) struct Shaking<F> {
    detector: Box<dyn Detector>,
    /// Makes the detector anew.
    make: F,
    camera: CameraMotionEstimator,
    image_from_ground: Homography,
    canvas: Frame,
    started: bool,
    /// Whether a motion was measured, and whether it was not known any more since.
    known: bool,
    lost: bool,
    /// Area from which on regions count, if another than the configuration's.
    least_px: Option<u32>,
}

impl<F: Fn() -> Result<Box<dyn Detector>> + Send> Shaking<F> {
    /// Around a detector that `make` makes.
    /// # Errors
    /// What `make` refuses.
    pub(super) fn new(make: F) -> Result<Self> {
        let nothing = Pixels::Gray8(Image::default());
        Ok(Self {
            detector: make()?,
            make,
            camera: CameraMotionEstimator::default(),
            image_from_ground: Homography::identity(),
            canvas: Frame { index: Default::default(), time: Default::default(), pixels: nothing },
            started: false,
            known: false,
            lost: false,
            least_px: None,
        })
    }

    /// The frame becomes the view.
    fn start_anew(&mut self) -> Result<()> {
        if std::mem::replace(&mut self.started, true) {
            self.detector = (self.make)()?;
            if let Some(area_px) = self.least_px {
                self.detector.leave_out_below(area_px);
            }
        }
        self.image_from_ground = Homography::identity();
        (self.known, self.lost) = (false, false);
        Ok(())
    }
}

/// Whether where the view lies is not known any more behind such a motion.
fn breaks(motion: Option<&CameraMotion>) -> bool {
    motion.is_none_or(|m| matches!(m.basis, MotionBasis::Resumed | MotionBasis::Cut))
}

/// Whether the view's middle lies far from the frame's, or outside of all sense.
fn is_away(image_from_ground: &Homography, pixels: &Pixels) -> bool {
    let size = Vector2::new(pixels.width() as f64, pixels.height() as f64);
    let away = image_from_ground.shift_at(0.5 * size);
    !(image_from_ground.is_sound() && away.x.abs() <= MOST_AWAY * size.x && away.y.abs() <= MOST_AWAY * size.y)
}

impl<F: Fn() -> Result<Box<dyn Detector>> + Send> Detector for Shaking<F> {
    fn detect(&mut self, frame: &Frame, scan: &mut Scan) -> Result<()> {
        let motion = self.camera.step(&frame.pixels);
        let is_measured = motion.is_some_and(|m| matches!(m.basis, MotionBasis::Measured | MotionBasis::Resumed));
        if let Some(motion) = &motion {
            self.image_from_ground = self.image_from_ground.then(&motion.now_from_before);
        }
        // Of what was not known of the place nothing is ever made up for.
        self.lost |= self.known && breaks(motion.as_ref());
        let is_cut = motion.is_some_and(|m| m.is_cut());
        let is_found = self.lost && is_measured;
        if !self.started || is_cut || is_found || is_away(&self.image_from_ground, &frame.pixels) {
            self.start_anew()?;
        }
        self.known |= is_measured;
        let is_seen = is_measured || is_cut || !self.known;
        let canvas = &mut self.canvas;
        (canvas.index, canvas.time) = (frame.index, frame.time);
        if is_seen {
            draw_onto(&frame.pixels, &self.image_from_ground, &mut canvas.pixels);
            self.detector.detect(canvas, scan)?;
            if !self.image_from_ground.is_identity() {
                scan.detections.iter_mut().for_each(|d| d.move_by(&self.image_from_ground));
                // What stood there when it was last seen is no detection of this frame.
                let size = [frame.pixels.width() as f64, frame.pixels.height() as f64];
                let is_in = |v: f64, n: f64| (-0.5..n - 0.5).contains(&v);
                scan.detections.retain(|d| is_in(d.position.x, size[0]) && is_in(d.position.y, size[1]));
            }
        } else {
            (scan.index, scan.time, scan.blind) = (frame.index, frame.time, true);
            scan.detections.clear();
        }
        scan.camera_motion = motion;
        Ok(())
    }

    fn prime_s(&self) -> f64 {
        self.detector.prime_s()
    }

    fn prime(&mut self, frames: &[Frame]) -> Result<()> {
        let (mut camera, mut image_from_ground) = (CameraMotionEstimator::default(), Homography::identity());
        let mut known = false;
        let n = PRIME_FRAMES.min(frames.len());
        let mut some = Vec::with_capacity(n);
        let Some(mut canvas) = frames.first().cloned() else { return Ok(()) };
        for (k, frame) in frames.iter().enumerate() {
            let motion = camera.step(&frame.pixels);
            if let Some(motion) = &motion {
                image_from_ground = image_from_ground.then(&motion.now_from_before);
            }
            if known && breaks(motion.as_ref()) || is_away(&image_from_ground, &frame.pixels) {
                break;
            }
            known |= motion.is_some();
            draw_onto(&frame.pixels, &image_from_ground, &mut canvas.pixels);
            if k == some.len() * (frames.len() - 1) / (n - 1).max(1) {
                (canvas.index, canvas.time) = (frame.index, frame.time);
                some.push(canvas.clone());
            }
        }
        self.detector.prime(&some)
    }

    fn leave_out_below(&mut self, area_px: u32) -> bool {
        let is_possible = self.detector.leave_out_below(area_px);
        self.least_px = is_possible.then_some(area_px).or(self.least_px);
        is_possible
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::CameraConfig;
    use crate::vision::DetectorConfig;
    use crate::vision::threshold::ThresholdConfig;
    use crate::{FrameIndex, PixelKind, Similarity, SourceInfo, Timestamp};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const SIZE: [usize; 2] = [240, 160];

    /// Where the ground lies in a frame: shaken by some pixels and a little turned.
    fn place(k: usize) -> Homography {
        let t = k as f64;
        let shift =
            Vector2::new(3.1 * (1.9 * t).sin(), 2.3 * (2.7 * t + 1.0).sin()) - Vector2::new(0.0, 2.3 * 1f64.sin());
        let middle = Vector2::new(120.0, 80.0);
        Homography::of_similarity(&Similarity::about(middle, shift, 0.004 * (0.8 * t).sin(), 1.0))
    }

    /// The middle of a square of 13 px on the ground.
    fn square(k: usize) -> Vector2<f64> {
        Vector2::new(40.0 + 2.0 * k as f64, 70.5)
    }

    fn film(n: usize) -> Vec<Frame> {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let waves: Vec<[f64; 4]> = (0..60)
            .map(|_| {
                let (angle, length) = (6.3 * rng.random::<f64>(), 0.1 + 0.7 * rng.random::<f64>());
                [5.0 * rng.random::<f64>(), length * angle.cos(), length * angle.sin(), 6.3 * rng.random::<f64>()]
            })
            .collect();
        let ground =
            |g: Vector2<f64>| -> f64 { waves.iter().map(|[a, x, y, p]| a * (x * g.x + y * g.y + p).sin()).sum() };
        (0..n)
            .map(|k| {
                let (back, at) = (place(k).inverse(), square(k));
                let mut image = Image::filled(SIZE[0], SIZE[1], 0u8);
                for y in 0..SIZE[1] {
                    for (x, v) in image.row_mut(y).iter_mut().enumerate() {
                        let g = back.apply(Vector2::new(x as f64, y as f64));
                        let far = (g - at).abs();
                        let seen = if far.x <= 6.5 && far.y <= 6.5 { 220.0 } else { 110.0 + ground(g) };
                        *v = (seen + 3.0 * (rng.random::<f64>() - 0.5)).round().clamp(0.0, 255.0) as u8;
                    }
                }
                let time = Timestamp::from_secs_f64(0.04 * k as f64);
                Frame { index: FrameIndex(k as u64), time, pixels: Pixels::Gray8(image) }
            })
            .collect()
    }

    fn detector(camera: CameraConfig) -> Box<dyn Detector> {
        let threshold = ThresholdConfig::Moving(Default::default());
        let mut config = DetectorConfig { threshold, camera, ..DetectorConfig::default() };
        config.cluster.min_area_px = Some(20);
        let (label, reader) = (String::new(), String::new());
        let (width, height, kind) = (SIZE[0], SIZE[1], PixelKind::Gray8);
        let (n_frames, rate_hz, true_times) = (None, Some(25.0), true);
        crate::vision::build(&config, &SourceInfo { label, reader, width, height, kind, n_frames, rate_hz, true_times })
            .unwrap()
    }

    /// In how many of the frames from the twentieth on the square alone is found where it lies in the frame.
    fn alone(camera: CameraConfig, frames: &[Frame]) -> usize {
        let mut detector = detector(camera);
        detector.prime(frames).unwrap();
        let mut scan = Scan::default();
        let is_alone = |(k, frame): (usize, &Frame)| {
            detector.detect(frame, &mut scan).unwrap();
            assert_eq!((scan.index, scan.time), (frame.index, frame.time));
            let at = place(k).apply(square(k));
            k >= 20 && matches!(&scan.detections[..], [d] if (d.position - at).norm() < 1.0)
        };
        frames.iter().enumerate().map(is_alone).filter(|is| *is).count()
    }

    #[test]
    fn what_moves_before_a_camera_that_shakes_is_found_alone_and_where_it_lies_in_the_frame() {
        let frames = film(70);
        let [shaking, fixed] = [CameraConfig::Shaking, CameraConfig::Fixed].map(|camera| alone(camera, &frames));
        assert!(shaking >= 47 && fixed + 10 < shaking, "{shaking} and {fixed} of 50");
    }

    #[test]
    fn another_view_is_learnt_anew_and_the_motion_is_that_of_the_frames() {
        let frames = film(30);
        let mut detector = detector(CameraConfig::Shaking);
        let (mut scan, mut errors) = (Scan::default(), Vec::new());
        for (k, frame) in frames.iter().enumerate() {
            detector.detect(frame, &mut scan).unwrap();
            if let Some(motion) = scan.camera_motion.filter(|_| k > 0) {
                let expected = place(k - 1).inverse().then(&place(k));
                let middle = Vector2::new(120.0, 80.0);
                errors.push((motion.now_from_before.shift_at(middle) - expected.shift_at(middle)).norm());
            }
        }
        errors.sort_by(f64::total_cmp);
        assert!(errors.len() > 25 && errors[errors.len() / 2] < 0.1, "{errors:?}");
        // What is the other way round is another view, which is learnt anew, with the least area that was asked for.
        assert!(detector.leave_out_below(30));
        let (mut breaks, mut near) = (0, 0);
        for (k, frame) in film(130).iter().enumerate() {
            let Pixels::Gray8(image) = &frame.pixels else { panic!("grey") };
            let turned = image.as_slice().iter().rev().map(|v| 255 - v).collect();
            let pixels = Pixels::Gray8(Image::from_vec(SIZE[0], SIZE[1], turned).unwrap());
            let time = Timestamp::from_secs_f64(0.04 * (30 + k) as f64);
            detector.detect(&Frame { index: FrameIndex(30 + k as u64), time, pixels }, &mut scan).unwrap();
            breaks += usize::from(super::breaks(scan.camera_motion.as_ref()));
            let at = Vector2::new(SIZE[0] as f64 - 1.0, SIZE[1] as f64 - 1.0) - place(k).apply(square(k));
            near += usize::from(k > 80 && matches!(&scan.detections[..], [d] if (d.position - at).norm() < 1.0));
            assert!(scan.detections.iter().all(|d| d.area_px >= 30), "frame {k}");
        }
        assert!((1..20).contains(&breaks), "{breaks}");
        assert!(near > 12, "{near} of the frames from 80 to where the square leaves");
    }
}
