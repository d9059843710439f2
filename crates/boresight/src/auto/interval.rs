//! The usual time between frames.

use crate::{ASSUMED_RATE_HZ, Frame, SourceInfo};

/// Usual time between frames, s; from the nominal rate if there are too few frames.
///
/// The mean of the gaps near their median: pauses do not count, and times rounded to milliseconds (MKV) or hundredths (GIF) even
/// out.
pub fn interval_s(frames: &[Frame], info: &SourceInfo) -> f64 {
    let mut gaps: Vec<f64> =
        frames.windows(2).map(|w| w[1].time.seconds_since(w[0].time)).filter(|g| *g > 0.0).collect();
    gaps.sort_by(f64::total_cmp);
    let median = gaps.get(gaps.len() / 2).copied().unwrap_or(0.0);
    gaps.retain(|g| (g - median).abs() <= 0.5 * median);
    (!gaps.is_empty())
        .then(|| gaps.iter().sum::<f64>() / gaps.len() as f64)
        .or_else(|| info.rate_hz.map(|r| 1.0 / r))
        .filter(|g| g.is_finite() && *g > 0.0)
        .unwrap_or(1.0 / ASSUMED_RATE_HZ)
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
