//! The stages of a run once its configuration is settled, and what becomes of them when frames or parameters change.

use crate::board::Board;
use crate::choose::{Ready, info_of};
use crate::tune::Change;
use boresight::auto::Adaptation;
use boresight::track::{OutOfOrder, TrackerParameters, Tracking};
use boresight::vision::Detector;
use boresight::vision::threshold::ThresholdConfig;
use boresight::{
    Config, Error, ErrorKind, Frame, PixelKind, Result, Scan, Timestamp, TrackId, TrackState, track, vision,
};
use std::time::{Duration, Instant};

/// The stages.
pub struct Stages {
    /// The configuration.
    pub config: Config,
    /// Frame to detections; `None` for a stream of detections.
    pub detector: Option<Box<dyn Detector>>,
    /// Detections to tracks.
    pub tracking: Box<dyn Tracking>,
    size: Option<(usize, usize, PixelKind)>,
    /// Whether the detector is of an earlier configuration.
    is_stale: bool,
    /// The newest scan.
    pub scan: Scan,
    /// Scans tracked so far.
    pub n_steps: u64,
    /// Time of the last scan, and when it was the newest thing.
    pub last: Option<(Timestamp, Instant)>,
    /// Time between the last two arrivals: a slow stream is not a silent one.
    pub usual: Duration,
    /// Tracks now, tentative ones too.
    pub n_tracks: usize,
    /// What is added to a tracker's numbers, and the largest that was given: a number is never used twice in a run, though the tracker may begin anew.
    first_id: u64,
    last_id: u64,
    renumbered: Vec<TrackState>,
    /// What follows the scans, where the configuration was chosen.
    adaptation: Option<Adaptation>,
    /// What it says for the scans that come.
    next: Option<TrackerParameters>,
}

/// The tracks of a step with numbers of the run; `first_id` counts those of earlier trackers.
fn numbered<'t>(
    tracks: &'t [TrackState],
    first_id: u64,
    last_id: &mut u64,
    out: &'t mut Vec<TrackState>,
) -> &'t [TrackState] {
    let newest = tracks.iter().map(|t| t.id.0 + first_id).max().unwrap_or(0);
    *last_id = newest.max(*last_id);
    if first_id == 0 {
        return tracks;
    }
    out.clear();
    out.extend(tracks.iter().map(|t| TrackState { id: TrackId(t.id.0 + first_id), ..t.clone() }));
    out
}

/// The tracker of a configuration; `takes_late`: scans may come late by their times.
fn tracking(config: &Config, takes_late: bool) -> Result<Box<dyn Tracking>> {
    let tracking = track::build(&config.tracker)?;
    let takes_late = takes_late && config.input.late_s > 0.0;
    Ok(if takes_late { Box::new(OutOfOrder::new(tracking, config.input.late_s)) } else { tracking })
}

impl Stages {
    /// The stages of what is ready; what was kept stays with the caller.
    /// # Errors
    /// A tracker that cannot be built.
    pub fn of(ready: Ready) -> Result<(Self, Vec<crate::source::Arrived>)> {
        let stages = Self {
            tracking: tracking(&ready.config, ready.detector.is_none())?,
            adaptation: ready.adaptation,
            next: None,
            config: ready.config,
            detector: ready.detector,
            size: None,
            is_stale: false,
            scan: Scan::default(),
            n_steps: 0,
            last: None,
            usual: Duration::ZERO,
            n_tracks: 0,
            first_id: 0,
            last_id: 0,
            renumbered: Vec::new(),
        };
        Ok((stages, ready.kept))
    }

    /// The newest scan through the tracker: the scan and the tracks.
    /// # Errors
    /// What the tracker refuses.
    pub fn track(&mut self) -> Result<(&Scan, &[TrackState])> {
        let tracks = self.tracking.step(&self.scan)?;
        self.n_tracks = tracks.len();
        self.next = self.adaptation.as_mut().and_then(|a| a.step(&self.scan, tracks));
        Ok((&self.scan, numbered(tracks, self.first_id, &mut self.last_id, &mut self.renumbered)))
    }

    /// Takes a scan of a time before the newest; what it changes is seen with the next one. `false` if it is too late.
    /// # Errors
    /// What the tracker refuses.
    pub fn take_late(&mut self, scan: &Scan) -> Result<bool> {
        let late_ns = self.last.map_or(0, |(newest, _)| newest.ns.saturating_sub(scan.time.ns));
        if late_ns > Timestamp::from_secs_f64(self.config.input.late_s).ns {
            return Ok(false);
        }
        let tracks = self.tracking.step(scan)?;
        self.n_tracks = tracks.len();
        numbered(tracks, self.first_id, &mut self.last_id, &mut self.renumbered);
        Ok(true)
    }

    /// What the scans so far say for those that come, once.
    pub fn take_next(&mut self) -> Option<TrackerParameters> {
        self.next.take()
    }

    /// Whether the parameters follow the scans.
    pub fn is_adapting(&self) -> bool {
        self.adaptation.is_some()
    }

    /// Mean of the normalised squared innovations lately, where they are followed.
    pub fn mean_nis(&self) -> Option<f64> {
        self.adaptation.as_ref().and_then(Adaptation::mean_nis)
    }

    /// Gives the tracker other parameters, while its tracks go on; `false` if it takes none.
    /// # Errors
    /// A value outside its range; everything stays as it was.
    pub fn adapt(&mut self, parameters: &TrackerParameters) -> Result<bool> {
        let tracker = parameters.in_config(&self.config.tracker)?;
        let is_taken = self.tracking.adapt(parameters)?;
        if is_taken {
            self.config.tracker = tracker;
        }
        Ok(is_taken)
    }

    /// False detections that the detector is asked for in a frame of so many pixels; only some have such a knob.
    pub fn false_alarms_asked(&self, pixels: usize) -> Option<f64> {
        match &self.config.detector.threshold {
            ThresholdConfig::Cfar(cfar) => Some(cfar.rate(pixels)),
            ThresholdConfig::Integrate(integrate) => Some(integrate.false_alarms_per_frame),
            ThresholdConfig::Bernoulli(bernoulli) => Some(bernoulli.false_alarms_per_frame),
            _ => None,
        }
    }

    /// Takes a changed parameter: the detector or the tracker begins anew.
    /// # Errors
    /// A value that cannot be built; everything stays as it was.
    pub fn retune(&mut self, change: Change) -> Result<()> {
        let config = change.apply(&self.config)?;
        if change.is_of_detector() {
            // Built with the next frame.
            self.is_stale = true;
        } else {
            self.tracking = tracking(&config, self.detector.is_none())?;
            self.first_id = self.last_id;
            self.n_tracks = 0;
            if let Some(adaptation) = &mut self.adaptation {
                adaptation.freeze(change.key());
                adaptation.restart(&config.tracker);
            }
            self.next = None;
        }
        self.config = config;
        Ok(())
    }

    /// Builds the detector anew where the size or type of the frames has changed.
    /// # Errors
    /// A configuration that does not fit the frames.
    pub fn fit(&mut self, frame: &Frame, board: &Board) -> Result<()> {
        let size = (frame.pixels.width(), frame.pixels.height(), frame.pixels.kind());
        if self.detector.is_some() && !self.is_stale && self.size.is_none_or(|s| s == size) {
            self.size = Some(size);
            return Ok(());
        }
        if self.size.is_some_and(|s| s != size) {
            let (name, w, h) = (&board.source, size.0, size.1);
            board.say(&format!("{name}: frames have {w} x {h} pixels now; the detector starts anew"));
        }
        let info = info_of(frame, &board.source);
        self.detector = Some(
            vision::build(&self.config.detector, &info)
                .map_err(|e| Error::new(ErrorKind::Config, "the configuration does not fit the frames").because(e))?,
        );
        (self.size, self.is_stale) = (Some(size), false);
        Ok(())
    }
}
