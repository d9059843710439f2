//! One target in clutter: share of tracks lost by nearest neighbour, PDA, JPDA, IPDA and MHT, beside
//! `docs/theory/association.md`.
//!
//! Scene: constant velocity with acceleration noise 0.05 px/scan², measurements of 0.5 px, clutter uniform in a square that
//! moves with the target; a few clean scans to start, then 50 scans; lost: more than 5 px off at the end.

use anyhow::Result;
use boresight::associate::{AssociatorConfig, JpdaConfig};
use boresight::track::{
    self, ConfirmationConfig, ExistenceConfig, MOfNConfig, MergedMeasurementsConfig, MhtConfig, TrackerConfig,
};
use boresight::{Detection, FrameIndex, Scan, Timestamp, TrackState};
use nalgebra::{Matrix2, Vector2};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;
use rand_distr::{Distribution, Normal, Poisson};

#[derive(clap::Args)]
pub struct Args {
    /// Runs of each cell.
    #[arg(long, default_value_t = 300)]
    runs: u64,
    /// First seed.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Scans without clutter and misses at the start (how the reference's tracks start is not known; five come
    /// nearest).
    #[arg(long, default_value_t = 5)]
    clean: u64,
}

/// P_D, λ, then the shares lost in `docs/theory/association.md`: NN, PDA; with a blackout of scans 15-25: NN, PDA.
const CELLS: [(f64, f64, [f64; 4]); 5] = [
    (1.0, 0.01, [0.010, 0.007, 0.703, 0.620]),
    (1.0, 0.06, [0.260, 0.053, 0.790, 0.727]),
    (0.9, 0.01, [0.040, 0.010, 0.717, 0.473]),
    (0.9, 0.03, [0.233, 0.050, 0.740, 0.540]),
    (0.7, 0.03, [0.470, 0.133, 0.790, 0.480]),
];

const SIGMA: f64 = 0.5;
const SCANS: u64 = 50;
/// Half side of the square that holds clutter, px: wider than any gate that matters.
const HALF: f64 = 30.0;

pub fn run(args: &Args) -> Result<()> {
    println!(
        "share of tracks lost, {} runs a cell (standard error up to {:.3})",
        args.runs,
        0.5 / (args.runs as f64).sqrt()
    );
    println!("P_D  λ/px²  blackout   NN (reference)  PDA (reference) JPDA   IPDA   MHT");
    for blackout in [false, true] {
        for (p_d, lambda, spec) in CELLS {
            let lost: Vec<f64> = methods(p_d, lambda)
                .iter()
                .map(|config| share_lost(config, p_d, lambda, blackout, args))
                .collect::<Result<_>>()?;
            let spec = if blackout { [spec[2], spec[3]] } else { [spec[0], spec[1]] };
            println!(
                "{p_d:.1}  {lambda:.2}   {:8}   {:.3} ({:.3})   {:.3} ({:.3})   {:.3}  {:.3}  {:.3}",
                if blackout { "15-25" } else { "no" },
                lost[0],
                spec[0],
                lost[1],
                spec[1],
                lost[2],
                lost[3],
                lost[4]
            );
        }
    }
    Ok(())
}

fn methods(p_d: f64, lambda: f64) -> Vec<TrackerConfig> {
    let base = TrackerConfig {
        acceleration_std_px_per_s2: Some(0.05),
        extra_noise_px: 0.0,
        max_speed_px_per_s: 10.0,
        gate_within_max_speed: false,
        detection_probability: p_d,
        clutter_density_per_px2: lambda,
        // One target, followed to the end: no other starts, no giving up.
        max_tracks: 1,
        coast_s: 1e6,
        merged_measurements: MergedMeasurementsConfig::off(),
        confirmation: ConfirmationConfig::MOfN(MOfNConfig { hits: 2, scans: 2, ..MOfNConfig::default() }),
        ..TrackerConfig::default()
    };
    let with = |associator| TrackerConfig { associator, ..base.clone() };
    let jpda = AssociatorConfig::Jpda(JpdaConfig::default());
    let exists = ConfirmationConfig::Existence(ExistenceConfig {
        new_target_density_per_px2: 100.0 * lambda,
        confirm_probability: 0.5,
        demotion_probability: 1e-9,
        delete_probability: 1e-10,
        mean_target_lifetime_s: 1000.0,
    });
    // The target is known to exist, as it is for the others: a first score that no miss uses up.
    let certain =
        MhtConfig { n_scan: 7, max_leaves: 100, new_target_density_per_px2: lambda * 1e40, ..MhtConfig::default() };
    vec![
        with(AssociatorConfig::Nearest(Default::default())),
        with(AssociatorConfig::Pda(Default::default())),
        with(jpda.clone()),
        TrackerConfig { confirmation: exists, ..with(AssociatorConfig::Pda(Default::default())) },
        TrackerConfig { mht: Some(certain), ..base },
    ]
}

fn share_lost(config: &TrackerConfig, p_d: f64, lambda: f64, blackout: bool, args: &Args) -> Result<f64> {
    let mut lost = 0;
    for run in 0..args.runs {
        let mut rng = ChaCha12Rng::seed_from_u64(args.seed.wrapping_mul(1_000_003) + run);
        let (accelerate, measure) = (Normal::new(0.0, 0.05)?, Normal::new(0.0, SIGMA)?);
        let clutter = Poisson::new(lambda * 4.0 * HALF * HALF)?;
        let mut tracker = track::build(config)?;
        let (mut x, mut v) = (Vector2::new(10.0, 10.0), Vector2::new(1.0, 1.0));
        let mut off = f64::INFINITY;
        for k in 0..args.clean + SCANS {
            let a = Vector2::new(accelerate.sample(&mut rng), accelerate.sample(&mut rng));
            x += v + 0.5 * a;
            v += a;
            let mut points = Vec::new();
            let noise = Vector2::new(measure.sample(&mut rng), measure.sample(&mut rng));
            let scan = k.saturating_sub(args.clean) + 1;
            let dark = blackout && k >= args.clean && (15..=25).contains(&scan);
            if k < args.clean || (rng.random::<f64>() < p_d && !dark) {
                points.push(x + noise);
            }
            if k >= args.clean {
                for _ in 0..clutter.sample(&mut rng) as u64 {
                    points.push(x + Vector2::new(rng.random_range(-HALF..HALF), rng.random_range(-HALF..HALF)));
                }
            }
            let states = tracker.step(&scan_of(k, &points))?;
            off = states
                .iter()
                .find(|s: &&TrackState| s.id.0 == 1)
                .map_or(f64::INFINITY, |s| (Vector2::new(s.kinematics.mean[0], s.kinematics.mean[2]) - x).norm());
        }
        lost += u64::from(off > 5.0);
    }
    Ok(lost as f64 / args.runs as f64)
}

pub fn scan_of(k: u64, points: &[Vector2<f64>]) -> Scan {
    let detection = |p: &Vector2<f64>| Detection::at(*p, Matrix2::identity() * SIGMA * SIGMA);
    Scan::at(FrameIndex(k), Timestamp::from_secs_f64(k as f64)).with_detections(points.iter().map(detection).collect())
}
