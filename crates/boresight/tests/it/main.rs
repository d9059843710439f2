//! Integration tests: one binary, a module per matter.

mod background;
mod citations;
mod fuse;
mod golden;
mod hostile;
mod images;
mod memory;
mod metrics;
mod rooms;
mod track;
mod video;
mod vision_conformance;
mod vision_covariance;
