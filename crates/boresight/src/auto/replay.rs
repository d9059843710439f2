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
    pub(super) fn up_to(mut self, most: usize) -> Self {
        self.most = most;
        self
    }

    /// The first `n` frames, or as many as may be held, read now if they have not been yet; more if more have.
    pub(super) fn read_on(&mut self, n: usize) -> &[Frame] {
        while self.ahead.len() < n && self.read_one() {}
        self.ahead()
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
