//! `detections.csv`: one row for each detection, in the detector's order within its frame.
//!
//! Columns: frame (from 0), time_s, centroid (px, the centre of the top-left pixel is (0, 0)), its covariance (px²), the
//! box in pixel-edge coordinates (a single pixel at x has left = x - 0.5), number of pixels, strongest value, sum of
//! weights (counts), score. Where spots were fitted, also how: `fit` (spot, or centroid where the fit was poor), squared residuals over their
//! variances a degree of freedom, and the chance of as much. Where each has a time of its own (a radar's plots), `age_s`: how long before the scan's time it was seen.
//! Numbers are the shortest that read back to the same bits.

use super::number::{push_f32, push_f64, push_int, push_seconds};
use crate::io::atomic::Output;
use crate::length_unit::LengthUnit;
use crate::{PositionFit, Result, Sink, Timestamp, View};
use std::path::PathBuf;

/// The header of `detections.csv`.
pub const DETECTIONS_HEADER: &str = "frame,time_s,x_px,y_px,var_x_px2,cov_x_y_px2,var_y_px2,\
left_px,top_px,width_px,height_px,area_px,peak,sum,score";

/// What it adds where spots were fitted.
const FIT_COLUMNS: &str = ",fit,chi2_per_dof,fit_p";

/// What it adds where each detection has its own time.
const AGE_COLUMN: &str = ",age_s";

/// Writes `detections.csv`.
pub struct DetectionsCsv {
    output: Output,
    lines: String,
    /// Number and time of the frame, as its rows begin.
    when: String,
    with_fits: bool,
    with_ages: bool,
}

opaque_debug!(DetectionsCsv);

impl DetectionsCsv {
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
        Ok(Self {
            output,
            lines: format!("{DETECTIONS_HEADER}\n"),
            when: String::new(),
            with_fits: false,
            with_ages: false,
        })
    }

    /// With columns that name this unit of length.
    pub fn with_unit(mut self, unit: LengthUnit) -> Self {
        self.lines = unit.columns(&self.lines);
        self
    }

    /// With columns that say how each position was fitted, or without.
    pub fn with_fits(mut self, with_fits: bool) -> Self {
        self.with_fits = with_fits;
        self.lines = self.header();
        self
    }

    /// With a column that says how long before its scan's time each detection was seen, or without.
    pub fn with_ages(mut self, with_ages: bool) -> Self {
        self.with_ages = with_ages;
        self.lines = self.header();
        self
    }

    fn header(&self) -> String {
        let fits = if self.with_fits { FIT_COLUMNS } else { "" };
        let ages = if self.with_ages { AGE_COLUMN } else { "" };
        format!("{DETECTIONS_HEADER}{fits}{ages}\n")
    }
}

impl Sink for DetectionsCsv {
    fn needs_frames(&self) -> bool {
        false
    }

    fn put(&mut self, view: &View<'_>) -> Result<()> {
        let out = &mut self.lines;
        let when = &mut self.when;
        when.clear();
        push_int(when, view.scan.index.0);
        when.push(',');
        push_seconds(when, view.scan.time);
        for d in &view.scan.detections {
            out.push_str(when);
            let e = &d.extent;
            let numbers = [
                d.position.x,
                d.position.y,
                d.cov[(0, 0)],
                d.cov[(0, 1)],
                d.cov[(1, 1)],
                e.left_px,
                e.top_px,
                e.width_px,
                e.height_px,
            ];
            for v in numbers {
                out.push(',');
                push_f64(out, v);
            }
            out.push(',');
            push_int(out, d.area_px);
            out.push(',');
            push_f32(out, d.peak);
            out.push(',');
            push_f64(out, d.sum);
            out.push(',');
            push_f32(out, d.score);
            if self.with_fits {
                match d.fit {
                    Some(PositionFit::Spot { chi2_per_dof, p }) => {
                        out.push_str(",spot,");
                        push_f64(out, chi2_per_dof);
                        out.push(',');
                        push_f64(out, p);
                    }
                    Some(PositionFit::Centroid) => out.push_str(",centroid,,"),
                    None => out.push_str(",,,"),
                }
            }
            if self.with_ages {
                out.push(',');
                push_seconds(out, Timestamp::from_ns(i64::try_from(d.age_ns).unwrap_or(i64::MAX)));
            }
            out.push('\n');
        }
        let written = self.output.put(out.as_bytes());
        out.clear();
        written
    }

    fn finish(mut self: Box<Self>) -> Result<()> {
        // A run without frames has its header still to write.
        self.output.put(self.lines.as_bytes())?;
        self.output.finish()
    }
}
