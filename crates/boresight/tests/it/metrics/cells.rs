//! Two hundred small scenes of dividing, merging, splitting and missing cells score as in py-ctcmetrics.
//! References: `scripts/metrics_reference.py cells`.

use super::lcg::Lcg;
use super::scenes::reference;
use boresight::metrics::cells::{CellFrame, cell_scores};

const SIDE: usize = 24;
type Box = [i64; 4];

struct Cell {
    label: u32,
    begin: i64,
    end: i64,
    parent: u32,
    boxes: Vec<Box>,
}

fn cell(label: i64, begin: i64, end: i64, parent: i64, boxes: Vec<Box>) -> Cell {
    Cell { label: label as u32, begin, end, parent: parent as u32, boxes }
}

fn truth_cells(r: &mut Lcg, frames: i64) -> Vec<Cell> {
    let (mut truth, mut busy, mut label) = (Vec::new(), [false; 24], 1);
    for place in 0..16_i64 {
        if busy[place as usize] || r.next(3) == 0 {
            continue;
        }
        let (w, h) = (3 + r.next(3), 3 + r.next(3));
        let begin = r.next(frames as u64);
        let end = begin + r.next((frames - begin) as u64);
        truth.push(cell(label, begin, end, 0, vec![[6 * (place % 4), 6 * (place / 4), w, h]]));
        let parent = label;
        label += 1;
        if end + 1 < frames && place % 4 < 2 && r.next(2) == 0 {
            for k in [1, 2] {
                busy[(place + k) as usize] = true;
                let last = end + 1 + r.next((frames - end - 1) as u64);
                truth.push(cell(label, end + 1, last, parent, vec![[6 * ((place + k) % 4), 6 * (place / 4), 4, 4]]));
                label += 1;
            }
        }
    }
    truth
}

/// A scene's truth, result and number of frames.
fn scene(seed: u64) -> (Vec<Cell>, Vec<Cell>, usize) {
    let mut r = Lcg::new(seed);
    let frames = 2 + r.next(4);
    let truth = truth_cells(&mut r, frames);
    let (mut result, mut label) = (Vec::new(), 50);
    let (mut name, mut merged) = ([0_i64; 64], [false; 64]);
    for (k, t) in truth.iter().enumerate() {
        let what = r.next(8);
        let (dx, dy) = (r.next(3) - 1, r.next(3) - 1);
        let [x, y, w, h] = t.boxes[0];
        let shifted = [(x + dx).max(0), (y + dy).max(0), w, h];
        if merged[t.label as usize] || what == 0 {
            continue;
        }
        if what == 1 && t.end > t.begin {
            let middle = t.begin + r.next((t.end - t.begin) as u64);
            result.push(cell(label, t.begin, middle, name[t.parent as usize], vec![shifted]));
            let parent = if r.next(2) == 0 { label } else { 0 };
            result.push(cell(label + 1, middle + 1, t.end, parent, vec![shifted]));
            name[t.label as usize] = label + 1;
            label += 2;
            continue;
        }
        let mut own = vec![shifted];
        if let (2, Some(next)) = (what, truth.get(k + 1).filter(|n| (n.begin, n.end) == (t.begin, t.end))) {
            own.push(next.boxes[0]);
            merged[next.label as usize] = true;
        }
        let parent = if r.next(4) > 0 { name[t.parent as usize] } else { 0 };
        result.push(cell(label, t.begin, t.end, parent, own));
        name[t.label as usize] = label;
        label += 1;
    }
    if r.next(2) == 0 {
        result.push(cell(label, 0, 0, 0, vec![[21, 21, 2, 2]]));
    }
    (truth, result, frames as usize)
}

fn image(cells: &[Cell], frame: i64) -> Vec<u16> {
    let mut out = vec![0; SIDE * SIDE];
    for c in cells.iter().filter(|c| (c.begin..=c.end).contains(&frame)) {
        for [x, y, w, h] in &c.boxes {
            for row in *y..(y + h).min(SIDE as i64) {
                for column in *x..(x + w).min(SIDE as i64) {
                    out[row as usize * SIDE + column as usize] = c.label as u16;
                }
            }
        }
    }
    out
}

#[test]
fn cells_score_as_in_py_ctcmetrics() {
    let path = format!("{}/tests/data/metrics_cells.csv", env!("CARGO_MANIFEST_DIR"));
    let seeds = std::fs::read_to_string(path).unwrap();
    let seeds = seeds.lines().skip(1).map(|l| l.split(',').next().unwrap().parse::<u64>().unwrap());
    let (_, rows) = reference("cells");
    assert!(rows.len() > 150);
    for (seed, row) in seeds.zip(rows) {
        let (truth, result, frames) = scene(seed);
        let frames: Vec<CellFrame> =
            (0..frames as i64).map(|f| CellFrame::of(&image(&truth, f), &image(&result, f)).unwrap()).collect();
        let parents = |c: &[Cell]| c.iter().filter(|c| c.parent != 0).map(|c| (c.label, c.parent)).collect::<Vec<_>>();
        let s = cell_scores(&frames, &parents(&truth), &parents(&result)).unwrap();
        for (name, ours, theirs) in [("DET", s.det(), row[0]), ("TRA", s.tra(), row[1])] {
            assert!((ours - theirs).abs() < 1e-9, "scene {seed}: {name} {ours} instead of {theirs}: {s:?}");
        }
    }
}
