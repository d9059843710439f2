//! The JPDA associator: each connected group by the method that its size allows.

use super::problem::Problem;
use super::{exact, loopy, star};
use crate::associate::groups::Groups;
use crate::associate::{Assignment, Associator, Gates};
use crate::{Error, ErrorKind, Result};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How neighbouring tracks are kept from growing into one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Coalescence {
    /// Plain JPDA: tracks that stay close drift together.
    None,
    /// JPDA*: of the events that give the same detections to the same tracks only the best permutation counts.
    #[default]
    Star,
}

/// Joint probabilistic data association.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct JpdaConfig {
    /// How neighbouring tracks are kept from growing into one: `star` (default) or `none`.
    pub coalescence: Coalescence,
    /// Most states (sets of contested detections, or for `star` joint events) of one group that are summed exactly,
    /// 1..=1 000 000; groups that need more go to belief propagation.
    pub max_states: u32,
}

impl Default for JpdaConfig {
    fn default() -> Self {
        Self { coalescence: Coalescence::Star, max_states: 2000 }
    }
}

impl JpdaConfig {
    /// Checks all values; `at` names the place in the configuration.
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self, at: &str) -> Result<()> {
        if (1..=1_000_000).contains(&self.max_states) {
            return Ok(());
        }
        Err(Error::new(ErrorKind::Config, "expected 1..=1000000 states")
            .at(format!("{at}.jpda.max-states = {}", self.max_states))
            .hint("2000 solves nearly all groups exactly in well under a millisecond"))
    }
}

/// The JPDA associator.
#[derive(Clone, Debug)]
pub struct Jpda {
    config: JpdaConfig,
    groups: Groups,
    problem: Problem,
    local: Vec<u32>,
    exact: exact::Exact,
    loopy: loopy::Loopy,
    star: star::Star,
    /// Probability of each pair of the table, row by row.
    found: Vec<f64>,
    place: Vec<u32>,
}

impl Jpda {
    /// Builds the associator.
    pub fn new(config: &JpdaConfig) -> Self {
        Self {
            config: config.clone(),
            groups: Groups::default(),
            problem: Problem::default(),
            local: Vec::new(),
            exact: exact::Exact::default(),
            loopy: loopy::Loopy::default(),
            star: star::Star::default(),
            found: Vec::new(),
            place: Vec::new(),
        }
    }
}

impl Associator for Jpda {
    fn needs_likelihood(&self) -> bool {
        true
    }

    fn associate(&mut self, gates: &Gates, out: &mut Assignment) {
        self.local.clear();
        self.local.resize(gates.n_detections(), u32::MAX);
        self.found.clear();
        self.found.resize(gates.n_pairs(), 0.0);
        self.place.clear();
        let mut at = 0;
        for i in 0..gates.n_tracks() {
            self.place.push(at);
            at += gates.row(i).len() as u32;
        }
        self.groups.find(gates);
        let max_states = self.config.max_states as usize;
        for group in self.groups.iter() {
            let p = &mut self.problem;
            p.load(gates, group, &mut self.local);
            let starred =
                group.len() > 1 && self.config.coalescence == Coalescence::Star && self.star.solve(p, max_states);
            if !starred && !self.exact.solve(p, max_states) {
                self.loopy.solve(p);
            }
            for (k, row) in group.iter().enumerate() {
                let to = self.place[*row as usize] as usize;
                let from = p.row(k);
                self.found[to..to + from.len()].copy_from_slice(&p.probability[from]);
            }
        }
        out.reset();
        let mut at = 0;
        for i in 0..gates.n_tracks() {
            let row = &self.found[at..at + gates.row(i).len()];
            // More than 1 by the rounding of long sums is 1: filters refuse it.
            let scale = 1.0 / row.iter().sum::<f64>().max(1.0);
            for (pair, probability) in gates.row(i).iter().zip(row) {
                out.push(pair.detection, probability * scale);
            }
            at += row.len();
            out.end_row();
        }
    }
}
