//! Three spots of peak SNR 0.5 that cross in one place at one time, tracked: kept to the end, and by the same number as before.

use super::scenes::{RATE_HZ, Spot, detector, frame, random};
use super::white::{ONE_AN_HOUR, config};
use anyhow::Result;
use boresight::{Config, Scan, TrackStatus, track};
use rand::RngExt;
use std::fmt::Write as _;

/// Frames of a run, and when they meet.
const FRAMES: u64 = 256;
const MEET: f64 = 128.0;
const SIDE: usize = 160;
const TRACKER: &str = include_str!("../../../configs/below-noise.toml");

pub fn table(runs: u64, page: &mut String) -> Result<()> {
    let mut tracker = Config::from_toml(TRACKER, "configs/below-noise.toml")?.tracker;
    // As the command fills it in.
    tracker.field_px = Some([SIDE as f64; 2]);
    let (mut kept, mut unswapped, mut held, mut rows, mut strangers) = (0, 0, 0usize, 0usize, 0usize);
    for run in 0..runs {
        let mut rng = random(5000 + run);
        let turn = rng.random::<f64>() * std::f64::consts::TAU;
        let spots: Vec<Spot> = (0..3)
            .map(|i| {
                // 120 degrees apart, 0.35 to 0.5 px a frame.
                let (a, v) = (turn + std::f64::consts::TAU / 3.0 * f64::from(i), 0.35 + 0.15 * rng.random::<f64>());
                let middle = 0.5 * SIDE as f64;
                let place = [0, 1].map(|_| middle + rng.random::<f64>() - 0.5);
                Spot { place, velocity: [v * a.cos(), v * a.sin()], at: MEET }
            })
            .collect();
        let mut detector = detector([SIDE; 2], config(64, ONE_AN_HOUR))?;
        let mut tracker = track::build(&tracker)?;
        let mut scan = Scan::default();
        let (mut before, mut after) = ([None; 3], [None; 3]);
        let mut false_ids = std::collections::BTreeSet::new();
        for k in 0..FRAMES {
            detector.detect(&frame([SIDE; 2], &spots, 0.5, k, &mut rng), &mut scan)?;
            let states = tracker.step(&scan)?;
            let shown: Vec<_> = states.iter().filter(|s| s.status != TrackStatus::Tentative).collect();
            for s in &shown {
                let near = |t: &Spot| {
                    let [x, y] = t.place(k as f64);
                    (s.kinematics.mean[0] - x).hypot(s.kinematics.mean[2] - y) <= 5.0
                };
                if !spots.iter().any(near) {
                    false_ids.insert(s.id.0);
                }
            }
            let ids = [0, 1, 2].map(|i: usize| {
                let [x, y] = spots[i].place(k as f64);
                let near = |d: f64| {
                    move |s: &&&boresight::TrackState| (s.kinematics.mean[0] - x).hypot(s.kinematics.mean[2] - y) <= d
                };
                shown.iter().filter(near(3.0)).map(|s| s.id.0).next()
            });
            if k >= 63 {
                rows += 3;
                held += ids.iter().flatten().count();
            }
            if k as f64 <= MEET - 33.0 {
                before = [0, 1, 2].map(|i: usize| ids[i].or(before[i]));
            }
            after = ids;
        }
        kept += u64::from(after.iter().all(Option::is_some));
        unswapped += u64::from(before.iter().zip(&after).all(|(a, b)| a.is_some() && a == b));
        strangers += false_ids.len();
    }
    let share = |n: u64| 100.0 * n as f64 / runs as f64;
    writeln!(
        page,
        "| runs | all three tracked in the last frame | and by the numbers they had before they met | rows held from frame 64 on | tracks off any target by 5 px at some time |"
    )?;
    writeln!(page, "| --- | --- | --- | --- | --- |")?;
    writeln!(
        page,
        "| {runs} of {:.1} s | {:.1} % | {:.1} % | {:.1} % | {:.2} a run |",
        FRAMES as f64 / RATE_HZ,
        share(kept),
        share(unswapped),
        100.0 * held as f64 / rows as f64,
        strangers as f64 / runs as f64
    )?;
    Ok(())
}
