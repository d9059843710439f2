//! A source on a thread of its own: the next frames are read while this one is worked on.
//!
//! Frames come in order and unchanged, an error in its place; at most [`AHEAD`] wait. The thread is not waited for when the reader leaves: it
//! may be asking a pipe that is silent, and ends when that answers.

use crate::{Frame, FrameSource, Result, SourceInfo};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

/// Frames read ahead.
const AHEAD: usize = 2;
/// Frames that wait to be used again.
const SPARE: usize = AHEAD + 4;

/// What the source gave, and its warnings if there are new ones.
struct Read {
    frame: Result<Option<Frame>>,
    warnings: Option<Vec<String>>,
}

/// The source.
pub(super) struct ReadAhead {
    info: SourceInfo,
    warnings: Vec<String>,
    frames: Option<Receiver<Read>>,
    spare: SyncSender<Frame>,
    thread: Option<JoinHandle<()>>,
}

impl ReadAhead {
    /// Puts a source on a thread, unless it has one of its own; where no thread can be had it stays as it is.
    pub fn of(source: Box<dyn FrameSource>) -> Box<dyn FrameSource> {
        if source.reads_ahead() {
            return source;
        }
        let (out, frames) = sync_channel(AHEAD);
        let (spare, spare_out) = sync_channel::<Frame>(SPARE);
        let (info, warnings) = (source.info().clone(), source.warnings().to_vec());
        let n_warnings = warnings.len();
        // Asked for in two steps, so that the source is still here if there is no thread.
        let (hand_over, taken) = sync_channel::<Box<dyn FrameSource>>(1);
        let work = move || {
            if let Ok(source) = taken.recv() {
                read_all(source, &out, &spare_out, n_warnings);
            }
        };
        let Ok(thread) = std::thread::Builder::new().name("boresight-read".into()).spawn(work) else { return source };
        match hand_over.send(source) {
            Ok(()) => Box::new(Self { info, warnings, frames: Some(frames), spare, thread: Some(thread) }),
            Err(back) => back.0,
        }
    }
}

fn read_all(mut source: Box<dyn FrameSource>, out: &SyncSender<Read>, spare: &Receiver<Frame>, mut n_warnings: usize) {
    loop {
        spare.try_iter().for_each(|frame| source.recycle(frame));
        let frame = source.next_frame();
        let over = !matches!(frame, Ok(Some(_)));
        let warnings = source.warnings();
        let warnings = (warnings.len() != n_warnings).then(|| warnings.to_vec());
        n_warnings = warnings.as_ref().map_or(n_warnings, Vec::len);
        if out.send(Read { frame, warnings }).is_err() || over {
            return;
        }
    }
}

impl FrameSource for ReadAhead {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next_frame(&mut self) -> Result<Option<Frame>> {
        let Some(frames) = &self.frames else { return Ok(None) };
        let Ok(read) = frames.recv() else {
            // It said no end: it panicked, and so does the reader.
            if let Some(Err(panic)) = self.thread.take().map(JoinHandle::join) {
                std::panic::resume_unwind(panic);
            }
            return Ok(None);
        };
        if let Some(warnings) = read.warnings {
            self.warnings = warnings;
        }
        if !matches!(read.frame, Ok(Some(_))) {
            self.frames = None;
        }
        read.frame
    }

    fn recycle(&mut self, frame: Frame) {
        // A full queue means that there is memory enough.
        let _ = self.spare.try_send(frame);
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }

    fn reads_ahead(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PixelKind;

    struct Panics(SourceInfo);

    impl FrameSource for Panics {
        fn info(&self) -> &SourceInfo {
            &self.0
        }
        fn next_frame(&mut self) -> Result<Option<Frame>> {
            panic!("as asked");
        }
    }

    #[test]
    fn a_panic_of_the_source_is_the_readers_and_no_end() {
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
        let mut ahead = ReadAhead::of(Box::new(Panics(info)));
        assert!(std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| ahead.next_frame())).is_err());
    }
}
