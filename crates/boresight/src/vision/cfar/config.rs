//! What the detector of a stated false-alarm rate is told: the rate, the sizes, the polarity.

use crate::Result;
use crate::validate::check;
use crate::vision::polarity::Polarity;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Targets that stand out more than a stated number of false alarms a frame would.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct CfarConfig {
    /// Expected number of false detections a frame, 1e-9..=1e4. Lower is surer and misses dimmer targets. A detection's
    /// score is -log10 of the expected number of false detections a frame at least as strong.
    pub false_alarms_per_frame: f64,
    /// The same for a million pixels, 1e-9..=1e4; if given, it stands in place of `false-alarms-per-frame`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub false_alarms_per_megapixel: Option<f64>,
    /// Diameter at half height of the smallest target looked for, px, 1...
    pub smallest_px: f64,
    /// Longest side of the largest target looked for, px; two fifths of the frame's shorter side if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub largest_px: Option<f64>,
    /// Which contrast is looked for.
    pub polarity: Polarity,
}

impl Default for CfarConfig {
    fn default() -> Self {
        Self {
            false_alarms_per_frame: 0.1,
            false_alarms_per_megapixel: None,
            smallest_px: 1.0,
            largest_px: None,
            polarity: Polarity::Bright,
        }
    }
}

impl CfarConfig {
    /// Checks every parameter; `at` is the path of this table.
    /// # Errors
    /// The first parameter out of its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        let rate = |key: &str, v: f64| {
            check((1e-9..=1e4).contains(&v), at, key, v, "1e-9 to 1e4", "0.1 is one false detection in ten frames")
        };
        rate("false-alarms-per-frame", self.false_alarms_per_frame)?;
        if let Some(v) = self.false_alarms_per_megapixel {
            rate("false-alarms-per-megapixel", v)?;
        }
        let small = self.smallest_px;
        check(
            (1.0..=1e5).contains(&small),
            at,
            "smallest-px",
            small,
            "1 to 100000 px",
            "1 looks for single pixels too",
        )?;
        if let Some(large) = self.largest_px {
            let ok = large >= small && large <= 1e5;
            check(ok, at, "largest-px", large, "smallest-px to 100000 px", "leave it out for two fifths of the frame")?;
        }
        Ok(())
    }

    /// The expected number of false detections in a frame of so many pixels.
    pub fn rate(&self, pixels: usize) -> f64 {
        self.false_alarms_per_megapixel.map_or(self.false_alarms_per_frame, |r| r * pixels as f64 * 1e-6)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_of_nothing_and_sizes_upside_down_are_refused() {
        let e = |c: CfarConfig| c.validate("detector.threshold.cfar").unwrap_err().to_string();
        let none = e(CfarConfig { false_alarms_per_frame: 0.0, ..Default::default() });
        assert!(none.starts_with("detector.threshold.cfar.false-alarms-per-frame = 0: expected 1e-9 to 1e4"), "{none}");
        assert!(e(CfarConfig { largest_px: Some(3.0), smallest_px: 4.0, ..Default::default() }).contains("largest-px"));
        assert!(
            e(CfarConfig { false_alarms_per_megapixel: Some(f64::NAN), ..Default::default() }).contains("megapixel")
        );
    }

    #[test]
    fn a_rate_for_a_megapixel_follows_the_size_of_the_frame() {
        let c = CfarConfig { false_alarms_per_megapixel: Some(2.0), ..Default::default() };
        assert!((c.rate(500_000) - 1.0).abs() < 1e-12);
        assert!((CfarConfig::default().rate(500_000) - 0.1).abs() < 1e-12);
    }
}
