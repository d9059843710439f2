//! The automatic choice: looks at the first frames and writes the configuration that a person would have chosen, with reasons.
//!
//! Source: our own. It only reads frames and proposes a [`Config`]; the run itself uses that configuration and nothing else, so
//! the same configuration given back gives the identical result.

mod cells;
mod colour;
mod detections;
mod further;
mod moving;
mod open;
mod particles;
mod replay;
mod scene;
mod spots;

pub use detections::for_detections;
pub use further::{FURTHER_FRAMES, open_and_choose};
pub use open::{Opened, PROBE_FRAMES, open};
pub use replay::Replay;

use crate::io::Colour;
use crate::{Config, Frame, Result, SourceInfo};
use scene::Camera;

/// A proposed configuration and why.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// The configuration.
    pub config: Config,
    /// What was seen and chosen, a sentence each.
    pub reasons: Vec<String>,
}

/// Proposes a configuration from the first frames of a sequence; [`open_and_choose`] also looks further on and in colour.
/// # Errors
/// Frames of more than one size or pixel type.
pub fn choose(frames: &[Frame], info: &SourceInfo, base: &Config) -> Result<Choice> {
    choose_with(frames, info, base, &mut Vec::new)
}

/// As [`choose`]; `further` gives frames from further on, in colour if there is any, or none.
fn choose_with(
    frames: &[Frame],
    info: &SourceInfo,
    base: &Config,
    further: &mut dyn FnMut() -> Vec<Frame>,
) -> Result<Choice> {
    let mut reasons = Vec::new();
    let mut config = base.clone();
    let interval_s = interval_s(frames, info);
    let mut scene = scene::look(frames, info)?;
    let more = if scene.camera == Camera::Fixed { further() } else { Vec::new() };
    let n_looked = frames.len().max(more.len());
    let looked = if more.is_empty() { frames } else { &more };
    let over_s = match (frames.first(), looked.last()) {
        (Some(first), Some(last)) => last.time.seconds_since(first.time),
        _ => 0.0,
    };
    reasons.push(format!(
        "{} x {} {:?}, {:.4} frames/s ({}), from {n_looked} {} of the first {over_s:.1} s.",
        info.width,
        info.height,
        info.kind,
        1.0 / interval_s,
        if info.true_times { "the file's times" } else { "no times in the input: the given rate" },
        if n_looked == 1 { "frame" } else { "frames" },
    ));
    if !more.is_empty() {
        scene = scene::look(&more, &SourceInfo { kind: more[0].pixels.kind(), ..info.clone() })?;
    }
    // Who asks for grey gets grey.
    let coloured = base.input.colour != Colour::Gray;
    if let Some(reference) = coloured.then(|| colour::look(&more, &scene)).flatten() {
        colour::configure(&reference, &scene, info, interval_s, &mut config, &mut reasons);
    } else if moving::fits(&scene, info) {
        moving::configure(&scene, info, interval_s, &mut config, &mut reasons);
    } else if let Some(seen) = particles::look(frames, &scene, info)? {
        particles::configure(&seen, info, interval_s, &mut config, &mut reasons);
    } else if let Some(seen) = cells::look(frames, info)? {
        cells::configure(&seen, info, interval_s, &mut config, &mut reasons);
    } else {
        let evidence = spots::look(frames, info)?;
        spots::configure(&evidence, info, interval_s, &mut config, &mut reasons);
    }
    Ok(Choice { config, reasons })
}

/// Usual time between frames, s; from the nominal rate if there are too few frames.
///
/// The mean of the gaps near their median: pauses do not count, and times rounded to milliseconds (MKV) or hundredths (GIF) even
/// out.
fn interval_s(frames: &[Frame], info: &SourceInfo) -> f64 {
    let mut gaps: Vec<f64> =
        frames.windows(2).map(|w| w[1].time.seconds_since(w[0].time)).filter(|g| *g > 0.0).collect();
    gaps.sort_by(f64::total_cmp);
    let median = gaps.get(gaps.len() / 2).copied().unwrap_or(0.0);
    gaps.retain(|g| (g - median).abs() <= 0.5 * median);
    (!gaps.is_empty())
        .then(|| gaps.iter().sum::<f64>() / gaps.len() as f64)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FrameIndex, Image, PixelKind, Pixels, Timestamp};

    #[test]
    fn times_rounded_to_milliseconds_give_the_rate_and_a_pause_does_not_count() {
        let info = SourceInfo {
            label: String::new(),
            reader: String::new(),
            width: 1,
            height: 1,
            kind: PixelKind::Gray8,
            n_frames: None,
            rate_hz: None,
            true_times: true,
        };
        let frame = |k: i64| {
            let pause_ms = if k < 40 { 0 } else { 5000 };
            let time = Timestamp::from_ns(((k as f64 * 1000.0 / 30.0).round() as i64 + pause_ms) * 1_000_000);
            Frame { index: FrameIndex(k as u64), time, pixels: Pixels::Gray8(Image::filled(1, 1, 0)) }
        };
        let frames: Vec<Frame> = (0..60).map(frame).collect();
        assert!((1.0 / interval_s(&frames, &info) - 30.0).abs() < 0.05, "{}", 1.0 / interval_s(&frames, &info));
        assert_eq!(interval_s(&frames[..1], &info), 0.04);
    }
}
