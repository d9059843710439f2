//! Whether targets forget their velocity, from a first pass that took it for constant.
//!
//! Source: our own; the motions are told apart by [`super::persistence`], from tracks. Each motion has the tracks that it can follow: those whose velocity is forgotten leave one of constant velocity at
//! their longer steps, and among many that diffuse or rest those that go somewhere leave the other one. So the scans are followed again, and in the end both are asked how much likelier the
//! detections are as those of their tracks than as clutter; with constant velocity each target may rest or go, as many as the scans tell.
//! Limits: one motion for all targets, the one that explains more.

use super::super::first_scans::PROBE_FRAMES;
use super::fit::{LEAST, MOST_STEPS, Motion, Noise, Step, log_likelihood, n_judged};
use super::follow::follow;
use super::forgotten::Persistence;
use super::given::put;
use super::persistence::{self, Assumed};
use crate::track::{ModelConfig, TrackerConfig};
use crate::{Result, Scan};

/// How often targets whose velocity is forgotten are followed again: each time the steps that were lost are nearer to none.
const MOST_ROUNDS: usize = 6;
/// Rounds in which the shares of motions are found: each target tells by some nats which it has, so they stay after a few.
const ROUNDS_OF_SHARES: usize = 10;

/// Noise and motion of targets whose velocity is forgotten, if the series are of such ones. What was assumed before has lost them at their longer steps, and those that are left look like noise
/// around a course: they are followed again with the simplest motion found, until that stays, and only then another may explain more.
///
/// `driven` is the noise of the same series with constant velocity: that motion stays if it explains more of the scans.
pub(super) fn forgetful(
    series: &[Vec<Step>],
    scans: &[Scan],
    assume: Assumed,
    driven: &Noise,
    config: &TrackerConfig,
) -> Result<Option<(Noise, Persistence)>> {
    let Some(mut found) = persistence::better(series, assume).next() else { return Ok(None) };
    let mut config = config.clone();
    // Steps are looked at, not whose they are after a gap, and those of some scans say enough where targets are many.
    config.reidentification.max_gap_s = 0.0;
    let mut n = 0;
    let enough = scans.iter().take_while(|s| (n < MOST_STEPS, n += s.detections.len()).0).count();
    let scans = &scans[..enough.max(PROBE_FRAMES).min(scans.len())];
    let mut round = 1;
    let found = loop {
        put(&found.0, assume.least_density, &mut config);
        config.filter.model = found.1.model();
        let again = series_of(scans, &config)?;
        let mut ever_better = persistence::better(&again, assume);
        // What is followed without loss and goes its way was lost before.
        let Some(next) = ever_better.next() else { return Ok(None) };
        if round == MOST_ROUNDS || next.1.is_nearly(&found.1) {
            break ever_better.last().unwrap_or(next);
        }
        found = next;
        round += 1;
    };
    let Assumed { least_density, speed_std, area_px2, .. } = assume;
    // What it costs to take a detection for clutter, as many of which lie about as there are detections of any kind.
    let n_detections: usize = scans.iter().map(|s| s.detections.len()).sum();
    let density = n_detections as f64 / (scans.len().max(1) as f64 * area_px2);
    let mut gain = |noise: &Noise, model: ModelConfig, motions: &[Motion]| -> Result<f64> {
        put(noise, least_density, &mut config);
        config.filter.model = model;
        let series = series_of(scans, &config)?;
        let of = |motion: &Motion| -> Vec<f64> {
            series.iter().map(|t| log_likelihood(std::slice::from_ref(t), noise, *motion, area_px2)).collect()
        };
        let likelihoods: Vec<Vec<f64>> = motions.iter().map(of).collect();
        Ok(mixed(&likelihoods) - n_judged(&series) as f64 * density.ln())
    };
    let forgets = gain(&found.0, found.1.model(), &[Motion::Persistent(found.1)])?;
    // Of many that rest each is likelier without a velocity by some nats, and those that go somewhere would be lost for that.
    let stays = gain(driven, ModelConfig::default(), &[Motion::Accelerated(speed_std), Motion::Accelerated(LEAST)])?;
    Ok((forgets > stays).then_some(found))
}

/// Logarithm of the likelihood of targets each of which has one of some motions, from the logarithm for each motion and target; the shares of the motions are those that make it largest
/// (expectation maximisation: Dempster, Laird, Rubin, *J. R. Stat. Soc. B* 39, 1977).
fn mixed(logs: &[Vec<f64>]) -> f64 {
    let n = logs.first().map_or(0, Vec::len);
    let mut shares = vec![1.0 / logs.len() as f64; logs.len()];
    let mut sum = 0.0;
    for _ in 0..ROUNDS_OF_SHARES {
        let mut counts = vec![0.0; logs.len()];
        sum = 0.0;
        for i in 0..n {
            let most = logs.iter().map(|l| l[i]).fold(f64::NEG_INFINITY, f64::max);
            let each = |(l, share): (&Vec<f64>, &f64)| share * (l[i] - most).exp();
            let all: f64 = logs.iter().zip(&shares).map(each).sum();
            sum += most + all.ln();
            counts.iter_mut().zip(logs.iter().zip(&shares)).for_each(|(c, both)| *c += each(both) / all);
        }
        // None is left out for good: half a target has each.
        let whole = n as f64 + 0.5 * logs.len() as f64;
        shares.iter_mut().zip(counts).for_each(|(s, c)| *s = (c + 0.5) / whole);
    }
    sum
}

/// The positions of the tracks that a configuration confirms.
fn series_of(scans: &[Scan], config: &TrackerConfig) -> Result<Vec<Vec<Step>>> {
    Ok(follow(scans, config)?.into_values().map(|t| t.steps).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_those_that_make_the_likelihood_largest() {
        // Of so many that rest by ten nats some go by 400.
        for (n_rest, n_go) in [(2000, 1), (30, 30), (1, 200), (5, 0)] {
            let likelihoods = |rest: f64, go: f64| [vec![rest; n_rest], vec![go; n_go]].concat();
            let logs = [likelihoods(0.0, -400.0), likelihoods(-10.0, 0.0)];
            let of = |share: f64| -> f64 {
                let all = logs[0].iter().zip(&logs[1]);
                all.map(|(rest, go)| (share * rest.exp() + (1.0 - share) * go.exp()).ln()).sum()
            };
            let most = (1..100_000).map(|i| of(f64::from(i) * 1e-5)).fold(f64::NEG_INFINITY, f64::max);
            let found = mixed(&logs);
            // What half a target of each costs, no more.
            assert!(found <= most + 0.01 && found > most - 1.0, "{n_rest} {n_go}: {found}, {most}");
            assert!(found > of(0.5) - 0.01, "{n_rest} {n_go}: {found}, {} of halves", of(0.5));
        }
        let one = [vec![-3.0, -4.5]];
        assert!((mixed(&one) + 7.5).abs() < 1e-12, "of one motion it is the sum");
    }
}
