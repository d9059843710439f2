//! Detections without tracks: of frames, and of tables of positions that are to be linked.

use crate::errors::refused;
use boresight::boresight_filters::nalgebra::{Matrix2, Vector2};
use boresight::{Detection, Extent, FrameIndex, Result, Scan, Sink, Timestamp, View};
use numpy::{PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Names of the columns that are floats of 64 bits.
const FLOATS: [&str; 12] =
    ["time_s", "x", "y", "var_x", "cov_xy", "var_y", "width", "height", "area", "peak", "sum", "score"];

/// The detections of a run as columns.
#[derive(Default)]
pub struct Found {
    frame: Vec<i64>,
    floats: [Vec<f64>; 12],
}

impl Found {
    /// The columns as arrays.
    pub fn arrays<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let out = PyDict::new(py);
        out.set_item("frame", PyArray1::from_slice(py, &self.frame))?;
        for (name, column) in FLOATS.iter().zip(&self.floats) {
            out.set_item(name, PyArray1::from_slice(py, column))?;
        }
        Ok(out)
    }
}

/// Fills the columns while a run goes on.
pub struct FoundSink<'a>(pub &'a mut Found);

impl Sink for FoundSink<'_> {
    fn put(&mut self, view: &View<'_>) -> Result<()> {
        let scan = view.scan;
        for d in &scan.detections {
            self.0.frame.push(i64::try_from(scan.index.0).unwrap_or(i64::MAX));
            let (e, c) = (&d.extent, &d.cov);
            let (area, peak, score) = (f64::from(d.area_px), f64::from(d.peak), f64::from(d.score));
            let time_s = scan.time.as_secs_f64();
            let place = [time_s, d.position.x, d.position.y, c[(0, 0)], c[(0, 1)], c[(1, 1)]];
            let look = [e.width_px, e.height_px, area, peak, d.sum, score];
            self.0.floats.iter_mut().zip(place.into_iter().chain(look)).for_each(|(column, v)| column.push(v));
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        Ok(())
    }
}

/// Scans from columns that are sorted by frame: positions N x 2, covariances N x 3 (xx, xy, yy), sizes N x 2, scores N.
pub fn scans_of(
    frames: &PyReadonlyArray1<'_, i64>,
    positions: &PyReadonlyArray2<'_, f64>,
    covariances: &PyReadonlyArray2<'_, f64>,
    sizes: &PyReadonlyArray2<'_, f64>,
    rate_hz: f64,
) -> PyResult<Vec<Scan>> {
    let (frames, positions) = (frames.as_array(), positions.as_array());
    let (covariances, sizes) = (covariances.as_array(), sizes.as_array());
    let n = frames.len();
    if positions.shape() != [n, 2] || covariances.shape() != [n, 3] || sizes.shape() != [n, 2] {
        return Err(refused("columns of different lengths", "table", "one row for each detection"));
    }
    let (Some(&first), Some(&last)) = (frames.first(), frames.last()) else {
        return Err(refused("the table has no rows", "table", "there is nothing to link"));
    };
    let most = 1_000_000 + 1000 * n as i64;
    if first < 0 || last > most {
        return Err(refused(format!("frames {first} to {last}"), "frame", "frames count from 0"));
    }
    let scan = |k: i64| Scan::at(FrameIndex(k.unsigned_abs()), Timestamp::from_secs_f64(k as f64 / rate_hz));
    let mut scans: Vec<Scan> = (first..=last).map(scan).collect();
    for r in 0..n {
        let at = frames[r] - first;
        let Some(scan) = usize::try_from(at).ok().and_then(|at| scans.get_mut(at)) else {
            return Err(refused(
                format!("frame {} after frame {last}", frames[r]),
                format!("row {r}"),
                "sort by frame",
            ));
        };
        let position = Vector2::new(positions[(r, 0)], positions[(r, 1)]);
        let c = |k: usize| covariances[(r, k)];
        let d = Detection::at(position, Matrix2::new(c(0), c(1), c(1), c(2)));
        scan.detections.push(d.with_extent(Extent::around(position, sizes[(r, 0)], sizes[(r, 1)])));
    }
    Ok(scans)
}
