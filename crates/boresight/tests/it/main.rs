//! Integration tests: one binary, a module per matter.

mod auto_real;
mod background;
mod citations;
mod colour_real;
mod fuse;
mod fuse_real;
mod golden;
mod hostile;
mod images;
mod memory;
mod metrics;
mod rooms;
mod tables;
mod track;
mod video;
mod vision_conformance;
mod vision_covariance;
mod vision_real;
