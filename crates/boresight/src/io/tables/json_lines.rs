//! JSON lines: one object for each frame with its detections and tracks, units in the names.
//!
//! Numbers that JSON cannot hold (infinite, not a number) become `null`. Covariances are rows of the upper triangle as
//! in the CSV tables: `[x,x] [x,y] [y,y]`, and the ten entries of `[x, vx, y, vy]`.
//! Why not `serde_json`: it writes 2.0 and 1e+21 where the CSV tables have 2 and 1e21; the numbers are to be the same text in both.

use super::number::{push_f32, push_f64, push_seconds};
use super::tracks_csv::status_word;
use crate::io::atomic::Output;
use crate::length_unit::LengthUnit;
use crate::{Detection, Result, Sink, TrackState, View};
use std::fmt::Write;
use std::path::PathBuf;

/// Writes JSON lines.
pub struct JsonLines {
    output: Output,
    unit: LengthUnit,
    line: String,
    /// The line with the names of another unit.
    renamed: String,
}

opaque_debug!(JsonLines);

impl JsonLines {
    /// Creates the file.
    /// # Errors
    /// [`crate::ErrorKind::Output`] if it cannot be written.
    pub fn create(path: impl Into<PathBuf>) -> Result<Self> {
        Ok(Self::to(Output::file(path)?))
    }

    /// Writes to any output.
    pub fn to(output: Output) -> Self {
        Self { output, unit: LengthUnit::Pixel, line: String::new(), renamed: String::new() }
    }

    /// With names that say this unit of length.
    pub fn with_unit(mut self, unit: LengthUnit) -> Self {
        self.unit = unit;
        self
    }
}

fn number(out: &mut String, v: f64) {
    if v.is_finite() { push_f64(out, v) } else { out.push_str("null") }
}

fn numbers(out: &mut String, values: impl IntoIterator<Item = f64>) {
    out.push('[');
    for (i, v) in values.into_iter().enumerate() {
        if i > 0 {
            out.push(',');
        }
        number(out, v);
    }
    out.push(']');
}

fn fields(out: &mut String, fields: &[(&str, f64)]) {
    for (name, v) in fields {
        let _ = write!(out, ",\"{name}\":");
        number(out, *v);
    }
}

/// The shortest digits of a 32-bit number as JSON.
fn short(out: &mut String, name: &str, v: f32) {
    let _ = write!(out, ",\"{name}\":");
    if v.is_finite() { push_f32(out, v) } else { out.push_str("null") }
}

fn detection(out: &mut String, d: &Detection) {
    out.push_str("{\"x_px\":");
    number(out, d.position.x);
    fields(out, &[("y_px", d.position.y)]);
    out.push_str(",\"cov_px2\":");
    numbers(out, [d.cov[(0, 0)], d.cov[(0, 1)], d.cov[(1, 1)]]);
    let e = &d.extent;
    fields(out, &[("left_px", e.left_px), ("top_px", e.top_px), ("width_px", e.width_px), ("height_px", e.height_px)]);
    let _ = write!(out, ",\"area_px\":{}", d.area_px);
    short(out, "peak", d.peak);
    fields(out, &[("sum", d.sum)]);
    short(out, "score", d.score);
    if let Some(class) = d.class {
        let _ = write!(out, ",\"class\":{}", class.0);
    }
    out.push('}');
}

fn track(out: &mut String, t: &TrackState) {
    let _ = write!(out, "{{\"track_id\":{},\"status\":\"{}\",\"x_px\":", t.id.0, status_word(t.status));
    let (m, p) = (&t.kinematics.mean, &t.kinematics.cov);
    number(out, m[0]);
    fields(out, &[("y_px", m[2]), ("vx_px_per_s", m[1]), ("vy_px_per_s", m[3])]);
    out.push_str(",\"cov\":");
    numbers(out, (0..4).flat_map(|i| (i..4).map(move |j| p[(i, j)])));
    fields(out, &[("width_px", t.extent.width_px), ("height_px", t.extent.height_px)]);
    if let Some(row) = t.detection {
        let _ = write!(out, ",\"detection\":{row}");
    }
    if let Some(i) = &t.innovation {
        out.push_str(",\"innovation\":{\"residual_px\":");
        numbers(out, [i.innovation.x, i.innovation.y]);
        out.push_str(",\"cov_px2\":");
        numbers(out, [i.cov[(0, 0)], i.cov[(0, 1)], i.cov[(1, 1)]]);
        fields(out, &[("nis", i.nis)]);
        out.push('}');
    }
    short(out, "score", t.score);
    out.push('}');
}

impl Sink for JsonLines {
    fn needs_frames(&self) -> bool {
        false
    }

    fn put(&mut self, view: &View<'_>) -> Result<()> {
        let out = &mut self.line;
        out.clear();
        let _ = write!(out, "{{\"frame\":{},\"time_s\":", view.scan.index.0);
        push_seconds(out, view.scan.time);
        out.push_str(",\"detections\":[");
        for (i, d) in view.scan.detections.iter().enumerate() {
            if i > 0 {
                out.push(',');
            }
            detection(out, d);
        }
        out.push_str("],\"tracks\":[");
        for (i, t) in view.tracks.iter().enumerate() {
            if i > 0 {
                out.push(',');
            }
            track(out, t);
        }
        out.push_str("]}\n");
        if self.unit == LengthUnit::Pixel {
            return self.output.put(out.as_bytes());
        }
        // Only names hold letters here.
        self.renamed.clear();
        self.unit.push_columns(&mut self.renamed, &self.line);
        self.output.put(self.renamed.as_bytes())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.output.finish()
    }
}
