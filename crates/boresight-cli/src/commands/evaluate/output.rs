//! Writes the files of scores: each whole or not at all, and each whatever becomes of the others.

use crate::console::say;
use std::path::Path;

/// The outputs of one evaluation, and why some could not be written.
#[derive(Default)]
pub struct Files {
    unwritten: Vec<boresight::Error>,
}

impl Files {
    /// Writes a text.
    pub fn put(&mut self, path: &Path, text: &str) {
        self.take(boresight::io::write_whole(path, text.as_bytes()));
    }

    /// Takes what became of another output.
    pub fn take(&mut self, outcome: boresight::Result<()>) {
        self.unwritten.extend(outcome.err());
    }

    /// Whether all are written; errors behind the first are said.
    /// # Errors
    /// The first output that could not be written.
    pub fn all_written(self) -> boresight::Result<()> {
        let mut unwritten = self.unwritten.into_iter();
        let first = unwritten.next();
        unwritten.for_each(|e| say!("error: {e}"));
        first.map_or(Ok(()), Err)
    }
}
