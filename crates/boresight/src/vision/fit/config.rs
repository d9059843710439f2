//! What the fit of spots is told: widths, ground, motion, and what is poor.

use crate::Result;
use crate::validate::check;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A spot fitted around each detection by maximum likelihood: its position at the Cramér-Rao bound with the covariance that goes with it.
///
/// For targets up to some 8 px across; larger ones, and those whose fit is poor, keep their centroid, and the table of detections says so.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct FitConfig {
    /// What is fitted of a spot's width.
    pub width: FitWidth,
    /// Standard deviation of a spot, px, 0.4 to 3.3: the fit starts there, or stays there if `width` is `known`. If absent, the start follows from the
    /// detection's area; `known` needs it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_px: Option<f64>,
    /// Whether the ground may be inclined under a spot. `false` gives errors some 7 % smaller where it is even, and wrong positions where it is not.
    pub slope: bool,
    /// Way of the targets over the exposure (x, y), px, up to 20: the spot is smeared along it. Positions are those of the middle of the exposure.
    pub motion_px: [f64; 2],
    /// Residual that the noise does not explain, as a share of the spot's height, above which a fit is poor, above 0. Larger keeps more fits.
    pub max_misfit: f64,
}

/// What is fitted of a spot's width.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FitWidth {
    /// One width for all directions; spots that overlap share it.
    #[default]
    Round,
    /// One along x, one along y.
    Elliptic,
    /// Nothing: it is `sigma-px`.
    Known,
}

impl Default for FitConfig {
    fn default() -> Self {
        Self { width: FitWidth::Round, sigma_px: None, slope: true, motion_px: [0.0; 2], max_misfit: 0.1 }
    }
}

impl FitConfig {
    /// Checks every parameter; `at` is the path of this table.
    /// # Errors
    /// The first parameter out of its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        if let Some(s) = self.sigma_px {
            let hint = "the width at half height is 2.35 of it; leave it out to start from each detection's area";
            check((0.4..=3.3).contains(&s), at, "sigma-px", s, "0.4 to 3.3 px", hint)?;
        }
        let has_width = self.width != FitWidth::Known || self.sigma_px.is_some();
        check(has_width, at, "width", "known", "sigma-px beside it", "known says that the width is sigma-px")?;
        let [x, y] = self.motion_px;
        let is_short = x.hypot(y) <= 20.0;
        let motion = format!("{:?}", self.motion_px);
        check(
            is_short,
            at,
            "motion-px",
            motion,
            "a way of at most 20 px",
            "speed times exposure time, [0, 0] at rest",
        )?;
        let ok = self.max_misfit > 0.0 && self.max_misfit.is_finite();
        check(ok, at, "max-misfit", self.max_misfit, "a share above 0", "0.1 is a tenth of the spot's height")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_known_width_must_be_known_and_a_misfit_above_zero() {
        let e = |c: FitConfig| c.validate("detector.centroid.fit").unwrap_err().to_string();
        let known = e(FitConfig { width: FitWidth::Known, ..FitConfig::default() });
        assert!(known.starts_with("detector.centroid.fit.width = known: expected sigma-px beside it"), "{known}");
        assert!(e(FitConfig { sigma_px: Some(9.0), ..FitConfig::default() }).contains("sigma-px = 9"));
        assert!(e(FitConfig { motion_px: [30.0, 0.0], ..FitConfig::default() }).contains("motion-px"));
        assert!(e(FitConfig { motion_px: [f64::NAN, 0.0], ..FitConfig::default() }).contains("motion-px"));
        assert!(e(FitConfig { max_misfit: 0.0, ..FitConfig::default() }).contains("max-misfit"));
        assert!(FitConfig::default().validate("detector.centroid.fit").is_ok());
    }
}
