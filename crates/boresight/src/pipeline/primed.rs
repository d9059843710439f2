//! Shows a detector the first seconds of a recording before anything is detected in them: a background is known from the first frame on.
//!
//! Limits: a stream is not held up, and a recording whose first seconds take too much memory is not read ahead; its background is learnt as it goes.

use crate::io::{MOST_BYTES, MOST_FRAMES, Replay, frames_ahead};
use crate::vision::Detector;
use crate::{FrameSource, SourceInfo};

/// Whether a detector wants to see the first seconds of such a source.
fn wants(detector: &dyn Detector, info: &SourceInfo) -> bool {
    detector.prime_s() > 0.0 && info.n_frames.is_some()
}

/// Shows the detector the first seconds, if it learns from them and they can be held.
pub(crate) fn prime(detector: &mut dyn Detector, frames: &mut Replay) {
    if !wants(detector, frames.info()) {
        return;
    }
    if let Some(first) = frames.read_for(detector.prime_s()).filter(|first| first.len() > 1) {
        // A frame that does not fit the others is met again in its place, and refused there.
        let _ = detector.prime(first);
    }
}

/// As [`prime`]; the source hands out all its frames.
pub(super) fn primed(source: Box<dyn FrameSource>, detector: &mut dyn Detector) -> Box<dyn FrameSource> {
    if !wants(detector, source.info()) {
        return source;
    }
    let most = frames_ahead(source.info(), MOST_FRAMES, MOST_BYTES);
    let mut frames = Replay::new(source, 0).up_to(most);
    prime(detector, &mut frames);
    Box::new(frames)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::threshold::ThresholdConfig;
    use crate::vision::{self, DetectorConfig};
    use crate::{Frame, FrameIndex, Image, PixelKind, Pixels, Result, Scan, Timestamp};

    const SIDE: usize = 64;

    /// A bright square on an even ground that moves 1 px a frame from the first on, at 10 Hz.
    struct Square(SourceInfo, u64);

    impl FrameSource for Square {
        fn info(&self) -> &SourceInfo {
            &self.0
        }
        fn next_frame(&mut self) -> Result<Option<Frame>> {
            let k = self.1;
            self.1 += 1;
            let mut image = Image::filled(SIDE, SIDE, 50u8);
            let left = 5 + k as usize;
            if k < 40 {
                (20..30).for_each(|y| image.row_mut(y)[left..left + 10].fill(150));
            }
            let time = Timestamp::from_ns(k as i64 * 100_000_000);
            Ok((k < 40).then_some(Frame { index: FrameIndex(k), time, pixels: Pixels::Gray8(image) }))
        }
    }

    /// The frames in which the square is found where it is.
    fn found(n_frames: Option<u64>) -> Vec<u64> {
        let info = SourceInfo {
            label: String::new(),
            reader: String::new(),
            width: SIDE,
            height: SIDE,
            kind: PixelKind::Gray8,
            n_frames,
            rate_hz: Some(10.0),
            true_times: true,
        };
        let config = DetectorConfig { threshold: ThresholdConfig::Moving(Default::default()), ..Default::default() };
        let mut detector = vision::build(&config, &info).unwrap();
        let mut source = primed(Box::new(Square(info, 0)), &mut *detector);
        let (mut scan, mut k, mut found) = (Scan::default(), 0, Vec::new());
        while let Some(frame) = source.next_frame().unwrap() {
            assert_eq!(frame.index.0, k, "every frame is handed out");
            detector.detect(&frame, &mut scan).unwrap();
            let near = |x: f64, y: f64| (x - (9.5 + k as f64)).abs() < 1.0 && (y - 24.5).abs() < 1.0;
            if matches!(&scan.detections[..], [d] if near(d.position.x, d.position.y)) {
                found.push(k);
            }
            k += 1;
        }
        assert_eq!(k, 40);
        found
    }

    #[test]
    fn what_moves_from_the_first_frame_on_is_found_in_it() {
        assert_eq!(found(Some(40)), (0..40).collect::<Vec<_>>());
        // A stream is not read ahead: the square is in the background at first.
        assert!(!found(None).contains(&0));
    }
}
