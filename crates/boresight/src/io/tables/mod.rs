//! Tables in and out: tracks and detections by column names, MOTChallenge, KITTI, AB3DMOT; JSON lines and COCO.
//!
//! One way in: [`lexer`] parts lines and fields, [`table`] tells the kind by the first line, [`columns`] names the columns,
//! [`dialect`] knows what is special of each, [`row`] gives cells as numbers. What is made of the rows: detections
//! ([`read_detections`]), states ([`read_tracks`]), or a table of tracks (`io::tracks`).

mod camera_csv;
mod coco;
pub(crate) mod columns;
mod detection_row;
mod detection_table;
mod detections_csv;
pub(crate) mod dialect;
mod json_lines;
pub(crate) mod kind;
pub(crate) mod lexer;
pub(crate) mod lost;
mod measured_only;
mod mot_writer;
pub(crate) mod number;
mod options;
mod radar;
mod read_detections;
mod read_tracks;
pub(crate) mod row;
mod scan_times;
mod seqinfo;
mod ship_reports;
pub(crate) mod table;
mod tracks_csv;

pub use crate::length_unit::LengthUnit;
pub use camera_csv::CameraCsv;
pub use columns::Columns;
pub use detection_table::DetectionTable;
pub use detections_csv::DetectionsCsv;
pub use dialect::mot::mot_box_of_extent;
pub use dialect::named::Dialect;
pub use json_lines::JsonLines;
pub use measured_only::MeasuredOnly;
pub use mot_writer::MotWriter;
pub use options::TableOptions;
pub use radar::options::{AzimuthFrom, RadarOptions};
pub use radar::picture::RadarPicture;
pub use read_detections::read_detections;
pub use read_tracks::{StateTable, read_tracks};
pub use seqinfo::SequenceInfo;
pub use ship_reports::{ShipReports, read_ship_reports};
pub(crate) use tracks_csv::COVARIANCE_COLUMNS;
pub(crate) use tracks_csv::status_word;
pub use tracks_csv::{TRACKS_HEADER, TracksCsv};
