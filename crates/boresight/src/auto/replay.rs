//! Reads the first frames of a source ahead and hands them out again, so that looking first costs no frame.

use crate::{Frame, FrameSource, Result, SourceInfo};
use std::collections::VecDeque;

/// A source whose first frames were read ahead.
pub struct Replay {
    ahead: VecDeque<Frame>,
    /// An error met while reading ahead, handed out in its place.
    failed: Option<crate::Error>,
    ended: bool,
    rest: Box<dyn FrameSource>,
}

opaque_debug!(Replay);

impl Replay {
    /// Reads up to `n` frames ahead.
    pub fn new(mut source: Box<dyn FrameSource>, n: usize) -> Self {
        let mut ahead = VecDeque::with_capacity(n);
        let (mut failed, mut ended) = (None, false);
        while ahead.len() < n {
            match source.next_frame() {
                Ok(Some(frame)) => ahead.push_back(frame),
                Ok(None) => {
                    ended = true;
                    break;
                }
                Err(e) => {
                    failed = Some(e);
                    break;
                }
            }
        }
        Self { ahead, failed, ended, rest: source }
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
