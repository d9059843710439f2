//! Detections by TCP: a server that is killed and comes back in the middle, clients that call, and what is sent to harm.

mod common;

use boresight::config::InputConfig;
use boresight_live::{Address, Board, LiveOutput, Pauses, RunOptions, Shown, run};
use common::{board, daemon::port};
use std::io::Write;
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

const PATIENCE: Duration = Duration::from_secs(30);

/// A target that goes right, a scan each 40 ms.
fn line(k: u32) -> String {
    let (time_s, x) = (0.04 * f64::from(k), 10.0 + 0.5 * f64::from(k));
    format!("{{\"time_s\":{time_s:.2},\"detections\":[{{\"x_px\":{x},\"y_px\":20,\"cov_px2\":[0.04,0,0.04]}}]}}\n")
}

/// Whether a scan was blind, and the confirmed tracks in it.
type Scans = Arc<Mutex<Vec<(bool, Vec<u64>)>>>;

struct Notes(Scans);

impl LiveOutput for Notes {
    fn put(&mut self, shown: &Shown<'_>) -> boresight::Result<()> {
        let tracks = shown.tracks.iter().map(|t| t.track).collect();
        self.0.lock().unwrap().push((shown.view.scan.blind, tracks));
        Ok(())
    }
}

/// A run that ends with its test.
struct Run {
    board: Arc<Board>,
    scans: Scans,
    over: Arc<AtomicBool>,
    thread: Option<std::thread::JoinHandle<boresight::Result<()>>>,
}

impl Run {
    fn start(source: &str) -> Self {
        let (board, scans, over) = (board(), Scans::default(), Arc::new(AtomicBool::new(false)));
        let connect = Box::new(Address::new(source, InputConfig::default(), false, false));
        let (there, notes, stop) = (Arc::clone(&board), Notes(Arc::clone(&scans)), Arc::clone(&over));
        let config = boresight::Config::from_toml("[tracker]\ncoast-s = 60.0\n", "test").unwrap();
        let pauses = Pauses { first: Duration::from_millis(20), ..Pauses::default() };
        let options = RunOptions { config: Some(config), pauses, ..RunOptions::default() };
        let thread = std::thread::spawn(move || {
            run(connect, &options, &there, &mut [Box::new(notes)], &|| stop.load(Ordering::SeqCst))
        });
        Self { board, scans, over, thread: Some(thread) }
    }

    fn until(&self, what: &str, is_so: impl Fn(&[(bool, Vec<u64>)]) -> bool) {
        let end = Instant::now() + PATIENCE;
        while !is_so(&self.scans.lock().unwrap()) {
            assert!(Instant::now() < end, "{what}: {:?}", self.board.said());
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    fn end(&mut self) {
        self.over.store(true, Ordering::SeqCst);
        self.thread.take().unwrap().join().unwrap().unwrap();
    }
}

fn seen(scans: &[(bool, Vec<u64>)]) -> usize {
    scans.iter().filter(|(blind, _)| !blind).count()
}

#[test]
fn a_server_that_is_killed_and_comes_back_finds_its_track_coasting() {
    let port = port();
    let server = TcpListener::bind(("127.0.0.1", port)).unwrap();
    let mut run = Run::start(&format!("tcp://127.0.0.1:{port}?detections"));
    let (mut stream, _) = server.accept().unwrap();
    (0..50).for_each(|k| stream.write_all(line(k).as_bytes()).unwrap());
    run.until("the first scans", |scans| seen(scans) == 50 && scans[49].1.len() == 1);
    // A line is cut in its middle.
    stream.write_all(&line(50).as_bytes()[..20]).unwrap();
    drop((stream, server));
    run.until("the track coasts", |scans| scans.last().is_some_and(|(blind, tracks)| *blind && tracks.len() == 1));
    let server = TcpListener::bind(("127.0.0.1", port)).unwrap();
    let (mut stream, _) = server.accept().unwrap();
    // It stood still meanwhile; the server counts from 0 again.
    for k in 0..25 {
        let again = line(49).replacen("1.96", &format!("{:.2}", 0.04 * f64::from(k)), 1);
        stream.write_all(again.as_bytes()).unwrap();
    }
    run.until("the rest", |scans| seen(scans) == 75);
    assert_eq!(run.board.counts.lost.load(Ordering::SeqCst), 1);
    assert_eq!(run.board.counts.bad_lines.load(Ordering::SeqCst), 1, "the line that was cut");
    assert_eq!(run.board.counts.dropped.load(Ordering::SeqCst), 0);
    run.end();
}

#[test]
fn a_client_that_calls_is_heard_and_takes_the_place_of_a_silent_one() {
    let port = port();
    let mut run = Run::start(&format!("tcp://127.0.0.1:{port}?detections&listen"));
    let call = || {
        let end = Instant::now() + PATIENCE;
        loop {
            match TcpStream::connect(("127.0.0.1", port)) {
                Ok(stream) => return stream,
                Err(e) => assert!(Instant::now() < end, "{e}"),
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    };
    let mut first = call();
    (0..10).for_each(|k| first.write_all(line(k).as_bytes()).unwrap());
    first.write_all(b"{\"time_s\":0.4,\"dete").unwrap();
    run.until("the first client", |scans| seen(scans) == 10);
    // It stays open and says nothing more, as one does whose cable was pulled.
    let mut second = call();
    (11..20).for_each(|k| second.write_all(line(k).as_bytes()).unwrap());
    run.until("the second client", |scans| seen(scans) == 19);
    assert_eq!(run.board.counts.bad_lines.load(Ordering::SeqCst), 1, "what the first had begun");
    drop(second);
    let mut third = call();
    third.write_all(b"no JSON\n[1]\n").unwrap();
    third.write_all(line(20).as_bytes()).unwrap();
    run.until("the third client", |scans| seen(scans) == 20);
    assert_eq!(run.board.counts.bad_lines.load(Ordering::SeqCst), 3);
    // The run ends while a client is connected and silent.
    run.end();
}

#[test]
fn a_line_without_end_is_left_out_and_the_next_is_read() {
    let port = port();
    let server = TcpListener::bind(("127.0.0.1", port)).unwrap();
    let mut run = Run::start(&format!("tcp://127.0.0.1:{port}?detections"));
    let (mut stream, _) = server.accept().unwrap();
    stream.write_all(line(0).as_bytes()).unwrap();
    let part = vec![b'['; 1 << 20];
    (0..9).for_each(|_| stream.write_all(&part).unwrap());
    stream.write_all(b"\n").unwrap();
    stream.write_all(line(1).as_bytes()).unwrap();
    run.until("the line behind it", |scans| seen(scans) == 2);
    assert_eq!(run.board.counts.bad_lines.load(Ordering::SeqCst), 1);
    run.end();
}

#[test]
fn a_server_that_is_not_there_at_the_start_is_an_error_in_words() {
    let mut run = Run::start(&format!("tcp://127.0.0.1:{}?detections", port()));
    let said = run.thread.take().unwrap().join().unwrap().unwrap_err().to_string();
    assert!(said.contains("does not answer") && said.contains("127.0.0.1"), "{said}");
}
