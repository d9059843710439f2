//! What the detector that sums frames is told: how many, how fast targets are, how wide, and how many false alarms are allowed.

use crate::Result;
use crate::validate::check;
use crate::vision::polarity::Polarity;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Targets that no single frame shows: frames are summed along every straight path, and what is rarer than a stated number of
/// false alarms is kept. It reports every `frames` / 2 frames; the frames between are no misses.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct IntegrateConfig {
    /// Expected number of false detections a frame, averaged over frames with and without a report, 1e-9..=1e4. Lower is
    /// surer and misses dimmer targets. A detection's score is -log10 of that number for one at least as strong.
    pub false_alarms_per_frame: f64,
    /// Frames that are summed, a power of two, 4..=256. More finds dimmer targets (four times as many, half the contrast), if
    /// they keep their velocity so long; the cost a frame grows in proportion, the first report comes later.
    pub frames: u32,
    /// Standard deviation of the spot that a target makes, px, 0.6..=10.
    pub sigma_px: f64,
    /// Largest speed looked for, px/s, above 0. The cost grows with its square.
    pub max_speed_px_per_s: f64,
    /// Which contrast is looked for.
    pub polarity: Polarity,
    /// What is taken for background.
    pub background: StillBackground,
}

/// What is subtracted from frames before they are summed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum StillBackground {
    /// The mean of each pixel over the last eight sums: a fixed camera. What stands still is not seen.
    #[default]
    Temporal,
    /// The mean of the pixels around, over 17 `sigma-px`: a camera that moves slowly, light that changes.
    Spatial,
    /// Both.
    Both,
}

impl Default for IntegrateConfig {
    fn default() -> Self {
        Self {
            false_alarms_per_frame: 0.001,
            frames: 16,
            sigma_px: 1.3,
            max_speed_px_per_s: 50.0,
            polarity: Polarity::Bright,
            background: StillBackground::Temporal,
        }
    }
}

impl IntegrateConfig {
    /// Checks every parameter; `at` is the path of this table.
    /// # Errors
    /// The first parameter out of its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        let (rate, n, sigma, speed) =
            (self.false_alarms_per_frame, self.frames, self.sigma_px, self.max_speed_px_per_s);
        let hint = "0.001 is one false detection in a thousand frames";
        check((1e-9..=1e4).contains(&rate), at, "false-alarms-per-frame", rate, "1e-9 to 1e4", hint)?;
        let ok = n.is_power_of_two() && (4..=256).contains(&n);
        check(
            ok,
            at,
            "frames",
            n,
            "4, 8, 16, 32, 64, 128 or 256",
            "16 for targets that manoeuvre, 64 for dim straight ones",
        )?;
        check(
            (0.6..=10.0).contains(&sigma),
            at,
            "sigma-px",
            sigma,
            "0.6 to 10 px",
            "0.42 of the width at half height",
        )?;
        let hint = "the largest speed of a target in the image";
        check(
            speed > 0.0 && speed <= 1e6,
            at,
            "max-speed-px-per-s",
            speed,
            "a speed above 0 and at most 1e6 px/s",
            hint,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_of_frames_that_cannot_be_halved_down_is_refused() {
        IntegrateConfig::default().validate("a").unwrap();
        for frames in [0, 2, 12, 512] {
            let e = IntegrateConfig { frames, ..Default::default() }.validate("detector").unwrap_err().to_string();
            assert!(e.contains(&format!("detector.frames = {frames}")) && e.contains("hint"), "{e}");
        }
        for wrong in [f64::NAN, 0.0, -1.0] {
            assert!(IntegrateConfig { max_speed_px_per_s: wrong, ..Default::default() }.validate("a").is_err());
            assert!(IntegrateConfig { sigma_px: wrong, ..Default::default() }.validate("a").is_err());
            assert!(IntegrateConfig { false_alarms_per_frame: wrong, ..Default::default() }.validate("a").is_err());
        }
    }
}
