//! Where the results of a run go, and what is counted of them.

use super::summary::Summary;
use crate::{Error, Sink, TrackState, TrackStatus, View};
use std::collections::BTreeSet;
use std::ops::ControlFlow;

/// The sinks that can still be written, and why others could not.
pub(super) struct Outputs<'s> {
    pub sinks: Vec<Box<dyn Sink + 's>>,
    pub unwritten: Vec<Error>,
}

impl Outputs<'_> {
    /// Shows a view to every sink; one that fails is dropped unfinished. Breaks when the last one is gone.
    pub fn put(&mut self, view: &View<'_>) -> ControlFlow<()> {
        let before = self.sinks.len();
        self.sinks.retain_mut(|sink| match sink.put(view) {
            Ok(()) => true,
            Err(e) => {
                self.unwritten.push(e);
                false
            }
        });
        if before > 0 && self.sinks.is_empty() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// Finishes the sinks, each whatever became of the others; or drops them.
    pub fn end(mut self, finish: bool) -> Vec<Error> {
        if finish {
            self.unwritten.extend(self.sinks.into_iter().filter_map(|sink| sink.finish().err()));
        }
        self.unwritten
    }
}

/// What is counted of the tracks of all scans.
#[derive(Default)]
pub(super) struct Counts {
    confirmed: BTreeSet<u64>,
    nis_sum: f64,
    nis_n: u64,
    /// Scans that the tracker refused, and why the first.
    pub refused: Option<(u64, Error)>,
}

impl Counts {
    /// Counts the tracks of one scan.
    pub fn add(&mut self, tracks: &[TrackState], summary: &mut Summary) {
        let mut now = 0;
        for t in tracks.iter().filter(|t| t.status != TrackStatus::Tentative) {
            now += 1;
            self.confirmed.insert(t.id.0);
            if let Some(i) = &t.innovation {
                self.nis_sum += i.nis;
                self.nis_n += 1;
            }
        }
        summary.most_at_once = summary.most_at_once.max(now);
    }

    pub fn into_summary(self, summary: &mut Summary) {
        summary.confirmed_tracks = self.confirmed.len() as u64;
        summary.mean_nis = (self.nis_n > 0).then(|| (self.nis_sum / self.nis_n as f64, self.nis_n));
    }
}
