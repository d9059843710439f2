//! Integration tests: one binary, a module per matter.

mod background;
mod citations;
#[cfg(feature = "video")]
mod coded_particles;
mod faint_movers;
mod fuse;
mod golden;
#[cfg(all(feature = "images", feature = "video"))]
mod hostile;
#[cfg(feature = "images")]
mod images;
mod memory;
mod metrics;
mod rooms;
mod steadied;
mod track;
mod unsafe_places;
#[cfg(feature = "video")]
mod video;
mod vision_conformance;
mod vision_covariance;
mod vision_fit;
