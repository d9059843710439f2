//! Tables of detections, tracked without options, beside SORT's tracks of the same detections.

use super::clips::is_wanted;
use crate::mot::{SETS, judged, name_of, sequences, sort_of, table, tracked};
use anyhow::Result;
use boresight::io::{TableOptions, read_detections};
use boresight::metrics::{MotScores, hota};
use boresight::{Config, auto};
use std::fmt::Write as _;
use std::path::Path;

fn figures(s: &MotScores) -> [f64; 3] {
    [hota::mean(&s.hota.hota()), s.identity.idf1(), s.clear.mota()].map(|v| 100.0 * v)
}

/// The table as Markdown, on how many sequences all three figures are above SORT's, and of how many; `sort` is a folder with SORT's tracks where none are published.
pub fn run(data: &Path, only: &[String], sort: Option<&Path>) -> Result<(String, usize, usize)> {
    let mut out = String::from(
        "## Tables of detections\n\n`boresight track det.txt` without options; SORT's tracks of the same detections beside it (MOT15: those \
         published, MOT17: made by `scripts/sort_peer.py`).\n\n\
         | sequence | HOTA | IDF1 | MOTA | IDSW | SORT: HOTA | IDF1 | MOTA |\n| --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    let (mut above, mut n_all, mut n_compared) = ([0; 3], 0, 0);
    for (set, detections, rules) in SETS {
        for folder in sequences(&data.join(set), detections) {
            if !is_wanted(only, &folder.display().to_string()) {
                continue;
            }
            let read = read_detections(folder.join(detections), &TableOptions::default())?;
            let mut config = Config::default();
            auto::for_detections(&read.scans, read.rate_hz, read.unit, None, &mut config, &mut Vec::new());
            auto::report_whole(read.rate_hz, &mut config, &mut Vec::new());
            let truth = table(&folder.join("gt.txt"))?;
            let scores = judged(&truth, &tracked(&config.tracker, &read.scans)?, rules)?;
            let ours = figures(&scores);
            let [hota, idf1, mota] = ours;
            write!(out, "| {} | {hota:.1} | {idf1:.1} | {mota:.1} | {} ", name_of(&folder), scores.clear.idsw)?;
            let Some(peer) = sort_of(&folder, sort) else {
                writeln!(out, "| - | - | - |")?;
                continue;
            };
            let theirs = figures(&judged(&truth, &table(&peer)?, rules)?);
            let better = [0, 1, 2].map(|i| ours[i] > theirs[i]);
            above.iter_mut().zip(better).for_each(|(n, b)| *n += usize::from(b));
            n_all += usize::from(better == [true; 3]);
            n_compared += 1;
            writeln!(out, "| {:.1} | {:.1} | {:.1} |", theirs[0], theirs[1], theirs[2])?;
        }
    }
    let [hota, idf1, mota] = above;
    writeln!(
        out,
        "\nAbove SORT in HOTA on {hota}, in IDF1 on {idf1}, in MOTA on {mota}, in all three on {n_all} of {n_compared} sequences."
    )?;
    Ok((out, n_all, n_compared))
}
