//! The tracker for a radar's plots: speeds, noise, motion and confirmation from the stated covariances, the turn of the antenna, and what tracks show.
//!
//! Source: our own. A first pass takes the covariances as they are and lets a target move as fast as two plots of it can seem to; what its confirmed tracks show then
//! gives noise and motion ([`super::noise`]), the largest speed and the spread of speeds at the start. Land, buoys and ships at anchor come again at their places and are
//! reported: a radar sees what is there. Confirmation counts plots in turns, as many as the plots that stand alone ask for.
//! Symbols: σ m, the larger standard deviation of a plot, T s, the time of a turn. Limits: constant velocity; what is learnt is the first [`first_scans`](super::first_scans)'.

use super::detections::area_px2;
use super::digits::round;
use super::evidence::Evidence;
use super::first_scans::first;
use super::{noise, speed};
use crate::io::LengthUnit;
use crate::track::{
    ConfirmationConfig, InitiationConfig, MOfNConfig, MergedMeasurementsConfig, OnePointConfig, RadarUpdate, Report,
};
use crate::{Config, Detection, Scan, TrackStatus};
use std::collections::BTreeMap;

/// Turns over which a steady target strays by a plot's deviation, as assumed before anything is learnt.
const STRAY_TURNS: f64 = 20.0;
/// Most turns for which a confirmed track goes on unseen: plots of small ships come in bursts.
const MOST_COAST_TURNS: f64 = 16.0;
/// A track of nothing is to find nothing in that time with at least this probability, or false plots keep it alive.
const DIES: f64 = 0.5;
/// Turns in which a track must be confirmed, and the fewest plots that do it.
const CONFIRM_TURNS: u32 = 8;
const LEAST_HITS: u32 = 4;
/// False tracks that are let through, a turn: one in a hundred turns.
const FALSE_A_TURN: f64 = 0.01;
/// Squared distance within which a plot may belong to another's target: the gate of 0.9999, 2 degrees of freedom.
const GATE: f64 = 18.42;
/// Covariance of the difference of two plots of a target over that of one: both, and what its unknown speed adds at the start.
const DIFFERENCE: f64 = 2.5;
/// Scans looked at for false plots, and plots of each: a guard of time.
const MOST_LOOKED_AT: [usize; 2] = [200, 400];
/// Turns of a track whose speed is believed.
const LEAST_TURNS: usize = 15;
/// The largest speed over the fastest track's: another one is faster.
const SPEED_RESERVE: f64 = 1.5;
/// Tracks whose speeds tell.
const LEAST_TRACKS: usize = 3;

/// Writes the tracker's configuration for a radar's plots; `turn_s` is the time of a turn of the antenna, `unit` what positions are in.
pub fn for_radar(scans: &[Scan], turn_s: f64, unit: LengthUnit, config: &mut Config, reasons: &mut Vec<String>) {
    let turn_s = if turn_s.is_finite() && turn_s > 0.0 { turn_s } else { 1.0 };
    let (sigma, px) = (spread(scans), unit.sign());
    let t = &mut config.tracker;
    t.report = Report::All;
    t.radar_update = RadarUpdate::Extended;
    t.extra_noise_px = 0.0;
    t.extra_noise_per_height = 0.0;
    t.acceleration_density_px2_per_s3 = round(3.0 * sigma.powi(2) / (STRAY_TURNS * turn_s).powi(3));
    // Two plots of a target at rest seem to lie √2 σ apart in the mean square: twice that is hardly exceeded.
    t.max_speed_px_per_s = round(2.0 * std::f64::consts::SQRT_2 * sigma / turn_s);
    t.initiation = starting_with(t.max_speed_px_per_s / 4.0);
    let clutter = clutter(scans);
    let scans_s = round(f64::from(CONFIRM_TURNS) * turn_s);
    let hits = clutter.hits();
    t.confirmation = ConfirmationConfig::MOfN(MOfNConfig { hits, scans: CONFIRM_TURNS, tentative_s: scans_s });
    let coast = clutter.coast_turns();
    t.coast_s = round(coast * turn_s);
    t.coast_scans = coast as u32;
    t.merged_measurements = MergedMeasurementsConfig::off();
    let mut told = vec![format!(
        "Plots of a radar, a turn in {turn_s:.3} s, to {sigma:.0} {px} at the median: a target may move by {} {px}/s. {:.1} plots a turn are false; one of them would continue a track of nothing with {:.1} %: \
         {hits} plots in {CONFIRM_TURNS} turns confirm a track, which is unseen for at most {} s. A plot corrects a track by its range and azimuth, linearised at the prediction (tracker.radar-update).",
        t.max_speed_px_per_s,
        clutter.n_false,
        100.0 * clutter.p_chance,
        t.coast_s
    )];
    let area = area_px2(scans);
    // A radar that measures well sees fast targets move far between its turns.
    speed::learn(&Evidence::of_scans(scans, area), unit, config, &mut told);
    let n_assumed = told.len();
    let _ = noise::learn(scans, area, unit, noise::Motions::Driven, config, &mut told);
    if let Some(speeds) = speeds(scans, config) {
        let t = &mut config.tracker;
        t.max_speed_px_per_s = round((SPEED_RESERVE * speeds.fastest).max(1.0));
        t.initiation = starting_with(speeds.rms.max(0.1 * t.max_speed_px_per_s));
        told.push(format!(
            "The fastest of {} tracks moves at {:.1} {px}/s, their speeds are {:.1} {px}/s in the mean square: a target may move by {} {px}/s.",
            speeds.n_tracks, speeds.fastest, speeds.rms, t.max_speed_px_per_s
        ));
        let mut again = Vec::new();
        let _ = noise::learn(scans, area, unit, noise::Motions::Driven, config, &mut again);
        if !again.is_empty() {
            told.remove(n_assumed);
            told.extend(again);
        }
    }
    reasons.extend(told);
}

fn starting_with(velocity_std: f64) -> InitiationConfig {
    InitiationConfig::OnePoint(OnePointConfig { velocity_std_px_per_s: round(velocity_std) })
}

/// The median of the plots' larger standard deviations, m.
fn spread(scans: &[Scan]) -> f64 {
    let of = |d: &Detection| d.cov.symmetric_eigenvalues().max().max(0.0).sqrt();
    let mut all: Vec<f64> = first(scans).iter().flat_map(|s| &s.detections).map(of).filter(|v| v.is_finite()).collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().filter(|v| *v > 0.0).unwrap_or(1.0)
}

/// What false plots do.
struct Clutter {
    /// False plots a turn.
    n_false: f64,
    /// Probability that one of them lies in the gate of a track of nothing, a turn.
    p_chance: f64,
}

impl Clutter {
    /// Plots in [`CONFIRM_TURNS`] turns that chance makes seldom enough.
    fn hits(&self) -> u32 {
        let n = CONFIRM_TURNS - 1;
        let p = self.p_chance;
        // P(at least k of n), from the most down.
        let mut tail = 0.0;
        let mut choose = 1.0;
        let mut hits = CONFIRM_TURNS;
        for k in (0..=n).rev() {
            tail += choose * p.powi(k as i32) * (1.0 - p).powi((n - k) as i32);
            choose *= f64::from(k) / f64::from(n - k + 1);
            if self.n_false * tail > FALSE_A_TURN {
                break;
            }
            hits = k + 1;
        }
        hits.clamp(LEAST_HITS, CONFIRM_TURNS)
    }

    /// Turns for which a confirmed track may go on unseen.
    fn coast_turns(&self) -> f64 {
        (DIES.ln() / (1.0 - self.p_chance.min(0.99)).ln().min(-1e-9)).floor().clamp(2.0, MOST_COAST_TURNS)
    }
}

/// False plots by those that stand alone: no plot of the turn before and of the one behind may belong to the same target. Of n false plots spread evenly n (1 - p)² do,
/// p = 1 - exp(-n V / A) with V the gate's area and A that of the field; land and ships come again and are not counted.
fn clutter(scans: &[Scan]) -> Clutter {
    let [most_scans, most_plots] = MOST_LOOKED_AT;
    let seen = &scans[..scans.len().min(most_scans)];
    let (mut alone, mut looked, mut all, mut gates) = (0.0, 0.0, 0.0, 0.0);
    for w in seen.windows(3) {
        let [before, now, after] = w else { continue };
        let step = now.detections.len().div_ceil(most_plots).max(1);
        for d in now.detections.iter().step_by(step) {
            let near = |e: &Detection| {
                let r = e.position - d.position;
                let s = (d.cov + e.cov) * (DIFFERENCE / 2.0);
                s.try_inverse().is_some_and(|w| r.dot(&(w * r)) <= GATE)
            };
            looked += 1.0;
            alone += f64::from(u8::from(!before.detections.iter().chain(&after.detections).any(near)));
            gates += std::f64::consts::PI * GATE * DIFFERENCE * d.cov.determinant().max(0.0).sqrt();
        }
        all += now.detections.len() as f64;
    }
    if looked == 0.0 {
        return Clutter { n_false: 0.0, p_chance: 0.0 };
    }
    let a_turn = all / (seen.len() - 2) as f64;
    let (n_alone, share) = (a_turn * alone / looked, gates / looked / area_px2(scans));
    let (mut n, mut p) = (n_alone, 0.0);
    for _ in 0..20 {
        p = 1.0 - (-n * share).exp();
        n = (n_alone / (1.0 - p).powi(2).max(0.01)).min(a_turn);
    }
    Clutter { n_false: n, p_chance: p }
}

struct Speeds {
    fastest: f64,
    rms: f64,
    n_tracks: usize,
}

/// How fast confirmed tracks are that have been followed for long; `None` where there are too few of them.
fn speeds(scans: &[Scan], config: &Config) -> Option<Speeds> {
    let mut tracker = crate::track::build(&config.tracker).ok()?;
    let mut tracks: BTreeMap<u64, (usize, f64)> = BTreeMap::new();
    for scan in first(scans) {
        for s in tracker.step(scan).ok()? {
            if s.status != TrackStatus::Confirmed || s.detection.is_none() {
                continue;
            }
            let m = &s.kinematics.mean;
            let of = tracks.entry(s.id.0).or_default();
            of.0 += 1;
            // The last one counts: it has seen the most.
            of.1 = m[1].hypot(m[3]);
        }
    }
    let mut all: Vec<f64> =
        tracks.into_values().filter(|t| t.0 >= LEAST_TURNS && t.1.is_finite()).map(|t| t.1).collect();
    all.sort_by(f64::total_cmp);
    if all.len() < LEAST_TRACKS {
        return None;
    }
    let rms = (all.iter().map(|v| v * v).sum::<f64>() / all.len() as f64).sqrt();
    Some(Speeds { fastest: *all.last()?, rms, n_tracks: all.len() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FrameIndex, Timestamp};
    use nalgebra::{Matrix2, Vector2};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// A target of 8 m/s and a buoy, seen in nine of ten turns to 5 m, with `n` false plots a turn in a square of 800 m.
    fn scans(n: u32) -> Vec<Scan> {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let scan = |k: u64| {
            let mut u = || rng.random::<f64>();
            let mut noise = |p: Vector2<f64>| {
                p + 5.0 * Vector2::new(u() + u() + u() + u() - 2.0, u() + u() + u() + u() - 2.0) * 3f64.sqrt()
            };
            let mut at = vec![noise(Vector2::new(50.0 + 8.0 * k as f64, 300.0)), noise(Vector2::new(600.0, 600.0))];
            at.retain(|_| rng.random::<f64>() < 0.9);
            at.extend((0..n).map(|_| 800.0 * Vector2::new(rng.random::<f64>(), rng.random::<f64>())));
            let all = at.into_iter().map(|p| Detection::at(p, Matrix2::identity() * 25.0)).collect();
            Scan::at(FrameIndex(k), Timestamp::from_secs_f64(k as f64)).with_detections(all)
        };
        (0..80).map(scan).collect()
    }

    #[test]
    fn false_plots_are_counted_and_make_confirmation_harder() {
        for n in [0, 5, 20, 40] {
            let found = clutter(&scans(n));
            // The chance by the areas: a gate of 18.42 π 2.5 25 m² in 800 x 800 m.
            let p = 1.0 - (-f64::from(n) * 18.42 * std::f64::consts::PI * 62.5 / 640_000.0).exp();
            assert!((found.p_chance - p).abs() < 0.02 + 0.15 * p, "{n}: {} not {p}", found.p_chance);
            assert!((found.n_false - f64::from(n)).abs() < 0.5 + 0.2 * f64::from(n), "{n}: {}", found.n_false);
        }
        let hits = |n_false: f64, p_chance: f64| Clutter { n_false, p_chance }.hits();
        // 20 P(at least 5 of 7) = 0.0013, 20 P(at least 4 of 7) = 0.023 for p = 0.08 (binomial tables).
        assert_eq!([hits(0.0, 0.0), hits(20.0, 0.08), hits(60.0, 0.5)], [4, 6, 8]);
        assert_eq!(Clutter { n_false: 20.0, p_chance: 0.08 }.coast_turns(), 8.0);
    }

    #[test]
    fn a_ship_and_a_buoy_are_followed_among_false_plots() {
        for n in [0, 5, 20] {
            let (mut config, mut reasons) = (Config::default(), Vec::new());
            let scans = scans(n);
            for_radar(&scans, 1.0, LengthUnit::Metre, &mut config, &mut reasons);
            assert!(reasons.iter().all(|r| !r.contains("px")), "{reasons:?}");
            let mut tracker = crate::track::build(&config.tracker).unwrap();
            let (mut on_ship, mut others) = (0, 0);
            for (k, scan) in scans.iter().enumerate().skip(20) {
                let states = tracker.step(scan).unwrap();
                if k < 40 {
                    continue;
                }
                let known = [Vector2::new(50.0 + 8.0 * k as f64, 300.0), Vector2::new(600.0, 600.0)];
                let confirmed = states.iter().filter(|s| s.status != TrackStatus::Tentative);
                let places: Vec<Vector2<f64>> =
                    confirmed.map(|s| Vector2::new(s.kinematics.mean[0], s.kinematics.mean[2])).collect();
                on_ship += known.iter().filter(|p| places.iter().any(|q| (*p - q).norm() < 15.0)).count();
                others += places.iter().filter(|q| known.iter().all(|p| (p - *q).norm() > 25.0)).count();
            }
            // Two things in 40 turns; a false track in a hundred turns, of some ten turns each.
            assert!(on_ship >= 72, "{n}: {on_ship} of 80");
            assert!(others <= 15, "{n}: {others}");
        }
    }
}
