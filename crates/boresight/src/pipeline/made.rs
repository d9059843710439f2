//! A frame with what was found in it, as the threads of a run hand it on.

use crate::{Frame, Result, Scan};
use std::time::Duration;

/// One frame with what was found in it.
pub(super) struct Made {
    pub frame: Frame,
    pub scan: Scan,
    /// Time it took to read (or wait for) and to detect.
    pub read: Duration,
    pub detect: Duration,
    /// The source's warnings, if there are new ones.
    pub warnings: Option<Vec<String>>,
}

/// What a finder made last: nothing more, or an error; and warnings that came with it.
pub(super) type Sent = (Result<Option<Made>>, Option<Vec<String>>);

/// A frame that was begun, and whether that was all; or the end; with warnings that came with it.
pub(super) type Begun = (Result<Option<(Made, bool)>>, Option<Vec<String>>);
