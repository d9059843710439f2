//! One stage of association: some of the tracks against the detections still free.
//!
//! Source: SPEC D.5 (2), (3). Rows are the tracks that `who` picks; detections taken by an earlier stage are not seen.
//! In soft stages (PDA and its kin) all gated detections count as used, as SPEC D.5 says.

use super::gating::{innovation_cov, normalised_square, prior};
use super::tracker::{Outcome, Track, Tracker};
use crate::Scan;
use crate::associate::{Assignment, Associator, AssociatorConfig, Gates, Share};
use crate::record::Innovation;
use boresight_filters::{Filter, Measurement, Weighted};
use nalgebra::{Matrix2, Vector2};

/// An associator with its tables.
#[derive(Default)]
pub(super) struct Stage {
    associator: Option<Box<dyn Associator>>,
    soft: bool,
    gates: Gates,
    answer: Assignment,
    rows: Vec<u32>,
    weighted: Vec<Weighted>,
}

impl Stage {
    pub fn new(config: &AssociatorConfig) -> Self {
        Self { associator: Some(config.build()), soft: config.is_soft(), gates: Gates::new(), ..Self::default() }
    }

    /// Associates and updates the tracks that `who` picks.
    pub fn run(&mut self, tracker: &mut Tracker, scan: &Scan, who: impl Fn(&Track) -> bool) {
        let Some(associator) = &mut self.associator else { return };
        let config = &tracker.config;
        self.rows.clear();
        self.gates.reset(scan.detections.len(), config.clutter_density_per_px2);
        let likelihood = associator.needs_likelihood() || !matches!(config.life, super::life::LifeConfig::MOfN(_));
        for (i, t) in tracker.tracks.iter().enumerate() {
            if !who(t) {
                continue;
            }
            self.rows.push(i as u32);
            let used = &tracker.used;
            tracker.table.gate_row(
                &tracker.predicted[i],
                tracker.gate,
                config.max_gated as usize,
                likelihood,
                |j| !used[j as usize],
                |_| 0.0,
                &mut self.gates,
            );
            let existence = config.life.existence(&t.life);
            self.gates.end_row(prior(config.detection_probability, config.gate_probability, existence, tracker.gate));
        }
        if self.rows.is_empty() {
            return;
        }
        associator.associate(&self.gates, &mut self.answer);
        for row in 0..self.rows.len() {
            let i = self.rows[row] as usize;
            tracker.outcomes[i] = self.apply(tracker, scan, row, i);
        }
    }

    /// Corrects one track by its shares; a filter that refuses them leaves the track as if nothing was seen.
    fn apply(&mut self, tracker: &mut Tracker, scan: &Scan, row: usize, i: usize) -> Outcome {
        let shares = self.answer.row(row);
        let p = self.gates.prior(row);
        let log_missed = (1.0 - p.p_detection * p.p_gate).max(1e-300).ln();
        if self.soft {
            for pair in self.gates.row(row) {
                tracker.used[pair.detection as usize] = true;
            }
        }
        let missed = Outcome { log_ratio: log_missed, ..Outcome::default() };
        let Some(best) = best_share(shares) else { return missed };

        let seen: f64 = shares.iter().map(|s| s.weight).sum();
        let none = (1.0 - seen).max(0.0);
        let (log_ratio, seen_if_exists) = if self.soft {
            // β₀ also holds "there is no target": weights are taken given that it exists.
            let there = p.existence * (1.0 - p.p_detection * p.p_gate)
                / (1.0 - p.existence * p.p_detection * p.p_gate).max(1e-300);
            let exists = (none * there + seen).clamp(1e-300, 1.0);
            let odds = exists / (1.0 - exists).max(1e-300);
            let before = p.existence / (1.0 - p.existence).max(1e-300);
            let ratio =
                if p.existence >= 1.0 { (1.0 - p.p_detection * p.p_gate) / none.max(1e-300) } else { odds / before };
            (ratio.max(1e-300).ln(), exists)
        } else {
            let pair = self.gates.row(row).iter().find(|q| q.detection == best.detection);
            let ratio =
                pair.map_or(0.0, |q| p.p_detection.ln() + q.log_likelihood - self.gates.log_clutter(q.detection));
            (ratio, 1.0)
        };

        self.weighted.clear();
        let mut residual = Vector2::zeros();
        let mut s_mean = Matrix2::zeros();
        let predicted = tracker.predicted[i];
        for share in shares {
            let noise = &tracker.table.noise[share.detection as usize];
            let position = scan.detections[share.detection as usize].position;
            let weight = (share.weight / seen_if_exists).min(1.0);
            self.weighted.push(Weighted { measurement: Measurement { position, cov: noise.matrix() }, weight });
            residual += (position - Vector2::new(predicted.x, predicted.y)) * weight;
            s_mean += innovation_cov(&predicted, noise) * (share.weight / seen.max(1e-300));
        }
        let track = &mut tracker.tracks[i];
        if track.belief.update(&self.weighted).is_err() {
            return missed;
        }
        tracker.used[best.detection as usize] = true;
        let hit = !self.soft || hit_when_soft(tracker, seen);
        if hit {
            tracker.tracks[i].seen(scan, best.detection, &tracker.table.noise[best.detection as usize]);
        }
        let nis = normalised_square(&residual, &s_mean);
        Outcome {
            hit,
            detection: hit.then_some(best.detection),
            log_ratio,
            innovation: Some(Innovation { residual, cov: s_mean, nis }),
        }
    }
}

/// With M-of-N any gated detection is a hit (SPEC D.5); else the target was seen if that is likelier than not.
fn hit_when_soft(tracker: &Tracker, seen: f64) -> bool {
    matches!(tracker.config.life, super::life::LifeConfig::MOfN(_)) || seen >= 0.5
}

fn best_share(shares: &[Share]) -> Option<Share> {
    shares.iter().copied().reduce(|a, b| if b.weight > a.weight { b } else { a })
}
