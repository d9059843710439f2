//! The source is lost and comes back, or falls silent: tracks coast, and it is said.

mod common;

use boresight::{Error, ErrorKind, Result, SourceInfo};
use boresight_live::{Connect, Content, Feed, LiveOutput, Pauses, RunOptions, Target, publisher, run};
use common::{SceneFeed, Truth, board, collect_udp, config, scene};
use serde_json::Value;
use std::net::UdpSocket;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// A scene whose connection breaks after 60 frames, cannot be had twice, and goes on with stamps from 0.
struct Fragile(u32);

struct Part {
    feed: SceneFeed,
    left: u32,
    zero_ns: Option<i64>,
}

impl Connect for Fragile {
    fn connect(&mut self) -> Result<Box<dyn Feed>> {
        self.0 += 1;
        let refused = || Error::new(ErrorKind::NotFound, "no route to the camera");
        match self.0 {
            1 => {
                let source = scene(120, 50.0).build(boresight::sim::Seed::new(1)).unwrap();
                let feed = SceneFeed { source, truth: Truth::default(), clock: Some(Instant::now()) };
                Ok(Box::new(Part { feed, left: 60, zero_ns: None }))
            }
            2 | 3 => Err(refused()),
            4 => {
                // The same scene, further on.
                let mut source = scene(120, 50.0).build(boresight::sim::Seed::new(1)).unwrap();
                for _ in 0..60 {
                    boresight::FrameSource::next_frame(&mut source).unwrap();
                }
                let feed = SceneFeed { source, truth: Truth::default(), clock: None };
                Ok(Box::new(Part { feed, left: 60, zero_ns: Some(0) }))
            }
            _ => Err(Error::new(ErrorKind::NotFound, "over")),
        }
    }
    fn is_endless(&self) -> bool {
        true
    }
    fn newest_counts(&self) -> bool {
        false
    }
}

impl Feed for Part {
    fn next(&mut self) -> Result<Option<Content>> {
        if self.left == 0 {
            return Err(Error::new(ErrorKind::Damaged, "the connection broke"));
        }
        self.left -= 1;
        let Some(Content::Frame(mut frame)) = self.feed.next()? else { return Ok(None) };
        if let Some(zero) = &mut self.zero_ns {
            // A new connection counts from 0.
            frame.time.ns = *zero;
            *zero += 20_000_000;
        }
        Ok(Some(Content::Frame(frame)))
    }
    fn info(&self) -> Option<&SourceInfo> {
        self.feed.info()
    }
}

#[test]
fn a_source_that_comes_back_finds_its_tracks() {
    let board = board();
    let wire = UdpSocket::bind("127.0.0.1:0").unwrap();
    let target = Target::parse(&format!("udp://{}", wire.local_addr().unwrap())).unwrap();
    let mut outputs: Vec<Box<dyn LiveOutput>> = vec![publisher(&target, &board).unwrap()];
    let datagrams = std::thread::spawn(move || collect_udp(&wire));
    let pauses = Pauses { first: Duration::from_millis(20), longest: Duration::from_millis(50), ..Pauses::default() };
    let options = RunOptions { config: Some(config()), updates_hz: f64::INFINITY, pauses, ..RunOptions::default() };
    let counts = &board.counts;
    let enough = || counts.tracked.load(Ordering::SeqCst) >= 120;
    run(Box::new(Fragile(0)), &options, &board, &mut outputs, &enough).unwrap();
    let events: Vec<Value> = datagrams.join().unwrap().into_iter().map(|(_, v)| v).collect();
    let states: Vec<&str> = events.iter().filter_map(|e| e["state"].as_str()).collect();
    let first_lost = states.iter().position(|s| *s == "lost").expect("the loss is said");
    assert!(states[first_lost..].contains(&"running"), "{states:?}");
    assert!(events.iter().any(|e| e["why"].as_str().is_some_and(|w| w.contains("connecting again"))));
    assert!(counts.lost.load(Ordering::SeqCst) >= 1);
    let starts: Vec<u64> =
        events.iter().filter(|e| e["event"] == "start").map(|e| e["track"].as_u64().unwrap()).collect();
    assert_eq!(starts.len(), 2, "the same two tracks before and after");
    let times: Vec<f64> =
        events.iter().filter(|e| e["track"] == starts[0]).map(|e| e["time_s"].as_f64().unwrap()).collect();
    assert!(times.is_sorted() && *times.last().unwrap() > 2.0, "time goes on though the stamps began anew");
}

/// Gives 40 frames, then nothing until it is told to end.
struct Silent(SceneFeed, u32, Receiver<()>);

impl Feed for Silent {
    fn next(&mut self) -> Result<Option<Content>> {
        if self.1 == 0 {
            let _ = self.2.recv();
            return Ok(None);
        }
        self.1 -= 1;
        self.0.next()
    }
    fn info(&self) -> Option<&SourceInfo> {
        self.0.info()
    }
}

struct SilentPlug(Option<Silent>);

impl Connect for SilentPlug {
    fn connect(&mut self) -> Result<Box<dyn Feed>> {
        Ok(Box::new(self.0.take().expect("connected once")))
    }
    fn is_endless(&self) -> bool {
        false
    }
    fn newest_counts(&self) -> bool {
        true
    }
}

#[test]
fn tracks_of_a_silent_source_coast_and_end_by_their_budget() {
    let board = board();
    let wire = UdpSocket::bind("127.0.0.1:0").unwrap();
    let target = Target::parse(&format!("udp://{}", wire.local_addr().unwrap())).unwrap();
    let mut outputs: Vec<Box<dyn LiveOutput>> = vec![publisher(&target, &board).unwrap()];
    let (end, told) = channel();
    let datagrams = std::thread::spawn(move || {
        wire.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
        let (mut all, mut buffer) = (Vec::new(), vec![0; 65_536]);
        let mut n_ended = 0;
        // Only when both tracks have ended is the source let go: their end does not wait for it.
        while n_ended < 2 {
            let n = wire.recv(&mut buffer).expect("the tracks end while the source is silent");
            let event: Value = serde_json::from_slice(&buffer[..n]).unwrap();
            n_ended += u32::from(event["event"] == "end");
            all.push(event);
        }
        end.send(()).unwrap();
        all
    });
    let source = scene(60, 50.0).build(boresight::sim::Seed::new(1)).unwrap();
    let feed = SceneFeed { source, truth: Truth::default(), clock: Some(Instant::now()) };
    let options = RunOptions { config: Some(config()), updates_hz: f64::INFINITY, ..RunOptions::default() };
    let plug = SilentPlug(Some(Silent(feed, 40, told)));
    run(Box::new(plug), &options, &board, &mut outputs, &|| false).unwrap();
    let events = datagrams.join().unwrap();
    assert!(events.iter().any(|e| e["state"] == "lost" && e["why"] == "nothing comes"));
}
