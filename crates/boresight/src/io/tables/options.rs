//! How tables from elsewhere are read: columns, rate, assumed errors, origin of pixels and frames, bad rows.

use super::columns::Columns;
use super::radar::options::RadarOptions;
use crate::length_unit::LengthUnit;
use crate::{ASSUMED_RATE_HZ, Error, ErrorKind, Result};
use serde::{Deserialize, Serialize};

/// How a table of detections is read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct TableOptions {
    /// Columns by name or number where the usual names do not fit.
    pub columns: Columns,
    /// Rate, frames/s, above 0. Given, it makes all times (frame / rate); absent, the table's times count, then the
    /// `frameRate` of a `seqinfo.ini` beside it, then `input.rate-hz`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate_hz: Option<f64>,
    /// Rate of a table that says nothing of time, frames/s: `input.rate-hz` of a configuration.
    #[serde(skip)]
    pub assumed_rate_hz: f64,
    /// Standard deviation of a position where the table has none, px, above 0. Larger values make tracks smoother.
    pub std_px: f64,
    /// Standard deviation of a position as a share of the box's side, 0..=1, where the table has none and this is more
    /// than `std-px`. Detectors of large things are off by more pixels.
    pub std_per_side: f64,
    /// Side of the box where the table has neither box nor area, px, at least 0. Only drawings and box metrics use it.
    pub box_px: f64,
    /// Number that the table gives to its first pixel in x and y (0 or 1). MOTChallenge text always counts from 1.
    pub first_pixel: f64,
    /// Number that the table gives to its first frame; absent: 1 in MOTChallenge text, else 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_frame: Option<u64>,
    /// Unit of positions and sizes, `px` or `m`; absent: what the names of the columns say (`x_m`), else `px`. Keys that end in `-px` are in it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<LengthUnit>,
    /// Least score of a detection; rows below it are left out. Absent: all are kept.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_score: Option<f32>,
    /// Whether rows that cannot be read are counted and left out instead of ending the run.
    pub skip_bad_rows: bool,
    /// How a radar's table of range and azimuth is read.
    pub radar: RadarOptions,
}

impl Default for TableOptions {
    fn default() -> Self {
        Self {
            columns: Columns::default(),
            rate_hz: None,
            assumed_rate_hz: ASSUMED_RATE_HZ,
            std_px: 1.0,
            std_per_side: 0.0,
            box_px: 5.0,
            first_pixel: 0.0,
            first_frame: None,
            unit: None,
            min_score: None,
            skip_bad_rows: false,
            radar: RadarOptions::default(),
        }
    }
}

impl TableOptions {
    /// Checks ranges.
    /// # Errors
    /// [`ErrorKind::Config`] with the field that is wrong.
    pub fn validate(&self, at: &str) -> Result<()> {
        let config = |name: &str, value: f64, what: &str| {
            Err(Error::new(ErrorKind::Config, format!("expected {what}")).at(format!("{at}.{name} = {value}")))
        };
        self.columns.validate(&format!("{at}.columns"))?;
        self.radar.validate(&format!("{at}.radar"))?;
        if let Some(rate) = self.rate_hz.filter(|r| !(r.is_finite() && *r > 0.0)) {
            return config("rate-hz", rate, "a positive number of frames/s");
        }
        if let Some(rate) = self.rate_hz {
            crate::time::check_rate(rate).map_err(|e| e.at(format!("{at}.rate-hz = {rate}")))?;
        }
        if !(self.std_px.is_finite() && self.std_px > 0.0) {
            return config("std-px", self.std_px, "a positive number of pixels");
        }
        if !(0.0..=1.0).contains(&self.std_per_side) {
            return config("std-per-side", self.std_per_side, "a share in 0..=1");
        }
        if !(self.box_px.is_finite() && self.box_px >= 0.0) {
            return config("box-px", self.box_px, "a size in pixels");
        }
        if let Some(score) = self.min_score.filter(|s| !s.is_finite()) {
            return config("min-score", score.into(), "a number");
        }
        if !self.first_pixel.is_finite() {
            return config("first-pixel", self.first_pixel, "0 or 1");
        }
        Ok(())
    }
}
