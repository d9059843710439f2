//! Isolated targets of any size: closed contours that stand clear of the ring around them.

mod bars;
mod blob;
mod cells;
mod config;
mod detect;
mod grow;
mod levels;
mod measure;
mod near;
mod nested;
mod peaks;
mod rims;
mod ring;
mod steps;

pub use config::IsolatedConfig;
pub use detect::IsolatedDetector;
