//! Events to a NATS server: each at least once while there is a connection, without waiting for anybody.
//!
//! Tracks go to SUBJECT, the state of the run to `SUBJECT.status`. The server takes what it gets in order, so the answer to a PING behind a batch of events says that it
//! has them all; a batch that is not answered when the connection breaks is sent again first. A server that is away is connected again with growing pauses; up to
//! [`WAITING`] events wait for it, older ones go and are counted.
//! Source: the client protocol of NATS, docs.nats.io/reference/reference-protocols/nats-protocol.
//! Why not `async-nats` 0.51: it says of no event whether the server has it, waits for room when its buffer is full, and brings 48 crates more.
//! Limits: no TLS, no JetStream, one server (not its cluster); NATS itself has neither last will nor retained messages.

use super::address::Broker;
use super::connection::{again_and_again, open};
use super::last_words::wait_for;
use crate::board::Board;
use crate::event::Event;
use crate::output::{LiveOutput, Shown};
use crate::queue::{Closed, Queue};
use boresight::{Error, ErrorKind, Result};
use serde::Deserialize;
use std::collections::VecDeque;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Events that wait for a server that is away.
const WAITING: usize = 4096;
/// Events sent before their arrival is asked for.
const BATCH: usize = 256;
/// How long an answer may take; after as long without events one is asked for, so that a dead connection is noticed.
const ANSWER: Duration = Duration::from_secs(5);
/// How long the end waits for the server.
const LAST_WORDS: Duration = Duration::from_secs(2);
/// Longest line of the server that is read, bytes.
const MAX_LINE: u64 = 1 << 20;

struct Shared {
    queue: Queue<Event>,
    /// Events that the server would not take.
    refused: AtomicU64,
    abandoned: AtomicBool,
}

/// Events to a NATS server.
pub struct Nats {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Nats {
    /// Starts the thread that connects; a server that is not there yet is waited for by it alone.
    /// # Errors
    /// A system without threads.
    pub fn start(broker: &Broker, board: Arc<Board>) -> Result<Self> {
        let (queue, refused) = (Queue::new(WAITING), AtomicU64::new(0));
        let shared = Arc::new(Shared { queue, refused, abandoned: AtomicBool::new(false) });
        let (here, broker) = (Arc::clone(&shared), broker.clone());
        let thread = std::thread::Builder::new().name("live-nats".into()).spawn(move || work(&here, &broker, &board));
        let thread = thread.map_err(|e| Error::new(ErrorKind::Output, "no thread can be started").because(e))?;
        Ok(Self { shared, thread: Some(thread) })
    }
}

/// Connects again and again until everything is said.
fn work(shared: &Shared, broker: &Broker, board: &Board) {
    let mut unanswered = VecDeque::new();
    again_and_again(&format!("{broker:?}"), WAITING, board, &shared.abandoned, |stands| {
        let mut connection = Connection::open(broker, board)?;
        stands();
        connection.serve(shared, &mut unanswered)
    });
}

/// What a server says of itself.
#[derive(Deserialize)]
struct Info {
    #[serde(default = "usual_payload")]
    max_payload: usize,
    #[serde(default)]
    tls_required: bool,
}

/// What servers take where they say nothing else, bytes.
fn usual_payload() -> usize {
    1 << 20
}

struct Connection<'b> {
    reader: BufReader<TcpStream>,
    writer: TcpStream,
    broker: &'b Broker,
    board: &'b Board,
    max_payload: usize,
    text: Vec<u8>,
    n_denied: u64,
}

fn refusal(why: impl Into<String>) -> io::Error {
    io::Error::other(why.into())
}

impl<'b> Connection<'b> {
    fn open(broker: &'b Broker, board: &'b Board) -> io::Result<Self> {
        let stream = open((broker.host.as_str(), broker.port), ANSWER)?;
        stream.set_read_timeout(Some(ANSWER))?;
        let (reader, writer) = (BufReader::new(stream.try_clone()?), stream);
        let mut new =
            Self { reader, writer, broker, board, max_payload: usual_payload(), text: Vec::new(), n_denied: 0 };
        let line = new.line()?;
        let Some(info) = line.strip_prefix("INFO ") else { return Err(refusal("this is no NATS server")) };
        let info: Info =
            serde_json::from_str(info).map_err(|e| refusal(format!("its greeting cannot be read: {e}")))?;
        if info.tls_required {
            return Err(refusal(
                "it demands TLS, which is not spoken here: use a server on this machine that passes on",
            ));
        }
        new.max_payload = info.max_payload;
        let name = format!("boresight {}", board.source);
        let mut hello = serde_json::json!({
            "verbose": false, "pedantic": false, "lang": "rust", "version": env!("CARGO_PKG_VERSION"), "name": name,
        });
        match &broker.user {
            Some((token, password)) if password.is_empty() => hello["auth_token"] = token.as_str().into(),
            Some((user, password)) => {
                (hello["user"], hello["pass"]) = (user.as_str().into(), password.as_str().into());
            }
            None => {}
        }
        new.text.extend(format!("CONNECT {hello}\r\n").bytes());
        new.settle()?;
        Ok(new)
    }

    fn line(&mut self) -> io::Result<String> {
        let mut line = Vec::new();
        self.reader.by_ref().take(MAX_LINE).read_until(b'\n', &mut line)?;
        if line.last() != Some(&b'\n') {
            return Err(refusal("the server has closed the connection"));
        }
        Ok(String::from_utf8_lossy(&line).trim_end().to_string())
    }

    /// Sends what is written so far, and waits until the server says that it has taken it.
    fn settle(&mut self) -> io::Result<()> {
        self.text.extend(b"PING\r\n");
        self.writer.write_all(&self.text)?;
        self.text.clear();
        let until = Instant::now() + ANSWER;
        while Instant::now() < until {
            let line = self.line()?;
            match line.split(' ').next().unwrap_or_default() {
                "PONG" => return Ok(()),
                "PING" => self.writer.write_all(b"PONG\r\n")?,
                "-ERR" if line.contains("Permissions Violation") => {
                    // The connection stands: what may not be published is lost, said once and counted.
                    self.n_denied += 1;
                    if self.n_denied == 1 {
                        self.board.say(&format!("warning: {:?}: the server answers {line}", self.broker));
                    }
                }
                "-ERR" => return Err(refusal(format!("the server answers {line}"))),
                // News of the server's cluster, an acknowledgement that nobody asked for.
                _ => {}
            }
        }
        Err(refusal("no answer"))
    }

    /// Sends events until there are no more; those that the server did not confirm stay in `unanswered`.
    fn serve(&mut self, shared: &Shared, unanswered: &mut VecDeque<Event>) -> io::Result<()> {
        loop {
            if unanswered.is_empty() {
                match shared.queue.pop(ANSWER) {
                    Err(Closed) => return Ok(()),
                    Ok(event) => unanswered.extend(event),
                }
            }
            while unanswered.len() < BATCH
                && let Some(event) = shared.queue.try_pop()
            {
                unanswered.push_back(event);
            }
            for event in &*unanswered {
                let payload = &*self.broker.form.bytes(&event.json);
                if payload.len() > self.max_payload {
                    shared.refused.fetch_add(1, Ordering::Relaxed);
                    continue;
                }
                let end = if event.is_status { ".status" } else { "" };
                let head = format!("PUB {}{end} {}\r\n", self.broker.topic, payload.len());
                [head.as_bytes(), payload, b"\r\n"].iter().for_each(|part| self.text.extend_from_slice(part));
            }
            let before = self.n_denied;
            self.settle()?;
            shared.refused.fetch_add(self.n_denied - before, Ordering::Relaxed);
            unanswered.clear();
            if shared.abandoned.load(Ordering::SeqCst) {
                return Ok(());
            }
        }
    }
}

impl LiveOutput for Nats {
    fn put(&mut self, shown: &Shown<'_>) -> Result<()> {
        shown.events.iter().for_each(|event| self.event(event));
        Ok(())
    }

    fn event(&mut self, event: &Event) {
        self.shared.queue.push(event.clone());
    }

    fn finish(&mut self) {
        self.shared.queue.close();
        wait_for(&mut self.thread, LAST_WORDS);
    }

    fn dropped(&self) -> u64 {
        self.shared.queue.dropped() + self.shared.refused.load(Ordering::Relaxed)
    }
}

impl Drop for Nats {
    /// Nobody waits any more for what the server did not take.
    fn drop(&mut self) {
        self.shared.abandoned.store(true, Ordering::SeqCst);
        self.shared.queue.close();
    }
}
