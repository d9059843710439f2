//! The correction of one track by what was associated with it, and what the scan says of its existence.
//!
//! Source: SPEC D.1, E. Λ of a hard choice is P_D l / λ, of a miss 1 − P_D P_G; of soft weights (JIPDA, D. Mušicki,
//! R. Evans, IEEE Trans. AES 40, 2004) it follows from β₀, the probability that no detection is the target's:
//! ψ ← β₀ ψ (1 − P_D P_G) / (1 − ψ P_D P_G) + (1 − β₀), weights given existence β_j / ψ.

use super::config::TrackerConfig;
use super::gating::{Predicted, ScanTable, innovation_cov, normalised_square};
use super::life_config::LifeConfig;
use super::living::{Outcome, Track};
use super::sharing::Part;
use crate::Scan;
use crate::associate::{Gates, Share};
use crate::record::Innovation;
use boresight_filters::{Filter, Measurement, Weighted};
use nalgebra::{Matrix2, Vector2};

/// Scratch memory of corrections.
#[derive(Default)]
pub(super) struct Scratch {
    weighted: Vec<Weighted>,
}

impl Scratch {
    /// Corrects a track by at most one detection; a filter that refuses it leaves the track as if nothing was seen.
    #[inline]
    pub fn hard(
        &mut self,
        track: &mut Track,
        predicted: &Predicted,
        scan: &Scan,
        table: &ScanTable,
        gates: &Gates,
        row: usize,
        shares: &[Share],
        config: &TrackerConfig,
    ) -> Outcome {
        let prior = gates.prior(row);
        let missed = Outcome { ratio: 1.0 - prior.p_detection * prior.p_gate, ..Outcome::default() };
        let [share] = shares else { return missed };
        let detection = &scan.detections[share.detection as usize];
        let noise = table.noise(share.detection);
        let measurement = Measurement { position: detection.position, cov: noise.matrix() };
        if track.belief.update(&[Weighted { measurement, weight: 1.0 }]).is_err() {
            return missed;
        }
        let residual = detection.position - Vector2::new(predicted.x, predicted.y);
        let cov = innovation_cov(predicted, &noise);
        let nis = normalised_square(&residual, &cov);
        let clutter = gates.clutter(share.detection);
        let density = (-0.5 * nis).exp() / (std::f64::consts::TAU * cov.determinant().sqrt());
        track.seen(detection, &noise, config.look_gain);
        Outcome {
            hit: true,
            shared: false,
            detection: Some(share.detection),
            ratio: prior.p_detection * density / clutter,
            innovation: Some(Innovation { residual, cov, nis }),
        }
    }

    /// Corrects a track by weighted detections.
    pub fn soft(
        &mut self,
        track: &mut Track,
        predicted: &Predicted,
        scan: &Scan,
        table: &ScanTable,
        gates: &Gates,
        row: usize,
        shares: &[Share],
        config: &TrackerConfig,
    ) -> Outcome {
        let p = gates.prior(row);
        let miss = 1.0 - p.p_detection * p.p_gate;
        let missed = Outcome { ratio: miss, ..Outcome::default() };
        let Some(best) = best_share(shares) else { return missed };
        let seen: f64 = shares.iter().map(|s| s.weight).sum();
        let none = (1.0 - seen).max(0.0);
        let (ratio, exists) = if p.existence >= 1.0 {
            (miss / none.max(1e-300), 1.0)
        } else {
            let there = p.existence * miss / (1.0 - p.existence * p.p_detection * p.p_gate).max(1e-300);
            let after = (none * there + seen).clamp(1e-300, 1.0);
            // The same, so that a certain target stays in range: odds after over odds before.
            let odds = after / (none * (1.0 - there)).max(1e-15);
            (odds * (1.0 - p.existence) / p.existence, after)
        };

        self.weighted.clear();
        let mut residual = Vector2::zeros();
        let mut cov = Matrix2::zeros();
        for share in shares {
            let noise = table.noise(share.detection);
            let position = scan.detections[share.detection as usize].position;
            let weight = (share.weight / exists).min(1.0);
            self.weighted.push(Weighted { measurement: Measurement { position, cov: noise.matrix() }, weight });
            residual += (position - Vector2::new(predicted.x, predicted.y)) * weight;
            cov += innovation_cov(predicted, &noise) * (share.weight / seen.max(1e-300));
        }
        if track.belief.update(&self.weighted).is_err() {
            return missed;
        }
        // With M-of-N any gated detection is a hit (SPEC D.5); else the target was seen if that is likelier than not.
        let hit = matches!(config.life, LifeConfig::MOfN(_)) || seen >= 0.5;
        if hit {
            track.seen(&scan.detections[best.detection as usize], &table.noise(best.detection), config.look_gain);
        }
        let nis = normalised_square(&residual, &cov);
        Outcome {
            hit,
            shared: false,
            detection: hit.then_some(best.detection),
            ratio,
            innovation: Some(Innovation { residual, cov, nis }),
        }
    }
}

/// Corrects a track by its part of a shared detection; says nothing of its existence.
pub(super) fn shared(track: &mut Track, predicted: &Predicted, part: &Part) -> Outcome {
    let position = Vector2::from(part.position);
    let measurement = Measurement { position, cov: part.noise.matrix() };
    if track.belief.update(&[Weighted { measurement, weight: 1.0 }]).is_err() {
        return Outcome { ratio: 1.0, ..Outcome::default() };
    }
    let [x, y] = part.position;
    track.anchor = [x, y, part.noise.xx.max(part.noise.yy).sqrt()];
    let residual = position - Vector2::new(predicted.x, predicted.y);
    let cov = innovation_cov(predicted, &part.noise);
    let nis = normalised_square(&residual, &cov);
    Outcome {
        hit: true,
        shared: !part.main,
        detection: Some(part.detection),
        ratio: 1.0,
        innovation: Some(Innovation { residual, cov, nis }),
    }
}

fn best_share(shares: &[Share]) -> Option<Share> {
    shares.iter().copied().reduce(|a, b| if b.weight > a.weight { b } else { a })
}
