//! From an input and what the caller gives to what runs: frames and their detector, or scans, and the whole configuration.
//!
//! The order is the command's: what the caller sets holds for the first pass as well, and is not overruled by what it learns.

use crate::config::changed;
use crate::python_detector::PythonDetector;
use crate::source::ArrayFrames;
use boresight::pipeline::Input;
use boresight::{ASSUMED_RATE_HZ, Config, Error, ErrorKind, FrameSource, Result, Scan, auto, io, vision};

/// What the caller gives besides the input.
#[derive(Default)]
pub struct Wishes {
    /// The configuration; chosen by looking at the first frames if absent.
    pub config: Option<Config>,
    /// Keys to change in it, `key=value`.
    pub sets: Vec<String>,
    /// Rate of inputs without times, frames/s.
    pub rate_hz: Option<f64>,
    /// False tracks an hour that are allowed.
    pub false_tracks_per_hour: Option<f64>,
    /// The library's detector, by its word, where it is not to be chosen.
    pub word: Option<String>,
    /// A detector of the caller's own.
    pub detector: Option<PythonDetector>,
}

/// What is to be run.
pub struct Plan {
    /// Frames with their detector, or scans.
    pub input: Input,
    /// The configuration.
    pub config: Config,
    /// Why it is what it is.
    pub reasons: Vec<String>,
    /// What is lost of the input already.
    pub lost: Vec<String>,
    /// Frames, if known.
    pub total: Option<u64>,
    /// How the input is read.
    pub reader: String,
}

impl Wishes {
    /// The configuration to start from: how the input is read is settled in it.
    pub fn base(&self) -> Result<Config> {
        let mut base = self.config.clone().unwrap_or_default();
        if let Some(rate) = self.rate_hz {
            base = base.with(&format!("input.rate-hz={rate}")).map_err(|e| e.at("rate_hz"))?;
        }
        // How the input is read must be settled before it is opened.
        let input: Vec<String> = self.sets.iter().filter(|s| s.starts_with("input.")).cloned().collect();
        changed(base, &input)
    }

    fn request(&self) -> Result<auto::Request> {
        let detector = self.word.as_ref().map(|w| w.parse()).transpose().map_err(|e: Error| e.at("detector"))?;
        Ok(auto::Request { detector, false_tracks_per_hour: self.false_tracks_per_hour, ..auto::Request::default() })
    }

    /// Refuses a detector's word where nothing is chosen by looking at frames.
    fn no_word(&self, why: &str) -> Result<()> {
        self.word
            .as_ref()
            .map_or(Ok(()), |word| Err(Error::new(ErrorKind::Config, why).at(format!("detector = {word}"))))
    }

    /// The plan for a path, a glob, a folder, a table of detections.
    pub fn for_path(self, input: &str) -> Result<Plan> {
        let base = self.base()?;
        if io::is_table(input) {
            self.no_word("a table of detections needs no detector")?;
            return self.for_table(input, base);
        }
        if self.config.is_some() || self.detector.is_some() {
            self.no_word("with a configuration the detector stands in it")?;
            let source = base.input.mend(io::open(input, &base.input.open_options())?)?;
            return self.for_source(source, base);
        }
        let request = self.request()?;
        let (mut frames, mut choice) = auto::open_and_choose(input, &base, &request)?;
        let detector = auto::learn(&mut frames, &mut choice, &request, |config| changed(config, &self.sets))?;
        self.chosen(frames, choice, detector)
    }

    /// The plan for arrays; `again` hands them out a second time, if they can be had.
    pub fn for_arrays(self, frames: ArrayFrames, again: Option<ArrayFrames>) -> Result<Plan> {
        let base = self.base()?;
        if self.config.is_some() || self.detector.is_some() {
            self.no_word("with a configuration the detector stands in it")?;
            let frames = base.input.mend(Box::new(frames))?;
            return self.for_source(frames, base);
        }
        let request = self.request()?;
        let mut again = again;
        let again = again.as_mut().map(|a| a as &mut dyn FrameSource);
        let (mut frames, mut choice) =
            auto::read_and_choose(base.input.mend(Box::new(frames))?, again, &base, &request)?;
        choice.report_whole(frames.info().rate_hz.unwrap_or(base.input.rate_hz));
        let detector = auto::learn(&mut frames, &mut choice, &request, |config| changed(config, &self.sets))?;
        self.chosen(frames, choice, detector)
    }

    fn chosen(self, frames: auto::Replay, choice: auto::Choice, detector: Box<dyn vision::Detector>) -> Result<Plan> {
        let config = choice.config;
        let (total, reader) = (frames.info().n_frames, frames.info().reader.clone());
        let mut reasons = choice.reasons;
        reasons.extend(unused(&config));
        let input = Input::Frames(Box::new(frames), detector);
        Ok(Plan { input, config, reasons, lost: Vec::new(), total, reader })
    }

    fn for_source(mut self, source: Box<dyn FrameSource>, base: Config) -> Result<Plan> {
        let info = source.info().clone();
        let reasons = vec!["Configuration as given.".to_string()];
        if let Some(detector) = &mut self.detector {
            detector.std = (base.input.table.std_px, base.input.table.std_per_side);
        }
        match (self.detector.take(), self.config.is_some()) {
            (Some(detector), true) => {
                let config = changed(base, &self.sets)?;
                let input = Input::Frames(source, Box::new(detector));
                Ok(Plan { input, config, reasons, lost: Vec::new(), total: info.n_frames, reader: info.reader })
            }
            (Some(detector), false) => {
                let rate = info.rate_hz.or(self.rate_hz).unwrap_or(ASSUMED_RATE_HZ);
                let (scans, lost) = all_scans(source, detector)?;
                let mut plan = self.for_scans(scans, rate, base, info.reader)?;
                plan.lost.extend(lost);
                Ok(plan)
            }
            (None, _) => {
                let mut config = changed(base, &self.sets)?;
                config.fill_in(&info);
                let detector = vision::build(&config.detector, &info)?;
                let reasons = reasons.into_iter().chain(unused(&config)).collect();
                let input = Input::Frames(source, detector);
                Ok(Plan { input, config, reasons, lost: Vec::new(), total: info.n_frames, reader: info.reader })
            }
        }
    }

    fn for_table(self, input: &str, mut base: Config) -> Result<Plan> {
        base.input.table.rate_hz = self.rate_hz.or(base.input.table.rate_hz);
        let table = io::read_detections(input, &base.input.table_options())?;
        if table.scans.is_empty() {
            let e = Error::new(ErrorKind::Damaged, "the table has no rows: there is nothing to track");
            return Err(e.at(input));
        }
        let notes = table.warnings.iter().filter(|w| !table.lost.contains(w)).cloned().collect::<Vec<_>>();
        let turn = table.radar.as_ref().map(|r| (r.turn_s, r.unit));
        let mut plan = self.of_scans(table.scans, table.rate_hz, turn, base, table.format)?;
        plan.reasons.splice(0..0, notes);
        plan.lost = table.lost;
        Ok(plan)
    }

    /// The plan for detections made elsewhere.
    pub fn for_scans(self, scans: Vec<Scan>, rate_hz: f64, base: Config, reader: String) -> Result<Plan> {
        self.of_scans(scans, rate_hz, None, base, reader)
    }

    /// As [`Self::for_scans`]; `turn` is the time of a turn of the antenna and the unit of length, of a radar's plots.
    fn of_scans(
        self,
        scans: Vec<Scan>,
        rate_hz: f64,
        turn: Option<(f64, io::LengthUnit)>,
        base: Config,
        reader: String,
    ) -> Result<Plan> {
        let mut config = changed(base, &self.sets)?;
        let mut reasons = Vec::new();
        if self.config.is_some() {
            reasons.push("Configuration as given.".to_string());
        } else {
            match turn {
                Some((turn_s, unit)) => auto::for_radar(&scans, turn_s, unit, &mut config, &mut reasons),
                None => auto::for_detections(
                    &scans,
                    rate_hz,
                    io::LengthUnit::Pixel,
                    self.false_tracks_per_hour,
                    &mut config,
                    &mut reasons,
                ),
            }
            auto::report_whole(rate_hz, &mut config, &mut reasons);
            config = changed(config, &self.sets)?;
        }
        let total = Some(scans.len() as u64);
        Ok(Plan { input: Input::Scans(scans), config, reasons, lost: Vec::new(), total, reader })
    }
}

/// A sentence that names the detector's keys that are set in vain.
fn unused(config: &Config) -> Option<String> {
    let keys = config.detector.unused_keys();
    (!keys.is_empty()).then(|| format!("Without effect beside this detector.threshold: {}.", keys.join(", ")))
}

/// Every frame's detections: the tracker's configuration is learnt from all of them.
fn all_scans(mut source: Box<dyn FrameSource>, mut detector: PythonDetector) -> Result<(Vec<Scan>, Vec<String>)> {
    let mut scans = Vec::new();
    while let Some(frame) = source.next_frame()? {
        let mut scan = Scan::default();
        vision::Detector::detect(&mut detector, &frame, &mut scan)?;
        source.recycle(frame);
        scans.push(scan);
    }
    Ok((scans, source.warnings().to_vec()))
}
