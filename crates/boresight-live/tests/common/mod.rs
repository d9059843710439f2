//! What the tests share: scenes as streams, a client by hand.
#![allow(dead_code)]

pub mod daemon;

use boresight::sim::scene::{Background, Rectangle, SceneConfig, Shape, Target, White};
use boresight::sim::{SceneSource, Seed};
use boresight::{Config, FrameSource, Result, SourceInfo};
use boresight_live::{Board, Connect, Content, Feed};
use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// A mast 20 m above flat ground that looks half down to the north-east.
pub const POSE: &str = "world.pinhole={focal-px=200, principal-point-px=[79.5, 59.5], latitude-deg=48.137154, longitude-deg=11.576124, height-m=540, yaw-deg=45, pitch-deg=-40, pitch-sd-deg=0.5, ground-height-m=520}";

/// Two bright squares that cross a dark frame.
pub fn scene(n_frames: u64, rate_hz: f64) -> SceneConfig {
    let target = |start_px, velocity_px_per_s| Target {
        start_px,
        velocity_px_per_s,
        shape: Shape::Rectangle(Rectangle { size_px: [9, 9], mean: 150.0, std: 3.0 }),
        ..Target::default()
    };
    SceneConfig {
        width_px: 160,
        height_px: 120,
        n_frames,
        rate_hz,
        background: Background::White(White { mean: 50.0, std: 5.0 }),
        targets: vec![target([20.0, 30.0], [12.0, 4.0]), target([140.0, 90.0], [-9.0, -3.0])],
        ..SceneConfig::default()
    }
}

pub fn config() -> Config {
    // Every track has a number of its own, so that what begins and ends can be counted.
    let text = "[detector.threshold.band]\nlow = 120\nhigh = 180\n[detector.cluster]\nmin-area-px = 25\n[tracker]\ncoast-s = 0.6\nfield-px = [160, 120]\n\
                [tracker.reidentification]\nmax-gap-s = 0\n";
    Config::from_toml(text, "test").unwrap()
}

/// Truth of each frame by its time, ns: positions of the targets.
pub type Truth = Arc<Mutex<BTreeMap<i64, Vec<[f64; 2]>>>>;

pub struct SceneFeed {
    pub source: SceneSource,
    pub truth: Truth,
    pub clock: Option<Instant>,
}

impl Feed for SceneFeed {
    fn next(&mut self) -> Result<Option<Content>> {
        let Some(frame) = self.source.next_frame()? else { return Ok(None) };
        if let Some(clock) = self.clock {
            let due = clock + Duration::from_nanos(frame.time.ns as u64);
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
        }
        let places = self.source.truth().iter().map(|t| [t.position().x, t.position().y]).collect();
        self.truth.lock().unwrap().insert(frame.time.ns, places);
        Ok(Some(Content::Frame(frame)))
    }
    fn info(&self) -> Option<&SourceInfo> {
        Some(self.source.info())
    }
}

/// A scene as a stream: by the clock, or as fast as it is taken.
pub struct ScenePlug {
    pub scene: SceneConfig,
    pub truth: Truth,
    pub paced: bool,
    pub newest: bool,
}

impl ScenePlug {
    pub fn of(scene: SceneConfig, paced: bool) -> Self {
        Self { scene, truth: Truth::default(), paced, newest: false }
    }
}

impl Connect for ScenePlug {
    fn connect(&mut self) -> Result<Box<dyn Feed>> {
        let clock = self.paced.then(Instant::now);
        Ok(Box::new(SceneFeed { source: self.scene.build(Seed::new(1))?, truth: Arc::clone(&self.truth), clock }))
    }
    fn is_endless(&self) -> bool {
        false
    }
    fn newest_counts(&self) -> bool {
        self.newest
    }
}

pub fn board() -> Arc<Board> {
    Arc::new(Board::new("cam", |_| {}))
}

/// Asks and returns the code, the head and the beginning of the body that came with it or soon after.
pub fn ask(to: SocketAddr, request: &str) -> (u16, String, String) {
    let mut stream = TcpStream::connect(to).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    // A server that refuses may close before everything is written.
    let _ = stream.write_all(request.as_bytes());
    let mut text = Vec::new();
    let mut part = [0; 65_536];
    loop {
        let head_end = text.windows(4).position(|w| w == b"\r\n\r\n");
        if let Some(end) = head_end {
            let head = String::from_utf8_lossy(&text[..end]).into_owned();
            let length =
                head.lines().find_map(|l| l.to_ascii_lowercase().strip_prefix("content-length: ")?.parse().ok());
            if text.len() - end - 4 >= length.unwrap_or(0) {
                let code = head.split(' ').nth(1).and_then(|c| c.parse().ok()).unwrap_or(0);
                return (code, head, String::from_utf8_lossy(&text[end + 4..]).into_owned());
            }
        }
        match stream.read(&mut part) {
            Ok(0) | Err(_) => return (0, String::new(), String::new()),
            Ok(n) => text.extend_from_slice(&part[..n]),
        }
    }
}

pub fn get(to: SocketAddr, path: &str) -> (u16, String, String) {
    ask(to, &format!("GET {path} HTTP/1.1\r\nHost: {to}\r\nConnection: close\r\n\r\n"))
}

/// A viewer of the page.
pub struct Viewer(pub TcpStream);

impl Viewer {
    /// Enters; the code if it is refused.
    pub fn enter(to: SocketAddr, headers: &str) -> std::result::Result<Self, u16> {
        Self::enter_at(to, "/api/view", headers)
    }

    /// The same at another address, of one of several sources.
    pub fn enter_at(to: SocketAddr, path: &str, headers: &str) -> std::result::Result<Self, u16> {
        let mut stream = TcpStream::connect(to).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        let upgrade = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==";
        write!(stream, "GET {path} HTTP/1.1\r\nHost: {to}\r\n{upgrade}\r\n{headers}\r\n").unwrap();
        let mut head = Vec::new();
        let mut byte = [0];
        while !head.ends_with(b"\r\n\r\n") && stream.read(&mut byte).is_ok_and(|n| n == 1) {
            head.push(byte[0]);
        }
        let text = String::from_utf8_lossy(&head).into_owned();
        match text.split(' ').nth(1).and_then(|c| c.parse().ok()).unwrap_or(0) {
            101 => Ok(Self(stream)),
            code => Err(code),
        }
    }

    pub fn send(&mut self, text: &[u8]) {
        let mut frame = vec![0x81];
        match text.len() {
            n if n < 126 => frame.push(0x80 | n as u8),
            n => {
                frame.push(0x80 | 126);
                frame.extend((n as u16).to_be_bytes());
            }
        }
        // A mask of zeros leaves the text as it is.
        frame.extend([0; 4]);
        frame.extend(text);
        let _ = self.0.write_all(&frame);
    }

    /// The next message: the snapshot and the bytes of the picture; `None` when the server has closed.
    pub fn next(&mut self) -> Option<(serde_json::Value, Vec<u8>)> {
        loop {
            let mut head = [0; 2];
            self.0.read_exact(&mut head).ok()?;
            let n = match head[1] & 127 {
                126 => {
                    let mut n = [0; 2];
                    self.0.read_exact(&mut n).ok()?;
                    u64::from(u16::from_be_bytes(n))
                }
                127 => {
                    let mut n = [0; 8];
                    self.0.read_exact(&mut n).ok()?;
                    u64::from_be_bytes(n)
                }
                n => u64::from(n),
            };
            let mut body = vec![0; n as usize];
            self.0.read_exact(&mut body).ok()?;
            match head[0] & 15 {
                2 => {
                    let n = u32::from_be_bytes(body[..4].try_into().unwrap()) as usize;
                    return Some((serde_json::from_slice(&body[4..4 + n]).unwrap(), body[4 + n..].to_vec()));
                }
                8 => return None,
                _ => {}
            }
        }
    }
}

/// Datagrams as JSON until the run says that it ended; keeps the text beside.
pub fn collect_udp(socket: &std::net::UdpSocket) -> Vec<(String, serde_json::Value)> {
    socket.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
    let mut out = Vec::new();
    let mut buffer = vec![0; 65_536];
    loop {
        let n = socket.recv(&mut buffer).expect("an event within 30 s");
        let text = String::from_utf8(buffer[..n].to_vec()).unwrap();
        let value: serde_json::Value = serde_json::from_str(&text).unwrap();
        let over = value["state"] == "ended";
        out.push((text, value));
        if over {
            return out;
        }
    }
}
