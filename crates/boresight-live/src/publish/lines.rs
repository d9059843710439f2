//! Events as JSON lines on standard output, or to anything that takes bytes: a reader that stands still loses lines, and holds up nobody.

use crate::event::Event;
use crate::output::{LiveOutput, Shown};
use crate::queue::Queue;
use boresight::{Error, ErrorKind, Result};
use std::io::Write;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Lines that wait for a slow reader.
const WAITING: usize = 4096;
/// How long the end waits for the reader.
const LAST_WORDS: Duration = Duration::from_secs(2);

/// Events as lines.
pub struct Lines {
    queue: Arc<Queue<Event>>,
    thread: Option<JoinHandle<()>>,
}

impl Lines {
    /// Starts the thread that writes.
    /// # Errors
    /// A system without threads.
    pub fn start(mut out: impl Write + Send + 'static) -> Result<Self> {
        let queue = Arc::new(Queue::<Event>::new(WAITING));
        let from = Arc::clone(&queue);
        let write = move || {
            let mut line = String::new();
            while let Ok(event) = from.pop(Duration::from_secs(3600)) {
                let Some(event) = event else { continue };
                line.clear();
                line.push_str(&event.json);
                line.push('\n');
                // A reader that has gone takes no more; the run goes on for the others.
                if out.write_all(line.as_bytes()).and_then(|()| out.flush()).is_err() {
                    return;
                }
            }
        };
        let thread = std::thread::Builder::new().name("live-lines".into()).spawn(write);
        let thread = thread.map_err(|e| Error::new(ErrorKind::Output, "no thread can be started").because(e))?;
        Ok(Self { queue, thread: Some(thread) })
    }
}

impl LiveOutput for Lines {
    fn put(&mut self, shown: &Shown<'_>) -> Result<()> {
        shown.events.iter().for_each(|event| self.event(event));
        Ok(())
    }

    fn event(&mut self, event: &Event) {
        self.queue.push(event.clone());
    }

    fn finish(&mut self) {
        self.queue.close();
        let until = Instant::now() + LAST_WORDS;
        while self.thread.as_ref().is_some_and(|t| !t.is_finished()) && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(2));
        }
        self.thread = None;
    }

    fn dropped(&self) -> u64 {
        self.queue.dropped()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Read, pipe};

    #[test]
    fn a_reader_that_stands_still_loses_lines_and_holds_up_nobody() {
        let (mut read, write) = pipe().unwrap();
        let mut lines = Lines::start(write).unwrap();
        let long: Arc<str> = "x".repeat(1000).into();
        // More than a pipe and the queue hold together: this ends only if nobody is waited for.
        (0..WAITING + 1000).for_each(|_| lines.event(&Event::line(false, Arc::clone(&long))));
        assert!(lines.dropped() > 0);
        let reader = std::thread::spawn(move || {
            let mut text = String::new();
            read.read_to_string(&mut text).unwrap();
            text.lines().all(|l| l.len() == 1000)
        });
        lines.finish();
        assert!(reader.join().unwrap(), "what comes is whole lines");
    }
}
