//! Threads that find the detections of frames which were begun in order: each has a twin of the detector and takes its turn.
//!
//! Where what is found depends on the frames before, there is one thread, which hands on what was found when the frame was begun.

use super::made::{Begun, Made, Sent};
use crate::vision::Detector;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::Instant;

/// Most threads that find: so many keep up with a decoder whose frames take an eighth of the time that finding takes, and each holds some frames.
const MOST: usize = 8;

/// Frames that wait before a finder, and scans behind it.
pub(super) const AHEAD: usize = 1;

/// The ends at which frames are given.
pub(super) struct Finders(Vec<SyncSender<Begun>>);

/// The end at which one thread's scans are taken.
pub(super) struct Finder {
    pub made: Receiver<Sent>,
    pub thread: Option<JoinHandle<()>>,
}

impl Finders {
    /// Starts up to `n_threads`; `None` where no thread can be had.
    pub fn start(detector: &dyn Detector, n_threads: usize) -> Option<(Self, Vec<Finder>)> {
        let (mut given, mut finders) = (Vec::new(), Vec::new());
        for _ in 0..n_threads.clamp(1, MOST) {
            let twin = detector.twin();
            let alone = twin.is_none();
            let (give, begun) = sync_channel(AHEAD);
            let (out, made) = sync_channel(AHEAD);
            let work = move || find_all(twin, &begun, &out);
            let Ok(thread) = std::thread::Builder::new().name("boresight-detect".into()).spawn(work) else { break };
            given.push(give);
            finders.push(Finder { made, thread: Some(thread) });
            if alone {
                break;
            }
        }
        (!given.is_empty()).then_some((Self(given), finders))
    }

    /// The ends one after the other, without end.
    pub fn in_turn(&self) -> impl Iterator<Item = &SyncSender<Begun>> {
        self.0.iter().cycle()
    }
}

fn find_all(mut twin: Option<Box<dyn Detector>>, begun: &Receiver<Begun>, out: &SyncSender<Sent>) {
    for (begun, warnings) in begun {
        let made = begun.and_then(|begun| {
            let Some((mut made, done)) = begun else { return Ok(None) };
            if let Some(twin) = twin.as_mut().filter(|_| !done) {
                let started = Instant::now();
                let Made { frame, scan, .. } = &mut made;
                twin.finish(frame, scan)?;
                made.detect += started.elapsed();
            }
            Ok(Some(made))
        });
        let over = !matches!(made, Ok(Some(_)));
        if out.send((made, warnings)).is_err() || over {
            return;
        }
    }
}
