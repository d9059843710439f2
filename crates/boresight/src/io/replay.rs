//! Reads the first frames of a source ahead and hands them out again, so that looking first costs no frame.

use crate::{Frame, FrameSource, Result, SourceInfo};
use std::collections::VecDeque;

/// A source whose first frames were read ahead.
pub struct Replay {
    ahead: VecDeque<Frame>,
    /// An error met while reading ahead, handed out in its place.
    failed: Option<crate::Error>,
    ended: bool,
    /// Most frames that are held.
    most: usize,
    rest: Box<dyn FrameSource>,
}

opaque_debug!(Replay);

impl Replay {
    /// Reads up to `n` frames ahead.
    pub fn new(source: Box<dyn FrameSource>, n: usize) -> Self {
        let mut replay = Self { ahead: VecDeque::with_capacity(n), failed: None, ended: false, most: n, rest: source };
        while replay.read_one() {}
        replay
    }

    /// Lets [`Replay::read_on`] read on, up to `most` frames in all.
    pub(crate) fn up_to(mut self, most: usize) -> Self {
        self.most = most;
        self
    }

    /// Lets the source read on by itself to the first `n` frames, or as many as may be held: for who is going to hold them all.
    pub(crate) fn reading_on(mut self, n: usize) -> Self {
        self.rest.will_hold(n.min(self.most));
        self
    }

    /// The first `n` frames, or as many as may be held, read now if they have not been yet; more if more have.
    pub(crate) fn read_on(&mut self, n: usize) -> &[Frame] {
        while self.ahead.len() < n && self.read_one() {}
        self.ahead()
    }

    /// The frames of the first `time_s` from the first one on, or all of a source that is shorter, read now if they have not been yet; `None` if they are more than may be held.
    pub(crate) fn read_for(&mut self, time_s: f64) -> Option<&[Frame]> {
        let lasts = |ahead: &VecDeque<Frame>| match (ahead.front(), ahead.back()) {
            (Some(first), Some(last)) => last.time.seconds_since(first.time) >= time_s,
            _ => false,
        };
        while !lasts(&self.ahead) {
            if !self.read_one() {
                return (self.ended || self.failed.is_some()).then(|| self.ahead());
            }
        }
        let n = self.ahead.iter().take_while(|f| f.time.seconds_since(self.ahead[0].time) < time_s).count();
        self.ahead().get(..n + 1)
    }

    /// Reads one more frame, if there is one and it may be held.
    fn read_one(&mut self) -> bool {
        if self.ahead.len() >= self.most || self.ended || self.failed.is_some() {
            return false;
        }
        match self.rest.next_frame() {
            Ok(Some(frame)) => {
                self.ahead.push_back(frame);
                return true;
            }
            Ok(None) => self.ended = true,
            Err(e) => self.failed = Some(e),
        }
        false
    }

    /// The number behind that of the last frame read, and whether it is the last that can be read.
    pub(crate) fn end(&self) -> (u64, bool) {
        (self.ahead.back().map_or(0, |f| f.index.0 + 1), self.ended || self.failed.is_some())
    }

    /// The frames read ahead.
    pub fn ahead(&mut self) -> &[Frame] {
        self.ahead.make_contiguous()
    }
}

impl FrameSource for Replay {
    fn info(&self) -> &SourceInfo {
        self.rest.info()
    }

    fn next_frame(&mut self) -> Result<Option<Frame>> {
        if let Some(frame) = self.ahead.pop_front() {
            return Ok(Some(frame));
        }
        if let Some(e) = self.failed.take() {
            return Err(e);
        }
        if self.ended {
            return Ok(None);
        }
        self.rest.next_frame()
    }

    fn recycle(&mut self, frame: Frame) {
        self.rest.recycle(frame);
    }

    fn reads_ahead(&self) -> bool {
        self.rest.reads_ahead()
    }

    fn warnings(&self) -> &[String] {
        self.rest.warnings()
    }
}

/// Most frames that are read ahead: half a minute of most videos. A run with a configuration and the choice that wrote it hold the same ones.
pub(crate) const MOST_FRAMES: usize = 1000;

/// Most memory that frames read ahead take, bytes.
pub(crate) const MOST_BYTES: usize = 256 << 20;

/// How many of at most `most` frames are read ahead within that memory.
pub(crate) fn frames_ahead(info: &SourceInfo, most: usize, most_bytes: usize) -> usize {
    let bytes = info.width.saturating_mul(info.height).saturating_mul(info.kind.bytes()).max(1);
    most.min((most_bytes / bytes).max(2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FrameIndex, Image, PixelKind, Pixels, Timestamp};

    /// Frames of 10 Hz.
    struct Few(SourceInfo, u64, u64);

    impl FrameSource for Few {
        fn info(&self) -> &SourceInfo {
            &self.0
        }
        fn next_frame(&mut self) -> Result<Option<Frame>> {
            let k = self.1;
            self.1 += 1;
            let pixels = Pixels::Gray8(Image::filled(2, 2, 0));
            let time = Timestamp::from_ns(k as i64 * 100_000_000);
            Ok((k < self.2).then_some(Frame { index: FrameIndex(k), time, pixels }))
        }
    }

    #[test]
    fn the_frames_of_some_seconds_are_those_or_all_or_none() {
        let info = info(2, 2, PixelKind::Gray8);
        let of = |n: u64, most: usize| Replay::new(Box::new(Few(info.clone(), 0, n)), 3).up_to(most);
        for (n, most, found) in [(50, 40, Some(11)), (5, 40, Some(5)), (50, 8, None), (0, 8, Some(0))] {
            let mut replay = of(n, most);
            assert_eq!(replay.read_for(1.0).map(<[Frame]>::len), found, "{n} {most}");
            for k in 0..n {
                assert_eq!(replay.next_frame().unwrap().unwrap().index.0, k);
            }
            assert!(replay.next_frame().unwrap().is_none());
        }
    }

    fn info(width: usize, height: usize, kind: PixelKind) -> SourceInfo {
        SourceInfo {
            label: String::new(),
            reader: String::new(),
            width,
            height,
            kind,
            n_frames: None,
            rate_hz: None,
            true_times: true,
        }
    }

    #[test]
    fn memory_bounds_what_is_read_ahead() {
        assert_eq!(frames_ahead(&info(100, 100, PixelKind::Gray8), 50, 1 << 20), 50);
        assert_eq!(frames_ahead(&info(100, 100, PixelKind::GrayF32), 50, 1 << 20), 26);
        assert_eq!(frames_ahead(&info(60_000, 60_000, PixelKind::Rgb8), 50, 1 << 20), 2);
    }
}
