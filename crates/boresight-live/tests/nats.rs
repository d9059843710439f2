//! NATS with a real server, nats-server, which is killed and started again in the middle; ignored where it is not installed.

mod common;

use boresight_live::{Board, Event, LiveOutput, Nats, RunOptions, Target, publisher, run};
use common::daemon::{Daemon, PATIENCE, port};
use common::{ScenePlug, board, config, scene};
use libtest_mimic::{Arguments, Trial};
use std::collections::BTreeSet;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

fn program() -> Option<&'static str> {
    let runs = |p: &&str| Command::new(p).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok();
    ["nats-server", "/usr/sbin/nats-server"].into_iter().find(runs)
}

fn serving(port: u16, more: &str) -> Daemon {
    Daemon::start(program().unwrap().as_ref(), &format!("listen: 127.0.0.1:{port}\n{more}\n"), port)
}

/// Everything that comes on any subject: subject and payload. `connect` is the object that is sent at first.
fn subscribe(port: u16, connect: &str) -> Receiver<(String, String)> {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
    write!(stream, "CONNECT {connect}\r\nSUB > 1\r\nPING\r\n").unwrap();
    let mut reader = BufReader::new(stream.try_clone().unwrap());
    let mut line = String::new();
    while line.trim() != "PONG" {
        line.clear();
        assert!(reader.read_line(&mut line).unwrap() > 0, "the server closes");
    }
    let (send, receive) = channel();
    std::thread::spawn(move || {
        loop {
            let mut line = String::new();
            if reader.read_line(&mut line).unwrap_or(0) == 0 {
                return;
            }
            let words: Vec<&str> = line.split_whitespace().collect();
            match words[..] {
                ["PING"] => stream.write_all(b"PONG\r\n").unwrap(),
                ["MSG", subject, _, n] => {
                    let mut payload = vec![0; n.parse::<usize>().unwrap() + 2];
                    reader.read_exact(&mut payload).unwrap();
                    payload.truncate(payload.len() - 2);
                    if send.send((subject.to_string(), String::from_utf8(payload).unwrap())).is_err() {
                        return;
                    }
                }
                _ => {}
            }
        }
    });
    receive
}

fn event(k: u64) -> Event {
    Event::line(false, format!("{{\"k\":{k}}}"))
}

fn start(address: &str, board: Arc<Board>) -> Nats {
    match Target::parse(address).unwrap() {
        Target::Nats(broker) => Nats::start(&broker, board).unwrap(),
        other => panic!("{other:?}"),
    }
}

/// Takes what comes until all of these numbers did; how often a number came that had come before.
fn until_all(from: &Receiver<(String, String)>, mut missing: BTreeSet<u64>) -> usize {
    let (until, mut n_again) = (Instant::now() + PATIENCE, 0);
    while !missing.is_empty() {
        let left = until.saturating_duration_since(Instant::now());
        let Ok((subject, text)) = from.recv_timeout(left) else { panic!("never came: {missing:?}") };
        if subject == "site.tracks" {
            let value: serde_json::Value = serde_json::from_str(&text).unwrap();
            n_again += usize::from(!missing.remove(&value["k"].as_u64().unwrap()));
        }
    }
    n_again
}

fn a_server_that_is_killed_and_comes_back_gets_what_waited() {
    let port = port();
    let mut server = serving(port, "");
    let first = subscribe(port, "{}");
    let mut nats = start(&format!("nats://127.0.0.1:{port}/site/tracks"), board());
    nats.event(&Event::line(true, "{\"state\":\"running\"}"));
    (0..50).for_each(|k| nats.event(&event(k)));
    let (subject, text) = first.recv_timeout(PATIENCE).unwrap();
    assert_eq!((subject.as_str(), text.as_str()), ("site.tracks.status", "{\"state\":\"running\"}"));
    assert_eq!(until_all(&first, (0..50).collect()), 0);
    drop(server);
    // While it is away nobody waits, and nothing is lost that fits.
    let began = Instant::now();
    (50..500).for_each(|k| nats.event(&event(k)));
    assert!(began.elapsed() < Duration::from_secs(1), "nobody waits for it");
    server = serving(port, "");
    let second = subscribe(port, "{}");
    // What came in before this subscription was there went to nobody; of the rest everything comes.
    (500..600).for_each(|k| nats.event(&event(k)));
    until_all(&second, (500..600).collect());
    assert_eq!(nats.dropped(), 0);
    nats.finish();
    drop(server);
}

/// What is sent when the server dies and was not confirmed is sent again: events come without a gap, whenever it is killed.
fn nothing_is_lost_on_the_way_when_the_server_is_killed_in_the_middle() {
    let port = port();
    let mut server = serving(port, "");
    let mut nats = start(&format!("nats://127.0.0.1:{port}/site/tracks"), board());
    let mut came = BTreeSet::new();
    for round in 0..3u64 {
        let listener = subscribe(port, "{}");
        let from = 1000 * round;
        (from..from + 1000).for_each(|k| nats.event(&event(k)));
        // In the middle of them.
        std::thread::sleep(Duration::from_millis(round));
        drop(server);
        came.extend(listener.iter().filter_map(|(_, text)| text[5..text.len() - 1].parse::<u64>().ok()));
        server = serving(port, "");
        let late = subscribe(port, "{}");
        nats.event(&event(10_000 + round));
        until_all(&late, [10_000 + round].into());
    }
    // Those that went while nobody was subscribed are the only ones that this test cannot see: they are the last of a round, never a hole.
    for round in 0..3u64 {
        let seen: Vec<u64> = came.range(1000 * round..1000 * (round + 1)).copied().collect();
        let expected: Vec<u64> = (1000 * round..).take(seen.len()).collect();
        assert_eq!(seen, expected, "a hole in round {round}");
    }
    assert_eq!(nats.dropped(), 0);
    nats.finish();
}

fn what_waits_for_a_server_is_bounded_and_comes_when_it_does() {
    let port = port();
    let mut nats = start(&format!("nats://127.0.0.1:{port}/site.tracks"), board());
    (0..5000).for_each(|k| nats.event(&event(k)));
    assert_eq!(nats.dropped(), 5000 - 4096, "bounded: the oldest go, and are counted");
    let _server = serving(port, "");
    let listener = subscribe(port, "{}");
    (5000..5010).for_each(|k| nats.event(&event(k)));
    until_all(&listener, (5000..5010).collect());
    nats.finish();
}

/// What the boards of these tests said.
static SAID: Mutex<Vec<String>> = Mutex::new(Vec::new());

fn said(words: &str) {
    SAID.lock().unwrap().push(words.to_string());
}

fn until_said(words: &str) {
    let until = Instant::now() + PATIENCE;
    while !SAID.lock().unwrap().iter().any(|s| s.contains(words)) {
        assert!(Instant::now() < until, "{words:?} is never said: {:?}", SAID.lock().unwrap());
        std::thread::sleep(Duration::from_millis(10));
    }
}

fn a_password_opens_and_what_the_server_refuses_is_said_and_counted() {
    let port = port();
    let users =
        "{user: me, password: right, permissions: {publish: {allow: [\"site.>\"]}, subscribe: {allow: [\">\"]}}}";
    let _server = serving(port, &format!("max_payload: 1024\nauthorization {{ users: [{users}] }}"));
    let speaking = || Arc::new(Board::new("cam", said));
    let _wrong = start(&format!("nats://me:wrong@127.0.0.1:{port}/site.tracks"), speaking());
    until_said("Authorization Violation");
    assert!(SAID.lock().unwrap().iter().all(|s| !s.contains("wrong")), "a password is never said");
    let listener = subscribe(port, "{\"user\":\"me\",\"pass\":\"right\"}");
    let mut nats = start(&format!("nats://me:right@127.0.0.1:{port}/site.tracks"), speaking());
    // One that is too large for the server must not end the connection, again and again.
    nats.event(&Event::line(false, "x".repeat(2000)));
    (0..10).for_each(|k| nats.event(&event(k)));
    until_all(&listener, (0..10).collect());
    assert_eq!(nats.dropped(), 1);
    let mut elsewhere = start(&format!("nats://me:right@127.0.0.1:{port}/other"), speaking());
    (0..3).for_each(|k| elsewhere.event(&event(k)));
    until_said("Permissions Violation");
    elsewhere.finish();
    assert_eq!(elsewhere.dropped(), 3);
    nats.finish();
}

fn a_run_goes_on_and_its_tracks_come_while_the_server_comes_and_goes() {
    let port = port();
    let board = board();
    let target = Target::parse(&format!("nats://127.0.0.1:{port}/site.tracks")).unwrap();
    let mut outputs = vec![publisher(&target, &board).unwrap()];
    let server = Arc::new(Mutex::new(Some(serving(port, ""))));
    let listener = subscribe(port, "{}");
    let kills = Arc::clone(&server);
    let killer = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(800));
        let server = kills.lock().unwrap().take();
        drop(server);
        std::thread::sleep(Duration::from_millis(600));
        *kills.lock().unwrap() = Some(serving(port, ""));
        subscribe(port, "{}")
    });
    let options = RunOptions { config: Some(config()), updates_hz: f64::INFINITY, ..RunOptions::default() };
    run(Box::new(ScenePlug::of(scene(150, 50.0), true)), &options, &board, &mut outputs, &|| false).unwrap();
    let frames = |from: &Receiver<(String, String)>| -> BTreeSet<u64> {
        let values = from.iter().map(|(_, text)| serde_json::from_str::<serde_json::Value>(&text).unwrap());
        values.filter_map(|v| v["frame"].as_u64()).collect()
    };
    let late = killer.join().unwrap();
    drop(server.lock().unwrap().take());
    let (before, after) = (frames(&listener), frames(&late));
    assert_eq!(board.counts.tracked.load(std::sync::atomic::Ordering::SeqCst), 150, "the run waited for nobody");
    assert!(before.len() > 20 && after.contains(&149), "{} {after:?}", before.len());
}

fn main() -> std::process::ExitCode {
    let tests: [(&str, fn()); 5] = [
        (
            "a_server_that_is_killed_and_comes_back_gets_what_waited",
            a_server_that_is_killed_and_comes_back_gets_what_waited,
        ),
        (
            "nothing_is_lost_on_the_way_when_the_server_is_killed_in_the_middle",
            nothing_is_lost_on_the_way_when_the_server_is_killed_in_the_middle,
        ),
        (
            "what_waits_for_a_server_is_bounded_and_comes_when_it_does",
            what_waits_for_a_server_is_bounded_and_comes_when_it_does,
        ),
        (
            "a_password_opens_and_what_the_server_refuses_is_said_and_counted",
            a_password_opens_and_what_the_server_refuses_is_said_and_counted,
        ),
        (
            "a_run_goes_on_and_its_tracks_come_while_the_server_comes_and_goes",
            a_run_goes_on_and_its_tracks_come_while_the_server_comes_and_goes,
        ),
    ];
    let missing = program().is_none();
    let trials = tests.map(|(name, run)| {
        let trial = Trial::test(name, move || {
            run();
            Ok(())
        });
        let why = "needs nats-server: apt-get install nats-server";
        if missing { trial.with_kind(why).with_ignored_flag(true) } else { trial }
    });
    libtest_mimic::run(&Arguments::from_args(), trials.into()).exit_code()
}
