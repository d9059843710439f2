//! One stage of association: some of the tracks against the detections still free.
//!
//! Source: docs/theory/track-management.md, "One scan". Rows are tracks in ascending order; detections taken by an earlier stage are
//! not seen. In soft stages (PDA and its kin) all gated detections count as used.

use super::super::clutter::Clutter;
use super::super::scan_table::Predicted;
use super::super::score_likelihood::ScanScores;
use super::super::single_track::Track;
use super::context::{Context, VelocityCost};
use super::gate::gate_row;
use super::plot_time::gate_row_by_time;
use crate::Scan;
use crate::associate::{Assignment, Associator, AssociatorConfig, Gates, Prior, Share};

/// An associator with its tables and the rows of this scan.
pub(super) struct Stage {
    associator: Box<dyn Associator>,
    pub soft: bool,
    likelihood: bool,
    /// What pairs may cost beside d².
    cost_budget: f64,
    pub gates: Gates,
    pub answer: Assignment,
    rows: Vec<u32>,
    cursor: usize,
}

impl Stage {
    pub fn new(config: &AssociatorConfig, cost_budget: f64) -> Self {
        let associator = config.build();
        Self {
            likelihood: associator.needs_likelihood(),
            associator,
            soft: config.is_soft(),
            cost_budget,
            gates: Gates::new(),
            answer: Assignment::new(),
            rows: Vec::new(),
            cursor: 0,
        }
    }

    /// The rows, each with its track and its shares.
    pub fn rows(&self) -> impl Iterator<Item = (u32, &[Share])> {
        self.rows.iter().enumerate().map(|(row, i)| (*i, self.answer.row(row)))
    }

    /// Fetches ahead the detections that the next `n` rows took.
    #[inline]
    pub fn touch(&self, scan: &Scan, n: usize) {
        let mut sum = 0.0;
        for row in self.cursor..self.rows.len().min(self.cursor + n) {
            for share in self.answer.row(row) {
                // The first and the last field: a detection spans two cache lines.
                let d = &scan.detections[share.detection as usize];
                sum += d.position.x + f64::from(d.score);
            }
        }
        std::hint::black_box(sum);
    }

    /// How its associator takes a velocity that does not fit.
    pub fn velocity_cost(&self) -> VelocityCost {
        if self.likelihood { VelocityCost::Likelihood } else { VelocityCost::Square }
    }

    /// Begins a scan.
    pub fn begin(&mut self, scan: &Scan, clutter: &Clutter, scores: &ScanScores) {
        self.gates.reset(scan.detections.len(), clutter.density());
        if clutter.is_map() || !scores.is_empty() {
            let places = scan.detections.iter().map(|d| clutter.at(d.position.x, d.position.y));
            self.gates.set_clutter(places.enumerate().map(|(j, at)| at * scores.clutter(j as u32)));
        }
        self.rows.clear();
        self.cursor = 0;
    }

    /// Adds a track, `predicted` to the scan, with the detections that `free` lets pass.
    #[inline]
    pub fn add(
        &mut self,
        i: usize,
        track: &Track,
        predicted: &Predicted,
        context: &Context<'_>,
        free: impl Fn(u32) -> bool,
        extra_cost: impl Fn(&Predicted, u32) -> f64,
    ) {
        let (config, gate) = (context.config, context.gate);
        self.rows.push(i as u32);
        let (max_gated, likelihood) = (config.max_gated as usize, self.likelihood);
        if context.table.is_timed() {
            gate_row_by_time(context, track, predicted, likelihood, free, extra_cost, &mut self.gates);
        } else {
            gate_row(context.table, predicted, gate, max_gated, likelihood, free, extra_cost, &mut self.gates);
        }
        self.gates.end_row(Prior {
            p_detection: config.p_detection(track.history.misses),
            p_gate: config.gate_probability,
            // A hard choice is what the target would have chosen if it exists; whether it does is what its likelihood then tells.
            existence: if self.soft { config.confirmation.existence(&track.history) } else { 1.0 },
            miss_cost: gate + self.cost_budget + context.velocity_budget(),
        });
    }

    /// Associates, and marks the detections that are taken.
    pub fn solve(&mut self, used: &mut [bool]) {
        self.associator.associate(&self.gates, &mut self.answer);
        for row in 0..self.rows.len() {
            if self.soft {
                for pair in self.gates.row(row) {
                    used[pair.detection as usize] = true;
                }
            } else {
                for share in self.answer.row(row) {
                    used[share.detection as usize] = true;
                }
            }
        }
    }

    /// The row of track `i`, asked for in ascending order, if it has one here; the next call looks behind it.
    #[inline]
    pub fn next_row(&mut self, i: usize) -> Option<usize> {
        let row = self.cursor;
        if self.rows.get(row) != Some(&(i as u32)) {
            return None;
        }
        self.cursor += 1;
        Some(row)
    }
}
