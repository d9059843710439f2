//! Worker for the comparison with peers, workload W6: metrics of long sequences.
//!
//! `peer_w6` scores by CLEAR, identity and HOTA; `peer_w6 gospa` and `peer_w6 ospa` give the mean set distance (c = 10,
//! p = 2) of all frames. The work starts with the boxes by frame, as for every peer there.

use boresight::metrics::hota::mean;
use boresight::metrics::set::{SetDistance, SetOptions};
use boresight::metrics::{MatchOptions, mot_scores};
use boresight::{PixelOrigin, TrackRow, TrackTable};
use peers::{Fault, Job};

enum What {
    MotScores,
    Gospa,
    Ospa,
}

struct W6 {
    truth: TrackTable,
    result: TrackTable,
    what: What,
    row: Vec<f64>,
}

impl W6 {
    fn set_distance(&self, gospa: bool) -> Vec<f64> {
        let (mut d, o) = (SetDistance::default(), SetOptions::default());
        let (mut a, mut b, mut sum) = (Vec::new(), Vec::new(), 0.0);
        let centres = |t: &TrackTable, frame: usize, out: &mut Vec<[f64; 2]>| {
            out.clear();
            out.extend(t.boxes[t.rows(frame)].iter().map(|b| [b[0] + b[2] / 2.0, b[1] + b[3] / 2.0]));
        };
        let n = self.truth.n_frames().max(self.result.n_frames());
        for frame in 0..n {
            centres(&self.truth, frame, &mut a);
            centres(&self.result, frame, &mut b);
            sum += if gospa { d.gospa(&a, &b, &o).distance } else { d.ospa(&a, &b, &o) };
        }
        vec![sum / n.max(1) as f64, n as f64]
    }
}

impl Job for W6 {
    fn run(&mut self) {
        self.row = match self.what {
            What::Gospa => self.set_distance(true),
            What::Ospa => self.set_distance(false),
            What::MotScores => match mot_scores(&self.truth, &self.result, &MatchOptions::default()) {
                Ok(s) => vec![s.clear.mota(), s.identity.idf1(), mean(&s.hota.hota()), s.clear.idsw as f64],
                Err(_) => vec![f64::NAN; 4],
            },
        };
    }

    fn result(&mut self) -> (Vec<f64>, usize) {
        (self.row.clone(), self.row.len())
    }

    fn units(&self) -> f64 {
        self.truth.n_frames() as f64
    }
}

fn table(path: &str) -> Result<TrackTable, Fault> {
    let (v, shape) = peers::read_npy(&std::fs::read(path)?)?;
    if shape.len() != 2 || shape[1] != 6 {
        return Err(format!("{path}: expected 6 columns").into());
    }
    let rows = v.chunks_exact(6).map(|r| TrackRow {
        frame: r[0] as u32,
        id: r[1] as i64,
        bbox: [r[2], r[3], r[4] - r[2], r[5] - r[3]],
        ..TrackRow::default()
    });
    Ok(TrackTable::from_rows(path, PixelOrigin::Centre0, rows)?)
}

fn main() -> Result<(), Fault> {
    let word = std::env::args().nth(1).unwrap_or_default();
    peers::serve(|message| {
        let input = |key: &str| message["inputs"][key].as_str().ok_or(format!("no {key}"));
        let what = match word.as_str() {
            "gospa" => What::Gospa,
            "ospa" => What::Ospa,
            _ => What::MotScores,
        };
        Ok(Box::new(W6 { truth: table(input("gt")?)?, result: table(input("tr")?)?, what, row: Vec::new() }))
    })
}
