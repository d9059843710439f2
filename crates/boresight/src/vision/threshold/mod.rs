//! Thresholds: which pixels belong to targets. Each turns one row of native pixels into one row of bits.

pub(crate) mod band;
mod bits;
mod boxes;
pub(crate) mod grid;
mod lanes;
pub(crate) mod level;
pub(crate) mod local;
pub(crate) mod otsu;
pub(crate) mod spot;
mod summits;
pub use band::words;
pub use bits::band_bits;
pub use grid::BackgroundGrid;
pub use otsu::otsu_level;

use super::background::{BackgroundConfig, DifferenceConfig};
use super::bernoulli::BernoulliConfig;
use super::cfar::CfarConfig;
use super::colour::ColourMatchConfig;
use super::integrate::config::IntegrateConfig;
use super::isolated::IsolatedConfig;
pub use super::polarity::{Polarity, Side};
use super::steadied::SteadiedConfig;
use crate::Result;
use crate::validate::wrong;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which pixels belong to targets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ThresholdConfig {
    /// Values inside a band, both ends included.
    Band(BandConfig),
    /// Values on one side of a fixed level.
    Level(LevelConfig),
    /// Values on one side of the level that separates the frame's histogram best (Otsu), anew in every frame.
    Otsu(OtsuConfig),
    /// Values that stand out from their local background by k robust standard deviations.
    Local(LocalConfig),
    /// Pixels that differ from a running model of a fixed camera's background.
    Moving(BackgroundConfig),
    /// Pixels that differ from the frames just before.
    Difference(DifferenceConfig),
    /// Pixels that differ from frames some time ago, steadied by the camera's motion: what moves before a moving camera.
    Steadied(SteadiedConfig),
    /// Pixels of one colour; needs colour frames (`input.colour = "rgb"` for video).
    Colour(ColourMatchConfig),
    /// Closed blobs of any size that stand clear of the ring around them.
    Isolated(IsolatedConfig),
    /// Small targets by their contrast to what surrounds them: one detection for each peak, no clusters.
    Spot(SpotConfig),
    /// Small targets of any size that stand out more than a stated number of false alarms a frame would; no clusters.
    Cfar(CfarConfig),
    /// Small moving targets that no single frame shows: frames are summed along every straight path; no clusters.
    Integrate(IntegrateConfig),
    /// Small targets that no single frame shows and that turn: a density over places and velocities is carried from frame to frame; no clusters.
    Bernoulli(BernoulliConfig),
}

impl Default for ThresholdConfig {
    fn default() -> Self {
        Self::Local(LocalConfig::default())
    }
}

/// Pixels with `low` <= value <= `high`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct BandConfig {
    /// Lowest kept value, counts, at most `high`. Raising it drops dim targets and clutter alike.
    pub low: f64,
    /// Highest kept value, counts. Lowering it drops what is brighter than the target.
    pub high: f64,
}

impl Default for BandConfig {
    fn default() -> Self {
        Self { low: 90.0, high: 110.0 }
    }
}

/// Pixels on one side of a fixed level.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct LevelConfig {
    /// The level, counts; a pixel exactly on it counts as target unless `exclusive`.
    pub level: f64,
    /// On which side of the level targets lie.
    pub side: Side,
    /// Whether a pixel exactly on the level is left out.
    pub exclusive: bool,
}

impl Default for LevelConfig {
    fn default() -> Self {
        Self { level: 150.0, side: Side::Bright, exclusive: false }
    }
}

/// Pixels on one side of the level found by Otsu's method.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct OtsuConfig {
    /// On which side of the level targets lie.
    pub side: Side,
}

/// Pixels that stand out from the local background.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct LocalConfig {
    /// Distance from the local median in robust standard deviations, above 0. Lower finds dimmer targets and more clutter.
    pub k: f64,
    /// Which contrast is looked for.
    pub polarity: Polarity,
    /// Side of a background cell, px, 4..=4096: a few times the largest target, so that a target fills less than half a cell.
    pub cell_px: u32,
    /// Least distance from the local median, counts, 0...: keeps a quiet background from calling every step a target.
    pub min_contrast: f64,
}

impl Default for LocalConfig {
    fn default() -> Self {
        Self { k: 5.0, polarity: Polarity::Bright, cell_px: 32, min_contrast: 3.0 }
    }
}

/// Small targets by their local contrast.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct SpotConfig {
    /// Diameter of the target with its soft edge, px, 2..=255. Larger finds larger and fainter targets; half of it tells clear neighbours apart.
    pub size_px: f64,
    /// Distance of the response from its local median in robust standard deviations, above 0.
    pub k: f64,
    /// Which contrast is looked for.
    pub polarity: Polarity,
    /// Least response, counts, 0...: keeps a quiet background from calling every step a target. Scores count in a `k`-th of it at least.
    pub min_contrast: f64,
    /// Side of the surroundings in units of `size-px`, 1..=10. 1 suits crowded frames, 2 or more dim single targets.
    pub surround: f64,
    /// Side of the smoothing box, px, 1...; a quarter of `size-px` if absent. Raise it with the noise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub smooth_px: Option<f64>,
}

impl Default for SpotConfig {
    fn default() -> Self {
        Self { size_px: 7.0, k: 6.0, polarity: Polarity::Bright, min_contrast: 2.0, surround: 1.5, smooth_px: None }
    }
}

impl SpotConfig {
    fn validate(&self, at: &str) -> Result<()> {
        let check = |key: &str, v: f64, low: f64, high: f64, hint: &str| {
            if (low..=high).contains(&v) {
                return Ok(());
            }
            Err(wrong(at, key, v, &format!("{low} to {high}"), hint))
        };
        check("size-px", self.size_px, 2.0, 255.0, "the diameter of the target with its soft edge")?;
        check("k", self.k, f64::MIN_POSITIVE, 1e6, "6 is a common start; lower finds dimmer targets")?;
        check("min-contrast", self.min_contrast, 0.0, 1e9, "0 leaves the deviation alone to decide")?;
        check("surround", self.surround, 1.0, 10.0, "1.5 is a common start")?;
        if let Some(smooth_px) = self.smooth_px {
            check("smooth-px", smooth_px, 1.0, 255.0, "leave it out for a quarter of size-px")?;
        }
        Ok(())
    }
}

impl ThresholdConfig {
    /// Its word: the key below `detector.threshold`.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Band(_) => "band",
            Self::Level(_) => "level",
            Self::Otsu(_) => "otsu",
            Self::Local(_) => "local",
            Self::Moving(_) => "moving",
            Self::Difference(_) => "difference",
            Self::Steadied(_) => "steadied",
            Self::Colour(_) => "colour",
            Self::Isolated(_) => "isolated",
            Self::Spot(_) => "spot",
            Self::Cfar(_) => "cfar",
            Self::Integrate(_) => "integrate",
            Self::Bernoulli(_) => "bernoulli",
        }
    }

    /// Checks every parameter; `at` is the path of this table.
    /// # Errors
    /// The first parameter out of its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        match self {
            Self::Band(c) => {
                if c.low.is_nan() || c.high.is_nan() || c.low > c.high {
                    return Err(wrong(
                        at,
                        "band.low",
                        c.low,
                        &format!("at most band.high = {}", c.high),
                        "a band of one level has low = high",
                    ));
                }
            }
            Self::Level(c) => {
                if !c.level.is_finite() {
                    return Err(wrong(
                        at,
                        "level.level",
                        c.level,
                        "a finite level, counts",
                        "`otsu` finds a level by itself",
                    ));
                }
            }
            Self::Otsu(_) => {}
            Self::Moving(c) => c.validate(&format!("{at}.moving"))?,
            Self::Difference(c) => c.validate(&format!("{at}.difference"))?,
            Self::Steadied(c) => c.validate(&format!("{at}.steadied"))?,
            Self::Colour(c) => c.validate(&format!("{at}.colour"))?,
            Self::Isolated(c) => c.validate(&format!("{at}.isolated"))?,
            Self::Spot(c) => c.validate(&format!("{at}.spot"))?,
            Self::Cfar(c) => c.validate(&format!("{at}.cfar"))?,
            Self::Integrate(c) => c.validate(&format!("{at}.integrate"))?,
            Self::Bernoulli(c) => c.validate(&format!("{at}.bernoulli"))?,
            Self::Local(c) => {
                if !(c.k > 0.0 && c.k.is_finite()) {
                    return Err(wrong(
                        at,
                        "local.k",
                        c.k,
                        "a number of deviations above 0",
                        "5 is a common start; lower finds dimmer targets",
                    ));
                }
                if !(4..=4096).contains(&c.cell_px) {
                    return Err(wrong(
                        at,
                        "local.cell-px",
                        c.cell_px,
                        "4 to 4096 px",
                        "a few times the largest target",
                    ));
                }
                if !(c.min_contrast >= 0.0 && c.min_contrast.is_finite()) {
                    return Err(wrong(
                        at,
                        "local.min-contrast",
                        c.min_contrast,
                        "0 counts or more",
                        "0 leaves the deviation alone to decide",
                    ));
                }
            }
        }
        Ok(())
    }
}
