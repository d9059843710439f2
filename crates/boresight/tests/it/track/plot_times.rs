//! Plots with times of their own: a radar whose antenna turns in 2.5 s, targets of 10 to 300 m/s.
//!
//! Independent of the tracker's own way: the truth is drawn exactly at the plots' times and the scans' (continuous white acceleration), errors and innovations are
//! held against χ², and scans of one plot against the same plots as scans of their own time, which need no splitting.

use super::trackers;
use boresight::track::{ConfirmationConfig, MOfNConfig, ModelConfig, PRESETS, TrackerConfig, build};
use boresight::{Detection, Extent, FrameIndex, Scan, Timestamp, TrackState, TrackStatus};
use boresight_filters::consistency::{Consistency, Verdict, normalized_error2};
use nalgebra::{Matrix2, Vector2, Vector4};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::TAU;

pub(super) const TURN_S: f64 = 2.5;
const STD_M: f64 = 10.0;
/// m²/s³.
pub(super) const DENSITY: f64 = 0.5;

pub(super) fn normal(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// The state `[x, vx, y, vy]` after `dt_s`, with continuous white acceleration.
pub(super) fn moved(s: Vector4<f64>, dt_s: f64, rng: &mut ChaCha8Rng) -> Vector4<f64> {
    let mut out = s;
    for a in [0, 2] {
        // cov = q [[t³/3, t²/2], [t²/2, t]]: the velocity first, the place given it.
        let dv = (DENSITY * dt_s).sqrt() * normal(rng);
        let rest = (DENSITY * dt_s.powi(3) / 12.0).sqrt() * normal(rng);
        out[a] = s[a] + s[a + 1] * dt_s + 0.5 * dt_s * dv + rest;
        out[a + 1] = s[a + 1] + dv;
    }
    out
}

/// One turn of a run: when the plot was seen, where, and the truth in the middle of the turn and at its end.
struct Turn {
    end_s: f64,
    seen_s: f64,
    plot: Vector2<f64>,
    middle: Vector4<f64>,
    end: Vector4<f64>,
}

/// A target from `start` on, seen once a turn when the antenna (clockwise, at north when a turn begins) points at it.
fn turns(start: Vector4<f64>, n: usize, rng: &mut ChaCha8Rng) -> Vec<Turn> {
    let mut s = start;
    (0..n)
        .map(|k| {
            let begin_s = k as f64 * TURN_S;
            let mut within_s = 0.5 * TURN_S;
            for _ in 0..50 {
                let at = Vector2::new(s[0] + s[1] * within_s, s[2] + s[3] * within_s);
                within_s = at.x.atan2(at.y).rem_euclid(TAU) / TAU * TURN_S;
            }
            let seen = moved(s, within_s, rng);
            let plot = Vector2::new(seen[0], seen[2]) + STD_M * Vector2::new(normal(rng), normal(rng));
            let half = 0.5 * TURN_S;
            // The middle may lie on either side of the plot; only its mean is looked at.
            let middle = seen + Vector4::new(seen[1], 0.0, seen[3], 0.0) * (half - within_s);
            s = moved(seen, TURN_S - within_s, rng);
            Turn { end_s: begin_s + TURN_S, seen_s: begin_s + within_s, plot, middle, end: s }
        })
        .collect()
}

fn plot(t: &Turn) -> Detection {
    // A large box, so that costs of overlap know it again.
    Detection::at(t.plot, Matrix2::identity() * STD_M * STD_M).with_extent(Extent::around(t.plot, 400.0, 400.0))
}

pub(super) fn ns(s: f64) -> i64 {
    Timestamp::from_secs_f64(s).ns
}

/// The turn as a scan at its end, its plot with a time of its own.
fn by_plot(k: usize, t: &Turn) -> Scan {
    let age_ns = (ns(t.end_s) - ns(t.seen_s)).unsigned_abs();
    Scan::at(FrameIndex(k as u64), Timestamp::from_ns(ns(t.end_s))).with_detections(vec![plot(t).with_age_ns(age_ns)])
}

/// The turn as a scan of this time, its plot taken as of that time.
fn at_once(k: usize, t: &Turn, time_s: f64) -> Scan {
    Scan::at(FrameIndex(k as u64), Timestamp::from_ns(ns(time_s))).with_detections(vec![plot(t)])
}

fn radar() -> TrackerConfig {
    TrackerConfig {
        acceleration_density_px2_per_s3: DENSITY,
        extra_noise_px: 0.0,
        max_speed_px_per_s: 800.0,
        gate_probability: 0.9999,
        clutter_density_per_px2: 1e-12,
        coast_s: 30.0,
        confirmation: ConfirmationConfig::MOfN(MOfNConfig { hits: 3, scans: 4, ..MOfNConfig::default() }),
        ..TrackerConfig::default()
    }
}

/// The states of the one track, scan by scan.
fn track(config: &TrackerConfig, scans: impl Iterator<Item = Scan>) -> Vec<Option<TrackState>> {
    let mut tracker = build(config).unwrap();
    scans.map(|s| tracker.step(&s).unwrap().first().cloned()).collect()
}

/// Outward at 5 degrees from north: seen at the beginning of each turn.
fn outward(speed: f64) -> Vector4<f64> {
    let (s, c) = 5f64.to_radians().sin_cos();
    Vector4::new(5000.0 * s, speed * s, 5000.0 * c, speed * c)
}

/// East across north in the middle of the run: from the end of a turn to the beginning of the next.
fn across(speed: f64) -> Vector4<f64> {
    Vector4::new(-speed * TURN_S * 12.3, speed, 30_000.0, 0.0)
}

#[test]
fn the_errors_of_fast_targets_are_those_stated_and_have_no_bias_where_each_plot_has_its_time() {
    const RUNS: u64 = 100;
    const N: usize = 25;
    for (way, start) in [("outward", outward as fn(f64) -> Vector4<f64>), ("across", across)] {
        let (mut nees, mut nis) = (Consistency::new(4), Consistency::new(2));
        for speed in [10.0, 50.0, 100.0, 300.0] {
            let (mut along, mut along2, mut late) = (0.0, 0.0, 0.0);
            for run in 0..RUNS {
                let mut rng = ChaCha8Rng::seed_from_u64(1000 * speed as u64 + run);
                let turns = turns(start(speed), N, &mut rng);
                let states = track(&radar(), turns.iter().enumerate().map(|(k, t)| by_plot(k, t)));
                let last = states[N - 1].as_ref().unwrap();
                assert_eq!(last.status, TrackStatus::Confirmed, "{way}, {speed} m/s, run {run}");
                let off = last.kinematics.mean - turns[N - 1].end;
                nees.add(normalized_error2(&off, &last.kinematics.cov).unwrap());
                states[5..].iter().flatten().filter_map(|s| s.innovation.as_ref()).for_each(|i| nis.add(i.nis));
                let way = start(1.0);
                let ahead = |off: Vector4<f64>| off[0] * way[1] + off[2] * way[3];
                along += ahead(off);
                along2 += ahead(off).powi(2);
                // The twin: one time for the turn, its middle.
                let states =
                    track(&radar(), turns.iter().enumerate().map(|(k, t)| at_once(k, t, t.end_s - 0.5 * TURN_S)));
                if let Some(s) = &states[N - 1] {
                    late += ahead(s.kinematics.mean - turns[N - 1].middle);
                }
            }
            let n = RUNS as f64;
            let (bias, std) = (along / n, (along2 / n).sqrt() / n.sqrt());
            println!("{way}, {speed} m/s: bias {bias:.2} ± {std:.2} m, with one time a turn {:.1} m", late / n);
            assert!(bias.abs() < 3.0 * std, "{way}, {speed} m/s: bias {bias} ± {std} m");
            if way == "outward" {
                // Seen 5/360 of a turn after its beginning, held for seen in its middle.
                let want = -speed * (0.5 - 5.0 / 360.0) * TURN_S;
                assert!(
                    (late / n - want).abs() < 3.0 * std + 0.01 * want.abs(),
                    "{speed} m/s: {} not {want}",
                    late / n
                );
            }
        }
        println!(
            "{way}: NEES {:.3} {:?}, NIS {:.3} {:?}",
            nees.mean(),
            nees.bounds(0.95),
            nis.mean(),
            nis.bounds(0.95)
        );
        assert_eq!(nees.is_consistent(0.95).unwrap(), Verdict::Consistent, "{way}: NEES {}", nees.mean());
        assert_eq!(nis.is_consistent(0.95).unwrap(), Verdict::Consistent, "{way}: NIS {}", nis.mean());
    }
}

/// Innovations (in deviations of a plot) and statuses of scans whose one plot has its time, and of the same plots as scans of their own times.
fn compare(config: &TrackerConfig, tolerance: f64, what: &str) {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let turns = turns(outward(100.0), 40, &mut rng);
    // A few misses.
    let empty = |k: usize, s: Scan| if [17, 25, 26].contains(&k) { s.with_detections(Vec::new()) } else { s };
    let ours = track(config, turns.iter().enumerate().map(|(k, t)| empty(k, by_plot(k, t))));
    let twin = track(config, turns.iter().enumerate().map(|(k, t)| empty(k, at_once(k, t, t.seen_s))));
    let mut n = 0;
    for (k, (a, b)) in ours.iter().zip(&twin).enumerate() {
        let (Some(a), Some(b)) = (a, b) else {
            assert!(a.is_none() && b.is_none(), "{what}, turn {k}");
            continue;
        };
        assert_eq!((a.status, a.detection), (b.status, b.detection), "{what}, turn {k}");
        if let (Some(a), Some(b)) = (&a.innovation, &b.innovation) {
            let off = (a.innovation - b.innovation).norm() / STD_M;
            let wider = (a.cov - b.cov).norm() / b.cov.norm();
            assert!(off < tolerance && wider < tolerance, "{what}, turn {k}: {off:e} {wider:e}");
            n += 1;
        }
    }
    assert!(n > 25, "{what}: {n} innovations");
}

#[test]
fn every_tracker_compares_a_plot_with_where_the_track_is_at_that_time() {
    for (k, config) in trackers().into_iter().enumerate() {
        // Their own association, confirmation, initiation and costs, in metres.
        let config = TrackerConfig {
            acceleration_density_px2_per_s3: DENSITY,
            clutter_density_per_px2: 1e-9,
            gate_probability: 0.999,
            coast_s: 30.0,
            ..config
        };
        // The twin's scans are regular to some ms, so that an estimate with a memory in seconds differs by as little.
        compare(&config, 1e-5, &format!("tracker {k}: {config:?}"));
    }
}

#[test]
fn every_filter_compares_a_plot_with_where_the_track_is_at_that_time_or_counts_turns() {
    for preset in PRESETS {
        let mut config = TrackerConfig { filter: preset.filter(), ..radar() };
        if let ModelConfig::NearlyConstantTurn(c) = &mut config.filter.model {
            // The turns of aircraft; the preset's are those of things near a camera, with which this target is lost whatever its plots' times.
            (c.start_rate_std_rad_per_s, c.rate_drift_rad_per_s) = (0.02, 0.002);
        }
        if ["ekf", "ukf", "imm"].contains(&preset.name) {
            // Where a step is linearised or mixed, two parts of it are not the whole: held against the truth. With one time for the turn it would be 120 m.
            let mut rng = ChaCha8Rng::seed_from_u64(11);
            let turns = turns(outward(100.0), 60, &mut rng);
            let states = track(&config, turns.iter().enumerate().map(|(k, t)| by_plot(k, t)));
            let seen = states.iter().zip(&turns).skip(20).filter_map(|(s, t)| Some((s.as_ref()?, t)));
            let offs: Vec<Vector2<f64>> = seen.map(|(s, t)| s.position() - Vector2::new(t.end[0], t.end[2])).collect();
            let mean = offs.iter().sum::<Vector2<f64>>() / offs.len() as f64;
            assert!(offs.len() == 40 && mean.norm() < STD_M, "{}: {mean} of {}", preset.name, offs.len());
        } else if config.filter.form.takes_any_time() {
            compare(&config, 1e-6, preset.name);
        } else {
            let mut rng = ChaCha8Rng::seed_from_u64(11);
            let turns = turns(outward(100.0), 40, &mut rng);
            let ours = track(&config, turns.iter().enumerate().map(|(k, t)| by_plot(k, t)));
            let twin = track(&config, turns.iter().enumerate().map(|(k, t)| at_once(k, t, t.end_s)));
            assert_eq!(ours, twin, "{}", preset.name);
        }
    }
}

#[test]
fn plots_of_several_times_that_share_a_track_do_not_pull_it_along_its_way() {
    use boresight::associate::AssociatorConfig;
    // At rest in its own frame: every plot lies where the target was at the plot's time, so whatever the weights, nothing is learnt of the place.
    let start = outward(300.0);
    let place = |time_s: f64| Vector2::new(start[0] + start[1] * time_s, start[2] + start[3] * time_s);
    let at = |end_s: f64, ages_s: &[f64]| {
        let seen = ages_s.iter().map(|age_s| {
            Detection::at(place(end_s - age_s), Matrix2::identity() * STD_M * STD_M).with_age_ns((age_s * 1e9) as u64)
        });
        Scan::at(FrameIndex::default(), Timestamp::from_secs_f64(end_s)).with_detections(seen.collect())
    };
    for associator in [AssociatorConfig::Pda(Default::default()), AssociatorConfig::Jpda(Default::default())] {
        let config = TrackerConfig { associator, clutter_density_per_px2: 1e-6, ..radar() };
        let mut tracker = build(&config).unwrap();
        for k in 1..=10 {
            tracker.step(&at(f64::from(k) * TURN_S, &[1.0])).unwrap();
        }
        let states = tracker.step(&at(11.0 * TURN_S, &[2.2, 1.0, 0.3])).unwrap();
        let off = states[0].position() - place(11.0 * TURN_S);
        assert!(off.norm() < 1e-6 * STD_M, "{off}");
        assert!(states[0].innovation.as_ref().unwrap().innovation.norm() < 1e-6 * STD_M);
    }
}
