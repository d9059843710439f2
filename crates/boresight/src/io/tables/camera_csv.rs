//! `camera.csv`: one row for each frame, how the background moved in the image since the frame before.
//!
//! Columns: frame (from 0), time_s, state (`measured`; `held`: not seen, what went before goes on; `resumed`: measured against a frame that was held; `cut`: another view; `unknown`), the point that the row speaks of
//! (the image's middle, px), the background's shift there (px), its turn (rad, from +x towards +y), its growth (zoom, 1 for none), the ten distinct
//! entries of the covariance of `[dx, dy, angle, ln zoom]` (upper triangle, row by row), and the first eight entries of the homography that takes a pixel of the frame
//! before to its place now (row by row, the ninth is 1): where that is no more than a similarity the pixel p lies at c + d + zoom R(angle) (p - c). Where the motion is
//! unknown the cells are empty. Numbers are the shortest that read back to the same bits.

use super::number::{push_f64, push_seconds};
use crate::io::atomic::Output;
use crate::{Result, Sink, View};
use std::fmt::Write;
use std::path::PathBuf;

/// The header of `camera.csv`.
const CAMERA_HEADER: &str = "frame,time_s,state,centre_x_px,centre_y_px,dx_px,dy_px,angle_rad,zoom,\
var_dx_px2,cov_dx_dy_px2,cov_dx_angle_px_rad,cov_dx_zoom_px,\
var_dy_px2,cov_dy_angle_px_rad,cov_dy_zoom_px,\
var_angle_rad2,cov_angle_zoom_rad,var_zoom,h11,h12,h13_px,h21,h22,h23_px,h31_per_px,h32_per_px";

/// Writes `camera.csv`.
pub struct CameraCsv {
    output: Output,
    line: String,
}

opaque_debug!(CameraCsv);

impl CameraCsv {
    /// Creates the file and writes the header.
    /// # Errors
    /// [`crate::ErrorKind::Output`] if it cannot be written.
    pub fn create(path: impl Into<PathBuf>) -> Result<Self> {
        Self::to(Output::file(path)?)
    }

    /// Writes to any output.
    /// # Errors
    /// [`crate::ErrorKind::Output`] if it cannot be written.
    pub fn to(mut output: Output) -> Result<Self> {
        output.put(format!("{CAMERA_HEADER}\n").as_bytes())?;
        Ok(Self { output, line: String::new() })
    }
}

impl Sink for CameraCsv {
    fn needs_frames(&self) -> bool {
        false
    }

    fn put(&mut self, view: &View<'_>) -> Result<()> {
        let out = &mut self.line;
        out.clear();
        let _ = write!(out, "{},", view.scan.index.0);
        push_seconds(out, view.scan.time);
        match &view.scan.camera_motion {
            None => {
                out.push_str(",unknown");
                out.extend(std::iter::repeat_n(',', 24));
            }
            Some(m) => {
                out.push(',');
                out.push_str(m.basis.word());
                let (shift, by) = (m.shift_px(), m.now_from_before);
                for v in [
                    m.centre_px.x,
                    m.centre_px.y,
                    shift.x,
                    shift.y,
                    by.angle_rad_at(m.centre_px),
                    by.zoom_at(m.centre_px),
                ] {
                    out.push(',');
                    push_f64(out, v);
                }
                for i in 0..4 {
                    for j in i..4 {
                        out.push(',');
                        push_f64(out, m.cov[(i, j)]);
                    }
                }
                for k in 0..8 {
                    out.push(',');
                    push_f64(out, by.matrix()[(k / 3, k % 3)]);
                }
            }
        }
        out.push('\n');
        self.output.put(out.as_bytes())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.output.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CameraMotion, FrameIndex, MotionBasis, Scan, Timestamp};
    use nalgebra::Vector2;

    #[test]
    fn every_row_has_the_columns_of_the_header() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("camera.csv");
        let mut sink = CameraCsv::create(&path).unwrap();
        let motion = CameraMotion::exact_shift(Vector2::new(1.5, -2.0));
        for (k, motion) in
            [None, Some(motion), Some(CameraMotion { basis: MotionBasis::Held, ..motion })].into_iter().enumerate()
        {
            let scan =
                Scan::at(FrameIndex(k as u64), Timestamp::from_ns(40_000_000 * k as i64)).with_camera_motion(motion);
            sink.put(&View { frame: None, scan: &scan, tracks: &[] }).unwrap();
        }
        Box::new(sink).finish().unwrap();
        let text = std::fs::read_to_string(path).unwrap();
        let rows: Vec<Vec<&str>> = text.lines().map(|l| l.split(',').collect()).collect();
        assert!(rows.len() == 4 && rows.iter().all(|r| r.len() == 27), "{text}");
        assert_eq!(rows[1][..4], ["0", "0", "unknown", ""]);
        assert_eq!(rows[2][..9], ["1", "0.04", "measured", "0", "0", "1.5", "-2", "0", "1"]);
        assert_eq!(rows[2][19..], ["1", "0", "1.5", "0", "1", "-2", "0", "0"]);
        assert_eq!(rows[3][2], "held");
    }
}
