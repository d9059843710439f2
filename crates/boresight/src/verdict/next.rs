//! What a verdict proposes to try next: options of `boresight track`.

use crate::Config;
use crate::track::TrackerConfig;
use crate::vision::threshold::ThresholdConfig;

/// What finds more than this detector.
pub(super) fn more_sensitive(config: &Config) -> Option<String> {
    Some(match &config.detector.threshold {
        ThresholdConfig::Cfar(c) => {
            format!("--set detector.threshold.cfar.false-alarms-per-frame={}", 10.0 * c.false_alarms_per_frame)
        }
        ThresholdConfig::Integrate(c) => {
            format!("--set detector.threshold.integrate.false-alarms-per-frame={}", 10.0 * c.false_alarms_per_frame)
        }
        ThresholdConfig::Bernoulli(c) => {
            format!("--set detector.threshold.bernoulli.false-alarms-per-frame={}", 10.0 * c.false_alarms_per_frame)
        }
        ThresholdConfig::Moving(_) | ThresholdConfig::Difference(_) | ThresholdConfig::Colour(_) => {
            "--detector isolated".to_string()
        }
        _ => "--detector cfar".to_string(),
    })
}

/// What looks for something else than this detector.
pub(super) fn another_detector(config: &Config) -> Option<String> {
    let option = match &config.detector.threshold {
        ThresholdConfig::Moving(_) | ThresholdConfig::Difference(_) | ThresholdConfig::Colour(_) => {
            "--detector isolated"
        }
        ThresholdConfig::Isolated(_) | ThresholdConfig::Cfar(_) => "--detector moving",
        _ => "--detector cfar",
    };
    Some(option.to_string())
}

/// Whether the detector looks for particles under a microscope: no other one finds more of those.
pub(super) fn is_of_spots(config: &Config) -> bool {
    matches!(config.detector.threshold, ThresholdConfig::Spot(_))
}

/// The options that multiply the covariance of every measurement by that factor: what the detector states and what is added to it, if that is more than nothing.
pub(super) fn noise_scaled(tracker: &TrackerConfig, factor: f64) -> String {
    const NOTHING: f64 = 1e-3;
    let digits = |v: f64| if v < 0.1 { format!("{v:.2e}") } else { format!("{v:.3}") };
    let mut options =
        format!("--set tracker.detection-covariance-scale={}", digits(tracker.detection_covariance_scale * factor));
    for (key, std) in
        [("extra-noise-px", tracker.extra_noise_px), ("extra-noise-per-height", tracker.extra_noise_per_height)]
    {
        if std > NOTHING {
            options += &format!(" --set tracker.{key}={}", digits(std * factor.sqrt()));
        }
    }
    options
}
