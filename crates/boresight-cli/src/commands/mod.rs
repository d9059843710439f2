//! One file a command: its arguments and what it does.

pub mod completions;
pub mod config;
pub mod convert;
pub mod detect;
pub mod evaluate;
pub mod fuse;
pub mod reproduce;
mod run_options;
pub mod simulate;
pub mod smooth;
pub mod stitch;
pub mod track;

use std::io::Write;

/// Writes bytes to standard output; a reader that went away (`| head`) is not an error.
pub fn print(bytes: &[u8]) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        other => other,
    }
}
