//! What `boresight sensor` found, in words and as options.

use boresight::sensor::{Defects, Level, TransferCurve};
use std::fmt::Write as _;

/// What was measured.
pub(super) struct Measured {
    pub(super) input: String,
    pub(super) size: (usize, usize),
    pub(super) n_frames: u32,
    pub(super) curve: TransferCurve,
    pub(super) dark: Option<Level>,
    pub(super) defects: Defects,
    /// Bad pixels are those of the dark frames.
    pub(super) of_dark: bool,
}

/// Whether hardly more than the rounding was seen of the noise.
fn is_hidden(curve: &TransferCurve) -> bool {
    curve.variance < 2.0 * curve.rounding
}

/// The options that use what was measured.
pub(super) fn options(m: &Measured) -> Vec<String> {
    let [read, gain, offset] = m.curve.noise(m.dark);
    let mut out = Vec::new();
    if !is_hidden(&m.curve) {
        out.push(format!(
            "--set 'detector.noise.given={{read-counts={read:.4}, gain={gain:.5}, offset-counts={offset:.3}}}'"
        ));
    }
    if is_hidden(&m.curve) && !m.of_dark {
        return out;
    }
    if !m.defects.pixels.is_empty() {
        out.push("--set input.sensor.bad-pixels=true".to_string());
    }
    if !m.defects.columns.is_empty() && !m.of_dark {
        out.push("--set input.sensor.column-noise=true".to_string());
    }
    out
}

/// Sentences about the sensor.
pub(super) fn sentences(m: &Measured) -> Vec<String> {
    let [read, gain, offset] = m.curve.noise(m.dark);
    let mut out = Vec::new();
    match m.curve.line.filter(|_| m.curve.has_gain()) {
        Some(line) => {
            out.push(format!("gain {gain:.4} counts (line: {:.4} ± {:.4})", line.slope, line.slope_sd));
            out.push(match m.dark {
                Some(_) => format!("offset {offset:.2} counts and read noise {read:.3} counts, from the dark frames"),
                None => format!(
                    "variance {:.2} counts² at 0 counts: offset and read noise cannot be told apart without --dark; {offset:.2} and {read:.3} counts describe them",
                    line.intercept
                ),
            });
        }
        None if is_hidden(&m.curve) => out.push(
            "noise below the rounding: the frames are copies of one another (a codec, a still picture), and nothing is known of it"
                .to_string(),
        ),
        None => out.push(format!(
            "noise {:.3} counts, the same for all light that was seen: no gain to be told",
            m.curve.variance.sqrt()
        )),
    }
    if is_hidden(&m.curve) && !m.of_dark {
        out.push(
            "defects are not looked for: without noise a still scene's own points cannot be told from them".to_string(),
        );
        return out;
    }
    let bad = &m.defects.pixels;
    let some: Vec<String> = bad.iter().take(8).map(|[x, y]| format!("({x}, {y})")).collect();
    let more = if bad.len() > 8 { " .." } else { "" };
    let place = if m.of_dark { " in the dark frames" } else { "" };
    out.push(match bad.len() {
        0 => format!("no bad pixels{place}"),
        1 => format!("1 bad pixel{place}: {}", some.join(" ")),
        n => format!("{n} bad pixels{place}: {}{more}", some.join(" ")),
    });
    out.push(match m.defects.columns.len() {
        0 => format!("columns even{place}"),
        _ => format!("offsets of columns{place}: {:.3} counts rms", m.defects.column_rms()),
    });
    out
}

/// What is printed.
pub(super) fn text(m: &Measured) -> String {
    let mut out = format!("{} frames of {} x {} px\n", m.n_frames, m.size.0, m.size.1);
    for s in sentences(m) {
        let _ = writeln!(out, "{s}");
    }
    let options = options(m);
    if !options.is_empty() {
        let _ = writeln!(out, "options: {}", options.join(" "));
    }
    out
}
