//! What the detections are made of, targets' and false ones: P_D, the density of false detections and of new targets, how long targets stay.
//! Confirmation by the probability that a target exists needs these four and nothing else.
//!
//! Source: our own; the rule is IPDA's (`track/confirm/existence.rs`). The tracker runs over the first scans as it is configured; detections of the
//! tracks that it reports are targets', all others false. The numbers that follow are given to it and it runs again, [`PASSES`] times in all.
//! Detections of a target are a Markov chain: P_D after a detection, another after a miss, since what hides a target lasts. Both count the scans between a
//! track's first and last detection, in which it was there for sure. Counts of zero are half a count (Jeffreys' prior).
//! Symbols: λ false detections per px² and scan, β new targets per px² and scan, τ mean time a target stays, s.
//! Limits: a target that is never confirmed counts as false detections.

use super::digits::round;
use super::first_scans::{Shares, first};
use super::score_statistics::{self, Held};
use crate::associate::{AssociatorConfig, CostKind, GlobalNearestConfig};
use crate::tempo::Tempo;
use crate::track::{ClutterConfig, ClutterMapConfig, ConfirmationConfig, ExistenceConfig};
use crate::{Config, Result, Scan, TrackStatus};
use std::collections::{BTreeMap, BTreeSet};

/// The tracker runs this often: the first time under the assumed rule, the second under the one learnt from it.
const PASSES: usize = 2;
/// False tracks that are allowed where nobody says how many: one an hour of video, or one for a hundred targets that come if that is more.
const FALSE_PER_HOUR: f64 = 1.0;
const FALSE_SHARE: f64 = 0.01;
/// Probability at which a track is reported, at least: with hardly a new target an hour one false track an hour would allow every second one.
const LEAST_CONFIRM_PROBABILITY: f64 = 0.9;
/// And at most, and the least probability of the motion test: smaller ones are those of no model.
const LEAST_PROBABILITY: f64 = 1e-9;
/// Detections of a thing that is counted among those that may stand still.
const LEAST_HITS: usize = 3;
/// Detections that the assumed P_D of 0.9 weighs, hits and misses.
const PRIOR_HITS: [f64; 2] = [9.0, 1.0];
/// And that the assumed probability to be found again after a miss weighs: no more than one of each.
const PRIOR_FOUND: [f64; 2] = [1.0, 1.0];
/// P_D is not more certain than this: a target may be hidden in any clip.
const MOST_P_DETECTION: f64 = 0.99;
/// Shortest mean time of a target, s of video.
const LEAST_LIFE_S: f64 = 2.0;
/// A thing at rest is not taken for moving more often than this.
const MOST_FALSE_MOTION: f64 = 0.01;
/// A target may be hidden for so long and keep its id, s of video: now that it is known how long targets stay, likelihoods decide, and this bounds memory alone.
const LONGEST_HIDDEN_S: f64 = 3600.0;
/// Share of the targets' detections that may be given up with what scores less.
pub(super) const FAINT_SHARE: f64 = 0.01;
/// Fewer scans than this tell nothing.
const LEAST_SCANS: usize = 8;

/// What is said where a rate of false tracks was asked for and cannot be given.
pub const RATE_WITHOUT_EFFECT: &str = "--false-tracks-per-hour has no effect here: pieces of regions and boxes of an object detector are no independent false detections, so tracks are \
    confirmed by the number of their hits (tracker.confirmation).";

/// What was found, in the last of the passes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Found {
    /// Tracks that were reported.
    pub n_targets: usize,
    /// Their detections a scan.
    pub per_scan: f64,
    /// From when to when each clear target was followed, s: one of which three of four detections may start a track.
    pub clear_s: Vec<[f64; 2]>,
    /// The score that all but [`FAINT_SHARE`] of their detections reach; 0 of none.
    pub least_score: f64,
    /// Scores of their detections, rising.
    pub scores: Vec<f32>,
}

impl Found {
    /// Detections of targets a scan that score as much or more.
    pub fn per_scan_from(&self, score: f64) -> f64 {
        let less = self.scores.partition_point(|s| f64::from(*s) < score);
        self.per_scan * (self.scores.len() - less) as f64 / self.scores.len().max(1) as f64
    }
}

/// What is known of one track.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    first: usize,
    last: usize,
    hits: usize,
    /// Scans without a detection before the last one, and the runs of these.
    missed: usize,
    gaps: usize,
    /// Detections that it shares with no other track.
    own: usize,
    confirmed: bool,
}

/// Replaces the confirmation rule by existence with the numbers that the scans show, and states the error of the motion test; `area_px2` is the
/// field's, `false_per_hour` how many false tracks are allowed if that was said.
///
/// False tracks begin N ψ₀ / odds an hour (Ville's inequality for the likelihood ratio of N starts of clutter, N ψ₀ = the rate of new targets): the odds asked
/// for are that rate over the false tracks allowed. Things at rest that are tracked, M an hour, may each be taken for moving with that rate over M.
/// # Errors
/// Scans that the tracker refuses.
pub fn learn(
    scans: &[Scan],
    area_px2: f64,
    false_per_hour: Option<f64>,
    config: &mut Config,
    reasons: &mut Vec<String>,
) -> Result<Found> {
    let mut found = Found::default();
    let scans = first(scans);
    let n_scans = scans.len();
    let (Some(first), Some(last)) = (scans.first(), scans.last()) else { return Ok(found) };
    let over_s = last.time.seconds_since(first.time);
    if n_scans < LEAST_SCANS || over_s <= 0.0 || area_px2 <= 0.0 {
        return Ok(found);
    }
    let interval_s = over_s / (n_scans - 1) as f64;
    let tempo = Tempo::of_scans(scans);
    for _ in 0..PASSES {
        let Run { tracks, held, shared } = run(scans, config)?;
        let targets = || tracks.values().filter(|t| t.confirmed);
        let (mut hits, mut missed, mut gaps, mut lived, mut ended, mut begun, mut own) = (0, 0, 0, 0, 0, 0, 0);
        // A track that was seen to the last scans has not ended; one that began in the first ones was there before.
        let coast = (config.tracker.coast_s / interval_s).ceil().max(f64::from(config.tracker.coast_scans)) as usize;
        for t in targets() {
            hits += t.hits.saturating_sub(1);
            missed += t.missed;
            gaps += t.gaps;
            lived += t.last - t.first;
            ended += usize::from(t.last + coast < n_scans);
            begun += usize::from(t.first > coast);
            own += t.own;
        }
        let time_s = |k: usize| scans[k].time.ns as f64 * 1e-9;
        let score = |h: &Held| scans[h.scan].detections[h.detection as usize].score;
        let clear_s = clear(&held, |h| f64::from(score(h)) >= config.tracker.min_initiation_score)
            .map(|id| [time_s(tracks[&id].first), time_s(tracks[&id].last)])
            .collect();
        let mut scores: Vec<f32> = held.iter().map(score).collect();
        scores.sort_unstable_by(f32::total_cmp);
        let faint = (FAINT_SHARE * scores.len() as f64) as usize;
        let least_score = scores.get(faint).map_or(0.0, |s| f64::from(*s));
        let per_scan = own as f64 / n_scans as f64;
        found = Found { n_targets: targets().count(), per_scan, clear_s, least_score, scores };
        let seen_px2 = area_px2 * n_scans as f64;
        let false_density = (n_not_held(scans, &held, &shared) as f64).max(0.5) / seen_px2;
        let new_density = (begun as f64).max(0.5) / seen_px2;
        // Of the scans that follow a detection, those in which a gap begins; of those in a gap, the ones that end it.
        let [after_hit, after_miss] =
            [share(hits.saturating_sub(gaps), gaps, PRIOR_HITS), share(gaps, missed.saturating_sub(gaps), PRIOR_FOUND)];
        let life_s = lived as f64 * interval_s / (ended as f64).max(0.5);
        let tracked = tracks.values().filter(|t| t.hits >= LEAST_HITS).count();
        let per_hour = 3600.0 / (over_s + interval_s);
        let new_per_hour = (begun as f64).max(0.5) * per_hour;
        let allowed =
            false_per_hour.unwrap_or_else(|| (FALSE_SHARE * new_per_hour).max(FALSE_PER_HOUR / tempo.stretched(1.0)));
        let confirm =
            (new_per_hour / (new_per_hour + allowed)).clamp(LEAST_CONFIRM_PROBABILITY, 1.0 - LEAST_PROBABILITY);
        let false_motion = allowed / ((tracked as f64).max(0.5) * per_hour);
        let t = &mut config.tracker;
        t.motion_test.false_motion_probability = round(false_motion.clamp(LEAST_PROBABILITY, MOST_FALSE_MOTION));
        t.detection_probability = round(after_hit.clamp(0.1, MOST_P_DETECTION));
        t.redetection_probability = Some(round(after_miss.clamp(0.01, MOST_P_DETECTION)));
        t.clutter_density_per_px2 = round(false_density);
        // Glitter on water, a tree in the wind: there a detection says less.
        t.clutter = ClutterConfig::Map(ClutterMapConfig {
            memory_s: round(tempo.stretched(ClutterMapConfig::default().memory_s)),
            ..ClutterMapConfig::default()
        });
        if t.reidentification.max_gap_s > 0.0 {
            t.reidentification.max_gap_s = tempo.stretched(LONGEST_HIDDEN_S);
        }
        t.score_likelihood = score_statistics::of(scans, &held, &shared, t.appearance_gain);
        if t.score_likelihood.is_some() {
            t.associator = AssociatorConfig::GlobalNearest(GlobalNearestConfig { cost: CostKind::Likelihood });
        }
        t.confirmation = ConfirmationConfig::Existence(ExistenceConfig {
            new_target_density_per_px2: round(new_density),
            confirm_probability: 1.0 - round(1.0 - confirm),
            mean_target_lifetime_s: round(life_s.max(tempo.stretched(LEAST_LIFE_S))),
            ..ExistenceConfig::default()
        });
    }
    let t = &config.tracker;
    let ConfirmationConfig::Existence(e) = &t.confirmation else { return Ok(found) };
    let new_per_hour = e.new_target_density_per_px2 * area_px2 * 3600.0 / interval_s;
    reasons.push(format!(
        "In {n_scans} scans a target is detected with {:.0} %, after a miss with {:.0} %; {:.2} detections a scan are false, {:.1} targets a minute are new and stay {:.1} s: a track is reported from a \
         probability of {} on, about {:.2} false ones an hour (--false-tracks-per-hour). A lost one that is found again keeps its id if that is likelier than a new target, however long it was \
         hidden.",
        100.0 * t.detection_probability,
        100.0 * t.redetection_probability.unwrap_or(t.detection_probability),
        t.clutter_density_per_px2 * area_px2,
        new_per_hour / 60.0,
        e.mean_target_lifetime_s,
        e.confirm_probability,
        new_per_hour * (1.0 - e.confirm_probability) / e.confirm_probability,
    ));
    Ok(found)
}

/// The targets of which three of four detections are so; one that is fainter was followed by luck.
fn clear(held: &[Held], is_clear: impl Fn(&Held) -> bool) -> impl Iterator<Item = u64> {
    let mut of_track: BTreeMap<u64, [usize; 2]> = BTreeMap::new();
    for h in held {
        let [n, n_clear] = of_track.entry(h.track).or_default();
        (*n, *n_clear) = (*n + 1, *n_clear + usize::from(is_clear(h)));
    }
    of_track.into_iter().filter(|(_, [n, n_clear])| 4 * n_clear >= 3 * n).map(|(id, _)| id)
}

/// How many detections no reported track holds, alone or with others.
fn n_not_held(scans: &[Scan], held: &[Held], shared: &[Held]) -> usize {
    // What is shared is listed once for each of its tracks.
    let n_shared = shared.iter().map(|h| (h.scan, h.detection)).collect::<BTreeSet<_>>().len();
    scans.iter().map(|s| s.detections.len()).sum::<usize>() - held.len() - n_shared
}

/// Share of `yes` with the counts of a prior.
fn share(yes: usize, no: usize, prior: [f64; 2]) -> f64 {
    (yes as f64 + prior[0]) / ((yes + no) as f64 + prior[0] + prior[1])
}

/// What the tracker makes of the scans.
struct Run {
    tracks: BTreeMap<u64, Seen>,
    /// The detections that one reported track holds alone, and those that it shares: of targets that are seen as one.
    held: Vec<Held>,
    shared: Vec<Held>,
}

/// Runs the tracker over the scans.
fn run(scans: &[Scan], config: &Config) -> Result<Run> {
    let mut tracker = crate::track::build(&config.tracker)?;
    let mut tracks: BTreeMap<u64, Seen> = BTreeMap::new();
    let mut shares = Shares::default();
    let (mut held, mut shared) = (Vec::new(), Vec::new());
    for (k, scan) in scans.iter().enumerate() {
        let states = tracker.step(scan)?;
        shares.count(scan.detections.len(), states);
        for s in states {
            let t = tracks.entry(s.id.0).or_insert(Seen { first: k, ..Seen::default() });
            t.confirmed |= s.status != TrackStatus::Tentative;
            let Some(j) = s.detection else { continue };
            let passed = k - t.last;
            if t.hits > 0 && passed > 1 {
                t.missed += passed - 1;
                t.gaps += 1;
            }
            t.last = k;
            t.hits += 1;
            let holds = Held { scan: k, detection: j, track: s.id.0 };
            if shares.is_one(j) {
                t.own += 1;
                held.push(holds);
            } else {
                shared.push(holds);
            }
        }
    }
    [&mut held, &mut shared].into_iter().for_each(|h| h.retain(|h| tracks[&h.track].confirmed));
    Ok(Run { tracks, held, shared })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Detection, FrameIndex, Timestamp};
    use nalgebra::{Matrix2, Vector2};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    const SIDE_PX: f64 = 600.0;

    /// Forty targets in 200 scans of 25 a second, half of them from scan 100 on, that are lost in a scan with the probability `lost` and found again in one with
    /// `found`; `n_false` false detections a scan.
    fn scans(lost: f64, found: f64, n_false: usize) -> Vec<Scan> {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let mut targets: Vec<([f64; 4], bool)> = (0..40)
            .map(|_| {
                let mut v = || 0.3 * rng.sample::<f64, _>(StandardNormal);
                let (vx, vy) = (v(), v());
                ([SIDE_PX * rng.random::<f64>(), SIDE_PX * rng.random::<f64>(), vx, vy], true)
            })
            .collect();
        (0..200u64)
            .map(|k| {
                let mut places = Vec::new();
                for (i, (s, seen)) in targets.iter_mut().enumerate() {
                    (s[0], s[1]) = (s[0] + s[2], s[1] + s[3]);
                    *seen = rng.random::<f64>() < if *seen { 1.0 - lost } else { found };
                    let error = Vector2::from_fn(|_, _| 0.5 * rng.sample::<f64, _>(StandardNormal));
                    if *seen && (i < 20 || k >= 100) {
                        places.push(Vector2::new(s[0], s[1]) + error);
                    }
                }
                places.extend((0..n_false).map(|_| SIDE_PX * Vector2::from_fn(|_, _| rng.random::<f64>())));
                let d = places.iter().map(|p| Detection::at(*p, Matrix2::identity() * 0.25)).collect();
                Scan::at(FrameIndex(k), Timestamp::from_secs_f64(0.04 * k as f64)).with_detections(d)
            })
            .collect()
    }

    fn learnt(scans: &[Scan], allowed: Option<f64>) -> (Config, ExistenceConfig) {
        let mut config = Config::default();
        config.tracker.extra_noise_px = 0.0;
        config.tracker.acceleration_density_px2_per_s3 = 1.0;
        learn(scans, SIDE_PX * SIDE_PX, allowed, &mut config, &mut Vec::new()).unwrap();
        let ConfirmationConfig::Existence(e) = config.tracker.confirmation.clone() else { panic!("another rule") };
        (config, e)
    }

    #[test]
    fn what_the_detections_are_made_of_is_found() {
        for (lost, found, n_false) in [(0.1, 0.9, 10), (0.05, 0.3, 3), (0.2, 0.8, 30)] {
            let (config, e) = learnt(&scans(lost, found, n_false), None);
            let t = &config.tracker;
            let area = SIDE_PX * SIDE_PX;
            let false_a_scan = t.clutter_density_per_px2 * area;
            let new = e.new_target_density_per_px2 * area * 200.0;
            // 6 000 detections: P_D to 0.004; some hundred gaps: 0.03; ends of tracks are cut, which shortens gaps.
            assert!((t.detection_probability - (1.0 - lost)).abs() < 0.03, "{lost}: {}", t.detection_probability);
            let again = t.redetection_probability.unwrap();
            assert!((again - found).abs() < 0.12, "{found}: {again}");
            assert!((false_a_scan / n_false as f64 - 1.0).abs() < 0.2, "{n_false}: {false_a_scan}");
            assert!((17.0..40.0).contains(&new), "twenty come later, and those that were lost long: {new}");
        }
    }

    #[test]
    fn fewer_false_tracks_need_a_higher_probability() {
        let scans = scans(0.1, 0.9, 10);
        let odds = |allowed| {
            let p = learnt(&scans, Some(allowed)).1.confirm_probability;
            p / (1.0 - p)
        };
        // Twenty or more new targets in 8 s are 9 000 an hour.
        assert!((odds(1.0) / 9000.0 - 1.0).abs() < 0.6, "{}", odds(1.0));
        assert!((odds(1.0) / odds(10.0) / 10.0 - 1.0).abs() < 0.3);
    }

    #[test]
    fn a_target_whose_detections_reach_the_score_now_and_then_is_not_clear() {
        // Track 1: three of four, track 2: two of four, track 3: the only one.
        let held: Vec<Held> = [(1, 4), (2, 4), (3, 1)]
            .into_iter()
            .flat_map(|(track, n)| (0..n).map(move |scan| Held { scan, detection: 0, track }))
            .collect();
        let reaches = |h: &Held| h.scan < [3, 2, 1][h.track as usize - 1];
        assert_eq!(clear(&held, reaches).collect::<Vec<_>>(), [1, 3]);
    }

    #[test]
    fn too_few_scans_change_nothing() {
        let mut config = Config::default();
        learn(&scans(0.1, 0.9, 3)[..5], 3.6e5, None, &mut config, &mut Vec::new()).unwrap();
        assert_eq!(config, Config::default());
    }
    #[test]
    fn the_least_score_is_what_all_but_one_in_a_hundred_of_the_targets_detections_reach() {
        // Targets score evenly between 10 and 20, false ones 4.
        let mut scans = scans(0.05, 0.9, 5);
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        for d in scans.iter_mut().flat_map(|s| {
            let n = s.detections.len() - 5;
            s.detections.iter_mut().enumerate().map(move |(i, d)| (i < n, d))
        }) {
            d.1.score = if d.0 { 10.0 + 10.0 * rng.random::<f32>() } else { 4.0 };
        }
        let mut config = Config::default();
        config.tracker.extra_noise_px = 0.0;
        config.tracker.acceleration_density_px2_per_s3 = 1.0;
        let found = learn(&scans, SIDE_PX * SIDE_PX, None, &mut config, &mut Vec::new()).unwrap();
        assert!((found.least_score - 10.1).abs() < 0.05, "{}", found.least_score);
    }
}
