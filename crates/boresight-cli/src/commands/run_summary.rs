//! `summary.json`: what a run gave, for programs; no times of stages, so that the same run gives the same bytes.

use boresight::pipeline::Summary;
use boresight::verdict::Verdict;
use boresight::{Error, ErrorKind};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Counts, verdict and warnings of one run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RunSummary {
    /// The input as it was given.
    pub input: String,
    /// Frames done.
    pub frames: u64,
    /// Time from the first to the last frame, s.
    pub duration_s: f64,
    /// Detections in all frames.
    pub detections: u64,
    /// Tracks that were confirmed at some time.
    pub confirmed_tracks: u64,
    /// Most confirmed tracks in one frame.
    pub most_at_once: u64,
    /// Mean normalised innovation squared (2 if the uncertainty is honest), and over how many updates.
    pub mean_nis: Option<(f64, u64)>,
    /// What is thought of the run.
    pub verdict: String,
    /// Whether the run's own statistics speak against its result.
    pub is_doubtful: bool,
    /// Options to try next.
    pub next: Option<String>,
    /// What is lost.
    pub warnings: Vec<String>,
}

impl RunSummary {
    /// Puts together what is known at the end of a run.
    pub fn new(input: &str, s: &Summary, verdict: &Verdict, next: Option<&str>, warnings: &[String]) -> Self {
        Self {
            input: input.to_string(),
            frames: s.frames,
            duration_s: s.duration_s,
            detections: s.detections,
            confirmed_tracks: s.confirmed_tracks,
            most_at_once: s.most_at_once,
            mean_nis: s.mean_nis.filter(|(mean, _)| mean.is_finite()),
            verdict: verdict.sentence.clone(),
            is_doubtful: verdict.is_doubtful,
            next: next.map(str::to_string),
            warnings: warnings.to_vec(),
        }
    }

    /// Writes it; the file appears whole.
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, path: &Path) -> boresight::Result<()> {
        let text = serde_json::to_string_pretty(self)
            .map_err(|e| Error::new(ErrorKind::Output, "cannot be written").at(path.display()).because(e))?;
        boresight::io::write_whole(path, format!("{text}\n").as_bytes())
    }

    /// Reads it back; `None` where there is none that can be read.
    pub fn read(path: &Path) -> Option<Self> {
        serde_json::from_str(&std::fs::read_to_string(path).ok()?).ok()
    }
}
