//! What the `ffmpeg` program says on its error stream, drained all the time so that it never blocks.
//!
//! With `-loglevel level+info` every line carries its level in brackets: errors are counted and the last few kept, the
//! input's stream line gives the nominal rate.

use crate::{Error, ErrorKind};
use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read};
use std::process::ChildStderr;
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::JoinHandle;

/// Lines kept from the start (they describe the input) and errors kept from the end.
const KEEP_FIRST: usize = 200;
const KEEP_ERRORS: usize = 8;
/// Longest line that is kept, bytes.
const MAX_LINE: u64 = 4096;

#[derive(Debug, Default)]
struct Lines {
    first: Vec<String>,
    errors: VecDeque<String>,
    n_errors: u64,
}

/// The messages of one run.
pub(super) struct Log {
    lines: Arc<Mutex<Lines>>,
    thread: Option<JoinHandle<()>>,
}

impl Log {
    /// Starts to drain.
    pub fn drain(stderr: ChildStderr) -> Self {
        let lines = Arc::new(Mutex::new(Lines::default()));
        let shared = Arc::clone(&lines);
        let work = move || {
            let mut reader = BufReader::new(stderr);
            let mut line = Vec::new();
            loop {
                line.clear();
                match reader.by_ref().take(MAX_LINE).read_until(b'\n', &mut line) {
                    Ok(0) | Err(_) => return,
                    Ok(_) => lock(&shared).add(String::from_utf8_lossy(&line).trim_end()),
                }
            }
        };
        let thread = std::thread::Builder::new().name("boresight-ffmpeg-log".into()).spawn(work).ok();
        Self { lines, thread }
    }

    /// Waits for the last line; to be called when the program has ended.
    pub fn wait(&mut self) {
        if let Some(thread) = self.thread.take() {
            // It only reads; should it have panicked, the lines so far are what there is.
            let _ = thread.join();
        }
    }

    /// Whether one of the kept lines holds `text`.
    pub fn has(&self, text: &str) -> bool {
        let lines = lock(&self.lines);
        lines.first.iter().chain(&lines.errors).any(|l| l.contains(text))
    }

    /// Number of errors, and the last of them.
    pub fn errors(&self) -> (u64, Option<String>) {
        let lines = lock(&self.lines);
        (lines.n_errors, lines.errors.back().cloned())
    }

    /// The nominal rate of the input, frames/s.
    pub fn rate_hz(&self) -> Option<f64> {
        lock(&self.lines).first.iter().find_map(|l| rate_of(l))
    }

    /// The error for an input that gave no frame.
    pub fn failure(&self, why: &str) -> Error {
        let lines = lock(&self.lines);
        let text = lines.errors.iter().cloned().collect::<Vec<_>>().join("; ");
        let any = |words: &[&str]| words.iter().any(|w| text.contains(w));
        let (kind, hint) = if any(&["No such file", "No such device", "refused", "timed out", "not found", "resolve"]) {
            (ErrorKind::NotFound, "is the address right and the camera on? try it with `ffplay`")
        } else if any(&["Permission denied", "Device or resource busy"]) {
            (ErrorKind::NotFound, "may this user read it, and is no other program using it?")
        } else if any(&["Stream map", "matches no streams"]) {
            (ErrorKind::Unsupported, "it holds no video")
        } else if any(&["Decoder", "decoder", "not supported"]) {
            (ErrorKind::Unsupported, "an ffmpeg with more decoders may read it")
        } else {
            (
                ErrorKind::Damaged,
                "try to play it with `ffplay`, or copy it again; of frames without a header say the layout: --set 'input.raw={width=640, height=512, pixel=\"u16-le\"}'",
            )
        };
        let what = if text.is_empty() {
            format!("ffmpeg cannot read it: {why}")
        } else {
            format!("ffmpeg cannot read it: {text}")
        };
        Error::new(kind, what).hint(hint)
    }
}

impl Lines {
    fn add(&mut self, line: &str) {
        if line.is_empty() {
            return;
        }
        let error = ["[error]", "[fatal]", "[panic]"].iter().find_map(|l| line.split_once(l));
        if let Some((_, text)) = error {
            self.n_errors += 1;
            if self.errors.len() == KEEP_ERRORS {
                self.errors.pop_front();
            }
            self.errors.push_back(text.trim().to_string());
        }
        if self.first.len() < KEEP_FIRST {
            self.first.push(line.to_string());
        }
    }
}

fn lock(lines: &Mutex<Lines>) -> MutexGuard<'_, Lines> {
    lines.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

/// Reads `Stream #0:0: Video: ..., 10 fps, ...`.
fn rate_of(line: &str) -> Option<f64> {
    if !line.contains("Stream #") || !line.contains(": Video:") {
        return None;
    }
    let number = line.split(" fps").next().filter(|head| head.len() < line.len())?.rsplit([' ', ',']).next()?;
    let (digits, scale) = number.strip_suffix('k').map_or((number, 1.0), |d| (d, 1000.0));
    digits.parse::<f64>().ok().map(|r| r * scale).filter(|r| *r > 0.0 && r.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_is_read_from_the_streams_line() {
        let line =
            "[info]   Stream #0:0: Video: msmpeg4v3 (div3 / 0x33766964), yuv420p, 768x576, 816 kb/s, 10 fps, 10 tbr";
        assert_eq!(rate_of(line), Some(10.0));
        assert_eq!(rate_of("[info]   Stream #0:0: Audio: aac"), None);
        assert_eq!(rate_of("[info]   Stream #0:0: Video: h264, 29.97 fps, x"), Some(29.97));
    }

    #[test]
    fn errors_are_counted_and_the_last_ones_kept() {
        let mut lines = Lines::default();
        for i in 0..1000 {
            lines.add(&format!("[h264 @ 0x1] [error] broken {i}"));
        }
        assert_eq!((lines.n_errors, lines.errors.len(), lines.first.len()), (1000, KEEP_ERRORS, KEEP_FIRST));
        assert_eq!(lines.errors.back().unwrap(), "broken 999");
    }
}
