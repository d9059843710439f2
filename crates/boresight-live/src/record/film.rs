//! The pictures of a record: a fragmented MP4 beside each segment's tables, coded on a thread of its own that the run never waits for.
//!
//! Frames wait for the coder, eight or 64 MB of them; when these places are full a frame is left out of the video, counted and, the first time, said. What was handed to the file stays
//! readable after a kill at any moment: whole fragments of a second, each written at once; what a full disk cuts off is taken back to the last whole one.
//! Times in the file are those of the tables. 8-bit pixels are coded as they come, others with levels that follow the scene; sizes beyond the coder's are reduced.

use super::entry::{Filmed, path};
use crate::board::{Board, add};
use crate::eight_bits::EightBits;
use boresight::io::video::{MAX_SIZE, Mp4Fragments, Mp4Options};
use boresight::{Error, ErrorKind, Pixels, Result, Timestamp};
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Frames that wait for the coder, at most, and bytes that may wait where they are more: the first frames come at once when the configuration is chosen.
const WAITING: usize = 8;
const WAITING_BYTES: usize = 64 << 20;
/// Silence after which the fragment that is being made is written out.
const SILENCE: Duration = Duration::from_secs(1);
/// How long a file that cannot be written rests.
const REST: Duration = Duration::from_secs(10);

#[derive(Default)]
struct Shared {
    waiting: AtomicUsize,
    waiting_bytes: AtomicUsize,
    filmed: Mutex<BTreeMap<u64, Filmed>>,
}

impl Shared {
    fn note(&self, number: u64, f: impl FnOnce(&mut Filmed)) {
        f(self.filmed.lock().unwrap_or_else(PoisonError::into_inner).entry(number).or_default());
    }
}

fn bytes_of(pixels: &Pixels) -> usize {
    let bytes = match pixels {
        Pixels::Gray8(_) => 1,
        Pixels::Gray16(_) => 2,
        Pixels::Rgb8(_) => 3,
        Pixels::GrayF32(_) => 4,
    };
    pixels.width() * pixels.height() * bytes
}

struct Shot {
    number: u64,
    pixels: Pixels,
    time: Timestamp,
}

/// Takes the pictures of a record.
pub struct Film {
    shots: Option<Sender<Shot>>,
    shared: Arc<Shared>,
    board: Arc<Board>,
    has_said: bool,
    thread: Option<JoinHandle<()>>,
}

impl Film {
    /// Starts the thread, for segments in this folder.
    /// # Errors
    /// A system without threads.
    pub fn start(dir: &Path, board: Arc<Board>) -> Result<Self> {
        let (shots, from) = channel();
        let shared = Arc::new(Shared::default());
        let mut coder = Coder {
            dir: dir.to_path_buf(),
            shared: Arc::clone(&shared),
            board: Arc::clone(&board),
            eight: EightBits::at_most(MAX_SIZE.0, MAX_SIZE.1),
            open: None,
            rests_until: None,
            has_said: false,
            bytes: Vec::new(),
        };
        let thread = std::thread::Builder::new().name("live-film".into()).spawn(move || coder.run(&from));
        let thread = thread.map_err(|e| Error::new(ErrorKind::Output, "no thread can be started").because(e))?;
        Ok(Self { shots: Some(shots), shared, board, has_said: false, thread: Some(thread) })
    }

    /// Takes a frame of the segment with this number, if there is room.
    pub fn put(&mut self, number: u64, pixels: &Pixels, time: Timestamp) {
        // Only this thread adds.
        let bytes = bytes_of(pixels);
        let is_full = self.shared.waiting.load(Ordering::Acquire) >= WAITING;
        if is_full && self.shared.waiting_bytes.load(Ordering::Acquire) + bytes > WAITING_BYTES {
            self.shared.note(number, |filmed| filmed.left_out += 1);
            add(&self.board.counts.video_left_out, 1);
            if !std::mem::replace(&mut self.has_said, true) {
                let name = &self.board.source;
                self.board.say(&format!(
                    "warning: {name}: the video leaves out a frame, and others like it: coding is slower than the source"
                ));
            }
            return;
        }
        self.shared.waiting.fetch_add(1, Ordering::AcqRel);
        self.shared.waiting_bytes.fetch_add(bytes, Ordering::AcqRel);
        if let Some(shots) = &self.shots {
            // The thread takes until the sender is gone.
            let _ = shots.send(Shot { number, pixels: pixels.clone(), time });
        }
    }

    /// Frames that wait for the coder.
    #[cfg(test)]
    pub fn n_waiting(&self) -> usize {
        self.shared.waiting.load(Ordering::Acquire)
    }

    /// What became of a segment's pictures so far.
    pub fn of(&self, number: u64) -> Filmed {
        self.shared.filmed.lock().unwrap_or_else(PoisonError::into_inner).get(&number).copied().unwrap_or_default()
    }

    /// Forgets a segment whose files are removed.
    pub fn forget(&self, number: u64) {
        self.shared.filmed.lock().unwrap_or_else(PoisonError::into_inner).remove(&number);
    }

    /// Waits until what was taken is written: a few frames.
    pub fn finish(&mut self) {
        self.shots = None;
        if let Some(thread) = self.thread.take() {
            // One that broke off has written what it could.
            let _ = thread.join();
        }
    }
}

/// A file that is being written.
struct Open {
    number: u64,
    path: PathBuf,
    file: File,
    /// Bytes of whole fragments.
    whole: u64,
    frames: u64,
    made: Mp4Fragments,
}

struct Coder {
    dir: PathBuf,
    shared: Arc<Shared>,
    board: Arc<Board>,
    eight: EightBits,
    open: Option<Open>,
    rests_until: Option<Instant>,
    has_said: bool,
    bytes: Vec<u8>,
}

impl Coder {
    fn run(&mut self, shots: &Receiver<Shot>) {
        loop {
            match shots.recv_timeout(SILENCE) {
                Ok(shot) => {
                    let outcome = self.take(&shot);
                    self.shared.waiting.fetch_sub(1, Ordering::AcqRel);
                    self.shared.waiting_bytes.fetch_sub(bytes_of(&shot.pixels), Ordering::AcqRel);
                    if let Err(e) = outcome {
                        self.shared.note(shot.number, |filmed| filmed.left_out += 1);
                        add(&self.board.counts.video_left_out, 1);
                        self.say(&e);
                    }
                }
                Err(RecvTimeoutError::Timeout) => self.flush(),
                Err(RecvTimeoutError::Disconnected) => return self.flush(),
            }
        }
    }

    fn say(&mut self, e: &Error) {
        if !std::mem::replace(&mut self.has_said, true) {
            self.board.say(&format!("warning: {}: the video leaves out frames: {e}", self.board.source));
        }
    }

    fn take(&mut self, shot: &Shot) -> Result<()> {
        if self.rests_until.is_some_and(|until| Instant::now() < until) {
            return Err(Error::new(ErrorKind::Output, "the video rests: it could not be written"));
        }
        if self.open.as_ref().is_none_or(|open| open.number != shot.number) {
            self.flush();
            self.open = None;
            let outcome = self.create(shot.number);
            self.rests_until = outcome.is_err().then(|| Instant::now() + REST);
            self.open = Some(outcome?);
        }
        let (Some(open), Some(pixels)) = (&mut self.open, self.eight.of(&shot.pixels)) else { return Ok(()) };
        self.bytes.clear();
        let pushed = open.made.push(pixels, shot.time, &mut self.bytes);
        // A fragment that became whole is, whatever became of this frame.
        self.write();
        pushed
    }

    fn create(&self, number: u64) -> Result<Open> {
        let path = path(&self.dir, number, "mp4");
        let opened = OpenOptions::new().append(true).create_new(true).open(&path);
        let file =
            opened.map_err(|e| Error::new(ErrorKind::Output, "cannot be written").at(path.display()).because(e))?;
        Ok(Open { number, path, file, whole: 0, frames: 0, made: Mp4Fragments::new(Mp4Options::default()) })
    }

    /// Hands the fragment that is being made to the file.
    fn flush(&mut self) {
        let Some(open) = &mut self.open else { return };
        self.bytes.clear();
        match open.made.flush(&mut self.bytes) {
            Ok(()) => self.write(),
            Err(e) => self.say(&e),
        }
    }

    /// Writes what was handed out, by one write.
    fn write(&mut self) {
        let Some(open) = &mut self.open else { return };
        if self.bytes.is_empty() {
            return;
        }
        let frames = open.made.n_frames() - open.frames;
        open.frames += frames;
        let written = open.file.write_all(&self.bytes);
        let number = open.number;
        match written {
            Ok(()) => {
                open.whole += self.bytes.len() as u64;
                let bytes = self.bytes.len() as u64;
                self.shared.note(number, |filmed| {
                    (filmed.bytes, filmed.frames) = (filmed.bytes + bytes, filmed.frames + frames)
                });
                add(&self.board.counts.video_frames, frames);
            }
            Err(e) => {
                // No half fragment; a file without its head begins anew.
                let _ = open.file.set_len(open.whole);
                if open.whole == 0 {
                    open.made = Mp4Fragments::new(Mp4Options::default());
                    open.frames = 0;
                }
                self.rests_until = Some(Instant::now() + REST);
                self.shared.note(number, |filmed| filmed.left_out += frames);
                add(&self.board.counts.video_left_out, frames);
                let e = Error::new(ErrorKind::Output, "cannot be written").at(open.path.display()).because(e);
                self.say(&e);
            }
        }
    }
}
