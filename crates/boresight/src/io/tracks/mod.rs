//! Tables of tracks in the formats of the field: MOTChallenge, KITTI, CSV with named columns, Cell Tracking Challenge.

pub mod lines;
pub mod mot;

pub use lines::{BadRows, ReadOptions};
