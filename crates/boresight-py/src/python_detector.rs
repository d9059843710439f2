//! A detector written in Python as a stage of a run: it gets the pixels as an array, it returns detections.

use crate::detections::detections_of;
use crate::pixels::array_of;
use crate::source::Raised;
use boresight::vision::Detector;
use boresight::{Frame, Result, Scan};
use pyo3::prelude::*;

/// A callable `f(pixels) -> detections`.
pub struct PythonDetector {
    /// The callable.
    pub function: Py<PyAny>,
    /// Where its exceptions are kept.
    pub raised: Raised,
    /// Standard deviation of positions without covariance, px, and as a share of the box's side.
    pub std: (f64, f64),
}

impl Detector for PythonDetector {
    fn detect(&mut self, frame: &Frame, scan: &mut Scan) -> Result<()> {
        let found = Python::attach(|py| -> PyResult<_> {
            // A loop in Rust does not look at signals by itself.
            py.check_signals()?;
            let pixels = array_of(py, &frame.pixels)?;
            detections_of(&self.function.bind(py).call1((pixels,))?, self.std)
        });
        let detections = found.map_err(|e| self.raised.keep(e))?;
        *scan = Scan::at(frame.index, frame.time).with_detections(detections);
        Ok(())
    }
}
