//! Detections that come late or out of order, as lines: taken at their own time where they are late by no more than is stated, else counted; a record of them replays.

mod common;

use boresight::Config;
use boresight::config::InputConfig;
use boresight_live::{Address, Board, LiveOutput, Record, RecordOptions, RunOptions, run};
use common::board;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;

const RATE_HZ: f64 = 20.0;
const N_SCANS: usize = 200;

/// Three targets on circles, a line a scan, in the order of time.
fn lines() -> Vec<String> {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let line = |k: usize| {
        let t = k as f64 / RATE_HZ;
        let rows: Vec<String> = [0.0, 1.0, 2.0]
            .map(|i| {
                let turn = 0.3 * t + i;
                let mut error = || 0.5 * rng.sample::<f64, _>(StandardNormal);
                let [x, y] = [300.0 * (1.0 + i) + 60.0 * turn.cos() + error(), 400.0 + 60.0 * turn.sin() + error()];
                format!("{{\"x_px\":{x},\"y_px\":{y},\"cov_px2\":[0.25,0,0.25]}}")
            })
            .to_vec();
        format!("{{\"time_s\":{t},\"detections\":[{}]}}\n", rows.join(","))
    };
    (0..N_SCANS).map(line).collect()
}

/// The order in which they arrive where each takes up to 0.4 s on its way; the last comes last.
fn order() -> Vec<usize> {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut all: Vec<(f64, usize)> =
        (0..N_SCANS - 1).map(|k| (k as f64 / RATE_HZ + 0.4 * rng.random::<f64>(), k)).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all.into_iter().map(|(_, k)| k).chain([N_SCANS - 1]).collect()
}

fn run_lines(path: &Path, dir: &Path, options: &RunOptions) -> Arc<Board> {
    let board = board();
    let record = Record::create(dir, RecordOptions::default()).unwrap();
    let mut outputs: Vec<Box<dyn LiveOutput>> = vec![Box::new(record)];
    let source = Address::new(&path.display().to_string(), options.base.input.clone(), false, false);
    run(Box::new(source), options, &board, &mut outputs, &|| false).unwrap();
    board
}

fn given(late_s: f64) -> RunOptions {
    let input = InputConfig { late_s, ..InputConfig::default() };
    let config = Config { input, ..Config::default() };
    RunOptions { base: config.clone(), config: Some(config), ..RunOptions::default() }
}

/// Lines of the table at its last time, without the number of the frame and of the track.
fn last_states(dir: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(dir.join("000001.tracks.csv")).unwrap();
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    let time = head.iter().position(|h| *h == "time_s").unwrap();
    let rows: Vec<Vec<&str>> = lines.map(|l| l.split(',').collect()).collect();
    let last = rows.last().unwrap()[time];
    let of_it = rows.iter().filter(|r| r[time] == last);
    let named = |r: &Vec<&str>| {
        let kept = head.iter().zip(r).filter(|(h, _)| !matches!(**h, "frame" | "track_id"));
        kept.map(|(_, v)| *v).collect::<Vec<_>>().join(",")
    };
    let mut all: Vec<String> = of_it.map(named).collect();
    all.sort();
    all
}

#[test]
fn late_lines_give_the_states_of_the_same_lines_in_order_and_their_record_replays() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let (lines, order) = (lines(), order());
    std::fs::write(at("sorted.jsonl"), lines.concat()).unwrap();
    let arrived: String = order.iter().map(|k| lines[*k].as_str()).collect();
    std::fs::write(at("arrived.jsonl"), arrived).unwrap();
    let options = given(0.5);

    let sorted = run_lines(&at("sorted.jsonl"), &at("a"), &options);
    assert_eq!(sorted.counts.late.load(Ordering::Relaxed), 0);
    let late = run_lines(&at("arrived.jsonl"), &at("b"), &options);
    let n_late = {
        let mut newest = 0;
        let is_late = |k: &&usize| {
            let before = newest;
            newest = before.max(**k);
            before > **k
        };
        order.iter().filter(is_late).count()
    };
    assert!(n_late > 50, "{n_late}");
    let count = |c: &std::sync::atomic::AtomicU64| c.load(Ordering::Relaxed);
    assert_eq!(count(&late.counts.late), n_late as u64);
    assert_eq!([count(&late.counts.too_late), count(&late.counts.refused)], [0, 0]);
    assert_eq!(last_states(&at("a")).len(), 3);
    assert_eq!(last_states(&at("a")), last_states(&at("b")));

    // As they came, they stand in the lines, and give the same tables.
    let again = run_lines(&at("b").join("000001.jsonl"), &at("c"), &options);
    assert_eq!(count(&again.counts.late), n_late as u64);
    for ending in ["tracks.csv", "detections.csv"] {
        let of = |dir: &str| std::fs::read(at(dir).join(format!("000001.{ending}"))).unwrap();
        assert_eq!(of("b"), of("c"), "{ending}");
    }

    // The first seconds are chosen by in the order of time.
    let chosen = run_lines(&at("arrived.jsonl"), &at("d"), &RunOptions::default());
    assert_eq!(count(&chosen.counts.too_late), 0);
    assert_eq!(last_states(&at("d")).len(), 3);
}

#[test]
fn what_is_later_than_stated_is_counted_and_the_run_goes_on() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let mut lines = lines();
    // 5 s late and 0.1 s late.
    lines.insert(150, lines[50].clone());
    lines.insert(160, lines[158].replace("\"x_px\":", "\"x_px\":9"));
    std::fs::write(at("lines.jsonl"), lines.concat()).unwrap();
    let board = run_lines(&at("lines.jsonl"), &at("a"), &given(1.0));
    let counts = [&board.counts.late, &board.counts.too_late, &board.counts.refused, &board.counts.arrived];
    assert_eq!(counts.map(|c| c.load(Ordering::Relaxed)), [1, 1, 0, 202]);
    assert_eq!(last_states(&at("a")).len(), 3);
}
