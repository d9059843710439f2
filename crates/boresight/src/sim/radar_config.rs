//! What a simulated radar is made of: place, field, errors, misses, clutter, silence; read from TOML.
//!
//! Source: the usual plot model (Y. Bar-Shalom, P. K. Willett, X. Tian, *Tracking and Data Fusion*, 2011, ch. 1).
//! Units: px (or m, whatever the truth has), s, degrees; azimuth from +x towards +y.

use crate::Result;
use crate::validate::check_shown;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A radar.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct RadarConfig {
    /// Name of its files: letters, digits, `-` and `_`.
    pub name: String,
    /// Where it stands (x, y), px.
    pub position_px: [f64; 2],
    /// What it measures.
    pub measures: Measures,
    /// Time from scan to scan, s, above 0.
    pub scan_period_s: f64,
    /// Time of the first scan, s, 0 or more.
    pub first_scan_s: f64,
    /// Probability that a target in the field is detected, 0..=1.
    pub detection_probability: f64,
    /// Mean number of false plots a scan, 0 or more.
    pub clutter_per_scan: f64,
    /// Nearest and farthest range of the field, px, 0 or more.
    pub range_px: [f64; 2],
    /// First and last azimuth of the field, degrees from +x towards +y; at most 360 apart.
    pub sector_deg: [f64; 2],
    /// Error of its clock, s: its times are this much ahead of the truth's.
    pub clock_ahead_s: f64,
    /// Delay from a scan to its report's arrival, s, 0 or more: the arrival is written beside the plot.
    pub delay_s: f64,
    /// Times `[from, to]` in which it sees nothing and sends nothing, s.
    pub silent_s: Vec<[f64; 2]>,
}

impl Default for RadarConfig {
    fn default() -> Self {
        Self {
            name: "radar".into(),
            position_px: [0.0, 0.0],
            measures: Measures::default(),
            scan_period_s: 1.0,
            first_scan_s: 0.0,
            detection_probability: 1.0,
            clutter_per_scan: 0.0,
            range_px: [0.0, 1000.0],
            sector_deg: [-180.0, 180.0],
            clock_ahead_s: 0.0,
            delay_s: 0.0,
            silent_s: Vec::new(),
        }
    }
}

/// What a radar measures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Measures {
    /// Positions, as the papers' ground radar.
    Position(PositionErrors),
    /// Range and azimuth from where it stands.
    RangeAzimuth(PolarErrors),
}

impl Default for Measures {
    fn default() -> Self {
        Self::RangeAzimuth(PolarErrors::default())
    }
}

/// Errors of [`Measures::Position`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct PositionErrors {
    /// Standard deviation of each axis, px, above 0.
    pub std_px: f64,
    /// Constant bias (x, y), px.
    pub bias_px: [f64; 2],
}

impl Default for PositionErrors {
    fn default() -> Self {
        Self { std_px: 1.0, bias_px: [0.0; 2] }
    }
}

/// Errors of [`Measures::RangeAzimuth`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct PolarErrors {
    /// Standard deviation of the range, px, above 0.
    pub range_std_px: f64,
    /// Standard deviation of the azimuth, degrees, above 0, at most 30.
    pub azimuth_std_deg: f64,
    /// Constant bias of the range, px.
    pub range_bias_px: f64,
    /// Constant bias of the azimuth, degrees.
    pub azimuth_bias_deg: f64,
}

impl Default for PolarErrors {
    fn default() -> Self {
        Self { range_std_px: 1.0, azimuth_std_deg: 0.5, range_bias_px: 0.0, azimuth_bias_deg: 0.0 }
    }
}

impl RadarConfig {
    /// Checks all values; `at` names the place in the configuration.
    /// # Errors
    /// [`crate::ErrorKind::Config`] that names the first wrong parameter.
    pub fn validate(&self, at: &str) -> Result<()> {
        let check =
            |ok: bool, key: &str, value: &dyn std::fmt::Debug, want: &str| check_shown(ok, at, key, value, want);
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        let not_negative = |v: f64| v >= 0.0 && v.is_finite();
        let positive = |v: f64| v > 0.0 && v.is_finite();
        let finite = |v: &[f64]| v.iter().all(|v| v.is_finite());
        check(!self.name.is_empty() && self.name.chars().all(plain), "name", &self.name, "letters, digits, - and _")?;
        check(finite(&self.position_px), "position-px", &self.position_px, "finite numbers")?;
        check(positive(self.scan_period_s), "scan-period-s", &self.scan_period_s, "a time above 0")?;
        check(not_negative(self.first_scan_s), "first-scan-s", &self.first_scan_s, "a time, 0 or more")?;
        let p = self.detection_probability;
        check((0.0..=1.0).contains(&p), "detection-probability", &p, "a probability, 0..=1")?;
        let n = self.clutter_per_scan;
        check((0.0..=1e6).contains(&n), "clutter-per-scan", &n, "a number from 0 to 1e6")?;
        let [near, far] = self.range_px;
        check(not_negative(near) && positive(far) && near < far, "range-px", &self.range_px, "[nearest, farthest]")?;
        let [from, to] = self.sector_deg;
        check(
            finite(&[from, to]) && from < to && to - from <= 360.0,
            "sector-deg",
            &self.sector_deg,
            "[first, last] at most 360 apart",
        )?;
        check(self.clock_ahead_s.is_finite(), "clock-ahead-s", &self.clock_ahead_s, "a finite time")?;
        check(not_negative(self.delay_s), "delay-s", &self.delay_s, "a time, 0 or more")?;
        check(self.silent_s.iter().all(|[a, b]| a <= b), "silent-s", &self.silent_s, "pairs [from, to]")?;
        match &self.measures {
            Measures::Position(e) => {
                check(positive(e.std_px), "measures.position.std-px", &e.std_px, "a number above 0")?;
                check(finite(&e.bias_px), "measures.position.bias-px", &e.bias_px, "finite numbers")
            }
            Measures::RangeAzimuth(e) => {
                let key = |k: &str| format!("measures.range-azimuth.{k}");
                check(positive(e.range_std_px), &key("range-std-px"), &e.range_std_px, "a number above 0")?;
                let (std, bias) = (e.azimuth_std_deg, e.azimuth_bias_deg);
                check(positive(std) && std <= 30.0, &key("azimuth-std-deg"), &std, "an angle above 0, at most 30")?;
                check(e.range_bias_px.is_finite(), &key("range-bias-px"), &e.range_bias_px, "a finite number")?;
                check(bias.is_finite(), &key("azimuth-bias-deg"), &bias, "a finite number")
            }
        }
    }
}
