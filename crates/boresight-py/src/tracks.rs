//! The result of a run: its columns as arrays, its tables and its report as files.

use crate::arrow;
use crate::columns::{Columns, STATUS};
use crate::config::PyConfig;
use crate::errors::{OrRaise, raised, refused};
use boresight::io::tracks::{Dialect, Format, measured_rows, write_path};
use boresight::io::{JsonLines, MotWriter, TRACKS_HEADER, TracksCsv};
use boresight::pipeline::Summary;
use boresight::report::{HtmlReport, Notes};
use boresight::{Config, Sink};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyCapsule, PyDict};
use std::path::PathBuf;
use std::sync::Arc;

/// The rows of a run.
#[pyclass(module = "boresight._boresight", name = "Rows", frozen)]
pub struct Tracks {
    columns: Arc<Columns>,
    config: Config,
    reasons: Vec<String>,
    /// What was lost or made up.
    #[pyo3(get)]
    warnings: Vec<String>,
    summary: Summary,
    /// The input's name.
    #[pyo3(get)]
    label: String,
    reader: String,
}

impl Tracks {
    /// Takes over what a run left.
    pub fn new(
        columns: Columns,
        config: Config,
        reasons: Vec<String>,
        warnings: Vec<String>,
        summary: Summary,
        label: String,
        reader: String,
    ) -> Self {
        Self { columns: Arc::new(columns), config, reasons, warnings, summary, label, reader }
    }

    /// The columns.
    pub fn columns(&self) -> &Arc<Columns> {
        &self.columns
    }

    /// The input's name.
    pub fn name(&self) -> &str {
        &self.label
    }

    fn notes(&self, py: Python<'_>) -> PyResult<Notes> {
        Ok(Notes {
            input: self.label.clone(),
            facts: vec![("Read as".to_string(), self.reader.clone())],
            settings: self.reasons.clone(),
            configuration: Some(self.config.to_toml().or_raise(py)?),
            warnings: self.warnings.clone(),
            ..Notes::default()
        })
    }
}

#[pymethods]
impl Tracks {
    fn __len__(&self) -> usize {
        self.columns.len()
    }

    #[getter]
    fn config(&self) -> PyConfig {
        PyConfig { config: self.config.clone(), reasons: self.reasons.clone() }
    }

    /// Frames, seconds, detections, confirmed tracks, most at once, mean NIS, interrupted.
    #[getter]
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (s, d) = (&self.summary, PyDict::new(py));
        d.set_item("n_frames", s.frames)?;
        d.set_item("duration_s", s.duration_s)?;
        d.set_item("n_detections", s.detections)?;
        d.set_item("n_confirmed_tracks", s.confirmed_tracks)?;
        d.set_item("most_at_once", s.most_at_once)?;
        d.set_item("mean_nis", s.mean_nis.map(|(nis, _)| nis))?;
        Ok(d)
    }

    /// The columns as arrays, each a copy of its own; `status` as codes of `STATUS`.
    fn columns_as_arrays<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (c, out) = (&self.columns, PyDict::new(py));
        let mut floats = c.floats.iter();
        for name in TRACKS_HEADER.split(',') {
            match name {
                "frame" => out.set_item(name, PyArray1::from_slice(py, &c.frame))?,
                "time_s" => out.set_item(name, PyArray1::from_slice(py, &c.time_s))?,
                "track_id" => out.set_item(name, PyArray1::from_slice(py, &c.track_id))?,
                "status" => out.set_item(name, PyArray1::from_slice(py, &c.status))?,
                "detection" => out.set_item(name, PyArray1::from_slice(py, &c.detection))?,
                _ => out.set_item(name, PyArray1::from_slice(py, floats.next().map_or(&[][..], Vec::as_slice)))?,
            }
        }
        Ok(out)
    }

    /// Confidences, one a row.
    fn scores<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f32>> {
        PyArray1::from_slice(py, &self.columns.score)
    }

    #[pyo3(signature = (requested_schema = None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        // The standard lets a producer hand out its own types.
        drop(requested_schema);
        arrow::capsule(py, &self.columns)
    }

    /// Writes a table; returns the names of what the format cannot hold.
    fn write(&self, py: Python<'_>, path: PathBuf, format: &str) -> PyResult<Vec<String>> {
        let written = py.detach(|| -> boresight::Result<Option<Vec<String>>> {
            let mut sink: Box<dyn Sink> = match format {
                "csv" => Box::new(TracksCsv::create(&path)?),
                "mot" => Box::new(MotWriter::create(&path)?),
                "jsonl" => Box::new(JsonLines::create(&path)?),
                other => {
                    let mut all = Format::ALL.into_iter().chain(Format::EXPORTS);
                    let Some(format) = all.find(|f| f.name() == other && *f != Format::Ctc) else {
                        return Ok(None);
                    };
                    let mut table = self.columns.table(&self.label, false)?;
                    if format == Format::Named(Dialect::Trackpy) {
                        table = measured_rows(&table);
                    }
                    return write_path(&table, format, Some(&path)).map(Some);
                }
            };
            self.columns.replay(sink.as_mut())?;
            sink.finish()?;
            Ok(Some(Vec::new()))
        });
        written.or_raise(py)?.ok_or_else(|| {
            let known = "csv, mot, mot-truth, kitti, trackpy, trackmate, btrack, ultrack, geff, trackmate-xml, cvat, mot-zip, napari, mcap, vmti, jsonl, parquet";
            refused("there is no such format", format!("format = {format}"), format!("formats: {known}"))
        })
    }

    /// Writes the report.
    fn report(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let notes = self.notes(py)?;
        let written = py.detach(|| {
            let mut report = HtmlReport::create(path)?;
            self.columns.replay(&mut report.sink())?;
            report.write(&notes)
        });
        written.map_err(|e| raised(py, &e))
    }

    /// The words of the codes of `status`.
    #[classattr]
    const STATUS: [&'static str; 3] = STATUS;
}
