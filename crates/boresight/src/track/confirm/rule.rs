//! The life of a track: tentative, confirmed, deleted; by counting, by a sequential test, or by existence probability.
//!
//! Source: M-of-N `docs/theory/track-management.md`; score: S. S. Blackman, R. Popoli, *Design and Analysis of Modern
//! Tracking Systems*, 1999, ch. 6 (Wald's sequential probability ratio test); existence: D. Mušicki, R. Evans,
//! S. Stanković, "Integrated probabilistic data association", IEEE Trans. Automatic Control 39, 1994 (Markov chain
//! one).
//! Symbols: Λ likelihood ratio of this scan, target against none (no unit); ψ existence probability.
//! Limits: M-of-N windows of at most 64 scans. A confirmed track also ends when its coasting budget (s) is over.

use super::config::{ExistenceConfig, LifeConfig, MOfNConfig, ScoreConfig};

/// Where a track stands in its life.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Life {
    /// Hits (1) and misses (0), the newest in the lowest bit.
    history: u64,
    /// Score (ln Λ summed), or odds that the target exists, by the method.
    value: f64,
    best: f64,
    /// Time of the last detection of its own, ns.
    pub last_hit_ns: i64,
    /// Time of the last detection that was shared with another track, ns.
    pub last_shared_ns: i64,
    /// Time of the start, ns.
    pub born_ns: i64,
    /// Misses in a row.
    pub misses: u32,
    /// Entries of the history, at most 64.
    entries: u8,
    /// Believed.
    pub confirmed: bool,
}

impl Life {
    /// Time of the last detection, its own or shared, ns: coasting counts from here.
    #[inline]
    pub fn last_seen_ns(&self) -> i64 {
        self.last_hit_ns.max(self.last_shared_ns)
    }
}

/// What one scan said of a track.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evidence {
    /// A detection was taken.
    pub hit: bool,
    /// It belongs to another track as well: the track lives, but was not seen by itself.
    pub shared: bool,
    /// Λ of this scan.
    pub ratio: f64,
}

/// What becomes of a track.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It lives on.
    Keep,
    /// It is given up.
    Delete,
}

/// Odds stay within these, so that no past, good or bad, outweighs a new scan for ever.
const ODDS: (f64, f64) = (1e-12, 1e12);

impl LifeConfig {
    /// Life at the start of a track from `n_points` detections (1 or 2).
    ///
    /// `clutter_density` is in 1/px²; `ratio` is P_D l / λ of the second point given the first (1 for one point).
    pub fn begin(&self, n_points: u32, now_ns: i64, clutter_density: f64, ratio: f64) -> Life {
        let first = |birth: f64| (birth / clutter_density.max(1e-300) * ratio).clamp(ODDS.0, ODDS.1);
        let value = match self {
            Self::MOfN(_) => 0.0,
            Self::Score(c) => first(c.birth_density_per_px2).ln(),
            Self::Existence(c) => first(c.birth_density_per_px2),
        };
        let confirmed = match self {
            Self::MOfN(c) => c.hits <= n_points,
            Self::Score(c) => value >= c.confirm_score(),
            Self::Existence(c) => probability_of(value) >= c.confirm_probability,
        };
        Life {
            history: (1 << n_points) - 1,
            entries: n_points as u8,
            confirmed,
            misses: 0,
            value,
            best: value,
            last_hit_ns: now_ns,
            last_shared_ns: now_ns,
            born_ns: now_ns,
        }
    }

    /// Existence before the detections of a scan are seen: `survival` is the probability to stay in view since the last.
    #[inline]
    pub fn fade(&self, life: &mut Life, survival: f64) {
        if let Self::Existence(_) = self {
            life.value *= survival / (1.0 + life.value * (1.0 - survival));
        }
    }

    /// Probability that a target stays in view for `dt_s`.
    pub fn survival(&self, dt_s: f64) -> f64 {
        match self {
            Self::Existence(c) => (-dt_s / c.mean_life_s).exp(),
            _ => 1.0,
        }
    }

    /// Existence probability that weighs in the association: ψ, or 1 where the method has none.
    #[inline]
    pub fn existence(&self, life: &Life) -> f64 {
        match self {
            Self::Existence(_) => probability_of(life.value),
            _ => 1.0,
        }
    }

    /// Confidence of a track, 0..=1.
    #[inline]
    pub fn confidence(&self, life: &Life) -> f32 {
        match self {
            Self::MOfN(c) => {
                let n = u32::from(life.entries).min(c.scans).max(1);
                (life.history & low_bits(n)).count_ones() as f32 / n as f32
            }
            Self::Score(_) => (1.0 / (1.0 + (-life.value).exp())) as f32,
            Self::Existence(_) => probability_of(life.value) as f32,
        }
    }

    /// Takes the evidence of a scan and says whether the track lives on; the coasting budget is the tracker's.
    #[inline]
    pub fn advance(&self, life: &mut Life, evidence: Evidence, now_ns: i64) -> Verdict {
        life.history = (life.history << 1) | u64::from(evidence.hit);
        life.entries = life.entries.saturating_add(1).min(64);
        if evidence.hit {
            life.misses = 0;
            *(if evidence.shared { &mut life.last_shared_ns } else { &mut life.last_hit_ns }) = now_ns;
        } else {
            life.misses = life.misses.saturating_add(1);
        }
        match self {
            Self::MOfN(c) => c.judge(life, now_ns),
            Self::Score(c) => c.judge(life, evidence.ratio.clamp(ODDS.0, ODDS.1)),
            Self::Existence(c) => c.judge(life, evidence.ratio),
        }
    }
}

impl MOfNConfig {
    fn judge(&self, life: &mut Life, now_ns: i64) -> Verdict {
        if life.confirmed {
            return Verdict::Keep;
        }
        let entries = u32::from(life.entries);
        let hits = (life.history & low_bits(self.scans)).count_ones();
        if hits >= self.hits && entries >= self.hits {
            life.confirmed = true;
            return Verdict::Keep;
        }
        let late = (now_ns.saturating_sub(life.born_ns)) as f64 * 1e-9 > self.tentative_s;
        if entries >= self.scans || hits + (self.scans - entries) < self.hits || late {
            return Verdict::Delete;
        }
        Verdict::Keep
    }
}

impl ScoreConfig {
    /// Wald's upper threshold ln((1 − β) / α).
    fn confirm_score(&self) -> f64 {
        ((1.0 - self.true_delete_probability) / self.false_confirm_probability).ln()
    }

    fn judge(&self, life: &mut Life, ratio: f64) -> Verdict {
        // A long good past must not carry a lost track for as long again.
        life.value = (life.value + ratio.ln()).clamp(-50.0, 50.0);
        life.best = life.best.max(life.value);
        if !life.confirmed {
            if life.value >= self.confirm_score() {
                life.confirmed = true;
                life.best = life.value;
            } else if life.best - life.value
                > -(self.true_delete_probability / (1.0 - self.false_confirm_probability)).ln()
            {
                // Wald's lower threshold ln(β / (1 − α)), counted from the best so far: a late fall counts as an early one.
                return Verdict::Delete;
            }
        } else if life.best - life.value > self.max_drop {
            return Verdict::Delete;
        }
        Verdict::Keep
    }
}

impl ExistenceConfig {
    fn judge(&self, life: &mut Life, ratio: f64) -> Verdict {
        // ψ ← ψ Λ / (1 − ψ + ψ Λ) is odds ← odds Λ.
        life.value = (life.value * ratio).clamp(ODDS.0, ODDS.1);
        let psi = probability_of(life.value);
        if psi >= self.confirm_probability {
            life.confirmed = true;
        } else if psi < self.doubt_probability {
            life.confirmed = false;
        }
        if psi < self.delete_probability {
            return Verdict::Delete;
        }
        Verdict::Keep
    }
}

#[inline]
fn probability_of(odds: f64) -> f64 {
    odds / (1.0 + odds)
}

fn low_bits(n: u32) -> u64 {
    if n >= 64 { u64::MAX } else { (1 << n) - 1 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(config: &LifeConfig, points: u32, hits: &[bool]) -> Vec<(bool, Verdict)> {
        let mut life = config.begin(points, 0, 1e-5, 1.0);
        hits.iter()
            .map(|h| {
                let e = Evidence { hit: *h, shared: false, ratio: if *h { 3f64.exp() } else { 0.11 } };
                let v = config.advance(&mut life, e, 0);
                (life.confirmed, v)
            })
            .collect()
    }

    #[test]
    fn three_of_five_confirms_at_the_third_hit_and_gives_up_when_it_cannot_be_reached() {
        let c = LifeConfig::default();
        assert_eq!(run(&c, 2, &[false, true]), [(false, Verdict::Keep), (true, Verdict::Keep)]);
        let all_missed = run(&c, 2, &[false, false, false]);
        assert_eq!(all_missed.last(), Some(&(false, Verdict::Delete)));
        assert_eq!(run(&c, 1, &[false, false, false]).last(), Some(&(false, Verdict::Delete)));
    }

    #[test]
    fn the_sequential_test_confirms_at_walds_threshold() {
        // ln(0.99 / 0.001) = 6.898; from ln 0.1 = -2.303 four hits of 3 are needed (-2.303 + 12 = 9.697; three give 6.697).
        let c = LifeConfig::Score(ScoreConfig::default());
        let confirmed: Vec<bool> = run(&c, 1, &[true; 5]).iter().map(|s| s.0).collect();
        assert_eq!(confirmed, [false, false, false, true, true]);
    }

    #[test]
    fn existence_follows_bayes() {
        let c = LifeConfig::Existence(ExistenceConfig::default());
        let mut life = c.begin(1, 0, 4e-6, 1.0);
        assert!((c.existence(&life) - 0.2).abs() < 1e-12);
        c.advance(&mut life, Evidence { hit: true, shared: false, ratio: 8.0 }, 0);
        // 0.2 * 8 / (0.8 + 0.2 * 8) = 2/3.
        assert!((c.existence(&life) - 2.0 / 3.0).abs() < 1e-12);
        c.fade(&mut life, 0.9);
        assert!((c.existence(&life) - 0.6).abs() < 1e-12);
    }
}
