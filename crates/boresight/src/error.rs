//! Errors that say where, what and how to mend it.

use std::fmt;

/// The result of everything here that can fail.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// What sort of failure it is; the command's exit code follows from it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ErrorKind {
    /// A parameter or a configuration is wrong.
    Config,
    /// An input is missing or cannot be opened.
    NotFound,
    /// An input is damaged or not what it claims.
    Damaged,
    /// An input is sound, but of a kind that is not read here.
    Unsupported,
    /// A program that is needed is not installed.
    MissingTool,
    /// An output cannot be written.
    Output,
    /// A numerical step could not be done.
    Numeric,
    /// The run was interrupted.
    Interrupted,
}

/// An error: place, what, why, mend.
///
/// ```
/// use boresight::{Error, ErrorKind};
/// let e = Error::new(ErrorKind::Config, "expected a probability in (0, 1)")
///     .at("tracker.gate_probability = 1.2")
///     .hint("0.99 keeps 99 % of true detections inside the gate");
/// assert_eq!(e.to_string(), "tracker.gate_probability = 1.2: expected a probability in (0, 1)\nhint: 0.99 keeps 99 % of true detections inside the gate");
/// ```
#[derive(Debug)]
pub struct Error {
    inner: Box<Inner>,
}

#[derive(Debug)]
struct Inner {
    kind: ErrorKind,
    place: Option<String>,
    what: String,
    hints: Vec<String>,
    source: Option<Box<dyn std::error::Error + Send + Sync>>,
}

impl Error {
    /// Builds an error from what was found and expected.
    pub fn new(kind: ErrorKind, what: impl Into<String>) -> Self {
        Self { inner: Box::new(Inner { kind, place: None, what: what.into(), hints: Vec::new(), source: None }) }
    }

    /// Names the place: file, line, key, frame. A place named before stays, behind the new one.
    #[must_use]
    pub fn at(mut self, place: impl fmt::Display) -> Self {
        self.inner.place = Some(match self.inner.place.take() {
            Some(inner) => format!("{place}: {inner}"),
            None => place.to_string(),
        });
        self
    }

    /// Says how to mend it. A hint given before stays, on the line before.
    #[must_use]
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.inner.hints.push(hint.into());
        self
    }

    /// Keeps the error beneath.
    #[must_use]
    pub fn because(mut self, source: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Self {
        self.inner.source = Some(source.into());
        self
    }

    /// The place: file, line, key, frame.
    pub fn place(&self) -> Option<&str> {
        self.inner.place.as_deref()
    }

    /// How to mend it, a line each.
    pub fn hints(&self) -> &[String] {
        &self.inner.hints
    }

    /// What sort of failure it is.
    pub fn kind(&self) -> ErrorKind {
        self.inner.kind
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(place) = &self.inner.place {
            write!(f, "{place}: ")?;
        }
        f.write_str(&self.inner.what)?;
        if let Some(source) = &self.inner.source {
            write!(f, " ({source})")?;
        }
        self.inner.hints.iter().try_for_each(|hint| write!(f, "\nhint: {hint}"))
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.inner.source.as_deref().map(|e| e as &(dyn std::error::Error + 'static))
    }
}

impl From<boresight_filters::FilterError> for Error {
    fn from(e: boresight_filters::FilterError) -> Self {
        Self::new(ErrorKind::Numeric, e.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_later_hint_does_not_hide_the_first() {
        let e = Error::new(ErrorKind::Damaged, "the size changes")
            .at("f")
            .hint("give one sequence")
            .hint("5 frames are kept");
        assert_eq!(e.to_string(), "f: the size changes\nhint: give one sequence\nhint: 5 frames are kept");
    }
}
