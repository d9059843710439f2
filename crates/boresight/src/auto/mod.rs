//! The automatic choice: looks at the first frames and writes the configuration that a person would have chosen, with reasons.
//!
//! Source: our own. It only reads frames and proposes a [`Config`](crate::Config); the run itself uses that configuration and nothing else, so
//! the same configuration given back gives the identical result. [`open_and_choose`] is the whole way from an input's name to its frames
//! and configuration.

mod adaptation;
mod asked;
mod carried;
mod cells;
mod chains;
mod choose;
mod coast;
mod colour;
mod contest;
mod decoys;
mod detection_statistics;
mod detections;
mod digits;
mod evidence;
mod faint;
mod first_pass;
mod first_scans;
mod fixed_blocks;
mod ground;
mod if_fixed;
#[cfg(test)]
mod in_memory;
mod initiation_score;
mod interval;
mod lag;
mod lasting;
mod later_looks;
mod learn;
mod looks;
mod moving;
mod near;
mod noise;
mod noise_shown;
mod open;
mod particles;
mod pieces;
#[cfg(feature = "report")]
mod preview;
mod profile;
mod quantile;
mod radar;
mod request;
mod scene;
mod score_statistics;
mod second_look;
mod shake;
mod shaken;
mod sighting_density;
mod sightings;
mod speed;
mod spot_size;
mod spot_threshold;
mod spots;
mod spread;
mod steadied;
mod stretch;
mod summed;
mod value_step;
mod whole_tracks;

pub use crate::io::Replay;
pub use adaptation::Adaptation;
pub use choose::{Choice, choose};
pub use detections::for_detections;
pub use first_scans::PROBE_FRAMES;
pub use learn::learn;
pub use open::{Opened, open, open_and_choose, read_and_choose};
#[cfg(feature = "report")]
pub use preview::preview;
pub use radar::for_radar;
pub use request::{DetectorKind, Request};
pub use second_look::SECOND_LOOK_FRAMES;
pub use whole_tracks::report_whole;
