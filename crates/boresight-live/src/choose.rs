//! The automatic choice for a stream: its first frames are kept while they are looked at, and tracked afterwards, so that looking costs none.

use crate::source::{Arrived, Content};
use boresight::auto::{self, Adaptation, DetectorKind, Request};
use boresight::io::LengthUnit;
use boresight::vision::Detector;
use boresight::{Config, Error, ErrorKind, Frame, FrameSource, Result, Scan, SourceInfo, vision};
use std::time::{Instant, SystemTime};

/// Most memory that kept frames take, bytes.
const MOST_BYTES: usize = 192 << 20;
/// Most frames or scans kept: a second look at more would keep the stream waiting.
const MOST: usize = 96;

/// What was kept of an arrival whose frame is looked at.
type Clock = (Instant, SystemTime);

/// First frames or scans, until there are enough.
#[derive(Default)]
pub struct Kept {
    frames: Vec<Frame>,
    scans: Vec<Scan>,
    clocks: Vec<Clock>,
    info: Option<SourceInfo>,
    bytes: usize,
}

/// What is ready to run: the kept things come first.
pub struct Ready {
    /// The configuration.
    pub config: Config,
    /// Why it is what it is.
    pub reasons: Vec<String>,
    /// Frame to detections; `None` for a stream of detections.
    pub detector: Option<Box<dyn Detector>>,
    /// What follows the scans where the configuration was chosen, but for what was set by hand.
    pub adaptation: Option<Adaptation>,
    /// What was kept.
    pub kept: Vec<Arrived>,
}

/// What is known of a frame whose source says nothing.
pub fn info_of(frame: &Frame, label: &str) -> SourceInfo {
    SourceInfo {
        label: label.to_string(),
        reader: "live".into(),
        width: frame.pixels.width(),
        height: frame.pixels.height(),
        kind: frame.pixels.kind(),
        n_frames: None,
        rate_hz: None,
        true_times: true,
    }
}

impl Kept {
    /// Keeps one more; a frame of another size than those before is dropped, and `false`.
    pub fn keep(&mut self, arrived: Arrived, label: &str) -> bool {
        match arrived.content {
            Content::Scan(mut scan) | Content::Adapted(mut scan, _) => {
                scan.index.0 = self.scans.len() as u64;
                // One that came late takes its place: here there is time.
                let at = self.scans.partition_point(|s| s.time <= scan.time);
                self.scans.insert(at, scan);
                self.clocks.insert(at, (arrived.at, arrived.wall));
                return true;
            }
            Content::Frame(mut frame) => {
                let mut info = arrived.info.as_deref().cloned().unwrap_or_else(|| info_of(&frame, label));
                (info.width, info.height, info.kind) =
                    (frame.pixels.width(), frame.pixels.height(), frame.pixels.kind());
                let first = self.info.get_or_insert(info.clone());
                if (first.width, first.height, first.kind) != (info.width, info.height, info.kind) {
                    return false;
                }
                self.bytes += info.width.saturating_mul(info.height).saturating_mul(info.kind.bytes());
                frame.index.0 = self.frames.len() as u64;
                self.frames.push(frame);
            }
        }
        self.clocks.push((arrived.at, arrived.wall));
        true
    }

    /// Whether there is nothing yet.
    pub fn is_empty(&self) -> bool {
        self.clocks.is_empty()
    }

    /// Whether they cover this time, s, or are as many as may be kept.
    pub fn is_enough(&self, learn_s: f64) -> bool {
        let time = |k: usize| self.frames.get(k).map(|f| f.time).or_else(|| self.scans.get(k).map(|s| s.time));
        let n = self.clocks.len();
        let covers = n > 1 && matches!((time(0), time(n - 1)), (Some(a), Some(b)) if b.seconds_since(a) >= learn_s);
        covers || n >= MOST || self.bytes >= MOST_BYTES
    }

    /// Chooses by what was kept.
    /// # Errors
    /// Frames that are not alike, a parameter out of its range.
    pub fn choose(self, base: &Config, sets: &[String], detector: Option<DetectorKind>) -> Result<Ready> {
        let set = |config: Config| sets.iter().try_fold(config, |c, s| c.with(s));
        let request = Request { detector, ..Request::default() };
        let Some(mut info) = self.info else {
            let rate_hz = mean_rate_hz(&self.scans).unwrap_or(base.input.rate_hz);
            let (mut config, mut reasons) = (set(base.clone())?, Vec::new());
            auto::for_detections(&self.scans, rate_hz, LengthUnit::Pixel, None, &mut config, &mut reasons);
            let contents = self.scans.into_iter().map(Content::Scan);
            let kept = contents.zip(self.clocks).map(|(content, c)| arrived(content, c)).collect();
            let config = set(config)?;
            let adaptation = adaptation(&config, sets);
            return Ok(Ready { config, reasons, detector: None, adaptation, kept });
        };
        info.n_frames = Some(self.frames.len() as u64);
        let memory = Box::new(Memory { frames: self.frames.into_iter(), info });
        let (mut frames, mut choice) = auto::read_and_choose(memory, None, base, &request)?;
        if choice.config.input.colour != base.input.colour {
            return Err(Error::new(ErrorKind::Unsupported, "a colour cannot be learnt from frames that were read without")
                .hint("write a configuration with `boresight track --detector colour` on a recording, and give it by --config"));
        }
        let detector = auto::learn(&mut frames, &mut choice, &request, set)?;
        let config = choice.config;
        let mut kept = Vec::with_capacity(self.clocks.len());
        for clock in self.clocks {
            if let Some(frame) = frames.next_frame()? {
                kept.push(arrived(Content::Frame(frame), clock));
            }
        }
        let adaptation = adaptation(&config, sets);
        Ok(Ready { config, reasons: choice.reasons, detector: Some(detector), adaptation, kept })
    }

    /// Takes the configuration as it is given.
    /// # Errors
    /// A parameter that does not fit the frames.
    pub fn given(self, mut config: Config) -> Result<Ready> {
        self.info.iter().for_each(|info| config.fill_in(info));
        let detector = self.info.as_ref().map(|info| vision::build(&config.detector, info)).transpose()?;
        let contents = self.frames.into_iter().map(Content::Frame).chain(self.scans.into_iter().map(Content::Scan));
        let kept = contents.zip(self.clocks).map(|(content, c)| arrived(content, c)).collect();
        Ok(Ready { config, reasons: vec!["Configuration as given.".into()], detector, adaptation: None, kept })
    }
}

fn adaptation(config: &Config, sets: &[String]) -> Option<Adaptation> {
    let mut adaptation = Adaptation::of(&config.tracker)?;
    sets.iter().for_each(|set| adaptation.freeze(set.split('=').next().unwrap_or_default()));
    Some(adaptation)
}

fn arrived(content: Content, (at, wall): Clock) -> Arrived {
    Arrived { content, info: None, at, wall }
}

fn mean_rate_hz(scans: &[Scan]) -> Option<f64> {
    let (first, last) = (scans.first()?, scans.last()?);
    let span_s = last.time.seconds_since(first.time);
    (span_s > 0.0).then(|| (scans.len() - 1) as f64 / span_s)
}

/// Frames in memory.
struct Memory {
    frames: std::vec::IntoIter<Frame>,
    info: SourceInfo,
}

impl FrameSource for Memory {
    fn info(&self) -> &SourceInfo {
        &self.info
    }

    fn next_frame(&mut self) -> Result<Option<Frame>> {
        Ok(self.frames.next())
    }
}
