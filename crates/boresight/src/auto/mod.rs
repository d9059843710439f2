//! The automatic choice: looks at the first frames and writes the configuration that a person would have chosen, with reasons.
//!
//! Source: our own. It only reads frames and proposes a [`Config`]; the run itself uses that configuration and nothing else, so
//! the same configuration given back gives the identical result.

mod detections;
mod open;
mod replay;
mod spots;

pub use detections::for_detections;
pub use open::{Opened, PROBE_FRAMES, open};
pub use replay::Replay;

use crate::{Config, Frame, Result, SourceInfo};

/// A proposed configuration and why.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// The configuration.
    pub config: Config,
    /// What was seen and chosen, a sentence each.
    pub reasons: Vec<String>,
}

/// Proposes a configuration from the first frames of a sequence.
/// # Errors
/// Frames of more than one size or pixel type.
pub fn choose(frames: &[Frame], info: &SourceInfo, base: &Config) -> Result<Choice> {
    let mut reasons = Vec::new();
    let mut config = base.clone();
    let interval_s = interval_s(frames, info);
    reasons.push(format!(
        "{} x {} {:?}, {:.4} frames/s ({}), from {} first frames.",
        info.width,
        info.height,
        info.kind,
        1.0 / interval_s,
        if info.true_times { "the file's times" } else { "no times in the input: the given rate" },
        frames.len()
    ));
    let evidence = spots::look(frames, info)?;
    spots::configure(&evidence, info, interval_s, &mut config, &mut reasons);
    Ok(Choice { config, reasons })
}

/// Median time between frames, s; from the nominal rate if there are too few frames.
fn interval_s(frames: &[Frame], info: &SourceInfo) -> f64 {
    let mut gaps: Vec<f64> =
        frames.windows(2).map(|w| w[1].time.seconds_since(w[0].time)).filter(|g| *g > 0.0).collect();
    gaps.sort_by(f64::total_cmp);
    gaps.get(gaps.len() / 2)
        .copied()
        .or_else(|| info.rate_hz.map(|r| 1.0 / r))
        .filter(|g| g.is_finite() && *g > 0.0)
        .unwrap_or(0.04)
}

/// Three significant digits: what a person would write.
fn round(v: f64) -> f64 {
    if v == 0.0 || !v.is_finite() {
        return v;
    }
    let digits = (2.0 - v.abs().log10().floor()).clamp(0.0, 12.0) as usize;
    format!("{v:.digits$}").parse().unwrap_or(v)
}
