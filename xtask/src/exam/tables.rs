//! Tables of detections, tracked without options, beside SORT's published tracks of the same detections.

use anyhow::{Context, Result};
use boresight::io::tracks::{Format, ReadOptions, read};
use boresight::io::{TableOptions, mot_box_of_extent, read_detections};
use boresight::metrics::{MatchOptions, MotScores, Rules, hota, mot_scores, preprocess};
use boresight::{Config, PixelOrigin, TrackRow, TrackStatus, TrackTable, auto, track};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

const SETS: [(&str, &str, Rules); 2] =
    [("mot15_text", "det_frcnn_sort.txt", Rules::Mot15), ("mot17_text", "det_dpm.txt", Rules::Mot17)];

fn tracked(detections: &Path) -> Result<TrackTable> {
    let table = read_detections(detections, &TableOptions::default())?;
    let mut config = Config::default();
    auto::for_detections(&table.scans, table.rate_hz, &mut config, &mut Vec::new());
    let mut tracker = track::build(&config.tracker)?;
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

fn figures(s: &MotScores) -> [f64; 3] {
    [hota::mean(&s.hota.hota()), s.identity.idf1(), s.clear.mota()].map(|v| 100.0 * v)
}

/// The table as Markdown.
pub fn run(data: &Path, only: &str) -> Result<String> {
    let mut out = String::from(
        "## Tables of detections\n\n`boresight track det.txt` without options; SORT's published tracks of the same detections beside it.\n\n\
         | sequence | HOTA | IDF1 | MOTA | IDSW | SORT: HOTA | IDF1 | MOTA |\n| --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    let (mut n_above, mut n_compared) = (0, 0);
    for (set, detections, rules) in SETS {
        let Ok(entries) = std::fs::read_dir(data.join(set)) else { continue };
        let mut folders: Vec<PathBuf> = entries.flatten().map(|e| e.path()).collect();
        folders.retain(|p| p.join(detections).exists() && p.display().to_string().contains(only));
        folders.sort();
        for folder in folders {
            let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let table = |path: PathBuf| -> Result<TrackTable> {
                let read = read(&path, Some(Format::Mot), ReadOptions::default(), false);
                Ok(read.with_context(|| path.display().to_string())?.table)
            };
            let truth = table(folder.join("gt.txt"))?;
            let ours = judged(&truth, &tracked(&folder.join(detections))?, rules)?;
            let [hota, idf1, mota] = figures(&ours);
            write!(out, "| {name} | {hota:.1} | {idf1:.1} | {mota:.1} | {} ", ours.clear.idsw)?;
            let peer = folder.join("result_sort.txt");
            if peer.exists() {
                let theirs = figures(&judged(&truth, &table(peer)?, rules)?);
                n_compared += 1;
                n_above += usize::from(figures(&ours).iter().zip(&theirs).all(|(a, b)| a > b));
                writeln!(out, "| {:.1} | {:.1} | {:.1} |", theirs[0], theirs[1], theirs[2])?;
            } else {
                writeln!(out, "| - | - | - |")?;
            }
        }
    }
    writeln!(out, "\nAbove SORT in all three on {n_above} of {n_compared} sequences.")?;
    Ok(out)
}
