//! What a filter can refuse, and why; after an error the filter's state is what it was before.

use core::fmt;

/// Why a filter refused a step; its state is unchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FilterError {
    /// An input held NaN or infinity; the text names the input.
    NotFinite(&'static str),
    /// A covariance could not be factored; the text names it.
    NotPositiveDefinite(&'static str),
    /// A parameter lies outside its range; the text says what was expected.
    OutOfRange(&'static str),
}

impl fmt::Display for FilterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite(what) => write!(f, "{what} is not finite: expected ordinary numbers"),
            Self::NotPositiveDefinite(what) => write!(f, "{what} is not positive definite"),
            Self::OutOfRange(what) => write!(f, "out of range: expected {what}"),
        }
    }
}

impl core::error::Error for FilterError {}
