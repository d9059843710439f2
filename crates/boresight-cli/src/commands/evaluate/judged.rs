//! A result with its evaluation and remarks.

use boresight::metrics::evaluation::ResultEvaluation;

/// A result and what there is to say of it.
pub struct Judged {
    pub evaluation: ResultEvaluation,
    pub notes: Vec<String>,
}
