//! Targets that no single frame shows: frames are summed along every straight path before anything is detected.
//!
//! A frame becomes what it adds to the sums (`memory`), a bank of velocities shares partial sums from level to level (`velocities`, `sums`), tops are
//! climbed between pixels and velocities (`refine`), judged by the tops of the other sign (`null`) and by what higher ones explain (`cancel`).
//! Figures and limits: `docs/limit.md`.

mod cancel;
pub(crate) mod config;
mod detector;
mod memory;
mod null;
mod refine;
mod sums;
mod velocities;

pub use config::{IntegrateConfig, StillBackground};
pub(super) use detector::IntegrateDetector;
