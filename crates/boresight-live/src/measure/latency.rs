//! Latency from the capture of a frame to its tracks on the wire, measured from the outside: the frame carries its time, and a socket listens.

use super::camera::{CameraPlug, View};
use crate::board::{Board, read};
use crate::cbor::Form;
use crate::output::LiveOutput;
use crate::publish::Udp;
use crate::run::{RunOptions, run};
use boresight::{Config, Error, ErrorKind, Result};
use std::net::UdpSocket;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Frames a second.
const RATE_HZ: f64 = 30.0;
/// The first seconds do not count: tracks are confirmed, memory is taken.
const SETTLES_S: f64 = 2.0;

/// What was measured of one stream.
#[derive(Clone, Debug, PartialEq)]
pub struct Latency {
    /// Frames that the camera made, and those whose tracks arrived.
    pub frames: [u64; 2],
    /// Frames that were dropped for newer ones.
    pub dropped: u64,
    /// Half of the frames' tracks arrived within this time, and 99 % of them, s.
    pub p50_s: f64,
    /// See `p50_s`.
    pub p99_s: f64,
    /// The longest.
    pub longest_s: f64,
}

/// Runs that many streams of 1280 x 720 at 30 frames/s at once, each with its tracker, for that many seconds, with this configuration or the
/// one that is chosen for them.
/// # Errors
/// A system without sockets or threads; a stream whose tracks never arrived.
pub fn latency(n_streams: usize, seconds: f64, config: Option<Config>) -> Result<Vec<Latency>> {
    let config = config.map_or_else(chosen, Ok)?;
    let streams: Vec<_> = (0..n_streams.max(1))
        .map(|_| {
            let config = config.clone();
            std::thread::spawn(move || one(seconds, config))
        })
        .collect();
    let broken = || Error::new(ErrorKind::Numeric, "a measured stream broke off");
    streams.into_iter().map(|s| s.join().unwrap_or_else(|_| Err(broken()))).collect()
}

/// The view of the camera.
fn view(n_frames: u64) -> View {
    View { size_px: [1280, 720], rate_hz: RATE_HZ, n_frames, n_targets: 6, seen_s: f64::INFINITY }
}

/// The configuration that is chosen for it, beforehand: looking is no part of the latency.
fn chosen() -> Result<Config> {
    let board = Arc::new(Board::new("simulated", |_| {}));
    run(Box::new(CameraPlug(view(60), None)), &RunOptions::default(), &board, &mut [], &|| false)?;
    Config::from_toml(&board.configuration().0, "chosen")
}

fn one(seconds: f64, config: Config) -> Result<Latency> {
    let failed = |e: std::io::Error| Error::new(ErrorKind::Output, "no socket can be had").because(e);
    let socket = UdpSocket::bind("127.0.0.1:0").map_err(failed)?;
    socket.set_read_timeout(Some(Duration::from_millis(100))).map_err(failed)?;
    let address = socket.local_addr().map_err(failed)?;
    let over = Arc::new(AtomicBool::new(false));
    let started = Instant::now();
    let ends = Arc::clone(&over);
    let listener = std::thread::spawn(move || listen(&socket, started, &ends));

    let n_frames = ((seconds + SETTLES_S) * RATE_HZ) as u64;
    let board = Arc::new(Board::new("simulated", |_| {}));
    let mut outputs: Vec<Box<dyn LiveOutput>> = vec![Box::new(Udp::open(&address.to_string(), Form::Json)?)];
    let options = RunOptions { updates_hz: f64::INFINITY, config: Some(config), ..RunOptions::default() };
    let outcome = run(Box::new(CameraPlug(view(n_frames), Some(started))), &options, &board, &mut outputs, &|| false);
    over.store(true, Ordering::SeqCst);
    let mut seen = listener.join().unwrap_or_default();
    outcome?;
    seen.retain(|(time_s, _)| *time_s > SETTLES_S);
    let mut late: Vec<f64> = seen.iter().map(|(_, late)| *late).collect();
    late.sort_by(f64::total_cmp);
    let at = |share: f64| late.get(((late.len() as f64 * share) as usize).min(late.len().saturating_sub(1))).copied();
    let (Some(p50_s), Some(p99_s), Some(&longest_s)) = (at(0.5), at(0.99), late.last()) else {
        return Err(Error::new(ErrorKind::Numeric, "no tracks arrived").hint("measure for longer: --seconds 20"));
    };
    let frames = [n_frames, late.len() as u64];
    Ok(Latency { frames, dropped: read(&board.counts.dropped), p50_s, p99_s, longest_s })
}

/// Time of each frame whose tracks arrived, and how late the last of its events was, s.
fn listen(socket: &UdpSocket, started: Instant, over: &AtomicBool) -> Vec<(f64, f64)> {
    let mut seen: Vec<(f64, f64)> = Vec::new();
    let mut buffer = vec![0; 65_536];
    while !over.load(Ordering::SeqCst) {
        let Ok(n) = socket.recv(&mut buffer) else { continue };
        let now_s = started.elapsed().as_secs_f64();
        let Ok(event) = serde_json::from_slice::<serde_json::Value>(&buffer[..n]) else { continue };
        if event["event"] != "update" {
            continue;
        }
        let Some(time_s) = event["time_s"].as_f64() else { continue };
        match seen.last_mut() {
            Some((last, late)) if *last == time_s => *late = now_s - time_s,
            _ => seen.push((time_s, now_s - time_s)),
        }
    }
    seen
}
