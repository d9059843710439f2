//! Detection by a density of targets that is carried from frame to frame, where it was asked for.
//!
//! Source: our own. Velocities up to [`SPEED`] a frame are searched, less where a frame is so large that they would take more memory than the detector allows.
//! Limits: never chosen unasked. The camera has to stand still, or to move no faster than targets.

use super::scene::{Camera, Scene};
use super::summed::{polarity, write};
use crate::vision::bernoulli::{BernoulliConfig, speed_that_fits};
use crate::vision::integrate::StillBackground;
use crate::vision::threshold::ThresholdConfig;
use crate::{Config, SourceInfo};

/// Largest speed searched, px a frame.
const SPEED: f64 = 2.0;

/// Writes the detector; `config` is that for isolated targets.
pub fn configure(scene: &Scene, interval_s: f64, info: &SourceInfo, config: &mut Config, reasons: &mut Vec<String>) {
    let background = if scene.camera == Camera::Fixed { StillBackground::Temporal } else { StillBackground::Both };
    let wanted = (SPEED / interval_s.max(1e-6)).min(1e5);
    let mut carried = BernoulliConfig {
        max_speed_px_per_s: wanted,
        polarity: polarity(config),
        background,
        ..BernoulliConfig::default()
    };
    carried.max_speed_px_per_s = speed_that_fits(&carried, (info.width, info.height));
    let speed = carried.max_speed_px_per_s;
    let less = if speed < wanted { format!(" ({wanted:.0} take too much memory)") } else { String::new() };
    reasons.push(format!(
        "What may be there is carried from frame to frame, with velocities of up to {speed:.0} px/s along an axis{less}; {:.4} new false targets a \
         frame are allowed (detector.threshold.bernoulli).",
        carried.false_alarms_per_frame,
    ));
    write(ThresholdConfig::Bernoulli(carried), speed, config);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PixelKind;

    #[test]
    fn large_frames_are_searched_for_slower_targets_and_it_is_said() {
        for (width, height, slower) in [(320, 256, false), (640, 512, true), (1920, 1080, true)] {
            let info = SourceInfo {
                label: String::new(),
                reader: String::new(),
                width,
                height,
                kind: PixelKind::Gray8,
                n_frames: None,
                rate_hz: Some(30.0),
                true_times: true,
            };
            let (mut config, mut reasons) = (Config::default(), Vec::new());
            configure(&Scene::default(), 1.0 / 30.0, &info, &mut config, &mut reasons);
            config.validate().unwrap();
            let ThresholdConfig::Bernoulli(c) = &config.detector.threshold else { panic!("{config:?}") };
            assert_eq!(c.max_speed_px_per_s < 59.9, slower, "{width} x {height}: {}", c.max_speed_px_per_s);
            assert_eq!(reasons[0].contains("too much memory"), slower, "{reasons:?}");
        }
    }
}
