//! Scale: scans per CPU second of the tracker itself from 10 to 100 000 targets, with memory, GOSPA, IDF1 and links.
//!
//! Time is CPU time of the process, so that other work on the machine does not count; memory is the growth of the
//! resident memory over the tracker's lifetime, scans not included.
//! Scene: that of the comparison with peers, tracking from detections (its own random numbers): speeds N(0, 1.5²) px/scan per axis, acceleration 0.1, a
//! fifth born and a fifth ended on the way, P_D 0.9, noise 1 px, clutter of 10 % or 100 % of N, 100 scans, side 60 √N px.

use anyhow::Result;
use boresight::associate::{AssociatorConfig, JpdaConfig};
use boresight::metrics::Similarity;
use boresight::metrics::set::{SetDistance, SetOptions};
use boresight::metrics::{MatchOptions, mot_scores};
use boresight::track::{
    self, ConfirmationConfig, ExistenceConfig, InitiationConfig, MergedMeasurementsConfig, TrackerConfig,
    TwoPointConfig,
};
use boresight::{Detection, Extent, FrameIndex, PixelOrigin, Scan, Timestamp, TrackRow, TrackStatus, TrackTable};
use nalgebra::{Matrix2, Vector2};
use rand::{RngExt, SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha12Rng;
use rand_distr::{Distribution, Normal, Poisson};
use rustix::time::{ClockId, clock_gettime};

#[derive(clap::Args)]
pub struct Args {
    /// Numbers of targets.
    #[arg(long, value_delimiter = ',', default_values_t = [10, 100, 1000, 10_000, 100_000])]
    sizes: Vec<usize>,
    /// Associator: `gnn` or `jpda`.
    #[arg(long, default_value = "gnn")]
    associator: String,
    /// Times each case is run; the fastest counts.
    #[arg(long, default_value_t = 3)]
    repeats: u32,
    /// Largest number of targets for which IDF1 is computed (it needs all boxes in memory).
    #[arg(long, default_value_t = 10_000)]
    idf1_up_to: usize,
}

const FRAMES: usize = 100;

/// One scene: for each scan the truth (target, position) and the detections.
struct Scene {
    truth: Vec<Vec<(u32, [f64; 2])>>,
    scans: Vec<Scan>,
    clutter_density: f64,
}

fn scene(n: usize, clutter: f64) -> Result<Scene> {
    let mut rng = ChaCha12Rng::seed_from_u64(4_000_000 + n as u64 * 10 + (clutter * 10.0) as u64);
    let side = (60.0 * (n as f64).sqrt()).max(400.0);
    let (speed, accelerate, measure) = (Normal::new(0.0, 1.5)?, Normal::new(0.0, 0.1)?, Normal::new(0.0, 1.0)?);
    let two = |d: &Normal<f64>, rng: &mut ChaCha12Rng| Vector2::new(d.sample(rng), d.sample(rng));
    let place = |rng: &mut ChaCha12Rng| Vector2::new(rng.random_range(0.0..side), rng.random_range(0.0..side));
    let mut targets: Vec<_> = (0..n)
        .map(|_| {
            let (p, v) = (place(&mut rng), two(&speed, &mut rng));
            let born = if rng.random::<f64>() < 0.2 { rng.random_range(0..50) } else { 0 };
            let ended = if rng.random::<f64>() < 0.2 { rng.random_range(50..FRAMES) } else { FRAMES };
            (p, v, born, ended)
        })
        .collect();
    let n_clutter = Poisson::new((clutter * n as f64).max(1e-9))?;
    let (mut truth, mut scans) = (Vec::new(), Vec::new());
    for k in 0..FRAMES {
        let (mut now, mut points) = (Vec::new(), Vec::new());
        for (i, (p, v, born, ended)) in targets.iter_mut().enumerate() {
            if (*born..*ended).contains(&k) {
                now.push((i as u32, [p.x, p.y]));
                if rng.random::<f64>() < 0.9 {
                    points.push(*p + two(&measure, &mut rng));
                }
            }
            let a = two(&accelerate, &mut rng);
            *p += *v + 0.5 * a;
            *v += a;
        }
        for _ in 0..n_clutter.sample(&mut rng) as usize {
            points.push(place(&mut rng));
        }
        points.shuffle(&mut rng);
        let detection = |p: &Vector2<f64>| {
            Detection::at(*p, Matrix2::identity())
                .with_extent(Extent { left_px: p.x - 10.0, top_px: p.y - 10.0, width_px: 20.0, height_px: 20.0 })
                .with_area_px(400)
        };
        truth.push(now);
        scans.push(
            Scan::at(FrameIndex(k as u64), Timestamp::from_secs_f64(k as f64))
                .with_detections(points.iter().map(detection).collect()),
        );
    }
    Ok(Scene { truth, scans, clutter_density: clutter * n as f64 / (side * side) })
}

/// The tracker of the bench: existence by odds, two-point starts with a spread of velocities.
pub fn tracker_config(clutter_density: f64, associator: AssociatorConfig) -> TrackerConfig {
    TrackerConfig {
        acceleration_std_px_per_s2: Some(0.1),
        extra_noise_px: 0.0,
        gate_probability: 0.9999,
        max_speed_px_per_s: 8.0,
        detection_probability: 0.9,
        clutter_density_per_px2: clutter_density,
        associator,
        initiation: InitiationConfig::TwoPoint(TwoPointConfig { velocity_std_px_per_s: Some(2.0) }),
        confirmation: ConfirmationConfig::Existence(ExistenceConfig {
            new_target_density_per_px2: 1e-6,
            confirm_probability: 0.5,
            demotion_probability: 0.5,
            delete_probability: 0.001,
            mean_target_lifetime_s: 200.0,
        }),
        coast_s: 6.0,
        coast_scans: 1,
        merged_measurements: MergedMeasurementsConfig::off(),
        ..TrackerConfig::default()
    }
}

pub fn run(args: &Args) -> Result<()> {
    println!("clutter       N  scans/CPU s   exponent   B/track   GOSPA/√n     IDF1   links kept");
    for clutter in [0.1, 1.0] {
        let mut before: Option<(usize, f64)> = None;
        for n in &args.sizes {
            let scene = scene(*n, clutter)?;
            let associator = match args.associator.as_str() {
                "jpda" => AssociatorConfig::Jpda(JpdaConfig::default()),
                _ => AssociatorConfig::default(),
            };
            let config = tracker_config(scene.clutter_density, associator);
            let mut fastest = f64::INFINITY;
            let mut memory = 0.0;
            // A short scene is run many times over, so that the clock's step does not matter.
            let rounds = (1000 / n).clamp(1, 50);
            for _ in 0..args.repeats {
                let rss = resident_bytes();
                let begin = cpu_s();
                for _ in 0..rounds {
                    let mut tracker = track::build(&config)?;
                    for scan in &scene.scans {
                        tracker.step(scan)?;
                    }
                    memory = (resident_bytes() - rss).max(memory);
                }
                fastest = fastest.min((cpu_s() - begin) / (rounds * FRAMES) as f64);
            }
            let exponent = before.map(|(m, t)| (fastest / t).ln() / (*n as f64 / m as f64).ln());
            before = Some((*n, fastest));
            let quality = quality(&scene, &config, *n <= args.idf1_up_to)?;
            println!(
                "{:5.0} % {n:9} {:12.1}   {}   {:7.0}   {:8.3}   {}   {:8.2} %",
                100.0 * clutter,
                1.0 / fastest,
                exponent.map_or("    -  ".to_string(), |e| format!("{e:7.2}")),
                memory / *n as f64,
                quality.gospa,
                quality.idf1.map_or("   -  ".to_string(), |v| format!("{v:6.4}")),
                100.0 * quality.links
            );
        }
    }
    Ok(())
}

/// How good the tracks are.
struct Quality {
    /// GOSPA per root target (c 10, p 2, as that comparison samples it: ten scans from the fifth).
    gospa: f64,
    /// Identity F1 of points within 5 px.
    idf1: Option<f64>,
    /// Share of consecutive scans of a target that carry the same track.
    links: f64,
}

fn quality(scene: &Scene, config: &TrackerConfig, with_idf1: bool) -> Result<Quality> {
    let mut tracker = track::build(config)?;
    let options = SetOptions { cutoff_px: 10.0, order: 2.0, ..SetOptions::default() };
    let mut distance = SetDistance::default();
    let looked_at: Vec<usize> = (0..10).map(|i| 5 + i * (FRAMES - 6) / 9).collect();
    let (mut gospa, mut n_truth) = (0.0, 0.0);
    let mut last: std::collections::BTreeMap<u32, Option<u64>> = Default::default();
    let (mut kept, mut links) = (0u64, 0u64);
    let (mut truth_rows, mut result_rows) = (Vec::new(), Vec::new());
    let row = |frame: usize, id: u64, at: &[f64; 2]| TrackRow {
        frame: frame as u32,
        id: id as i64,
        bbox: [at[0], at[1], 0.0, 0.0],
        ..TrackRow::default()
    };
    for (k, scan) in scene.scans.iter().enumerate() {
        let states = tracker.step(scan)?;
        let shown: Vec<(u64, [f64; 2])> = states
            .iter()
            .filter(|s| s.status != TrackStatus::Tentative)
            .map(|s| (s.id.0, [s.kinematics.mean[0], s.kinematics.mean[2]]))
            .collect();
        let truth: Vec<[f64; 2]> = scene.truth[k].iter().map(|t| t.1).collect();
        let result: Vec<[f64; 2]> = shown.iter().map(|s| s.1).collect();
        if with_idf1 {
            truth_rows.extend(scene.truth[k].iter().map(|t| row(k, u64::from(t.0), &t.1)));
            result_rows.extend(shown.iter().map(|s| row(k, s.0, &s.1)));
        }
        let g = distance.gospa(&truth, &result, &options);
        if looked_at.contains(&k) {
            gospa += g.distance / 10.0;
            n_truth += truth.len() as f64 / 10.0;
        }
        let mut now: std::collections::BTreeMap<u32, Option<u64>> =
            scene.truth[k].iter().map(|t| (t.0, None)).collect();
        for (t, s) in distance.matched() {
            now.insert(scene.truth[k][t as usize].0, Some(shown[s as usize].0));
        }
        if k > 5 {
            for (t, id) in &now {
                if let Some(before) = last.get(t) {
                    links += 1;
                    kept += u64::from(id.is_some() && id == before);
                }
            }
        }
        last = now;
    }
    let idf1 = if with_idf1 {
        let table = |rows| TrackTable::from_rows("bench", PixelOrigin::Centre0, rows);
        let options = MatchOptions { similarity: Similarity::Centre { zero_distance_px: 10.0 }, threshold: 0.5 };
        Some(mot_scores(&table(truth_rows)?, &table(result_rows)?, &options)?.identity.idf1())
    } else {
        None
    };
    Ok(Quality { gospa: gospa / n_truth.max(1.0).sqrt(), idf1, links: kept as f64 / links.max(1) as f64 })
}

/// CPU time of this process, s.
fn cpu_s() -> f64 {
    let t = clock_gettime(ClockId::ProcessCPUTime);
    t.tv_sec as f64 + t.tv_nsec as f64 * 1e-9
}

fn resident_bytes() -> f64 {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find(|l| l.starts_with("VmRSS"));
    line.and_then(|l| l.split_whitespace().nth(1)?.parse::<f64>().ok()).unwrap_or(0.0) * 1024.0
}
