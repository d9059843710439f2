//! Results held back, so that a track that is confirmed is reported from its first detection on.
//!
//! Source: docs/theory/track-management.md. A tentative track is one of which nobody knows yet whether it is a target; once it is confirmed, its earlier
//! states were a target's too. What is held back is changed then; what was given out stays.
//! Method: a queue of scans with their tracks. A state of a track that is reported now turns the same track's tentative states in the queue into confirmed
//! (with a detection) or coasting ones (without). One that had been reported before and was thought gone since gets back only the states with a detection.
//! A track that continues a lost one takes that one's id back in time as well; where the lost one was still coasting, the one with a detection stays.
//! A track that is confirmed for the first time is then continued backward, through detections that nobody took ([`Backward`]).
//! A scan leaves the queue when it has waited for its time (where nothing is continued far backward also when no track is tentative in it and in the next one), or when the queue holds [`MOST_FRAME_BYTES`] of frames or
//! [`MOST_STATES`] states. The frames are counted whether or not a sink wants them, so that no table depends on what else is written.
//! Limits: a track that is confirmed later than that is reported from the oldest scan held back on.

use super::held::Held;
use crate::camera::SteadyGround;
use crate::track::{Backward, Own};
use crate::{Frame, Scan, TrackId, TrackState, TrackStatus};
use std::collections::{BTreeSet, VecDeque};

/// Most memory of the frames that are held back, bytes.
const MOST_FRAME_BYTES: usize = 64 << 20;
/// Most states of tracks that are held back: some 64 MiB.
const MOST_STATES: usize = (64 << 20) / size_of::<TrackState>();

/// What is held back.
pub(super) struct Retrospect {
    hold_s: f64,
    backward: Option<Backward>,
    ground: SteadyGround,
    queue: VecDeque<Held>,
    bytes: usize,
    n_states: usize,
    /// Tracks that were reported at some time.
    reported: BTreeSet<TrackId>,
    /// Memory of tracks to be used again.
    spare: Vec<Vec<TrackState>>,
}

impl Retrospect {
    /// Holds back for so long, s, and continues tracks backward.
    pub fn new(hold_s: f64, backward: Option<Backward>) -> Self {
        Self {
            hold_s,
            backward,
            ground: SteadyGround::default(),
            queue: VecDeque::new(),
            bytes: 0,
            n_states: 0,
            reported: BTreeSet::new(),
            spare: Vec::new(),
        }
    }

    /// Takes the newest scan with its tracks; `bytes` is its frame's size.
    pub fn push(&mut self, frame: Option<Frame>, bytes: usize, scan: Scan, mut tracks: Vec<TrackState>) {
        // Tracks stand in the order of their initiation: one that continues a lost one has an older id than its neighbours.
        if !tracks.is_sorted_by_key(|t| t.id) {
            tracks.sort_unstable_by_key(|t| t.id);
        }
        self.bytes += bytes;
        self.n_states += tracks.len();
        self.ground = self.ground.after(&scan);
        self.queue.push_back(Held::new(frame, scan, tracks, bytes, self.ground));
    }

    /// The oldest scan, if it need not wait any longer; `all` asks for it in any case.
    pub fn pop(&mut self, all: bool) -> Option<Held> {
        let (oldest, newest) = (self.queue.front()?, self.queue.back()?);
        let is_settled = |held: &Held| held.tracks.iter().all(|t| t.status != TrackStatus::Tentative);
        let is_final = match &self.backward {
            None => is_settled(oldest),
            // A track of the next scan may still begin here.
            Some(backward) if !backward.goes_far() => is_settled(oldest) && self.queue.get(1).is_some_and(is_settled),
            Some(_) => false,
        };
        let may_go = all
            || is_final
            || newest.scan.time.seconds_since(oldest.scan.time) >= self.hold_s
            || self.bytes > MOST_FRAME_BYTES
            || self.n_states > MOST_STATES;
        if !may_go {
            return None;
        }
        let held = self.queue.pop_front()?;
        self.bytes -= held.bytes;
        self.n_states -= held.tracks.len();
        Some(held)
    }

    /// Memory for the tracks of a scan.
    pub fn memory(&mut self) -> Vec<TrackState> {
        self.spare.pop().unwrap_or_default()
    }

    /// Takes memory back.
    pub fn recycle(&mut self, mut tracks: Vec<TrackState>) {
        tracks.clear();
        self.spare.push(tracks);
    }

    /// Reports the tracks that the newest scan reports in the scans before as well; `renamed` got another id in it.
    pub fn confirm(&mut self, renamed: &[(TrackId, TrackId)]) {
        let Self { hold_s, backward, queue, n_states, reported, .. } = self;
        if *hold_s <= 0.0 {
            return;
        }
        let Some(newest) = queue.pop_back() else { return };
        for track in newest.tracks.iter().filter(|t| t.status != TrackStatus::Tentative) {
            let was = renamed.iter().find(|(_, is)| *is == track.id).map(|(was, _)| *was);
            if let Some(was) = was {
                *n_states -= queue.iter_mut().map(|held| rename(&mut held.tracks, was, track.id)).sum::<usize>();
            }
            let was_reported = !reported.insert(track.id);
            for held in queue.iter_mut().rev() {
                let Ok(i) = held.tracks.binary_search_by_key(&track.id, |t| t.id) else { continue };
                let state = &mut held.tracks[i];
                match (state.status, state.detection) {
                    (TrackStatus::Tentative, Some(_)) => {
                        state.status = TrackStatus::Confirmed;
                        let detection = state.detection;
                        held.take(detection);
                    }
                    (TrackStatus::Tentative, None) if !was_reported => state.status = TrackStatus::Coasting,
                    // It was thought gone, and nobody saw it.
                    (TrackStatus::Tentative, None) => {}
                    // What lies before was looked at when this was reported.
                    _ => break,
                }
            }
            if let Some(backward) = backward.as_ref().filter(|_| !was_reported) {
                *n_states += continue_back(queue, &newest, track, backward);
            }
        }
        queue.push_back(newest);
    }
}

/// Continues a track of the newest scan into the scans before its first one; how many states that gave.
fn continue_back(queue: &mut VecDeque<Held>, newest: &Held, track: &TrackState, backward: &Backward) -> usize {
    let own = |held: &Held| held.tracks.binary_search_by_key(&track.id, |t| t.id).ok();
    let first = queue.iter().position(|held| own(held).is_some()).unwrap_or(queue.len());
    // A track of another view did not begin before it.
    let view = (0..=first).rev().find(|&i| queue.get(i).unwrap_or(newest).scan.is_cut()).unwrap_or(0);
    if first == view {
        return 0;
    }
    let taken = queue.range(first..).chain([newest]).filter_map(|held| {
        let detection = held.tracks[own(held)?].detection?;
        Some(Own { scan: &held.scan, ground: held.ground, detection })
    });
    let states = backward.continue_back(track.id, taken, queue.range(view..first).rev().map(Held::past));
    let n = states.len();
    for (held, state) in queue.range_mut(..first).rev().zip(states) {
        held.take(state.detection);
        let place = held.tracks.partition_point(|t| t.id < state.id);
        held.tracks.insert(place, state);
    }
    n
}

/// Gives the state of track `was` the id `is`, and says how many states were left out for it: of two with one id that with a detection stays, else the older track's.
fn rename(tracks: &mut Vec<TrackState>, was: TrackId, is: TrackId) -> usize {
    let Ok(new) = tracks.binary_search_by_key(&was, |t| t.id) else { return 0 };
    let old = tracks.binary_search_by_key(&is, |t| t.id).ok();
    let Some(old) = old else {
        tracks[new].id = is;
        tracks.sort_unstable_by_key(|t| t.id);
        return 0;
    };
    if tracks[new].detection.is_some() && tracks[old].detection.is_none() {
        tracks.swap(new, old);
        tracks[old].id = is;
        if tracks[new].status != TrackStatus::Tentative {
            tracks[old].status = TrackStatus::Confirmed;
        }
    }
    tracks.remove(new);
    1
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::{Input, run};
    use crate::{Detection, FrameIndex, Result, Sink, Timestamp, View};
    use TrackStatus::{Coasting, Confirmed, Tentative};
    use std::ops::ControlFlow;
    use std::sync::{Arc, Mutex};

    fn state(id: u64, status: TrackStatus, detection: Option<u32>) -> TrackState {
        TrackState {
            id: TrackId(id),
            status,
            kinematics: boresight_filters::Gaussian {
                mean: nalgebra::SVector::zeros(),
                cov: nalgebra::SMatrix::identity(),
            },
            extent: crate::Extent { left_px: 0.0, top_px: 0.0, width_px: 1.0, height_px: 1.0 },
            detection,
            innovation: None,
            score: 0.5,
        }
    }

    /// A scan a second, and what came out, a letter a state: tentative, confirmed or coasting, with its id.
    struct Scripted {
        held: Retrospect,
        k: u64,
        out: Vec<String>,
    }

    impl Scripted {
        fn of(hold_s: f64) -> Self {
            Self { held: Retrospect::new(hold_s, None), k: 0, out: Vec::new() }
        }

        fn scan(&mut self, bytes: usize, tracks: &[TrackState], renamed: &[(u64, u64)]) {
            let scan = Scan::at(FrameIndex(self.k), Timestamp::from_secs_f64(self.k as f64));
            self.k += 1;
            let renamed: Vec<_> = renamed.iter().map(|&(a, b)| (TrackId(a), TrackId(b))).collect();
            self.held.push(None, bytes, scan, tracks.to_vec());
            self.held.confirm(&renamed);
            self.take(false);
        }

        fn take(&mut self, all: bool) {
            while let Some(held) = self.held.pop(all) {
                let letter = |t: &TrackState| match t.status {
                    Tentative => 't',
                    Confirmed => 'c',
                    Coasting => 'o',
                };
                let all: Vec<String> = held.tracks.iter().map(|t| format!("{}{}", letter(t), t.id.0)).collect();
                self.out.push(all.join(" "));
                self.held.recycle(held.tracks);
            }
        }

        fn end(mut self) -> String {
            self.take(true);
            assert_eq!((self.held.bytes, self.held.n_states), (0, 0));
            self.out.join(", ")
        }
    }

    #[test]
    fn a_confirmed_track_is_reported_from_its_first_state_on() {
        let mut run = Scripted::of(9.0);
        run.scan(0, &[], &[]);
        run.scan(0, &[state(1, Tentative, Some(0))], &[]);
        run.scan(0, &[state(1, Tentative, None), state(2, Tentative, Some(0))], &[]);
        assert_eq!(run.out, [""], "nothing tentative waits for nothing");
        run.scan(0, &[state(1, Confirmed, Some(0))], &[]);
        assert_eq!(run.end(), ", c1, o1 t2, c1", "a track that never was confirmed stays as it was");
    }

    #[test]
    fn what_has_waited_long_enough_is_given_out_as_it_is() {
        let mut run = Scripted::of(2.0);
        for _ in 0..4 {
            run.scan(0, &[state(1, Tentative, Some(0))], &[]);
        }
        assert_eq!(run.out, ["t1", "t1"]);
        run.scan(0, &[state(1, Confirmed, Some(0))], &[]);
        assert_eq!(run.end(), "t1, t1, c1, c1, c1");
        let mut at_once = Scripted::of(0.0);
        at_once.scan(0, &[state(1, Tentative, Some(0))], &[]);
        at_once.scan(0, &[state(1, Confirmed, Some(0))], &[]);
        assert_eq!(at_once.end(), "t1, c1");
    }

    #[test]
    fn memory_is_bounded_whatever_the_time() {
        let mut run = Scripted::of(1e9);
        for _ in 0..5 {
            run.scan(MOST_FRAME_BYTES / 3, &[state(1, Tentative, None)], &[]);
        }
        assert_eq!(run.out.len(), 2, "three frames fit");
        let many: Vec<TrackState> = (0..MOST_STATES as u64 / 3).map(|id| state(id, Tentative, None)).collect();
        let mut run = Scripted::of(1e9);
        for _ in 0..5 {
            run.scan(0, &many, &[]);
        }
        assert_eq!(run.out.len(), 2);
    }

    #[test]
    fn a_track_that_continues_a_lost_one_takes_its_id_back_in_time() {
        let mut run = Scripted::of(99.0);
        run.scan(0, &[state(1, Coasting, None), state(3, Tentative, None)], &[]);
        run.scan(0, &[state(1, Coasting, None), state(7, Tentative, Some(0))], &[]);
        run.scan(0, &[state(1, Coasting, None), state(7, Tentative, None)], &[]);
        run.scan(0, &[state(3, Tentative, None), state(7, Tentative, Some(0))], &[]);
        run.scan(0, &[state(1, Confirmed, Some(0)), state(3, Tentative, None)], &[(7, 1)]);
        run.scan(0, &[state(1, Confirmed, Some(0))], &[]);
        assert_eq!(run.end(), "o1 t3, c1, o1, c1 t3, c1 t3, c1");
    }

    #[test]
    fn a_track_that_was_thought_gone_and_came_back_was_where_it_was_seen_between() {
        let mut run = Scripted::of(99.0);
        let seen = [
            (Tentative, false),
            (Confirmed, true),
            (Tentative, false),
            (Tentative, true),
            (Confirmed, true),
            (Tentative, true),
        ];
        for (status, seen) in seen {
            run.scan(0, &[state(4, status, seen.then_some(0))], &[]);
        }
        assert_eq!(run.end(), "o4, c4, t4, c4, c4, t4", "what comes after the last is nobody's");
    }

    /// Writes down frame, id and letter of each state.
    struct Rows(Arc<Mutex<Vec<(u64, u64, TrackStatus)>>>);

    impl Sink for Rows {
        fn put(&mut self, view: &View<'_>) -> Result<()> {
            let row = |t: &TrackState| (view.scan.index.0, t.id.0, t.status);
            self.0.lock().unwrap().extend(view.tracks.iter().map(row));
            Ok(())
        }
        fn finish(self: Box<Self>) -> Result<()> {
            Ok(())
        }
    }

    #[test]
    fn held_back_or_not_the_states_are_the_same_but_for_what_is_known_later() {
        // Two things that move, one of them seen in two scans only.
        let scan = |k: u64| {
            let at = |x: f64, y: f64| Detection::at(nalgebra::Vector2::new(x, y), nalgebra::Matrix2::identity());
            let mut detections = vec![at(3.0 * k as f64, 5.0)];
            detections.extend((4..6).contains(&k).then(|| at(80.0, 3.0 * k as f64)));
            Scan::at(FrameIndex(k), Timestamp::from_ns(k as i64 * 40_000_000)).with_detections(detections)
        };
        let rows = |retrospective_s: f64, n: u64| {
            let mut config = crate::Config::default().tracker;
            config.retrospective_s = retrospective_s;
            let rows = Arc::new(Mutex::new(Vec::new()));
            let sinks: Vec<Box<dyn Sink>> = vec![Box::new(Rows(Arc::clone(&rows)))];
            let tracking = crate::track::build(&config).unwrap();
            let input = Input::Scans((0..n).map(scan).collect());
            let outcome = run(input, Some(tracking), sinks, &mut |_| ControlFlow::Continue(()));
            assert_eq!((outcome.summary.frames, outcome.summary.confirmed_tracks), (n, 1));
            rows.lock().unwrap().clone()
        };
        let (at_once, whole) = (rows(0.0, 12), rows(10.0, 12));
        let places = |rows: &[(u64, u64, TrackStatus)]| rows.iter().map(|r| (r.0, r.1)).collect::<Vec<_>>();
        // The first of the two detections that a target is initiated from belongs to it; what never was confirmed has none.
        assert_eq!([vec![(0, 1)], places(&at_once)].concat(), places(&whole));
        let tentative = |rows: &[(u64, u64, TrackStatus)], id: u64| {
            rows.iter().filter(|r| r.1 == id && r.2 == TrackStatus::Tentative).count()
        };
        assert!(tentative(&at_once, 1) >= 1 && tentative(&whole, 1) == 0);
        assert!(tentative(&whole, 2) >= 2 && tentative(&whole, 2) == tentative(&at_once, 2), "it was no target");
        assert_eq!(rows(10.0, 7).len(), 1 + rows(0.0, 7).len(), "the end waits for nothing");
    }
}
