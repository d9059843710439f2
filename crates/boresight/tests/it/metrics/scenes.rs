//! The random scenes of `scripts/metrics_reference.py`, drawn again number by number.

use super::lcg::Lcg;
use boresight::{PixelOrigin, TrackRow, TrackTable};

/// A scene's truth and result.
pub fn scene(seed: u64) -> (TrackTable, TrackTable) {
    let mut r = Lcg::new(seed);
    let kind = seed % 4;
    let frames = if seed % 25 == 7 { 1 } else { 1 + r.next(12) };
    let n = (if kind == 3 { 8 + r.next(6) } else { r.next(7) }) as usize;
    let step = if kind == 0 { 10 } else { 1 };
    let span = if kind == 0 { 12 } else { 100 };
    let scale = |v: i64| if kind == 2 { v as f64 / 7.0 } else { v as f64 };
    let x0: Vec<_> = (0..n).map(|_| (r.next(span) * step, r.next(span) * step)).collect();
    let v: Vec<_> = (0..n).map(|_| ((r.next(3) - 1) * step, (r.next(3) - 1) * step)).collect();
    let size: Vec<_> = (0..n).map(|_| if kind == 0 { (20, 40) } else { (20 + r.next(20), 30 + r.next(20)) }).collect();
    let mut owner: Vec<i64> = (0..n as i64).collect();
    let mut fresh = 300;
    let (mut truth, mut result) = (Vec::new(), Vec::new());
    let half = if kind == 0 { 2 } else { 1 };
    for f in 0..frames {
        let row = |id: i64, x: i64, y: i64, (w, h): (i64, i64)| TrackRow {
            frame: f as u32,
            id,
            bbox: [scale(x), scale(y), scale(w), scale(h)],
            ..TrackRow::default()
        };
        if n > 1 && r.next(6) == 0 {
            let (a, b) = (r.next(n as u64), r.next(n as u64));
            owner.swap(a as usize, b as usize);
        }
        if n > 0 && r.next(8) == 0 {
            let g = r.next(n as u64);
            owner[g as usize] = fresh;
            fresh += 1;
        }
        let silent = r.next(9) == 0;
        for g in 0..n {
            if r.next(10) == 0 {
                continue;
            }
            let (x, y) = (x0[g].0 + v[g].0 * f, x0[g].1 + v[g].1 * f);
            truth.push(row(g as i64 + 1, x, y, size[g]));
            let hit = r.next(10);
            let dx = ((r.next(5) - 2) * step).div_euclid(half);
            let dy = ((r.next(5) - 2) * step).div_euclid(half);
            if silent || hit < 2 {
                continue;
            }
            result.push(row(owner[g], x + dx, y + dy, size[g]));
            if r.next(8) == 0 {
                result.push(row(100 + g as i64, x, y, size[g]));
            }
        }
        if !silent && r.next(3) == 0 {
            let id = 200 + r.next(4);
            let (x, y) = (r.next(span) * step, r.next(span) * step);
            result.push(row(id, x, y, (20, 40)));
        }
    }
    if seed.is_multiple_of(37) {
        result.clear();
    }
    if seed.is_multiple_of(41) {
        truth.clear();
    }
    let table = |name: &str, rows: Vec<TrackRow>| {
        let mut t = TrackTable::from_rows(name, PixelOrigin::Centre0, rows).unwrap();
        t.extend_to(frames as usize);
        t
    };
    (table("truth", truth), table("result", result))
}

/// A reference table: the names of its columns and, by seed, its values (NaN where empty).
pub fn reference(name: &str) -> (Vec<String>, Vec<Vec<f64>>) {
    let path = format!("{}/tests/data/metrics_{name}.csv", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path}: {e}"));
    let mut lines = text.lines();
    let names = lines.next().unwrap().split(',').skip(1).map(str::to_string).collect();
    let value = |v: &str| if v.is_empty() { f64::NAN } else { v.parse().unwrap() };
    (names, lines.map(|l| l.split(',').skip(1).map(value).collect()).collect())
}

/// Compares the named values of every scene with the reference, to 1e-9.
pub fn compare(name: &str, scores: impl Fn(&TrackTable, &TrackTable) -> Vec<(&'static str, f64)>) {
    let (names, rows) = reference(name);
    assert_eq!(rows.len(), 1000);
    let mut wrong = Vec::new();
    for (seed, row) in rows.iter().enumerate() {
        let (truth, result) = scene(seed as u64);
        let ours = scores(&truth, &result);
        assert_eq!(ours.len(), names.len(), "{name}: number of values");
        for ((key, v), (expected, r)) in ours.iter().zip(names.iter().zip(row)) {
            assert_eq!(key, expected);
            let same = v == r || (v.is_nan() && r.is_nan()) || (v - r).abs() <= 1e-9 * r.abs().max(1.0);
            if !same {
                wrong.push(format!("scene {seed} {key}: {v} instead of {r}"));
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "{} values differ from {name}:\n{}",
        wrong.len(),
        wrong[..wrong.len().min(25)].join("\n")
    );
}
