//! The choice: which kind of scene the first frames show, and the configuration that follows, with reasons.
//!
//! Source: our own. Tried in this order, the first that fits: a target told by its colour, things that move before a fixed camera, particles,
//! cells or spots; else isolated targets, in whose place faint ones or movers on steadied frames may be taken, these with the isolated ones as runner-up. Where the camera is not seen to stand, what moves before a fixed one stands against
//! whatever was chosen.

use super::asked;
use super::cells::Pieces;
use super::digits::round;
use super::interval::interval_s;
use super::particles::Particles;
use super::request::Request;
use super::scene::{self, Camera, Scene};
use super::second_look::Second;
use super::spread::growing;
use super::whole_tracks::report_whole;
use super::{cells, colour, faint, if_fixed, moving, particles, shaken, spots, steadied};
use crate::io::Colour;
use crate::tempo::Tempo;
use crate::track::ReidentificationConfig;
use crate::vision::threshold::Polarity;
use crate::{Config, Frame, Result, SourceInfo, shown_rate};

/// A proposed configuration and why.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// The configuration.
    pub config: Config,
    /// What was seen and chosen, a sentence each.
    pub reasons: Vec<String>,
    /// What is taken in its place if the first pass bears that out better ([`super::contest`]).
    pub(super) runner_up: Option<Box<Choice>>,
    /// What is taken in its place if the first pass says that the camera stands, or that more moves ([`super::if_fixed`]).
    pub(super) if_fixed: Option<Box<Choice>>,
    /// Whether the camera was seen to stand, and that candidate is of what isolated blobs explain.
    pub(super) stands: bool,
    /// Gain of what was seen to move, nats: 0 where nothing surely does, infinite where what is seen is told by something else ([`super::later_looks`]).
    pub(super) gain: f64,
}

impl Choice {
    /// A choice that nothing stands against.
    pub(super) fn alone(config: Config, reasons: Vec<String>) -> Self {
        Self { config, reasons, runner_up: None, if_fixed: None, stands: false, gain: f64::INFINITY }
    }

    /// Whether anything was seen.
    pub(super) fn is_evident(&self) -> bool {
        self.gain > 0.0
    }

    /// As [`super::report_whole`], whichever detector the first pass bears out.
    pub fn report_whole(&mut self, rate_hz: f64) {
        report_whole(rate_hz, &mut self.config, &mut self.reasons);
        for other in [&mut self.runner_up, &mut self.if_fixed].into_iter().filter_map(Option::as_deref_mut) {
            other.report_whole(rate_hz);
        }
    }

    /// Changes this choice and those that may be taken in its place in the same way; one that cannot be changed so, or becomes another detector by it, is none any more: who says `--min-score` wants one that has a score.
    pub(super) fn change<E>(&mut self, mut change: impl FnMut(&mut Self) -> Result<(), E>) -> Result<(), E> {
        change(self)?;
        let mut holds = |candidate: &mut Box<Self>| {
            let name = candidate.config.detector.threshold.name();
            change(candidate).is_ok() && candidate.config.detector.threshold.name() == name
        };
        self.runner_up.take_if(|c| !holds(c));
        self.if_fixed.take_if(|c| !holds(c));
        Ok(())
    }
}

/// Proposes a configuration from the first frames of a sequence; [`super::open_and_choose`] also takes a second look at files.
/// # Errors
/// Frames of more than one size or pixel type.
pub fn choose(frames: &[Frame], info: &SourceInfo, base: &Config) -> Result<Choice> {
    choose_among(frames, info, base, &Request::default())
}

/// As [`choose`], with what is asked for.
pub(super) fn choose_among(frames: &[Frame], info: &SourceInfo, base: &Config, request: &Request) -> Result<Choice> {
    let scene = scene::look(frames, info)?;
    let shaken = shaken::look(&scene, frames, info)?;
    choose_seen(frames, scene, &Second::default().with(shaken.as_ref(), frames), info, base, request)
}

/// As [`choose`], from the first frames, what they show as a whole, and the frames of a second look, in colour if there is any, or none.
pub(super) fn choose_seen(
    frames: &[Frame],
    scene: Scene,
    second: &Second<'_>,
    info: &SourceInfo,
    base: &Config,
    request: &Request,
) -> Result<Choice> {
    choose_looked(frames, &looked_again(scene, second, info)?, second, info, base, request)
}

/// What moves before a fixed camera as the frames are, or in one light where that hides it, or brought to one place where it shakes; and the share of it that isolated blobs explain. Where they explain
/// too much of it both times, that of the frames as they are.
fn moving_in_any_light<'s>(
    frames: &[&Frame],
    scene: &'s Scene,
    shaken: Option<&(&'s Scene, Vec<&Frame>)>,
    info: &SourceInfo,
    n_threads: usize,
) -> Result<Option<(&'s Scene, f64)>> {
    if let Some((scene, frames)) = shaken {
        return Ok(moving::look(frames, scene, info, n_threads)?.map(|explained| (*scene, explained)));
    }
    if scene.camera != Camera::Fixed {
        return Ok(None);
    }
    let mut found = None;
    for scene in std::iter::once(scene).chain(scene.in_one_light.as_deref()) {
        if let Some(explained) = moving::look(frames, scene, info, n_threads)? {
            if moving::is_evident(scene, explained, info) {
                return Ok(Some((scene, explained)));
            }
            found = found.or(Some((scene, explained)));
        }
    }
    Ok(found)
}

/// What the frames of the second look show as a whole, if there are any, on the ground of the first ones.
pub(super) fn looked_again(scene: Scene, second: &Second<'_>, info: &SourceInfo) -> Result<Scene> {
    let Some(frame) = second.frames.first() else { return Ok(scene) };
    let mut seen =
        scene::look(second.frames.iter().copied(), &SourceInfo { kind: frame.pixels.kind(), ..info.clone() })?;
    // The ground is that of the first frames, whose order and gaps motion is told by.
    seen.ground = scene.ground;
    Ok(seen)
}

/// As [`choose_seen`], where the scene is that of the second look already.
pub(super) fn choose_looked(
    frames: &[Frame],
    scene: &Scene,
    second: &Second<'_>,
    info: &SourceInfo,
    base: &Config,
    request: &Request,
) -> Result<Choice> {
    let n_threads = request.n_threads();
    let mut reasons = Vec::new();
    let mut config = base.clone();
    let (mut runner_up, mut gain) = (None, f64::INFINITY);
    let interval_s = interval_s(frames, info);
    let tempo = Tempo::of(interval_s);
    let n_looked = frames.len().max(second.frames.len());
    let looked = &second.or(frames)[..];
    let over_s = match (frames.first(), looked.last()) {
        (Some(first), Some(last)) => last.time.seconds_since(first.time),
        _ => 0.0,
    };
    reasons.push(format!(
        "{} x {} {:?}, {} frames/s ({}), from {n_looked} {} of {} {over_s:.1} s.",
        info.width,
        info.height,
        info.kind,
        shown_rate(1.0 / interval_s),
        if info.true_times { "the file's times" } else { "no times in the input: the given rate" },
        if n_looked == 1 { "frame" } else { "frames" },
        match looked.first().map_or(0, |f| f.index.0) {
            0 => "the first".to_string(),
            k => format!("frame {k} and the next"),
        },
    ));
    let if_fixed = match request.detector {
        None => if_fixed::look(looked, scene, tempo, info, n_threads, (config.clone(), reasons.clone()))?,
        Some(_) => None,
    };
    // Who asks for grey gets grey.
    let mut counted = None;
    let coloured = base.input.colour != Colour::Gray;
    let reference =
        (coloured && request.detector.is_none()).then(|| colour::look(&second.coloured, scene, info)).flatten();
    let moving = match request.detector {
        None if reference.is_none() => moving_in_any_light(looked, scene, second.shaken.as_ref(), info, n_threads)?,
        _ => None,
    };
    // Drawn into one view, what a shaking camera shows of small things is lost.
    let steady = second.shaken.is_none();
    let by_blobs = moving.filter(|(scene, explained)| steady && !moving::is_evident(scene, *explained, info));
    let if_fixed = by_blobs.map_or(if_fixed, |(scene, explained)| {
        let (mut config, mut reasons) = (config.clone(), reasons.clone());
        moving::configure(scene, explained, tempo, info, &mut config, &mut reasons);
        Some((config, reasons))
    });
    if let Some(kind) = request.detector {
        asked::configure(kind, frames, second, scene, interval_s, info, n_threads, &mut config, &mut reasons)?;
    } else if let Some(reference) = reference {
        colour::configure(&reference, tempo, info, &mut config, &mut reasons);
    } else if let Some((scene, explained)) =
        moving.filter(|(scene, explained)| moving::is_evident(scene, *explained, info))
    {
        moving::configure(scene, explained, tempo, info, &mut config, &mut reasons);
    } else if let Some(seen) = particles::look(frames, scene, info, n_threads, &mut counted)? {
        particles::configure(&seen, frames, info, n_threads, interval_s, &mut config, &mut reasons)?;
    } else {
        let pieces = cells::look(frames, info, n_threads)?;
        let dark = spots::look_for(Polarity::Dark, frames, &scene.ground, info, n_threads)?;
        let evidence = spots::look_beside(dark, frames, &scene.ground, info, n_threads)?;
        // Targets that stand alone are told better one by one, where most of the pieces are seen to move as such.
        let alone = |polarity| if polarity == Polarity::Dark { &evidence.dark.chains } else { &evidence.bright.chains };
        let most_move = |per_frame: f64, polarity| 2.0 * alone(polarity).moving.len() as f64 > per_frame;
        let are_too_fast = |s: &Particles| alone(s.polarity).fastest_px_per_s() > Some(s.most_px_per_s(interval_s));
        let gain_of_isolated = if evidence.moves() { evidence.most().1.gain() } else { 0.0 };
        // Pieces are of one polarity: where others move beside them, both are looked for.
        let pieces = pieces.filter(|_| evidence.polarity() != Polarity::Both);
        let isolated_are_better = match &pieces {
            Some(Pieces::Cells(seen)) if most_move(seen.per_frame, Polarity::Bright) => {
                let places = growing(frames.len());
                let own = cells::chains(seen, frames, &places, &scene.ground, info, n_threads)?;
                alone(Polarity::Bright).is_surely_more_than(&own)
            }
            Some(Pieces::Spots(seen)) => most_move(seen.per_frame, seen.polarity) && are_too_fast(seen),
            // What stands clear is told by its surroundings; the light of a wide spot falls off too slowly for that.
            Some(Pieces::FewSpots(seen)) => !evidence.is_poor() || are_too_fast(seen),
            Some(Pieces::Cells(_)) | None => false,
        };
        let pieces = pieces.filter(|_| !isolated_are_better);
        // Before a camera that stands they were not counted.
        let count = || counted.map_or_else(|| particles::count(frames, info, n_threads), Ok);
        let spots_in_place = match &pieces {
            Some(Pieces::Spots(seen) | Pieces::FewSpots(seen)) => Some(*seen),
            Some(Pieces::Cells(_)) => None,
            None if evidence.are_particles() => count()?.particles(),
            None => None,
        };
        if let Some(seen) = spots_in_place {
            particles::configure(&seen, frames, info, n_threads, interval_s, &mut config, &mut reasons)?;
            if let Some(Pieces::FewSpots(_)) = pieces {
                spots::report_what_moves(&mut config.tracker, &mut reasons);
                gain = gain_of_isolated;
            }
        } else if let Some(Pieces::Cells(seen)) = pieces {
            cells::configure(&seen, info, interval_s, &mut config, &mut reasons);
        } else {
            let steadied = steadied::look_beside(&evidence, frames, scene, tempo, info, n_threads)?;
            let seen_so_far = steadied.as_ref().map(|_| Choice::alone(config.clone(), reasons.clone()));
            spots::configure(&evidence, tempo, info, &mut config, &mut reasons);
            gain = gain_of_isolated;
            if let Some(seen) = faint::look(frames, scene, &evidence, info, n_threads)? {
                faint::configure(&seen, &mut config, &mut reasons);
                // There are more than false alarms, whether they move or not.
                gain = seen.chains.gain().max(f64::MIN_POSITIVE);
            }
            if let (Some(seen), Some(mut first)) = (steadied, seen_so_far) {
                steadied::configure(&seen, tempo, info, &mut first.config, &mut first.reasons);
                gain = seen.chains.gain();
                runner_up = Some(Box::new(Choice::alone(config, reasons)));
                Choice { config, reasons, .. } = first;
            }
        }
    }
    let if_fixed = if_fixed.map(|(config, reasons)| Box::new(Choice::alone(config, reasons)));
    let stands = by_blobs.is_some();
    let mut choice = Choice { config, reasons, runner_up, if_fixed, stands, gain };
    choice.change(|c| {
        let hidden_s = round(tempo.stretched(ReidentificationConfig::default().max_gap_s));
        c.config.tracker.reidentification = ReidentificationConfig { max_gap_s: hidden_s };
        c.reasons.push(format!(
            "A target that is lost and found again keeps its id, within {hidden_s} s where it is not known how long targets stay (--no-stitch gives every track its \
             own)."
        ));
        Ok::<(), crate::Error>(())
    })?;
    Ok(choice)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::background::BackgroundConfig;
    use crate::vision::threshold::ThresholdConfig;

    #[test]
    fn a_candidate_that_cannot_be_changed_as_the_user_says_is_dropped() {
        let of = |threshold| {
            let mut config = Config::default();
            config.detector.threshold = threshold;
            Choice::alone(config, Vec::new())
        };
        let mut choice = of(ThresholdConfig::Isolated(Default::default()));
        choice.if_fixed = Some(Box::new(of(ThresholdConfig::Moving(BackgroundConfig::default()))));
        let every = |c: &mut Choice| {
            c.config.tracker.coast_s = 3.0;
            Ok::<(), String>(())
        };
        choice.change(every).unwrap();
        assert_eq!(choice.if_fixed.as_ref().unwrap().config.tracker.coast_s, 3.0);
        let with_a_score = |c: &mut Choice| match &mut c.config.detector.threshold {
            ThresholdConfig::Isolated(isolated) => {
                isolated.min_score = 9.0;
                Ok(())
            }
            _ => Err("no least score"),
        };
        choice.change(with_a_score).unwrap();
        assert_eq!(choice.if_fixed, None);
        assert!(of(ThresholdConfig::Moving(BackgroundConfig::default())).change(with_a_score).is_err());
    }
}
