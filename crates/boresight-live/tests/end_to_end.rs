//! A simulated scene as a stream: its tracks on page, wire and record are the same, and near the truth; a record replays.

mod common;

use boresight::io::{Output, TracksCsv};
use boresight::pipeline::{self, Input};
use boresight::{Config, track};
use boresight_live::{
    Address, LiveOutput, Page, PageOptions, Record, RecordOptions, RunOptions, Shown, Target, publisher, run,
};
use common::{ScenePlug, Truth, Viewer, board, collect_udp, config, get, scene};
use serde_json::Value;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpStream, UdpSocket};
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// A track's state in numbers, as every way shows it.
fn state(t: &Value) -> Vec<f64> {
    let mut out: Vec<f64> =
        ["x_px", "y_px", "vx_px_per_s", "vy_px_per_s"].iter().map(|k| t[k].as_f64().unwrap()).collect();
    out.extend(t["cov"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()));
    out
}

fn recorded(dir: &Path, ending: &str) -> String {
    let mut files: Vec<_> = std::fs::read_dir(dir).unwrap().map(|e| e.unwrap().path()).collect();
    files.retain(|p| p.to_string_lossy().ends_with(ending));
    files.sort();
    files.iter().map(|p| std::fs::read_to_string(p).unwrap()).collect()
}

#[test]
fn page_wire_and_record_show_the_same_states_near_the_truth() {
    let (board, dir) = (board(), tempfile::tempdir().unwrap());
    let page = Page::serve(&PageOptions::at("127.0.0.1:0".parse().unwrap()), &[Arc::clone(&board)]).unwrap();
    let to = page.address();
    let wire = UdpSocket::bind("127.0.0.1:0").unwrap();
    let target = Target::parse(&format!("udp://{}", wire.local_addr().unwrap())).unwrap();
    let record = Record::create(dir.path(), RecordOptions::default()).unwrap();
    let mut outputs: Vec<Box<dyn LiveOutput>> =
        vec![Box::new(record), publisher(&target, &board).unwrap(), page.output(0).unwrap()];
    let datagrams = std::thread::spawn(move || collect_udp(&wire));
    let mut stream = TcpStream::connect(to).unwrap();
    write!(stream, "GET /api/stream HTTP/1.1\r\nHost: {to}\r\n\r\n").unwrap();
    let mut lines = BufReader::new(stream).lines();
    // The head is here, so the events are subscribed to.
    assert!(lines.by_ref().any(|l| l.unwrap().is_empty()));
    let streamed = std::thread::spawn(move || {
        let data = lines.map_while(Result::ok).filter_map(|l| l.strip_prefix("data: ").map(ToString::to_string));
        let mut all = Vec::new();
        for line in data {
            let over = line.contains("\"state\":\"ended\"");
            all.push(line);
            if over {
                break;
            }
        }
        all
    });
    let mut viewer = Viewer::enter(to, &format!("Origin: http://{to}\r\n")).ok().unwrap();
    let viewed = std::thread::spawn(move || {
        let mut all = Vec::new();
        while let Some((snapshot, jpeg)) = viewer.next() {
            viewer.send(b"next");
            let over = snapshot["state"] == "ended";
            all.push((snapshot, jpeg));
            if over {
                break;
            }
        }
        all
    });
    let done = Arc::new(AtomicBool::new(false));
    let stop_asking = Arc::clone(&done);
    let asked = std::thread::spawn(move || {
        let mut all: Vec<Value> = Vec::new();
        while !stop_asking.load(Ordering::SeqCst) {
            let (code, _, body) = get(to, "/api/tracks");
            assert_eq!(code, 200);
            all.push(serde_json::from_str(&body).unwrap());
            std::thread::sleep(std::time::Duration::from_millis(30));
        }
        all
    });

    let plug = ScenePlug { newest: true, ..ScenePlug::of(scene(150, 50.0), true) };
    let truth = Truth::clone(&plug.truth);
    let options = RunOptions { config: Some(config()), updates_hz: f64::INFINITY, ..RunOptions::default() };
    run(Box::new(plug), &options, &board, &mut outputs, &|| false).unwrap();
    done.store(true, Ordering::SeqCst);

    let wire = datagrams.join().unwrap();
    let mut states: BTreeMap<(u64, u64), Vec<f64>> = BTreeMap::new();
    for (_, e) in wire.iter().filter(|(_, e)| e["event"] == "start" || e["event"] == "update") {
        states.insert((e["frame"].as_u64().unwrap(), e["track"].as_u64().unwrap()), state(e));
    }
    assert!(states.len() > 100, "{}", states.len());

    // The stream of events is the datagrams' text.
    let texts: Vec<&String> = wire.iter().map(|(text, _)| text).collect();
    assert_eq!(streamed.join().unwrap().iter().collect::<Vec<_>>(), texts);

    // What the page and the interface show.
    let mut n_same = 0;
    let viewed = viewed.join().unwrap();
    assert!(viewed.iter().any(|(_, jpeg)| jpeg.starts_with(&[0xff, 0xd8])), "a picture came");
    for snapshot in viewed.iter().map(|(s, _)| s).chain(&asked.join().unwrap()) {
        for t in snapshot["tracks"].as_array().unwrap() {
            let key = (snapshot["frame"].as_u64().unwrap(), t["track"].as_u64().unwrap());
            assert_eq!(states.get(&key), Some(&state(t)), "{key:?}");
            n_same += 1;
        }
    }
    assert!(n_same > 20, "{n_same}");

    // What is recorded.
    let text = recorded(dir.path(), ".jsonl");
    let mut n_recorded = 0;
    for line in text.lines() {
        let line: Value = serde_json::from_str(line).unwrap();
        for t in line["tracks"].as_array().unwrap().iter().filter(|t| t["status"] != "tentative") {
            let key = (line["frame"].as_u64().unwrap(), t["track_id"].as_u64().unwrap());
            assert_eq!(states.get(&key), Some(&state(t)), "{key:?}");
            n_recorded += 1;
        }
    }
    assert_eq!(n_recorded, states.len(), "no state is missing");
    assert!(dir.path().join("manifest.json").exists());

    // And the truth: once the filters have settled, within 4 of their standard deviations, or a pixel.
    let truth = truth.lock().unwrap();
    let mut n_near = 0;
    for (_, e) in wire.iter().filter(|(_, e)| e["event"] == "update" && e["time_s"].as_f64().unwrap() > 1.0) {
        let time_ns = (e["time_s"].as_f64().unwrap() * 1e9).round() as i64;
        let (x, y) = (e["x_px"].as_f64().unwrap(), e["y_px"].as_f64().unwrap());
        let near = truth[&time_ns].iter().map(|p| (p[0] - x).hypot(p[1] - y)).fold(f64::INFINITY, f64::min);
        let std = (e["cov"][0].as_f64().unwrap() + e["cov"][7].as_f64().unwrap()).sqrt();
        assert!(near < (4.0 * std).max(1.0), "{near} px away, {std} px stated: {e}");
        n_near += 1;
    }
    assert!(n_near > 60, "{n_near}");
    let (_, _, metrics) = get(to, "/metrics");
    assert!(metrics.contains("boresight_tracks_total{source=\"cam\"} 2\n"), "{metrics}");
}

/// Records a run of the scene and returns where.
fn record_of(connect: Box<dyn boresight_live::Connect>, config: &Config) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let limits = RecordOptions { segment_bytes: 40_000, ..RecordOptions::default() };
    let mut outputs: Vec<Box<dyn LiveOutput>> = vec![Box::new(Record::create(dir.path(), limits).unwrap())];
    let options = RunOptions { config: Some(config.clone()), ..RunOptions::default() };
    run(connect, &options, &board(), &mut outputs, &|| false).unwrap();
    dir
}

/// The rows of tables that each begin with the header.
fn rows(text: &str) -> Vec<&str> {
    text.lines().filter(|l| !l.starts_with("frame,")).collect()
}

#[test]
fn a_record_replays_to_the_same_bytes_live_and_offline() {
    let first = record_of(Box::new(ScenePlug::of(scene(200, 25.0), false)), &config());
    let tables = recorded(first.path(), ".tracks.csv");
    assert!(tables.lines().filter(|l| l.starts_with("frame,")).count() > 1, "several segments");
    assert!(rows(&tables).len() > 300);

    // The lines through `live` again.
    let lines = first.path().join("all.json");
    std::fs::write(&lines, recorded(first.path(), ".jsonl")).unwrap();
    let input = boresight::config::InputConfig::default();
    let again = record_of(Box::new(Address::new(&lines.display().to_string(), input, false, false)), &config());
    assert_eq!(rows(&recorded(again.path(), ".tracks.csv")), rows(&tables));

    // The table of detections with the configuration beside it, as `boresight track --config` reads them.
    let beside = Config::from_file(&first.path().join("000001.config.toml")).unwrap();
    assert_eq!(beside, config());
    let detections = recorded(first.path(), ".detections.csv");
    let header = detections.lines().next().unwrap();
    let table = first.path().join("all.csv");
    std::fs::write(&table, format!("{header}\n{}\n", rows(&detections).join("\n"))).unwrap();
    let read = boresight::io::read_detections(table.display().to_string(), &beside.input.table_options()).unwrap();
    let offline = first.path().join("offline.csv");
    let sink = Box::new(TracksCsv::to(Output::file(&offline).unwrap()).unwrap());
    let tracking = track::build(&beside.tracker).unwrap();
    let outcome =
        pipeline::run(Input::Scans(read.scans), Some(tracking), vec![sink], &mut |_| ControlFlow::Continue(()));
    assert!(outcome.broken.is_none());
    assert_eq!(rows(&std::fs::read_to_string(&offline).unwrap()), rows(&tables));
}

#[test]
fn without_a_configuration_one_is_chosen_and_no_frame_is_lost_to_looking() {
    let dir = tempfile::tempdir().unwrap();
    let board = board();
    let mut outputs: Vec<Box<dyn LiveOutput>> =
        vec![Box::new(Record::create(dir.path(), RecordOptions::default()).unwrap())];
    let plug = Box::new(ScenePlug::of(scene(120, 25.0), false));
    run(plug, &RunOptions::default(), &board, &mut outputs, &|| false).unwrap();
    let text = recorded(dir.path(), ".jsonl");
    let frames: Vec<u64> =
        text.lines().map(|l| serde_json::from_str::<Value>(l).unwrap()["frame"].as_u64().unwrap()).collect();
    assert_eq!(frames, (0..120).collect::<Vec<_>>());
    assert_eq!(board.counts.tracks.load(Ordering::SeqCst), 2);
    assert!(board.configuration().0.contains("[detector"));
}

/// A machine that is four times too slow; notes the times of the frames that it got to.
struct Slow(Arc<Mutex<Vec<i64>>>);

impl LiveOutput for Slow {
    fn put(&mut self, shown: &Shown<'_>) -> boresight::Result<()> {
        self.0.lock().unwrap().push(shown.when.time.ns);
        std::thread::sleep(Duration::from_millis(40));
        Ok(())
    }
}

#[test]
fn a_machine_that_is_too_slow_takes_the_newest_frame_and_the_gap_is_a_gap_in_time() {
    let board = board();
    let times = Arc::new(Mutex::new(Vec::new()));
    let mut outputs: Vec<Box<dyn LiveOutput>> = vec![Box::new(Slow(Arc::clone(&times)))];
    let plug = ScenePlug { newest: true, ..ScenePlug::of(scene(200, 100.0), true) };
    let truth = Truth::clone(&plug.truth);
    let options = RunOptions { config: Some(config()), ..RunOptions::default() };
    run(Box::new(plug), &options, &board, &mut outputs, &|| false).unwrap();
    let count = |c: &AtomicU64| c.load(Ordering::SeqCst);
    let (tracked, dropped) = (count(&board.counts.tracked), count(&board.counts.dropped));
    assert_eq!(tracked + dropped, 200, "every frame is tracked or counted");
    assert!(dropped >= 100, "{dropped}");
    assert_eq!(count(&board.counts.tracks), 2, "gaps break no track");
    let times = times.lock().unwrap();
    assert!(times.iter().all(|ns| truth.lock().unwrap().contains_key(ns)), "the stamps are the stream's");
    assert_eq!(*times.last().unwrap(), 1_990_000_000, "the last frame is the newest: nothing queued up");
}
