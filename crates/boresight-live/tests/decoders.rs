//! Cursor on Target and ASTERIX as other people's packages read them: takproto, pytak, asterix-decoder, libasterix, pyasteryx; ignored where they are not
//! installed (`.ci/wire_readers` installs them; CONTRIBUTING.md).

mod common;

use boresight::Timestamp;
use boresight::world::{Bearing, Located, Place};
use boresight_live::{Board, Event, OnEarth, Target, TrackReport, What, When, publisher};
use common::daemon::port;
use libtest_mimic::{Arguments, Trial};
use nalgebra::{Matrix4, Vector2, Vector4};
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::net::UdpSocket;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Duration;

/// 24 November 2026, 03:44:52.123 UTC.
const UNIX_S: f64 = 1_795_491_892.123;

/// Where the packages are.
fn readers() -> PathBuf {
    let target = || {
        let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../../target");
        PathBuf::from(std::env::var_os("CARGO_TARGET_DIR").unwrap_or(beside.into()))
    };
    std::env::var_os("BORESIGHT_WIRE_READERS").map_or_else(|| target().join("wire_readers"), PathBuf::from)
}

fn python() -> Command {
    let own = readers().join("bin/python");
    let mut command = Command::new(if own.exists() { own } else { "python3".into() });
    command.arg(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/wire_readers.py")).env("WIRE_READERS", readers());
    command
}

fn has(reader: &str) -> bool {
    let checked = python().args(["check", reader]).stdout(Stdio::null()).stderr(Stdio::null()).status();
    checked.is_ok_and(|s| s.success())
}

/// What a reader says of bytes.
fn read_by(reader: &str, bytes: &[u8]) -> Vec<Value> {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("bytes");
    std::fs::write(&file, bytes).unwrap();
    let done = python().arg(reader).arg(&file).output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    serde_json::from_slice(&done.stdout).unwrap()
}

fn place(latitude_deg: f64, longitude_deg: f64, height_m: Option<f64>, velocity: [f64; 2]) -> Place {
    let cov = Matrix4::from_diagonal(&Vector4::new(9.0, 0.36, 25.0, 1.44));
    let velocity_m_per_s = Vector2::from(velocity);
    Place { latitude_deg, longitude_deg, height_m, height_sd_m: 4.0, velocity_m_per_s, cov }
}

/// A report of a track at a place.
fn report(track: u64, status: &'static str, place: Option<Place>) -> TrackReport {
    let bearing = Bearing { azimuth_deg: 271.25, elevation_deg: -3.5, azimuth_sd_deg: 0.25, elevation_sd_deg: 0.5 };
    TrackReport {
        track,
        status,
        x_px: 1.0,
        y_px: 2.0,
        vx_px_per_s: 0.0,
        vy_px_per_s: 0.0,
        cov: [1.0; 10],
        width_px: 3.0,
        height_px: 3.0,
        score: 1.0,
        nis: None,
        on_earth: OnEarth(Located { place, bearing: Some(bearing) }),
    }
}

fn event(what: What, track: u64, status: &'static str, place: Option<Place>) -> Event {
    let when = When { frame: 3, time: Timestamp::from_ns(1), arrived_unix_s: UNIX_S };
    Event::of_track(what, "north", when, &report(track, status, place))
}

/// Four events: in the north east, the south west at the end, at the date line without a height, coasting at a number beyond 16 bits.
fn events() -> Vec<(Event, Place)> {
    [
        (What::Start, 7, "confirmed", place(48.137154, 11.576124, Some(519.0), [12.3, -4.6])),
        (What::End, 8, "confirmed", place(-33.8568, -151.2153, Some(-12.5), [-250.0, 0.25])),
        (What::Start, 65_535, "confirmed", place(0.0, 179.99999, None, [0.0, 0.0])),
        (What::Update, 65_536 + 7, "coasting", place(-89.9, 0.0, Some(3000.0), [9e4, -9e4])),
    ]
    .map(|(what, track, status, place)| (event(what, track, status, Some(place)), place))
    .to_vec()
}

fn board() -> Arc<Board> {
    Arc::new(Board::new("north", |_| {}))
}

/// Sends events to a socket, and gives what came.
fn over_udp(url: impl Fn(u16) -> String, events: &[Event]) -> Vec<Vec<u8>> {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    let url = url(socket.local_addr().unwrap().port());
    let board = board();
    let mut output = publisher(&Target::parse(&url).unwrap(), &board).unwrap();
    let mut part = [0; 65_536];
    events
        .iter()
        .map(|event| {
            output.event(event);
            let n = socket.recv(&mut part).unwrap();
            part[..n].to_vec()
        })
        .collect()
}

fn number(of: &Value, key: &str) -> f64 {
    of[key].as_f64().unwrap_or_else(|| panic!("no {key} in {of}"))
}

fn near(a: f64, b: f64, most: f64) {
    assert!((a - b).abs() <= most, "{a} {b}");
}

fn asterix(reader: &str) {
    let events = events();
    let sent: Vec<Event> = events.iter().map(|e| e.0.clone()).collect();
    let bytes = over_udp(|port| format!("asterix+udp://127.0.0.1:{port}?sac=25&sic=201"), &sent).concat();
    let read = read_by(reader, &bytes);
    assert_eq!(read.len(), 4);
    // Units of the items, half of each: 180/2^25 degrees, 0.25 m/s, 6.25 ft, 1/128 s.
    let degree = 90.0 / f64::from(1 << 25) + 1e-12;
    for (r, (_, place)) in read.iter().zip(&events) {
        assert_eq!((r["sac"].as_u64(), r["sic"].as_u64()), (Some(25), Some(201)));
        near(number(r, "tod"), UNIX_S % 86_400.0, 0.5 / 128.0 + 1e-6);
        near(number(r, "lat"), place.latitude_deg, degree);
        near(number(r, "lon"), place.longitude_deg, degree);
        let v = place.velocity_m_per_s.map(|v| v.clamp(-8192.0, 8191.75));
        near(number(r, "vx"), v.x, 0.125);
        near(number(r, "vy"), v.y, 0.125);
        match place.height_m {
            Some(h) => near(number(r, "altitude_ft") * 0.3048, h, 0.96),
            None => assert!(r["altitude_ft"].is_null(), "{r}"),
        }
    }
    let numbers: Vec<_> = read.iter().map(|r| r["number"].as_u64().unwrap()).collect();
    assert_eq!(numbers, [7, 8, 65_535, 8], "65 543 is 7 modulo 65 536, which still lives; 8 has ended");
    let flags = |k: usize| ["MON", "CNF", "TSE", "TSB", "CST"].map(|f| read[k]["flags"][f].as_u64().unwrap());
    assert_eq!([flags(0), flags(1), flags(2)], [[1, 0, 0, 1, 0], [1, 0, 1, 1, 0], [1, 0, 0, 1, 0]]);
    assert_eq!(flags(3), [1, 0, 0, 1, 1]);
    if let Some(sds) = read[0]["sds"].as_array() {
        // 5 m north, 3 m east at 48.137 degrees: a degree is 111 195 m on a sphere, to half a percent.
        let sds: Vec<f64> = sds.iter().map(|v| v.as_f64().unwrap()).collect();
        near(sds[0] * 111_195.0, 5.0, 0.35);
        near(sds[1] * 111_195.0 * 48.137154f64.to_radians().cos(), 3.0, 0.35);
        near(sds[2] * 0.3048, 4.0, 0.96);
        near(sds[3], 0.6, 0.125);
        near(sds[4], 1.2, 0.125);
    }
}

/// Compares what a TAK program understood with what was meant.
fn check_cot(read: &[Value]) {
    for (r, (event, place)) in read.iter().zip(events()) {
        let track = event.track.unwrap();
        assert_eq!((r["type"].as_str(), r["how"].as_str()), (Some("a-u-G"), Some("m-i")));
        let uid = r["uid"].as_str().unwrap();
        assert!(uid.starts_with("boresight-") && uid.ends_with(&format!("-north-{}", track.report.track)), "{uid}");
        assert_eq!(r["callsign"].as_str(), Some(format!("north {}", track.report.track).as_str()));
        near(number(r, "lat"), place.latitude_deg, 1e-8);
        near(number(r, "lon"), place.longitude_deg, 1e-8);
        near(number(r, "hae"), place.height_m.unwrap_or(9_999_999.0), 1e-9);
        near(number(r, "ce"), 5.0, 1e-9);
        near(number(r, "le"), 4.0, 1e-9);
        near(number(r, "speed"), place.speed_m_per_s(), 0.006);
        near(number(r, "course"), place.course_deg(), 0.006);
        near(number(r, "start_ms"), UNIX_S * 1e3, 1.0);
        let stale = if track.what == What::End { 0.0 } else { 10_000.0 };
        near(number(r, "stale_ms") - number(r, "start_ms"), stale, 0.5);
    }
}

fn takproto_reads_each_event() {
    let mut sent: Vec<Event> = events().into_iter().map(|e| e.0).collect();
    let texts = over_udp(|port| format!("cot+udp://127.0.0.1:{port}"), &sent);
    let read = read_by("takproto", &texts.join(&0));
    assert_eq!(read.len(), 4);
    check_cot(&read);
    // A direction alone, from a camera that is known, by a name that is markup.
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let url = format!("cot+udp://{}", socket.local_addr().unwrap());
    let board = Arc::new(Board::new("a<b>&\"c\"", |_| {}));
    let mut output = publisher(&Target::parse(&url).unwrap(), &board).unwrap();
    let pose = "world.pinhole={focal-px=200, principal-point-px=[79.5, 59.5], latitude-deg=48.5, longitude-deg=-11.25, height-m=540, yaw-deg=45, pitch-deg=0}";
    output.configured(&common::config().with(pose).unwrap());
    sent = vec![event(What::Start, 9, "confirmed", None)];
    output.event(&sent[0]);
    let mut part = [0; 65_536];
    let n = socket.recv(&mut part).unwrap();
    let read = read_by("takproto", &part[..n]);
    let r = &read[0];
    assert_eq!((r["type"].as_str(), r["callsign"].as_str()), (Some("b-m-p-s-p-loc"), Some("a<b>&\"c\" 9")));
    assert_eq!([number(r, "lat"), number(r, "lon"), number(r, "hae")], [48.5, -11.25, 540.0]);
    assert_eq!([number(r, "ce"), number(r, "le")], [9_999_999.0; 2]);
    let rest = r["rest"].as_str().unwrap();
    for part in [
        "azimuth=\"271.250\"",
        "elevation=\"-3.500\"",
        "fov=\"1.500\"",
        "vfov=\"3.000\"",
        "range of the target is not known",
    ] {
        assert!(rest.contains(part), "{part} in {rest}");
    }
}

fn pytak_takes_the_events_from_a_connection() {
    let port = port();
    let command = &mut python();
    let mut child = command.args(["pytak", &port.to_string(), "4"]).stdout(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    assert_eq!(lines.next().unwrap().unwrap(), "listening");
    let board = board();
    let mut output = publisher(&Target::parse(&format!("cot+tcp://127.0.0.1:{port}")).unwrap(), &board).unwrap();
    events().iter().for_each(|(event, _)| output.event(event));
    output.finish();
    let read: Vec<Value> = serde_json::from_str(&lines.next().expect("an answer").unwrap()).unwrap();
    assert!(child.wait().unwrap().success());
    assert_eq!(read.len(), 4);
    check_cot(&read);
}

fn main() -> std::process::ExitCode {
    let tests: [(&str, &str, fn()); 5] = [
        ("takproto", "takproto_reads_each_event", takproto_reads_each_event),
        ("pytak", "pytak_takes_the_events_from_a_connection", pytak_takes_the_events_from_a_connection),
        ("asterix-decoder", "asterix_decoder_reads_each_track", || asterix("asterix-decoder")),
        ("libasterix", "libasterix_reads_each_track", || asterix("libasterix")),
        ("pyasteryx", "pyasteryx_reads_each_track", || asterix("pyasteryx")),
    ];
    let trials = tests.map(|(reader, name, run)| {
        let trial = Trial::test(name, move || {
            run();
            Ok(())
        });
        if has(reader) { trial } else { trial.with_kind(format!("needs {reader}")).with_ignored_flag(true) }
    });
    libtest_mimic::run(&Arguments::from_args(), trials.into()).exit_code()
}
