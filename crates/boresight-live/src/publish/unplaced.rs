//! Tracks that a wire cannot say because it is not known where on Earth they are: said once, counted.

use crate::board::{Board, add};
use std::sync::Arc;

/// What counts them.
pub(super) struct Unplaced {
    board: Arc<Board>,
    shown: String,
    is_said: bool,
}

impl Unplaced {
    /// For the wire that is shown as this.
    pub fn new(board: Arc<Board>, shown: String) -> Self {
        Self { board, shown, is_said: false }
    }

    /// Counts one event; `why` it cannot be said.
    pub fn count(&mut self, why: &str) {
        add(&self.board.counts.unplaced, 1);
        if !std::mem::replace(&mut self.is_said, true) {
            let (shown, source) = (&self.shown, &self.board.source);
            self.board.say(&format!("warning: {source}: {shown}: a track is not sent, and others like it: {why}"));
        }
    }
}
