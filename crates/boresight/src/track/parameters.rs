//! The numbers of a tracker that may change while it runs, and its tracks go on.
//!
//! Source: our own. They say how likely a detection is, not what the tracker does with it: noise, process noise, clutter, detection probability.
//! Symbols: R measurement covariance, px²; q density of the white acceleration, px²/s³; P_D probability of detection.
//! Limits: a density of acceleration, not the discrete noise.

use super::config::TrackerConfig;
use crate::Result;
use serde::{Deserialize, Serialize};

/// What a tracker assumes of noise, motion and detections; each is the key of that name in the tracker's configuration.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrackerParameters {
    /// Factor on stated covariances, above 0.
    pub detection_covariance_scale: f64,
    /// Noise beyond what is stated, px, 0 or more.
    pub extra_noise_px: f64,
    /// The same in box heights, 0 or more.
    pub extra_noise_per_height: f64,
    /// Density of the white acceleration, px²/s³, above 0.
    pub acceleration_density_px2_per_s3: f64,
    /// The same in squared box heights, 1/s³, 0 or more.
    pub acceleration_density_per_height2_per_s3: f64,
    /// Probability that a target is detected, in (0, 1].
    pub detection_probability: f64,
    /// The same after a miss.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub redetection_probability: Option<f64>,
    /// False detections per px² and scan, 0 or more.
    pub clutter_density_per_px2: f64,
}

impl TrackerParameters {
    /// Those of a configuration.
    pub fn of(config: &TrackerConfig) -> Self {
        Self {
            detection_covariance_scale: config.detection_covariance_scale,
            extra_noise_px: config.extra_noise_px,
            extra_noise_per_height: config.extra_noise_per_height,
            acceleration_density_px2_per_s3: config.acceleration_density_px2_per_s3,
            acceleration_density_per_height2_per_s3: config.acceleration_density_per_height2_per_s3,
            detection_probability: config.detection_probability,
            redetection_probability: config.redetection_probability,
            clutter_density_per_px2: config.clutter_density_per_px2,
        }
    }

    /// All of them by the names of their keys in the tracker's configuration, in its order; none where it is not set.
    pub fn values(&self) -> [(&'static str, Option<f64>); 8] {
        [
            ("detection-covariance-scale", Some(self.detection_covariance_scale)),
            ("extra-noise-px", Some(self.extra_noise_px)),
            ("extra-noise-per-height", Some(self.extra_noise_per_height)),
            ("acceleration-density-px2-per-s3", Some(self.acceleration_density_px2_per_s3)),
            ("acceleration-density-per-height2-per-s3", Some(self.acceleration_density_per_height2_per_s3)),
            ("detection-probability", Some(self.detection_probability)),
            ("redetection-probability", self.redetection_probability),
            ("clutter-density-per-px2", Some(self.clutter_density_per_px2)),
        ]
    }

    /// The configuration with them.
    /// # Errors
    /// A value outside its range.
    pub fn in_config(&self, config: &TrackerConfig) -> Result<TrackerConfig> {
        let config = TrackerConfig {
            detection_covariance_scale: self.detection_covariance_scale,
            extra_noise_px: self.extra_noise_px,
            extra_noise_per_height: self.extra_noise_per_height,
            acceleration_density_px2_per_s3: self.acceleration_density_px2_per_s3,
            acceleration_density_per_height2_per_s3: self.acceleration_density_per_height2_per_s3,
            detection_probability: self.detection_probability,
            redetection_probability: self.redetection_probability,
            clutter_density_per_px2: self.clutter_density_per_px2,
            ..config.clone()
        };
        config.validate("tracker")?;
        Ok(config)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_is_named_by_its_key_and_none_is_missing() {
        let config = TrackerConfig { redetection_probability: Some(0.6), ..TrackerConfig::default() };
        let parameters = TrackerParameters::of(&config);
        let serde_json::Value::Object(fields) = serde_json::to_value(parameters).unwrap() else { panic!("an object") };
        let named = |(key, value): (&str, Option<f64>)| (key.replace('-', "_"), value.unwrap());
        let mut all: Vec<(String, f64)> = parameters.values().map(named).to_vec();
        all.sort_by(|a, b| a.0.cmp(&b.0));
        let mut fields: Vec<(String, f64)> = fields.into_iter().map(|(k, v)| (k, v.as_f64().unwrap())).collect();
        fields.sort_by(|a, b| a.0.cmp(&b.0));
        assert_eq!(all, fields);
        // The names are keys of a file.
        for (key, value) in parameters.values() {
            let set = format!("tracker.{key}={:?}", value.unwrap());
            assert!(crate::Config::default().with(&set).is_ok(), "{set}");
        }
    }

    #[test]
    fn what_is_taken_out_of_a_configuration_goes_back_in_and_nonsense_does_not() {
        let config = TrackerConfig { extra_noise_px: 0.7, detection_probability: 0.8, ..TrackerConfig::default() };
        let p = TrackerParameters::of(&config);
        assert_eq!(p.in_config(&TrackerConfig::default()).unwrap(), config);
        for wrong in [f64::NAN, -1.0, 2.0, 0.0] {
            assert!(TrackerParameters { detection_probability: wrong, ..p }.in_config(&config).is_err(), "{wrong}");
        }
    }
}
