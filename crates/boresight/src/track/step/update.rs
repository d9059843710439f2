//! Update: each track's state by what was associated with it, and what the scan says of its existence.
//!
//! Source: docs/theory/filters.md, docs/theory/association.md. Λ of a hard choice is P_D l / λ, of a miss 1 − P_D P_G; of soft weights
//! (JIPDA, D. Mušicki, R. Evans, IEEE Trans. AES 40, 2004) it follows from β₀, the probability that no detection is the target's:
//! ψ ← β₀ ψ (1 − P_D P_G) / (1 − ψ P_D P_G) + (1 − β₀), weights given existence β_j / ψ.
//! Limits: a filter that refuses a measurement leaves the track as if nothing was seen.

use super::super::confirm::rule::ConfirmationConfig;
use super::super::merged_measurements::Part;
use super::super::scan_table::{Cov2, Predicted};
use super::super::single_track::{Outcome, Track};
use super::associate::Association;
use super::context::{Context, VelocityCost};
use super::gate::{innovation_cov, normalised_square};
use super::plot_time::{Carried, advance};
use crate::associate::{Gates, Share};
use crate::record::TrackInnovation;
use boresight_filters::{Filter, Measurement, Weighted};
use nalgebra::{Matrix2, Vector2};

/// Updates track `i`, asked for in ascending order, by its part of a merged measurement if it has one, else by what the stages assigned
/// to it. `weighted` is scratch memory.
#[inline]
pub(in crate::track) fn update(
    context: &Context<'_>,
    i: usize,
    track: &mut Track,
    predicted: &Predicted,
    part: Option<&Part>,
    association: &mut Association,
    weighted: &mut Vec<Weighted>,
) -> Outcome {
    let mut outcome = Outcome { likelihood_ratio: 1.0, ..Outcome::default() };
    if let Some(part) = part {
        outcome = merged(track, predicted, part);
    }
    // With times of their own, the filter stands still where the scan before left it.
    let mut is_at_scan = !context.table.is_timed();
    for stage in &mut association.stages {
        if let Some(row) = stage.next_row(i)
            && part.is_none()
        {
            let (gates, shares) = (&stage.gates, stage.answer.row(row));
            if !is_at_scan && let Some(best) = best_share(shares) {
                is_at_scan = true;
                let carried = Carried::new(context, track, shares, best.detection);
                let place = |j: u32| carried.place(context, j);
                outcome =
                    by_shares(context, track, &carried.predicted, gates, row, shares, stage.soft, place, weighted);
                carried.to_scan(track);
            } else {
                let place = |j: u32| context.measured(j, predicted);
                outcome = by_shares(context, track, predicted, gates, row, shares, stage.soft, place, weighted);
            }
        }
    }
    if !is_at_scan {
        advance(track, context.dt_s);
    }
    outcome
}

/// Updates a track by what a stage gave it; `place` says where a detection counts, and with which noise.
#[inline]
fn by_shares(
    context: &Context<'_>,
    track: &mut Track,
    predicted: &Predicted,
    gates: &Gates,
    row: usize,
    shares: &[Share],
    is_soft: bool,
    place: impl Fn(u32) -> (Vector2<f64>, Cov2),
    weighted: &mut Vec<Weighted>,
) -> Outcome {
    if is_soft {
        soft(context, track, predicted, gates, row, shares, place, weighted)
    } else {
        hard(context, track, predicted, gates, row, shares)
    }
}

/// Updates a track by at most one detection.
#[inline]
fn hard(
    context: &Context<'_>,
    track: &mut Track,
    predicted: &Predicted,
    gates: &Gates,
    row: usize,
    shares: &[Share],
) -> Outcome {
    let prior = gates.prior(row);
    let missed = Outcome { likelihood_ratio: 1.0 - prior.p_detection * prior.p_gate, ..Outcome::default() };
    let [share] = shares else { return missed };
    let detection = &context.scan.detections[share.detection as usize];
    let (position, noise) = context.measured(share.detection, predicted);
    let measurement = Measurement { position, cov: noise.matrix() };
    let velocity = context.velocity_cost(track, share.detection, VelocityCost::Likelihood);
    if track.filter.update(&[Weighted { measurement, weight: 1.0 }]).is_err() {
        return missed;
    }
    let innovation = innovation_of(&position, predicted, &innovation_cov(predicted, &noise));
    let clutter = gates.clutter(share.detection);
    let score = (-0.5 * (context.score_cost(track, share.detection) + velocity)).exp();
    let density = score * (-0.5 * innovation.nis).exp() / (std::f64::consts::TAU * innovation.cov.determinant().sqrt());
    let log_score = context.table.scores.log_score(share.detection);
    track.follow(detection, context.age_ns(share.detection), &noise, log_score, context.config.appearance_gain);
    Outcome {
        hit: true,
        detection: Some(share.detection),
        likelihood_ratio: prior.p_detection * density / clutter,
        innovation: Some(innovation),
        ..Outcome::default()
    }
}

/// Updates a track by weighted detections.
fn soft(
    context: &Context<'_>,
    track: &mut Track,
    predicted: &Predicted,
    gates: &Gates,
    row: usize,
    shares: &[Share],
    place: impl Fn(u32) -> (Vector2<f64>, Cov2),
    weighted: &mut Vec<Weighted>,
) -> Outcome {
    let p = gates.prior(row);
    let miss = 1.0 - p.p_detection * p.p_gate;
    let missed = Outcome { likelihood_ratio: miss, ..Outcome::default() };
    let Some(best) = best_share(shares) else { return missed };
    let seen: f64 = shares.iter().map(|s| s.weight).sum();
    let none = (1.0 - seen).max(0.0);
    let (likelihood_ratio, exists) = if p.existence >= 1.0 {
        (miss / none.max(1e-300), 1.0)
    } else {
        let there = p.existence * miss / (1.0 - p.existence * p.p_detection * p.p_gate).max(1e-300);
        let after = (none * there + seen).clamp(1e-300, 1.0);
        // The same, so that a certain target stays in range: odds after over odds before.
        let odds = after / (none * (1.0 - there)).max(1e-15);
        (odds * (1.0 - p.existence) / p.existence, after)
    };

    weighted.clear();
    let mut innovation = TrackInnovation { innovation: Vector2::zeros(), cov: Matrix2::zeros(), nis: 0.0 };
    for share in shares {
        let (position, noise) = place(share.detection);
        let weight = (share.weight / exists).min(1.0);
        weighted.push(Weighted { measurement: Measurement { position, cov: noise.matrix() }, weight });
        // Means over the detections, given that one of them is the target's: that of νᵀ S⁻¹ ν is χ² as of a sure one,
        // the square of the mean innovation is not.
        let given_seen = share.weight / seen.max(1e-300);
        let one = innovation_of(&position, predicted, &innovation_cov(predicted, &noise));
        innovation.innovation += one.innovation * given_seen;
        innovation.nis += one.nis * given_seen;
        innovation.cov += one.cov * given_seen;
    }
    if track.filter.update(weighted).is_err() {
        return missed;
    }
    // With M-of-N any gated detection is a hit; else the target was seen if that is likelier than not.
    let hit = matches!(context.config.confirmation, ConfirmationConfig::MOfN(_)) || seen >= 0.5;
    if hit {
        let (d, noise) = (&context.scan.detections[best.detection as usize], context.table.noise(best.detection));
        let log_score = context.table.scores.log_score(best.detection);
        track.follow(d, context.age_ns(best.detection), &noise, log_score, context.config.appearance_gain);
    }
    Outcome {
        hit,
        detection: hit.then_some(best.detection),
        likelihood_ratio,
        // Of clutter alone it would say nothing of the filter.
        innovation: (seen >= 0.5).then_some(innovation),
        ..Outcome::default()
    }
}

/// Updates a track by its part of a merged measurement; says nothing of its existence.
fn merged(track: &mut Track, predicted: &Predicted, part: &Part) -> Outcome {
    let position = Vector2::from(part.position);
    let measurement = Measurement { position, cov: part.noise.matrix() };
    if track.filter.update(&[Weighted { measurement, weight: 1.0 }]).is_err() {
        return Outcome { likelihood_ratio: 1.0, ..Outcome::default() };
    }
    let [x, y] = part.position;
    (track.last_place, track.last_age_ns) = ([x, y, part.noise.xx.max(part.noise.yy).sqrt()], 0);
    Outcome {
        hit: true,
        merged: true,
        secondary: !part.primary,
        detection: Some(part.detection),
        likelihood_ratio: 1.0,
        innovation: part.measures.then(|| innovation_of(&position, predicted, &innovation_cov(predicted, &part.noise))),
    }
}

/// Innovation of a measurement at `position` (px) with the innovation covariance `cov` (px²).
#[inline]
pub(in crate::track) fn innovation_of(
    position: &Vector2<f64>,
    predicted: &Predicted,
    cov: &Matrix2<f64>,
) -> TrackInnovation {
    let innovation = position - Vector2::new(predicted.x, predicted.y);
    TrackInnovation { innovation, cov: *cov, nis: normalised_square(&innovation, cov) }
}

fn best_share(shares: &[Share]) -> Option<Share> {
    shares.iter().copied().reduce(|a, b| if b.weight > a.weight { b } else { a })
}

#[cfg(test)]
mod tests {
    use crate::associate::AssociatorConfig;
    use crate::track::{InitialTrackConfig, TrackerConfig, build};
    use crate::{Detection, FrameIndex, Scan, Timestamp};
    use nalgebra::{Matrix2, Vector2};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// Mean NIS of a target of known model (P_D 0.9, R 1 px²) in `n_clutter` false detections a scan over 40 x 40 px.
    fn mean_nis(n_clutter: usize) -> f64 {
        let initial =
            InitialTrackConfig { position_std_px: 1.0, velocity_std_px_per_s: 0.1, ..InitialTrackConfig::default() };
        let config = TrackerConfig {
            associator: AssociatorConfig::Pda(Default::default()),
            initial_tracks: vec![initial],
            acceleration_std_px_per_s2: Some(0.1),
            extra_noise_px: 0.0,
            clutter_density_per_px2: (n_clutter as f64 / 1600.0).max(1e-9),
            coast_s: 1e9,
            max_tracks: 1,
            ..TrackerConfig::default()
        };
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let (mut sum, mut n) = (0.0, 0.0);
        for _ in 0..60 {
            let mut tracker = build(&config).unwrap();
            let mut truth = [Vector2::<f64>::zeros(), Vector2::zeros()];
            for k in 0..25 {
                let a = Vector2::from_fn(|_, _| 0.1 * rng.sample::<f64, _>(StandardNormal));
                truth = [truth[0] + truth[1] + 0.5 * a, truth[1] + a];
                let seen = rng.random::<f64>() < 0.9;
                let own = truth[0] + Vector2::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
                let mut places = if seen { vec![own] } else { Vec::new() };
                let mut clutter = || truth[0] + Vector2::from_fn(|_, _| 40.0 * rng.random::<f64>() - 20.0);
                places.extend((0..n_clutter).map(|_| clutter()));
                let detection = |position: &Vector2<f64>| Detection::at(*position, Matrix2::identity());
                let time = Timestamp::from_secs_f64(f64::from(k));
                let scan =
                    Scan::at(FrameIndex::default(), time).with_detections(places.iter().map(detection).collect());
                let states = tracker.step(&scan).unwrap();
                if let Some(i) = states.first().and_then(|s| s.innovation.as_ref()).filter(|_| k > 2) {
                    sum += i.nis;
                    n += 1.0;
                }
            }
        }
        sum / n
    }

    #[test]
    fn the_nis_of_weighted_detections_is_that_of_the_targets_own() {
        // χ² with 2 degrees of freedom within a gate of 99 %: 2 - 9.21 · 0.01/0.99 = 1.907; 1 300 values, so ± 0.11 at 95 %.
        for n_clutter in [0, 8, 32] {
            let nis = mean_nis(n_clutter);
            assert!((1.65..2.2).contains(&nis), "{n_clutter} false detections: NIS {nis}");
        }
    }

    #[test]
    fn the_innovation_of_weighted_detections_is_their_mean_by_likelihood() {
        let initial = InitialTrackConfig { position_std_px: 1.0, ..InitialTrackConfig::default() };
        let config = TrackerConfig {
            associator: AssociatorConfig::Pda(Default::default()),
            initial_tracks: vec![initial],
            extra_noise_px: 0.0,
            clutter_density_per_px2: 1e-9,
            ..TrackerConfig::default()
        };
        let innovation = |places: &[[f64; 2]]| {
            let detections = places.iter().map(|p| Detection::at(Vector2::from(*p), Matrix2::identity())).collect();
            let scan = Scan::at(FrameIndex::default(), Timestamp::default()).with_detections(detections);
            build(&config).unwrap().step(&scan).unwrap()[0].innovation.unwrap().innovation
        };
        // The target is predicted at (0, 0), S = 2 I: likelihoods go as e^(−r²/4).
        assert!((innovation(&[[0.5, -0.25]]) - Vector2::new(0.5, -0.25)).norm() < 1e-9);
        let (a, b) = ((-0.25f64 / 4.0).exp(), (-1f64 / 4.0).exp());
        let want = Vector2::new((0.5 * a - b) / (a + b), 0.0);
        assert!((innovation(&[[0.5, 0.0], [-1.0, 0.0]]) - want).norm() < 1e-9);
    }
}
