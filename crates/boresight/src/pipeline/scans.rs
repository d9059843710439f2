//! Frames with their detections, in order: made in the caller's thread, or ahead of it on others.
//!
//! Both ways run the same steps in the same order, so every byte is the same; ahead of the caller wait at most [`AHEAD`] scans. The threads are
//! not waited for when the caller leaves: the source may be asking a pipe that is silent, and ends when that answers.

use super::read_ahead::ReadAhead;
use crate::vision::Detector;
use crate::{Frame, FrameSource, Result, Scan};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Scans made ahead.
const AHEAD: usize = 2;

/// One frame with what was found in it.
pub(super) struct Made {
    pub frame: Frame,
    pub scan: Scan,
    /// Time it took to read (or wait for) and to detect.
    pub read: Duration,
    pub detect: Duration,
    /// The source's warnings, if there are new ones.
    pub warnings: Option<Vec<String>>,
}

/// Where scans come from.
pub(super) enum Scans {
    /// Made when asked for.
    Here(Here),
    /// Made ahead.
    Ahead(Ahead),
}

impl Scans {
    /// Takes a source and its detector; from two threads on they work ahead of the caller.
    pub fn of(source: Box<dyn FrameSource>, detector: Box<dyn Detector>, n_threads: usize) -> Self {
        if n_threads < 2 {
            return Self::Here(Here::new(source, detector));
        }
        let here = Here::new(ReadAhead::of(source), detector);
        let (out, made) = sync_channel(AHEAD);
        let (spare, spare_out) = sync_channel(AHEAD + 2);
        let thread = std::thread::Builder::new().name("boresight-detect".into());
        // Asked for in two steps, so that the work is still here if there is no thread.
        let (hand_over, taken) = sync_channel::<Here>(1);
        let work = move || {
            if let Ok(here) = taken.recv() {
                make_all(here, &out, &spare_out);
            }
        };
        match thread.spawn(work) {
            Ok(thread) => match hand_over.send(here) {
                Ok(()) => Self::Ahead(Ahead { made, spare, thread: Some(thread), last_warnings: None }),
                Err(back) => Self::Here(back.0),
            },
            Err(_) => Self::Here(here),
        }
    }

    /// The next frame and its scan; `None` at the end.
    /// # Errors
    /// What the source or the detector says, in its place.
    pub fn next(&mut self) -> Result<Option<Made>> {
        match self {
            Self::Here(here) => here.next(),
            Self::Ahead(ahead) => ahead.next(),
        }
    }

    /// Takes memory back.
    pub fn recycle(&mut self, made: Made) {
        match self {
            Self::Here(here) => here.recycle(made.frame, made.scan),
            Self::Ahead(ahead) => {
                // A full queue means that there is memory enough.
                let _ = ahead.spare.try_send((made.frame, made.scan));
            }
        }
    }

    /// Warnings that came with the end.
    pub fn last_warnings(&mut self) -> Option<Vec<String>> {
        match self {
            Self::Here(here) => here.new_warnings(),
            Self::Ahead(ahead) => ahead.last_warnings.take(),
        }
    }
}

/// A source and its detector.
pub(super) struct Here {
    source: Box<dyn FrameSource>,
    detector: Box<dyn Detector>,
    spare: Option<Scan>,
    n_warnings: usize,
}

impl Here {
    fn new(source: Box<dyn FrameSource>, detector: Box<dyn Detector>) -> Self {
        Self { source, detector, spare: None, n_warnings: 0 }
    }

    fn next(&mut self) -> Result<Option<Made>> {
        let started = Instant::now();
        let Some(frame) = self.source.next_frame()? else { return Ok(None) };
        let read = started.elapsed();
        let mut scan = self.spare.take().unwrap_or_default();
        self.detector.detect(&frame, &mut scan)?;
        Ok(Some(Made { frame, scan, read, detect: started.elapsed() - read, warnings: self.new_warnings() }))
    }

    fn new_warnings(&mut self) -> Option<Vec<String>> {
        let warnings = self.source.warnings();
        let more = warnings.len() > self.n_warnings;
        self.n_warnings = warnings.len();
        more.then(|| warnings.to_vec())
    }

    fn recycle(&mut self, frame: Frame, scan: Scan) {
        self.source.recycle(frame);
        self.spare = Some(scan);
    }
}

/// What the thread made last: nothing more, or an error; and warnings that came with it.
type Sent = (Result<Option<Made>>, Option<Vec<String>>);

/// The caller's end of the thread.
pub(super) struct Ahead {
    made: Receiver<Sent>,
    spare: SyncSender<(Frame, Scan)>,
    thread: Option<JoinHandle<()>>,
    last_warnings: Option<Vec<String>>,
}

impl Ahead {
    fn next(&mut self) -> Result<Option<Made>> {
        if let Ok((made, warnings)) = self.made.recv() {
            self.last_warnings = warnings;
            return made;
        }
        // It said no end: it panicked, and so does the caller.
        if let Some(Err(panic)) = self.thread.take().map(JoinHandle::join) {
            std::panic::resume_unwind(panic);
        }
        Ok(None)
    }
}

fn make_all(mut here: Here, out: &SyncSender<Sent>, spare: &Receiver<(Frame, Scan)>) {
    loop {
        spare.try_iter().for_each(|(frame, scan)| here.recycle(frame, scan));
        let made = here.next();
        let over = !matches!(made, Ok(Some(_)));
        let warnings = if over { here.new_warnings() } else { None };
        if out.send((made, warnings)).is_err() || over {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Error, ErrorKind, FrameIndex, Image, PixelKind, Pixels, SourceInfo, Timestamp};

    /// Gives `n` frames, a warning with the third, and an error at the end.
    struct Few {
        info: SourceInfo,
        at: u64,
        n: u64,
        warnings: Vec<String>,
    }

    impl FrameSource for Few {
        fn info(&self) -> &SourceInfo {
            &self.info
        }
        fn next_frame(&mut self) -> Result<Option<Frame>> {
            if self.at == self.n {
                self.warnings.push("at the end".into());
                return Err(Error::new(ErrorKind::Damaged, "over"));
            }
            if self.at == 2 {
                self.warnings.push("third".into());
            }
            self.at += 1;
            let pixels = Pixels::Gray8(Image::filled(2, 2, self.at as u8));
            Ok(Some(Frame { index: FrameIndex(self.at - 1), time: Timestamp::from_ns(self.at as i64), pixels }))
        }
        fn warnings(&self) -> &[String] {
            &self.warnings
        }
    }

    /// Panics at a frame.
    struct Copies(Option<u64>);

    impl Detector for Copies {
        fn detect(&mut self, frame: &Frame, scan: &mut Scan) -> Result<()> {
            assert_ne!(self.0, Some(frame.index.0), "as asked");
            *scan = Scan::at(frame.index, frame.time);
            Ok(())
        }
    }

    fn scans(n_threads: usize, panics_at: Option<u64>) -> Scans {
        let info = SourceInfo {
            label: String::new(),
            reader: String::new(),
            width: 2,
            height: 2,
            kind: PixelKind::Gray8,
            n_frames: None,
            rate_hz: None,
            true_times: true,
        };
        let source = Few { info, at: 0, n: 9, warnings: Vec::new() };
        Scans::of(Box::new(source), Box::new(Copies(panics_at)), n_threads)
    }

    #[test]
    fn frames_warnings_and_the_error_come_in_their_places_for_any_number_of_threads() {
        for n_threads in [1, 2, 8] {
            let mut scans = scans(n_threads, None);
            for k in 0..9 {
                let made = scans.next().unwrap().unwrap();
                assert_eq!((made.frame.index.0, made.scan.index.0), (k, k));
                assert_eq!(made.warnings, (k == 2).then(|| vec!["third".to_string()]), "{n_threads}");
                scans.recycle(made);
            }
            assert_eq!(scans.next().err().unwrap().to_string(), "over");
            assert_eq!(scans.last_warnings().unwrap(), ["third", "at the end"]);
        }
    }

    #[test]
    fn a_panic_on_a_thread_is_the_callers() {
        let caught = std::panic::catch_unwind(|| {
            let mut scans = scans(2, Some(3));
            while scans.next().unwrap().is_some() {}
        });
        assert!(caught.is_err());
    }
}
