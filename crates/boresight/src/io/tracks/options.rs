//! How tables of tracks are read, and what was left out of them.

use crate::{Error, Result};

/// How tables are read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReadOptions {
    /// Leave out malformed rows and count them, instead of failing at the first.
    pub skip_bad_rows: bool,
    /// Keep columns that have no place in a [`crate::TrackTable`] as text (for conversion).
    pub keep_extra: bool,
    /// What the file calls the first frame; `None`: 1 in MOTChallenge tables, 0 in all others.
    pub first_frame: Option<u64>,
}

/// Rows that were left out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BadRows {
    /// How many.
    pub count: u64,
    /// What was wrong with the first of them.
    pub first: Option<String>,
    /// Sound rows that belong to no track (TrackMate's spots outside of tracks), left out as well.
    pub without_track: u64,
}

impl BadRows {
    /// Takes note of a malformed row, or fails where that is not allowed.
    /// # Errors
    /// The mistake itself unless bad rows are skipped.
    pub fn note(&mut self, options: ReadOptions, e: Error) -> Result<()> {
        if !options.skip_bad_rows {
            return Err(e.hint("--skip-bad-rows leaves such rows out and counts them"));
        }
        self.count += 1;
        self.first.get_or_insert_with(|| e.to_string());
        Ok(())
    }
}
