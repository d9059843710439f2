//! What the command says: standard error for people, standard output for the next program. Either may be full, closed, or its reader gone.
//!
//! Words on standard error never decide over results: what cannot be said is dropped, and the run goes on. What cannot be written to
//! standard output is an error of the output, but for a reader that has enough (`| head`), which is no mistake of anybody.

use boresight::{Error, ErrorKind};
use std::io::Write;

/// Says a line on standard error; `eprintln!` would panic where it cannot be written, and lose the run.
macro_rules! say {
    ($($words:tt)*) => { $crate::console::line(format_args!($($words)*)) };
}
pub(crate) use say;

/// Says a line on standard error, in one write, so that the lines of two programs do not mix.
pub fn line(words: std::fmt::Arguments<'_>) {
    let _ = std::io::stderr().lock().write_all(format!("{words}\n").as_bytes());
}

/// Writes bytes to standard output; says whether anybody still reads it, for a reader that went away is not an error.
/// # Errors
/// [`ErrorKind::Output`] if it cannot be written.
pub fn print(bytes: &[u8]) -> boresight::Result<bool> {
    crate::stdout_at_start::check()?;
    let mut out = std::io::stdout().lock();
    written(out.write_all(bytes).and_then(|()| out.flush()))
}

/// What a write to standard output gave: whether anybody still reads it.
/// # Errors
/// [`ErrorKind::Output`] if it was not written for another reason.
pub fn written(outcome: std::io::Result<()>) -> boresight::Result<bool> {
    match outcome {
        Ok(()) => Ok(true),
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(false),
        Err(e) => Err(Error::new(ErrorKind::Output, "cannot be written").at("standard output").because(e)),
    }
}
