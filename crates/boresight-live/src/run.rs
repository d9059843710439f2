//! The run: the newest frame through detector and tracker to the outputs, while it happens.
//!
//! The stages are those of `boresight track`; only the source, the clock and the outputs differ. A frame that no one took before a newer one came is
//! dropped and counted; the gap is a gap in time, which the filters know. While the source gives nothing, tracks coast: blind scans carry the
//! time on, half a second behind the clock, until the budget of the configuration deletes them.

use crate::adapted;
use crate::board::{Board, ScanNotes, State, add, read as read_count, unix_s};
use crate::choose::{Kept, Ready};
use crate::event::{CONFIRMED, Event, TrackReport, When, status_line};
use crate::lives::Lives;
use crate::output::{LiveOutput, Shown};
use crate::slot::{Slot, Taken};
use crate::source::{Arrived, Connect, Content, Pauses, start};
use crate::stages::Stages;
use crate::tune::Change;
use boresight::auto::DetectorKind;
use boresight::io::StopFlag;
use boresight::track::TrackerParameters;
use boresight::world::World;
use boresight::{CameraMotion, Config, Error, ErrorKind, Frame, FrameIndex, Result, Scan, Timestamp, View};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant, SystemTime};

/// How long one waits for the next frame before looking around.
const LOOK_AROUND: Duration = Duration::from_millis(50);
/// Silence after which tracks coast by the clock.
const SILENCE: Duration = Duration::from_secs(1);
/// Longest time between arrivals that passes for usual.
const LONGEST_USUAL: Duration = Duration::from_secs(20);
/// Coasting lags behind the clock: a frame that is late all the same still comes after it.
const COAST_LAG_S: f64 = 0.5;

/// What decides over a run.
#[derive(Clone, Debug)]
pub struct RunOptions {
    /// The configuration; without it one is chosen from the first frames.
    pub config: Option<Config>,
    /// How the source is read, and where the choice starts from.
    pub base: Config,
    /// Keys to change, `tracker.coast-s=1`, chosen or given.
    pub sets: Vec<String>,
    /// Detector, where it is not to be chosen.
    pub detector: Option<DetectorKind>,
    /// Time of the first frames that are looked at, s.
    pub learn_s: f64,
    /// Updates of a track a second on the wire, at most.
    pub updates_hz: f64,
    /// Pauses between attempts to connect again.
    pub pauses: Pauses,
}

impl Default for RunOptions {
    fn default() -> Self {
        Self {
            config: None,
            base: Config::default(),
            sets: Vec::new(),
            detector: None,
            learn_s: 2.0,
            updates_hz: 10.0,
            pauses: Pauses::default(),
        }
    }
}

/// Runs until the source ends or `stop` says so; outputs are finished either way.
/// # Errors
/// A source that gives nothing, a configuration that cannot be built. What an output cannot write is said and counted, and the run goes on.
pub fn run(
    connect: Box<dyn Connect>,
    options: &RunOptions,
    board: &Arc<Board>,
    outputs: &mut [Box<dyn LiveOutput>],
    stop: &dyn Fn() -> bool,
) -> Result<()> {
    let slot = Arc::new(Slot::default());
    let stops = connect.stop_flag();
    let reader = start(connect, options.pauses, Arc::clone(&slot), Arc::clone(board))?;
    let mut live = Live::new(board, outputs, options.updates_hz);
    let outcome = live.all(&slot, options, stop);
    // Closed by the reader: it has ended and has something to say. One that can be stopped ends the program that reads for it; another may wait for a silent
    // pipe, and ends with the process.
    let has_ended = slot.is_closed();
    slot.close();
    stops.iter().for_each(StopFlag::stop);
    let joined = (has_ended || stops.is_some()).then(|| reader.join());
    let read = joined.map_or(Ok(()), |read| read.unwrap_or_else(|_| Err(broken_reader())));
    let nothing = || Error::new(ErrorKind::Damaged, "gave nothing to track").at(&board.source);
    let outcome = outcome.and(read).and_then(|()| match stop() || read_count(&board.counts.tracked) > 0 {
        true => Ok(()),
        false => Err(nothing()),
    });
    let why = match &outcome {
        Err(e) => e.to_string().lines().next().unwrap_or_default().to_string(),
        Ok(()) if stop() => "stopped".to_string(),
        Ok(()) => "the source ended".to_string(),
    };
    live.end(&why);
    outcome
}

fn broken_reader() -> Error {
    Error::new(ErrorKind::Damaged, "the reader of the source broke off, which is our own mistake")
}

struct Live<'o> {
    board: &'o Arc<Board>,
    outputs: &'o mut [Box<dyn LiveOutput>],
    lives: Lives,
    world: Option<World>,
    /// The parameters that were said last.
    assumed: Option<TrackerParameters>,
    reports: Vec<TrackReport>,
    events: Vec<Event>,
    said: State,
    failing: Vec<bool>,
}

impl<'o> Live<'o> {
    fn new(board: &'o Arc<Board>, outputs: &'o mut [Box<dyn LiveOutput>], updates_hz: f64) -> Self {
        let failing = vec![false; outputs.len()];
        let lives = Lives::new(updates_hz);
        let (reports, events) = (Vec::new(), Vec::new());
        Self { board, outputs, lives, world: None, assumed: None, reports, events, said: State::Ended, failing }
    }

    fn all(&mut self, slot: &Slot<Arrived>, options: &RunOptions, stop: &dyn Fn() -> bool) -> Result<()> {
        self.tell_state();
        let Some(kept) = self.gather(slot, options, stop) else { return Ok(()) };
        let ready = match &options.config {
            Some(config) => kept.given(options.sets.iter().try_fold(config.clone(), |c, s| c.with(s))?)?,
            None => {
                self.board.set(State::Choosing, "looking at the first frames");
                self.tell_state();
                kept.choose(&options.base, &options.sets, options.detector)?
            }
        };
        let mut stages = self.begin(ready)?;
        while !stop() {
            if let Some(change) = self.board.take_change() {
                self.retune(&mut stages, change);
            }
            match slot.take(LOOK_AROUND) {
                Taken::Item(arrived) => {
                    self.board.set(State::Running, "");
                    self.step(&mut stages, arrived, true)?;
                }
                Taken::Nothing => self.coast(&mut stages),
                Taken::Closed => break,
            }
            self.tell_state();
        }
        Ok(())
    }

    /// The first frame of a given configuration, or enough of them to choose; `None` if none came.
    fn gather(&mut self, slot: &Slot<Arrived>, options: &RunOptions, stop: &dyn Fn() -> bool) -> Option<Kept> {
        let mut kept = Kept::default();
        while !stop() {
            match slot.take(LOOK_AROUND) {
                Taken::Item(arrived) => {
                    if !kept.keep(arrived, &self.board.source) {
                        add(&self.board.counts.refused, 1);
                    }
                    if options.config.is_some() || kept.is_enough(options.learn_s) {
                        return Some(kept);
                    }
                    self.board.set(State::Choosing, "gathering the first frames");
                }
                Taken::Nothing => {}
                Taken::Closed => return (!kept.is_empty()).then_some(kept),
            }
            self.tell_state();
        }
        None
    }

    fn begin(&mut self, mut ready: Ready) -> Result<Stages> {
        self.world = ready.config.world.as_ref().map(World::new).transpose()?;
        ready.reasons.extend(self.world.iter().map(|world| world.says().to_string()));
        let toml = ready.config.to_toml()?;
        // In one piece: those of several sources do not mix.
        let reasons: String = ready.reasons.iter().map(|reason| format!("\n  {reason}")).collect();
        self.board.say(&format!("{}: configuration:{reasons}", self.board.source));
        self.board.configured(toml, ready.reasons.clone());
        self.outputs.iter_mut().for_each(|output| output.configured(&ready.config));
        self.settled(&ready.config);
        if ready.detector.is_none() {
            self.board.only_tracks();
        }
        let (mut stages, kept) = Stages::of(ready)?;
        self.board.set(State::Running, "");
        self.tell_state();
        for arrived in kept {
            self.step(&mut stages, arrived, false)?;
        }
        Ok(stages)
    }

    /// One arrival through the stages; `is_timed`: its latency counts.
    fn step(&mut self, stages: &mut Stages, mut arrived: Arrived, is_timed: bool) -> Result<()> {
        let index = FrameIndex(stages.n_steps);
        if let Content::Adapted(_, parameters) = &arrived.content
            && !stages.is_adapting()
        {
            self.adapt(stages, parameters);
        }
        if let Content::Scan(scan) | Content::Adapted(scan, _) = &mut arrived.content
            && stages.last.is_some_and(|(newest, _)| scan.time < newest)
        {
            scan.index = index;
            self.late(stages, scan, unix_s(arrived.wall));
            return Ok(());
        }
        let frame = match &mut arrived.content {
            Content::Frame(frame) => {
                // The frames that reach the tracker are numbered, so that the record has no holes that a reader would fill.
                frame.index = index;
                stages.fit(frame, self.board)?;
                let Some(detector) = &mut stages.detector else { return Ok(()) };
                if let Err(e) = detector.detect(frame, &mut stages.scan) {
                    self.refuse(&e);
                    return Ok(());
                }
                Some(&*frame)
            }
            Content::Scan(scan) | Content::Adapted(scan, _) => {
                scan.index = index;
                std::mem::swap(&mut stages.scan, scan);
                None
            }
        };
        stages.scan.index = index;
        if let Some((_, before)) = stages.last {
            stages.usual = arrived.at.saturating_duration_since(before);
        }
        let arrived_unix_s = unix_s(arrived.wall);
        self.track(stages, frame, arrived_unix_s, arrived.at);
        if is_timed {
            self.board.latency.add(arrived.at.elapsed().as_secs_f64());
        }
        Ok(())
    }

    /// A scan of a time before the newest.
    fn late(&mut self, stages: &mut Stages, scan: &Scan, arrived_unix_s: f64) {
        let counts = &self.board.counts;
        match stages.take_late(scan) {
            Ok(true) => {
                add(&counts.late, 1);
                add(&counts.detections, scan.detections.len() as u64);
                let failed =
                    self.outputs.iter_mut().filter_map(|output| output.late(scan, arrived_unix_s).err()).count();
                add(&counts.record_failures, failed as u64);
            }
            Ok(false) => self.board.too_late(),
            Err(e) => self.refuse(&e),
        }
    }

    fn settled(&mut self, config: &Config) {
        let parameters = TrackerParameters::of(&config.tracker);
        self.assumed = Some(parameters);
        self.board.assumes(parameters);
    }

    /// Other parameters for the scans that come: those that the run learnt, or those of a record that is replayed.
    fn adapt(&mut self, stages: &mut Stages, parameters: &TrackerParameters) {
        let name = &self.board.source;
        match stages.adapt(parameters).and_then(|taken| Ok(taken.then_some(stages.config.to_toml()?))) {
            Ok(Some(toml)) => {
                self.board.configured(toml, self.board.configuration().1);
                self.board.assumes(*parameters);
                self.outputs.iter_mut().for_each(|output| output.adapted(parameters, &stages.config));
                let said = self.assumed.get_or_insert(*parameters);
                if let Some(words) = adapted::words(said, parameters) {
                    self.board.say(&format!("{name}: adapted: {words}"));
                    *said = *parameters;
                }
            }
            Ok(None) => {}
            Err(e) => self.refuse(&e),
        }
    }

    /// The scan of `stages` through the tracker to the outputs.
    fn track(&mut self, stages: &mut Stages, frame: Option<&Frame>, arrived_unix_s: f64, at: Instant) {
        let pixels = frame.map(|f| f.pixels.width() * f.pixels.height());
        let false_alarms_asked = pixels.and_then(|n| stages.false_alarms_asked(n));
        let nis_lately = stages.mean_nis();
        let (scan, tracks) = match stages.track() {
            Ok(tracked) => tracked,
            Err(e) => return self.refuse(&e),
        };
        let counts = &self.board.counts;
        let when = When { frame: scan.index.0, time: scan.time, arrived_unix_s };
        self.reports.clear();
        self.reports.extend(tracks.iter().filter_map(|t| TrackReport::of(t, self.world.as_ref())));
        self.events.clear();
        self.lives.step(&self.board.source, when, &self.reports, &mut self.events);
        let view = View { frame, scan, tracks };
        let shown = Shown { view, when, tracks: &self.reports, events: &self.events };
        for (output, failing) in self.outputs.iter_mut().zip(&mut self.failing) {
            match output.put(&shown) {
                Ok(()) if std::mem::take(failing) => {
                    self.board.say(&format!("{}: the output is written again", self.board.source))
                }
                Ok(()) => {}
                Err(e) => {
                    add(&counts.record_failures, 1);
                    if !std::mem::replace(failing, true) {
                        self.board.say(&format!("warning: {}: {e}", self.board.source));
                    }
                }
            }
        }
        add(&counts.tracked, 1);
        add(&counts.detections, scan.detections.len() as u64);
        add(&counts.events, self.events.len() as u64);
        counts.tracks.store(self.lives.started, Ordering::Relaxed);
        counts.now.store(self.reports.len() as u64, Ordering::Relaxed);
        counts.events_dropped.store(self.outputs.iter().map(|o| o.dropped()).sum(), Ordering::Relaxed);
        if !scan.blind {
            let n_claimed = self.reports.iter().filter(|t| t.status == CONFIRMED).count();
            let unclaimed = scan.detections.len().saturating_sub(n_claimed);
            let moved = |m: &CameraMotion| (m.now_from_before.apply(m.centre_px) - m.centre_px).norm();
            let camera_moved_px = scan.camera_motion.as_ref().map(moved).filter(|px| px.is_finite());
            add(&counts.unclaimed, unclaimed as u64);
            let notes = ScanNotes { unclaimed, false_alarms_asked, camera_moved_px, nis_lately };
            self.board.scan_done(self.reports.iter().filter_map(|t| t.nis), notes);
        }
        stages.last = Some((stages.scan.time, at));
        stages.n_steps += 1;
        if let Some(parameters) = stages.take_next() {
            self.adapt(stages, &parameters);
        }
    }

    /// Carries the time on while nothing comes.
    fn coast(&mut self, stages: &mut Stages) {
        let Some((last, at)) = stages.last else { return };
        let silent = at.elapsed();
        if silent < SILENCE.max(3 * stages.usual.min(LONGEST_USUAL)) {
            return;
        }
        if self.board.said().state == State::Running {
            self.board.set(State::Lost, "nothing comes");
        }
        let now = Instant::now();
        let ahead_s = now.saturating_duration_since(at).as_secs_f64() - COAST_LAG_S;
        if stages.n_tracks == 0 || ahead_s <= 0.0 {
            return;
        }
        let time = Timestamp::from_ns(last.ns.saturating_add((ahead_s * 1e9) as i64));
        stages.scan = Scan::at(FrameIndex(stages.n_steps), time).with_blind(true);
        let lag = Duration::from_secs_f64(COAST_LAG_S);
        self.track(stages, None, unix_s(SystemTime::now()), now.checked_sub(lag).unwrap_or(now));
    }

    /// Takes a changed parameter; with another tracker the tracks of the one before end.
    fn retune(&mut self, stages: &mut Stages, change: Change) {
        let (name, words) = (&self.board.source, change.words());
        let text = stages.retune(change).and_then(|()| stages.config.to_toml());
        match text {
            Ok(toml) => {
                self.board.say(&format!("{name}: changed on the page: {words}"));
                let mut reasons = self.board.configuration().1;
                reasons.push(format!("Changed on the page: {words}."));
                self.board.configured(toml, reasons);
                self.outputs.iter_mut().for_each(|output| output.configured(&stages.config));
                self.settled(&stages.config);
                if !change.is_of_detector() {
                    self.end_tracks();
                }
            }
            Err(e) => self.board.say(&format!("warning: {name}: {words} is not taken: {e}")),
        }
    }

    fn end_tracks(&mut self) {
        self.events.clear();
        self.lives.end(&self.board.source, &mut self.events);
        for event in self.events.drain(..) {
            self.outputs.iter_mut().for_each(|output| output.event(&event));
        }
    }

    fn refuse(&mut self, e: &Error) {
        if self.board.counts.refused.fetch_add(1, Ordering::Relaxed) == 0 {
            let why = e.to_string();
            let why = why.lines().next().unwrap_or_default();
            let name = &self.board.source;
            self.board.say(&format!("warning: {name}: a frame is left out, and others like it: {why}"));
        }
    }

    /// Tells the wire the state, if it is new.
    fn tell_state(&mut self) {
        let said = self.board.said();
        if said.state != self.said {
            self.said = said.state;
            let json = status_line(&self.board.source, said.state.word(), &said.why, unix_s(SystemTime::now()));
            let event = Event::line(true, json);
            self.outputs.iter_mut().for_each(|output| output.event(&event));
        }
    }

    fn end(&mut self, why: &str) {
        self.end_tracks();
        self.board.counts.now.store(0, Ordering::Relaxed);
        self.board.set(State::Ended, why);
        self.tell_state();
        self.outputs.iter_mut().for_each(|output| output.finish());
    }
}
