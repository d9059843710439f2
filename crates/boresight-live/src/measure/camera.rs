//! A camera that is none: noise with bright squares that go to and fro, by the clock or as fast as it is read.
//!
//! Cheap, so that what is measured is the run: eight backgrounds of noise are made once, a frame is a copy with squares.

use crate::source::{Connect, Content, Feed};
use boresight::{Frame, FrameIndex, Image, PixelKind, Pixels, Result, SourceInfo, Timestamp};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// What the camera sees.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// Size of a frame, px.
    pub size_px: [usize; 2],
    /// Frames a second.
    pub rate_hz: f64,
    /// Frames in all.
    pub n_frames: u64,
    /// Targets: squares of 7 px.
    pub n_targets: u64,
    /// A target is seen this long, then away for half of it, s; infinite: always seen.
    pub seen_s: f64,
}

/// Side of a target, px.
const SIDE: usize = 7;

/// The camera.
pub struct Camera {
    view: View,
    info: SourceInfo,
    backgrounds: Arc<Vec<Image<u8>>>,
    k: u64,
    /// When it started; `None`: it does not look at the clock.
    started: Option<Instant>,
}

/// Connects to the camera.
pub struct CameraPlug(pub View, pub Option<Instant>);

impl Connect for CameraPlug {
    fn connect(&mut self) -> Result<Box<dyn Feed>> {
        Ok(Box::new(Camera::new(self.0, self.1)))
    }

    fn is_endless(&self) -> bool {
        false
    }

    fn newest_counts(&self) -> bool {
        self.1.is_some()
    }
}

impl Camera {
    fn new(view: View, started: Option<Instant>) -> Self {
        let [w, h] = view.size_px;
        let mut state = 1u64;
        let mut noise = || {
            // Knuth's multiplier; the high bits are random enough to look like noise.
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            60 + ((state >> 59) as u8 & 7) + ((state >> 51) as u8 & 7)
        };
        let backgrounds = (0..8).map(|_| {
            let mut image = Image::filled(w, h, 0u8);
            image.as_mut_slice().iter_mut().for_each(|v| *v = noise());
            image
        });
        let info = SourceInfo {
            label: "simulated".into(),
            reader: "simulated camera".into(),
            width: w,
            height: h,
            kind: PixelKind::Gray8,
            n_frames: None,
            rate_hz: Some(view.rate_hz),
            true_times: true,
        };
        Self { view, info, backgrounds: Arc::new(backgrounds.collect()), k: 0, started }
    }

    /// Where a target's top left corner is at a time, if it is seen.
    fn corner(&self, target: u64, t: f64) -> Option<[usize; 2]> {
        let i = target as f64;
        if self.view.seen_s.is_finite() && (t + 7.0 * i) % (1.5 * self.view.seen_s) > self.view.seen_s {
            return None;
        }
        let fold = |v: f64, room: f64| (v.rem_euclid(2.0 * room) - room).abs();
        let [w, h] = self.view.size_px.map(|s| (s - SIDE) as f64);
        let x = fold(w * (0.13 + 0.31 * i) + (0.04 + 0.004 * i) * w * t, w);
        let y = fold(h * (0.21 + 0.17 * i) + (0.03 - 0.003 * i) * h * t, h);
        Some([x as usize, y as usize])
    }
}

impl Feed for Camera {
    fn next(&mut self) -> Result<Option<Content>> {
        if self.k >= self.view.n_frames {
            return Ok(None);
        }
        let t = self.k as f64 / self.view.rate_hz;
        let mut time = Timestamp::from_secs_f64(t);
        if let Some(started) = self.started {
            std::thread::sleep((started + Duration::from_secs_f64(t)).saturating_duration_since(Instant::now()));
            // The frame carries the time at which its light fell.
            time = Timestamp::from_ns(i64::try_from(started.elapsed().as_nanos()).unwrap_or(i64::MAX));
        }
        let mut image = self.backgrounds[(self.k % 8) as usize].clone();
        for target in 0..self.view.n_targets {
            if let Some([x, y]) = self.corner(target, t) {
                (y..y + SIDE).for_each(|row| image.row_mut(row)[x..x + SIDE].fill(200));
            }
        }
        self.k += 1;
        let frame = Frame { index: FrameIndex(self.k - 1), time, pixels: Pixels::Gray8(image) };
        Ok(Some(Content::Frame(frame)))
    }

    fn info(&self) -> Option<&SourceInfo> {
        Some(&self.info)
    }
}
