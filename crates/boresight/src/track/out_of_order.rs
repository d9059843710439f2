//! Scans that come late are taken at their own time: the tracker goes back to a state before them and takes them and all that came since in the order of their times.
//!
//! Source: our own; `Late::Replay` of `boresight_filters` for the whole tracker. A filter alone can retrodict a measurement (Bar-Shalom 2002, 2004), but which track a late
//! detection belongs to, whether it confirms one or begins one, is decided by all scans of that time. So the answer is that of the same scans in order, whatever filter and associator.
//! Method: copies of the tracker are kept, [`COPIES`] within `late_s`, and the scans since the oldest of them. A late scan is put in its place, the newest copy before it takes it
//! and all behind it. A track begun by the same detection of the same scan as before keeps its number; other new ones get numbers that nobody had.
//! Scans of one time are taken as they came. How the camera moved is unknown in a late scan: it stands on the ground of the scan before it.
//! Limits: without several hypotheses (`mht`). Cost: a copy of the tracker each `late_s` / [`COPIES`], the scans of `late_s`; a late scan costs a step for each scan behind it and
//! of one such part before it.

use super::parameters::TrackerParameters;
use super::tracking::Tracking;
use crate::{Error, ErrorKind, Result, Scan, Timestamp, TrackId, TrackState};
use std::collections::{BTreeMap, VecDeque};

/// Copies of the tracker within the time that a scan may be late: more cost memory, fewer cost steps.
const COPIES: i64 = 8;

/// What the tracker was given.
#[expect(clippy::large_enum_variant, reason = "nearly all are scans, and a box of each would be an allocation a scan")]
enum Given {
    Scan(Scan),
    Parameters(TrackerParameters),
}

struct Entry {
    /// Number of its arrival.
    arrival: u64,
    given: Given,
}

/// A copy of the tracker.
struct Saved {
    tracking: Box<dyn Tracking>,
    /// Time of its newest scan; none before the first.
    time: Option<Timestamp>,
    /// Entries of the log that it has taken.
    taken: usize,
}

/// The detection by which a track began: the arrival of its scan and its place there. Targets known before the first scan have no scan.
type Birth = (u64, u32);
/// Their arrival.
const NEVER: u64 = u64::MAX;

/// A tracker whose scans may come late.
pub struct OutOfOrder {
    inner: Box<dyn Tracking>,
    late_ns: i64,
    now: Option<Timestamp>,
    /// The oldest first.
    saved: VecDeque<Saved>,
    /// All since the oldest copy, in the order of time.
    log: VecDeque<Entry>,
    arrivals: u64,
    /// Numbers of the tracks that began by scans of the log.
    births: BTreeMap<Birth, TrackId>,
    /// Scans whose memory is used again.
    spare: Vec<Scan>,
}

opaque_debug!(OutOfOrder);

impl OutOfOrder {
    /// Lets scans come up to `late_s` seconds after one of a later time.
    pub fn new(inner: Box<dyn Tracking>, late_s: f64) -> Self {
        let late_ns = Timestamp::from_secs_f64(late_s).ns.max(0);
        let (saved, log, spare) = (VecDeque::new(), VecDeque::new(), Vec::new());
        Self { inner, late_ns, now: None, saved, log, arrivals: 0, births: BTreeMap::new(), spare }
    }

    fn log_scan(&mut self, at: usize, scan: &Scan) {
        let mut kept = self.spare.pop().unwrap_or_default();
        kept.detections.clone_from(&scan.detections);
        (kept.index, kept.time, kept.blind, kept.camera_motion) =
            (scan.index, scan.time, scan.blind, scan.camera_motion);
        self.log.insert(at, Entry { arrival: self.arrivals, given: Given::Scan(kept) });
        self.arrivals += 1;
    }

    /// Forgets what no late scan can ask for any more.
    fn forget(&mut self) {
        let Some(now) = self.now else { return };
        let oldest = now.ns.saturating_sub(self.late_ns);
        while self.saved.get(1).is_some_and(|s| s.time.is_some_and(|time| time.ns <= oldest)) {
            self.saved.pop_front();
        }
        let n = self.saved.front().map_or(0, |s| s.taken);
        if n == 0 {
            return;
        }
        self.saved.iter_mut().for_each(|s| s.taken -= n);
        for entry in self.log.drain(..n) {
            if let Given::Scan(scan) = entry.given {
                self.births.retain(|birth, _| birth.0 != entry.arrival);
                self.spare.push(scan);
            }
        }
    }

    /// Puts a late scan in its place and does again what lies behind it.
    fn redo(&mut self, scan: &Scan) -> Result<()> {
        let is_later = |e: &Entry| matches!(&e.given, Given::Scan(s) if s.time > scan.time);
        let place = self.log.iter().position(is_later).unwrap_or(self.log.len());
        let before = |s: &Saved| s.taken <= place;
        let from = self.saved.iter().rposition(before).unwrap_or(0);
        let saved = self.saved.get(from).and_then(|s| Some((s.tracking.twin()?, s.time, s.taken)));
        let (mut tracking, mut time, taken) = saved.ok_or_else(|| too_late(scan, self.late_ns))?;
        self.log_scan(place, scan);
        // What is known of the camera is how it moved since the scan before, which was another.
        if let Some(Entry { given: Given::Scan(late), .. }) = self.log.get_mut(place) {
            late.camera_motion = None;
        }
        tracking.renumber(self.inner.next_id(), &[]);
        let (mut again, mut births) = (Vec::new(), BTreeMap::new());
        for k in taken..self.log.len() {
            let outcome = match &self.log[k] {
                Entry { given: Given::Parameters(parameters), .. } => tracking.adapt(parameters).map(drop),
                Entry { given: Given::Scan(scan), arrival } => {
                    time = Some(scan.time);
                    step(&mut *tracking, scan, *arrival, &self.births, &mut births)
                }
            };
            if let Err(e) = outcome {
                // What it may have been: all stays as it was.
                self.log.remove(place);
                return Err(e);
            }
            let newest = again.last().map_or(self.saved[from].time, |s: &Saved| s.time);
            if let Some(copy) = self.copy_if_due(&*tracking, newest, time, k + 1) {
                again.push(copy);
            }
        }
        self.births.extend(births);
        self.saved.truncate(from + 1);
        self.saved.extend(again);
        self.inner = tracking;
        Ok(())
    }

    /// A copy of the tracker, if the newest is old enough.
    fn copy_if_due(
        &self,
        tracking: &dyn Tracking,
        newest: Option<Timestamp>,
        time: Option<Timestamp>,
        taken: usize,
    ) -> Option<Saved> {
        let age_ns = newest.zip(time).map(|(before, now)| now.ns.saturating_sub(before.ns));
        let is_due = age_ns.is_none_or(|age| age >= (self.late_ns / COPIES).max(1));
        is_due.then(|| tracking.twin()).flatten().map(|tracking| Saved { tracking, time, taken })
    }
}

fn too_late(scan: &Scan, late_ns: i64) -> Error {
    let what = format!("a scan of {} s comes more than {} s late", scan.time.as_secs_f64(), late_ns as f64 * 1e-9);
    Error::new(ErrorKind::Damaged, what).hint("input.late-s says how late a scan may come")
}

/// A step in which tracks that begin get the numbers that they had; `births` takes those of others.
fn step(
    tracking: &mut dyn Tracking,
    scan: &Scan,
    arrival: u64,
    before: &BTreeMap<Birth, TrackId>,
    births: &mut BTreeMap<Birth, TrackId>,
) -> Result<()> {
    let first_new = tracking.next_id();
    let states = tracking.step(scan)?;
    let mut renamed = Vec::new();
    for (birth, id) in born(states, first_new, arrival) {
        match before.get(&birth) {
            Some(had) if states.iter().all(|s| s.id != *had) => renamed.push((id, *had)),
            _ => drop(births.insert(birth, id)),
        }
    }
    tracking.renumber(first_new, &renamed);
    Ok(())
}

/// Tracks that began in a step, with the detections by which they did.
fn born(states: &[TrackState], first_new: TrackId, arrival: u64) -> impl Iterator<Item = (Birth, TrackId)> {
    let mut n_known = 0;
    states.iter().filter(move |s| s.id >= first_new).map(move |s| match s.detection {
        Some(j) => ((arrival, j), s.id),
        None => {
            n_known += 1;
            ((NEVER, n_known), s.id)
        }
    })
}

impl Tracking for OutOfOrder {
    /// Takes a scan in its place. Of a late one the tracks are those after the newest scan, and so are their detections.
    fn step(&mut self, scan: &Scan) -> Result<&[TrackState]> {
        if self.now.is_some_and(|now| scan.time < now) {
            if self.now.is_some_and(|now| now.ns.saturating_sub(scan.time.ns) > self.late_ns) {
                return Err(too_late(scan, self.late_ns));
            }
            self.redo(scan)?;
            self.forget();
            return Ok(self.inner.renumber(TrackId(0), &[]));
        }
        if self.saved.is_empty() {
            match self.inner.twin() {
                Some(tracking) => self.saved.push_back(Saved { tracking, time: None, taken: 0 }),
                None => return self.inner.step(scan),
            }
        }
        let first_new = self.inner.next_id();
        let states = self.inner.step(scan)?;
        self.births.extend(born(states, first_new, self.arrivals));
        self.log_scan(self.log.len(), scan);
        self.now = Some(scan.time);
        let newest = self.saved.back().and_then(|s| s.time);
        let copy = self.copy_if_due(&*self.inner, newest, self.now, self.log.len());
        self.saved.extend(copy);
        self.forget();
        Ok(self.inner.renumber(TrackId(0), &[]))
    }

    fn adapt(&mut self, parameters: &TrackerParameters) -> Result<bool> {
        let is_taken = self.inner.adapt(parameters)?;
        if is_taken && !self.saved.is_empty() {
            self.log.push_back(Entry { arrival: self.arrivals, given: Given::Parameters(*parameters) });
            self.arrivals += 1;
        }
        Ok(is_taken)
    }

    fn next_id(&self) -> TrackId {
        self.inner.next_id()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::track::{TrackerConfig, build};
    use crate::{Config, Detection, FrameIndex};
    use nalgebra::Vector2;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const DT_S: f64 = 0.05;

    /// Five targets that cross and come and go, 90 % of them seen, and clutter; scan by scan.
    fn scans(n: u64, seed: u64) -> Vec<Scan> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let scan = |k: u64| {
            let t = k as f64 * DT_S;
            let mut all = Vec::new();
            for i in 0..5u64 {
                let lives = k >= 12 * i && (i % 2 == 0 || k < n.saturating_sub(9 * i));
                let (x, y) = (40.0 + 60.0 * i as f64 + 20.0 * t, 100.0 + (if i % 2 == 0 { 8.0 } else { -8.0 }) * t);
                let off = [rng.random::<f64>() - 0.5, rng.random::<f64>() - 0.5];
                if lives && rng.random::<f64>() < 0.9 {
                    all.push(Detection::point(x + off[0], y + off[1], 0.3));
                }
            }
            for _ in 0..rng.random_range(0..3) {
                all.push(Detection::point(600.0 * rng.random::<f64>(), 300.0 * rng.random::<f64>(), 0.3));
            }
            Scan::at(FrameIndex(k), Timestamp::from_secs_f64(t)).with_detections(all)
        };
        (0..n).map(scan).collect()
    }

    /// The scans as they arrive where each takes up to `late_s` on its way.
    fn delayed(scans: &[Scan], late_s: f64, seed: u64) -> Vec<Scan> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let arrives = |s: &Scan| s.time.as_secs_f64() + late_s * rng.random::<f64>();
        let mut all: Vec<(f64, Scan)> = scans.iter().map(arrives).zip(scans.to_vec()).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        all.into_iter().map(|(_, scan)| scan).collect()
    }

    fn configs() -> Vec<TrackerConfig> {
        let with = |sets: &[&str]| {
            let config = sets.iter().fold(Config::default(), |c, s| c.with(s).unwrap());
            config.tracker
        };
        vec![
            TrackerConfig::default(),
            with(&["tracker.confirmation.existence={}", "tracker.filter=imm"]),
            with(&["tracker.associator=jpda", "tracker.clutter.map={}", "tracker.field-px=[700, 300]"]),
            with(&["tracker.reidentification.max-gap-s=2", "tracker.coast-s=0.3"]),
        ]
    }

    /// Everything but the numbers, which say when a track was first thought of.
    fn unnumbered(states: &[TrackState]) -> Vec<String> {
        let mut all: Vec<String> =
            states.iter().map(|s| format!("{:?}", TrackState { id: TrackId(0), ..s.clone() })).collect();
        all.sort();
        all
    }

    #[test]
    fn scans_that_come_late_give_the_tracks_of_the_same_scans_in_order() {
        for (k, config) in configs().iter().enumerate() {
            for seed in 0..6 {
                let (late_s, all) = (0.5, scans(120, seed));
                let arrived = delayed(&all[..119], late_s, seed + 100);
                assert!(arrived.windows(2).filter(|w| w[1].time < w[0].time).count() > 20);
                let mut tracker = OutOfOrder::new(build(config).unwrap(), late_s);
                for scan in &arrived {
                    tracker.step(scan).unwrap();
                }
                let late = unnumbered(tracker.step(&all[119]).unwrap());
                let mut plain = build(config).unwrap();
                let mut states = Vec::new();
                for scan in &all {
                    states = plain.step(scan).unwrap().to_vec();
                }
                assert!(states.len() > 1);
                assert_eq!(late, unnumbered(&states), "configuration {k}, seed {seed}");
                assert!(tracker.log.len() < 40 && tracker.saved.len() < 12, "{}", tracker.log.len());
            }
        }
    }

    #[test]
    fn in_order_nothing_changes_not_even_a_number() {
        for config in &configs() {
            let mut plain = build(config).unwrap();
            let mut tracker = OutOfOrder::new(build(config).unwrap(), 0.5);
            for scan in &scans(100, 7) {
                assert_eq!(tracker.step(scan).unwrap(), plain.step(scan).unwrap());
            }
        }
    }

    #[test]
    fn a_track_keeps_its_number_and_no_two_have_one() {
        let all = scans(200, 3);
        let mut tracker = OutOfOrder::new(build(&TrackerConfig::default()).unwrap(), 0.5);
        let mut last: BTreeMap<u64, (f64, Vector2<f64>)> = BTreeMap::new();
        let mut confirmed = std::collections::BTreeSet::new();
        for scan in delayed(&all, 0.4, 9) {
            let states = tracker.step(&scan).unwrap().to_vec();
            let now_s = tracker.now.unwrap().as_secs_f64();
            let mut ids: Vec<u64> = states.iter().map(|s| s.id.0).collect();
            ids.sort_unstable();
            ids.dedup();
            assert_eq!(ids.len(), states.len());
            for s in states.iter().filter(|s| s.status != crate::TrackStatus::Tentative) {
                confirmed.insert(s.id.0);
                let place = s.position();
                if let Some((then_s, before)) = last.insert(s.id.0, (now_s, place)) {
                    // Targets go at some 21 px/s; what a scan in between changes is a few px.
                    let far = 21.5 * (now_s - then_s) + 6.0;
                    assert!((place - before).norm() < far, "number {} went from {before} to {place}", s.id.0);
                }
            }
        }
        assert!((5..=7).contains(&confirmed.len()), "five targets, and at most two breaks: {confirmed:?}");
    }

    #[test]
    fn what_is_too_late_or_no_scan_is_refused_and_changes_nothing() {
        let all = scans(40, 1);
        let config = TrackerConfig::default();
        let (mut tracker, mut plain) = (OutOfOrder::new(build(&config).unwrap(), 0.2), build(&config).unwrap());
        for (k, scan) in all.iter().enumerate() {
            assert_eq!(tracker.step(scan).unwrap(), plain.step(scan).unwrap());
            if k == 20 {
                let said = tracker.step(&all[10]).unwrap_err().to_string();
                assert!(said.contains("0.2 s late") && said.contains("input.late-s"), "{said}");
                let bad = Detection::point(f64::NAN, 0.0, 1.0);
                assert!(tracker.step(&Scan { detections: vec![bad], ..all[18].clone() }).is_err());
            }
        }
    }

    #[test]
    fn parameters_that_changed_meanwhile_hold_from_their_time_on() {
        let all = scans(60, 5);
        let config = TrackerConfig::default();
        let parameters = TrackerParameters { extra_noise_px: 2.0, ..TrackerParameters::of(&config) };
        let run = |order: &[usize], tracker: &mut dyn Tracking| {
            let mut states = Vec::new();
            for k in order {
                states = unnumbered(tracker.step(&all[*k]).unwrap());
                if *k == 50 {
                    assert!(tracker.adapt(&parameters).unwrap());
                }
            }
            states
        };
        let in_order: Vec<usize> = (0..60).collect();
        // 48 comes behind the change that followed 50, 53 behind 55.
        let late: Vec<usize> = (0..48).chain([49, 50, 51, 48, 52, 54, 55, 53]).chain(56..60).collect();
        let mut plain = build(&config).unwrap();
        let mut tracker = OutOfOrder::new(build(&config).unwrap(), 0.3);
        assert_eq!(run(&in_order, &mut *plain), run(&late, &mut tracker));
    }
}
