//! From an input's name to what runs it, in the order of the steps:
//!
//! 1. open the input and read its first frames ahead ([`Replay`] hands them out again: a stream is read once, and no frame is lost);
//! 2. look at them as a whole; a file whose camera stands still is read a second time, further on and in colour ([`super::second_look`]);
//! 3. choose detector and tracker;
//! 4. run the detector over the frames read ahead and learn noise and motion from its detections ([`learn`]);
//! 5. hand on the frames. Only where a colour was chosen is the file opened anew: grey frames cannot be turned into coloured ones.

use super::choose::{Choice, choose_seen};
use super::detection_statistics::{self, Found, RATE_WITHOUT_EFFECT};
use super::evidence::Evidence;
use super::first_pass::FirstPass;
use super::request::{DetectorKind, Request};
use super::scene::{self, Camera};
use super::second_look;
use super::{contest, first_scans, initiation_score, noise, speed};
use crate::io::{LengthUnit, MOST_BYTES, Replay, frames_ahead};
use crate::track::{Report, Tracking};
use crate::vision::Detector;
use crate::vision::threshold::ThresholdConfig;
use crate::{Config, Error, Frame, FrameSource, Result, Scan};
use std::ffi::OsStr;

/// Frames looked at by the automatic choice.
pub const PROBE_FRAMES: usize = 48;

/// Things that stand still and are reported where nothing moves, a frame at most: as many as one looks at one by one.
const FEW_STILL: f64 = 3.0;

/// An input ready to be run: its frames, and what turns them into tracks.
pub struct Opened {
    /// The frames, from the first on.
    pub frames: Box<dyn FrameSource>,
    /// Frame to detections.
    pub detector: Box<dyn Detector>,
    /// Detections to tracks.
    pub tracker: Box<dyn Tracking>,
    /// The configuration chosen.
    pub config: Config,
    /// Why it is what it is, a sentence each.
    pub reasons: Vec<String>,
}

opaque_debug!(Opened);

/// Opens an input and proposes its configuration; the source hands out every frame from the first on.
/// # Errors
/// An input that cannot be opened, or whose first frames differ in size or pixel type.
pub fn open_and_choose(input: impl AsRef<OsStr>, base: &Config, request: &Request) -> Result<(Replay, Choice)> {
    let input = input.as_ref();
    let read = |config: &Config| -> Result<Replay> {
        let source = config.input.mend(crate::io::open(input, &config.input.open_options())?)?;
        // A stream waits for nothing longer than the choice needs.
        let most = if second_look::can_be_opened_twice(input) { first_scans::MOST_SCANS } else { PROBE_FRAMES };
        let n = frames_ahead(source.info(), most, MOST_BYTES);
        // The rest of them is read when it is detected, so that decoding and detecting overlap and the second look finds the memory free.
        Ok(Replay::new(source, n.min(PROBE_FRAMES)).up_to(n))
    };
    let mut frames = read(base)?;
    let again = || match second_look::can_be_opened_twice(input) {
        true => second_look::frames(input, base, PROBE_FRAMES),
        false => Vec::new(),
    };
    let mut choice = choose_from(&mut frames, again, base, request)?;
    if second_look::can_be_opened_twice(input) {
        let rate_hz = frames.info().rate_hz.unwrap_or(base.input.rate_hz);
        choice.report_whole(rate_hz);
    }
    if choice.config.input.colour != base.input.colour {
        frames = read(&choice.config)?;
    }
    Ok((frames, choice))
}

/// As [`open_and_choose`], for frames that the caller has: `again` hands out the same frames anew, if they can be had a second time.
/// # Errors
/// First frames that cannot be read, or that differ in size or pixel type.
pub fn read_and_choose(
    source: Box<dyn FrameSource>,
    again: Option<&mut dyn FrameSource>,
    base: &Config,
    request: &Request,
) -> Result<(Replay, Choice)> {
    let info = source.info().clone();
    let most = if info.n_frames.is_some() || again.is_some() { first_scans::MOST_SCANS } else { PROBE_FRAMES };
    let n = frames_ahead(&info, most, MOST_BYTES);
    let mut frames = Replay::new(source, n.min(PROBE_FRAMES)).up_to(n);
    let again = || again.map(|source| second_look::spread(source, PROBE_FRAMES)).unwrap_or_default();
    let choice = choose_from(&mut frames, again, base, request)?;
    Ok((frames, choice))
}

/// The choice from frames read ahead; `again` gives those of the second look, which only a fixed camera or a colour asks for.
fn choose_from(
    frames: &mut Replay,
    again: impl FnOnce() -> Vec<Frame>,
    base: &Config,
    request: &Request,
) -> Result<Choice> {
    let info = frames.info().clone();
    let scene = scene::look(probed(frames.ahead()), &info)?;
    let look_again = scene.camera == Camera::Fixed || request.detector == Some(DetectorKind::Colour);
    let second = if look_again { again() } else { Vec::new() };
    choose_seen(probed(frames.ahead()), scene, &second, &info, base, request)
}

/// The frames that are looked at for the choice.
fn probed(ahead: &[Frame]) -> &[Frame] {
    &ahead[..ahead.len().min(PROBE_FRAMES)]
}

/// Runs the detector chosen over the frames read ahead, learns noise and motion of the targets from its detections, and returns it: it goes on
/// where they end, so no frame is detected twice. What `set` changes in a configuration holds for this first pass as well, and is not overruled by what it learns.
/// # Errors
/// A parameter out of its range; what `set` refuses.
pub fn learn<E: From<Error>>(
    frames: &mut Replay,
    choice: &mut Choice,
    request: &Request,
    set: impl Fn(Config) -> Result<Config, E>,
) -> Result<Box<dyn Detector>, E> {
    choice.change(|c| set(std::mem::take(&mut c.config)).map(|config| c.config = config))?;
    let area_px2 = (frames.info().width * frames.info().height).max(1) as f64;
    let mut pass = first_pass(frames, &choice.config, request)?;
    let mut evidence = Evidence::of_scans(pass.scans(), area_px2);
    if let Some(other) = choice.runner_up.take()
        && let Some(reason) = contest::lost(&evidence, pass.scans(), choice, &other)
    {
        *choice = *other;
        choice.reasons.push(reason);
        pass = first_pass(frames, &choice.config, request)?;
        evidence = Evidence::of_scans(pass.scans(), area_px2);
    }
    learn_from(&mut pass, &evidence, frames, choice, request)?;
    choice.change(|c| set(std::mem::take(&mut c.config)).map(|config| c.config = config))?;
    Ok(Box::new(pass))
}

/// Learns from the scans of a first pass; where the detector is changed by it, the pass is made anew.
fn learn_from(
    pass: &mut FirstPass,
    evidence: &Evidence,
    frames: &mut Replay,
    choice: &mut Choice,
    request: &Request,
) -> Result<()> {
    let false_tracks_per_hour = request.false_tracks_per_hour;
    let area_px2 = (frames.info().width * frames.info().height).max(1) as f64;
    speed::learn(evidence, LengthUnit::Pixel, &mut choice.config, &mut choice.reasons);
    let assumed = choice.clone();
    let found = statistics(pass.scans(), area_px2, false_tracks_per_hour, choice)?;
    let raised = found.as_ref().and_then(|f| initiation_score::raised(f.per_scan, area_px2, &choice.config));
    if let Some((score, reason)) = raised {
        *choice = assumed;
        choice.config.tracker.min_initiation_score = score;
        choice.reasons.push(reason);
        let assumed = choice.clone();
        let found = statistics(pass.scans(), area_px2, false_tracks_per_hour, choice)?;
        if let Some((score, reason)) = found.and_then(|f| initiation_score::kept(f.least_score, &assumed.config)) {
            *choice = assumed;
            if let ThresholdConfig::Isolated(isolated) = &mut choice.config.detector.threshold {
                isolated.min_score = score;
            }
            choice.reasons.push(reason);
            // Other blobs fall away with those left out, so all is detected anew: what is learnt is learnt of what the run sees.
            *pass = first_pass(frames, &choice.config, request)?;
            statistics(pass.scans(), area_px2, false_tracks_per_hour, choice)?;
        }
        return Ok(());
    }
    let mut fainter = assumed.clone();
    let clear_s = found.as_ref().map_or(&[][..], |f| &f.spans_s);
    if initiation_score::learn(evidence, clear_s, &mut fainter.config, &mut fainter.reasons) {
        let more = statistics(pass.scans(), area_px2, false_tracks_per_hour, &mut fainter)?;
        if more.is_some_and(|f| f.n_targets > 0) {
            *choice = fainter;
            return Ok(());
        }
    }
    if choice.config.tracker.report == Report::Moving && found.is_some_and(|f| f.n_targets == 0) {
        // Who films a thing that hovers or stands wants to see it, if there is nothing else and not a landscape of them.
        let mut still = assumed.clone();
        still.config.tracker.report = Report::All;
        let things = statistics(pass.scans(), area_px2, false_tracks_per_hour, &mut still)?;
        if let Some(things) = things.filter(|f| f.n_targets > 0 && f.per_scan <= FEW_STILL) {
            still.reasons.push(format!(
                "Nothing moves by itself, but {:.1} things a frame stand there: they are reported.",
                things.per_scan
            ));
            *choice = still;
        }
    }
    Ok(())
}

/// The detector of a configuration with the scans that it makes of the frames read ahead.
fn first_pass(frames: &mut Replay, config: &Config, request: &Request) -> Result<FirstPass> {
    let mut detector = crate::vision::build(&config.detector, frames.info())?;
    crate::pipeline::prime(&mut *detector, frames);
    let mut pass = FirstPass::new(detector);
    let mut at_once = pass.at_once(request.n_threads());
    let mut taken = 0;
    loop {
        let frames = frames.read_on(taken + at_once.n_frames()).get(taken..).unwrap_or_default();
        if frames.is_empty() || !pass.take(frames, &mut at_once) {
            return Ok(pass);
        }
        taken += frames.len();
    }
}

/// Learns noise and motion, and of points what the detections are made of; of regions this is not known, and their rule stays.
fn statistics(
    scans: &[Scan],
    area_px2: f64,
    false_tracks_per_hour: Option<f64>,
    choice: &mut Choice,
) -> Result<Option<Found>> {
    noise::learn(scans, area_px2, LengthUnit::Pixel, &mut choice.config, &mut choice.reasons)?;
    if !is_of_points(&choice.config.detector.threshold) {
        if false_tracks_per_hour.is_some() {
            choice.reasons.push(RATE_WITHOUT_EFFECT.to_string());
        }
        return Ok(None);
    }
    let Choice { config, reasons, .. } = choice;
    // Scans in which nothing could be detected are no misses.
    let seeing: Vec<Scan>;
    let scans = if scans.iter().any(|s| s.blind) {
        seeing = scans.iter().filter(|s| !s.blind).cloned().collect();
        &seeing
    } else {
        scans
    };
    detection_statistics::learn(scans, area_px2, false_tracks_per_hour, config, reasons).map(Some)
}

/// Whether what is detected is a point or a blob that stands alone: one detection a target, false ones anywhere. Regions come in pieces, which lie where
/// targets are; what comes of counting those as independent is no probability, so regions are confirmed by the number of their hits.
fn is_of_points(threshold: &ThresholdConfig) -> bool {
    matches!(
        threshold,
        ThresholdConfig::Isolated(_)
            | ThresholdConfig::Spot(_)
            | ThresholdConfig::Cfar(_)
            | ThresholdConfig::Integrate(_)
    )
}

/// Opens frames and chooses a detector and a tracker by looking at the first [`PROBE_FRAMES`] of them, of a file also later ones.
///
/// `base` says how the input is read; its other parts are where the choice starts from.
#[cfg_attr(feature = "video", doc = "```")]
#[cfg_attr(not(feature = "video"), doc = "```no_run")]
/// use boresight::{Config, Scan, TrackStatus, auto};
///
/// # fn main() -> boresight::Result<()> {
/// let clip = concat!(env!("CARGO_MANIFEST_DIR"), "/../../samples/ir_drone/IR_DRONE_046.mp4");
/// let mut run = auto::open(clip, &Config::default())?;
/// let (mut scan, mut confirmed) = (Scan::default(), 0);
/// for _ in 0..10 {
///     let Some(frame) = run.frames.next_frame()? else { break };
///     run.detector.detect(&frame, &mut scan)?;
///     confirmed = run.tracker.step(&scan)?.iter().filter(|t| t.status == TrackStatus::Confirmed).count();
/// }
/// assert_eq!(confirmed, 1); // one drone before sky and trees
/// # Ok(())
/// # }
/// ```
/// # Errors
/// An input that cannot be read; a parameter out of its range.
pub fn open(input: impl AsRef<OsStr>, base: &Config) -> Result<Opened> {
    let (mut frames, mut choice) = open_and_choose(input, base, &Request::default())?;
    let detector = learn(&mut frames, &mut choice, &Request::default(), Ok::<_, Error>)?;
    Ok(Opened {
        frames: Box::new(frames),
        detector,
        tracker: crate::track::build(&choice.config.tracker)?,
        config: choice.config,
        reasons: choice.reasons,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::DetectorConfig;
    use crate::vision::isolated::IsolatedConfig;
    use crate::{FrameIndex, Image, PixelKind, Pixels, SourceInfo, Timestamp};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const SIZE: [usize; 2] = [160, 120];

    struct Memory(std::vec::IntoIter<Frame>, SourceInfo);

    impl FrameSource for Memory {
        fn info(&self) -> &SourceInfo {
            &self.1
        }

        fn next_frame(&mut self) -> Result<Option<Frame>> {
            Ok(self.0.next())
        }
    }

    /// 100 frames on which `draw` has drawn, and what describes them.
    fn filmed(draw: impl Fn(u64, &mut Image<u8>)) -> (Vec<Frame>, SourceInfo) {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let frames = (0..100u64)
            .map(|k| {
                let noise = (0..SIZE[0] * SIZE[1]).map(|_| 60 + rng.random_range(0..6u8)).collect();
                let mut image = Image::from_vec(SIZE[0], SIZE[1], noise).unwrap();
                draw(k, &mut image);
                Frame {
                    index: FrameIndex(k),
                    time: Timestamp::from_secs_f64(0.04 * k as f64),
                    pixels: Pixels::Gray8(image),
                }
            })
            .collect();
        let info = SourceInfo {
            label: String::new(),
            reader: String::new(),
            width: SIZE[0],
            height: SIZE[1],
            kind: PixelKind::Gray8,
            n_frames: Some(100),
            rate_hz: Some(25.0),
            true_times: true,
        };
        (frames, info)
    }

    /// Draws a bright square of 4 px.
    fn square(image: &mut Image<u8>, [x, y]: [f64; 2], value: u8) {
        (0..4).for_each(|dy| image.row_mut(y as usize + dy)[x as usize..x as usize + 4].fill(value));
    }

    /// The choice that is learnt from, for isolated blobs of at least this score.
    fn assumed(min_score: f64, report: Report) -> Choice {
        let mut config = Config::default();
        config.detector = DetectorConfig {
            threshold: ThresholdConfig::Isolated(IsolatedConfig { min_score, ..IsolatedConfig::default() }),
            ..DetectorConfig::default()
        };
        config.tracker.report = report;
        Choice::alone(config, Vec::new())
    }

    /// What is reported of noise with bright squares at these places and speeds, px a frame.
    fn reported(squares: &[([f64; 2], f64)]) -> (Report, Vec<String>) {
        let (frames, info) = filmed(|k, image| {
            squares.iter().for_each(|([x, y], speed)| square(image, [x + speed * k as f64, *y], 200));
        });
        let mut choice = assumed(IsolatedConfig::default().min_score, Report::Moving);
        let mut frames = Replay::new(Box::new(Memory(frames.into_iter(), info)), 100);
        learn(&mut frames, &mut choice, &Request::default(), Ok::<_, Error>).unwrap();
        (choice.config.tracker.report, choice.reasons)
    }

    #[test]
    fn where_specks_are_left_out_the_scans_made_ahead_are_those_of_the_configuration_that_is_written() {
        // Twelve bright squares, and forty faint specks that stay for eight frames each.
        let (frames, info) = filmed(|k, image| {
            (0..12).for_each(|i| {
                let (column, row) = (i % 4, i / 4);
                square(image, [8.0 + 36.0 * f64::from(column) + 0.2 * k as f64, 10.0 + 40.0 * f64::from(row)], 200);
            });
            let mut specks = ChaCha8Rng::seed_from_u64(100 + k / 8);
            for _ in 0..40 {
                let place = [specks.random_range(4.0..150.0), specks.random_range(4.0..110.0)];
                if place[1] as usize % 40 > 20 {
                    square(image, place, 75 + specks.random_range(0..10));
                }
            }
        });
        let mut choice = assumed(2.5, Report::All);
        choice.config.detector.camera = crate::camera::CameraConfig::Moving;
        choice.config.tracker.min_initiation_score = 4.0;
        let mut replay = Replay::new(Box::new(Memory(frames.clone().into_iter(), info.clone())), 48).up_to(60);
        let mut learnt = learn(&mut replay, &mut choice, &Request::default(), Ok::<_, Error>).unwrap();
        let ThresholdConfig::Isolated(isolated) = &choice.config.detector.threshold else { panic!("another detector") };
        assert!(isolated.min_score > 2.5, "{:?}", choice.reasons);
        let mut anew = crate::vision::build(&choice.config.detector, &info).unwrap();
        for frame in &frames {
            let [mut a, mut b] = [Scan::default(), Scan::default()];
            learnt.detect(frame, &mut a).unwrap();
            anew.detect(frame, &mut b).unwrap();
            assert_eq!(format!("{a:?}"), format!("{b:?}"));
        }
    }

    #[test]
    fn what_stands_is_reported_where_nothing_moves_and_only_there() {
        let still = ([40.0, 40.0], 0.0);
        let (report, reasons) = reported(&[still]);
        assert_eq!(report, Report::All, "{reasons:?}");
        assert!(reasons.iter().any(|r| r.contains("Nothing moves by itself")));
        assert_eq!(reported(&[still, ([20.0, 80.0], 1.0)]).0, Report::Moving);
        let many: Vec<([f64; 2], f64)> =
            (0..8).map(|i| ([20.0 + 30.0 * f64::from(i % 4), 30.0 + 40.0 * f64::from(i / 4)], 0.0)).collect();
        assert_eq!(reported(&many).0, Report::Moving, "eight things are a landscape");
    }
}
