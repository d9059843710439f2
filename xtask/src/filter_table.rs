//! `cargo xtask filter-table`: every filter by name over one clip, scored against its truth.
//!
//! The clip is read and detected once, as `boresight track` with no options does; then each filter tracks the same
//! detections. Held: share of truth frames with a confirmed or coasting track within 8 px of the box's centre. Error: of
//! the nearest such track, rms over held frames. NIS: mean over updates, 2 for an honest filter. Truth counts pixels and
//! frames from 1.

use anyhow::{Context, Result};
use boresight::auto::{self, Replay};
use boresight::pipeline::{Input, run};
use boresight::track::PRESETS;
use boresight::{Config, FrameSource, Scan, Sink, TrackStatus, View};
use std::collections::HashMap;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

/// Arguments of `filter-table`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The clip; NAME.gt.csv beside it is the truth.
    #[arg(long, default_value = "samples/ir_drone/IR_DRONE_046.mp4")]
    clip: PathBuf,
}

/// What one filter showed: distance of the nearest track in each frame, updates and their NIS, tracks.
#[derive(Default)]
struct Shown {
    nearest: HashMap<u64, f64>,
    nis: Vec<f64>,
    confirmed: std::collections::BTreeSet<u64>,
}

type Shared<T> = Arc<Mutex<T>>;

struct Scans(Shared<Vec<Scan>>);
impl Sink for Scans {
    fn put(&mut self, view: &View<'_>) -> boresight::Result<()> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(view.scan.clone());
        Ok(())
    }
    fn finish(self: Box<Self>) -> boresight::Result<()> {
        Ok(())
    }
}

struct Watch(Shared<Shown>, Arc<HashMap<u64, [f64; 2]>>);
impl Sink for Watch {
    fn put(&mut self, view: &View<'_>) -> boresight::Result<()> {
        let mut shown = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        for t in view.tracks {
            shown.nis.extend(t.innovation.map(|i| i.nis));
            if t.status == TrackStatus::Tentative {
                continue;
            }
            shown.confirmed.insert(t.id.0);
            if let Some([x, y]) = self.1.get(&view.scan.index.0) {
                let off = (t.kinematics.mean[0] - x).hypot(t.kinematics.mean[2] - y);
                let best = shown.nearest.entry(view.scan.index.0).or_insert(off);
                *best = best.min(off);
            }
        }
        Ok(())
    }
    fn finish(self: Box<Self>) -> boresight::Result<()> {
        Ok(())
    }
}

fn truth(args: &Args) -> Result<HashMap<u64, [f64; 2]>> {
    let path = args.clip.with_extension("gt.csv");
    let mut out = HashMap::new();
    for record in csv::Reader::from_path(&path).with_context(|| path.display().to_string())?.deserialize() {
        let (frame, _id, left, top, width, height, _class): (u64, i64, f64, f64, f64, f64, String) = record?;
        out.insert(frame - 1, [left + width / 2.0 - 1.5, top + height / 2.0 - 1.5]);
    }
    Ok(out)
}

/// Runs the chore.
pub fn table(args: &Args) -> Result<()> {
    let truth = Arc::new(truth(args)?);
    let base = Config::default();
    let mut replay = Replay::new(boresight::io::open(&args.clip, &base.input.open_options())?, 48);
    let info = replay.info().clone();
    let config = auto::choose(replay.ahead(), &info, &base)?.config;
    let detector = boresight::vision::build(&config.detector, &info)?;
    let scans: Shared<Vec<Scan>> = Shared::default();
    let go_on = &mut |_: &boresight::pipeline::Summary| ControlFlow::Continue(());
    let input = Input::Frames(Box::new(replay), detector);
    let (_, broken) = run(input, None, vec![Box::new(Scans(Arc::clone(&scans)))], go_on).all_written()?;
    broken.map_or(Ok(()), Err)?;
    println!("| filter | held | rms error, px | mean NIS | confirmed tracks | µs a frame |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for preset in PRESETS {
        let mut tracker = config.tracker.clone();
        tracker.filter = preset.filter();
        let all = scans.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let n_frames = all.len() as f64;
        let shown: Shared<Shown> = Shared::default();
        let watch = Watch(Arc::clone(&shown), Arc::clone(&truth));
        let tracking = boresight::track::build(&tracker)?;
        let (summary, broken) = run(Input::Scans(all), Some(tracking), vec![Box::new(watch)], go_on).all_written()?;
        broken.map_or(Ok(()), Err)?;
        let shown = shown.lock().unwrap_or_else(PoisonError::into_inner);
        let near: Vec<f64> = shown.nearest.values().copied().filter(|d| *d < 8.0).collect();
        let rms = (near.iter().map(|d| d * d).sum::<f64>() / near.len() as f64).sqrt();
        println!(
            "| {} | {:.1} % | {rms:.2} | {:.2} | {} | {:.0} |",
            preset.name,
            100.0 * near.len() as f64 / truth.len() as f64,
            shown.nis.iter().sum::<f64>() / shown.nis.len() as f64,
            shown.confirmed.len(),
            1e6 * summary.times.track.as_secs_f64() / n_frames
        );
    }
    Ok(())
}
