//! What the detector that carries a density of targets is told: how wide they are, how fast, how they turn, and how many false ones are allowed.

use crate::Result;
use crate::validate::check;
use crate::vision::integrate::StillBackground;
use crate::vision::polarity::Polarity;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Small targets that no single frame shows and that turn: where they may be, how fast and how bright, is carried from frame to frame, and what is
/// surer than a stated number of false alarms is a target. It reports in every frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct BernoulliConfig {
    /// Expected number of new false targets a frame at most, 1e-9..=1e4. Lower is surer and later. A detection's score is -log10 of that number for one at
    /// least as sure.
    pub false_alarms_per_frame: f64,
    /// What a target looks like.
    pub shape: TargetShape,
    /// Standard deviation of the spot that a target makes, px, 0.6..=10; of `shape = "spot"`.
    pub sigma_px: f64,
    /// Side of the square that a target fills evenly, px, 3..=64; of `shape = "square"`.
    /// Its edges place it twice as finely as a spot of that width is: more places and velocities are told apart, at more cost and memory.
    pub side_px: f64,
    /// Largest speed along an axis, px/s, above 0. Cost and memory grow with its square.
    pub max_speed_px_per_s: f64,
    /// How targets change their velocity: density of white acceleration along an axis, px²/s³, above 0. Higher follows sharper turns and
    /// sums fewer frames; the time that a straight line holds is (3 δ² / this)^(1/3) seconds, where δ is `sigma-px` or 0.22 `side-px`.
    pub acceleration_density_px2_per_s3: f64,
    /// Least strength of a target that is looked for: its peak in the frame matched to its shape, in deviations of the noise there, 0.25..=8. Lower needs more frames.
    pub least_snr: f64,
    /// Mean time for which a target is there, s, above 0.
    pub mean_life_s: f64,
    /// Which contrast is looked for.
    pub polarity: Polarity,
    /// What is taken for background.
    pub background: StillBackground,
}

/// What a target looks like.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TargetShape {
    /// A Gaussian of `sigma-px`.
    #[default]
    Spot,
    /// A square along the axes, even within `side-px`.
    Square,
}

impl Default for BernoulliConfig {
    fn default() -> Self {
        Self {
            false_alarms_per_frame: 0.001,
            shape: TargetShape::Spot,
            sigma_px: 1.3,
            side_px: 9.0,
            max_speed_px_per_s: 50.0,
            acceleration_density_px2_per_s3: 300.0,
            least_snr: 1.0,
            mean_life_s: 10.0,
            polarity: Polarity::Bright,
            background: StillBackground::Temporal,
        }
    }
}

impl BernoulliConfig {
    /// Checks every parameter; `at` is the path of this table.
    /// # Errors
    /// The first parameter out of its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        let in_range = |key: &str, v: f64, low: f64, high: f64, what: &str, hint: &str| {
            check((low..=high).contains(&v), at, key, v, what, hint)
        };
        let rate = "0.001 is one new false target in a thousand frames";
        in_range("false-alarms-per-frame", self.false_alarms_per_frame, 1e-9, 1e4, "1e-9 to 1e4", rate)?;
        in_range("sigma-px", self.sigma_px, 0.6, 10.0, "0.6 to 10 px", "0.42 of the width at half height")?;
        in_range("side-px", self.side_px, 3.0, 64.0, "3 to 64 px", "smaller ones are spots")?;
        let (tiny, speed) = (f64::MIN_POSITIVE, "the largest speed of a target in the image");
        in_range(
            "max-speed-px-per-s",
            self.max_speed_px_per_s,
            tiny,
            1e6,
            "a speed above 0 and at most 1e6 px/s",
            speed,
        )?;
        let (key, turns) =
            ("acceleration-density-px2-per-s3", "300: a path is straight to 1.3 px for a quarter of a second");
        in_range(key, self.acceleration_density_px2_per_s3, 1e-6, 1e12, "1e-6 to 1e12 px²/s³", turns)?;
        in_range("least-snr", self.least_snr, 0.25, 8.0, "0.25 to 8 deviations", "1 needs some forty frames")?;
        in_range("mean-life-s", self.mean_life_s, 1e-3, 1e6, "0.001 to 1e6 s", "10 s suits what crosses the view")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_out_of_range_is_refused_by_name() {
        BernoulliConfig::default().validate("a").unwrap();
        let wrong = [
            ("false-alarms-per-frame", BernoulliConfig { false_alarms_per_frame: 0.0, ..Default::default() }),
            ("sigma-px", BernoulliConfig { sigma_px: f64::NAN, ..Default::default() }),
            ("side-px", BernoulliConfig { side_px: 2.0, ..Default::default() }),
            ("max-speed-px-per-s", BernoulliConfig { max_speed_px_per_s: 0.0, ..Default::default() }),
            (
                "acceleration-density-px2-per-s3",
                BernoulliConfig { acceleration_density_px2_per_s3: -1.0, ..Default::default() },
            ),
            ("least-snr", BernoulliConfig { least_snr: 0.0, ..Default::default() }),
            ("mean-life-s", BernoulliConfig { mean_life_s: f64::INFINITY, ..Default::default() }),
        ];
        for (key, config) in wrong {
            let e = config.validate("detector").unwrap_err().to_string();
            assert!(e.contains(&format!("detector.{key}")) && e.contains("hint"), "{e}");
        }
    }
}
