//! Places on Earth on the wire: a scene with a pose through the run to Cursor on Target and ASTERIX; a server that goes and comes; what has no place.

mod common;

use boresight_live::{Board, Event, LiveOutput, RunOptions, Shown, Target, TrackEvent, What, publisher, run};
use common::daemon::PATIENCE;
use common::{POSE, ScenePlug, board, config, scene};
use std::io::Read;
use std::net::{TcpListener, TcpStream, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Instant;

/// What the run gave to its outputs.
#[derive(Clone, Default)]
struct Heard(Arc<Mutex<Vec<Event>>>);

impl LiveOutput for Heard {
    fn put(&mut self, shown: &Shown<'_>) -> boresight::Result<()> {
        self.0.lock().unwrap().extend_from_slice(shown.events);
        Ok(())
    }
    fn event(&mut self, event: &Event) {
        self.0.lock().unwrap().push(event.clone());
    }
}

impl Heard {
    fn tracks(&self) -> Vec<Arc<TrackEvent>> {
        self.0.lock().unwrap().iter().filter_map(|e| e.track.clone()).collect()
    }
}

/// A socket that listens, and its port.
fn listener() -> (UdpSocket, u16) {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.set_read_timeout(Some(std::time::Duration::from_millis(300))).unwrap();
    let port = socket.local_addr().unwrap().port();
    (socket, port)
}

/// The next event of a connection; none where it ends.
fn next_event(mut stream: &TcpStream) -> Option<String> {
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    let mut text = Vec::new();
    let mut byte = [0];
    while !text.ends_with(b"</event>") {
        stream.read_exact(&mut byte).ok()?;
        text.extend(byte);
    }
    String::from_utf8(text).ok()
}

/// Everything that has come.
fn datagrams(socket: &UdpSocket) -> Vec<Vec<u8>> {
    let mut part = [0; 65_536];
    std::iter::from_fn(|| socket.recv(&mut part).ok().map(|n| part[..n].to_vec())).collect()
}

fn attribute(xml: &str, element: &str, name: &str) -> String {
    let within = xml.split(&format!("<{element} ")).nth(1).unwrap_or_else(|| panic!("no {element} in {xml}"));
    let within = within.split('>').next().unwrap();
    let rest = within.split(&format!("{name}=\"")).nth(1).unwrap_or_else(|| panic!("no {name} in {within}"));
    rest.split('"').next().unwrap().to_string()
}

fn number(xml: &str, element: &str, name: &str) -> f64 {
    attribute(xml, element, name).parse().unwrap()
}

/// Runs the scene with this pose; what was heard, the board's unplaced events, Cursor on Target, ASTERIX.
fn through(pose: &str) -> (Heard, u64, Vec<String>, Vec<Vec<u8>>) {
    let ((cot, cot_port), (asterix, asterix_port)) = (listener(), listener());
    let board = board();
    let open = |url: String| publisher(&Target::parse(&url).unwrap(), &board).unwrap();
    let heard = Heard::default();
    let mut outputs: Vec<Box<dyn LiveOutput>> = vec![
        Box::new(heard.clone()),
        open(format!("cot+udp://127.0.0.1:{cot_port}?type=a-n-G&stale=4")),
        open(format!("asterix+udp://127.0.0.1:{asterix_port}?sac=25&sic=7")),
    ];
    let options =
        RunOptions { config: Some(config()), sets: vec![pose.to_string()], updates_hz: 5.0, ..RunOptions::default() };
    let plug = Box::new(ScenePlug::of(scene(120, 20.0), false));
    run(plug, &options, &board, &mut outputs, &|| false).unwrap();
    let xml = datagrams(&cot).into_iter().map(|d| String::from_utf8(d).unwrap()).collect();
    (heard, board.counts.unplaced.load(Ordering::Relaxed), xml, datagrams(&asterix))
}

#[test]
fn each_event_of_a_placed_track_is_said_in_all_tongues() {
    let (heard, unplaced, xml, blocks) = through(POSE);
    let events = heard.tracks();
    assert!(events.len() > 20 && unplaced == 0, "{} {unplaced}", events.len());
    assert_eq!(xml.len(), events.len());
    let mut uids = std::collections::BTreeSet::new();
    for (xml, event) in xml.iter().zip(&events) {
        let place = event.report.on_earth.0.place.unwrap();
        assert!((number(xml, "point", "lat") - place.latitude_deg).abs() < 1e-8);
        assert!((number(xml, "point", "lon") - place.longitude_deg).abs() < 1e-8);
        assert_eq!((number(xml, "point", "hae"), number(xml, "point", "le")), (520.0, 9_999_999.0));
        assert!((number(xml, "point", "ce") - place.position_sd_m()).abs() < 0.006);
        assert!((number(xml, "track", "speed") - place.speed_m_per_s()).abs() < 0.006);
        assert_eq!(attribute(xml, "event", "type"), "a-n-G");
        let (start, stale) = (attribute(xml, "event", "start"), attribute(xml, "event", "stale"));
        assert_eq!(event.what == What::End, start == stale, "an end is stale at once: {xml}");
        let uid = attribute(xml, "event", "uid");
        assert!(uid.ends_with(&format!("-cam-{}", event.report.track)), "{uid}");
        uids.insert(uid);
        // The mast stands 20 m above the ground: whatever it sees lies within some 60 m.
        assert!((place.latitude_deg - 48.137154).abs() < 6e-4 && place.latitude_deg > 48.137154);
    }
    let n_tracks = events.iter().map(|e| e.report.track).collect::<std::collections::BTreeSet<_>>().len();
    assert_eq!(uids.len(), n_tracks, "a track keeps its uid");
    // The JSON line says the same.
    for event in heard.0.lock().unwrap().iter().filter(|e| e.track.is_some()) {
        let json: serde_json::Value = serde_json::from_str(&event.json).unwrap();
        let place = event.track.as_ref().unwrap().report.on_earth.0.place.unwrap();
        assert_eq!(json["lat_deg"].as_f64(), Some(place.latitude_deg));
        assert_eq!((json["hae_m"].as_f64(), json["cov_en"][7].as_f64()), (Some(520.0), Some(place.cov[(2, 2)])));
        assert!(json["bearing_deg"].as_f64().is_some_and(|b| b > 0.0 && b < 90.0), "{json}");
    }
    // What the octets mean is for the decoders of others (`decoders.rs`); here that each block is whole and says whose it is.
    assert!(!blocks.is_empty() && blocks.len() <= events.len());
    for block in &blocks {
        assert_eq!((block[0], usize::from(block[1]) << 8 | usize::from(block[2])), (62, block.len()));
        assert_eq!(block[7..9], [25, 7], "{block:?}");
    }
}

#[test]
fn without_a_ground_there_is_a_bearing_from_the_camera_and_no_place() {
    let (heard, unplaced, xml, blocks) = through(&POSE.replace(", ground-height-m=520", ""));
    let events = heard.tracks();
    assert!(blocks.is_empty() && unplaced == events.len() as u64, "each is counted: {unplaced} of {}", events.len());
    assert_eq!(xml.len(), events.len());
    for (xml, event) in xml.iter().zip(&events) {
        let bearing = event.report.on_earth.0.bearing.unwrap();
        assert!(event.report.on_earth.0.place.is_none());
        assert_eq!((number(xml, "point", "lat"), number(xml, "point", "lon")), (48.137154, 11.576124));
        assert_eq!((number(xml, "point", "hae"), number(xml, "point", "ce")), (540.0, 9_999_999.0));
        assert_eq!(attribute(xml, "event", "type"), "b-m-p-s-p-loc");
        assert!((number(xml, "sensor", "azimuth") - bearing.azimuth_deg).abs() < 6e-4);
        assert!((number(xml, "sensor", "vfov") - 6.0 * bearing.elevation_sd_deg).abs() < 6e-4);
        // The pose's own is 0.5; beside the axis a part of it turns the ray sideways.
        assert!(bearing.elevation_sd_deg > 0.4, "{bearing:?}");
        assert!(xml.contains("the range of the target is not known"), "{xml}");
    }
    let line = heard.0.lock().unwrap().iter().find(|e| e.track.is_some()).unwrap().json.to_string();
    assert!(line.contains("\"bearing_deg\":") && !line.contains("lat_deg"), "{line}");
}

#[test]
fn without_a_world_nothing_is_added_to_a_line() {
    let heard = Heard::default();
    let options = RunOptions { config: Some(config()), ..RunOptions::default() };
    let mut outputs: Vec<Box<dyn LiveOutput>> = vec![Box::new(heard.clone())];
    run(Box::new(ScenePlug::of(scene(60, 20.0), false)), &options, &board(), &mut outputs, &|| false).unwrap();
    let events = heard.0.lock().unwrap();
    assert!(events.iter().any(|e| e.track.is_some()));
    for word in ["_deg", "hae_m", "cov_en", "on_earth"] {
        assert!(events.iter().all(|e| !e.json.contains(word)), "{word}");
    }
}

#[test]
fn a_server_that_goes_and_comes_gets_the_events_that_waited() {
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = server.local_addr().unwrap();
    static IS_LOST: AtomicBool = AtomicBool::new(false);
    let say = |words: &str| IS_LOST.store(words.contains("events wait"), Ordering::SeqCst);
    let board = Arc::new(Board::new("cam", say));
    let mut cot = publisher(&Target::parse(&format!("cot+tcp://{address}")).unwrap(), &board).unwrap();
    let (heard, ..) = through(POSE);
    let events: Vec<Event> = heard.0.lock().unwrap().iter().filter(|e| e.track.is_some()).cloned().collect();
    let (first, _) = server.accept().unwrap();
    cot.event(&events[0]);
    assert!(next_event(&first).is_some());
    drop(first);
    drop(server);
    // Nobody is there: they wait.
    let until = Instant::now() + PATIENCE;
    while !IS_LOST.load(Ordering::SeqCst) {
        assert!(Instant::now() < until, "a connection that is closed is noticed");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    events[1..5].iter().for_each(|e| cot.event(e));
    let server = TcpListener::bind(address).unwrap();
    let (second, _) = server.accept().unwrap();
    let reader = std::thread::spawn(move || std::iter::from_fn(|| next_event(&second)).collect::<Vec<_>>());
    cot.finish();
    let came = reader.join().unwrap();
    assert_eq!(came.len(), 4);
    assert!(came.iter().all(|xml| xml.starts_with("<?xml") && xml.matches("<event ").count() == 1), "{came:?}");
    assert_eq!(cot.dropped(), 0);
}
