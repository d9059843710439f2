//! Detects in several frames at once, where what is found in one depends on no other.
//!
//! What must see the frames in their order (the camera's motion) runs beside, in the caller's thread; the scans are the same for any number of threads.

use super::Detector;
use crate::{Frame, Result, Scan};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Frames that are given to each thread at a time: enough that no thread waits long for the last one.
const FRAMES_EACH: usize = 4;

/// Twins of a detector, one for each thread; none where its frames must be seen in order.
pub(crate) struct AtOnce {
    twins: Vec<Box<dyn Detector>>,
}

impl AtOnce {
    /// Makes the twins.
    pub(crate) fn new(detector: &dyn Detector, n_threads: usize) -> Self {
        let n = if n_threads < 2 { 0 } else { n_threads };
        Self { twins: (0..n).map_while(|_| detector.twin()).collect() }
    }

    /// How many frames are best given at once.
    pub(crate) fn n_frames(&self) -> usize {
        (FRAMES_EACH * self.twins.len()).max(1)
    }

    /// Appends the scans of the frames, up to the first that is refused.
    /// # Errors
    /// Why it is refused.
    pub(crate) fn detect(
        &mut self,
        detector: &mut dyn Detector,
        frames: &[&Frame],
        scans: &mut Vec<Scan>,
    ) -> Result<()> {
        if self.twins.len() < 2 || frames.len() < 2 {
            for frame in frames {
                let mut scan = Scan::default();
                detector.detect(frame, &mut scan)?;
                scans.push(scan);
            }
            return Ok(());
        }
        let next = AtomicUsize::new(0);
        let mut found: Vec<Option<Result<Scan>>> = frames.iter().map(|_| None).collect();
        let begun: Vec<Result<(Scan, bool)>> = std::thread::scope(|scope| {
            let find = |twin| scope.spawn(|| find(twin, frames, &next));
            let workers: Vec<_> = self.twins.iter_mut().map(find).collect();
            let begun = frames.iter().map(|frame| {
                let mut scan = Scan::default();
                detector.begin(frame, &mut scan).map(|done| (scan, done))
            });
            let begun = begun.collect();
            for worker in workers {
                match worker.join() {
                    Ok(own) => own.into_iter().for_each(|(i, scan)| found[i] = Some(scan)),
                    Err(panic) => std::panic::resume_unwind(panic),
                }
            }
            begun
        });
        for (begun, found) in begun.into_iter().zip(found) {
            let (begun, done) = begun?;
            match found.filter(|_| !done) {
                Some(found) => scans.push(Scan { camera_motion: begun.camera_motion, ..found? }),
                None => scans.push(begun),
            }
        }
        Ok(())
    }
}

/// Finds in the next frame that no other thread has, until there is none.
fn find(twin: &mut Box<dyn Detector>, frames: &[&Frame], next: &AtomicUsize) -> Vec<(usize, Result<Scan>)> {
    let mut own = Vec::new();
    loop {
        let i = next.fetch_add(1, Ordering::Relaxed);
        let Some(frame) = frames.get(i) else { return own };
        let mut scan = Scan::default();
        own.push((i, twin.detect(frame, &mut scan).map(|()| scan)));
    }
}
