//! Detection by a density of targets that is carried from frame to frame, where it was asked for.
//!
//! Source: our own. As fast as in sums ([`super::summed`]), less where a frame is so large that its velocities would take more memory than the detector allows.
//! Limits: never chosen unasked. The camera has to stand still, or to move no faster than targets.

use super::scene::Scene;
use super::summed::{background, max_speed, polarity, write};
use crate::vision::bernoulli::{BernoulliConfig, speed_that_fits};
use crate::vision::threshold::ThresholdConfig;
use crate::{Config, SourceInfo};

/// Writes the detector; `config` is that for isolated targets.
pub fn configure(scene: &Scene, interval_s: f64, info: &SourceInfo, config: &mut Config, reasons: &mut Vec<String>) {
    let wanted = max_speed(interval_s);
    let mut carried = BernoulliConfig {
        max_speed_px_per_s: wanted,
        polarity: polarity(config),
        background: background(scene),
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
