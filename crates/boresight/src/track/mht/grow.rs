//! Growth of the trees: every leaf by a miss and by its gated detections, every detection as a new target.
//!
//! A leaf whose life ends (score, existence, coasting budget) is cut at once. New targets start from one point with
//! unknown velocity; those that the next scans do not bear out die by their score.

use super::super::association_cost::Look;
use super::super::confirm::confirmation_gate::Proof;
use super::super::confirm::rule::{Evidence, Verdict};
use super::super::initiation::from_one_point;
use super::super::single_track::Outcome;
use super::super::step::gate::{Noise, Predicted, innovation_cov, normalised_square};
use super::{Leaf, Mht, NONE, Tree, WINDOW};
use crate::associate::{Pair, Prior};
use crate::record::Innovation;
use crate::{Result, Scan, Timestamp};
use boresight_filters::{Filter, Measurement, Weighted};
use nalgebra::Vector2;

impl Mht {
    /// Grows every leaf; the trees then hold the leaves of this scan, the best first.
    pub(super) fn grow(&mut self, scan: &Scan, dt_s: f64) -> Result<()> {
        let survival = self.config.life.survival(dt_s);
        let mut trees = std::mem::take(&mut self.trees);
        for tree in &mut trees {
            let parents = std::mem::take(&mut tree.leaves);
            for mut leaf in parents {
                leaf.belief.predict(dt_s)?;
                self.config.life.fade(&mut leaf.life, survival);
                leaf.predicted = self.predicted(&leaf, scan.time);
                self.children(scan, &leaf, &mut tree.leaves);
            }
            tree.leaves.sort_by(|a, b| b.score.total_cmp(&a.score).then(a.path.cmp(&b.path)));
            tree.leaves.dedup_by(|b, a| a.path == b.path);
            let best = tree.leaves.first().map_or(0.0, |l| l.score);
            let max_gap = self.mht.max_gap;
            tree.leaves.retain(|l| l.score >= best - max_gap);
            tree.leaves.truncate(self.mht.max_leaves as usize);
            tree.chosen = None;
        }
        trees.retain(|t| !t.leaves.is_empty());
        // All in all: every target keeps its best, however many there are.
        let total: usize = trees.iter().map(|t| t.leaves.len()).sum();
        if total > self.mht.max_hypotheses as usize {
            let each = (self.mht.max_hypotheses as usize / trees.len().max(1)).max(1);
            for tree in &mut trees {
                tree.leaves.truncate(each);
            }
        }
        self.trees = trees;
        Ok(())
    }

    fn predicted(&self, leaf: &Leaf, now: Timestamp) -> Predicted {
        let p = leaf.belief.predicted();
        let elapsed_s = now.seconds_since(Timestamp::from_ns(leaf.life.last_seen_ns()));
        let [ax, ay, std] = leaf.anchor;
        let far = self.config.max_speed_px_per_s * elapsed_s + 3.0 * std;
        let off = (p.mean - Vector2::new(ax, ay)).norm();
        Predicted {
            x: p.mean.x,
            y: p.mean.y,
            cov: Noise { xx: p.cov[(0, 0)], xy: p.cov[(0, 1)], yy: p.cov[(1, 1)] },
            reach: if self.config.gate_within_max_speed { far + off } else { f64::INFINITY },
        }
    }

    fn children(&mut self, scan: &Scan, leaf: &Leaf, out: &mut Vec<Leaf>) {
        let c = &self.config;
        let budget_s = self.coast_budget_s();
        let mut path = [NONE; WINDOW];
        path[1..].copy_from_slice(&leaf.path[..WINDOW - 1]);
        let miss = 1.0 - c.detection_probability * c.gate_probability;
        let mut missed = Leaf { path, outcome: Outcome { ratio: miss, ..Outcome::default() }, ..leaf.clone() };
        missed.score += miss.max(1e-300).ln();
        let silent_s = scan.time.seconds_since(Timestamp::from_ns(leaf.life.last_seen_ns()));
        let evidence = Evidence { hit: false, shared: false, ratio: miss };
        if c.life.advance(&mut missed.life, evidence, scan.time.ns) == Verdict::Keep && silent_s < budget_s - 1e-9 {
            out.push(missed);
        }

        self.gates.reset(scan.detections.len(), 1.0);
        let (terms, p) = (&self.terms, &leaf.predicted);
        let cost = |j: u32| terms.cost(p.x, p.y, &leaf.look, &scan.detections[j as usize]);
        let low = c.two_stage.as_ref().map_or(f32::NEG_INFINITY, |t| t.low_score);
        let free = |j: u32| scan.detections[j as usize].score >= low;
        self.table.gate_row(p, self.gate, c.max_gated as usize, true, free, cost, &mut self.gates);
        self.gates.end_row(Prior { p_detection: 1.0, p_gate: 1.0, existence: 1.0, miss_cost: self.gate });
        for pair in self.gates.row(0) {
            if let Some(mut child) = self.hit(scan, leaf, pair) {
                child.path[1..].copy_from_slice(&leaf.path[..WINDOW - 1]);
                child.path[0] = pair.detection;
                out.push(child);
            }
        }
    }

    fn hit(&self, scan: &Scan, leaf: &Leaf, pair: &Pair) -> Option<Leaf> {
        let c = &self.config;
        let d = &scan.detections[pair.detection as usize];
        let noise = self.table.noise(pair.detection);
        let mut child = leaf.clone();
        let measurement = Measurement { position: d.position, cov: noise.matrix() };
        child.belief.update(&[Weighted { measurement, weight: 1.0 }]).ok()?;
        let log_ratio = c.detection_probability.ln() + pair.log_likelihood
            - self.clutter.at(d.position.x, d.position.y).max(1e-200).ln();
        child.score += log_ratio;
        let ratio = log_ratio.clamp(-100.0, 100.0).exp();
        let evidence = Evidence { hit: true, shared: false, ratio };
        if c.life.advance(&mut child.life, evidence, scan.time.ns) == Verdict::Delete {
            return None;
        }
        let residual = d.position - Vector2::new(leaf.predicted.x, leaf.predicted.y);
        let cov = innovation_cov(&leaf.predicted, &noise);
        let nis = normalised_square(&residual, &cov);
        child.look.follow(d, c.look_gain);
        child.proof.seen(d.score);
        child.anchor = [d.position.x, d.position.y, noise.xx.max(noise.yy).sqrt()];
        child.outcome = Outcome {
            hit: true,
            shared: false,
            guest: false,
            detection: Some(pair.detection),
            ratio,
            innovation: Some(Innovation { residual, cov, nis }),
        };
        Some(child)
    }

    /// Every detection may be a new target.
    pub(super) fn start(&mut self, scan: &Scan) {
        let c = &self.config;
        let third = c.max_speed_px_per_s / 3.0;
        let (velocity, variance) =
            c.birth.velocity_prior().unwrap_or((Vector2::zeros(), Vector2::repeat(third * third)));
        let weak = c.two_stage.as_ref().map_or(f32::NEG_INFINITY, |t| t.high_score);
        for (j, d) in scan.detections.iter().enumerate() {
            if d.score < weak || !c.proof.may_start(d.score) || self.trees.len() >= c.max_tracks as usize {
                continue;
            }
            let noise = self.table.noise(j as u32);
            let start = &from_one_point(&d.position, &noise.matrix(), velocity, variance);
            let Ok(belief) = c.belief(start, d.extent.height_px) else { continue };
            let density = self.clutter.at(d.position.x, d.position.y).max(1e-200);
            let mut path = [NONE; WINDOW];
            path[0] = j as u32;
            let leaf = Leaf {
                predicted: Predicted { x: d.position.x, y: d.position.y, cov: noise, reach: 0.0 },
                belief,
                score: (self.mht.birth_density_per_px2 / density).ln(),
                path,
                life: c.life.begin(1, scan.time.ns, density, 1.0),
                look: Look::of(d),
                proof: Proof::begin([d.position.x, d.position.y], self.table.camera, d.score),
                anchor: [d.position.x, d.position.y, noise.xx.max(noise.yy).sqrt()],
                outcome: Outcome { hit: true, detection: Some(j as u32), ..Outcome::default() },
            };
            self.trees.push(Tree { id: 0, leaves: vec![leaf], chosen: None, unchosen: 0 });
        }
    }
}
