//! Tracks from MOTChallenge detections against SORT's: HOTA, IDF1, MOTA of every sequence, one configuration for all
//! but the detectors' score thresholds.
//!
//! Data: 2D MOT 2015 with SORT's Faster R-CNN detections (SORT's own result beside them) and MOT17 with DPM detections.
//! Scores are those of `boresight::metrics`, which equal TrackEval's; `--out DIR` writes MOT files for TrackEval itself.

use crate::mot::{SETS, judged, name_of, sequences, sort_of, table, tracked};
use anyhow::{Context, Result};
use boresight::io::read_detections;
use boresight::metrics::{MotScores, hota};
use boresight::track::TwoStageConfig;
use boresight::{Config, TrackTable};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub struct Args {
    /// Folder with `mot15_text` and `mot17_text`.
    #[arg(long, env = "BORESIGHT_TEST_DATA", default_value = "../shared/data")]
    data: PathBuf,
    /// Configuration (TOML) instead of `configs/detections-mot.toml`.
    #[arg(long)]
    config: Option<PathBuf>,
    /// Folder with SORT's results on MOT17 (`MOT17-02.txt` …), made by `scripts/sort_peer.py`.
    #[arg(long)]
    sort: Option<PathBuf>,
    /// Write the tracks as MOTChallenge text into this folder.
    #[arg(long)]
    out: Option<PathBuf>,
}

/// The one configuration for all sequences.
const PEOPLE: &str = include_str!("../../configs/detections-mot.toml");

pub fn run(args: &Args) -> Result<()> {
    let config = match &args.config {
        Some(path) => Config::from_file(path)?,
        None => Config::from_toml(PEOPLE, "configs/detections-mot.toml")?,
    };
    // Score thresholds are in each detector's own scale; all else is the same.
    let frcnn = TwoStageConfig { high_score: 0.9, low_score: 0.0 };
    let dpm = TwoStageConfig { high_score: 0.3, low_score: -0.5 };
    for ((set, detections, rules), two_stage) in SETS.into_iter().zip([frcnn, dpm]) {
        let mut config = config.clone();
        if args.config.is_none() {
            config.tracker.two_stage = Some(two_stage);
        }
        println!("\n{set}, {detections}            HOTA   IDF1   MOTA   IDSW    FP     FN");
        let (mut ours, mut peers) = (Vec::new(), Vec::new());
        for folder in &sequences(&args.data.join(set), detections) {
            let name = name_of(folder);
            let truth = table(&folder.join("gt.txt"))?;
            let scans = read_detections(folder.join(detections), &config.input.table)?.scans;
            let result = tracked(&config.tracker, &scans).with_context(|| name.clone())?;
            if let Some(out) = &args.out {
                write(&out.join(format!("{name}.txt")), &result)?;
            }
            ours.push(judged(&truth, &result, rules)?);
            print_row(&format!("{name:16} boresight"), &ours[ours.len() - 1]);
            if let Some(peer) = sort_of(folder, args.sort.as_deref()) {
                peers.push(judged(&truth, &table(&peer)?, rules)?);
                print_row(&format!("{:16} SORT", ""), &peers[peers.len() - 1]);
            }
        }
        print_row(&format!("{:16} boresight", "all"), &MotScores::combined(&ours));
        if !peers.is_empty() {
            print_row(&format!("{:16} SORT", ""), &MotScores::combined(&peers));
        }
    }
    Ok(())
}

fn print_row(name: &str, s: &MotScores) {
    println!(
        "{name:32} {:6.2} {:6.2} {:6.2} {:6} {:6} {:6}",
        100.0 * hota::mean(&s.hota.hota()),
        100.0 * s.identity.idf1(),
        100.0 * s.clear.mota(),
        s.clear.idsw,
        s.clear.fp,
        s.clear.fn_
    );
}

fn write(path: &Path, table: &TrackTable) -> Result<()> {
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    let mut text = String::new();
    for frame in 0..table.n_frames() {
        for row in table.rows(frame) {
            let [l, t, w, h] = table.boxes[row];
            let id = table.ids[table.tracks[row] as usize];
            writeln!(text, "{},{id},{l:.2},{t:.2},{w:.2},{h:.2},1,-1,-1,-1", frame + 1)?;
        }
    }
    Ok(std::fs::write(path, text)?)
}
