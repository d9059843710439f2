//! `cargo xtask ir-exam`: `boresight track` with no options on the public infrared clips, scored against their truth.
//!
//! Held: share of truth frames with a confirmed (or coasting) track inside a truth box grown by 3 px. False: confirmed tracks that
//! lie in a grown truth box in fewer than half of their frames. Error: distance of the held track from the box's centre.
//! Truth boxes count pixels and frames from 1 (the data's SOURCE.md); single-target clips are those with one box in every frame.

use anyhow::{Context, Result};
use boresight::auto;
use boresight::pipeline::{Input, run};
use boresight::{Config, FrameSource, Sink, TrackStatus, View};
use std::collections::{BTreeMap, HashMap};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// Arguments of `ir-exam`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder with NAME.mp4, NAME.gt.csv and index.csv.
    #[arg(long)]
    data: Option<PathBuf>,
    /// Only clips whose name contains this.
    #[arg(long, default_value = "")]
    only: String,
    /// Changes of the configuration chosen, as with `boresight track --set`.
    #[arg(long = "set")]
    sets: Vec<String>,
    /// Print each false track: frames, first and last position, mean score.
    #[arg(long)]
    list_false: bool,
    /// Read NAME/ folders of images from here instead of the videos.
    #[arg(long)]
    frames: Option<PathBuf>,
}

type Box4 = [f64; 4];

/// A confirmed track's positions: frame, x, y.
#[derive(Default)]
struct Seen(BTreeMap<u64, Vec<(u64, f64, f64)>>);

struct Collect(Arc<Mutex<Seen>>);

impl Sink for Collect {
    fn put(&mut self, view: &View<'_>) -> boresight::Result<()> {
        let mut seen = self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        for t in view.tracks.iter().filter(|t| t.status != TrackStatus::Tentative) {
            let m = t.kinematics.mean;
            seen.0.entry(t.id.0).or_default().push((view.scan.index.0, m[0], m[2]));
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> boresight::Result<()> {
        Ok(())
    }
}

fn truth(path: &Path) -> Result<HashMap<u64, Vec<Box4>>> {
    let mut out: HashMap<u64, Vec<Box4>> = HashMap::new();
    for record in csv::Reader::from_path(path).with_context(|| path.display().to_string())?.deserialize() {
        let (frame, _id, left, top, width, height, _class): (u64, i64, f64, f64, f64, f64, String) = record?;
        out.entry(frame - 1).or_default().push([left - 1.0, top - 1.0, width, height]);
    }
    Ok(out)
}

fn inside(x: f64, y: f64, b: &Box4) -> bool {
    x >= b[0] - 3.0 && x <= b[0] + b[2] + 3.0 && y >= b[1] - 3.0 && y <= b[1] + b[3] + 3.0
}

struct Score {
    held: f64,
    false_tracks: usize,
    confirmed: usize,
    minutes: f64,
    errors: Vec<f64>,
    frames_per_s: f64,
    listing: Vec<String>,
}

fn clip(input: &str, truth: &HashMap<u64, Vec<Box4>>, sets: &[String]) -> Result<Score> {
    let base = Config::default().with("input.rate-hz=30")?;
    let started = std::time::Instant::now();
    let (replay, choice) = auto::open_and_choose(input, &base)?;
    let info = replay.info().clone();
    let mut config = choice.config;
    for set in sets {
        config = config.with(set)?;
    }
    let detector = boresight::vision::build(&config.detector, &info)?;
    let tracking = boresight::track::build(&config.tracker)?;
    let seen = Arc::new(Mutex::new(Seen::default()));
    let sinks: Vec<Box<dyn Sink>> = vec![Box::new(Collect(Arc::clone(&seen)))];
    let go_on = &mut |_: &boresight::pipeline::Summary| ControlFlow::Continue(());
    let (summary, broken) = run(Input::Frames(Box::new(replay), detector), Some(tracking), sinks, go_on)?;
    if let Some(e) = broken {
        return Err(e.into());
    }
    let elapsed = started.elapsed().as_secs_f64();
    let seen = seen.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let mut held: HashMap<(u64, usize), f64> = HashMap::new();
    let (mut false_tracks, mut listing) = (0, Vec::new());
    for (id, points) in &seen.0 {
        let mut hits = 0;
        for &(frame, x, y) in points {
            let boxes = truth.get(&frame).map_or(&[][..], Vec::as_slice);
            for (i, b) in boxes.iter().enumerate().filter(|(_, b)| inside(x, y, b)) {
                let error = (x - b[0] - 0.5 * b[2]).hypot(y - b[1] - 0.5 * b[3]);
                let best = held.entry((frame, i)).or_insert(error);
                *best = best.min(error);
            }
            hits += usize::from(boxes.iter().any(|b| inside(x, y, b)));
        }
        if 2 * hits < points.len() {
            false_tracks += 1;
            if let (Some(a), Some(b)) = (points.first(), points.last()) {
                listing.push(format!(
                    "    false track {id}: frames {}..{} ({:.0}, {:.0}) -> ({:.0}, {:.0})",
                    a.0, b.0, a.1, a.2, b.1, b.2
                ));
            }
        }
    }
    let total: usize = truth.values().map(Vec::len).sum();
    Ok(Score {
        held: held.len() as f64 / total.max(1) as f64,
        false_tracks,
        confirmed: seen.0.len(),
        minutes: summary.duration_s / 60.0,
        errors: held.into_values().collect(),
        frames_per_s: summary.frames as f64 / elapsed,
        listing,
    })
}

fn median(v: &mut [f64]) -> f64 {
    v.sort_by(f64::total_cmp);
    v.get(v.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Runs the exam and prints the table.
pub fn exam(args: &Args) -> Result<()> {
    let data = args.data.clone().unwrap_or_else(|| crate::data::test_data().join("ir_drone_svanstrom"));
    let mut index = csv::Reader::from_path(data.join("index.csv")).with_context(|| data.display().to_string())?;
    let headers = index.headers()?.clone();
    let column = |name: &str| headers.iter().position(|h| h == name).with_context(|| format!("no column {name}"));
    let (c_name, c_scr, c_targets) = (column("name")?, column("median_scr")?, column("max_targets")?);
    println!(
        "{:<20} {:>7} {:>7} {:>7} {:>6} {:>6} {:>8} {:>9}",
        "clip", "SCR", "targets", "held", "false", "tracks", "error px", "frames/s"
    );
    let (mut false_tracks, mut minutes, mut good, mut counted, mut errors) = (0, 0.0, 0, 0, Vec::new());
    let (mut held_sum, mut singles) = (0.0, 0);
    for row in index.records() {
        let row = row?;
        let (name, scr, targets) = (&row[c_name], row[c_scr].parse::<f64>()?, row[c_targets].parse::<u32>()?);
        if !name.contains(&args.only) {
            continue;
        }
        let truth = truth(&data.join(format!("{name}.gt.csv")))?;
        let input = match &args.frames {
            Some(dir) => dir.join(name),
            None => data.join(format!("{name}.mp4")),
        };
        let mut s = clip(&input.display().to_string(), &truth, &args.sets)?;
        println!(
            "{name:<20} {scr:>7.2} {targets:>7} {:>6.1}% {:>6} {:>6} {:>8.2} {:>9.0}",
            100.0 * s.held,
            s.false_tracks,
            s.confirmed,
            median(&mut s.errors),
            s.frames_per_s
        );
        if args.list_false {
            s.listing.iter().for_each(|l| println!("{l}"));
        }
        if targets == 1 {
            singles += 1;
            held_sum += s.held;
            false_tracks += s.false_tracks;
            minutes += s.minutes;
            errors.append(&mut s.errors);
            if scr > 3.0 {
                counted += 1;
                good += usize::from(s.held >= 0.9);
            }
        }
    }
    println!(
        "\nsingle-target clips: {singles}; mean share of truth frames held {:.1} %; false confirmed tracks {false_tracks} in {minutes:.2} min = {:.2} a \
         minute; median centroid error {:.2} px\nclips with SCR above 3: {good} of {counted} held in 90 % of their frames or more",
        100.0 * held_sum / f64::from(singles.max(1)),
        f64::from(u32::try_from(false_tracks)?) / minutes.max(1e-9),
        median(&mut errors)
    );
    Ok(())
}
