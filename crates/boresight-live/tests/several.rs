//! Two simulated cameras at once: each has its tracker, its place on the page, on the wire and in the record, and neither changes the other's tracks.

mod common;

use boresight::sim::scene::SceneConfig;
use boresight::{Error, ErrorKind};
use boresight_live::{
    Board, Connect, Feed, LiveOutput, OneRun, Page, PageOptions, Pauses, Record, RecordOptions, RunOptions, Target,
    publisher, run_all,
};
use common::{ScenePlug, Viewer, config, get, scene};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufRead, BufReader, Write};
use std::net::{SocketAddr, TcpStream, UdpSocket};
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// The second camera sees other targets in a larger frame, at another rate.
fn scenes() -> [(&'static str, SceneConfig); 2] {
    let mut south = SceneConfig { width_px: 200, ..scene(120, 40.0) };
    south.targets.truncate(1);
    south.targets[0].start_px = [40.0, 100.0];
    [("north", scene(150, 50.0)), ("south", south)]
}

fn options() -> RunOptions {
    RunOptions { config: Some(config()), updates_hz: f64::INFINITY, ..RunOptions::default() }
}

fn record(dir: &Path) -> Box<dyn LiveOutput> {
    Box::new(Record::create(dir, RecordOptions::default()).unwrap())
}

/// The table of tracks that a run of this scene alone records.
fn alone(name: &str, scene: SceneConfig) -> String {
    let dir = tempfile::tempdir().unwrap();
    let board = Arc::new(Board::new(name, |_| {}));
    let connect = Box::new(ScenePlug::of(scene, false));
    run_all(vec![OneRun { connect, options: options(), board, outputs: vec![record(dir.path())] }], &|| false).unwrap();
    std::fs::read_to_string(dir.path().join("000001.tracks.csv")).unwrap()
}

/// The events that an address streams, until this many sources have said that they ended.
fn streamed(to: SocketAddr, path: &str, n_sources: usize) -> std::thread::JoinHandle<Vec<Value>> {
    let mut stream = TcpStream::connect(to).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\nHost: {to}\r\n\r\n").unwrap();
    let mut lines = BufReader::new(stream).lines();
    assert!(lines.by_ref().any(|l| l.unwrap().is_empty()), "the head is here, so the events are subscribed to");
    std::thread::spawn(move || {
        let (mut all, mut ended) = (Vec::new(), BTreeSet::new());
        while ended.len() < n_sources {
            let line = lines.next().expect("an event").unwrap();
            let Some(event) = line.strip_prefix("data: ") else { continue };
            let event: Value = serde_json::from_str(event).unwrap();
            if event["state"] == "ended" {
                ended.insert(event["source"].to_string());
            }
            all.push(event);
        }
        all
    })
}

fn state(t: &Value) -> Vec<f64> {
    let numbers = ["x_px", "y_px", "vx_px_per_s", "vy_px_per_s"].map(|k| t[k].as_f64().unwrap());
    numbers.into_iter().chain(t["cov"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap())).collect()
}

/// States by source, frame and track.
fn states(events: &[Value]) -> BTreeMap<(String, u64, u64), Vec<f64>> {
    let tracks = events.iter().filter(|e| e["event"] == "start" || e["event"] == "update");
    let key = |e: &Value| {
        (e["source"].as_str().unwrap().to_string(), e["frame"].as_u64().unwrap(), e["track"].as_u64().unwrap())
    };
    tracks.map(|e| (key(e), state(e))).collect()
}

#[test]
fn two_cameras_at_once_are_tracked_as_each_alone_and_told_apart_everywhere() {
    let dir = tempfile::tempdir().unwrap();
    let boards = scenes().map(|(name, _)| Arc::new(Board::new(name, |_| {})));
    let page = Page::serve(&PageOptions::at("127.0.0.1:0".parse().unwrap()), &boards).unwrap();
    let to = page.address();
    let both = streamed(to, "/api/stream", 2);
    let south_only = streamed(to, "/api/stream?source=south", 1);
    assert_eq!(get(to, "/api/tracks").0, 400, "which of them?");
    assert_eq!(get(to, "/api/tracks?source=west").0, 404);
    assert_eq!(get(to, "/api/stream?source=west").0, 404);

    let wire = UdpSocket::bind("127.0.0.1:0").unwrap();
    wire.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
    let target = Target::parse(&format!("udp://{}", wire.local_addr().unwrap())).unwrap();
    // Read while it comes: the system's buffer of datagrams is small.
    let datagrams = std::thread::spawn(move || {
        let (mut all, mut buffer, mut n_ended) = (Vec::new(), vec![0; 65_536], 0);
        while n_ended < 2 {
            let n = wire.recv(&mut buffer).expect("an event");
            let event: Value = serde_json::from_slice(&buffer[..n]).unwrap();
            n_ended += u32::from(event["state"] == "ended");
            all.push(event);
        }
        all
    });
    let runs = scenes().into_iter().zip(&boards).enumerate().map(|(k, ((name, scene), board))| {
        let outputs = vec![record(&dir.path().join(name)), publisher(&target, board).unwrap(), page.output(k).unwrap()];
        let connect = Box::new(ScenePlug::of(scene, true));
        OneRun { connect, options: options(), board: Arc::clone(board), outputs }
    });
    // A viewer of each: what it is shown is of its source alone.
    let viewed = scenes().map(|(name, scene)| {
        let mut viewer = Viewer::enter_at(to, &format!("/api/view?source={name}"), "").ok().unwrap();
        std::thread::spawn(move || {
            let mut n = 0;
            while let Some((shot, jpeg)) = viewer.next() {
                viewer.send(b"next");
                assert_eq!(shot["source"], name);
                if !jpeg.is_empty() {
                    assert_eq!(shot["size_px"][0], scene.width_px);
                    n += 1;
                }
                if shot["state"] == "ended" {
                    break;
                }
            }
            n
        })
    });
    run_all(runs.collect(), &|| false).unwrap();
    assert!(viewed.into_iter().all(|v| v.join().unwrap() > 10), "both cameras' pictures came");

    // The wire, the page's stream: the same states under each name.
    let sent = states(&datagrams.join().unwrap());
    assert_eq!(states(&both.join().unwrap()), sent);
    let south = south_only.join().unwrap();
    assert!(south.iter().all(|e| e["source"] == "south"));
    let of = |name: &str| sent.clone().into_iter().filter(|((n, ..), _)| n == name).collect::<BTreeMap<_, _>>();
    assert_eq!(states(&south), of("south"));
    assert!(of("north").len() > 150 && of("south").len() > 60, "{} {}", of("north").len(), of("south").len());

    // The record: a folder each, byte for byte that of the camera alone.
    for (name, scene) in scenes() {
        let kept = std::fs::read_to_string(dir.path().join(name).join("000001.tracks.csv")).unwrap();
        assert!(kept.lines().count() > 60);
        assert_eq!(kept, alone(name, scene), "{name}");
        let text = std::fs::read_to_string(dir.path().join(name).join("000001.jsonl")).unwrap();
        let mut n = 0;
        for line in text.lines() {
            let line: Value = serde_json::from_str(line).unwrap();
            for t in line["tracks"].as_array().unwrap().iter().filter(|t| t["status"] != "tentative") {
                let key = (name.to_string(), line["frame"].as_u64().unwrap(), t["track_id"].as_u64().unwrap());
                assert_eq!(sent.get(&key), Some(&state(t)), "{key:?}");
                n += 1;
            }
        }
        assert_eq!(n, of(name).len(), "{name}: no state is missing");
    }

    // What is asked afterwards.
    let sources: Value = serde_json::from_str(&get(to, "/api/sources").2).unwrap();
    let said: Vec<_> = sources["sources"].as_array().unwrap().iter().map(|s| (&s["source"], &s["state"])).collect();
    assert!(said.len() == 2 && said[0].0 == "north" && said[1].0 == "south" && said[1].1 == "ended", "{said:?}");
    let metrics = get(to, "/metrics").2;
    for line in ["tracks_total{source=\"north\"} 2\n", "tracks_total{source=\"south\"} 1\n"] {
        assert!(metrics.contains(line), "{line}{metrics}");
    }
    assert!(metrics.contains("boresight_frames_tracked_total{source=\"south\"} 120\n"), "{metrics}");
}

/// A camera that is not there at first.
struct Late(u32, Option<ScenePlug>);

impl Connect for Late {
    fn connect(&mut self) -> boresight::Result<Box<dyn Feed>> {
        self.0 += 1;
        match &mut self.1 {
            Some(plug) if self.0 > 3 => plug.connect(),
            _ => Err(Error::new(ErrorKind::NotFound, "no route to the camera")),
        }
    }
    fn is_endless(&self) -> bool {
        true
    }
    fn newest_counts(&self) -> bool {
        false
    }
}

#[test]
fn one_that_fails_or_comes_late_ends_no_other() {
    let boards = ["good", "gone", "late"].map(|name| Arc::new(Board::new(name, |_| {})));
    let tracked = |k: usize| boards[k].counts.tracked.load(std::sync::atomic::Ordering::SeqCst);
    let quick = Pauses { first: Duration::from_millis(5), longest: Duration::from_millis(10), from_the_start: false };
    let connects: [Box<dyn Connect>; 3] = [
        Box::new(ScenePlug::of(scene(60, 50.0), false)),
        Box::new(Late(0, None)),
        Box::new(Late(0, Some(ScenePlug::of(scene(60, 50.0), false)))),
    ];
    let runs = connects.into_iter().zip(&boards).enumerate().map(|(k, (connect, board))| {
        let options = RunOptions { pauses: Pauses { from_the_start: k == 2, ..quick }, ..options() };
        OneRun { connect, options, board: Arc::clone(board), outputs: Vec::new() }
    });
    let outcome = run_all(runs.collect(), &|| tracked(0) >= 60 && tracked(2) >= 60);
    let why = outcome.unwrap_err().to_string();
    assert!(why.contains("no route to the camera"), "the one that failed is said in the end: {why}");
    assert!(tracked(0) == 60 && tracked(1) == 0 && tracked(2) >= 60);
}
