//! Which plots make a scan: by the table's own number of the turn, else plots of one time, else turns of the antenna ([`super::antenna`]).
//!
//! Source: our own. Limits: plots in order of time.

use super::antenna;
use crate::{Error, ErrorKind, Result};

/// Most scans between the first and the last plot: empty ones take memory as well.
const MOST_SCANS: u64 = 10_000_000;
/// One plot, as the table has it.
pub(super) struct Plot {
    pub time_s: f64,
    pub turn: Option<u64>,
    pub range: f64,
    pub azimuth_rad: f64,
    pub std: [f64; 2],
}

/// The scans of plots: their times, no earlier than any of their plots; which plot is in which, the number of the first.
pub(super) struct Numbered {
    pub first: u64,
    pub turn_of: Vec<u64>,
    pub times_s: Vec<f64>,
    pub turn_s: f64,
}

/// Numbers the scans of plots in order of time; `given` is the time of a turn, s, if it is known.
/// # Errors
/// Numbers or times that make far too many scans, azimuths that no turning antenna explains.
pub(super) fn number(plots: &[Plot], given: Option<f64>) -> Result<Numbered> {
    if plots.iter().all(|p| p.turn.is_some()) && !plots.is_empty() {
        let numbers: Vec<u64> = plots.iter().filter_map(|p| p.turn).collect();
        return by_number(plots, &numbers, given);
    }
    let mut times: Vec<f64> = plots.iter().map(|p| p.time_s).collect();
    times.dedup();
    // Plots that share their times are scans already; those of an antenna that turns hardly ever do.
    if plots.len() > 1 && 10 * times.len() <= 6 * plots.len() {
        let turn_s = given.unwrap_or_else(|| median_step(&times));
        let mut numbers = Vec::with_capacity(plots.len());
        let (mut k, mut last) = (0u64, times[0]);
        for p in plots {
            if p.time_s > last {
                k += ((p.time_s - last) / turn_s).round().max(1.0) as u64;
                last = p.time_s;
            }
            numbers.push(k);
        }
        return by_number(plots, &numbers, Some(turn_s));
    }
    let seen: Vec<(f64, f64)> = plots.iter().map(|p| (p.time_s, p.azimuth_rad)).collect();
    let t = antenna::turns(&seen, given)?;
    Ok(Numbered { first: 0, turn_of: t.turn_of, times_s: t.times_s, turn_s: t.turn_s })
}

fn median_step(times: &[f64]) -> f64 {
    let mut steps: Vec<f64> = times.windows(2).map(|w| w[1] - w[0]).filter(|s| *s > 0.0).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len().saturating_sub(1) / 2).copied().unwrap_or(1.0)
}

/// Scans by their numbers; the time of one is that of its last plot, of one without plots evenly between its neighbours'.
fn by_number(plots: &[Plot], numbers: &[u64], turn_s: Option<f64>) -> Result<Numbered> {
    let (first, last) = (numbers.iter().copied().min().unwrap_or(0), numbers.iter().copied().max().unwrap_or(0));
    if last - first >= MOST_SCANS || last - first > (antenna::MOST_EMPTY + 100 * plots.len()) as u64 {
        return Err(Error::new(
            ErrorKind::Damaged,
            format!("{} scans between the first plot and the last", last - first + 1),
        )
        .hint("is it really the number of the scan, are the times really seconds? a table of weeks is read in parts"));
    }
    let n = (last - first + 1) as usize;
    let mut latest = vec![f64::NEG_INFINITY; n];
    for (p, k) in plots.iter().zip(numbers) {
        let of = &mut latest[(k - first) as usize];
        *of = of.max(p.time_s);
    }
    let seen: Vec<(usize, f64)> = latest.iter().copied().enumerate().filter(|(_, t)| t.is_finite()).collect();
    let mut times_s = vec![0.0; n];
    if let [(k, t)] = seen[..] {
        times_s[k] = t;
    }
    for w in seen.windows(2) {
        let ((a, from), (b, to)) = (w[0], w[1]);
        (a..=b).for_each(|k| times_s[k] = from + (to - from) * (k - a) as f64 / (b - a) as f64);
    }
    let turn_s = turn_s.unwrap_or_else(|| median_step(&times_s));
    Ok(Numbered { first, turn_of: numbers.iter().map(|k| k - first).collect(), times_s, turn_s })
}
