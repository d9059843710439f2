//! The program against real peers on loopback: what is put, what is asked, and a peer that is killed and comes back.

use serde_json::Value;
use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};
use zenoh::{Config, Session, Wait};

const PATIENCE: Duration = Duration::from_secs(60);
/// Nobody else's network is touched.
const ALONE: &str = "{ scouting: { multicast: { enabled: false }, gossip: { enabled: false } } }";

/// A program whose lines are read; it dies with its test.
struct Program {
    child: Child,
    input: Option<ChildStdin>,
    lines: Receiver<String>,
}

impl Program {
    fn start(path: PathBuf, args: &[&str]) -> Self {
        let mut command = Command::new(path);
        let mut child = command.args(args).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        let (send, lines) = channel();
        let out = BufReader::new(child.stdout.take().unwrap());
        std::thread::spawn(move || out.lines().map_while(Result::ok).for_each(|line| drop(send.send(line))));
        let input = child.stdin.take();
        Self { child, input, lines }
    }

    fn boresight_zenoh(args: &[&str]) -> Self {
        Self::start(env!("CARGO_BIN_EXE_boresight-zenoh").into(), args)
    }

    /// A subscriber that can be killed.
    fn listener(port: u16) -> Self {
        let bin = PathBuf::from(env!("CARGO_BIN_EXE_boresight-zenoh"));
        let path = bin.parent().unwrap().join("examples/listen");
        Self::start(path, &["site/**", "--listen", &endpoint(port)])
    }

    fn put(&mut self, line: &str) {
        writeln!(self.input.as_mut().unwrap(), "{line}").unwrap();
    }

    fn line(&self) -> String {
        self.lines.recv_timeout(PATIENCE).expect("a line")
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn port() -> u16 {
    std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

fn endpoint(port: u16) -> String {
    format!("tcp/127.0.0.1:{port}")
}

fn event(k: u64) -> String {
    format!("{{\"schema\":\"boresight.track/1\",\"event\":\"update\",\"k\":{k},\"x_px\":0.1}}")
}

fn status(state: &str) -> String {
    format!("{{\"schema\":\"boresight.status/1\",\"source\":\"cam\",\"state\":\"{state}\",\"unix_s\":1.5}}")
}

/// A configuration file that leaves the network alone.
fn alone() -> (PathBuf, String) {
    let file = std::env::temp_dir().join(format!("boresight-zenoh-{}-{}.json5", std::process::id(), port()));
    std::fs::write(&file, ALONE).unwrap();
    (file.clone(), file.display().to_string())
}

/// A session of this test that is connected to the program.
fn connected(port: u16) -> Session {
    let mut config = Config::default();
    config.insert_json5("scouting/multicast/enabled", "false").unwrap();
    config.insert_json5("listen/endpoints", "[]").unwrap();
    config.insert_json5("connect/endpoints", &format!("[{:?}]", endpoint(port))).unwrap();
    let session = zenoh::open(config).wait().unwrap();
    let end = Instant::now() + PATIENCE;
    while session.info().peers_zid().wait().next().is_none() {
        assert!(Instant::now() < end, "the program does not answer");
        std::thread::sleep(Duration::from_millis(20));
    }
    session
}

#[test]
fn events_come_in_order_the_state_is_answered_and_the_end_is_said() {
    let (file, config) = alone();
    let port = port();
    let mut program =
        Program::boresight_zenoh(&["site/cam", "--listen", &endpoint(port), "--config", &config, "--acknowledge"]);
    let session = connected(port);
    let subscriber = session.declare_subscriber("site/**").wait().unwrap();
    let (send, came) = channel();
    std::thread::spawn(move || {
        while let Ok(sample) = subscriber.recv() {
            let text = String::from_utf8(sample.payload().to_bytes().to_vec()).unwrap();
            let _ = send.send((sample.key_expr().to_string(), sample.encoding().to_string(), text));
        }
    });
    // What is put before the subscription is known goes to nobody.
    let mut n_lines = 0;
    let first = loop {
        program.put(&event(0));
        n_lines += 1;
        if let Ok(first) = came.recv_timeout(Duration::from_millis(100)) {
            break first;
        }
        assert!(n_lines < 600, "nothing comes");
    };
    assert_eq!(first, ("site/cam".into(), "application/json".into(), event(0)));
    program.put(&status("running"));
    (1..=500).for_each(|k| program.put(&event(k)));
    let next = || came.recv_timeout(PATIENCE).unwrap();
    let mut at = next();
    while at.2 == event(0) {
        at = next();
    }
    assert_eq!((at.0.as_str(), at.2), ("site/cam/status", status("running")));
    (1..=500).for_each(|k| assert_eq!(next().2, event(k)));
    let last = (0..n_lines + 501).map(|_| program.line()).last().unwrap();
    assert_eq!(last, (n_lines + 501).to_string(), "each line is acknowledged");
    // Who comes later asks.
    let ask = |key: &str| {
        let replies = session.get(key).wait().unwrap();
        let reply = replies.recv_timeout(PATIENCE).unwrap().expect("a reply");
        String::from_utf8(reply.result().unwrap().payload().to_bytes().to_vec()).unwrap()
    };
    assert_eq!(ask("site/cam/status"), status("running"));
    let tokens = session.liveliness().get("site/cam/alive").wait().unwrap();
    assert!(tokens.recv_timeout(PATIENCE).unwrap().is_some_and(|reply| reply.result().is_ok()), "it is alive");
    // The run ends without a word.
    drop(program.input.take());
    let (key, _, gone) = next();
    let gone: Value = serde_json::from_str(&gone).unwrap();
    assert_eq!((key.as_str(), &gone["state"], &gone["source"]), ("site/cam/status", &"gone".into(), &"cam".into()));
    assert!(program.child.wait().unwrap().success());
    let _ = std::fs::remove_file(file);
}

#[test]
fn a_peer_that_is_killed_and_comes_back_gets_what_waited() {
    let (file, config) = alone();
    let port = port();
    let mut program =
        Program::boresight_zenoh(&["site/cam", "--connect", &endpoint(port), "--config", &config, "--acknowledge"]);
    // Nobody is there: it waits.
    (0..100).for_each(|k| program.put(&event(k)));
    assert!(
        program.lines.recv_timeout(Duration::from_secs(1)).is_err(),
        "nothing is acknowledged that nobody can hear"
    );
    let listener = Program::listener(port);
    let heard = |listener: &Program| -> u64 {
        let line = listener.line();
        serde_json::from_str::<Value>(line.strip_prefix("site/cam ").unwrap()).unwrap()["k"].as_u64().unwrap()
    };
    (0..100).for_each(|k| assert_eq!(heard(&listener), k));
    (0..100).for_each(|k| assert_eq!(program.line(), (k + 1).to_string()));
    drop(listener);
    // Lines go on coming while it is away: those that were on their way when it was killed are lost, then they wait.
    let mut put = 100;
    let end = Instant::now() + PATIENCE;
    loop {
        program.put(&event(put));
        put += 1;
        if program.lines.recv_timeout(Duration::from_millis(50)).is_err() {
            break;
        }
        assert!(Instant::now() < end, "it never notices");
    }
    let n_lost = put - 1 - 100;
    (put..put + 100).for_each(|k| program.put(&event(k)));
    let listener = Program::listener(port);
    let first = heard(&listener);
    assert!(first < put, "the line that waited comes: {first} of {put}");
    (first + 1..put + 100).for_each(|k| assert_eq!(heard(&listener), k, "without a hole"));
    // Loopback says that a peer is gone at once; a few lines of 50 ms each at most.
    assert!(n_lost < 20, "{n_lost}");
    let _ = std::fs::remove_file(file);
}

#[test]
fn cbor_says_what_json_says() {
    let (file, config) = alone();
    let port = port();
    let mut program =
        Program::boresight_zenoh(&["site/cam", "--listen", &endpoint(port), "--config", &config, "--cbor"]);
    let session = connected(port);
    let subscriber = session.declare_subscriber("site/cam").wait().unwrap();
    let end = Instant::now() + PATIENCE;
    let sample = loop {
        program.put(&event(7));
        if let Ok(Some(sample)) = subscriber.recv_timeout(Duration::from_millis(100)) {
            break sample;
        }
        assert!(Instant::now() < end, "nothing comes");
    };
    assert_eq!(sample.encoding().to_string(), "application/cbor");
    let value: Value = ciborium::from_reader(&*sample.payload().to_bytes()).unwrap();
    assert_eq!(value, serde_json::from_str::<Value>(&event(7)).unwrap());
    let _ = std::fs::remove_file(file);
}

#[test]
fn what_cannot_be_is_said() {
    for (args, why) in [
        (&["site/*"][..], "is no key"),
        (&["a", "--connect", "nonsense"], "error: "),
        (&["a", "--config", "gone.json5"], "gone.json5 cannot be read"),
    ] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_boresight-zenoh"));
        let out = command.args(args).stdin(Stdio::null()).output().unwrap();
        let said = String::from_utf8_lossy(&out.stderr);
        assert!(out.status.code() == Some(1) && said.contains(why), "{args:?}: {said}");
    }
}
