//! Tables in and out: tracks, detections, MOTChallenge, JSON lines.

mod columns;
mod detection_row;
mod detections_csv;
mod json_lines;
mod mot;
mod number;
mod options;
mod read_detections;
mod read_tracks;
mod rows;
mod scan_times;
mod seqinfo;
mod tracks_csv;

pub use columns::Columns;
pub use detections_csv::DetectionsCsv;
pub use json_lines::JsonLines;
pub use mot::{MotWriter, mot_box_of_extent};
pub(crate) use number::parse_seconds;
pub use options::TableOptions;
pub use read_detections::{DetectionTable, read_detections};
pub use read_tracks::{StateTable, read_tracks};
pub use tracks_csv::{TRACKS_HEADER, TracksCsv};
