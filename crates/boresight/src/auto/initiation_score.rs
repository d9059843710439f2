//! From which score on a detection starts a track: lower where what moves is fainter than assumed, higher where false ones would start too many.
//!
//! Source: our own. Of a scene that nobody knows a target is assumed to stand out clearly; what moves and does not would never start a track. Whether it moves is told by the
//! chains of the first pass ([`super::evidence`]), which know of no such score: those count of which each gains surely more than any in another order of the scans.
//! How: the score is lowered to what three of four detections of every such chain reach, of those that gain a tenth of what the surest gains and in most of whose time no clear
//! target is followed: beside one, what moves faintly is waves, leaves and reflections as often as another target. They must be surely more than such chains are beside clear targets
//! (Poisson's deviation, [`STDS`] times).
//! Where targets are many and all that stands is reported, it is raised instead ([`raised`]), and what scores less than the targets do is not looked for ([`kept`]).
//! Limits: a faint target beside a clear one is not looked for.

use super::chains::Chain;
use super::detection_statistics::{FAINT_SHARE, Found};
use super::digits::round;
use super::evidence::Evidence;
use crate::Config;
use crate::track::Report;
use crate::vision::threshold::ThresholdConfig;

/// Share of a chain's detections that start a track, less what comes back by following it backward: three of four.
const MISSED_SHARE: f64 = 0.25;
/// Share of the surest chain's gain from which another one counts.
const GAIN_SHARE: f64 = 0.1;

/// Deviations by which chains must be more than expected.
const STDS: f64 = 3.0;

/// Share of false ones among the detections that may start a track, where targets are many and all that stands is reported.
const FALSE_STARTS: f64 = 0.01;

/// Detections of targets after which it is known what hardly one of them falls short of: of so many some ten do, give or take three.
pub const ENOUGH_HELD: f64 = 10.0 / FAINT_SHARE;

/// Lowers the least score that starts a track to what the chains show, and says whether it did; `clear_s` lists from when to when clear targets are followed, s.
pub fn learn(evidence: &Evidence, clear_s: &[[f64; 2]], config: &mut Config, reasons: &mut Vec<String>) -> bool {
    let assumed = config.tracker.min_initiation_score;
    let alone = |c: &Chain| {
        let time = |h: &(usize, _)| evidence.times_s.get(h.0).copied().unwrap_or(f64::NAN);
        let beside = |t: f64| clear_s.iter().any(|s| (s[0]..=s[1]).contains(&t));
        2 * c.hits.iter().filter(|h| beside(time(h))).count() < c.hits.len()
    };
    let most = evidence.sure().map(|c| c.gain).fold(0.0, f64::max);
    let sure = || evidence.sure().filter(|c| c.gain >= GAIN_SHARE * most);
    let counting = || sure().filter(|c| alone(c));
    // What moves faintly while a clear target is followed says how much of that there is at any time.
    let is_faint = |c: &&Chain| faintest(c) < assumed;
    let n_alone = counting().filter(is_faint).count();
    let n_beside = sure().filter(is_faint).count() - n_alone;
    let [beside_s, alone_s] = times_s(evidence, clear_s);
    let expected = if n_beside > 0 { n_beside as f64 * alone_s / beside_s } else { 0.0 };
    if n_alone as f64 <= expected + STDS * expected.sqrt() {
        return false;
    }
    let score = round(counting().map(faintest).fold(f64::INFINITY, f64::min));
    // A detector without scores says nothing.
    if !(score > 0.0 && score < assumed) {
        return false;
    }
    let n = counting().count();
    reasons.push(format!(
        "{n} chain{} though fainter than a score of {assumed}: detections of {score} start tracks.",
        if n == 1 {
            " of detections moves and is surely no chance,"
        } else {
            "s of detections move and are surely no chance,"
        },
    ));
    config.tracker.min_initiation_score = score;
    true
}

/// How long, of the time of the chains, a clear target is followed, and how long none is, s.
fn times_s(evidence: &Evidence, clear_s: &[[f64; 2]]) -> [f64; 2] {
    let (Some(&first), Some(&last)) = (evidence.times_s.first(), evidence.times_s.last()) else { return [0.0; 2] };
    let mut spans: Vec<[f64; 2]> = clear_s.iter().map(|s| s.map(|t| t.clamp(first, last))).collect();
    spans.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let (mut beside, mut upto) = (0.0, first);
    for [from, to] in spans {
        beside += (to - from.max(upto)).max(0.0);
        upto = upto.max(to);
    }
    [beside, last - first - beside]
}

/// The score from which on false detections are at most [`FALSE_STARTS`] of those that start a track, with the reason, if it is higher than the one configured and there is any: of the
/// targets `found` only those count that score as much. The field is of `area_px2`. Where all that stands is reported, nothing else tells what a codec makes of noise, which lasts for many
/// frames, from a target.
pub fn raised(found: &Found, area_px2: f64, config: &Config) -> Option<(f64, String)> {
    let t = &config.tracker;
    let law = t.score_likelihood.as_ref().filter(|_| t.report == Report::All && t.min_initiation_score > 0.0)?;
    // Of n false ones of a scan n (s / least)^-k score more than s; each step upward loses targets, until it is consistent or none is left.
    let n_false = t.clutter_density_per_px2 * area_px2;
    let asked = |targets: f64| law.least_score * (n_false / (FALSE_STARTS * targets)).powf(1.0 / law.clutter_exponent);
    let (mut score, mut targets) = (t.min_initiation_score, found.per_scan_from(t.min_initiation_score));
    while targets > 0.0 && asked(targets) > score {
        score = asked(targets);
        targets = found.per_scan_from(score);
    }
    // Where false detections score as targets do, the score tells nothing: more targets would be lost than there are false ones.
    if found.per_scan_from(t.min_initiation_score) - targets > n_false {
        return None;
    }
    let score = round(score);
    let reason = || {
        format!(
            "Detections of {score} start tracks, not of {}: of {n_false:.0} false ones a scan so few score more that they are {} % of all.",
            t.min_initiation_score,
            100.0 * FALSE_STARTS,
        )
    };
    (targets > 0.0 && score > t.min_initiation_score && score.is_finite()).then(|| (score, reason()))
}

/// The least score that the detector then keeps, with the reason, if it keeps less now: what hardly a detection of a target falls short of (`least_score`), and no more than
/// starts a track. What is not found costs nothing, neither time nor a wrong choice of the tracker.
pub fn kept(least_score: f64, config: &Config) -> Option<(f64, String)> {
    let ThresholdConfig::Isolated(isolated) = &config.detector.threshold else { return None };
    let score = round(least_score.min(config.tracker.min_initiation_score));
    (score > isolated.min_score).then(|| {
        let before = isolated.min_score;
        (score, format!("Detections of less than {score} (not {before}) are left out: 99 % of the targets' reach it."))
    })
}

/// The score that all but [`MISSED_SHARE`] of a chain's detections reach.
fn faintest(chain: &Chain) -> f64 {
    let mut scores: Vec<f64> = chain.hits.iter().map(|h| h.1.score).collect();
    let at = (MISSED_SHARE * scores.len() as f64) as usize;
    if at >= scores.len() { 0.0 } else { *scores.select_nth_unstable_by(at, f64::total_cmp).1 }
}

#[cfg(test)]
mod tests {
    use super::super::sightings::Sighting;
    use super::*;
    use crate::track::ScoreLikelihoodConfig;
    use crate::{Detection, FrameIndex, Scan, Timestamp};
    use nalgebra::Vector2;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// What starts tracks after 60 scans of 25 a second of targets that move by 2 px a scan, of these scores, with five false detections a scan of score 3; clear targets
    /// are followed at these times, s.
    fn learnt(targets: &[f32], clear_s: &[[f64; 2]]) -> (f64, usize) {
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let scans: Vec<Scan> = (0..60u64)
            .map(|k| {
                let target = |(i, score): (usize, &f32)| {
                    Detection::point(20.0 + 2.0 * k as f64, 40.0 + 50.0 * i as f64, 0.2).with_score(*score)
                };
                let mut all: Vec<Detection> = targets.iter().enumerate().map(target).collect();
                all.extend((0..5).map(|_| {
                    Detection::point(320.0 * rng.random::<f64>(), 240.0 * rng.random::<f64>(), 0.2).with_score(3.0)
                }));
                Scan::at(FrameIndex(k), Timestamp::from_secs_f64(0.04 * k as f64)).with_detections(all)
            })
            .collect();
        let (mut config, mut reasons) = (Config::default(), Vec::new());
        config.tracker.min_initiation_score = 6.0;
        let evidence = Evidence::of_scans(&scans, 320.0 * 240.0);
        let lowered = learn(&evidence, clear_s, &mut config, &mut reasons);
        assert_eq!(lowered, config.tracker.min_initiation_score < 6.0);
        (config.tracker.min_initiation_score, reasons.len())
    }

    #[test]
    fn what_moves_faintly_starts_tracks_where_nothing_moves_clearly() {
        assert_eq!(learnt(&[3.5], &[]), (3.5, 1));
        assert_eq!(learnt(&[4.5, 3.5], &[]), (3.5, 1));
        assert_eq!(learnt(&[20.0, 3.5], &[[0.0, 1.0]]), (3.5, 1), "the clear one is there for a time only");
        assert_eq!(learnt(&[20.0, 3.5], &[[0.0, 2.4]]), (6.0, 0), "beside a clear one");
        assert_eq!(learnt(&[20.0, 20.0], &[]), (6.0, 0), "clear targets start by themselves");
        assert_eq!(learnt(&[], &[]), (6.0, 0), "false detections are no chains");
        assert_eq!(learnt(&[0.0], &[]), (6.0, 0), "a detector without scores");
    }

    #[test]
    fn the_time_with_a_clear_target_is_that_of_its_spans_together() {
        let mut evidence = Evidence::default();
        evidence.times_s = vec![0.0, 5.0, 10.0];
        assert_eq!(times_s(&evidence, &[]), [0.0, 10.0]);
        // 2 to 5 and 4 to 6 are four seconds, 9 to 12 is one of them.
        assert_eq!(times_s(&evidence, &[[4.0, 6.0], [2.0, 5.0], [9.0, 12.0]]), [5.0, 5.0]);
        assert_eq!(times_s(&Evidence::default(), &[[0.0, 1.0]]), [0.0; 2]);
    }

    #[test]
    fn faint_chains_count_where_they_are_surely_more_than_beside_clear_targets() {
        // A wave crosses the field every second, and a clear target is followed from the third second on.
        let wave = |k: usize| Chain {
            gain: 400.0,
            moves: true,
            hits: (0..20)
                .map(|i| (25 * k + i, Sighting { score: 3.0, ..Sighting::of_box(Vector2::zeros(), 0.1, 3.0) }))
                .collect(),
            speeds_px_per_s: Vec::new(),
        };
        let evidence = |waves: &[usize]| {
            let mut evidence = Evidence::default();
            evidence.moving = waves.iter().map(|&k| wave(k)).collect();
            evidence.times_s = (0..250).map(|k| 0.04 * f64::from(k)).collect();
            evidence
        };
        let lowered = |waves: &[usize], clear_s: &[[f64; 2]]| {
            let mut config = Config::default();
            config.tracker.min_initiation_score = 6.0;
            learn(&evidence(waves), clear_s, &mut config, &mut Vec::new())
        };
        let all: Vec<usize> = (0..10).collect();
        assert!(lowered(&all, &[]), "nothing clear: they may be the targets");
        assert!(!lowered(&all, &[[3.0, 10.0]]), "three of them are as many as come anyway");
        assert!(lowered(&[0, 1, 2], &[[3.0, 10.0]]), "none comes while the clear one is there");
    }

    #[test]
    fn where_all_that_stands_is_reported_few_false_detections_start_tracks() {
        let mut config = Config::default();
        config.tracker.min_initiation_score = 4.0;
        config.tracker.report = Report::All;
        config.tracker.clutter_density_per_px2 = 1e-4;
        let from = |per_scan: f64, exponent: f64, report: Report| {
            let mut c = config.clone();
            c.tracker.report = report;
            c.tracker.score_likelihood =
                Some(ScoreLikelihoodConfig { least_score: 2.5, clutter_exponent: exponent, ..Default::default() });
            let found = Found { per_scan, scores: vec![25.0; 50], ..Found::default() };
            raised(&found, 1e6, &c).map(|(score, _)| score)
        };
        // Of 100 false ones 0.5 score more than 2.5 * 200^(1/5), a hundredth of 50.
        assert!((from(50.0, 5.0, Report::All).unwrap() - 7.21).abs() < 0.01);
        assert_eq!(from(50.0, 20.0, Report::All), None, "hardly any scores more than 4");
        assert_eq!(from(50.0, 5.0, Report::Moving), None, "the test of motion decides");
        assert_eq!(from(0.0, 5.0, Report::All), None, "no target, nothing to compare with");
        // 2.5 * 200^(1/2) is 35: of such a law no score of 25 stands out, and one that no target reaches starts no track.
        assert_eq!(from(50.0, 2.0, Report::All), None, "no score tells them apart");
    }

    #[test]
    fn no_more_targets_are_lost_than_there_are_false_detections() {
        let mut config = Config::default();
        config.tracker.min_initiation_score = 4.0;
        config.tracker.report = Report::All;
        config.tracker.score_likelihood =
            Some(ScoreLikelihoodConfig { least_score: 10.0, clutter_exponent: 1.0, ..Default::default() });
        // Fifty targets a scan of scores from 10 to 59, and false ones that score as they do.
        let found = Found { per_scan: 50.0, scores: (10..60u8).map(f32::from).collect(), ..Found::default() };
        let mut of = |n_false: f64| {
            config.tracker.clutter_density_per_px2 = n_false * 1e-6;
            raised(&found, 1e6, &config).map(|(score, _)| score)
        };
        // From 12.8 on they are one in a hundred, 0.47 of 0.6: three targets would be lost for 0.13.
        assert_eq!(of(0.6), None);
        assert_eq!(of(0.5), Some(10.0), "one in a hundred of what all targets reach");
    }

    #[test]
    fn what_hardly_a_target_scores_is_not_kept_and_nothing_that_starts_a_track_goes() {
        let mut config = Config::default();
        config.tracker.min_initiation_score = 7.0;
        assert_eq!(kept(20.0, &config), None, "a detector without such a score");
        config.detector.threshold =
            ThresholdConfig::Isolated(crate::vision::isolated::IsolatedConfig { min_score: 2.5, ..Default::default() });
        let score = |least: f64| kept(least, &config).map(|(score, _)| score);
        assert_eq!(score(5.0), Some(5.0));
        assert_eq!(score(20.0), Some(7.0));
        assert_eq!(score(2.0), None);
        assert_eq!(score(0.0), None, "no target");
    }
}
