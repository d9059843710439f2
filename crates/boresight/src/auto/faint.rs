//! Faint targets: where hardly anything stands clear of its surroundings, the detector with a stated rate of false alarms may still find more than
//! that rate explains.
//!
//! Source: our own; the test is Poisson's. Over the frames looked at, the number of false alarms has at most the mean and the variance 3 × rate × frames.
//! Limits: texture hides what is as strong as texture; there the detector for isolated targets looks at each one's own surroundings.

use super::spread::spread;
use crate::vision::cfar::CfarConfig;
use crate::vision::config::DetectorConfig;
use crate::vision::threshold::{Polarity, ThresholdConfig};
use crate::{Config, Frame, Result, Scan, SourceInfo};

/// False alarms a frame that the tracker can bear: at 320 x 240 px and 5 px a frame, three within five frames and a gate of 50 px² meet by
/// chance in some 3e-6 of the frames, twice in eight hours.
const FALSE_ALARMS_PER_FRAME: f64 = 1.0;
/// False alarms on real frames may be so many times the number asked for; docs/detect.md measured 1.3 at one a frame, texture may add to that.
const REAL_FACTOR: f64 = 3.0;
/// Deviations by which the number found must exceed the number of false alarms.
const SURE_STDS: f64 = 5.0;
/// Frames looked at.
const LOOKS: usize = 12;

/// Faint targets of one polarity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Faint {
    /// Brighter or darker than the ground.
    pub polarity: Polarity,
    /// Detections a frame.
    pub per_frame: f64,
}

fn detector(polarity: Polarity) -> DetectorConfig {
    let cfar = CfarConfig { false_alarms_per_frame: FALSE_ALARMS_PER_FRAME, polarity, ..CfarConfig::default() };
    DetectorConfig { threshold: ThresholdConfig::Cfar(cfar), max_detections: Some(5000), ..DetectorConfig::default() }
}

/// Counts the detections at that rate in the frames: those of the polarity of which there are more, and the frames looked at.
/// # Errors
/// Frames of more than one size or pixel type.
pub fn count(frames: &[Frame], info: &SourceInfo) -> Result<(Faint, f64)> {
    let mut best = Faint { polarity: Polarity::Bright, per_frame: 0.0 };
    let mut looks = 0.0;
    for polarity in [Polarity::Bright, Polarity::Dark] {
        let mut detector = crate::vision::build(&detector(polarity), info)?;
        let (mut scan, mut n) = (Scan::default(), 0.0);
        looks = 0.0;
        for frame in spread(frames, LOOKS) {
            detector.detect(frame, &mut scan)?;
            n += scan.detections.len() as f64;
            looks += 1.0;
        }
        let per_frame = n / f64::max(looks, 1.0);
        if per_frame > best.per_frame {
            best = Faint { polarity, per_frame };
        }
    }
    Ok((best, looks))
}

/// Faint targets, if there are more detections than false alarms.
/// # Errors
/// Frames of more than one size or pixel type.
pub fn look(frames: &[Frame], info: &SourceInfo) -> Result<Option<Faint>> {
    let (seen, looks) = count(frames, info)?;
    let expected: f64 = REAL_FACTOR * FALSE_ALARMS_PER_FRAME * looks;
    Ok((seen.per_frame * looks > expected + SURE_STDS * expected.sqrt()).then_some(seen))
}

/// Puts the detector for faint targets in the place of that for isolated ones; scores are now -log10 of a number of false alarms.
fn replace(faint: &Faint, config: &mut Config) {
    let camera = config.detector.camera;
    config.detector = detector(faint.polarity);
    config.detector.camera = camera;
    config.tracker.min_initiation_score = 0.0;
}

/// Writes the detector where it was asked for.
pub fn configure_asked(faint: &Faint, config: &mut Config, reasons: &mut Vec<String>) {
    replace(faint, config);
    reasons.push(format!(
        "{:.1} {} things a frame are found at {FALSE_ALARMS_PER_FRAME} false alarm a frame (detector.threshold.cfar.false-alarms-per-frame).",
        faint.per_frame,
        if faint.polarity == Polarity::Dark { "dark" } else { "bright" },
    ));
}

/// Writes the detector where isolated targets are not found.
pub fn configure(faint: &Faint, config: &mut Config, reasons: &mut Vec<String>) {
    replace(faint, config);
    reasons.push(format!(
        "But {:.1} {} things a frame exceed the one false alarm a frame that is allowed: so faint targets are looked for \
         (detector.threshold.cfar).",
        faint.per_frame,
        if faint.polarity == Polarity::Dark { "dark" } else { "bright" },
    ));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FrameIndex, Image, PixelKind, Pixels, Timestamp};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// White noise of 8 counts, with `n` spots of five times that at their peak.
    fn frames(n: usize) -> (Vec<Frame>, SourceInfo) {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let make = |k: u64| {
            let mut image = Image::filled(200, 160, 0u8);
            for y in 0..160 {
                for (x, p) in image.row_mut(y).iter_mut().enumerate() {
                    let mut v = 80.0 + 8.0 * rng.sample::<f64, _>(StandardNormal);
                    for i in 0..n {
                        let (dx, dy) = (x as f64 - 20.0 - 17.0 * i as f64, y as f64 - 30.0 - 11.0 * i as f64);
                        v += 40.0 * (-0.5 * (dx * dx + dy * dy) / 1.69).exp();
                    }
                    *p = v.round() as u8;
                }
            }
            Frame { index: FrameIndex(k), time: Timestamp::from_ns(k as i64), pixels: Pixels::Gray8(image) }
        };
        let info = SourceInfo {
            label: "test".into(),
            reader: "test".into(),
            width: 200,
            height: 160,
            kind: PixelKind::Gray8,
            n_frames: None,
            rate_hz: None,
            true_times: false,
        };
        ((0..12).map(make).collect(), info)
    }

    #[test]
    fn spots_of_five_deviations_are_seen_and_noise_alone_is_not() {
        let (spots, info) = frames(10);
        let seen = look(&spots, &info).unwrap().expect("ten spots");
        assert_eq!(seen.polarity, Polarity::Bright);
        assert!((8.0..13.0).contains(&seen.per_frame), "{seen:?}");
        let (noise, info) = frames(0);
        assert_eq!(look(&noise, &info).unwrap(), None);
    }
}
