//! Errors of the library as Python has them: `BoresightError` with `.kind`, `.where` and `.hint`.

use boresight::{Error, ErrorKind};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The word of a kind, as `BoresightError.kind` holds it.
fn word(kind: ErrorKind) -> &'static str {
    match kind {
        ErrorKind::Config => "config",
        ErrorKind::NotFound => "not-found",
        ErrorKind::Damaged => "damaged",
        ErrorKind::Unsupported => "unsupported",
        ErrorKind::MissingTool => "missing-tool",
        ErrorKind::Output => "output",
        ErrorKind::Numeric => "numeric",
        ErrorKind::Interrupted => "interrupted",
        _ => "other",
    }
}

/// The library's error as an exception.
pub fn raised(py: Python<'_>, error: &Error) -> PyErr {
    let made = || -> PyResult<PyErr> {
        let kwargs = PyDict::new(py);
        kwargs.set_item("kind", word(error.kind()))?;
        kwargs.set_item("where", error.place())?;
        kwargs.set_item("hint", (!error.hints().is_empty()).then(|| error.hints().join("\n")))?;
        let class = py.import("boresight._errors")?.getattr("BoresightError")?;
        Ok(PyErr::from_value(class.call((error.to_string(),), Some(&kwargs))?))
    };
    made().unwrap_or_else(|e| e)
}

/// A wrong argument as an exception: what, where, mend.
pub fn refused(what: impl Into<String>, place: impl std::fmt::Display, hint: impl Into<String>) -> PyErr {
    Python::attach(|py| raised(py, &Error::new(ErrorKind::Config, what).at(place).hint(hint)))
}

/// Turns the library's results into Python's.
pub trait OrRaise<T> {
    /// The value, or the exception.
    /// # Errors
    /// The library's own.
    fn or_raise(self, py: Python<'_>) -> PyResult<T>;
}

impl<T> OrRaise<T> for boresight::Result<T> {
    fn or_raise(self, py: Python<'_>) -> PyResult<T> {
        self.map_err(|e| raised(py, &e))
    }
}

impl<T> OrRaise<T> for Result<T, boresight_filters::FilterError> {
    fn or_raise(self, py: Python<'_>) -> PyResult<T> {
        self.map_err(|e| raised(py, &Error::from(e)))
    }
}
