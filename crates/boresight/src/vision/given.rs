//! Detections that were made before, handed out frame by frame: the detector of a table whose pictures are at hand.
//!
//! It looks at no pixel. A frame without a scan of its number gets an empty one.

use super::Detector;
use crate::{Frame, Result, Scan};
use std::collections::VecDeque;

/// Hands out scans by the numbers of their frames.
#[derive(Clone, Debug)]
pub struct GivenDetections {
    scans: VecDeque<Scan>,
}

impl GivenDetections {
    /// Takes the scans, in the order of their frames.
    pub fn new(scans: Vec<Scan>) -> Self {
        Self { scans: scans.into() }
    }
}

impl Detector for GivenDetections {
    fn detect(&mut self, frame: &Frame, scan: &mut Scan) -> Result<()> {
        while self.scans.front().is_some_and(|s| s.index < frame.index) {
            self.scans.pop_front();
        }
        *scan = match self.scans.front() {
            Some(s) if s.index == frame.index => self.scans.pop_front().unwrap_or_default(),
            _ => Scan::at(frame.index, frame.time),
        };
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Detection, FrameIndex, Image, Pixels, Timestamp};

    #[test]
    fn each_frame_gets_the_detections_of_its_number() {
        let scan = |k: u64| {
            Scan::at(FrameIndex(k), Timestamp::from_ns(k as i64))
                .with_detections(vec![Detection::point(k as f64, 0.0, 1.0)])
        };
        let mut given = GivenDetections::new(vec![scan(1), scan(2), scan(5)]);
        let mut found = Vec::new();
        for k in [0, 2, 3, 5] {
            let (index, time) = (FrameIndex(k), Timestamp::from_ns(k as i64));
            let mut out = scan(9);
            given.detect(&Frame { index, time, pixels: Pixels::Gray8(Image::default()) }, &mut out).unwrap();
            assert_eq!((out.index, out.time), (index, time));
            found.push(out.detections.first().map(|d| d.position.x));
        }
        assert_eq!(found, [None, Some(2.0), None, Some(5.0)]);
    }
}
