//! What a live run costs, measured by commands: its latency, and its memory over a day.

mod camera;
mod latency;
mod soak;

pub use latency::{Latency, latency};
pub use soak::{Sample, Soak, soak};
