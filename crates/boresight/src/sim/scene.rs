//! What a simulated scene is made of: frame, targets, background, sensor, clock; read from TOML.
//!
//! Source: `docs/theory/simulation.md` for the papers' scenes; the rest is the usual model of an imaging sensor (optics
//! blur, shot noise, fixed pattern, read noise, dead pixels, salt and pepper, saturation, rounding). Order of a frame:
//! background, targets in order, occluders, blur, shot noise, fixed pattern, read noise, dead pixels, salt and pepper,
//! clamp and round.
//! Units: px, s, counts. Coordinates: (x, y) = (column, row), centre of the top-left pixel = (0, 0).

use super::ground::{CameraPathConfig, Ground};
use super::motion::MotionConfig;
use super::radar_config::RadarConfig;
use crate::{Error, ErrorKind, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct SceneConfig {
    /// Width of the frame, px, 1..=16384.
    pub width_px: usize,
    /// Height of the frame, px, 1..=16384.
    pub height_px: usize,
    /// Number of frames (dropped ones count).
    pub n_frames: u64,
    /// Frames a second, above 0. The papers' scenes have 1, so that px/s and px/scan are the same.
    pub rate_hz: f64,
    /// Bits of a pixel: 8 gives 8-bit frames, 9..=16 give 16-bit frames with values below 2^bits.
    pub bits: u32,
    /// What lies behind the targets.
    pub background: Background,
    /// The targets; later ones cover earlier ones.
    pub targets: Vec<Target>,
    /// Things that stand still in front of the targets.
    pub occluders: Vec<Occluder>,
    /// How the camera moves; starts and velocities of the targets, and `ground` and `gradient` behind them, stay where they are, on the ground.
    pub camera: CameraPathConfig,
    /// What the sensor does to the scene.
    pub sensor: Sensor,
    /// What the clock does: dropped frames, jitter.
    pub clock: Clock,
    /// Radars that see the same targets; none by default.
    pub radars: Vec<RadarConfig>,
}

impl Default for SceneConfig {
    fn default() -> Self {
        Self {
            width_px: 64,
            height_px: 64,
            n_frames: 50,
            rate_hz: 1.0,
            bits: 8,
            background: Background::default(),
            targets: vec![Target::default()],
            occluders: Vec::new(),
            camera: CameraPathConfig::default(),
            sensor: Sensor::default(),
            clock: Clock::default(),
            radars: Vec::new(),
        }
    }
}

/// What lies behind the targets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Background {
    /// Independent Gaussian pixels, new in each frame.
    White(White),
    /// Smooth random clutter.
    Correlated(Correlated),
    /// A plane of brightness.
    Gradient(Gradient),
    /// A textured ground without end, over which the camera moves.
    Ground(Ground),
    /// Frames of a picture or a video file, in its own size; the last frame stays when it ends.
    File(String),
}

impl Default for Background {
    fn default() -> Self {
        Self::White(White::default())
    }
}

/// Parameters of [`Background::White`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct White {
    /// Mean, counts.
    pub mean: f64,
    /// Standard deviation, counts, 0 or more.
    pub std: f64,
}

impl Default for White {
    fn default() -> Self {
        Self { mean: 50.0, std: 50.0 }
    }
}

/// Parameters of [`Background::Correlated`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Correlated {
    /// Mean, counts.
    pub mean: f64,
    /// Standard deviation, counts, 0 or more.
    pub std: f64,
    /// Correlation length (standard deviation of the smoothing Gaussian), px, 0..=64. Larger makes larger clouds.
    pub length_px: f64,
    /// Correlation from one frame to the next, 0..=1: 1 is clutter that stands still, 0 is new in each frame.
    pub coherence: f64,
}

impl Default for Correlated {
    fn default() -> Self {
        Self { mean: 50.0, std: 20.0, length_px: 3.0, coherence: 1.0 }
    }
}

/// Parameters of [`Background::Gradient`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Gradient {
    /// Brightness at the centre of the top-left pixel, counts.
    pub level: f64,
    /// Growth per column and per row, counts/px.
    pub slope_per_px: [f64; 2],
    /// Standard deviation of white noise on it, counts, 0 or more.
    pub std: f64,
}

impl Default for Gradient {
    fn default() -> Self {
        Self { level: 20.0, slope_per_px: [1.0, 0.5], std: 5.0 }
    }
}

/// One target.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Target {
    /// Position (x, y) when it appears, px.
    pub start_px: [f64; 2],
    /// Velocity (x, y) when it appears, px/s.
    pub velocity_px_per_s: [f64; 2],
    /// How it moves.
    pub motion: MotionConfig,
    /// How it looks.
    pub shape: Shape,
    /// When it appears, s from the scene's start, 0 or more.
    pub appears_s: f64,
    /// When it vanishes, s; none (the default) means never.
    pub vanishes_s: Option<f64>,
    /// Growth of its size, share of the first size per second; 0.1 grows by a tenth of it each second. Negative shrinks.
    pub growth_per_s: f64,
}

impl Default for Target {
    fn default() -> Self {
        Self {
            start_px: [10.0, 10.0],
            velocity_px_per_s: [1.0, 1.0],
            motion: MotionConfig::default(),
            shape: Shape::default(),
            appears_s: 0.0,
            vanishes_s: None,
            growth_per_s: 0.0,
        }
    }
}

/// How a target looks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Shape {
    /// The papers' target: a rectangle of independent Gaussian pixels on the pixel grid, replacing the background.
    Rectangle(Rectangle),
    /// A point or a round spot seen through the optics: a Gaussian added to the background, integrated over each pixel.
    Spot(Spot),
    /// A rectangle with a texture of its own that moves with it by parts of a pixel, replacing the background.
    Textured(Textured),
}

impl Default for Shape {
    fn default() -> Self {
        Self::Rectangle(Rectangle::default())
    }
}

/// Parameters of [`Shape::Rectangle`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Rectangle {
    /// Columns and rows, px, 1..=4096.
    pub size_px: [usize; 2],
    /// Mean of its pixels, counts.
    pub mean: f64,
    /// Standard deviation of its pixels, counts, 0 or more.
    pub std: f64,
}

impl Default for Rectangle {
    fn default() -> Self {
        Self { size_px: [9, 9], mean: 100.0, std: 10.0 }
    }
}

/// Parameters of [`Shape::Spot`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Spot {
    /// Standard deviation of the target's own Gaussian shape, px, 0 (a point) or more.
    pub sigma_px: f64,
    /// Standard deviation of the optics' point-spread function, px, above 0; adds in squares to the shape's.
    pub psf_sigma_px: f64,
    /// All its light, counts summed over pixels; negative for a dark target.
    pub total: f64,
}

impl Default for Spot {
    fn default() -> Self {
        Self { sigma_px: 0.0, psf_sigma_px: 1.0, total: 1000.0 }
    }
}

/// Parameters of [`Shape::Textured`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Textured {
    /// Width and height, px, above 0, at most 4096.
    pub size_px: [f64; 2],
    /// Mean, counts.
    pub mean: f64,
    /// Standard deviation of the texture, counts, 0 or more.
    pub contrast: f64,
    /// Size of the texture's grains, px, above 0.
    pub grain_px: f64,
}

impl Default for Textured {
    fn default() -> Self {
        Self { size_px: [15.0, 11.0], mean: 150.0, contrast: 25.0, grain_px: 3.0 }
    }
}

/// A rectangle that stands still in front of the targets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Occluder {
    /// First column and row, px.
    pub corner_px: [i64; 2],
    /// Columns and rows, px.
    pub size_px: [usize; 2],
    /// Mean, counts.
    pub mean: f64,
    /// Standard deviation of white noise on it, counts, 0 or more.
    pub std: f64,
}

impl Default for Occluder {
    fn default() -> Self {
        Self { corner_px: [30, 0], size_px: [8, 64], mean: 50.0, std: 0.0 }
    }
}

/// What the sensor does to the scene; all off by default.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Sensor {
    /// Standard deviation of the optics' Gaussian blur, px, 0..=32.
    pub blur_sigma_px: f64,
    /// Electrons per count for shot noise (variance = counts / this), above 0; none (the default) means no shot noise.
    pub electrons_per_count: Option<f64>,
    /// Standard deviation of the read noise, counts, 0 or more.
    pub read_noise: f64,
    /// Standard deviation of each pixel's fixed offset, counts, 0 or more.
    pub offset_std: f64,
    /// Standard deviation of each pixel's fixed gain about 1, 0 or more.
    pub gain_std: f64,
    /// Share of dead pixels (always 0), 0..=1.
    pub dead_share: f64,
    /// Share of pixels set to 0 or to full scale in each frame (half each), 0..=1.
    pub salt_pepper_share: f64,
    /// Value at which pixels saturate, counts; none (the default) means 2^bits - 1.
    pub saturation: Option<f64>,
    /// Standard deviation of the camera's own jitter per frame and axis, px, 0 or more; the truth moves with it.
    pub jitter_px: f64,
}

impl Default for Sensor {
    fn default() -> Self {
        Self {
            blur_sigma_px: 0.0,
            electrons_per_count: None,
            read_noise: 0.0,
            offset_std: 0.0,
            gain_std: 0.0,
            dead_share: 0.0,
            salt_pepper_share: 0.0,
            saturation: None,
            jitter_px: 0.0,
        }
    }
}

/// What the clock does; regular by default.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Clock {
    /// Share of frames that are lost, 0 up to below 1; the others keep their numbers and times.
    pub dropped_share: f64,
    /// Standard deviation of each frame's time about its nominal time, s, 0 or more; cut at 0.45 frame intervals so that order stays.
    pub jitter_s: f64,
    /// Times `[from, to]` in which the camera gives no frames, s.
    pub silent_s: Vec<[f64; 2]>,
}

impl SceneConfig {
    /// Reads a scene from TOML.
    /// # Errors
    /// [`ErrorKind::Config`] with the line that is wrong.
    pub fn from_toml(text: &str) -> Result<Self> {
        let scene: Self = toml::from_str(text).map_err(|e| Error::new(ErrorKind::Config, e.to_string()).at("scene"))?;
        scene.validate("scene")?;
        Ok(scene)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_parameter_is_named_with_its_value() {
        let e = SceneConfig::from_toml("rate-hz = 0.0").unwrap_err().to_string();
        assert!(e.starts_with("scene.rate-hz = 0.0: expected a rate above 0"), "{e}");
        let e = SceneConfig::from_toml("[[targets]]\nshape.rectangle.std = -1.0").unwrap_err().to_string();
        assert!(e.starts_with("scene.targets[0].shape.rectangle.std = -1.0"), "{e}");
        let e = SceneConfig::from_toml("[sensor]\nblurr = 1").unwrap_err().to_string();
        assert!(e.contains("blurr"), "{e}");
    }

    #[test]
    fn a_scene_survives_the_way_through_toml() {
        let mut scene = SceneConfig { background: Background::Correlated(Correlated::default()), ..Default::default() };
        scene.targets[0].motion = MotionConfig::Singer(super::super::motion::Singer::default());
        scene.targets[0].shape = Shape::Spot(Spot::default());
        scene.sensor.electrons_per_count = Some(10.0);
        let text = toml::to_string(&scene).unwrap();
        assert_eq!(SceneConfig::from_toml(&text).unwrap(), scene);
    }
}
