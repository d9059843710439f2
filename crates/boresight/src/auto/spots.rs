//! Evidence of isolated targets, bright or dark, and the configuration that follows from it.

use super::digits::round;
use super::evidence::{Evidence, SURE_GAIN};
use super::ground::Ground;
use super::looks;
use super::spread::growing;
use super::stretch;
use crate::camera::CameraConfig;
use crate::tempo::Tempo;
use crate::track::{MergedMeasurementsConfig, Report, TrackerConfig};
use crate::vision::config::DetectorConfig;
use crate::vision::isolated::IsolatedConfig;
use crate::vision::threshold::{Polarity, ThresholdConfig};
use crate::{Config, Frame, Result, Scan, SourceInfo};

/// A score from which a blob is surely a thing and not noise.
const SURE: f64 = 8.0;
/// More sure blobs a frame than this are particles or cells.
const MANY: f64 = 15.0;
/// Where fewer of them move, surely, they are what something moves before: one of ten.
const FEW_MOVE: f64 = 0.1;
/// Targets with a longer side than this are large, px.
const LARGE_PX: f64 = 24.0;
/// How much the velocity of a target changes within one second before anything of it was measured, as a share of the largest speed.
const SPEED_CHANGE: f64 = 0.08;
/// The same for the changing outline of a large one, px/s for each px above [`LARGE_PX`].
const OUTLINE_JERK: f64 = 3.75;
/// In fewer of the frames nothing stands clear.
const POOR: f64 = 0.1;
/// Least score of a detection that continues a track.
const MIN_SCORE: f64 = 2.5;

/// What was seen of one polarity.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Side {
    /// Sure blobs a frame.
    pub per_frame: f64,
    /// All blobs a frame, and those that would start no track.
    pub all_per_frame: f64,
    pub faint_per_frame: f64,
    /// Their mean score.
    pub mean_score: f64,
    /// Median and 95 % point of the longer side of their boxes, px.
    pub side_px: [f64; 2],
    /// Chains of all, sure or not.
    pub chains: Evidence,
}

impl Side {
    /// What the scans of one polarity hold, with the chains of their detections.
    pub fn of(scans: &[Scan], chains: Evidence) -> Self {
        let (mut n, mut sum, mut sides) = (0usize, 0.0, Vec::new());
        for d in scans.iter().flat_map(|s| &s.detections).filter(|d| f64::from(d.score) >= SURE) {
            n += 1;
            sum += f64::from(d.score).min(100.0);
            sides.push(d.extent.width_px.max(d.extent.height_px));
        }
        let n_scans = scans.len().max(1) as f64;
        let all = || scans.iter().flat_map(|s| &s.detections);
        let n_faint = all().filter(|d| f64::from(d.score) < INITIATION_SCORE).count();
        sides.sort_by(f64::total_cmp);
        let at = |q: f64| sides.get((sides.len().saturating_sub(1) as f64 * q) as usize).copied().unwrap_or(0.0);
        Self {
            per_frame: n as f64 / n_scans,
            all_per_frame: all().count() as f64 / n_scans,
            faint_per_frame: n_faint as f64 / n_scans,
            mean_score: sum / n.max(1) as f64,
            side_px: [at(0.5), at(0.95)],
            chains,
        }
    }
}

/// What was seen of both polarities.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Seen {
    /// Targets brighter than their surroundings.
    pub bright: Side,
    /// Targets darker than their surroundings.
    pub dark: Side,
}

impl Seen {
    /// Whether in hardly one frame of ten anything stands clear.
    pub fn is_poor(&self) -> bool {
        self.bright.per_frame + self.dark.per_frame < POOR
    }

    /// Whether they are particles or cells.
    pub fn are_many(&self) -> bool {
        self.bright.per_frame.max(self.dark.per_frame) > MANY
    }

    /// Whether they are that, but for few that move before the others, which stand.
    pub fn are_particles(&self) -> bool {
        let per_frame = self.per_frame(self.polarity());
        let few_move = self.moves() && (self.n_moving() as f64) < FEW_MOVE * per_frame;
        per_frame > MANY && !few_move
    }

    /// Chains that move, of both polarities.
    fn n_moving(&self) -> usize {
        self.bright.chains.moving.len() + self.dark.chains.moving.len()
    }

    /// Blobs a frame of these polarities.
    fn per_frame(&self, polarity: Polarity) -> f64 {
        match polarity {
            Polarity::Both => self.bright.per_frame + self.dark.per_frame,
            Polarity::Dark => self.dark.per_frame,
            Polarity::Bright => self.bright.per_frame,
        }
    }

    /// Whether anything moves as a target would.
    pub fn moves(&self) -> bool {
        self.bright.chains.is_sure() || self.dark.chains.is_sure()
    }

    /// How many blobs a frame there are if they are as many, beyond those of the other polarity, as particles are, and more than a fourth score too little to start a track: many targets
    /// never would. Of noise and texture there are as many of both.
    pub fn many_faint(&self) -> Option<f64> {
        let (side, other) = match self.most().0 {
            Polarity::Dark => (&self.dark, &self.bright),
            _ => (&self.bright, &self.dark),
        };
        let beyond = side.all_per_frame - other.all_per_frame;
        let faint = side.faint_per_frame - other.faint_per_frame;
        (beyond > MANY && faint > MOST_FAINT * beyond).then_some(beyond)
    }

    /// The polarity whose chains gain more, and these.
    pub fn most(&self) -> (Polarity, &Evidence) {
        let (bright, dark) = (&self.bright.chains, &self.dark.chains);
        if dark.gain() > bright.gain() { (Polarity::Dark, dark) } else { (Polarity::Bright, bright) }
    }

    /// The polarity of the targets: that of what stands clear and surely moves where only one of them moves and neither is many; else that of what stands clear and, of what hardly does, that of what
    /// moves; both if the lesser one's moves beside the greater one's and not with it.
    pub fn polarity(&self) -> Polarity {
        let weight = |s: &Side| s.per_frame * s.mean_score;
        // Things at rest, however clear, are scenery or dead pixels. Of many it is not told which of them move.
        let moves_clearly = |s: &Side| s.per_frame >= POOR && s.chains.is_sure();
        let by_motion = self.bright.chains.is_sure() != self.dark.chains.is_sure()
            && (moves_clearly(&self.bright) || moves_clearly(&self.dark))
            && !self.are_many();
        let dark_weighs = match by_motion || (self.is_poor() && self.moves()) {
            true => self.dark.chains.gain() > self.bright.chains.gain(),
            false => weight(&self.dark) > 2.0 * weight(&self.bright),
        };
        let (polarity, most, other) = match dark_weighs {
            true => (Polarity::Dark, &self.dark, &self.bright),
            false => (Polarity::Bright, &self.bright, &self.dark),
        };
        // Between many of one polarity gaps of the other one move as they do.
        let counts = !self.are_many() || other.per_frame >= POOR;
        let beside = other.chains.gain_beside(&most.chains) > SURE_GAIN;
        if counts && most.chains.is_sure() && beside { Polarity::Both } else { polarity }
    }
}

/// Looks for isolated blobs in the frames; `ground` is the first one's in each, none where it stands.
pub fn look(frames: &[Frame], ground: &[Ground], info: &SourceInfo, n_threads: usize) -> Result<Seen> {
    let dark = look_for(Polarity::Dark, frames, ground, info, n_threads)?;
    look_beside(dark, frames, ground, info, n_threads)
}

/// As [`look`], where the dark ones were looked for before.
pub fn look_beside(
    dark: Side,
    frames: &[Frame],
    ground: &[Ground],
    info: &SourceInfo,
    n_threads: usize,
) -> Result<Seen> {
    Ok(Seen { bright: look_for(Polarity::Bright, frames, ground, info, n_threads)?, dark })
}

/// What is seen of one polarity.
pub fn look_for(
    polarity: Polarity,
    frames: &[Frame],
    ground: &[Ground],
    info: &SourceInfo,
    n_threads: usize,
) -> Result<Side> {
    look_at(frames, &growing(frames.len()), ground, polarity, info, n_threads)
}

/// What is seen of one polarity in the frames at these places.
pub fn look_at(
    frames: &[Frame],
    places: &[usize],
    ground: &[Ground],
    polarity: Polarity,
    info: &SourceInfo,
    n_threads: usize,
) -> Result<Side> {
    let scans = looks::scans(&detector(polarity, info), places.iter().map(|&k| &frames[k]), info, n_threads)?;
    Ok(Side::of(&scans, Evidence::of_looks(&scans, places, ground, info)))
}

/// What finds isolated targets of that polarity.
pub(super) fn detector(polarity: Polarity, info: &SourceInfo) -> DetectorConfig {
    let isolated = IsolatedConfig { polarity, min_score: MIN_SCORE, max_side_px: max_side(info), ..Default::default() };
    let mut config = DetectorConfig { threshold: ThresholdConfig::Isolated(isolated), ..Default::default() };
    config.cluster.min_area_px = Some(3);
    config
}

/// The longest side looked for: two fifths of the frame's shorter side.
pub(super) fn max_side(info: &SourceInfo) -> u32 {
    (info.width.min(info.height) * 2 / 5).clamp(8, 4096) as u32
}

/// Score from which a target starts a track where few are expected, and where there are many, unless what moves is fainter ([`super::initiation_score`]). Chosen: with 6, 4, 2.5 for all infrared clips of
/// the exam 1.1, 4.7, 8.3 false tracks a minute come in half A and 0.4, 1.2, 2.7 in half B, for 95.0, 95.1, 96.7 and 88.6, 89.9, 92.4 % held.
pub(super) const INITIATION_SCORE: f64 = 6.0;
const WEAK_INITIATION_SCORE: f64 = 4.0;
/// Share of the blobs that may score less.
const MOST_FAINT: f64 = 0.25;

/// Writes detector and tracker for isolated targets.
pub fn configure(evidence: &Seen, tempo: Tempo, info: &SourceInfo, config: &mut Config, reasons: &mut Vec<String>) {
    let polarity = evidence.polarity();
    let seen = if polarity == Polarity::Dark { &evidence.dark } else { &evidence.bright };
    let per_frame = evidence.per_frame(polarity);
    reasons.push(if evidence.is_poor() && !evidence.moves() {
        "Nothing stands clear of its surroundings in these frames and nothing in them moves as a target would: small bright targets are looked for \
         (dark ones: --set detector.threshold.isolated.polarity=dark)."
            .to_string()
    } else {
        format!(
            "Isolated {} targets: {:.1} bright (mean score {:.0}) and {:.1} dark ones (mean score {:.0}) a frame stand clear of their \
             surroundings; median side {:.0} px. Bright: {}. Dark: {}.",
            match polarity {
                Polarity::Bright => "bright",
                Polarity::Dark => "dark",
                Polarity::Both => "bright and dark",
            },
            evidence.bright.per_frame,
            evidence.bright.mean_score,
            evidence.dark.per_frame,
            evidence.dark.mean_score,
            seen.side_px[0],
            evidence.bright.chains.words(),
            evidence.dark.chains.words(),
        )
    });
    config.detector = DetectorConfig { max_detections: Some(5000), ..detector(polarity, info) };
    config.detector.camera = CameraConfig::Moving;
    let tracker = &mut config.tracker;
    *tracker = TrackerConfig::default();
    tracker.max_speed_px_per_s = round(0.5 * info.width.max(info.height) as f64);
    // Large targets change their outline: their middle wanders and jerks with them (a mouse of 41 px lost its track 11 times in 20 s).
    let large_px = (seen.side_px[0] - LARGE_PX).max(0.0);
    tracker.extra_noise_px += round(0.03 * large_px);
    let turns = SPEED_CHANGE * tracker.max_speed_px_per_s;
    tracker.acceleration_density_px2_per_s3 = round(turns.powi(2) + (OUTLINE_JERK * large_px).powi(2));
    tracker.coast_s = 0.7;
    // An aircraft that falls in pieces for some frames is one track soon after.
    tracker.merged_measurements =
        MergedMeasurementsConfig { max_secondary_s: tracker.coast_s, ..MergedMeasurementsConfig::default() };
    tracker.field_px = Some([info.width as f64, info.height as f64]);
    tracker.min_initiation_score = INITIATION_SCORE;
    stretch::of_tracker(tempo, tracker);
    if evidence.are_particles() {
        reasons.push(
            "So many that they are particles or cells: every one is tracked, whether it moves or not.".to_string(),
        );
        tracker.min_initiation_score = WEAK_INITIATION_SCORE;
        return;
    }
    if per_frame > MANY {
        reasons.push(format!(
            "Of so many {} move and the others stand: stars or lamps before which something moves, no particles.",
            evidence.n_moving()
        ));
    }
    report_what_moves(tracker, reasons);
}

/// Has tracks reported that are seen to move.
pub(super) fn report_what_moves(tracker: &mut TrackerConfig, reasons: &mut Vec<String>) {
    tracker.report = Report::Moving;
    reasons.push(
        "A track is reported once it has moved farther than its covariance, the camera's motion and the wander of its outline explain: what stands \
         still is taken for scenery. Report that too with --set tracker.report=all."
            .to_string(),
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::auto::sightings::{Sighting, Sightings};
    use nalgebra::Vector2;

    /// A side with the chains of one thing that moves along a row from `x0`, px, in steps of so many px.
    fn side(per_frame: f64, mean_score: f64, x0: f64, y: f64, step_px: f64) -> Side {
        let scans: Vec<Sightings> = (0..12)
            .map(|k| {
                let at = Vector2::new(x0 + step_px * f64::from(k), y);
                Sightings { time_s: 0.04 * f64::from(k), all: vec![Sighting::of_box(at, 0.1, 6.0)] }
            })
            .collect();
        let chains = Evidence::of(&scans, 76_800.0);
        Side { per_frame, mean_score, side_px: [6.0; 2], chains, ..Side::default() }
    }

    #[test]
    fn many_faint_ones_are_those_of_one_polarity_that_would_start_no_track() {
        let many = |[bright, faint]: [f64; 2], [dark, faint_dark]: [f64; 2]| {
            let side = |all_per_frame, faint_per_frame| Side { all_per_frame, faint_per_frame, ..Side::default() };
            Seen { bright: side(bright, faint), dark: side(dark, faint_dark) }.many_faint()
        };
        assert_eq!(many([40.0, 30.0], [0.0, 0.0]), Some(40.0));
        assert_eq!(many([40.0, 5.0], [0.0, 0.0]), None, "nearly all start tracks");
        assert_eq!(many([40.0, 30.0], [38.0, 30.0]), None, "texture");
        assert_eq!(many([12.0, 10.0], [0.0, 0.0]), None, "few");
    }

    #[test]
    fn before_many_that_stand_what_moves_is_reported_and_where_many_move_all_are() {
        let info = SourceInfo {
            label: String::new(),
            reader: String::new(),
            width: 320,
            height: 240,
            kind: crate::PixelKind::Gray8,
            n_frames: None,
            rate_hz: None,
            true_times: true,
        };
        // One chain in motion beside so many sure blobs a frame.
        let report = |per_frame: f64, step_px: f64| {
            let bright = side(per_frame, 20.0, 50.0, 50.0, step_px);
            let (mut config, mut reasons) = (Config::default(), Vec::new());
            configure(&Seen { bright, dark: Side::default() }, Tempo::VIDEO, &info, &mut config, &mut reasons);
            config.tracker.report
        };
        assert_eq!(report(44.0, 4.0), Report::Moving, "stars and a satellite");
        assert_eq!(report(44.0, 0.0), Report::All, "nothing moves");
        assert_eq!(report(3.0, 4.0), Report::Moving, "few");
    }

    #[test]
    fn the_polarity_is_that_of_what_moves_where_nothing_stands_clear() {
        let seen = |bright, dark| Seen { bright, dark }.polarity();
        let still = || side(0.0, 0.0, 50.0, 50.0, 0.0);
        let moving = |y| side(0.0, 0.0, 50.0, y, 4.0);
        assert_eq!(seen(still(), moving(50.0)), Polarity::Dark);
        assert_eq!(seen(moving(50.0), still()), Polarity::Bright);
        assert_eq!(seen(moving(50.0), moving(150.0)), Polarity::Both);
        assert_ne!(seen(moving(50.0), moving(56.0)), Polarity::Both, "a thing and its dark edge");
        let clear = || side(1.0, 20.0, 50.0, 50.0, 4.0);
        assert_eq!(seen(clear(), moving(150.0)), Polarity::Both, "a clear one and a faint one that goes elsewhere");
        assert_ne!(seen(clear(), moving(56.0)), Polarity::Both, "a clear one and its dark edge");
        assert_ne!(seen(side(40.0, 20.0, 50.0, 50.0, 4.0), moving(150.0)), Polarity::Both, "gaps between many");
        assert_ne!(seen(clear(), side(0.0, 0.0, 50.0, 150.0, 0.0)), Polarity::Both, "what stands is none");
        // What stands clear decides where there is any.
        assert_eq!(seen(moving(50.0), side(1.0, 20.0, 90.0, 150.0, 0.0)), Polarity::Dark);
        assert_eq!(seen(still(), still()), Polarity::Bright);
        // Unless something else is clear in some frames and moves: dead pixels are clearest.
        assert_eq!(seen(side(0.9, 9.0, 50.0, 50.0, 4.0), side(1.8, 28.0, 90.0, 150.0, 0.0)), Polarity::Bright);
        assert_eq!(seen(side(0.9, 9.0, 50.0, 50.0, 0.0), side(1.8, 28.0, 90.0, 150.0, 0.0)), Polarity::Dark);
    }
}
