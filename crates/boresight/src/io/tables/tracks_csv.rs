//! `tracks.csv`: one row for each track and frame, with the whole covariance.
//!
//! Columns: frame (from 0), time_s, track_id, status (tentative, confirmed, coasting), the state `[x, vx, y, vy]` (px,
//! px/s), the ten distinct entries of its covariance (upper triangle, row by row), the box's size (px), and the row of
//! the detection that was taken among this frame's detections (empty: none). Numbers are the shortest that read back
//! to the same bits. In metres the columns say so: `x_m`, `vx_m_per_s`.

use super::number::{push_f64, push_int, push_seconds};
use crate::io::atomic::Output;
use crate::length_unit::LengthUnit;
use crate::{Result, Sink, TrackStatus, View};
use std::path::PathBuf;

/// The header of `tracks.csv`.
pub const TRACKS_HEADER: &str = "frame,time_s,track_id,status,x_px,y_px,vx_px_per_s,vy_px_per_s,\
var_x_px2,cov_x_vx_px2_per_s,cov_x_y_px2,cov_x_vy_px2_per_s,\
var_vx_px2_per_s2,cov_vx_y_px2_per_s,cov_vx_vy_px2_per_s2,\
var_y_px2,cov_y_vy_px2_per_s,var_vy_px2_per_s2,\
width_px,height_px,detection";

/// The ten entries of the state's covariance among its columns.
pub(crate) const COVARIANCE_COLUMNS: [&str; 10] = [
    "var_x_px2",
    "cov_x_vx_px2_per_s",
    "cov_x_y_px2",
    "cov_x_vy_px2_per_s",
    "var_vx_px2_per_s2",
    "cov_vx_y_px2_per_s",
    "cov_vx_vy_px2_per_s2",
    "var_y_px2",
    "cov_y_vy_px2_per_s",
    "var_vy_px2_per_s2",
];

/// The word of a status in tables.
pub fn status_word(status: TrackStatus) -> &'static str {
    match status {
        TrackStatus::Tentative => "tentative",
        TrackStatus::Confirmed => "confirmed",
        TrackStatus::Coasting => "coasting",
    }
}

/// Writes `tracks.csv`.
pub struct TracksCsv {
    output: Output,
    /// Until it is written.
    header: Option<String>,
    lines: String,
    /// Number and time of the frame, as its rows begin.
    when: String,
}

opaque_debug!(TracksCsv);

impl TracksCsv {
    /// Creates the file and writes the header.
    /// # Errors
    /// [`crate::ErrorKind::Output`] if it cannot be written.
    pub fn create(path: impl Into<PathBuf>) -> Result<Self> {
        Self::to(Output::file(path)?)
    }

    /// Writes to any output.
    /// # Errors
    /// [`crate::ErrorKind::Output`] if it cannot be written.
    pub fn to(output: Output) -> Result<Self> {
        Ok(Self { output, header: Some(format!("{TRACKS_HEADER}\n")), lines: String::new(), when: String::new() })
    }

    /// With columns that name this unit of length.
    pub fn with_unit(mut self, unit: LengthUnit) -> Self {
        self.header = Some(format!("{}\n", unit.columns(TRACKS_HEADER)));
        self
    }

    fn put_header(&mut self) -> Result<()> {
        self.header.take().map_or(Ok(()), |header| self.output.put(header.as_bytes()))
    }
}

impl Sink for TracksCsv {
    fn needs_frames(&self) -> bool {
        false
    }

    fn put(&mut self, view: &View<'_>) -> Result<()> {
        self.put_header()?;
        let out = &mut self.lines;
        out.clear();
        let when = &mut self.when;
        when.clear();
        push_int(when, view.scan.index.0);
        when.push(',');
        push_seconds(when, view.scan.time);
        when.push(',');
        for track in view.tracks {
            out.push_str(when);
            push_int(out, track.id.0);
            out.push(',');
            out.push_str(status_word(track.status));
            let (mean, cov) = (&track.kinematics.mean, &track.kinematics.cov);
            for k in [0, 2, 1, 3] {
                out.push(',');
                push_f64(out, mean[k]);
            }
            for i in 0..4 {
                for j in i..4 {
                    out.push(',');
                    push_f64(out, cov[(i, j)]);
                }
            }
            for v in [track.extent.width_px, track.extent.height_px] {
                out.push(',');
                push_f64(out, v);
            }
            out.push(',');
            if let Some(detection) = track.detection {
                push_int(out, detection);
            }
            out.push('\n');
        }
        self.output.put(out.as_bytes())
    }

    fn finish(mut self: Box<Self>) -> Result<()> {
        // A run without frames has its header still to write.
        self.put_header()?;
        self.output.finish()
    }
}

#[cfg(test)]
mod names {
    use super::*;

    #[test]
    fn the_covariance_stands_in_the_header_in_its_order() {
        assert!(TRACKS_HEADER.contains(&COVARIANCE_COLUMNS.join(",")));
    }
}
