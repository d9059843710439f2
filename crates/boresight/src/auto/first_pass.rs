//! The first pass over the frames read ahead: their detections, from which noise and motion are learnt, kept for the run itself.
//!
//! The detector that made them goes on where they end, so a frame is detected once however often it is looked at.

use crate::io::Replay;
use crate::vision::{AtOnce, Detector};
use crate::{Frame, Result, Scan};
use std::collections::VecDeque;

/// A detector whose first scans were made ahead.
pub struct FirstPass {
    scans: VecDeque<Scan>,
    detector: Box<dyn Detector>,
}

impl FirstPass {
    /// Nothing seen yet.
    pub fn new(detector: Box<dyn Detector>) -> Self {
        Self { scans: VecDeque::new(), detector }
    }

    /// What detects in several frames at once, on so many threads.
    pub fn at_once(&self, n_threads: usize) -> AtOnce {
        AtOnce::new(&*self.detector, n_threads)
    }

    /// Takes the next frames of a source; one that the detector refuses ends the pass (`false`), and is refused again in the run.
    pub fn take(&mut self, frames: &[Frame], at_once: &mut AtOnce) -> bool {
        let frames: Vec<&Frame> = frames.iter().collect();
        let mut scans = Vec::with_capacity(frames.len());
        let taken = at_once.detect(&mut *self.detector, &frames, &mut scans).is_ok();
        self.scans.extend(scans);
        taken
    }

    /// Takes frames that are read ahead, or read now as long as they may be held, until `most` are taken in all or the detector refuses one.
    pub fn take_on(&mut self, frames: &mut Replay, at_once: &mut AtOnce, most: usize) {
        while self.scans.len() < most {
            let taken = self.scans.len();
            let ahead = frames.read_on(taken.saturating_add(at_once.n_frames()).min(most));
            let frames = ahead.get(taken..ahead.len().min(most)).unwrap_or_default();
            if frames.is_empty() || !self.take(frames, at_once) {
                return;
            }
        }
    }

    /// Leaves out regions smaller than this, ahead and from now on, as a detector would whose configuration says so and keeps `most` detections a frame; `false`, and nothing done, where it might
    /// have found others.
    pub fn leave_out_below(&mut self, area_px: u32, most: Option<u32>) -> bool {
        // Of a full scan some were left out for those that go now.
        let is_full = |s: &Scan| most.is_some_and(|most| s.detections.len() >= most as usize);
        if self.scans.iter().any(is_full) || !self.detector.leave_out_below(area_px) {
            return false;
        }
        self.scans.iter_mut().for_each(|s| s.detections.retain(|d| d.area_px >= area_px));
        true
    }

    /// The scans made ahead.
    pub fn scans(&mut self) -> &[Scan] {
        self.scans.make_contiguous()
    }
}

impl Detector for FirstPass {
    fn detect(&mut self, frame: &Frame, scan: &mut Scan) -> Result<()> {
        match self.scans.pop_front() {
            Some(ahead) if ahead.index == frame.index => {
                *scan = ahead;
                Ok(())
            }
            _ => {
                self.scans.clear();
                self.detector.detect(frame, scan)
            }
        }
    }

    fn begin(&mut self, frame: &Frame, scan: &mut Scan) -> Result<bool> {
        if self.scans.is_empty() {
            return self.detector.begin(frame, scan);
        }
        self.detect(frame, scan).map(|()| true)
    }

    fn twin(&self) -> Option<Box<dyn Detector>> {
        self.detector.twin()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FrameIndex, Image, Pixels};

    /// Counts how often each frame was seen; refuses frame 3.
    struct Counting(std::sync::Arc<std::sync::Mutex<Vec<u64>>>);
    impl Detector for Counting {
        fn detect(&mut self, frame: &Frame, scan: &mut Scan) -> Result<()> {
            self.0.lock().unwrap().push(frame.index.0);
            if frame.index.0 == 3 {
                return Err(crate::Error::new(crate::ErrorKind::Damaged, "another size"));
            }
            *scan = Scan::at(frame.index, frame.time);
            Ok(())
        }
    }

    fn frame(k: u64) -> Frame {
        Frame {
            index: FrameIndex(k),
            time: crate::Timestamp::from_ns(k as i64),
            pixels: Pixels::Gray8(Image::filled(2, 2, 0)),
        }
    }

    #[test]
    fn a_frame_is_detected_once_and_an_error_comes_in_its_place() {
        let seen = std::sync::Arc::default();
        let frames: Vec<Frame> = (0..5).map(frame).collect();
        let mut pass = FirstPass::new(Box::new(Counting(std::sync::Arc::clone(&seen))));
        let mut at_once = pass.at_once(2);
        assert!(pass.take(&frames[..2], &mut at_once));
        assert_eq!(pass.scans().len(), 2);
        let mut scan = Scan::default();
        for f in &frames {
            assert_eq!(pass.detect(f, &mut scan).is_ok(), f.index.0 != 3);
            assert!(f.index.0 == 3 || scan.index == f.index);
        }
        assert_eq!(*seen.lock().unwrap(), [0, 1, 2, 3, 4]);
    }
}
