//! Bootstrap confidence intervals of scores, and of the differences between results.
//!
//! Source: B. Efron, R. Tibshirani, *An Introduction to the Bootstrap*, 1993, chapter 13 (percentile interval). The units
//! drawn are sequences, or pieces of sequences where there are few; every result is judged on the same draws, so that
//! differences are paired.
//! Limits: a track that crosses a border of pieces counts in each of them, so scores of pieces are a little higher than of
//! the whole; intervals are moved to stand around the whole's score.

use super::multi_object::MotScores;
use crate::{Error, ErrorKind, Result};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

/// A score with its interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// The score of the whole.
    pub value: f64,
    /// Lower end.
    pub lower: f64,
    /// Upper end.
    pub upper: f64,
}

/// A result's score and its difference to the first result.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Compared {
    /// The score.
    pub score: Interval,
    /// Score minus that of the first result.
    pub difference: Interval,
    /// Share of the draws in which it is above the first result (ties count half).
    pub share_above: f64,
}

/// Draws `n_draws` times and compares; `units[r][u]` are the scores of result r on unit u, `whole[r]` its score on all.
/// `measure` picks the number to compare. The same `seed` gives the same intervals.
/// # Errors
/// Fewer than two units; results of different numbers of units; a level outside (0, 1); no draws.
pub fn compare(
    units: &[Vec<MotScores>],
    whole: &[MotScores],
    measure: impl Fn(&MotScores) -> f64,
    level: f64,
    n_draws: usize,
    seed: u64,
) -> Result<Vec<Compared>> {
    let n = units.first().map_or(0, Vec::len);
    if n < 2 || units.len() != whole.len() || units.iter().any(|u| u.len() != n) {
        return Err(Error::new(
            ErrorKind::Config,
            format!("{n} units: expected at least two, as many for each result"),
        )
        .hint("more sequences, or longer ones, are needed for confidence intervals"));
    }
    if !(level > 0.0 && level < 1.0) {
        return Err(Error::new(ErrorKind::Config, "expected a probability in (0, 1)").at(format!("level = {level}")));
    }
    if n_draws == 0 {
        return Err(Error::new(ErrorKind::Config, "expected at least one draw").at("draws = 0"));
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut draws: Vec<Vec<f64>> = vec![Vec::with_capacity(n_draws); units.len()];
    let mut picked = Vec::with_capacity(n);
    for _ in 0..n_draws {
        picked.clear();
        picked.extend((0..n).map(|_| rng.random_range(0..n)));
        for (d, u) in draws.iter_mut().zip(units) {
            let sample: Vec<MotScores> = picked.iter().map(|&k| u[k].clone()).collect();
            d.push(measure(&MotScores::combined(&sample)));
        }
    }
    let piecewise: Vec<f64> = units.iter().map(|u| measure(&MotScores::combined(u))).collect();
    let value: Vec<f64> = whole.iter().map(&measure).collect();
    let interval = |values: Vec<f64>, centre: f64, around: f64| {
        let mut v = values;
        v.sort_by(f64::total_cmp);
        let at = |p: f64| v[((v.len() - 1) as f64 * p).round() as usize] - around + centre;
        Interval { value: centre, lower: at((1.0 - level) / 2.0), upper: at((1.0 + level) / 2.0) }
    };
    Ok((0..units.len())
        .map(|r| {
            let difference: Vec<f64> = draws[r].iter().zip(&draws[0]).map(|(a, b)| a - b).collect();
            let above: f64 = difference
                .iter()
                .map(|d| {
                    if *d > 0.0 {
                        1.0
                    } else if *d == 0.0 {
                        0.5
                    } else {
                        0.0
                    }
                })
                .sum();
            Compared {
                score: interval(draws[r].clone(), value[r], piecewise[r]),
                difference: interval(difference, value[r] - value[0], piecewise[r] - piecewise[0]),
                share_above: above / n_draws as f64,
            }
        })
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit(tp: u64, fp: u64) -> MotScores {
        let mut s = MotScores::default();
        s.clear.tp = tp;
        s.clear.fp = fp;
        s.clear.fn_ = 100 - tp;
        s
    }

    #[test]
    fn a_result_that_is_better_everywhere_is_above_in_every_draw() {
        let a: Vec<MotScores> = (0..20).map(|k| unit(60 + k, 5)).collect();
        let b: Vec<MotScores> = (0..20).map(|k| unit(70 + k, 5)).collect();
        let whole = [MotScores::combined(&a), MotScores::combined(&b)];
        let c = compare(&[a, b], &whole, |s| s.clear.mota(), 0.95, 500, 7).unwrap();
        assert_eq!((c[1].share_above, c[0].share_above), (1.0, 0.5));
        assert!((c[1].difference.value - 0.1).abs() < 1e-12 && c[1].difference.lower > 0.09);
        assert!(c[0].score.lower < c[0].score.value && c[0].score.value < c[0].score.upper);
    }

    #[test]
    fn the_seed_fixes_the_interval_and_too_few_units_or_draws_are_refused() {
        let a: Vec<MotScores> = (0..5).map(|k| unit(60 + 7 * k, 5)).collect();
        let run = |seed| {
            compare(std::slice::from_ref(&a), &[MotScores::combined(&a)], |s| s.clear.mota(), 0.9, 100, seed).unwrap()
                [0]
            .score
        };
        assert_eq!(run(1), run(1));
        assert!(compare(&[vec![unit(1, 1)]], &[unit(1, 1)], |s| s.clear.mota(), 0.9, 10, 1).is_err());
        assert!(compare(std::slice::from_ref(&a), &[unit(1, 1)], |s| s.clear.mota(), 0.9, 0, 1).is_err());
    }
}
