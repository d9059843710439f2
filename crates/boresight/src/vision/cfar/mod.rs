//! Small targets at a stated rate of false alarms: directional contrast over scales, judged by the frame's own extremes.
//!
//! How: the frame becomes a pyramid (`pyramid`); on each of its levels the contrast of a pixel is what it keeps against the best
//! of four opposite pairs of neighbours (`contrast`), so that edges, lines and slopes have none. Contrast over the local noise
//! (`noise`) is z; its local extremes of the polarity with fewer strong ones are the null that turns z into the expected number of
//! false alarms a frame at least as strong (`tail`). What is rarer than the number asked for is kept, one detection a place
//! (`merge`), with its region (`region`) and, for spots, a Gaussian's position and covariance (`spot_fit`).
//! Derivation and every constant: `docs/theory/detection-cfar.md`.

pub(crate) mod config;
mod contrast;
pub(crate) mod detector;
pub(crate) mod lane;
mod merge;
mod noise;
mod pyramid;
mod region;
mod spot_fit;
mod tail;

pub use config::CfarConfig;
pub use detector::{Cell, CfarDetector};
