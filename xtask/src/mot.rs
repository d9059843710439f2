//! What the exam and `mot-table` share: tables of MOTChallenge detections, tracked and judged by the challenge's rules.

use anyhow::{Context, Result};
use boresight::io::mot_box_of_extent;
use boresight::io::tracks::{Format, ReadOptions, read};
use boresight::metrics::{MatchOptions, MotScores, Rules, mot_scores, preprocess};
use boresight::pipeline::{Input, run};
use boresight::track::{self, TrackerConfig};
use boresight::{PixelOrigin, Scan, Sink, TrackRow, TrackStatus, TrackTable, View};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Detections and rules of the sets of sequences.
pub const SETS: [(&str, &str, Rules); 2] =
    [("mot15_text", "det_frcnn_sort.txt", Rules::Mot15), ("mot17_text", "det_dpm.txt", Rules::Mot17)];

/// The sequences of a set that are here, in order.
pub fn sequences(set: &Path, detections: &str) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(set) else { return Vec::new() };
    let mut folders: Vec<PathBuf> =
        entries.flatten().map(|e| e.path()).filter(|p| p.join(detections).exists()).collect();
    folders.sort();
    folders
}

/// The sequence's name.
pub fn name_of(folder: &Path) -> String {
    folder.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// SORT's tracks: those published with the sequence, or `NAME.txt` of a folder that `scripts/sort_peer.py` filled.
pub fn sort_of(folder: &Path, made: Option<&Path>) -> Option<PathBuf> {
    let made = made.map(|m| m.join(format!("{}.txt", name_of(folder))));
    [Some(folder.join("result_sort.txt")), made].into_iter().flatten().find(|p| p.exists())
}

/// Reads a MOTChallenge file.
pub fn table(path: &Path) -> Result<TrackTable> {
    let read = read(path, Some(Format::Mot), ReadOptions::default(), false);
    Ok(read.with_context(|| path.display().to_string())?.table)
}

struct Collect(Arc<Mutex<Vec<TrackRow>>>);

impl Sink for Collect {
    fn put(&mut self, view: &View<'_>) -> boresight::Result<()> {
        let mut rows = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        for s in view.tracks.iter().filter(|s| s.status == TrackStatus::Confirmed) {
            let bbox = mot_box_of_extent(&s.extent);
            rows.push(TrackRow { frame: view.scan.index.0 as u32, id: s.id.0 as i64, bbox, ..TrackRow::default() });
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> boresight::Result<()> {
        Ok(())
    }
}

/// Runs the tracker over scans; rows are confirmed tracks with a detection in the frame.
pub fn tracked(config: &TrackerConfig, scans: &[Scan]) -> Result<TrackTable> {
    let rows = Arc::new(Mutex::new(Vec::new()));
    let sinks: Vec<Box<dyn Sink>> = vec![Box::new(Collect(Arc::clone(&rows)))];
    let input = Input::Scans(scans.to_vec());
    let (_, broken) =
        run(input, Some(track::build(config)?), sinks, &mut |_| ControlFlow::Continue(())).all_written()?;
    if let Some(e) = broken {
        return Err(e.into());
    }
    let rows = std::mem::take(&mut *rows.lock().unwrap_or_else(PoisonError::into_inner));
    Ok(TrackTable::from_rows("boresight", PixelOrigin::Pixel1, rows)?)
}

/// Scores a result by a set's rules.
pub fn judged(truth: &TrackTable, result: &TrackTable, rules: Rules) -> Result<MotScores> {
    let (truth, result) = preprocess(truth, result, rules)?;
    Ok(mot_scores(&truth, &result, &MatchOptions::default())?)
}
