//! The reader's thread: connects, reads, stamps with the time of arrival, and connects again with growing pauses when the source is lost.

use super::feed::{Connect, Content};
use crate::board::{Board, State, add};
use crate::slot::Slot;
use crate::timeline::Timeline;
use boresight::{Error, ErrorKind, FrameIndex, Result, SourceInfo, Timestamp};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

/// What came, with its time and the time of its arrival.
#[derive(Debug)]
pub struct Arrived {
    /// Frame or scan; its time is the run's.
    pub content: Content,
    /// What is known of the frames.
    pub info: Option<Arc<SourceInfo>>,
    /// When it arrived.
    pub at: Instant,
    /// The same by the system's clock.
    pub wall: SystemTime,
}

/// Attempts to connect: the pauses between them, each twice the one before, and whether there is a second where the first failed.
#[derive(Clone, Copy, Debug)]
pub struct Pauses {
    /// The first.
    pub first: Duration,
    /// The longest.
    pub longest: Duration,
    /// Whether an endless source that was never there is tried again, as one that was lost; else it is an error.
    pub from_the_start: bool,
}

impl Default for Pauses {
    fn default() -> Self {
        Self { first: Duration::from_millis(250), longest: Duration::from_secs(30), from_the_start: false }
    }
}

/// Starts the thread. It ends with a source that ends, or when the slot is closed; its error is that of a first connection that failed, or of
/// a source that cannot be connected again.
/// # Errors
/// A system without threads.
pub fn start(
    connect: Box<dyn Connect>,
    pauses: Pauses,
    slot: Arc<Slot<Arrived>>,
    board: Arc<Board>,
) -> Result<JoinHandle<Result<()>>> {
    let work = move || {
        let outcome =
            Reader { connect, slot: Arc::clone(&slot), board, line: Timeline::default(), n_read: 0 }.run(pauses);
        slot.close();
        outcome
    };
    let thread = std::thread::Builder::new().name("live-read".into()).spawn(work);
    thread.map_err(|e| Error::new(ErrorKind::NotFound, "no thread can be started").because(e))
}

struct Reader {
    connect: Box<dyn Connect>,
    slot: Arc<Slot<Arrived>>,
    board: Arc<Board>,
    line: Timeline,
    n_read: u64,
}

impl Reader {
    fn run(&mut self, pauses: Pauses) -> Result<()> {
        let mut pause = pauses.first;
        loop {
            let before = self.n_read;
            let outcome = self.read_to_end();
            if self.slot.is_closed() {
                return Ok(());
            }
            let why = match outcome {
                Ok(()) if !self.connect.is_endless() => return Ok(()),
                Ok(()) => "the stream ended".to_string(),
                // What never came once is named wrongly; a broken file does not mend.
                Err(e) if (self.n_read == 0 && !pauses.from_the_start) || !self.connect.is_endless() => return Err(e),
                Err(e) => e.to_string().lines().next().unwrap_or_default().to_string(),
            };
            if self.n_read > before {
                pause = pauses.first;
                add(&self.board.counts.lost, 1);
            }
            self.board.set(State::Lost, &format!("{why}; connecting again"));
            self.sleep(pause);
            pause = (pause * 2).min(pauses.longest);
        }
    }

    /// Sleeps in small steps, so that the end of the run is not waited for.
    fn sleep(&self, pause: Duration) {
        let until = Instant::now() + pause;
        while Instant::now() < until && !self.slot.is_closed() {
            std::thread::sleep(Duration::from_millis(20).min(until.saturating_duration_since(Instant::now())));
        }
    }

    fn read_to_end(&mut self) -> Result<()> {
        let mut feed = self.connect.connect()?;
        let newest_counts = self.connect.newest_counts();
        let info = feed.info().cloned().map(Arc::new);
        self.line.reconnected();
        let (mut n_bad, mut n_warnings) = (0, 0);
        loop {
            let next = feed.next();
            add(&self.board.counts.bad_lines, feed.bad_lines() - n_bad);
            n_bad = feed.bad_lines();
            for warning in feed.warnings().iter().skip(n_warnings) {
                self.board.say(&format!("warning: {}: {warning}", self.board.source));
            }
            n_warnings = feed.warnings().len();
            let Some(mut content) = next? else { return Ok(()) };
            let (at, wall) = (Instant::now(), SystemTime::now());
            let stamp = feed.has_stamps().then(|| content.stamp());
            let time = self.line.at_or_late(stamp, at, feed.late_ns());
            self.n_read += 1;
            self.board.counts.arrived.store(self.n_read, Ordering::Relaxed);
            let Some(time) = time else {
                self.board.too_late();
                continue;
            };
            restamp(&mut content, self.n_read - 1, time);
            let arrived = Arrived { content, info: info.clone(), at, wall };
            if self.slot.is_closed() {
                return Ok(());
            }
            if newest_counts {
                let older = self.slot.put(arrived);
                add(&self.board.counts.dropped, u64::from(older.is_some()));
            } else if !self.slot.put_waiting(arrived) {
                return Ok(());
            }
        }
    }
}

fn restamp(content: &mut Content, index: u64, time: Timestamp) {
    match content {
        Content::Frame(frame) => (frame.index, frame.time) = (FrameIndex(index), time),
        Content::Scan(scan) | Content::Adapted(scan, _) => (scan.index, scan.time) = (FrameIndex(index), time),
    }
}
