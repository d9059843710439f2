//! How a radar's table of range and azimuth is read: what azimuths count from, own ship, turns, errors, known biases.

use crate::{Error, ErrorKind, Result};
use serde::{Deserialize, Serialize};

/// What an azimuth is counted from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AzimuthFrom {
    /// From north (+y), clockwise.
    #[default]
    North,
    /// From the bow of own ship, clockwise; needs its heading.
    Bow,
    /// From +x towards +y, as mathematics and this program's simulated radars count.
    XAxis,
}

/// How a table of range and azimuth is read; of no effect on other tables.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct RadarOptions {
    /// Table of own ship's positions and headings; absent: `NAME-ownship.csv` beside `NAME-plots.csv`, or `ownship.csv`, or else the radar stands at (0, 0).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub own_ship: Option<String>,
    /// What azimuths are counted from: `north` (clockwise), `bow` (clockwise, own ship's heading is added) or `x-axis` (towards +y).
    pub azimuth_from: AzimuthFrom,
    /// Time of a turn of the antenna, s, above 0; absent: found from azimuths and times.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub turn_s: Option<f64>,
    /// Standard deviation of a range where the table has none, m, above 0.
    pub range_std_m: f64,
    /// Standard deviation of an azimuth where the table has none, degrees, above 0, at most 30.
    pub azimuth_std_deg: f64,
    /// What is taken off every range, m: what `fuse --register range` found.
    pub range_bias_m: f64,
    /// What is taken off every azimuth, degrees in the table's own sense: what `fuse --register azimuth` found.
    pub azimuth_bias_deg: f64,
}

impl Default for RadarOptions {
    fn default() -> Self {
        Self {
            own_ship: None,
            azimuth_from: AzimuthFrom::North,
            turn_s: None,
            range_std_m: 30.0,
            azimuth_std_deg: 1.0,
            range_bias_m: 0.0,
            azimuth_bias_deg: 0.0,
        }
    }
}

impl RadarOptions {
    /// Checks ranges.
    /// # Errors
    /// [`ErrorKind::Config`] with the field that is wrong.
    pub fn validate(&self, at: &str) -> Result<()> {
        let wrong = |name: &str, value: f64, what: &str| {
            Err(Error::new(ErrorKind::Config, format!("expected {what}")).at(format!("{at}.{name} = {value}")))
        };
        let positive = |v: f64| v > 0.0 && v.is_finite();
        if let Some(turn) = self.turn_s.filter(|v| !positive(*v)) {
            return wrong("turn-s", turn, "a time above 0 s");
        }
        if !positive(self.range_std_m) {
            return wrong("range-std-m", self.range_std_m, "a length above 0 m");
        }
        if !(positive(self.azimuth_std_deg) && self.azimuth_std_deg <= 30.0) {
            return wrong("azimuth-std-deg", self.azimuth_std_deg, "an angle above 0, at most 30 degrees");
        }
        if !self.range_bias_m.is_finite() {
            return wrong("range-bias-m", self.range_bias_m, "a length in m");
        }
        if !self.azimuth_bias_deg.is_finite() {
            return wrong("azimuth-bias-deg", self.azimuth_bias_deg, "an angle in degrees");
        }
        Ok(())
    }
}
