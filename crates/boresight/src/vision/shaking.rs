//! A camera that stays in its place but shakes or nods: each frame is brought to where the first one's ground lies, and what is found there is put back into the frame.
//!
//! Source: our own; a background model on frames that were steadied, as before surveillance cameras on masts.
//! How: the estimator's motions are added up (against a key frame, so that errors do not), and the frame is drawn onto a canvas of the first one's view. What of the view the frame does not show stays on the canvas as it was last
//! seen, so that nothing moves there. The detector sees the canvas alone; its detections are moved to where they lie in the frame, and the tracker steadies them once more.
//! Symbols: image_from_ground, from a place of the canvas to the frame. Limits: one plane; what lies beyond the first view is not seen. Where the view is farther away than [`MOST_AWAY`], or another one begins, all is learnt
//! anew. Frames whose motion is not measured are no look at the scene once one was.

use super::Detector;
use super::target_finder::PRIME_FRAMES;
use crate::camera::CameraMotionEstimator;
use crate::warp::draw_onto;
use crate::{Frame, Homography, Image, MotionBasis, Pixels, Result, Scan};
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
    /// Whether a motion was measured.
    known: bool,
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
        })
    }

    /// The frame becomes the view.
    fn start_anew(&mut self) -> Result<()> {
        if std::mem::replace(&mut self.started, true) {
            self.detector = (self.make)()?;
        }
        self.image_from_ground = Homography::identity();
        self.known = false;
        Ok(())
    }
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
        let is_cut = motion.is_some_and(|m| m.is_cut());
        if !self.started || is_cut || is_away(&self.image_from_ground, &frame.pixels) {
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
        let n = PRIME_FRAMES.min(frames.len());
        let mut some = Vec::with_capacity(n);
        let Some(mut canvas) = frames.first().cloned() else { return Ok(()) };
        for (k, frame) in frames.iter().enumerate() {
            if let Some(motion) = camera.step(&frame.pixels) {
                image_from_ground = image_from_ground.then(&motion.now_from_before);
            }
            if is_away(&image_from_ground, &frame.pixels) {
                break;
            }
            draw_onto(&frame.pixels, &image_from_ground, &mut canvas.pixels);
            if k == some.len() * (frames.len() - 1) / (n - 1).max(1) {
                (canvas.index, canvas.time) = (frame.index, frame.time);
                some.push(canvas.clone());
            }
        }
        self.detector.prime(&some)
    }

    fn leave_out_below(&mut self, area_px: u32) -> bool {
        self.detector.leave_out_below(area_px)
    }
}
