//! The native part of the Python package `boresight`; `python/boresight` wraps it, and `_boresight.pyi` says its types.
//!
//! Nothing here computes: every function takes Python's values apart, calls the library without the interpreter's lock, and puts the
//! results together. A run's frames are copied once from the caller's arrays, so the caller may write to them again as soon as
//! the next frame is asked for.

// What Python names need no path in Rust.
#![allow(unnameable_types)]

mod arrow;
mod columns;
mod config;
mod detect;
mod detections;
mod errors;
mod evaluate;
mod filters;
mod pixels;
mod plan;
mod python_detector;
mod run;
mod simulate;
mod source;
mod speed;
mod states;
mod tracker;
mod tracks;

use pyo3::prelude::*;

#[pymodule]
mod _boresight {
    use super::*;

    #[pymodule_export]
    use super::config::PyConfig;
    #[pymodule_export]
    use super::evaluate::{Table, evaluate};
    #[pymodule_export]
    use super::filters::{Batch, Filter};
    #[pymodule_export]
    use super::run::{
        choose_for_arrays, choose_for_path, choose_for_scans, detect_arrays, detect_path, track_arrays, track_columns,
        track_path,
    };
    #[pymodule_export]
    use super::simulate::{scenes, simulate};
    #[pymodule_export]
    use super::speed::time_of_updates;
    #[pymodule_export]
    use super::states::{State, States};
    #[pymodule_export]
    use super::tracker::Tracker;
    #[pymodule_export]
    use super::tracks::Tracks;

    /// The processor's architecture and the vector instructions it has.
    #[pyfunction]
    fn cpu_features() -> Vec<&'static str> {
        boresight::cpu_features()
    }

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
