//! What an evaluation has to say beside its numbers.

use crate::metrics::sanity::SanityWarning;
use std::fmt;

/// A remark on an evaluation; shown as a sentence.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Note {
    /// Truth and result may not belong together.
    Sanity(SanityWarning),
    /// Trajectory GOSPA was not computed, for this reason.
    TrajectoryGospaLeftOut(String),
    /// The NIS was not computed: the result's rows do not name their detections.
    NoDetectionColumn,
    /// So many rows have no NIS: their detection is not there, or their state is no better known than it.
    NisRowsLeftOut(u64),
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Sanity(warning) => warning.fmt(f),
            Self::TrajectoryGospaLeftOut(reason) => write!(f, "TGOSPA is left out: {reason}"),
            Self::NoDetectionColumn => write!(f, "NIS needs the column detection of boresight's tracks.csv"),
            Self::NisRowsLeftOut(n) => {
                write!(
                    f,
                    "NIS leaves out {n} rows: no such detection, one seen before its frame's time, or a state no better known than its detection"
                )
            }
        }
    }
}
