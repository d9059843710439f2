//! Isolated targets of any size: closed contours that stand clear of the ring around them.

mod config;
mod detect;
mod highest;
mod levels;
mod near;
mod ring;
mod sums;
mod sweep;

pub use config::IsolatedConfig;
pub use detect::IsolatedDetector;
