//! Turns of a rotating antenna from the azimuths and times of its plots.
//!
//! Source: our own. The turn's frequency f and sense maximise |Σ exp i(θ_j ∓ 2π f t_j)|/n, the coherence of azimuth θ and phase of the turn, over a grid as fine as the time
//! looked at tells apart. A loop then follows the phase u = θ/2π + whole turns from plot to plot, so that an antenna that drifts by a few percent keeps its count.
//! A turn begins at the azimuth where the fewest plots lie: a target that wavers about the border would be seen twice in one scan and not in the next.
//! Symbols: θ rad, t s, f turns/s, u turns. Limits: plots in order of time; turns of 0.5 s to 60 s; a gap of more than some tens of turns may cost a count.

use crate::{Error, ErrorKind, Result};
use std::f64::consts::TAU;

/// Turn frequencies looked for, turns/s.
const FREQUENCIES_HZ: [f64; 2] = [1.0 / 60.0, 2.0];
/// Plots and seconds looked at.
const MOST_PLOTS: usize = 1500;
const MOST_S: f64 = 300.0;
/// Turns without a plot beyond a hundred for each plot: five days of turns of 2.5 s, some 150 MB of empty scans.
pub(super) const MOST_EMPTY: usize = 200_000;
/// Steps of the grid in the frequency that the time looked at tells apart.
const STEPS: f64 = 6.0;
/// Less coherent plots show no antenna that turns; of n plots at random the coherence is about 1/√n.
const LEAST_COHERENCE: f64 = 0.7;
/// Share of a plot's deviation by which the loop follows.
const GAIN: f64 = 0.2;
/// Parts of a turn in which plots are counted for its border.
const SECTORS: usize = 72;

/// The turns of an antenna.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Turns {
    /// Number of the turn of each plot, from 0, never falling by more than a plot's noise allows.
    pub turn_of: Vec<u64>,
    /// Time of a turn, s.
    pub turn_s: f64,
    /// End of each turn, s, no plot of it is later; as many as there are turns.
    pub times_s: Vec<f64>,
}

/// Coherence of the plots with an antenna of `sense` (1 or -1) x `frequency` turns/s.
fn coherence(plots: &[(f64, f64)], frequency: f64) -> f64 {
    let (mut re, mut im) = (0.0, 0.0);
    for (t, azimuth) in plots {
        let (s, c) = (azimuth - TAU * frequency * t).sin_cos();
        re += c;
        im += s;
    }
    re.hypot(im) / plots.len().max(1) as f64
}

/// Signed frequency of the turns (turns/s, above 0 where azimuths grow) and its coherence.
fn frequency(plots: &[(f64, f64)]) -> (f64, f64) {
    let Some((first, _)) = plots.first() else { return (0.0, 0.0) };
    let seen: Vec<(f64, f64)> =
        plots.iter().take(MOST_PLOTS).map(|(t, a)| (t - first, *a)).take_while(|(t, _)| *t <= MOST_S).collect();
    let span = seen.last().map_or(0.0, |(t, _)| *t);
    if span <= 0.0 {
        return (0.0, 0.0);
    }
    let step = 1.0 / (STEPS * span);
    let n = ((FREQUENCIES_HZ[1] - FREQUENCIES_HZ[0]) / step).floor() as usize;
    let grid = (0..=n).flat_map(|k| [1.0, -1.0].map(|sense| sense * (FREQUENCIES_HZ[0] + k as f64 * step)));
    let rough = grid.map(|f| (f, coherence(&seen, f))).fold((0.0, 0.0), |a, b| if b.1 > a.1 { b } else { a });
    // Between the steps of the grid.
    let fine = (-10..=10).map(|k| rough.0 + f64::from(k) * 0.1 * step).map(|f| (f, coherence(&seen, f)));
    fine.fold(rough, |a, b| if b.1 > a.1 { b } else { a })
}

/// Parts plots (time s, azimuth rad; in order of time) into turns; `given_s` is the time of a turn, if it is known.
/// # Errors
/// [`ErrorKind::Damaged`] where no antenna that turns explains the azimuths.
pub(crate) fn turns(plots: &[(f64, f64)], given_s: Option<f64>) -> Result<Turns> {
    let f = match given_s {
        Some(turn_s) => {
            let [forth, back] = [1.0, -1.0].map(|sense| coherence(&plots[..plots.len().min(200)], sense / turn_s));
            if back > forth { -1.0 / turn_s } else { 1.0 / turn_s }
        }
        None => {
            let (f, coherent) = frequency(plots);
            if coherent < LEAST_COHERENCE {
                return Err(Error::new(
                    ErrorKind::Damaged,
                    format!("azimuths and times show no antenna that turns (coherence {coherent:.2}, expected above {LEAST_COHERENCE})"),
                )
                .hint("say how long a turn takes: --set input.table.radar.turn-s=2.5; or number the scans in a column scan"));
            }
            f
        }
    };
    // Phase of each plot in turns, growing with time whatever the sense.
    let sense = f.signum();
    let rate = f.abs();
    let mut phases = Vec::with_capacity(plots.len());
    let mut now: Option<(f64, f64)> = None;
    for (t, azimuth) in plots {
        let part = sense * azimuth / TAU;
        let phase = match now {
            None => part,
            Some((u, at)) => part + (u + (t - at) * rate - part).round(),
        };
        let expected = now.map_or(phase, |(u, at)| u + (t - at) * rate);
        now = Some((expected + GAIN * (phase - expected), *t));
        phases.push(phase);
    }
    let border = border(&phases);
    let numbers: Vec<i64> = phases.iter().map(|u| (u - border).floor() as i64).collect();
    let first = numbers.iter().copied().min().unwrap_or(0);
    let last = numbers.iter().copied().max().unwrap_or(0);
    let n = (last - first + 1) as usize;
    // What holes in time make of turns without plots; beyond any pause it is a wrong number.
    const MOST_TURNS: usize = 10_000_000;
    if n > MOST_TURNS || n > MOST_EMPTY + 100 * plots.len() {
        return Err(Error::new(
            ErrorKind::Damaged,
            format!("{n} turns of the antenna between the first plot and the last"),
        )
        .hint("are the times really seconds? a table of weeks is read in parts"));
    }
    // The end of a turn by its own plots, as they would place it; of one without plots a turn after the one before.
    let mut sums = vec![(0.0, 0usize, f64::NEG_INFINITY); n];
    for (((t, _), u), k) in plots.iter().zip(&phases).zip(&numbers) {
        let of = &mut sums[(k - first) as usize];
        of.0 += t + (*k as f64 + border + 1.0 - u) / rate;
        of.1 += 1;
        of.2 = of.2.max(*t);
    }
    let mut times_s: Vec<f64> = Vec::with_capacity(n);
    let begun = plots.first().map_or(0.0, |p| p.0);
    for k in 0..n {
        let seen = sums[k].1 > 0;
        let before = times_s.last().copied();
        let time =
            if seen { (sums[k].0 / sums[k].1 as f64).max(sums[k].2) } else { before.unwrap_or(begun) + 1.0 / rate };
        // A turn is never shorter than a tenth of itself.
        times_s.push(before.map_or(time, |b| time.max(b + 0.1 / rate)));
    }
    let turn_of = numbers.iter().map(|k| (k - first) as u64).collect();
    Ok(Turns { turn_of, turn_s: 1.0 / rate, times_s })
}

/// The part of a turn, 0..1, around which the fewest plots lie.
fn border(phases: &[f64]) -> f64 {
    let mut counts = [0usize; SECTORS];
    for u in phases {
        counts[((u - u.floor()) * SECTORS as f64) as usize % SECTORS] += 1;
    }
    let around = |i: usize| counts[(i + SECTORS - 1) % SECTORS] + counts[i] + counts[(i + 1) % SECTORS];
    let best = (0..SECTORS).min_by_key(|i| around(*i)).unwrap_or(0);
    (best as f64 + 0.5) / SECTORS as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Plots of echoes at random azimuths of an antenna whose turns take `turn_s(k)`; and their true turns.
    fn plots(turn_s: impl Fn(u64) -> f64, n: u64, sense: f64) -> (Vec<(f64, f64)>, Vec<u64>) {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let mut all: Vec<(f64, f64, u64)> = Vec::new();
        let mut began = 1000.0;
        for k in 0..n {
            let parts: Vec<f64> = (0..rng.random_range(1..9)).map(|_| 0.1 + 0.8 * rng.random::<f64>()).collect();
            all.extend(parts.iter().map(|p| {
                let azimuth = (sense * TAU * (p + 0.002 * (rng.random::<f64>() - 0.5)) + 0.7).rem_euclid(TAU);
                (began + p * turn_s(k), azimuth, k)
            }));
            began += turn_s(k);
        }
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        (all.iter().map(|p| (p.0, p.1)).collect(), all.iter().map(|p| p.2).collect())
    }

    #[test]
    fn every_plot_is_put_into_its_turn_whatever_the_sense_and_the_drift() {
        for sense in [1.0, -1.0] {
            let (seen, want) = plots(|k| 2.5 * (1.0 + 0.01 * (k as f64 / 40.0).sin()), 200, sense);
            let found = turns(&seen, None).unwrap();
            assert_eq!(found.turn_of, want);
            assert!((found.turn_s - 2.5).abs() < 0.03, "{}", found.turn_s);
            assert!(found.times_s.windows(2).all(|w| (w[1] - w[0] - 2.5).abs() < 0.1));
        }
    }

    #[test]
    fn azimuths_at_random_show_no_antenna_and_a_given_turn_is_taken() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let seen: Vec<(f64, f64)> = (0..300).map(|k| (0.3 * f64::from(k), TAU * rng.random::<f64>())).collect();
        assert!(turns(&seen, None).unwrap_err().to_string().contains("turn-s"));
        let (seen, want) = plots(|_| 3.0, 50, 1.0);
        assert_eq!(turns(&seen, Some(3.01)).unwrap().turn_of, want);
    }

    #[test]
    fn turns_without_a_plot_are_counted() {
        let (seen, want) = plots(|_| 2.0, 100, 1.0);
        let kept: Vec<usize> = (0..seen.len()).filter(|i| !(40..48).contains(&want[*i])).collect();
        let found = turns(&kept.iter().map(|i| seen[*i]).collect::<Vec<_>>(), None).unwrap();
        assert_eq!(found.turn_of, kept.iter().map(|i| want[*i]).collect::<Vec<_>>());
        assert_eq!(found.times_s.len(), 100);
    }
}
