//! Parameters of the background of a fixed camera.

use super::morphology::CleanUp;
use super::shadow::ShadowConfig;
use crate::Result;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the background is learned and what stands out from it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct BackgroundConfig {
    /// Standard deviations of its background that make a pixel moving, 1 to 50. Lower finds fainter targets and more noise.
    pub threshold_sd: f32,
    /// Smallest difference that counts as moving, counts, 0... . If absent: from the deviation typical of the whole image.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_difference: Option<f32>,
    /// Time constant of the background, s, above 0. Shorter follows the light faster and absorbs slow targets.
    pub time_constant_s: f64,
    /// Time constant with which moving pixels enter the background, s, above 0. A target that stands is lost after about
    /// this time.
    pub standing_time_s: f64,
    /// Time constant with which moving pixels that look like the background beside them enter it, s, above 0.
    pub ghost_time_s: f64,
    /// Time in which the background is learned at first, s, 0... : at its end every pixel's background becomes the median of
    /// samples from this time, so that passing targets leave no trace. A recording is read ahead for it; of a stream the
    /// background is a running mean before.
    pub start_s: f64,
    /// Whether the light of the whole frame is followed at once (clouds, automatic exposure).
    pub follow_light: bool,
    /// Whether a pixel may fit the background of one of its 8 neighbours: forgives a shake of 1 px, costs edges.
    pub shake: bool,
    /// What is taken for shadow.
    pub shadow: ShadowConfig,
    /// How the moving pixels are cleaned.
    pub clean_up: CleanUp,
}

impl Default for BackgroundConfig {
    fn default() -> Self {
        Self {
            threshold_sd: 8.0,
            min_difference: None,
            time_constant_s: 10.0,
            standing_time_s: 60.0,
            ghost_time_s: 10.0,
            start_s: 3.0,
            follow_light: true,
            shake: false,
            shadow: ShadowConfig::default(),
            clean_up: CleanUp::Majority,
        }
    }
}

impl BackgroundConfig {
    /// Checks the parameters; `at` is the key of this part, for messages.
    /// # Errors
    /// The first parameter out of its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        let wrong = |key: &str, value: f64, expected: &str, hint: &str| {
            Err(crate::validate::wrong(at, key, value, expected, hint))
        };
        if !(1.0..=50.0).contains(&self.threshold_sd) {
            let hint = "8 leaves few noisy pixels";
            return wrong("threshold-sd", self.threshold_sd.into(), "a number from 1 to 50", hint);
        }
        if let Some(d) = self.min_difference
            && !(d >= 0.0 && d.is_finite())
        {
            return wrong("min-difference", d.into(), "0 or more counts", "leave it out to take it from the noise");
        }
        for (key, value) in [
            ("time-constant-s", self.time_constant_s),
            ("standing-time-s", self.standing_time_s),
            ("ghost-time-s", self.ghost_time_s),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return wrong(key, value, "a time above 0 s", "10 s suits the light of day, 60 s a standing target");
            }
        }
        if !(self.start_s >= 0.0 && self.start_s.is_finite()) {
            return wrong("start-s", self.start_s, "a time of 0 s or more", "3 s sees passing targets pass");
        }
        let s = &self.shadow;
        if !(s.darkest > 0.0 && s.darkest < s.lightest && s.lightest <= 1.0) {
            let hint = "0.5 to 0.97 fits sunlit ground";
            return wrong("shadow.darkest", s.darkest.into(), "0 < darkest < lightest <= 1", hint);
        }
        if !(s.spread > 0.0 && s.spread.is_finite()) {
            return wrong("shadow.spread", s.spread.into(), "a ratio above 0", "0.2 forgives 20 % of texture");
        }
        Ok(())
    }
}
