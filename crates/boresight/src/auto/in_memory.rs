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
