//! Exit codes that scripts can trust, and how an error is shown.

use crate::console::{self, say};
use boresight::ErrorKind;
use std::io::Write;
use std::process::ExitCode;

/// The table of exit codes, shown under every help text.
pub const HELP: &str = "Exit codes:
  0  done
  1  a demand was not met (evaluate --require), an input of a batch failed, or an unforeseen error
  2  wrong usage or configuration
  3  an input is missing, damaged or of a kind that is not read
  4  a program that is needed is not installed (ffmpeg)
  5  an output could not be written
  6  a numerical step could not be done
  130  interrupted; what was finished is on disk";

/// Shows what is asked for (help, version) or wrong in the arguments; returns the exit code.
pub fn usage(words: &clap::Error) -> ExitCode {
    if words.kind() == clap::error::ErrorKind::InvalidUtf8 {
        // clap does not say which; neither its form nor a list of options would help.
        say!("error: not UTF-8, where text is needed: {}", not_utf8().join(", "));
        say!(
            "hint: names of inputs and outputs may be anything; this one would go into a configuration or a manifest, which are text: rename it, or ln -s OLD new"
        );
        return ExitCode::from(2);
    }
    let shown = words.print().and_then(|()| std::io::stdout().flush());
    if words.use_stderr() {
        return ExitCode::from(2);
    }
    console::written(shown).map_or_else(|e| report(&e.into()), |_| ExitCode::SUCCESS)
}

/// The arguments that are no UTF-8, with what is wrong in them as `\\xff`.
fn not_utf8() -> Vec<String> {
    let bad = std::env::args_os().skip(1).filter(|a| a.to_str().is_none());
    bad.map(|a| a.as_encoded_bytes().escape_ascii().to_string()).collect()
}

/// Prints an error to standard error and returns its exit code.
pub fn report(error: &anyhow::Error) -> ExitCode {
    if reader_left(error) {
        return ExitCode::SUCCESS;
    }
    let mut text = format!("{error:#}");
    let kind = error.downcast_ref::<boresight::Error>().map(boresight::Error::kind);
    if kind.is_some() {
        text = error.to_string();
    }
    say!("error: {text}");
    ExitCode::from(match kind {
        Some(ErrorKind::Config) => 2,
        Some(ErrorKind::NotFound | ErrorKind::Damaged | ErrorKind::Unsupported) => 3,
        Some(ErrorKind::MissingTool) => 4,
        Some(ErrorKind::Output) => 5,
        Some(ErrorKind::Numeric) => 6,
        Some(ErrorKind::Interrupted) => 130,
        _ => 1,
    })
}

/// Whether the reader of an output's pipe went away, as `| head` does once it has its lines: no mistake of anybody.
fn reader_left(error: &anyhow::Error) -> bool {
    let broken = |e: &(dyn std::error::Error + 'static)| {
        e.downcast_ref::<std::io::Error>().is_some_and(|e| e.kind() == std::io::ErrorKind::BrokenPipe)
    };
    let output = error.downcast_ref::<boresight::Error>().is_none_or(|e| e.kind() == ErrorKind::Output);
    output && error.chain().any(broken)
}
