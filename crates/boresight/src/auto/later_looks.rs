//! Targets that come later: the choice looks at the first frames, and a file may show nothing in them, or its bright aircraft first and a dark one after a cut.
//!
//! Where nothing is seen to move in the first frames the whole choice is made again of three places further on, and that in which most moves is taken ([`choice`]): a chain that is
//! there by chance gains little beside a target's. Where something does, targets of the other polarity are asked for ([`polarity`]):
//! Source: our own; the evidence is that of [`super::evidence`]. Over what was read ahead for the first pass, three times as many frames as the choice looked at are asked what moves
//! of the other polarity, with the same gaps as there. It counts where it surely gains more than what was chosen does in the same frames; by chance that is so once in three hundred
//! files. It is looked for from the first frame on, beside what was looked for before, or in its place where nothing of that moves: a thing that is bright and dark in turns comes in
//! pieces where both are looked for, so that both must be needed.
//! Limits: a target of another kind that comes beside one that was seen; what comes after the frames read ahead, and between the places looked at.

use super::choose::{Choice, choose_among};
use super::evidence::Evidence;
use super::first_scans::PROBE_FRAMES;
use super::looks;
use super::request::Request;
use super::spots::{self, Seen, Side};
use super::spread::growing;
use crate::io::Replay;
use crate::vision::threshold::{Polarity, ThresholdConfig};
use crate::{Config, Frame, FrameSource, Result, Scan, SourceInfo};

/// Places of the frames at which it is looked, each as long as the choice's own.
const LOOKS: usize = 3;

/// The choice by those later frames in which what moves gains most, if anything does; all frames that may be held are read for it.
/// # Errors
/// Frames of more than one size or pixel type.
pub(super) fn choice(frames: &mut Replay, base: &Config, request: &Request) -> Result<Option<Choice>> {
    let info = frames.info().clone();
    let ahead = frames.read_on(usize::MAX);
    let mut most: Option<Choice> = None;
    for start in starts(ahead.len()) {
        let window = &ahead[start..start + PROBE_FRAMES];
        let later = choose_among(window, &info, base, request)?;
        if later.gain > most.as_ref().map_or(0.0, |m| m.gain) {
            most = Some(later);
        }
    }
    if let Some(most) = &mut most {
        most.reasons.insert(0, "In the first frames nothing is seen to move: later ones were looked at.".into());
    }
    Ok(most)
}

/// The polarity to look for in the place of the configured one, with the reason, if targets of the other one move later; `scans` are what the detector made of `frames`.
/// # Errors
/// Frames of more than one size or pixel type.
pub(super) fn polarity(
    frames: &[Frame],
    scans: &[Scan],
    config: &Config,
    info: &SourceInfo,
    n_threads: usize,
) -> Result<Option<(Polarity, String)>> {
    let ThresholdConfig::Isolated(isolated) = &config.detector.threshold else { return Ok(None) };
    let Some(other) = isolated.polarity.opposite() else { return Ok(None) };
    let word = if other == Polarity::Dark { "dark" } else { "bright" };
    let area_px2 = (info.width * info.height) as f64;
    // What the run would not see is not looked for.
    let mut detector = spots::detector(other, info);
    if let ThresholdConfig::Isolated(of_other) = &mut detector.threshold {
        of_other.min_score = isolated.min_score;
    }
    for start in starts(frames.len().min(scans.len())) {
        let places: Vec<usize> = growing(PROBE_FRAMES).into_iter().map(|k| start + k).collect();
        let found = looks::scans(&detector, places.iter().map(|&k| &frames[k]), info, n_threads)?;
        let own: Vec<Scan> = places.iter().map(|&k| scans[k].clone()).collect();
        let side = |of_places: &[Scan]| {
            let all = on_their_way(scans, &places, of_places);
            Side::of(of_places, Evidence::of_scans(&all, area_px2))
        };
        let (own, of_other) = (side(&own), side(&found));
        if !of_other.chains.is_surely_more_than(&own.chains) {
            continue;
        }
        let at_s = frames[start].time.seconds_since(frames[0].time);
        let words = of_other.chains.words();
        let seen = match other {
            Polarity::Dark => Seen { bright: own, dark: of_other },
            _ => Seen { bright: of_other, dark: own },
        };
        if seen.polarity() != isolated.polarity {
            let own_moves = Evidence::of_scans(scans, area_px2).is_sure();
            let reason = format!(
                "From {at_s:.1} s on {word} targets move as well, {words}: {} looked for.",
                if own_moves { "both are" } else { "only they are" },
            );
            return Ok(Some((if own_moves { Polarity::Both } else { other }, reason)));
        }
    }
    Ok(None)
}

/// The first frames of the looks into `n` frames, behind those that the choice looked at.
fn starts(n: usize) -> Vec<usize> {
    let Some(room) = n.checked_sub(2 * PROBE_FRAMES) else { return Vec::new() };
    let mut all: Vec<usize> = (0..LOOKS).map(|k| PROBE_FRAMES + room * k / (LOOKS - 1)).collect();
    all.dedup();
    all
}

/// The scans of those places among the others, which tell the camera's way and nothing else.
fn on_their_way(scans: &[Scan], places: &[usize], found: &[Scan]) -> Vec<Scan> {
    let (Some(first), Some(last)) = (places.first(), places.last()) else { return Vec::new() };
    let mut next = places.iter().zip(found).peekable();
    (*first..=*last)
        .map(|k| {
            let scan = Scan::at(scans[k].index, scans[k].time).with_camera_motion(scans[k].camera_motion);
            match next.next_if(|(place, _)| **place == k) {
                Some((_, found)) => scan.with_detections(found.detections.clone()),
                None => scan.with_blind(true),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::in_memory::InMemory;
    use super::super::open::of_held;
    use super::super::scene;
    use super::super::second_look::Read;
    use super::*;
    use crate::{FrameIndex, Image, PixelKind, Pixels, Timestamp};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// Noise of two counts with a spot that moves by 2 px a frame: bright at first, dark from that frame on.
    fn frames(dark_from: usize, n: usize) -> (Vec<Frame>, SourceInfo) {
        with_spot(|k| if k < dark_from { 60.0 } else { -60.0 }, n)
    }

    /// The same with a spot of so many counts in each frame.
    fn with_spot(height: impl Fn(usize) -> f64, n: usize) -> (Vec<Frame>, SourceInfo) {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let frame = |k: usize| {
            let mut image = Image::filled(160, 120, 0u8);
            let height = height(k);
            for y in 0..120 {
                for (x, p) in image.row_mut(y).iter_mut().enumerate() {
                    let d2 = (x as f64 - 10.0 - 2.0 * (k % 70) as f64).powi(2) + (y as f64 - 50.0).powi(2);
                    let v = 120.0 + 2.0 * rng.sample::<f64, _>(StandardNormal) + height * (-0.5 * d2 / 4.0).exp();
                    *p = v.round() as u8;
                }
            }
            let time = Timestamp::from_secs_f64(0.04 * k as f64);
            Frame { index: FrameIndex(k as u64), time, pixels: Pixels::Gray8(image) }
        };
        let info = SourceInfo {
            label: "test".into(),
            reader: "test".into(),
            width: 160,
            height: 120,
            kind: PixelKind::Gray8,
            n_frames: Some(n as u64),
            rate_hz: Some(25.0),
            true_times: true,
        };
        ((0..n).map(frame).collect(), info)
    }

    fn later(chosen: Polarity, dark_from: usize, n: usize) -> Option<Polarity> {
        let (frames, info) = frames(dark_from, n);
        let mut config = Config::default();
        config.detector = spots::detector(chosen, &info);
        let scans = looks::scans(&config.detector, frames.iter(), &info, 1).unwrap();
        polarity(&frames, &scans, &config, &info, 1).unwrap().map(|p| p.0)
    }

    #[test]
    fn what_comes_later_is_looked_for_as_well() {
        assert_eq!(later(Polarity::Bright, 130, 200), Some(Polarity::Both));
        assert_eq!(later(Polarity::Bright, 0, 200), Some(Polarity::Dark), "nothing bright moves");
        assert_eq!(later(Polarity::Bright, 200, 200), None);
        assert_eq!(later(Polarity::Bright, 80, 90), None, "too short for a second look");
    }

    #[test]
    fn where_the_first_frames_show_nothing_later_ones_choose() {
        let chosen = |from: usize| {
            let (frames, info) = with_spot(|k| if k < from { 0.0 } else { -60.0 }, 144);
            let mut replay = Replay::new(Box::new(InMemory(frames.into_iter(), info)), PROBE_FRAMES).up_to(144);
            choice(&mut replay, &Config::default(), &Request::default()).unwrap()
        };
        let later = chosen(60).unwrap();
        assert!(
            later.is_evident() && later.reasons[1].contains("of frame 48 and the next 1.9 s"),
            "{:?}",
            later.reasons
        );
        // It finds the spot, at (70, 50) in frame 100.
        let (frames, info) = with_spot(|_| -60.0, 144);
        let mut detector = crate::vision::build(&later.config.detector, &info).unwrap();
        let mut scan = Scan::default();
        frames[60..=100].iter().for_each(|f| detector.detect(f, &mut scan).unwrap());
        let near = |d: &crate::Detection| (d.position - nalgebra::Vector2::new(70.0, 50.0)).norm() < 3.0;
        assert!(scan.detections.iter().any(near), "{:?}: {:?}", later.reasons, scan.detections);
        assert!(chosen(200).is_none(), "there is nothing in any of them");
    }

    #[test]
    fn frames_held_choose_where_they_show_what_moves_and_else_say_nothing() {
        let chosen = |height: f64| {
            let (mut frames, info) = with_spot(|_| height, 100);
            // A post, by which the camera is seen to stand: before one that may move large things leave it open what moves.
            for frame in &mut frames {
                let Pixels::Gray8(image) = &mut frame.pixels else { panic!("frames of bytes") };
                (80..115).for_each(|y| image.row_mut(y)[100..106].fill(220));
            }
            let scene = scene::look(&frames[..PROBE_FRAMES], &info).unwrap();
            let mut replay = Replay::new(Box::new(InMemory(frames.into_iter(), info)), 100);
            let small = Read::Coloured(Vec::new());
            of_held(&small, &mut replay, &scene, None, &Config::default(), &Request::default()).unwrap()
        };
        // Every third of 100 frames of 25 Hz, to the last, where the first look ends at 1.9 s.
        let reasons = chosen(-60.0).unwrap().reasons;
        assert!(reasons[0].contains("from 48 frames of the first 4.0 s"), "{reasons:?}");
        assert!(chosen(0.0).is_none(), "more are worth another reading");
    }

    #[test]
    fn of_later_frames_those_in_which_most_moves_choose() {
        // A bright spot for half a second, and later a dark one that stays.
        let height = |k: usize| match k {
            48..=60 => 60.0,
            150.. => -60.0,
            _ => 0.0,
        };
        let (frames, info) = with_spot(height, 300);
        let at = |start: usize| {
            let window = &frames[start..start + PROBE_FRAMES];
            let request = Request::default();
            choose_among(window, &info, &Config::default(), &request).unwrap().gain
        };
        let [short, long] = [at(48), at(150)];
        assert!(0.0 < short && short < long, "{short} {long}");
        let mut replay = Replay::new(Box::new(InMemory(frames.into_iter(), info)), PROBE_FRAMES).up_to(300);
        let later = choice(&mut replay, &Config::default(), &Request::default()).unwrap().unwrap();
        assert!(later.gain >= long && !later.reasons[1].contains("of frame 48"), "{:?}", later.reasons);
    }

    #[test]
    fn the_looks_lie_behind_the_first_one_and_within_the_frames() {
        assert_eq!(starts(95), Vec::<usize>::new());
        assert_eq!(starts(96), [48]);
        assert_eq!(starts(300), [48, 150, 252]);
    }
}
