//! Checks the scores that `--require` demands.

use super::arguments::Args;
use crate::console::say;
use anyhow::bail;
use boresight::metrics::evaluation::{Better, Value};
use std::process::ExitCode;

/// Whether the demands are met, as an exit code.
pub fn met(args: &Args, combined: &[Value]) -> anyhow::Result<ExitCode> {
    let mut met = true;
    for (name, limit) in &args.require {
        let Some(found) = combined.iter().find(|v| v.name.eq_ignore_ascii_case(name)) else {
            let known: Vec<&str> = combined.iter().map(|v| v.name).collect();
            bail!(
                boresight::Error::new(boresight::ErrorKind::Config, "no such measure")
                    .at(format!("--require {name}"))
                    .hint(format!("one of {}", known.join(", ")))
            );
        };
        let (key, value, at_most) = (found.name, found.value, found.better == Better::Lower);
        let ok = if at_most { value <= *limit } else { value >= *limit };
        if !ok {
            met = false;
            let word = if at_most { "at most" } else { "at least" };
            say!("not met: {key} = {value:.6}, demanded {word} {limit}");
        }
    }
    Ok(if met { ExitCode::SUCCESS } else { ExitCode::from(1) })
}
