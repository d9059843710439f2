//! Frames from a Python iterable: each `next` is called with the interpreter's lock held, everything else runs without it.

use crate::pixels::pixels_of;
use boresight::{Error, ErrorKind, Frame, FrameIndex, FrameSource, Result, SourceInfo, Timestamp};
use pyo3::prelude::*;
use std::sync::{Arc, Mutex};

/// How the input of a run is named that asks Python for its frames.
pub const READER: &str = "arrays in memory";

/// An exception raised by the user's own code in the middle of a run; it is what the caller gets to see.
#[derive(Clone, Default)]
pub struct Raised(Arc<Mutex<Option<PyErr>>>);

impl Raised {
    /// Keeps an exception and gives the error that ends the run.
    pub fn keep(&self, error: PyErr) -> Error {
        let text = error.to_string();
        if let Ok(mut kept) = self.0.lock() {
            kept.get_or_insert(error);
        }
        Error::new(ErrorKind::Interrupted, text)
    }

    /// The exception, if there was one.
    pub fn take(&self) -> Option<PyErr> {
        self.0.lock().ok()?.take()
    }
}

/// When frames were taken.
#[derive(Clone, Debug)]
pub enum Times {
    /// Evenly, frames/s.
    Rate(f64),
    /// Each frame's own, s.
    Each(Arc<Vec<f64>>),
}

impl Times {
    /// The time of frame `k`.
    pub fn of(&self, k: u64) -> Result<Timestamp> {
        match self {
            Self::Rate(hz) => Ok(Timestamp::from_secs_f64(k as f64 / hz)),
            Self::Each(times) => {
                let found = usize::try_from(k).ok().and_then(|k| times.get(k));
                found.map(|t| Timestamp::from_secs_f64(*t)).ok_or_else(|| {
                    Error::new(ErrorKind::Config, format!("{} times for more frames than that", times.len()))
                        .at("times")
                        .hint("give one time for each frame, or rate_hz=")
                })
            }
        }
    }

    /// The mean rate, frames/s.
    pub fn rate_hz(&self) -> Option<f64> {
        match self {
            Self::Rate(hz) => Some(*hz),
            Self::Each(times) => {
                let span = times.last()? - times.first()?;
                (times.len() > 1 && span > 0.0).then(|| (times.len() - 1) as f64 / span)
            }
        }
    }
}

/// Frames of an iterator.
pub struct ArrayFrames {
    iterator: Py<PyAny>,
    first: Option<Frame>,
    next: u64,
    times: Times,
    info: SourceInfo,
    raised: Raised,
}

impl ArrayFrames {
    /// Starts an iterable and reads its first frame.
    pub fn start(
        frames: &Bound<'_, PyAny>,
        n_frames: Option<u64>,
        times: Times,
        raised: Raised,
    ) -> PyResult<Option<Self>> {
        let iterator = frames.call_method0("__iter__")?;
        let Some(first) = iterator.try_iter()?.next().transpose()? else { return Ok(None) };
        let pixels = pixels_of(&first)?;
        let info = SourceInfo {
            label: "arrays".into(),
            reader: READER.into(),
            width: pixels.width(),
            height: pixels.height(),
            kind: pixels.kind(),
            n_frames,
            rate_hz: times.rate_hz(),
            true_times: matches!(times, Times::Each(_)),
        };
        let time = times.of(0).map_err(|e| crate::errors::raised(frames.py(), &e))?;
        let first = Some(Frame { index: FrameIndex(0), time, pixels });
        Ok(Some(Self { iterator: iterator.unbind(), first, next: 0, times, info, raised }))
    }
}

impl FrameSource for ArrayFrames {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next_frame(&mut self) -> Result<Option<Frame>> {
        let index = FrameIndex(self.next);
        if let Some(frame) = self.first.take() {
            self.next += 1;
            return Ok(Some(frame));
        }
        let pixels = Python::attach(|py| -> PyResult<_> {
            let iterator = self.iterator.bind(py);
            match iterator.try_iter()?.next() {
                None => Ok(None),
                Some(frame) => pixels_of(&frame?).map(Some),
            }
        });
        let Some(pixels) = pixels.map_err(|e| self.raised.keep(e))? else { return Ok(None) };
        let time = self.times.of(index.0)?;
        self.next += 1;
        Ok(Some(Frame { index, time, pixels }))
    }
}
