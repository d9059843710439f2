//! What a run of `track` or `detect` came to: its exit code, and what was fitted.

use crate::console::say;
use boresight::pipeline::Outcome;
use boresight::{Error, ErrorKind};
use std::ffi::OsStr;
use std::process::ExitCode;

/// A sentence on how many positions are fitted, where a fit was asked for.
pub fn fits(s: &boresight::pipeline::Summary) -> Option<String> {
    let [fitted, kept] = s.fits;
    (fitted + kept > 0).then(|| {
        format!(
            "{fitted} positions by fitted spots; {kept} by the centroid, since the fit was poor or the target too large"
        )
    })
}

/// The exit code of a run, or what went wrong: an output that is not there weighs more than an input that breaks off.
/// # Errors
/// The first output's that was abandoned (the others are said), what broke the run off, an input without a frame.
pub fn outcome(input: &OsStr, done: Outcome) -> anyhow::Result<ExitCode> {
    let Outcome { summary, broken, unwritten } = done;
    let kept = match summary.frames {
        0 => "nothing is written; what an earlier run wrote stays".to_string(),
        1 => "the frame before it is in the results".to_string(),
        n => format!("the {n} frames before it are in the results"),
    };
    let mut errors: Vec<Error> = unwritten;
    errors.extend(broken.map(|e| e.hint(&kept)));
    if errors.is_empty() && summary.frames == 0 && !summary.interrupted {
        errors.push(Error::new(ErrorKind::Damaged, "holds no frames").at(input.display()).hint(kept));
    }
    let mut errors = errors.into_iter();
    let Some(first) = errors.next() else {
        return Ok(if summary.interrupted { ExitCode::from(130) } else { ExitCode::SUCCESS });
    };
    for other in errors {
        say!("error: {other}");
    }
    Err(first.into())
}
