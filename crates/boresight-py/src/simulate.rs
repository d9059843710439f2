//! Scenes with a known truth.

use crate::columns::Columns;
use crate::errors::OrRaise;
use crate::pixels::array_of;
use crate::tracks::Tracks;
use boresight::pipeline::Summary;
use boresight::sim::scene::SceneConfig;
use boresight::sim::{NAMES, Seed, named};
use boresight::{Config, FrameSource, Pixels};
use pyo3::prelude::*;
use std::collections::BTreeSet;

/// Names of scenes, each with what it shows.
#[pyfunction]
pub fn scenes() -> Vec<(&'static str, &'static str)> {
    NAMES.to_vec()
}

/// A scene's frames, their times (s), the truth, the rate (frames/s).
type Simulated<'py> = (Vec<Bound<'py, PyAny>>, Vec<f64>, Tracks, f64);

/// Makes a scene by name or from TOML text.
#[pyfunction]
#[pyo3(signature = (name, toml, seed, run, n_frames))]
pub fn simulate<'py>(
    py: Python<'py>,
    name: &str,
    toml: Option<&str>,
    seed: u64,
    run: u64,
    n_frames: Option<u64>,
) -> PyResult<Simulated<'py>> {
    let seed = Seed { seed, run };
    let mut scene: SceneConfig = match toml {
        Some(text) => SceneConfig::from_toml(text).map_err(|e| e.at(name)).or_raise(py)?,
        None => named(name, seed).or_raise(py)?,
    };
    scene.n_frames = n_frames.unwrap_or(scene.n_frames);
    let mut source = scene.build(seed).or_raise(py)?;
    let (mut frames, mut times, mut truth) = (Vec::new(), Vec::new(), Columns::default());
    let mut ids = BTreeSet::new();
    loop {
        py.check_signals()?;
        let next = py.detach(|| -> boresight::Result<Option<(Pixels, f64)>> {
            let Some(frame) = source.next_frame()? else { return Ok(None) };
            truth.push(frame.index, frame.time, 0, source.truth());
            ids.extend(source.truth().iter().map(|t| t.id));
            Ok(Some((frame.pixels, frame.time.as_secs_f64())))
        });
        let Some((pixels, time_s)) = next.or_raise(py)? else { break };
        frames.push(array_of(py, &pixels)?);
        times.push(time_s);
    }
    let duration_s = times.last().zip(times.first()).map_or(0.0, |(last, first)| last - first);
    let confirmed_tracks = ids.len() as u64;
    let summary = Summary { frames: frames.len() as u64, duration_s, confirmed_tracks, ..Summary::default() };
    let label = format!("the truth of {name}");
    let truth = Tracks::new(truth, Config::default(), Vec::new(), Vec::new(), summary, label, "simulated".into());
    Ok((frames, times, truth, scene.rate_hz))
}
