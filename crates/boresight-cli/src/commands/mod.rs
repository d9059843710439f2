//! One file a command: its arguments and what it does.

pub mod completions;
#[allow(dead_code)] // until the command line names it
pub mod convert;
#[allow(dead_code)] // until the command line names it
pub mod evaluate;
#[allow(dead_code)] // until the command line names it
pub mod reproduce;
pub mod config;
pub mod detect;
pub mod fuse;
pub mod reproduce;
mod run_options;
#[allow(dead_code)] // until the command line names it
pub mod simulate;
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
