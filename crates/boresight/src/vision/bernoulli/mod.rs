//! Small targets that no single frame shows and that turn: their density over places, velocities and strengths, carried from frame to frame.
//!
//! A frame matched to what a target looks like (`shape`) becomes deviations of the noise on a grid (`whitened`), those become likelihood ratios (`likelihood`), a density of what may be there
//! is carried over the whole frame (`density`); what stands out of it is a target with a small density of its own (`target`), whose light is taken out of the frame for
//! all others (`detector`). Figures and limits: `docs/limit.md`.

pub(crate) mod config;
mod density;
mod detector;
mod grid;
mod likelihood;
mod memory;
mod null;
mod shape;
mod target;
mod whitened;

pub use config::{BernoulliConfig, TargetShape};
pub(super) use detector::BernoulliDetector;
pub(crate) use memory::speed_that_fits;
