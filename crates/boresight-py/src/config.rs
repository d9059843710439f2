//! `Config`: the whole configuration of a run, from a file, a preset, the automatic choice; changed by keys.

use crate::errors::OrRaise;
use boresight::{Config, Error, ErrorKind};
use pyo3::prelude::*;
use std::path::PathBuf;

/// The ready configurations, by name.
const PRESETS: [(&str, &str); 5] = [
    ("detections-mot", include_str!("../configs/detections-mot.toml")),
    ("known-band", include_str!("../configs/known-band.toml")),
    ("particles-microscope", include_str!("../configs/particles-microscope.toml")),
    ("people-fixed-camera", include_str!("../configs/people-fixed-camera.toml")),
    ("small-infrared-targets", include_str!("../configs/small-infrared-targets.toml")),
];

/// The configuration with keys changed, each as `key=value`.
pub fn changed(mut config: Config, sets: &[String]) -> boresight::Result<Config> {
    if sets.iter().any(|s| s.starts_with("tracker.associator")) {
        // Multiple hypotheses would take its place.
        config.tracker.mht = None;
    }
    for set in sets {
        config = config.with(set)?;
    }
    Ok(config)
}

/// A configuration.
#[pyclass(name = "Config", module = "boresight._boresight", frozen, eq, from_py_object)]
#[derive(Clone, PartialEq)]
pub struct PyConfig {
    /// What it says.
    pub config: Config,
    /// Why, where it was chosen.
    #[pyo3(get)]
    pub reasons: Vec<String>,
}

#[pymethods]
impl PyConfig {
    #[new]
    #[pyo3(signature = (sets = Vec::new()))]
    fn new(py: Python<'_>, sets: Vec<String>) -> PyResult<Self> {
        let config = changed(Config::default(), &sets).or_raise(py)?;
        Ok(Self { config, reasons: Vec::new() })
    }

    #[staticmethod]
    fn from_toml(py: Python<'_>, text: &str, name: &str) -> PyResult<Self> {
        Ok(Self { config: Config::from_toml(text, name).or_raise(py)?, reasons: Vec::new() })
    }

    #[staticmethod]
    fn from_file(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        Ok(Self { config: Config::from_file(&path).or_raise(py)?, reasons: Vec::new() })
    }

    #[staticmethod]
    fn preset(py: Python<'_>, name: &str) -> PyResult<Self> {
        let found = PRESETS.iter().find(|(n, _)| *n == name).ok_or_else(|| {
            Error::new(ErrorKind::NotFound, "there is no preset of this name")
                .at(name)
                .hint(format!("presets: {}", PRESETS.map(|(n, _)| n).join(", ")))
        });
        Self::from_toml(py, found.or_raise(py)?.1, name)
    }

    #[staticmethod]
    fn presets() -> Vec<&'static str> {
        PRESETS.map(|(n, _)| n).to_vec()
    }

    fn with_sets(&self, py: Python<'_>, sets: Vec<String>) -> PyResult<Self> {
        Ok(Self { config: changed(self.config.clone(), &sets).or_raise(py)?, reasons: self.reasons.clone() })
    }

    fn to_toml(&self, py: Python<'_>) -> PyResult<String> {
        self.config.to_toml().or_raise(py)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (String, String))> {
        let text = slf.get().config.to_toml().or_raise(py)?;
        Ok((slf.get_type().getattr("from_toml")?, (text, "pickle".to_string())))
    }
}
