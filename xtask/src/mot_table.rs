//! Tracks from MOTChallenge detections against SORT's: HOTA, IDF1, MOTA of every sequence, one configuration for all
//! but the detectors' score thresholds.
//!
//! Data: 2D MOT 2015 with SORT's Faster R-CNN detections (SORT's own result beside them) and MOT17 with DPM detections.
//! Scores are those of `boresight::metrics`, which equal TrackEval's; `--out DIR` writes MOT files for TrackEval itself.

use anyhow::{Context, Result};
use boresight::io::tracks::{Format, ReadOptions, read};
use boresight::io::{mot_box_of_extent, read_detections};
use boresight::metrics::{MatchOptions, MotScores, Rules, hota, mot_scores, preprocess};
use boresight::track::{self, TwoStageConfig};
use boresight::{Config, PixelOrigin, TrackRow, TrackStatus, TrackTable};
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
    let sets = [
        ("mot15_text", "det_frcnn_sort.txt", Some("result_sort.txt"), Rules::Mot15, frcnn),
        ("mot17_text", "det_dpm.txt", None, Rules::Mot17, dpm),
    ];
    for (set, detections, peer, rules, two_stage) in sets {
        let mut config = config.clone();
        if args.config.is_none() {
            config.tracker.two_stage = Some(two_stage);
        }
        println!("\n{set}, {detections}            HOTA   IDF1   MOTA   IDSW    FP     FN");
        let mut folders: Vec<PathBuf> = std::fs::read_dir(args.data.join(set))?
            .flatten()
            .map(|e| e.path())
            .filter(|p| p.join(detections).exists())
            .collect();
        folders.sort();
        let (mut ours, mut peers) = (Vec::new(), Vec::new());
        for folder in &folders {
            let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let truth = read(&folder.join("gt.txt"), Some(Format::Mot), ReadOptions::default(), false)?.table;
            let result = tracked(&config, &folder.join(detections)).with_context(|| name.clone())?;
            if let Some(out) = &args.out {
                write(&out.join(format!("{name}.txt")), &result)?;
            }
            ours.push(judged(&truth, &result, rules)?);
            print_row(&format!("{name:16} boresight"), &ours[ours.len() - 1]);
            let beside = peer.map(|p| folder.join(p)).or_else(|| Some(args.sort.as_ref()?.join(format!("{name}.txt"))));
            if let Some(peer) = beside {
                let result = read(&peer, Some(Format::Mot), ReadOptions::default(), false);
                let result = result.with_context(|| peer.display().to_string())?.table;
                peers.push(judged(&truth, &result, rules)?);
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

/// Runs the tracker over a detection file; rows are confirmed tracks with a detection in the frame.
fn tracked(config: &Config, detections: &Path) -> Result<TrackTable> {
    let mut tracker = track::build(&config.tracker)?;
    let table = read_detections(detections, &config.input.table)?;
    let mut rows = Vec::new();
    for scan in &table.scans {
        for s in tracker.step(scan)?.iter().filter(|s| s.status == TrackStatus::Confirmed) {
            let bbox = mot_box_of_extent(&s.extent);
            rows.push(TrackRow { frame: scan.index.0 as u32, id: s.id.0 as i64, bbox, ..TrackRow::default() });
        }
    }
    Ok(TrackTable::from_rows("boresight", PixelOrigin::Pixel1, rows)?)
}

fn judged(truth: &TrackTable, result: &TrackTable, rules: Rules) -> Result<MotScores> {
    let (truth, result) = preprocess(truth, result, rules)?;
    Ok(mot_scores(&truth, &result, &MatchOptions::default())?)
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
