//! `cargo xtask vision-exam`: `boresight track` with no options on the public clips other than infrared, scored against what truth there is.
//!
//! Truth: boxes (vtest and TUD-Campus of MOTChallenge, the visible-light drone clips, one car from the air), points (cells), or a
//! peer's result (trackpy's particles, tracktor's mouse). Rows that count are confirmed or coasting tracks; a pair matches within the
//! distance named, by CLEAR's rule. Where the truth knows one target of many (the car) precision says nothing and is left out.
//! `error` is the mean distance of the matched pairs.

use anyhow::{Context, Result};
use boresight::metrics::{MatchOptions, MotScores, Rules, Similarity, mot_scores, preprocess};
use boresight::pipeline::{Input, run as run_pipeline};
use boresight::{Config, FrameSource, PixelOrigin, Sink, TrackRow, TrackStatus, TrackTable, View, auto, track, vision};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Arguments of `vision-exam`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder of the public data.
    #[arg(long)]
    data: Option<PathBuf>,
    /// Only clips whose path contains this.
    #[arg(long, default_value = "")]
    only: String,
    /// Changes of the configuration chosen, as with `boresight track --set`.
    #[arg(long = "set")]
    sets: Vec<String>,
}

/// The aim on vtest.avi: recall and precision at 30 px.
const AIM: f64 = 0.9;

/// Where a truth's columns are: frame, id, x or left, y or top, and width and height of boxes.
struct Columns {
    at: [usize; 4],
    size: Option<[usize; 2]>,
    first_frame: u32,
    first_pixel: f64,
    head: bool,
}

const MOT: Columns = Columns { at: [0, 1, 2, 3], size: Some([4, 5]), first_frame: 1, first_pixel: 1.0, head: false };
const BOXES: Columns = Columns { at: [0, 1, 2, 3], size: Some([4, 5]), first_frame: 1, first_pixel: 1.0, head: true };
const POINTS: Columns = Columns { at: [0, 1, 2, 3], size: None, first_frame: 0, first_pixel: 0.0, head: true };
// One animal: its own row's number column is empty of meaning, every row is target 0.
const MOUSE: Columns = Columns { at: [1, usize::MAX, 2, 3], size: None, first_frame: 1, first_pixel: 0.0, head: true };
// The air clips have one target and no id column that matters; their boxes begin at column 1 or 2.
const DRONE: Columns =
    Columns { at: [0, usize::MAX, 1, 2], size: Some([3, 4]), first_frame: 1, first_pixel: 1.0, head: true };
const CAR: Columns = Columns { first_pixel: 0.0, ..BOXES };

struct Clip {
    input: &'static str,
    truth: &'static str,
    columns: Columns,
    distance_px: f64,
    /// Whether the truth holds all targets.
    whole: bool,
}

const fn clip(input: &'static str, truth: &'static str, columns: Columns, distance_px: f64, whole: bool) -> Clip {
    Clip { input, truth, columns, distance_px, whole }
}

const CLIPS: [Clip; 11] = [
    clip("pets09_vtest/vtest.avi", "pets09_vtest/gt.txt", MOT, 30.0, true),
    clip("dctracking_pets_tud/TUD-Campus/img1", "dctracking_pets_tud/TUD-Campus/gt.txt", MOT, 30.0, true),
    clip("trackpy_bulk_water/frames", "trackpy_bulk_water/trackpy_link_first60.csv", POINTS, 3.0, true),
    clip("cells_ctc_gowt1/01/frames", "cells_ctc_gowt1/01/gt_points.csv", POINTS, 30.0, true),
    clip("animals_tracktor/mouse_video.mp4", "animals_tracktor/mouse_video_tracked.csv", MOUSE, 15.0, true),
    clip("uav_uavdt_S1001/frames", "uav_uavdt_S1001/gt.csv", CAR, 10.0, false),
    clip("vis_drone_svanstrom/V_AIRPLANE_003.mp4", "vis_drone_svanstrom/V_AIRPLANE_003.gt.csv", DRONE, 20.0, true),
    clip("vis_drone_svanstrom/V_BIRD_042.mp4", "vis_drone_svanstrom/V_BIRD_042.gt.csv", DRONE, 20.0, true),
    clip("vis_drone_svanstrom/V_DRONE_005.mp4", "vis_drone_svanstrom/V_DRONE_005.gt.csv", DRONE, 20.0, true),
    clip("vis_drone_svanstrom/V_DRONE_028.mp4", "vis_drone_svanstrom/V_DRONE_028.gt.csv", DRONE, 20.0, true),
    clip("vis_drone_svanstrom/V_HELICOPTER_004.mp4", "vis_drone_svanstrom/V_HELICOPTER_004.gt.csv", DRONE, 20.0, true),
];

/// Reads a truth as points in boresight's coordinates.
fn truth(path: &Path, c: &Columns) -> Result<Vec<TrackRow>> {
    let mut reader = csv::ReaderBuilder::new().has_headers(c.head).flexible(true).from_path(path)?;
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record?;
        let number = |i: usize| -> Result<f64> {
            let text = record.get(i).with_context(|| format!("{}: a row without column {i}", path.display()))?;
            text.trim().parse().with_context(|| format!("{}: {text}", path.display()))
        };
        let id = if c.at[1] == usize::MAX { 0.0 } else { number(c.at[1])? };
        let (mut x, mut y) = (number(c.at[2])? - c.first_pixel, number(c.at[3])? - c.first_pixel);
        if let Some([w, h]) = c.size {
            // A box's left is its first pixel's edge, half a pixel before that pixel's centre.
            (x, y) = (x - 0.5 + 0.5 * number(w)?, y - 0.5 + 0.5 * number(h)?);
        }
        rows.push(TrackRow {
            frame: number(c.at[0])? as u32 - c.first_frame,
            id: id as i64,
            bbox: [x, y, 0.0, 0.0],
            score: 1.0,
            ..TrackRow::default()
        });
    }
    Ok(rows)
}

/// The reported tracks as points.
struct Collect(Arc<Mutex<Vec<TrackRow>>>);

impl Sink for Collect {
    fn put(&mut self, view: &View<'_>) -> boresight::Result<()> {
        let mut rows = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        rows.extend(view.tracks.iter().filter(|t| t.status != TrackStatus::Tentative).map(|t| TrackRow {
            frame: view.scan.index.0 as u32,
            id: t.id.0 as i64,
            bbox: [t.kinematics.mean[0], t.kinematics.mean[2], 0.0, 0.0],
            score: 1.0,
            ..TrackRow::default()
        }));
        Ok(())
    }

    fn finish(self: Box<Self>) -> boresight::Result<()> {
        Ok(())
    }
}

/// Tracks a clip; returns the rows, the first sentence of the choice that says what was chosen, and frames a second.
fn tracked(input: &str, sets: &[String]) -> Result<(Vec<TrackRow>, String, f64)> {
    let started = std::time::Instant::now();
    let (source, choice) = auto::open_and_choose(input, &Config::default())?;
    let info = source.info().clone();
    let mut config = choice.config;
    for set in sets {
        config = config.with(set)?;
    }
    let detector = vision::build(&config.detector, &info)?;
    let tracking = track::build(&config.tracker)?;
    let rows = Arc::new(Mutex::new(Vec::new()));
    let sinks: Vec<Box<dyn Sink>> = vec![Box::new(Collect(Arc::clone(&rows)))];
    let go_on = &mut |_: &boresight::pipeline::Summary| ControlFlow::Continue(());
    let (summary, broken) = run_pipeline(Input::Frames(Box::new(source), detector), Some(tracking), sinks, go_on)?;
    if let Some(e) = broken {
        return Err(e.into());
    }
    let rows = std::mem::take(&mut *rows.lock().unwrap_or_else(PoisonError::into_inner));
    let per_s = summary.frames as f64 / started.elapsed().as_secs_f64();
    Ok((rows, choice.reasons.get(1).cloned().unwrap_or_default(), per_s))
}

fn scores(clip: &Clip, truth: Vec<TrackRow>, result: Vec<TrackRow>) -> Result<MotScores> {
    let last = truth.iter().map(|r| r.frame).max().unwrap_or(0);
    // Beyond the last frame of the truth nothing is known.
    let result = result.into_iter().filter(|r| r.frame <= last);
    let truth = TrackTable::from_rows("truth", PixelOrigin::Centre0, truth)?;
    let result = TrackTable::from_rows("boresight", PixelOrigin::Centre0, result)?;
    let (truth, result) = preprocess(&truth, &result, Rules::None)?;
    let similarity = Similarity::Centre { zero_distance_px: 2.0 * clip.distance_px };
    Ok(mot_scores(&truth, &result, &MatchOptions { similarity, threshold: 0.5 })?)
}

/// Runs the exam and prints the table.
pub fn run(args: &Args) -> Result<()> {
    let data = args.data.clone().unwrap_or_else(crate::data::test_data);
    println!(
        "{:<32} {:>6} {:>7} {:>9} {:>7} {:>7} {:>6} {:>9} {:>9}",
        "clip", "px", "recall", "precision", "MOTA", "IDF1", "IDSW", "error px", "frames/s"
    );
    for clip in CLIPS.iter().filter(|c| c.input.contains(&args.only)) {
        let input = data.join(clip.input);
        if !input.exists() {
            println!("{:<32} skipped: not here", clip.input);
            continue;
        }
        let (rows, reason, per_s) = tracked(&input.display().to_string(), &args.sets)?;
        let s = scores(clip, truth(&data.join(clip.truth), &clip.columns)?, rows)?;
        let c = &s.clear;
        let whole = |v: f64| if clip.whole { format!("{:.1} %", 100.0 * v) } else { "-".to_string() };
        let name: Vec<&str> = clip.input.rsplit('/').take(2).collect();
        println!(
            "{:<32} {:>6} {:>5.1} % {:>9} {:>7} {:>7} {:>6} {:>9.2} {:>9.0}\n    {reason}",
            name.into_iter().rev().collect::<Vec<_>>().join("/"),
            clip.distance_px,
            100.0 * c.recall(),
            whole(c.precision()),
            whole(c.mota()),
            whole(s.identity.idf1()),
            c.idsw,
            (1.0 - c.motp()) * 2.0 * clip.distance_px,
            per_s
        );
        if clip.input.ends_with("vtest.avi") {
            let held = if c.recall() >= AIM && c.precision() >= AIM { "held" } else { "missed" };
            println!("    aim: recall and precision of {:.0} % at 30 px: {held}", 100.0 * AIM);
        }
    }
    Ok(())
}
