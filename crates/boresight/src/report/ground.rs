//! Steady ground under a camera that moves: where each frame lies on the ground of the first one, and pictures enough to cover it.
//!
//! The motions that scans carry are added up. A picture is kept where the ground has moved by [`FAR`] of the frame's width from all kept before; when they are
//! too many, every second one goes and the next must lie twice as far.
//! Limits: one plane; where the motion is unknown for more than a tenth of the frames the ground is not steady, and the image is drawn instead.

use super::picture::Picture;
use crate::{CameraMotion, Homography, View};
use nalgebra::Vector2;

/// How far the ground moves from one picture to the next, as a share of the frame's width.
const FAR: f64 = 0.3;
/// Most pictures, and their longest side, px.
const MOST_PICTURES: usize = 16;
const MOST_SIDE: usize = 512;
/// A camera that came no farther than this share of the frame's width stands.
const STILL_SHARE: f64 = 0.02;

/// The ground so far.
#[derive(Debug)]
pub(super) struct Ground {
    /// From the newest frame to the ground of the first.
    pub first_from_now: Homography,
    /// Pictures with the way from each to the ground.
    pub pictures: Vec<(Picture, Homography)>,
    far: f64,
    /// Farthest that a corner came from its place, as a share of the width.
    moved: f64,
    n_frames: u64,
    n_unknown: u64,
    /// Whether there was another view, of which nobody knows where it lies.
    cut: bool,
}

impl Default for Ground {
    fn default() -> Self {
        Self {
            first_from_now: Homography::identity(),
            pictures: Vec::new(),
            far: FAR,
            moved: 0.0,
            n_frames: 0,
            n_unknown: 0,
            cut: false,
        }
    }
}

impl Ground {
    /// Follows the camera to a view.
    pub fn put(&mut self, view: &View<'_>) {
        let motion = view.scan.camera_motion.filter(CameraMotion::is_finite);
        self.n_unknown += u64::from(self.n_frames > 0 && motion.is_none());
        self.n_frames += 1;
        self.cut |= view.scan.is_cut();
        if let Some(motion) = motion {
            self.first_from_now = motion.now_from_before.inverse().then(&self.first_from_now);
        }
        let Some(frame) = view.frame.filter(|_| view.scan.camera_motion.is_some() || self.n_frames == 1) else {
            return;
        };
        let (w, h) = (frame.pixels.width() as f64, frame.pixels.height() as f64);
        let corners = [[0.0, 0.0], [w, 0.0], [0.0, h], [w, h], [w / 2.0, h / 2.0]].map(|[x, y]| Vector2::new(x, y));
        let from_home = corners.map(|c| (self.first_from_now.apply(c) - c).norm());
        self.moved = from_home.iter().fold(self.moved, |a, b| a.max(b / w.max(1.0)));
        let middle = corners[4];
        let here = self.first_from_now.apply(middle);
        let near = |(_, first_from): &(Picture, Homography)| (first_from.apply(middle) - here).norm() < self.far * w;
        if !self.pictures.iter().any(near) {
            if self.pictures.len() >= MOST_PICTURES {
                let mut k = 0;
                self.pictures.retain(|_| {
                    k += 1;
                    k % 2 == 1
                });
                self.far *= 2.0;
            }
            self.pictures.push((Picture::of_frame_within(frame, MOST_SIDE), self.first_from_now));
        }
    }

    /// Where a point of the newest frame lies on the ground, px.
    pub fn place(&self, x: f32, y: f32) -> [f32; 2] {
        let p = self.first_from_now.apply(Vector2::new(f64::from(x), f64::from(y)));
        [p.x as f32, p.y as f32]
    }

    /// Whether the camera moves and is known well enough to draw on the ground.
    pub fn is_steadied(&self) -> bool {
        !self.cut && self.moved > STILL_SHARE && 10 * self.n_unknown <= self.n_frames && !self.pictures.is_empty()
    }

    /// Left, top, width and height of the pictures on the ground, px.
    pub fn field(&self) -> Option<[f64; 4]> {
        let corners = self.pictures.iter().flat_map(|(p, first_from)| {
            let (w, h) = (p.width as f64 - 0.5, p.height as f64 - 0.5);
            [[-0.5, -0.5], [w, -0.5], [-0.5, h], [w, h]].map(|[x, y]| first_from.apply(Vector2::new(x, y)))
        });
        let all: Vec<Vector2<f64>> = corners.filter(|c| c.iter().all(|v| v.is_finite())).collect();
        let (first, rest) = all.split_first()?;
        let (low, high) = rest.iter().fold((*first, *first), |(low, high), c| (low.inf(c), high.sup(c)));
        Some([low.x, low.y, high.x - low.x, high.y - low.y])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Frame, FrameIndex, Image, Pixels, Scan, Timestamp};

    /// The ground after 100 frames of 100 x 80 px over which the background goes left by `step` px a frame, with a motion unless `unknown`.
    fn ground(step: f64, unknown: impl Fn(u64) -> bool) -> Ground {
        let mut ground = Ground::default();
        for k in 0..100 {
            let (index, time) = (FrameIndex(k), Timestamp::from_ns(k as i64));
            let frame = Frame { index, time, pixels: Pixels::Gray8(Image::filled(100, 80, 9)) };
            let mut scan = Scan::at(index, time);
            let motion = CameraMotion::exact_shift(Vector2::new(-step, 0.0));
            scan.camera_motion = (k > 0 && !unknown(k)).then_some(motion);
            ground.put(&View { frame: Some(&frame), scan: &scan, tracks: &[] });
        }
        ground
    }

    #[test]
    fn a_point_of_the_ground_stays_where_it_is_while_the_camera_goes_on() {
        let ground = ground(5.0, |_| false);
        // What lay at (500, 10) in the first frame has gone 99 x 5 px to the left.
        assert_eq!(ground.place(500.0 - 495.0, 10.0), [500.0, 10.0]);
        assert!(ground.is_steadied());
        let [left, top, width, height] = ground.field().unwrap();
        assert!((left, top, height) == (-0.5, -0.5, 80.0) && (550.0..=596.0).contains(&width), "{width}");
        // 17 places 30 px apart are one too many: 60 px then.
        assert!((8..=MOST_PICTURES).contains(&ground.pictures.len()), "{}", ground.pictures.len());
    }

    #[test]
    fn a_camera_that_stands_or_is_not_known_is_no_steady_ground() {
        assert!(!ground(0.0, |_| false).is_steadied());
        assert!(!ground(5.0, |k| k % 4 == 0).is_steadied());
        assert!(ground(500.0, |_| false).pictures.len() <= MOST_PICTURES);
    }
}
