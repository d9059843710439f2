//! Frames in memory as a source, for tests.

use crate::{Frame, FrameSource, Result, SourceInfo};

/// The frames, and what describes them.
pub(super) struct InMemory(pub std::vec::IntoIter<Frame>, pub SourceInfo);

impl FrameSource for InMemory {
    fn info(&self) -> &SourceInfo {
        &self.1
    }

    fn next_frame(&mut self) -> Result<Option<Frame>> {
        Ok(self.0.next())
    }
}

/// The frames with what describes them, at the rate of the first two.
pub(super) fn described(frames: Vec<Frame>) -> (Vec<Frame>, SourceInfo) {
    let pixels = &frames[0].pixels;
    let info = SourceInfo {
        label: String::new(),
        reader: String::new(),
        width: pixels.width(),
        height: pixels.height(),
        kind: pixels.kind(),
        n_frames: Some(frames.len() as u64),
        rate_hz: Some(1.0 / frames[1].time.seconds_since(frames[0].time)),
        true_times: true,
    };
    (frames, info)
}
