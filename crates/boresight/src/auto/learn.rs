//! The first pass: the chosen detector runs over the frames read ahead, and what its detections tell is written into the configuration.
//!
//! Source: our own. Noise and motion ([`super::noise`]), largest speed ([`super::speed`]), what the detections are made of ([`super::detection_statistics`]) and from which score on they start
//! tracks ([`super::initiation_score`]).
//! Where targets are many, the frames of the choice tell what they reach; the detector then leaves out what scores less, and all else is learnt of what it finds so.

use super::choose::Choice;
use super::detection_statistics::{self, Found, RATE_WITHOUT_EFFECT};
use super::digits::round;
use super::evidence::{self, Evidence};
use super::first_pass::FirstPass;
use super::first_scans::PROBE_FRAMES;
use super::noise::Motions;
use super::request::Request;
use super::{
    coast, contest, decoys, if_fixed, initiation_score, lag, lasting, later_looks, moving, noise, pieces, speed,
    spot_threshold,
};
use crate::camera::{CameraConfig, CameraPath};
use crate::io::{LengthUnit, Replay};
use crate::track::Report;
use crate::vision::steadied::SteadiedConfig;
use crate::vision::threshold::ThresholdConfig;
use crate::vision::{AtOnce, Detector, DetectorConfig};
use crate::{Config, Error, FrameSource, Result, Scan};

/// Things that stand still and are reported where nothing moves, a frame at most: as many as one looks at one by one.
const FEW_STILL: f64 = 3.0;
/// Parallax that a thing before the ground would be told from it by, px.
const LEAST_PARALLAX_PX: f64 = 1.0;

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
    let set = |c: &mut Choice| set(std::mem::take(&mut c.config)).map(|config| c.config = config);
    choice.change(set)?;
    let of_own = with_fixed(frames, choice, request)?;
    let begun = of_own.map_or_else(|| with_smaller(frames, choice, request, set), |begun| Ok(Some(begun)))?;
    let begun = with_decoys(begun, frames, choice, request, set)?;
    let mut assumed = choice.clone();
    let mut pass = match begun {
        Some((pass, at_once)) => learn_on(pass, at_once, frames, choice, request)?,
        None => learn_set(frames, choice, request)?,
    };
    let info = frames.info().clone();
    let size_px = [info.width as f64, info.height as f64];
    let area_px2 = size_px[0] * size_px[1];
    while let ThresholdConfig::Steadied(SteadiedConfig { lag_s, .. }) = choice.config.detector.threshold {
        let shown = Evidence::of_scans(pass.scans(), area_px2);
        let Some((longer_s, reason)) = lag::longer(pass.scans(), &shown, lag_s, size_px) else { break };
        let mut longer = assumed.clone();
        if let ThresholdConfig::Steadied(steadied) = &mut longer.config.detector.threshold {
            steadied.lag_s = longer_s;
        }
        longer.reasons.push(reason);
        if !stands(&mut longer, set)? {
            break;
        }
        let (mut again, mut at_once) = first_pass(frames, &longer.config, request)?;
        again.take_on(frames, &mut at_once, evidence::MOST_SCANS);
        // Rims count once for their target: what a longer lag shows must gain as much.
        if Evidence::of_scans(again.scans(), area_px2).gain_alone() < shown.gain_alone() {
            break;
        }
        assumed = longer.clone();
        pass = learn_on(again, at_once, frames, &mut longer, request)?;
        *choice = longer;
    }
    let later = later_looks::polarity(frames.ahead(), pass.scans(), &choice.config, &info, request.n_threads())?;
    if let Some((polarity, reason)) = later {
        let mut wider = assumed;
        if let ThresholdConfig::Isolated(isolated) = &mut wider.config.detector.threshold {
            isolated.polarity = polarity;
        }
        wider.reasons.push(reason);
        if stands(&mut wider, set)? {
            pass = learn_set(frames, &mut wider, request)?;
            *choice = wider;
        }
    }
    choice.change(set)?;
    Ok(Box::new(pass))
}

/// Changes a choice by what is set; whether its detector stays as it is: who says which one gets that.
fn stands<E>(choice: &mut Choice, set: impl FnMut(&mut Choice) -> Result<(), E>) -> Result<bool, E> {
    let asked = choice.config.detector.clone();
    choice.change(set)?;
    Ok(choice.config.detector == asked)
}

/// Takes the candidate of a fixed camera if there is one and the first passes of both say so; else the choice's own first pass, which has begun, if it was asked for.
fn with_fixed(frames: &mut Replay, choice: &mut Choice, request: &Request) -> Result<Option<(FirstPass, AtOnce)>> {
    let own = &choice.config.detector;
    let is_asked = !choice.stands || if_fixed::finds_blobs(&own.threshold);
    let Some(fixed) = choice.if_fixed.take().filter(|f| is_asked && f.config.detector != *own) else {
        return Ok(None);
    };
    let mut begin = |config: &Config| -> Result<(FirstPass, AtOnce)> {
        let (mut pass, mut at_once) = first_pass(frames, config, request)?;
        pass.take_on(frames, &mut at_once, evidence::MOST_SCANS);
        Ok((pass, at_once))
    };
    let mut own = begin(&choice.config)?;
    if choice.stands || !if_fixed::is_followed(own.0.scans()) {
        let mut candidate = begin(&fixed.config)?;
        let info = frames.info();
        let area_px2 = (info.width * info.height) as f64;
        let wins = if choice.stands { if_fixed::finds_more } else { if_fixed::wins };
        if let Some(reason) = wins(own.0.scans(), candidate.0.scans(), area_px2) {
            *choice = *fixed;
            choice.reasons.push(reason);
            return Ok(None);
        }
    }
    Ok(Some(own))
}

/// Lets smaller regions count where such move by themselves before a fixed camera, and returns the first pass that has begun with the area chosen; none where nothing was looked for, or where it
/// must be made anew.
fn with_smaller<E: From<Error>>(
    frames: &mut Replay,
    choice: &mut Choice,
    request: &Request,
    set: impl FnMut(&mut Choice) -> Result<(), E>,
) -> Result<Option<(FirstPass, AtOnce)>, E> {
    let mut every = choice.config.clone();
    let DetectorConfig { threshold, cluster, camera, max_detections, .. } = &mut every.detector;
    let (ThresholdConfig::Moving(_), CameraConfig::Fixed | CameraConfig::Shaking) = (threshold, camera) else {
        return Ok(None);
    };
    let Some(least_px) = cluster.min_area_px.filter(|a| *a > moving::LEAST_PX) else { return Ok(None) };
    let most = *max_detections;
    cluster.min_area_px = Some(moving::LEAST_PX);
    let (mut pass, mut at_once) = first_pass(frames, &every, request)?;
    pass.take_on(frames, &mut at_once, evidence::MOST_SCANS);
    let info = frames.info();
    let evidence = Evidence::of_scans(pass.scans(), (info.width * info.height) as f64);
    let mut kept_px = least_px;
    if let Some((area_px, reason)) = moving::smaller(&evidence, pass.scans(), least_px) {
        let mut smaller = choice.clone();
        smaller.config.detector.cluster.min_area_px = Some(area_px);
        smaller.reasons.push(reason);
        if stands(&mut smaller, set)? {
            (*choice, kept_px) = (smaller, area_px);
        }
    }
    Ok(pass.leave_out_below(kept_px, most).then_some((pass, at_once)))
}

/// Looks at what false detections are like: raises the threshold of spots to where there are few, and says up to which score they last. Returns the first pass that has begun with the detector
/// chosen; what has begun already where nothing is known of them.
fn with_decoys<E: From<Error>>(
    begun: Option<(FirstPass, AtOnce)>,
    frames: &mut Replay,
    choice: &mut Choice,
    request: &Request,
    mut set: impl FnMut(&mut Choice) -> Result<(), E>,
) -> Result<Option<(FirstPass, AtOnce)>, E> {
    let threshold = &choice.config.detector.threshold;
    let is_spot = matches!(threshold, ThresholdConfig::Spot(_));
    // Where only what moves is reported its motion test holds back what stays, and a target that hovers is one.
    let may_last = choice.config.tracker.report == Report::All
        && matches!(threshold, ThresholdConfig::Spot(_) | ThresholdConfig::Cfar(_) | ThresholdConfig::Isolated(_));
    if !is_spot && !may_last {
        return Ok(begun);
    }
    let (mut pass, mut at_once) = begun.map_or_else(|| first_pass(frames, &choice.config, request), Ok)?;
    // Where the detector may be changed by what is found, the others are not searched yet.
    let most = if matches!(threshold, ThresholdConfig::Cfar(_)) { usize::MAX } else { PROBE_FRAMES };
    pass.take_on(frames, &mut at_once, most);
    let is_copied = may_last && lasting::is_copied(pass.scans());
    if !is_spot && !is_copied {
        return Ok(Some((pass, at_once)));
    }
    let info = frames.info().clone();
    let decoys = decoys::look(frames.ahead(), pass.scans(), &choice.config, &info, request.n_threads())?;
    let Some(decoys) = decoys else { return Ok(Some((pass, at_once))) };
    if is_copied && let Some((score, reason)) = lasting::score(&decoys, pass.scans()) {
        choice.config.tracker.lasting_clutter_score = score;
        choice.reasons.push(reason);
        set(choice)?;
    }
    let mut higher = choice.clone();
    if let ThresholdConfig::Spot(spot) = &mut higher.config.detector.threshold
        && let Some((k, reason)) = spot_threshold::raised(&decoys, spot.k)
    {
        // The least contrast stays so many of the deviations that scores count in.
        spot.min_contrast = round(spot.min_contrast * k / spot.k);
        spot.k = k;
        higher.reasons.push(reason);
        if stands(&mut higher, set)? {
            *choice = higher;
            return Ok(Some(first_pass(frames, &choice.config, request)?));
        }
    }
    Ok(Some((pass, at_once)))
}

/// As [`learn`], where what is set is in the configuration.
fn learn_set(frames: &mut Replay, choice: &mut Choice, request: &Request) -> Result<FirstPass> {
    let (pass, at_once) = first_pass(frames, &choice.config, request)?;
    learn_on(pass, at_once, frames, choice, request)
}

/// As [`learn_set`], with a first pass that has begun.
fn learn_on(
    mut pass: FirstPass,
    mut at_once: AtOnce,
    frames: &mut Replay,
    choice: &mut Choice,
    request: &Request,
) -> Result<FirstPass> {
    let false_tracks_per_hour = request.false_tracks_per_hour;
    let info = frames.info().clone();
    let area_px2 = (info.width * info.height).max(1) as f64;
    let leaves_out = matches!(choice.config.detector.threshold, ThresholdConfig::Isolated(_));
    if leaves_out && choice.config.tracker.report == Report::All {
        // Where the first frames say already what the many targets reach, the others are not searched for less.
        pass.take_on(frames, &mut at_once, PROBE_FRAMES);
        let mut early = choice.clone();
        let evidence = Evidence::of_scans(pass.scans(), area_px2);
        speed::learn(&evidence, LengthUnit::Pixel, &mut early.config, &mut early.reasons);
        let (found, kept) = raise(pass.scans(), area_px2, false_tracks_per_hour, &mut early)?;
        let n_held = found.map_or(0.0, |f| f.per_scan * pass.scans().len() as f64);
        if kept && n_held >= initiation_score::ENOUGH_HELD {
            *choice = early;
            return learn_of_kept(frames, area_px2, choice, request);
        }
    }
    pass.take_on(frames, &mut at_once, usize::MAX);
    let evidence = Evidence::of_scans(pass.scans(), area_px2);
    if let Some(other) = choice.runner_up.take() {
        if let Some(reason) = contest::lost(&evidence, pass.scans(), choice, &other) {
            *choice = *other;
            choice.reasons.push(reason);
            return learn_set(frames, choice, request);
        }
        if contest::is_often_blind(pass.scans()) {
            let (mut next, mut at_once) = first_pass(frames, &other.config, request)?;
            next.take_on(frames, &mut at_once, pass.scans().len().min(evidence::MOST_SCANS));
            if let Some(reason) = contest::beaten(&evidence, pass.scans(), next.scans(), area_px2, choice, &other) {
                *choice = *other;
                choice.reasons.push(reason);
                return learn_on(next, at_once, frames, choice, request);
            }
        }
    }
    speed::learn(&evidence, LengthUnit::Pixel, &mut choice.config, &mut choice.reasons);
    let assumed = choice.clone();
    let (found, kept) = raise(pass.scans(), area_px2, false_tracks_per_hour, choice)?;
    if kept {
        return learn_of_kept(frames, area_px2, choice, request);
    }
    if choice.config.tracker.min_initiation_score > assumed.config.tracker.min_initiation_score {
        return Ok(pass);
    }
    let mut fainter = assumed.clone();
    let clear_s = found.as_ref().map_or(&[][..], |f| &f.clear_s);
    if initiation_score::learn(&evidence, clear_s, &mut fainter.config, &mut fainter.reasons) {
        let more = statistics(pass.scans(), area_px2, false_tracks_per_hour, &mut fainter)?;
        if more.is_some_and(|f| f.n_targets > 0) {
            *choice = fainter;
            return Ok(pass);
        }
    }
    let nothing_moves = choice.config.tracker.report == Report::Moving && found.is_some_and(|f| f.n_targets == 0);
    let parallax_share = assumed.config.tracker.motion_test.parallax_share;
    if nothing_moves && parallax_share * farthest_px(pass.scans()) <= LEAST_PARALLAX_PX {
        // Who films a thing that hovers or stands wants to see it, if there is nothing else and not a landscape of them. What keeps its place in the ground while the camera goes
        // far belongs to it.
        let mut still = assumed.clone();
        still.config.tracker.report = Report::All;
        let things = statistics(pass.scans(), area_px2, false_tracks_per_hour, &mut still)?;
        if let Some(things) = things.filter(|f| f.n_targets > 0 && f.per_scan <= FEW_STILL) {
            still.reasons.push(format!(
                "Nothing moves by itself, but {:.1} things a frame stand there: they are reported.",
                things.per_scan
            ));
            *choice = still;
            return Ok(pass);
        }
    }
    Ok(pass)
}

/// The detector of a configuration, which has seen no frame yet, and what lets it detect in several at once.
fn first_pass(frames: &mut Replay, config: &Config, request: &Request) -> Result<(FirstPass, AtOnce)> {
    let mut detector = crate::vision::build(&config.detector, frames.info())?;
    crate::pipeline::prime(&mut *detector, frames);
    let pass = FirstPass::new(detector);
    let at_once = pass.at_once(request.n_threads());
    Ok((pass, at_once))
}

/// Learns from all frames read ahead once it is known what the detector keeps. Other blobs fall away with those left out, so all is detected anew: what is learnt is
/// learnt of what the run sees.
fn learn_of_kept(frames: &mut Replay, area_px2: f64, choice: &mut Choice, request: &Request) -> Result<FirstPass> {
    let (mut pass, mut at_once) = first_pass(frames, &choice.config, request)?;
    pass.take_on(frames, &mut at_once, usize::MAX);
    let evidence = Evidence::of_scans(pass.scans(), area_px2);
    speed::learn(&evidence, LengthUnit::Pixel, &mut choice.config, &mut choice.reasons);
    statistics(pass.scans(), area_px2, request.false_tracks_per_hour, choice)?;
    Ok(pass)
}

/// Learns of the scans, and once more with a higher score where targets are many and too many false detections would start tracks; the last of what was found. If the detector is to keep
/// less (true), the choice holds that and nothing else that was learnt.
fn raise(
    scans: &[Scan],
    area_px2: f64,
    false_tracks_per_hour: Option<f64>,
    choice: &mut Choice,
) -> Result<(Option<Found>, bool)> {
    let assumed = choice.clone();
    let found = statistics(scans, area_px2, false_tracks_per_hour, choice)?;
    let raised = found.as_ref().and_then(|f| initiation_score::raised(f, area_px2, &choice.config));
    let Some((score, reason)) = raised else { return Ok((found, false)) };
    *choice = assumed;
    choice.config.tracker.min_initiation_score = score;
    choice.reasons.push(reason);
    let assumed = choice.clone();
    let found = statistics(scans, area_px2, false_tracks_per_hour, choice)?;
    let kept = found.as_ref().and_then(|f| initiation_score::kept(f.least_score, &assumed.config));
    let Some((score, reason)) = kept else { return Ok((found, false)) };
    *choice = assumed;
    if let ThresholdConfig::Isolated(isolated) = &mut choice.config.detector.threshold {
        isolated.min_score = score;
    }
    choice.reasons.push(reason);
    Ok((found, true))
}

/// The farthest that the camera came from where it was at first, px.
fn farthest_px(scans: &[Scan]) -> f64 {
    let mut path = CameraPath::default();
    let far = |s: &Scan| {
        path.step(s.camera_motion.as_ref());
        path.place_px.norm()
    };
    scans.iter().map(far).fold(0.0, f64::max)
}

/// Learns noise and motion, and what the detections are made of, unless they are pieces of things: what comes of counting those as independent is no probability, and they are confirmed by the
/// number of their hits.
fn statistics(
    scans: &[Scan],
    area_px2: f64,
    false_tracks_per_hour: Option<f64>,
    choice: &mut Choice,
) -> Result<Option<Found>> {
    let of_points = is_of_points(&choice.config.detector.threshold);
    let motions = if of_points { Motions::DrivenOrForgetful } else { Motions::Driven };
    noise::learn(scans, area_px2, LengthUnit::Pixel, motions, &mut choice.config, &mut choice.reasons)?;
    if !of_points && pieces::are_pieces(scans, area_px2) {
        if false_tracks_per_hour.is_some() {
            choice.reasons.push(RATE_WITHOUT_EFFECT.to_string());
        }
        if matches!(choice.config.detector.threshold, ThresholdConfig::Moving(_)) {
            coast::learn(scans, &mut choice.config, &mut choice.reasons);
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

/// Whether what is detected is a point or a blob that stands alone, by the detector's make: one detection a target, false ones anywhere. Regions may come in pieces, which lie where targets are.
fn is_of_points(threshold: &ThresholdConfig) -> bool {
    matches!(
        threshold,
        ThresholdConfig::Isolated(_)
            | ThresholdConfig::Spot(_)
            | ThresholdConfig::Cfar(_)
            | ThresholdConfig::Integrate(_)
            | ThresholdConfig::Bernoulli(_)
    )
}

#[cfg(test)]
#[path = "learn/tests.rs"]
mod tests;
