//! The whole of `boresight live`: a simulated scene as an MPEG-TS stream by HTTP, its tracks on the page, by MQTT and NATS and in the record with equal states, while the source, the
//! brokers, a viewer and at last the program itself are killed.
//!
//! Needs `ffmpeg`, `mosquitto` and `nats-server`; where one is missing the test shows as ignored and says which. The subscribers are written here, from the protocols.

use libtest_mimic::{Arguments, Trial};
use serde_json::Value;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};

const PATIENCE: Duration = Duration::from_secs(90);

/// Two squares that cross the frame: starts and velocities, px and px/s.
const TARGETS: [([f64; 2], [f64; 2]); 2] = [([20.0, 30.0], [4.0, 1.5]), ([140.0, 90.0], [-3.0, -1.0])];

const CONFIG: &str = "[detector.threshold.band]\nlow = 110\nhigh = 190\n[detector.cluster]\nmin-area-px = 25\n";

fn scene() -> String {
    let head = "width-px = 160\nheight-px = 120\nrate-hz = 25.0\nn-frames = 750\nbackground.white = { mean = 50.0, std = 5.0 }\n";
    let target = |(start, velocity): &([f64; 2], [f64; 2])| {
        format!(
            "[[targets]]\nstart-px = {start:?}\nvelocity-px-per-s = {velocity:?}\nshape.rectangle = {{ size-px = [9, 9], mean = 150.0, std = 3.0 }}\n"
        )
    };
    TARGETS.iter().fold(head.to_string(), |text, t| text + &target(t))
}

/// A program that dies with its test.
struct Program(Child);

impl Program {
    fn start(name: &str, args: &[&str]) -> Self {
        let mut command = Command::new(name);
        let quiet = command.args(args).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        Self(quiet.spawn().unwrap_or_else(|e| panic!("{name}: {e}")))
    }

    fn listening(name: &str, args: &[&str], port: u16) -> Self {
        let program = Self::start(name, args);
        until("a broker listens", || TcpStream::connect(("127.0.0.1", port)).is_ok());
        program
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn until(what: &str, is_so: impl Fn() -> bool) {
    let end = Instant::now() + PATIENCE;
    while !is_so() {
        assert!(Instant::now() < end, "{what}: not within {PATIENCE:?}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// A port that was free a moment ago.
fn port() -> u16 {
    std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

/// Whether somebody listens on a port; a connection would be the one that the player serves. The system's table says it: addresses in hexadecimal, state 0A.
fn listens(port: u16) -> bool {
    let table = std::fs::read_to_string("/proc/net/tcp").unwrap();
    let local = format!(":{port:04X}");
    table
        .lines()
        .any(|l| matches!(l.split_whitespace().collect::<Vec<_>>()[..], [_, at, _, "0A", ..] if at.ends_with(&local)))
}

type Key = (u64, u64);

/// What came one way: states by frame and track, and the words about the run.
#[derive(Default)]
struct Seen {
    states: BTreeMap<Key, Vec<f64>>,
    words: Vec<String>,
}

type Way = Arc<Mutex<Seen>>;

fn look(way: &Way) -> MutexGuard<'_, Seen> {
    way.lock().unwrap()
}

fn state(t: &Value) -> Vec<f64> {
    let numbers = ["x_px", "y_px", "vx_px_per_s", "vy_px_per_s"].map(|k| t[k].as_f64().unwrap());
    numbers.into_iter().chain(t["cov"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap())).collect()
}

impl Seen {
    fn put(&mut self, frame: &Value, track: &Value, state: Vec<f64>) {
        let key = (frame.as_u64().unwrap(), track.as_u64().unwrap());
        // What a broker did not confirm comes again: it must be the same.
        let before = self.states.insert(key, state.clone());
        assert!(before.is_none_or(|b| b == state), "{key:?} came with two states");
    }

    fn event(&mut self, text: &str) {
        let e: Value = serde_json::from_str(text).unwrap_or_else(|_| panic!("no JSON: {text}"));
        match (&e["event"], &e["state"]) {
            (Value::String(what), _) if what == "end" => {}
            (Value::String(_), _) => self.put(&e["frame"], &e["track"], state(&e)),
            (_, Value::String(word)) => self.words.push(word.clone()),
            _ => panic!("{text}"),
        }
    }

    fn newest(&self) -> u64 {
        self.states.keys().next_back().map_or(0, |k| k.0)
    }
}

/// Reads a way on a thread, again and again where it breaks off, until `over`.
fn follow(over: &Arc<AtomicBool>, read: impl Fn(&Way) -> std::io::Result<()> + Send + 'static) -> Way {
    let (way, over) = (Way::default(), Arc::clone(over));
    let here = Arc::clone(&way);
    std::thread::spawn(move || {
        while !over.load(Ordering::SeqCst) {
            let _ = read(&here);
            std::thread::sleep(Duration::from_millis(20));
        }
    });
    way
}

/// One connection to an MQTT 3.1.1 broker: everything, with quality of service 0.
fn read_mqtt(port: u16, way: &Way) -> std::io::Result<()> {
    let mut stream = TcpStream::connect(("127.0.0.1", port))?;
    stream.write_all(b"\x10\x10\x00\x04MQTT\x04\x02\x00\x00\x00\x04test")?;
    stream.write_all(b"\x82\x06\x00\x01\x00\x01#\x00")?;
    let mut reader = BufReader::new(stream);
    loop {
        let mut head = [0];
        reader.read_exact(&mut head)?;
        let (mut n, mut shift) = (0usize, 0);
        loop {
            let mut byte = [0];
            reader.read_exact(&mut byte)?;
            n |= usize::from(byte[0] & 127) << shift;
            shift += 7;
            if byte[0] < 128 {
                break;
            }
        }
        let mut body = vec![0; n];
        reader.read_exact(&mut body)?;
        if head[0] >> 4 == 3 {
            let topic = 2 + usize::from(u16::from_be_bytes([body[0], body[1]]));
            look(way).event(std::str::from_utf8(&body[topic..]).unwrap());
        }
    }
}

/// One connection to a NATS server.
fn read_nats(port: u16, way: &Way) -> std::io::Result<()> {
    let mut stream = TcpStream::connect(("127.0.0.1", port))?;
    stream.write_all(b"CONNECT {}\r\nSUB > 1\r\n")?;
    let mut reader = BufReader::new(stream);
    loop {
        let mut line = String::new();
        if reader.read_line(&mut line)? == 0 {
            return Ok(());
        }
        if let ["MSG", _, _, n] = line.split_whitespace().collect::<Vec<_>>()[..] {
            let mut payload = vec![0; n.parse::<usize>().unwrap() + 2];
            reader.read_exact(&mut payload)?;
            look(way).event(std::str::from_utf8(&payload).unwrap().trim_end());
        }
    }
}

fn request(to: SocketAddr, path: &str) -> std::io::Result<impl Iterator<Item = std::io::Result<String>>> {
    let mut stream = TcpStream::connect(to)?;
    write!(stream, "GET {path} HTTP/1.1\r\nHost: {to}\r\nConnection: close\r\n\r\n")?;
    Ok(BufReader::new(stream).lines())
}

/// The page's stream of events.
fn read_events(to: SocketAddr, way: &Way) -> std::io::Result<()> {
    for line in request(to, "/api/stream")? {
        let line = line?;
        assert_ne!(line, "event: lost", "a reader that keeps up loses nothing");
        if let Some(event) = line.strip_prefix("data: ") {
            look(way).event(event);
        }
    }
    Ok(())
}

/// The page's newest frame, asked for again and again.
fn read_tracks(to: SocketAddr, way: &Way) -> std::io::Result<()> {
    for line in request(to, "/api/tracks")? {
        if let Ok(shot) = serde_json::from_str::<Value>(&line?)
            && let Some(tracks) = shot["tracks"].as_array()
        {
            tracks.iter().for_each(|t| look(way).put(&shot["frame"], &t["track"], state(t)));
        }
    }
    Ok(())
}

/// Starts the program and returns it with the address of its page.
fn live(dir: &Path, source: &str, to: [&str; 2]) -> (Program, SocketAddr) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_boresight"));
    command.current_dir(dir).args(["live", source, "--config", "band.toml", "--serve", "127.0.0.1:0"]);
    command.args(["--publish", to[0], "--publish", to[1], "--record", "kept", "--updates-hz", "1000"]);
    let mut child = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let mut said = BufReader::new(child.stderr.take().unwrap()).lines();
    let program = Program(child);
    let page = said.by_ref().map(Result::unwrap).find_map(|l| l.strip_prefix("page: http://").map(ToString::to_string));
    let page = page.expect("a page").trim_end_matches('/').parse().unwrap();
    // What it goes on to say is read, so that it never waits for it; it helps to understand a failure.
    std::thread::spawn(move || said.for_each(|l| println!("{}", l.unwrap_or_default())));
    (program, page)
}

/// The confirmed tracks of a record's file, whose every line must be whole.
fn recorded(path: &Path) -> BTreeMap<Key, Vec<f64>> {
    let text = std::fs::read_to_string(path).unwrap();
    assert!(text.ends_with('\n'), "no half line");
    let mut states = BTreeMap::new();
    for line in text.lines() {
        let line: Value = serde_json::from_str(line).unwrap();
        for t in line["tracks"].as_array().unwrap().iter().filter(|t| t["status"] != "tentative") {
            states.insert((line["frame"].as_u64().unwrap(), t["track_id"].as_u64().unwrap()), state(t));
        }
    }
    states
}

fn everything_is_killed_once_and_all_ways_agree() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("scene.toml"), scene()).unwrap();
    std::fs::write(dir.path().join("band.toml"), CONFIG).unwrap();
    let mut simulate = Command::new(env!("CARGO_BIN_EXE_boresight"));
    let simulate = simulate.current_dir(dir.path()).args(["simulate", "scene.toml", "--format", "y4m", "-o", "sim"]);
    assert!(simulate.output().unwrap().status.success());

    let [mqtt_port, nats_port, source_port] = [port(), port(), port()];
    let conf = dir.path().join("mosquitto.conf");
    std::fs::write(&conf, format!("listener {mqtt_port} 127.0.0.1\nallow_anonymous true\n")).unwrap();
    let (conf, nats_arg) = (conf.display().to_string(), nats_port.to_string());
    let mosquitto = || Program::listening(&found("mosquitto").unwrap(), &["-c", &conf], mqtt_port);
    let nats_args = ["-a", "127.0.0.1", "-p", &nats_arg];
    let nats_server = || Program::listening(&found("nats-server").unwrap(), &nats_args, nats_port);
    let source = format!("http://127.0.0.1:{source_port}/scene.ts");
    let frames = dir.path().join("sim/frames.y4m").display().to_string();
    let play = || {
        let coding = ["-c:v", "libx264", "-crf", "12", "-g", "12", "-tune", "zerolatency", "-pix_fmt", "yuv420p"];
        let all = [&["-nostdin", "-re", "-i", &frames][..], &coding, &["-f", "mpegts", "-listen", "1", &source]];
        let player = Program::start("ffmpeg", &all.concat());
        until("the player listens", || listens(source_port));
        player
    };
    let to = [format!("mqtt://127.0.0.1:{mqtt_port}/site"), format!("nats://127.0.0.1:{nats_port}/site")];
    let to = [to[0].as_str(), to[1].as_str()];

    let (mut broker, mut server, mut player) = (mosquitto(), nats_server(), play());
    let over = Arc::new(AtomicBool::new(false));
    let mqtt = follow(&over, move |way| read_mqtt(mqtt_port, way));
    let nats = follow(&over, move |way| read_nats(nats_port, way));
    let (mut program, page) = live(dir.path(), &source, to);
    let stream = follow(&over, move |way| read_events(page, way));
    let asked = follow(&over, move |way| read_tracks(page, way));
    let mut viewer = TcpStream::connect(page).unwrap();
    write!(viewer, "GET /api/view HTTP/1.1\r\nHost: {page}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n").unwrap();
    let ways = [("mqtt", &mqtt), ("nats", &nats), ("stream", &stream), ("asked", &asked)];
    ways.iter().for_each(|(name, way)| until(name, || look(way).states.len() > 40));

    // The brokers and a viewer that never said that it has drawn.
    drop((broker, server, viewer));
    let killed_at = look(&stream).newest();
    until("the run waits for no broker", || look(&stream).newest() > killed_at + 10);
    (broker, server) = (mosquitto(), nats_server());
    let back_at = look(&stream).newest();
    until("mqtt is back", || look(&mqtt).newest() > back_at + 20);
    until("nats is back", || look(&nats).newest() > back_at + 20);

    // The source.
    drop(player);
    until("the loss is said", || look(&stream).words.iter().any(|w| w == "lost"));
    let lost_at = look(&stream).newest();
    player = play();
    ways.iter().for_each(|(name, way)| until(name, || look(way).newest() > lost_at + 40));
    for word in ["lost", "running"] {
        assert!(look(&mqtt).words.iter().any(|w| w == word) && look(&nats).words.iter().any(|w| w == word), "{word}");
    }

    // The program itself: the broker says its last will.
    program.0.kill().unwrap();
    program.0.wait().unwrap();
    until("the last will", || look(&mqtt).words.last().is_some_and(|w| w == "gone"));
    over.store(true, Ordering::SeqCst);
    drop((broker, server, player));

    let record = recorded(&dir.path().join("kept/000001.jsonl"));
    let mut n_same = 0;
    for (name, way) in ways {
        for (key, state) in &look(way).states {
            assert_eq!(record.get(key), Some(state), "{name} {key:?}");
            n_same += 1;
        }
    }
    assert!(n_same > 400, "{n_same}");
    // Nothing that was recorded is missing on the way that was never broken, nor on the others since they are back: they came 20 frames later for sure.
    let complete = |name: &str, way: &Way, from: u64| {
        let last = look(way).newest();
        let missing: Vec<_> =
            record.keys().filter(|k| k.0 >= from && k.0 < last && !look(way).states.contains_key(k)).collect();
        assert!(missing.is_empty() && last > lost_at, "{name} has not {missing:?}");
    };
    let first = look(&stream).states.keys().next().unwrap().0 + 1;
    complete("stream", &stream, first);
    complete("mqtt", &mqtt, back_at + 20);
    complete("nats", &nats, back_at + 20);
    // The truth does not depend on the clock: a target goes along its line.
    let n_near = record.iter().filter(|(_, s)| s[4] + s[11] < 0.5).map(|(key, s)| {
        let far = TARGETS.map(|(p, v)| ((s[0] - p[0]) * v[1] - (s[1] - p[1]) * v[0]).abs() / v[0].hypot(v[1]));
        let near = far[0].min(far[1]);
        assert!(near < 1.5, "{key:?} is {near} px beside the nearest target's line");
    });
    assert!(n_near.count() > 200);

    // And the next run goes on beside the first one's files, until it is interrupted.
    (broker, server, player) = (mosquitto(), nats_server(), play());
    let over = Arc::new(AtomicBool::new(false));
    let mqtt = follow(&over, move |way| read_mqtt(mqtt_port, way));
    let (mut program, _) = live(dir.path(), &source, to);
    until("the second run", || look(&mqtt).states.len() > 20);
    let pid = program.0.id().to_string();
    assert!(Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
    assert_eq!(program.0.wait().unwrap().code(), Some(130));
    until("its end", || look(&mqtt).words.last().is_some_and(|w| w == "ended"));
    over.store(true, Ordering::SeqCst);
    // The program that read the stream for it is gone too: nobody takes what the player sends.
    let end = Instant::now() + PATIENCE;
    while player.0.try_wait().unwrap().is_none() {
        assert!(Instant::now() < end, "somebody still reads the stream");
        std::thread::sleep(Duration::from_millis(20));
    }
    drop((broker, server));
    let second = recorded(&dir.path().join("kept/000002.jsonl"));
    look(&mqtt).states.iter().for_each(|(key, state)| assert_eq!(second.get(key), Some(state), "{key:?}"));
    let manifest = std::fs::read_to_string(dir.path().join("kept/manifest.json")).unwrap();
    let manifest: Value = serde_json::from_str(&manifest).unwrap();
    let open: Vec<_> = manifest["segments"].as_array().unwrap().iter().map(|s| s["open"].as_bool().unwrap()).collect();
    assert_eq!(open, [false, false], "{manifest}");
}

/// Where a program is.
fn found(name: &str) -> Option<String> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let places = std::env::split_paths(&path).chain(["/usr/sbin".into()]);
    places.map(|dir| dir.join(name)).find(|p| p.is_file()).map(|p| p.display().to_string())
}

fn main() -> std::process::ExitCode {
    let missing: Vec<_> = ["ffmpeg", "mosquitto", "nats-server"].into_iter().filter(|p| found(p).is_none()).collect();
    let trial = Trial::test("everything_is_killed_once_and_all_ways_agree", || {
        everything_is_killed_once_and_all_ways_agree();
        Ok(())
    });
    let why = format!("needs {}", missing.join(", "));
    let trial = if missing.is_empty() { trial } else { trial.with_kind(why).with_ignored_flag(true) };
    libtest_mimic::run(&Arguments::from_args(), vec![trial]).exit_code()
}
