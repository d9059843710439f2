//! Faint targets: where hardly anything stands clear of its surroundings, the detector with a stated rate of false alarms may still find more than
//! that rate explains.
//!
//! Source: our own; the test is Poisson's. Over the frames looked at, the number of false alarms has at most the mean and the variance 3 × rate × frames.
//! Beside clear targets it is taken where it finds all of them, others that move, and no more than such false alarms ([`beside`]): the score of isolated ones counts the noise of a pixel and that of the ring around, so that
//! a spot of four times the noise starts no track.
//! Limits: texture hides what is as strong as texture; there the detector for isolated targets looks at each one's own surroundings.

use super::chains::Chain;
use super::evidence::{Evidence, SURE_GAIN};
use super::ground::Ground;
use super::looks;
use super::scene::{Camera, Scene};
use super::sightings::Sightings;
use super::spots::{self, Seen};
use super::spread::growing;
use crate::vision::cfar::CfarConfig;
use crate::vision::config::DetectorConfig;
use crate::vision::threshold::{Polarity, ThresholdConfig};
use crate::{Config, Frame, Result, Scan, SourceInfo};

/// False alarms a frame that the tracker can bear: at 320 x 240 px and 5 px a frame, three within five frames and a gate of 50 px² meet by
/// chance in some 3e-6 of the frames, twice in eight hours.
const FALSE_ALARMS_PER_FRAME: f64 = 1.0;
/// False alarms on real frames may be so many times the number asked for; docs/detect.md measured 1.3 at one a frame, texture may add to that.
const REAL_FACTOR: f64 = 3.0;
/// Deviations by which the number found must exceed the number of false alarms.
const SURE_STDS: f64 = 5.0;

/// Faint targets of one polarity.
#[derive(Clone, Debug, PartialEq)]
pub struct Faint {
    /// Brighter or darker than the ground.
    pub polarity: Polarity,
    /// Detections a frame.
    pub per_frame: f64,
    /// Chains of these.
    pub chains: Evidence,
}

impl Faint {
    fn of(polarity: Polarity, scans: &[Scan], chains: Evidence) -> Self {
        let n: usize = scans.iter().map(|s| s.detections.len()).sum();
        Self { polarity, per_frame: n as f64 / scans.len().max(1) as f64, chains }
    }
}

fn detector(polarity: Polarity) -> DetectorConfig {
    let cfar = CfarConfig { false_alarms_per_frame: FALSE_ALARMS_PER_FRAME, polarity, ..CfarConfig::default() };
    DetectorConfig { threshold: ThresholdConfig::Cfar(cfar), max_detections: Some(5000), ..DetectorConfig::default() }
}

/// What is found at that rate in the frames, with bright targets and with dark ones, and the number of frames looked at.
/// # Errors
/// Frames of more than one size or pixel type.
pub fn count(frames: &[Frame], ground: &[Ground], info: &SourceInfo, n_threads: usize) -> Result<([Faint; 2], f64)> {
    let places = growing(frames.len());
    let side = |polarity| look_at(frames, &places, ground, polarity, info, n_threads);
    Ok(([side(Polarity::Bright)?, side(Polarity::Dark)?], places.len() as f64))
}

fn look_at(
    frames: &[Frame],
    places: &[usize],
    ground: &[Ground],
    polarity: Polarity,
    info: &SourceInfo,
    n_threads: usize,
) -> Result<Faint> {
    let scans = looks::scans(&detector(polarity), places.iter().map(|&k| &frames[k]), info, n_threads)?;
    Ok(Faint::of(polarity, &scans, Evidence::of_looks(&scans, places, ground, info)))
}

/// Of both polarities the one whose chains gain more, or both if the lesser one's go beside those; where neither moves, that of which there are more.
pub fn better([bright, dark]: [Faint; 2]) -> Faint {
    let of_dark = match bright.chains.is_sure() || dark.chains.is_sure() {
        true => dark.chains.gain() > bright.chains.gain(),
        false => dark.per_frame > bright.per_frame,
    };
    let (most, other) = if of_dark { (dark, bright) } else { (bright, dark) };
    let beside = other.chains.gain_beside(&most.chains) > SURE_GAIN;
    let polarity = if most.chains.is_sure() && beside { Polarity::Both } else { most.polarity };
    Faint { polarity, ..most }
}

/// Faint targets beside or in the place of the `isolated` ones.
///
/// Where these are clear, those beside them ([`beside`]). Else, if their chains surely gain more than those of the isolated ones, or if they are most of the many of which a part would never start a
/// track, or if there are more detections than false alarms and nothing moves surely.
/// # Errors
/// Frames of more than one size or pixel type.
pub fn look(
    frames: &[Frame],
    scene: &Scene,
    isolated: &Seen,
    info: &SourceInfo,
    n_threads: usize,
) -> Result<Option<Faint>> {
    let ground = &scene.ground[..];
    if !isolated.is_poor() && isolated.moves() && isolated.many_faint().is_none() {
        // Before a camera that moves what stands nearer than the ground goes a way of its own as well.
        let may_be_others = scene.camera != Camera::Moving && !isolated.are_many();
        return if may_be_others { beside(frames, ground, isolated, info, n_threads) } else { Ok(None) };
    }
    let (seen, looks) = count(frames, ground, info, n_threads)?;
    let seen = better(seen);
    let (polarity, chains) = isolated.most();
    if !seen.chains.is_sure() && !chains.is_sure() {
        let expected: f64 = REAL_FACTOR * FALSE_ALARMS_PER_FRAME * looks;
        if seen.per_frame * looks > expected + SURE_STDS * expected.sqrt() {
            return Ok(Some(seen));
        }
        // One or two that move among as many false alarms show in their chains alone, and these need all frames.
        let all: Vec<usize> = (0..frames.len()).collect();
        let longer = look_at(frames, &all, ground, seen.polarity, info, n_threads)?;
        return Ok(longer.chains.is_sure().then_some(longer));
    }
    let finds_most = |n: &f64| seen.polarity == polarity && 2.0 * seen.per_frame > *n;
    let many = isolated.many_faint().filter(finds_most).is_some() && seen.chains.is_sure();
    let mut more = many || seen.chains.is_surely_more_than(chains);
    if !more && !chains.is_surely_more_than(&seen.chains) {
        // What is gone after a second shows in few of the frames looked at.
        let all: Vec<usize> = (0..frames.len()).collect();
        let of_isolated = spots::look_at(frames, &all, ground, polarity, info, n_threads)?;
        more = look_at(frames, &all, ground, seen.polarity, info, n_threads)?
            .chains
            .is_surely_more_than(&of_isolated.chains);
    }
    Ok(more.then_some(seen))
}

/// Faint targets beside clear ones of the same polarity: all chains that would start a track as `isolated` ones are found, what is left without them moves, and the rest of it is no more than the false alarms asked for:
/// nothing that the rate does not know of is there, no texture, wave or leaf.
fn beside(
    frames: &[Frame],
    ground: &[Ground],
    isolated: &Seen,
    info: &SourceInfo,
    n_threads: usize,
) -> Result<Option<Faint>> {
    let (polarity, clear) = isolated.most();
    if isolated.polarity() != polarity {
        // Targets of the other polarity are clear as well.
        return Ok(None);
    }
    let places = growing(frames.len());
    let scans = looks::scans(&detector(polarity), places.iter().map(|&k| &frames[k]), info, n_threads)?;
    let mut left = Sightings::of_looks(&scans, &places, ground);
    let area_px2 = (info.width * info.height) as f64;
    let seen = Faint::of(polarity, &scans, Evidence::of(&left, area_px2));
    let starts = |c: &&Chain| c.hits.iter().any(|h| h.1.score >= spots::INITIATION_SCORE);
    for chain in clear.moving.iter().filter(starts) {
        let same: Vec<&Chain> = seen.chains.moving.iter().filter(|c| chain.goes_with(c)).collect();
        if same.is_empty() {
            return Ok(None);
        }
        for (k, hit) in same.into_iter().chain([chain]).flat_map(|c| &c.hits) {
            left[*k].all.retain(|s| !s.touches(hit));
        }
    }
    let moving = Evidence::of(&left, area_px2);
    let n_others = left.iter().map(|s| s.all.len() as f64).sum::<f64>() - moving.n_hits() as f64;
    let expected = REAL_FACTOR * FALSE_ALARMS_PER_FRAME * places.len() as f64;
    let is_noise = n_others <= expected + SURE_STDS * expected.sqrt();
    Ok(Some(seen).filter(|_| is_noise && moving.gain() > SURE_GAIN))
}

/// Puts the detector for faint targets in the place of that for isolated ones; scores are now -log10 of a number of false alarms.
fn replace(faint: &Faint, config: &mut Config) {
    let camera = config.detector.camera;
    config.detector = detector(faint.polarity);
    config.detector.camera = camera;
    config.tracker.min_initiation_score = 0.0;
}

fn word(polarity: Polarity) -> &'static str {
    match polarity {
        Polarity::Bright => "bright",
        Polarity::Dark => "dark",
        Polarity::Both => "bright and dark",
    }
}

/// Writes the detector where it was asked for.
pub fn configure_asked(faint: &Faint, config: &mut Config, reasons: &mut Vec<String>) {
    replace(faint, config);
    reasons.push(format!(
        "{:.1} {} things a frame are found at {FALSE_ALARMS_PER_FRAME} false alarm a frame (detector.threshold.cfar.false-alarms-per-frame).",
        faint.per_frame,
        word(faint.polarity),
    ));
}

/// Writes the detector where it finds what the one for isolated targets does not.
pub fn configure(faint: &Faint, config: &mut Config, reasons: &mut Vec<String>) {
    replace(faint, config);
    reasons.push(format!(
        "But at one false alarm a frame {:.1} {} things a frame are found, {}: so faint targets are looked for (detector.threshold.cfar).",
        faint.per_frame,
        word(faint.polarity),
        faint.chains.words(),
    ));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FrameIndex, Image, PixelKind, Pixels, Timestamp};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// White noise of 8 counts, with `n` spots of five times that at their peak.
    fn frames(n: usize) -> (Vec<Frame>, SourceInfo) {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let make = |k: u64| {
            let mut image = Image::filled(200, 160, 0u8);
            for y in 0..160 {
                for (x, p) in image.row_mut(y).iter_mut().enumerate() {
                    let mut v = 80.0 + 8.0 * rng.sample::<f64, _>(StandardNormal);
                    for i in 0..n {
                        let (dx, dy) = (x as f64 - 20.0 - 17.0 * i as f64, y as f64 - 30.0 - 11.0 * i as f64);
                        v += 40.0 * (-0.5 * (dx * dx + dy * dy) / 1.69).exp();
                    }
                    *p = v.round() as u8;
                }
            }
            Frame { index: FrameIndex(k), time: Timestamp::from_ns(k as i64), pixels: Pixels::Gray8(image) }
        };
        let info = SourceInfo {
            label: "test".into(),
            reader: "test".into(),
            width: 200,
            height: 160,
            kind: PixelKind::Gray8,
            n_frames: None,
            rate_hz: None,
            true_times: false,
        };
        ((0..12).map(make).collect(), info)
    }

    #[test]
    fn spots_of_five_deviations_are_seen_and_noise_alone_is_not() {
        let (spots, info) = frames(10);
        let seen = look(&spots, &Scene::default(), &Seen::default(), &info, 1).unwrap().expect("ten spots");
        assert_eq!(seen.polarity, Polarity::Bright);
        assert!((8.0..13.0).contains(&seen.per_frame), "{seen:?}");
        let (noise, info) = frames(0);
        assert_eq!(look(&noise, &Scene::default(), &Seen::default(), &info, 1).unwrap(), None);
    }

    #[test]
    fn of_many_that_diffuse_and_mostly_score_too_little_to_start_a_track_all_are_looked_for() {
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let (mut many, info) = frames(0);
        let mut at: Vec<[f64; 2]> =
            (0..24).map(|i| [16.0 + 33.0 * f64::from(i % 6), 20.0 + 40.0 * f64::from(i / 6)]).collect();
        for (k, frame) in many.iter_mut().enumerate() {
            let Pixels::Gray8(image) = &mut frame.pixels else { unreachable!() };
            frame.time = Timestamp::from_secs_f64(0.04 * k as f64);
            at.iter_mut().flatten().for_each(|v| *v += 0.7 * rng.sample::<f64, _>(StandardNormal));
            for y in 0..160 {
                for (x, p) in image.row_mut(y).iter_mut().enumerate() {
                    let d2 = |a: &[f64; 2]| (x as f64 - a[0]).powi(2) + (y as f64 - a[1]).powi(2);
                    let light: f64 = at.iter().map(|a| 90.0 * (-0.5 * d2(a) / 1.69).exp()).sum();
                    *p = p.saturating_add(light.round() as u8);
                }
            }
        }
        let isolated = spots::look(&many, &[], &info, 1).unwrap();
        assert!(isolated.many_faint().is_some(), "{isolated:?}");
        let choice = crate::auto::choose(&many, &info, &Config::default()).unwrap();
        let threshold = choice.config.detector.threshold;
        let every = matches!(threshold, ThresholdConfig::Cfar(_) | ThresholdConfig::Spot(_));
        assert!(every && choice.config.tracker.min_initiation_score == 0.0, "{threshold:?}");
    }

    #[test]
    fn a_few_that_move_are_told_from_false_alarms_by_their_motion() {
        let (mut few, info) = frames(0);
        for (k, frame) in few.iter_mut().enumerate() {
            let Pixels::Gray8(image) = &mut frame.pixels else { unreachable!() };
            frame.time = Timestamp::from_secs_f64(0.04 * k as f64);
            for (x0, y0) in [(20.0, 40.0), (60.0, 110.0)] {
                let (cx, cy) = (x0 + 5.0 * k as f64, y0 + 1.0 * k as f64);
                for y in 0..160 {
                    for (x, p) in image.row_mut(y).iter_mut().enumerate() {
                        let d2 = (x as f64 - cx).powi(2) + (y as f64 - cy).powi(2);
                        *p = p.saturating_add((48.0 * (-0.5 * d2 / 1.69).exp()).round() as u8);
                    }
                }
            }
        }
        let seen = look(&few, &Scene::default(), &Seen::default(), &info, 1).unwrap().expect("two spots");
        // Three a frame are no more than twelve frames of false alarms may have.
        assert!(seen.polarity == Polarity::Bright && seen.per_frame < 5.0, "{seen:?}");
        assert!(seen.chains.moving.len() >= 2 && seen.chains.is_sure());
    }

    #[test]
    fn a_faint_one_beside_a_clear_one_is_looked_for_unless_more_is_there_than_noise_and_both() {
        // Twelve frames of noise of three counts with a spot of 150 and one of that height, which move, and with so many at rest that are as faint.
        let chosen = |height: f64, n_still: usize, camera: Camera| {
            let (mut all, info) = frames(0);
            let mut rng = ChaCha8Rng::seed_from_u64(9);
            let still: Vec<[f64; 2]> =
                (0..n_still).map(|_| [10.0 + 180.0 * rng.random::<f64>(), 70.0 + 20.0 * rng.random::<f64>()]).collect();
            for (k, frame) in all.iter_mut().enumerate() {
                frame.time = Timestamp::from_secs_f64(0.04 * k as f64);
                let way = 3.0 * k as f64;
                let mut spots = vec![([30.0 + way, 40.0], 150.0), ([40.0 + way, 120.0], height)];
                spots.extend(still.iter().map(|at| (*at, 30.0)));
                let light = |x: usize, y: usize| -> f64 {
                    let of = |(at, height): &([f64; 2], f64)| {
                        height * (-0.5 * ((x as f64 - at[0]).powi(2) + (y as f64 - at[1]).powi(2)) / 1.69).exp()
                    };
                    spots.iter().map(of).sum()
                };
                let Pixels::Gray8(image) = &mut frame.pixels else { unreachable!() };
                for y in 0..160 {
                    for (x, p) in image.row_mut(y).iter_mut().enumerate() {
                        let noise = 3.0 * rng.sample::<f64, _>(StandardNormal);
                        *p = (80.0 + noise + light(x, y)).round() as u8;
                    }
                }
            }
            let clear = spots::look(&all, &[], &info, 1).unwrap();
            assert!(!clear.is_poor() && clear.moves(), "{clear:?}");
            let mut scene = Scene::default();
            scene.camera = camera;
            look(&all, &scene, &clear, &info, 1).unwrap()
        };
        let seen = chosen(12.0, 0, Camera::Fixed).expect("both");
        assert!(seen.polarity == Polarity::Bright && seen.chains.moving.len() >= 2, "{seen:?}");
        assert_eq!(chosen(0.0, 0, Camera::Fixed), None, "the clear one is followed as it is");
        assert_eq!(chosen(12.0, 40, Camera::Fixed), None, "ground that is no noise");
        assert_eq!(chosen(12.0, 0, Camera::Moving), None, "it may stand nearer than the ground");
    }
}
