//! Tables of tracks from files, arrays and runs; every measure of one against another.

use crate::errors::{OrRaise, refused};
use crate::tracks::Tracks;
use boresight::io::tracks::{Format, ReadOptions, read};
use boresight::metrics::evaluation::{Better, EvaluateOptions, Matching, MeasureSet, Sequence};
use boresight::metrics::{KittiClass, Rules};
use boresight::{PixelOrigin, RowState, TrackRow, TrackTable, TrackTableBuilder};
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

/// A table of tracks.
#[pyclass(module = "boresight._boresight", frozen)]
pub struct Table {
    table: TrackTable,
    rules: Rules,
}

#[pymethods]
impl Table {
    /// Reads a file of any format that the command reads.
    #[staticmethod]
    #[pyo3(signature = (path, tentative = false))]
    fn from_path(py: Python<'_>, path: PathBuf, tentative: bool) -> PyResult<Self> {
        let file = py.detach(|| read(&path, None, ReadOptions::default(), tentative)).or_raise(py)?;
        let rules = match file.format {
            Format::Mot | Format::MotTruth => Rules::of_mot_challenge(&file.table),
            Format::Kitti => Rules::Kitti(KittiClass::Car),
            _ => Rules::None,
        };
        Ok(Self { table: file.table, rules })
    }

    /// The rows of a run.
    #[staticmethod]
    #[pyo3(signature = (rows, tentative = false))]
    fn from_rows(py: Python<'_>, rows: &Tracks, tentative: bool) -> PyResult<Self> {
        Ok(Self { table: rows.columns().table(rows.name(), tentative).or_raise(py)?, rules: Rules::None })
    }

    /// Rows from arrays: frames, ids, boxes N x 4 (left, top, width, height, from the centre of the first pixel), states N x 5
    /// (vx, vy, and xx, xy, yy of the position's covariance; NaN: unknown).
    #[staticmethod]
    fn from_columns(
        py: Python<'_>,
        frame: PyReadonlyArray1<'_, i64>,
        id: PyReadonlyArray1<'_, i64>,
        boxes: PyReadonlyArray2<'_, f64>,
        states: PyReadonlyArray2<'_, f64>,
        points: bool,
    ) -> PyResult<Self> {
        let (frame, id, boxes, states) = (frame.as_array(), id.as_array(), boxes.as_array(), states.as_array());
        let n = frame.len();
        if id.len() != n || boxes.shape() != [n, 4] || states.shape() != [n, 5] {
            return Err(refused("columns of different lengths", "table", "one row for each track and frame"));
        }
        let mut builder = TrackTableBuilder::new("table", PixelOrigin::Centre0);
        if points {
            builder.points();
        }
        for r in 0..n {
            let Ok(frame) = u32::try_from(frame[r]) else {
                return Err(refused(format!("frame {}", frame[r]), format!("row {r}"), "frames count from 0"));
            };
            let row =
                TrackRow { frame, id: id[r], bbox: std::array::from_fn(|k| boxes[(r, k)]), ..TrackRow::default() };
            let s = |k: usize| states[(r, k)];
            let state = RowState {
                velocity: (!s(0).is_nan()).then(|| [s(0), s(1)]),
                position_cov: (!s(2).is_nan()).then(|| [s(2), s(3), s(4)]),
                ..RowState::default()
            };
            builder.push_with_state(&row, &state).map_err(|e| e.at(format!("row {r}"))).or_raise(py)?;
        }
        Ok(Self { table: builder.finish(0).or_raise(py)?, rules: Rules::None })
    }
}

/// Every measure: name, value, unit, which way it is better; and remarks.
#[pyfunction]
#[pyo3(signature = (truth, result, *, distance_px = None, min_overlap = 0.5, cutoff_px = 10.0, order = 2.0, rate_hz = None, size_px = None, all_measures = true))]
pub fn evaluate<'py>(
    py: Python<'py>,
    truth: &Table,
    result: &Table,
    distance_px: Option<f64>,
    min_overlap: f64,
    cutoff_px: f64,
    order: f64,
    rate_hz: Option<f64>,
    size_px: Option<(f64, f64)>,
    all_measures: bool,
) -> PyResult<(Bound<'py, PyDict>, Vec<String>)> {
    let mut options = EvaluateOptions::default();
    options.rules = truth.rules;
    if let Some(distance) = distance_px {
        options.matching = Matching::Centre;
        options.max_distance_px = distance;
    }
    options.min_overlap = min_overlap;
    options.set.cutoff_px = cutoff_px;
    options.set.order = order;
    options.measures = if all_measures { MeasureSet::All } else { MeasureSet::Mot };
    let mut sequence = Sequence::new(&truth.table, &result.table);
    (sequence.rate_hz, sequence.size_px) = (rate_hz, size_px);
    let evaluation = py.detach(|| sequence.evaluate(&options)).or_raise(py)?;
    let out = PyDict::new(py);
    for v in evaluation.values() {
        let better = match v.better {
            Better::Higher => "higher",
            Better::Lower => "lower",
            Better::Neither => "",
        };
        out.set_item(v.name, (v.value, v.unit, better))?;
    }
    Ok((out, evaluation.notes.iter().map(ToString::to_string).collect()))
}
