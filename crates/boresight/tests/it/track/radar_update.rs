//! A radar's plots converted to positions, or used by the extended update, beside each other: near and far, one and two degrees of azimuth, a turning antenna on a
//! ship that moves.
//!
//! Independent of the tracker's own way: the truth is drawn exactly at the plots' times and the scans', range and azimuth get Gaussian noise, errors are held against χ² and
//! against 0.

use super::plot_times::{DENSITY, TURN_S, moved, normal, ns};
use boresight::track::{
    ConfirmationConfig, InitiationConfig, MOfNConfig, OnePointConfig, RadarUpdate, TrackerConfig, build,
};
use boresight::{Detection, FrameIndex, RadarPlot, Scan, Timestamp, TrackState};
use boresight_filters::consistency::{Consistency, Verdict, normalized_error2};
use boresight_filters::converted::{Polar, converted};
use nalgebra::{Vector2, Vector4};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

const RUNS: u64 = 400;
const N: usize = 40;
const RANGE_STD_M: f64 = 20.0;
const SPEED_STD: f64 = 10.0;

fn own_ship(time_s: f64) -> Vector2<f64> {
    Vector2::new(8.0 * time_s, -3.0 * time_s)
}

/// One turn: the plot, when it was seen, and the truth at its end.
struct Turn {
    end_s: f64,
    seen_s: f64,
    plot: RadarPlot,
    end: Vector4<f64>,
}

/// A target that begins `range` away in any direction, with a velocity drawn as the tracker's start takes it.
fn turns(range: f64, azimuth_std_deg: f64, rng: &mut ChaCha8Rng) -> Vec<Turn> {
    let way = TAU * 0.5 * (1.0 + (normal(rng) / 1.6).tanh());
    let mut v = || SPEED_STD * normal(rng);
    let mut s = Vector4::new(range * way.cos(), v(), range * way.sin(), v());
    let std = azimuth_std_deg.to_radians();
    (0..N)
        .map(|k| {
            let begin_s = k as f64 * TURN_S;
            let mut within_s = 0.5 * TURN_S;
            for _ in 0..50 {
                let at = Vector2::new(s[0] + s[1] * within_s, s[2] + s[3] * within_s) - own_ship(begin_s + within_s);
                within_s = at.x.atan2(at.y).rem_euclid(TAU) / TAU * TURN_S;
            }
            let seen = moved(s, within_s, rng);
            let sensor = own_ship(begin_s + within_s);
            let d = Vector2::new(seen[0], seen[2]) - sensor;
            let polar = Polar {
                range: d.norm() + RANGE_STD_M * normal(rng),
                azimuth_rad: d.y.atan2(d.x) + std * normal(rng),
                range_std: RANGE_STD_M,
                azimuth_std_rad: std,
            };
            s = moved(seen, TURN_S - within_s, rng);
            let plot = RadarPlot { polar, sensor };
            Turn { end_s: begin_s + TURN_S, seen_s: begin_s + within_s, plot, end: s }
        })
        .collect()
}

fn scan(k: usize, t: &Turn) -> Scan {
    let m = converted(&t.plot.polar, &t.plot.sensor).unwrap();
    let age_ns = (ns(t.end_s) - ns(t.seen_s)).unsigned_abs();
    let d = Detection::at(m.position, m.cov).with_plot(Some(t.plot)).with_age_ns(age_ns);
    Scan::at(FrameIndex(k as u64), Timestamp::from_ns(ns(t.end_s))).with_detections(vec![d])
}

fn config(radar_update: RadarUpdate) -> TrackerConfig {
    TrackerConfig {
        radar_update,
        acceleration_density_px2_per_s3: DENSITY,
        extra_noise_px: 0.0,
        max_speed_px_per_s: 3000.0,
        gate_probability: 0.99999,
        clutter_density_per_px2: 1e-12,
        coast_s: 60.0,
        coast_scans: 20,
        initiation: InitiationConfig::OnePoint(OnePointConfig { velocity_std_px_per_s: SPEED_STD }),
        confirmation: ConfirmationConfig::MOfN(MOfNConfig { hits: 3, scans: 4, ..MOfNConfig::default() }),
        ..TrackerConfig::default()
    }
}

/// What a form reaches at a range: NEES at the ends of turns, NIS, and the error along the line of sight at the last.
struct Reached {
    nees: [Consistency; 3],
    nis: Consistency,
    /// Mean error along the line of sight and across it, and their standard errors, m.
    bias: [[f64; 2]; 2],
    rms: [f64; 2],
    lost: usize,
}

/// The turns at whose ends errors are looked at.
const LOOKED_AT: [usize; 3] = [9, 19, N - 1];

fn reached(config: &TrackerConfig, runs: u64, range: f64, azimuth_std_deg: f64) -> Reached {
    let mut out = Reached {
        nees: [0; 3].map(|_| Consistency::new(4)),
        nis: Consistency::new(2),
        bias: [[0.0; 2]; 2],
        rms: [0.0; 2],
        lost: 0,
    };
    let mut sums = [[0.0f64; 2]; 2];
    for run in 0..runs {
        let mut rng = ChaCha8Rng::seed_from_u64(7000 + run);
        let turns = turns(range, azimuth_std_deg, &mut rng);
        let mut tracker = build(config).unwrap();
        let states: Vec<Option<TrackState>> =
            turns.iter().enumerate().map(|(k, t)| tracker.step(&scan(k, t)).unwrap().first().cloned()).collect();
        states[3..].iter().flatten().filter_map(|s| s.innovation.as_ref()).for_each(|i| out.nis.add(i.nis));
        for (nees, k) in out.nees.iter_mut().zip(LOOKED_AT) {
            let Some(s) = &states[k] else {
                out.lost += 1;
                continue;
            };
            let off = s.kinematics.mean - turns[k].end;
            nees.add(normalized_error2(&off, &s.kinematics.cov).unwrap());
        }
        if let Some(s) = &states[N - 1] {
            let t = &turns[N - 1];
            let u = (Vector2::new(t.end[0], t.end[2]) - own_ship(t.end_s)).normalize();
            let off = s.position() - Vector2::new(t.end[0], t.end[2]);
            for (sum, e) in sums.iter_mut().zip([off.dot(&u), off.y * u.x - off.x * u.y]) {
                *sum = [sum[0] + e, sum[1] + e * e];
            }
        }
    }
    let n = runs as f64;
    for (i, [sum, square]) in sums.into_iter().enumerate() {
        out.rms[i] = (square / n).sqrt();
        out.bias[i] = [sum / n, (square / n - (sum / n).powi(2)).sqrt() / n.sqrt()];
    }
    out
}

#[test]
fn the_extended_update_is_honest_and_without_bias_where_converted_plots_are_not() {
    for (range, deg) in [(2_000.0, 1.0), (2_000.0, 2.0), (40_000.0, 1.0), (40_000.0, 2.0)] {
        let [converted, extended] = [RadarUpdate::Converted, RadarUpdate::Extended].map(|update| {
            let r = reached(&config(update), RUNS, range, deg);
            let nees = r.nees.each_ref().map(|n| n.mean());
            println!(
                "{range} m, {deg} degrees, {update:?}: NEES {nees:.2?} in {:.2?}, NIS {:.3} in {:.3?}; along {:.1} ± {:.1} m (rms {:.1}), across {:.0} ± {:.0} m (rms {:.0})",
                r.nees[2].bounds(0.95).unwrap(),
                r.nis.mean(),
                r.nis.bounds(0.95).unwrap(),
                r.bias[0][0],
                r.bias[0][1],
                r.rms[0],
                r.bias[1][0],
                r.bias[1][1],
                r.rms[1]
            );
            assert_eq!(r.lost, 0, "{range} m, {deg} degrees, {update:?}");
            r
        });
        let along = |r: &Reached| r.bias[0][0].abs() / r.bias[0][1];
        assert!(along(&converted) > 3.0 || range < 10_000.0, "converted plots are known to be drawn outward");
        if range * deg < 50_000.0 {
            for (nees, turn) in extended.nees.iter().zip(LOOKED_AT) {
                let verdict = nees.is_consistent(0.95).unwrap();
                assert_eq!(verdict, Verdict::Consistent, "{range} m, {deg} degrees, turn {turn}: {}", nees.mean());
            }
            assert_eq!(extended.nis.is_consistent(0.95).unwrap(), Verdict::Consistent, "NIS {}", extended.nis.mean());
            assert!(along(&extended) < 3.0, "{range} m, {deg} degrees: {:?}", extended.bias[0]);
        } else {
            // 1.4 km across beside 20 m along: what the arc adds is the same from turn to turn, and no Cartesian state remembers it.
            let nees = extended.nees[2].mean();
            assert!(nees < 5.0 && nees < 0.65 * converted.nees[2].mean(), "NEES {nees}");
            assert!(extended.bias[0][0].abs() < 6.0 && extended.rms[0] < 0.4 * converted.rms[0]);
        }
    }
}

#[test]
fn every_tracker_takes_range_and_azimuth_as_they_were_measured() {
    for (k, other) in super::trackers().into_iter().enumerate() {
        let reached = |radar_update| {
            let own = config(radar_update);
            let config = TrackerConfig { associator: other.associator.clone(), mht: other.mht.clone(), ..own };
            reached(&config, 20, 40_000.0, 2.0)
        };
        let along = [RadarUpdate::Converted, RadarUpdate::Extended].map(|u| reached(u).bias[0][0]);
        // The bias of converted plots is 44 ± 5 m here.
        assert!(along[0] > 25.0 && along[1].abs() < 15.0, "tracker {k}: {along:?}");
    }
}

#[test]
fn without_range_and_azimuth_nothing_changes() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let turns = turns(20_000.0, 1.0, &mut rng);
    let states = [RadarUpdate::Converted, RadarUpdate::Extended].map(|update| {
        let mut tracker = build(&config(update)).unwrap();
        let without = |s: Scan| {
            let detections = s.detections.iter().map(|d| d.clone().with_plot(None)).collect();
            s.with_detections(detections)
        };
        turns.iter().enumerate().map(|(k, t)| tracker.step(&without(scan(k, t))).unwrap().to_vec()).collect::<Vec<_>>()
    });
    assert_eq!(states[0], states[1]);
}
