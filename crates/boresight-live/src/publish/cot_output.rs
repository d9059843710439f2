//! Cursor on Target to an address: a datagram an event, or one after the other over TCP, as TAK's servers take them.
//!
//! TCP: a server that is away is connected again with growing pauses; up to [`WAITING`] events wait for it, older ones go and are counted. What a server sends
//! of others is read and thrown away. Limits: no TLS; the protocol acknowledges nothing, so what a connection that breaks had not passed on is lost.

use super::connection::{again_and_again, open};
use super::cot::CotWriter;
use super::datagrams::Datagrams;
use super::earth_address::CotOptions;
use super::last_words::wait_for;
use super::unplaced::Unplaced;
use crate::board::Board;
use crate::event::Event;
use crate::output::{LiveOutput, Shown};
use crate::queue::{Closed, Queue};
use boresight::{Config, Error, ErrorKind, Result};
use std::io::{self, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// Events that wait for a server that is away: places are of little worth when they are old.
const WAITING: usize = 256;
/// How long the server may take to connect and to take bytes.
const ANSWER: Duration = Duration::from_secs(5);
/// After as long without events one looks whether the connection still stands.
const LOOK_AROUND: Duration = Duration::from_millis(200);
/// How long the end waits for the server.
const LAST_WORDS: Duration = Duration::from_secs(2);

enum Way {
    Udp(Datagrams),
    Tcp { shared: Arc<Shared>, thread: Option<JoinHandle<()>> },
}

struct Shared {
    queue: Queue<String>,
    abandoned: AtomicBool,
}

/// Events to one address.
pub struct Cot {
    writer: CotWriter,
    way: Way,
}

impl Cot {
    /// Datagrams.
    /// # Errors
    /// A name that is not known.
    pub fn udp(address: &str, options: &CotOptions, board: &Arc<Board>) -> Result<Self> {
        let shown = format!("cot+udp://{address}");
        let way = Way::Udp(Datagrams::open(address, &shown)?);
        Ok(Self { writer: writer(shown, options, board), way })
    }

    /// Starts the thread that connects; a server that is not there yet is waited for by it alone.
    /// # Errors
    /// A system without threads.
    pub fn tcp(address: &str, options: &CotOptions, board: &Arc<Board>) -> Result<Self> {
        let shown = format!("cot+tcp://{address}");
        let shared = Arc::new(Shared { queue: Queue::new(WAITING), abandoned: AtomicBool::new(false) });
        let (here, address, says, name) = (Arc::clone(&shared), address.to_string(), Arc::clone(board), shown.clone());
        let work = move || work(&here, &address, &name, &says);
        let thread = std::thread::Builder::new().name("live-cot".into()).spawn(work);
        let thread = thread.map_err(|e| Error::new(ErrorKind::Output, "no thread can be started").because(e))?;
        Ok(Self { writer: writer(shown, options, board), way: Way::Tcp { shared, thread: Some(thread) } })
    }
}

fn writer(shown: String, options: &CotOptions, board: &Arc<Board>) -> CotWriter {
    CotWriter::new(&board.source, options.clone(), Unplaced::new(Arc::clone(board), shown))
}

/// Connects again and again until everything is said.
fn work(shared: &Shared, address: &str, name: &str, board: &Board) {
    let mut unsent = None;
    again_and_again(name, WAITING, board, &shared.abandoned, |stands| {
        let stream = open(address, ANSWER)?;
        stands();
        serve(shared, stream, &mut unsent)
    });
}

/// Sends events until there are no more; the one that could not be sent stays in `unsent`.
fn serve(shared: &Shared, mut stream: TcpStream, unsent: &mut Option<String>) -> io::Result<()> {
    let (mut reads, over) = (stream.try_clone()?, Arc::new(AtomicBool::new(false)));
    let says = Arc::clone(&over);
    // It ends with the connection, which is closed below.
    std::thread::Builder::new().name("live-cot-read".into()).spawn(move || {
        let _ = io::copy(&mut reads, &mut io::sink());
        says.store(true, Ordering::SeqCst);
    })?;
    let outcome = loop {
        if over.load(Ordering::SeqCst) {
            break Err(io::Error::other("the server has closed the connection"));
        }
        if unsent.is_none() {
            match shared.queue.pop(LOOK_AROUND) {
                Err(Closed) => break Ok(()),
                Ok(event) => *unsent = event,
            }
        }
        if let Some(event) = unsent {
            if let Err(e) = stream.write_all(event.as_bytes()) {
                break Err(e);
            }
            *unsent = None;
        }
        if shared.abandoned.load(Ordering::SeqCst) {
            break Ok(());
        }
    };
    // What was written still goes out: only the reading thread is ended at once.
    let _ = stream.shutdown(if outcome.is_ok() { Shutdown::Write } else { Shutdown::Both });
    outcome
}

impl LiveOutput for Cot {
    fn configured(&mut self, config: &Config) {
        self.writer.configured(config);
    }

    fn put(&mut self, shown: &Shown<'_>) -> Result<()> {
        shown.events.iter().for_each(|event| self.event(event));
        Ok(())
    }

    fn event(&mut self, event: &Event) {
        let Some(xml) = event.track.as_deref().and_then(|track| self.writer.xml(track)) else { return };
        match &mut self.way {
            Way::Udp(datagrams) => datagrams.send(xml.as_bytes()),
            Way::Tcp { shared, .. } => shared.queue.push(xml),
        }
    }

    fn finish(&mut self) {
        if let Way::Tcp { shared, thread } = &mut self.way {
            shared.queue.close();
            wait_for(thread, LAST_WORDS);
            shared.abandoned.store(true, Ordering::SeqCst);
        }
    }

    fn dropped(&self) -> u64 {
        match &self.way {
            Way::Udp(datagrams) => datagrams.lost,
            Way::Tcp { shared, .. } => shared.queue.dropped(),
        }
    }
}

impl Drop for Cot {
    fn drop(&mut self) {
        if let Way::Tcp { shared, .. } = &self.way {
            shared.abandoned.store(true, Ordering::SeqCst);
        }
    }
}
