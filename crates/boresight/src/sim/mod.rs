//! Simulated scenes: targets, noise, background, sensors, radar; never sees the tracker.
//!
//! A [`SceneConfig`] (from TOML or by [`named()`] name) builds a [`SceneSource`], which is a [`crate::FrameSource`] and knows the
//! truth of the frame it handed out last. Nothing is held but one frame: scenes of any length stream. The same seed gives the
//! same bits on every machine of the architecture and for any number of threads.

mod draw;
pub mod ground;
pub mod motion;
pub(crate) mod named;
pub(crate) mod radar;
pub(crate) mod radar_config;
pub(crate) mod random;
pub(crate) mod render;
pub mod scene;
mod scene_check;
mod source;
pub use motion::Mover;
pub use named::{NAMES, PAPER_START, paper_scene};
pub use radar_config::{Measures, PolarErrors, PositionErrors};
pub use random::Purpose;

pub use motion::MotionConfig;
pub use named::named;
pub use radar::{PlotTruth, Radar, RadarScan};
pub use radar_config::RadarConfig;
pub use random::{LevelNoise, LevelTable, Seed};
pub use render::{PaperTarget, quantise, render_from_normals};
pub use scene::SceneConfig;
pub use source::SceneSource;
