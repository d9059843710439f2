//! The tracks after one scan, as Python sees them: a sequence of states, and arrays over all of them.

use crate::columns::{STATUS, status_code};
use crate::detections::corners_of;
use boresight::{Scan, TrackState, TrackStatus};
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::{PyIterator, PyList};
use std::sync::Arc;

/// One track after one scan.
#[pyclass(module = "boresight._boresight", name = "TrackState", frozen)]
pub struct State {
    all: Arc<Vec<TrackState>>,
    index: usize,
}

impl State {
    fn get(&self) -> &TrackState {
        &self.all[self.index]
    }
}

/// n x `W` values as an array.
fn rows<'py, const W: usize>(
    py: Python<'py>,
    tracks: &[TrackState],
    of: impl Fn(&TrackState) -> [f64; W],
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let flat: Vec<f64> = tracks.iter().flat_map(of).collect();
    PyArray1::from_vec(py, flat).reshape([tracks.len(), W])
}

/// n x `W` x `W` values as an array.
fn matrices<'py, const W: usize>(
    py: Python<'py>,
    tracks: &[TrackState],
    of: impl Fn(&TrackState, usize, usize) -> f64,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let entries = |t| (0..W * W).map(move |k| (t, k / W, k % W));
    let flat: Vec<f64> = tracks.iter().flat_map(entries).map(|(t, i, j)| of(t, i, j)).collect();
    PyArray1::from_vec(py, flat).reshape([tracks.len(), W, W])
}

fn position(t: &TrackState) -> [f64; 2] {
    [t.kinematics.mean[0], t.kinematics.mean[2]]
}

fn velocity(t: &TrackState) -> [f64; 2] {
    [t.kinematics.mean[1], t.kinematics.mean[3]]
}

fn position_cov(t: &TrackState, i: usize, j: usize) -> f64 {
    t.kinematics.cov[(2 * i, 2 * j)]
}

fn state_cov(t: &TrackState, i: usize, j: usize) -> f64 {
    t.kinematics.cov[(i, j)]
}

#[pymethods]
impl State {
    /// The track's number, from 1, never used twice.
    #[getter]
    fn id(&self) -> u64 {
        self.get().id.0
    }

    /// `tentative`, `confirmed` or `coasting` (confirmed, no detection in this scan).
    #[getter]
    fn status(&self) -> &'static str {
        STATUS[status_code(self.get().status) as usize]
    }

    /// Whether it is confirmed, coasting or not.
    #[getter]
    fn is_confirmed(&self) -> bool {
        self.get().status != TrackStatus::Tentative
    }

    /// x, y, px.
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &position(self.get()))
    }

    /// vx, vy, px/s.
    #[getter]
    fn velocity<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &velocity(self.get()))
    }

    /// Covariance of the position, 2 x 2, px².
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let one = std::slice::from_ref(self.get());
        matrices::<2>(py, one, position_cov)?.reshape([2, 2])
    }

    /// `[x, vx, y, vy]`, px and px/s.
    #[getter]
    fn state<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.get().kinematics.mean.as_slice())
    }

    /// Covariance of the state, 4 x 4.
    #[getter]
    fn state_covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrices::<4>(py, std::slice::from_ref(self.get()), state_cov)?.reshape([4, 4])
    }

    /// Left, top, right, bottom, px, as object detectors count: the first pixel begins at 0.
    #[getter]
    fn r#box<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &corners_of(&self.get().extent))
    }

    /// Confidence.
    #[getter]
    fn score(&self) -> f32 {
        self.get().score
    }

    /// Number of the detection of this scan that the track took, or `None`.
    #[getter]
    fn detection(&self) -> Option<u32> {
        self.get().detection
    }

    /// Normalised innovation squared of this scan's update; 2 in the mean if the uncertainty is honest.
    #[getter]
    fn nis(&self) -> Option<f64> {
        self.get().innovation.as_ref().map(|i| i.nis)
    }

    fn __repr__(&self) -> String {
        let (t, [x, y]) = (self.get(), position(self.get()));
        let (sx, sy) = (position_cov(t, 0, 0).sqrt(), position_cov(t, 1, 1).sqrt());
        format!("<track {} {}: x {x:.2} ± {sx:.2} px, y {y:.2} ± {sy:.2} px>", t.id.0, self.status())
    }
}

/// All tracks after one scan.
#[pyclass(module = "boresight._boresight", frozen, sequence)]
pub struct States {
    all: Arc<Vec<TrackState>>,
    #[pyo3(get)]
    frame: u64,
    #[pyo3(get)]
    time_s: f64,
    n_detections: usize,
}

impl States {
    /// The states after a scan.
    pub fn after(scan: &Scan, tracks: Vec<TrackState>) -> Self {
        let n_detections = scan.detections.len();
        Self { all: Arc::new(tracks), frame: scan.index.0, time_s: scan.time.as_secs_f64(), n_detections }
    }
}

#[pymethods]
impl States {
    fn __len__(&self) -> usize {
        self.all.len()
    }

    fn __getitem__(&self, index: isize) -> PyResult<State> {
        let n = self.all.len();
        let at = if index < 0 { n.checked_sub(index.unsigned_abs()) } else { Some(index.unsigned_abs()) };
        let at = at.filter(|at| *at < n);
        let index = at.ok_or_else(|| PyIndexError::new_err(format!("track {index} of {n}")))?;
        Ok(State { all: Arc::clone(&self.all), index })
    }

    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyIterator>> {
        let states = (0..self.all.len()).map(|index| State { all: Arc::clone(&self.all), index });
        PyList::new(py, states.collect::<Vec<_>>())?.try_iter()
    }

    /// Those that are confirmed, coasting ones among them.
    #[getter]
    fn confirmed(&self) -> Self {
        let kept = self.all.iter().filter(|t| t.status != TrackStatus::Tentative).cloned().collect();
        Self { all: Arc::new(kept), ..*self }
    }

    /// N numbers.
    #[getter]
    fn ids<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        PyArray1::from_iter(py, self.all.iter().map(|t| i64::try_from(t.id.0).unwrap_or(i64::MAX)))
    }

    /// N words.
    #[getter]
    fn statuses(&self) -> Vec<&'static str> {
        self.all.iter().map(|t| STATUS[status_code(t.status) as usize]).collect()
    }

    /// N x 2, px.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        rows(py, &self.all, position)
    }

    /// N x 2, px/s.
    #[getter]
    fn velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        rows(py, &self.all, velocity)
    }

    /// Covariances of the positions, N x 2 x 2, px².
    #[getter]
    fn covariances<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        matrices::<2>(py, &self.all, position_cov)
    }

    /// Covariances of `[x, vx, y, vy]`, N x 4 x 4.
    #[getter]
    fn state_covariances<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        matrices::<4>(py, &self.all, state_cov)
    }

    /// N x 4, left, top, right, bottom, px, as object detectors count.
    #[getter]
    fn boxes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        rows(py, &self.all, |t| corners_of(&t.extent))
    }

    /// N confidences.
    #[getter]
    fn scores<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f32>> {
        PyArray1::from_iter(py, self.all.iter().map(|t| t.score))
    }

    /// Numbers of the detections taken, -1 for none.
    #[getter]
    fn detections<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        PyArray1::from_iter(py, self.all.iter().map(|t| t.detection.map_or(-1, i64::from)))
    }

    /// For each detection of the scan the place of the confirmed track that took it, -1 for none.
    fn tracks_of_detections<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        let mut places = vec![-1_i64; self.n_detections];
        for (place, t) in self.all.iter().enumerate().filter(|(_, t)| t.status == TrackStatus::Confirmed) {
            if let Some(of) = t.detection.and_then(|d| places.get_mut(d as usize)) {
                *of = place as i64;
            }
        }
        PyArray1::from_vec(py, places)
    }

    fn __repr__(&self) -> String {
        let shown: Vec<String> =
            (0..self.all.len().min(5)).map(|index| State { all: Arc::clone(&self.all), index }.__repr__()).collect();
        let rest = if self.all.len() > 5 { ", .." } else { "" };
        format!("[{}{rest}] at {:.3} s", shown.join(", "), self.time_s)
    }
}
