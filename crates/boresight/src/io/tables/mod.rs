//! Tables in and out: tracks, detections, MOTChallenge, JSON lines.

mod atomic;
mod detections_csv;
mod json_lines;
mod mot;
mod number;
mod tracks_csv;

pub use atomic::{AtomicFile, Output};
pub use detections_csv::DetectionsCsv;
pub use json_lines::JsonLines;
pub use mot::{MotWriter, extent_of_mot_box, mot_box_of_extent};
pub use tracks_csv::TracksCsv;
