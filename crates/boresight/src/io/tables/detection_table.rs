//! Detections as they were read from a table.

use super::radar::picture::RadarPicture;
use crate::Scan;
use crate::length_unit::LengthUnit;

/// Detections read from a table.
#[derive(Clone, Debug, PartialEq)]
pub struct DetectionTable {
    /// One scan for each frame from the first to the last, empty ones included.
    pub scans: Vec<Scan>,
    /// Rate, frames/s: given, or found from the times.
    pub rate_hz: f64,
    /// The number that the table gives to its first frame, which is frame 0 here: 1 in MOTChallenge text.
    pub first_frame: u64,
    /// What positions and sizes are counted in.
    pub unit: LengthUnit,
    /// What kind of table it was, for the summary: `boresight detections`, `MOTChallenge`, `CSV (frame, x, y)`.
    pub format: String,
    /// Names of the classes, by [`crate::ClassId`], if the table has names instead of numbers.
    pub class_names: Vec<String>,
    /// Number of rows read.
    pub n_rows: u64,
    /// Number of rows left out.
    pub n_skipped: u64,
    /// Whole sentences about what was assumed or left out.
    pub warnings: Vec<String>,
    /// Those of the warnings that say what is lost.
    pub lost: Vec<String>,
    /// What a radar's table says beside its plots; the scans are in metres east and north then.
    pub radar: Option<RadarPicture>,
}
