//! Parameters that follow a stream: a scene that grows noisier, with a configuration chosen and with one given; the same each time; a record of it replays.

mod common;

use boresight::Config;
use boresight::config::InputConfig;
use boresight_live::{Address, Board, LiveOutput, Record, RecordOptions, RunOptions, Shown, run};
use common::board;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::path::Path;
use std::sync::{Arc, Mutex};

const RATE_HZ: f64 = 10.0;
/// When the noise doubles, s, and when the stream ends.
const NOISY_FROM_S: f64 = 60.0;
const END_S: f64 = 260.0;

/// Three targets on circles, as lines; the detections deviate by 0.5 px, which is what they state, later by 1 px.
fn lines(path: &Path) {
    let mut rng = ChaCha8Rng::seed_from_u64(21);
    let mut text = String::new();
    for k in 0..(END_S * RATE_HZ) as u32 {
        let t = f64::from(k) / RATE_HZ;
        let std = if t < NOISY_FROM_S { 0.5 } else { 1.0 };
        let mut place = |i: f64| {
            let turn = 0.1 * t + i;
            let mut error = || std * rng.sample::<f64, _>(StandardNormal);
            let [x, y] = [300.0 * (1.0 + i) + 60.0 * turn.cos() + error(), 400.0 + 60.0 * turn.sin() + error()];
            let is_seen = rng.random::<f64>() < 0.95;
            is_seen.then(|| format!("{{\"x_px\":{x},\"y_px\":{y},\"cov_px2\":[0.25,0,0.25]}}"))
        };
        let rows: Vec<String> = [0.0, 1.0, 2.0].into_iter().filter_map(&mut place).collect();
        text += &format!("{{\"time_s\":{t},\"detections\":[{}]}}\n", rows.join(","));
    }
    std::fs::write(path, text).unwrap();
}

/// Normalised squared innovations with their times, s.
struct Nis(Arc<Mutex<Vec<(f64, f64)>>>);

impl LiveOutput for Nis {
    fn put(&mut self, shown: &Shown<'_>) -> boresight::Result<()> {
        let time_s = shown.when.time.as_secs_f64();
        self.0.lock().unwrap().extend(shown.tracks.iter().filter_map(|t| t.nis).map(|nis| (time_s, nis)));
        Ok(())
    }
}

/// Runs a file, records it into `dir`, and gives the mean normalised squared innovation of the last 60 s.
fn run_lines(path: &Path, dir: &Path, options: &RunOptions, board: &Arc<Board>) -> f64 {
    let all = Arc::new(Mutex::new(Vec::new()));
    let record = Record::create(dir, RecordOptions::default()).unwrap();
    let mut outputs: Vec<Box<dyn LiveOutput>> = vec![Box::new(record), Box::new(Nis(Arc::clone(&all)))];
    let source = Address::new(&path.display().to_string(), InputConfig::default(), false, false);
    run(Box::new(source), options, board, &mut outputs, &|| false).unwrap();
    let all = all.lock().unwrap();
    let late: Vec<f64> = all.iter().filter(|(t, _)| *t > END_S - 60.0).map(|(_, nis)| *nis).collect();
    assert!(late.len() > 1000, "{}", late.len());
    late.iter().sum::<f64>() / late.len() as f64
}

fn read(dir: &Path, ending: &str) -> String {
    assert!(!dir.join("000002.jsonl").exists(), "one segment");
    std::fs::read_to_string(dir.join(format!("000001.{ending}"))).unwrap()
}

#[test]
fn the_noise_that_doubles_is_followed_where_the_choice_was_automatic_and_a_record_of_it_replays() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let scans = at("scans.jsonl");
    lines(&scans);
    let (chosen, adapted) = (RunOptions::default(), board());
    let nis = run_lines(&scans, &at("a"), &chosen, &adapted);
    assert!((1.6..2.4).contains(&nis), "{nis}");
    assert!(read(&at("a"), "jsonl").matches("\"parameters\":").count() > 5);
    let config = Config::from_file(&at("a").join("000001.config.toml")).unwrap();
    let first = config.tracker.clone();
    let now = adapted.parameters().unwrap();
    let variance = |scale: f64, extra_px: f64| 0.25 * scale + extra_px * extra_px;
    let grown = variance(now.detection_covariance_scale, now.extra_noise_px)
        / variance(first.detection_covariance_scale, first.extra_noise_px);
    assert!((2.5..6.0).contains(&grown), "four times the variance: {grown}");
    assert!(adapted.configuration().0.contains(&format!("extra-noise-px = {:?}", now.extra_noise_px)));

    // Again: the same.
    run_lines(&scans, &at("b"), &chosen, &board());
    assert_eq!(read(&at("a"), "tracks.csv"), read(&at("b"), "tracks.csv"));

    // The record of it with the configuration beside it, by which it was not yet adapted: the lines say when it was.
    let given = RunOptions { config: Some(config), ..RunOptions::default() };
    run_lines(&at("a").join("000001.jsonl"), &at("c"), &given, &board());
    assert_eq!(read(&at("a"), "tracks.csv"), read(&at("c"), "tracks.csv"));

    // The stream itself with that configuration: frozen.
    let frozen = board();
    let nis = run_lines(&scans, &at("d"), &given, &frozen);
    assert!(nis > 2.6, "{nis}");
    assert!(!read(&at("d"), "jsonl").contains("\"parameters\":"));
    assert_eq!(frozen.parameters().unwrap().extra_noise_px, first.extra_noise_px);
}

#[test]
fn what_is_set_by_hand_is_left_alone() {
    let dir = tempfile::tempdir().unwrap();
    let scans = dir.path().join("scans.jsonl");
    lines(&scans);
    let sets = vec!["tracker.extra-noise-px=0.1".to_string()];
    let board = board();
    run_lines(&scans, &dir.path().join("a"), &RunOptions { sets, ..RunOptions::default() }, &board);
    let now = board.parameters().unwrap();
    assert_eq!(now.extra_noise_px, 0.1);
    let text = read(&dir.path().join("a"), "config.toml");
    let first = Config::from_toml(&text, "recorded").unwrap().tracker;
    assert_eq!(now.detection_covariance_scale, first.detection_covariance_scale);
}
