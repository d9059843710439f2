//! Frames with their detections, in order: made in the caller's thread, or ahead of it on others.
//!
//! Both ways run the same steps, so every byte is the same. Ahead of the caller one thread takes the frames in order (with what must see them so: a background that is learnt,
//! the camera's motion) and gives them in turn to the finders, one a thread, where what is found in a frame depends on no other; the caller takes them back in turn. With each
//! finder wait at most [`AHEAD`] frames on either side. The threads are not waited for when the caller leaves: the source may be asking a pipe that is silent, and ends when
//! that answers.

use super::finders::{AHEAD, Finder, Finders};
use super::made::Made;
use super::read_ahead::ReadAhead;
use crate::vision::Detector;
use crate::{Frame, FrameSource, Result, Scan};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::Instant;

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
        let finders = Finders::start(&*detector, n_threads);
        let here = Here::new(ReadAhead::of(source), detector);
        let Some((finders, ends)) = finders else { return Self::Here(here) };
        let n_spare = ends.len() * (2 * AHEAD + 1) + 1;
        let (spare, spare_out) = sync_channel(n_spare);
        let thread = std::thread::Builder::new().name("boresight-order".into());
        // Asked for in two steps, so that the work is still here if there is no thread.
        let (hand_over, taken) = sync_channel::<(Here, Finders)>(1);
        let work = move || {
            if let Ok((here, finders)) = taken.recv() {
                begin_all(here, finders, &spare_out);
            }
        };
        match thread.spawn(work) {
            Ok(thread) => match hand_over.send((here, finders)) {
                Ok(()) => {
                    Self::Ahead(Ahead { finders: ends, turn: 0, spare, thread: Some(thread), last_warnings: None })
                }
                Err(back) => Self::Here(back.0.0),
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
    pub fn recycle(&mut self, frame: Frame, scan: Scan) {
        match self {
            Self::Here(here) => here.recycle(frame, scan),
            Self::Ahead(ahead) => {
                // A full queue means that there is memory enough.
                let _ = ahead.spare.try_send((frame, scan));
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
    spare: Vec<Scan>,
    n_warnings: usize,
}

impl Here {
    fn new(source: Box<dyn FrameSource>, detector: Box<dyn Detector>) -> Self {
        Self { source, detector, spare: Vec::new(), n_warnings: 0 }
    }

    fn next(&mut self) -> Result<Option<Made>> {
        self.take(|detector, frame, scan| detector.detect(frame, scan).map(|()| true))
            .map(|made| made.map(|(made, _)| made))
    }

    /// The next frame with what must be done in order; whether that was all.
    fn begin(&mut self) -> Result<Option<(Made, bool)>> {
        self.take(|detector, frame, scan| detector.begin(frame, scan))
    }

    fn take(
        &mut self,
        work: impl FnOnce(&mut dyn Detector, &Frame, &mut Scan) -> Result<bool>,
    ) -> Result<Option<(Made, bool)>> {
        let started = Instant::now();
        let Some(frame) = self.source.next_frame()? else { return Ok(None) };
        let read = started.elapsed();
        let mut scan = self.spare.pop().unwrap_or_default();
        let done = work(&mut *self.detector, &frame, &mut scan)?;
        let detect = started.elapsed() - read;
        Ok(Some((Made { frame, scan, read, detect, warnings: self.new_warnings() }, done)))
    }

    fn new_warnings(&mut self) -> Option<Vec<String>> {
        let warnings = self.source.warnings();
        let more = warnings.len() > self.n_warnings;
        self.n_warnings = warnings.len();
        more.then(|| warnings.to_vec())
    }

    fn recycle(&mut self, frame: Frame, scan: Scan) {
        self.source.recycle(frame);
        self.spare.push(scan);
    }
}

/// The caller's end of the threads.
pub(super) struct Ahead {
    finders: Vec<Finder>,
    /// Whose scan is the next.
    turn: usize,
    spare: SyncSender<(Frame, Scan)>,
    thread: Option<JoinHandle<()>>,
    last_warnings: Option<Vec<String>>,
}

impl Ahead {
    fn next(&mut self) -> Result<Option<Made>> {
        let turn = self.turn;
        self.turn = (turn + 1) % self.finders.len();
        if let Ok((made, warnings)) = self.finders[turn].made.recv() {
            self.last_warnings = warnings;
            return made;
        }
        // It said no end: it panicked, or what gives it frames did, and so does the caller.
        for thread in [self.finders[turn].thread.take(), self.thread.take()] {
            if let Some(Err(panic)) = thread.map(JoinHandle::join) {
                std::panic::resume_unwind(panic);
            }
        }
        Ok(None)
    }
}

/// Takes every frame in order and gives them to the finders in turn.
fn begin_all(mut here: Here, finders: Finders, spare: &Receiver<(Frame, Scan)>) {
    for finder in finders.in_turn() {
        spare.try_iter().for_each(|(frame, scan)| here.recycle(frame, scan));
        let begun = here.begin();
        let over = !matches!(begun, Ok(Some(_)));
        let warnings = if over { here.new_warnings() } else { None };
        if finder.send((begun, warnings)).is_err() || over {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Error, ErrorKind, FrameIndex, Image, PixelKind, Pixels, SourceInfo, Timestamp};
    use std::time::Duration;

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

    fn source() -> Box<dyn FrameSource> {
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
        Box::new(Few { info, at: 0, n: 9, warnings: Vec::new() })
    }

    fn scans(n_threads: usize, panics_at: Option<u64>) -> Scans {
        Scans::of(source(), Box::new(Copies(panics_at)), n_threads)
    }

    #[test]
    fn frames_warnings_and_the_error_come_in_their_places_for_any_number_of_threads() {
        for n_threads in [1, 2, 8] {
            let mut scans = scans(n_threads, None);
            for k in 0..9 {
                let made = scans.next().unwrap().unwrap();
                assert_eq!((made.frame.index.0, made.scan.index.0), (k, k));
                assert_eq!(made.warnings, (k == 2).then(|| vec!["third".to_string()]), "{n_threads}");
                scans.recycle(made.frame, made.scan);
            }
            assert_eq!(scans.next().err().unwrap().to_string(), "over");
            assert_eq!(scans.last_warnings().unwrap(), ["third", "at the end"]);
        }
    }

    /// Finds frame by frame, the later ones of three sooner; refuses a frame.
    #[derive(Clone)]
    struct Alone {
        refuses: u64,
        in_order: bool,
        seen: u64,
    }

    impl Detector for Alone {
        fn detect(&mut self, frame: &Frame, scan: &mut Scan) -> Result<()> {
            if frame.index.0 == self.refuses {
                return Err(Error::new(ErrorKind::Damaged, "refused"));
            }
            std::thread::sleep(Duration::from_millis(3 - frame.index.0 % 3));
            let motion = scan.camera_motion;
            *scan = Scan::at(frame.index, frame.time);
            assert!(motion.is_none());
            Ok(())
        }
        fn begin(&mut self, frame: &Frame, scan: &mut Scan) -> Result<bool> {
            assert!(self.in_order && frame.index.0 == self.seen, "the first of all sees every frame in order");
            self.seen += 1;
            *scan = Scan::at(frame.index, frame.time);
            scan.camera_motion = Some(crate::CameraMotion::exact_shift(nalgebra::Vector2::zeros()));
            Ok(false)
        }
        fn twin(&self) -> Option<Box<dyn Detector>> {
            Some(Box::new(Self { in_order: false, ..*self }))
        }
    }

    #[test]
    fn frames_found_side_by_side_come_in_order_with_their_camera_motion() {
        for n_threads in [2, 3, 7] {
            let detector = Alone { refuses: 7, in_order: true, seen: 0 };
            let mut scans = Scans::of(source(), Box::new(detector), n_threads);
            for k in 0..7 {
                let made = scans.next().unwrap().unwrap();
                assert_eq!((made.frame.index.0, made.scan.index.0), (k, k));
                assert!(made.scan.camera_motion.is_some());
                scans.recycle(made.frame, made.scan);
            }
            assert_eq!(scans.next().err().unwrap().to_string(), "refused");
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
