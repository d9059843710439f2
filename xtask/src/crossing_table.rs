//! Crossing targets (data set III, `docs/theory/simulation.md`): share of scans tracked and identity switches for each
//! method.
//!
//! The scene is rendered and segmented as the papers do (band 90..110, d_p 2); clusters below 0.35 of a target are dropped,
//! merged ones are kept. A target is tracked in a scan when a confirmed track is within 3 px; a switch is a change of the
//! track that is on it.

use anyhow::Result;
use boresight::associate::{AssociatorConfig, JpdaConfig};
use boresight::sim::{Seed, named};
use boresight::track::{
    self, ConfirmationConfig, ExistenceConfig, MOfNConfig, MergedMeasurementsConfig, MhtConfig, TrackerConfig,
};
use boresight::vision::{self, DetectorConfig, threshold::BandConfig, threshold::ThresholdConfig};
use boresight::vision::{ClusterConfig, GivenNoise, NoiseConfig};
use boresight::{FrameSource, Scan, TrackStatus};

#[derive(clap::Args)]
pub struct Args {
    /// Runs of each method.
    #[arg(long, default_value_t = 200)]
    runs: u64,
    /// Only methods whose name holds this.
    #[arg(long)]
    only: Option<String>,
    /// First seed.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

pub fn run(args: &Args) -> Result<()> {
    println!("data set III, {} runs        tracked   switches a target   false tracks a run", args.runs);
    let wanted = |name: &str| args.only.as_ref().is_none_or(|only| name.contains(only.as_str()));
    for (name, config) in methods().into_iter().filter(|m| wanted(m.0)) {
        let (mut held, mut all, mut switches, mut wrong) = (0u64, 0u64, 0u64, 0u64);
        for run in 0..args.runs {
            let r = one(&config, Seed::new(args.seed).of_run(run))?;
            held += r[0];
            all += r[1];
            switches += r[2];
            wrong += r[3];
        }
        println!(
            "{name:28} {:6.2} %   {:.3}               {:.3}",
            100.0 * held as f64 / all as f64,
            switches as f64 / (2 * args.runs) as f64,
            wrong as f64 / args.runs as f64
        );
    }
    println!("the papers' own NN           82-88 %   0.75-1.6            0.2-0.7");
    Ok(())
}

fn methods() -> Vec<(&'static str, TrackerConfig)> {
    let base = TrackerConfig {
        acceleration_std_px_per_s2: Some(1e-3f64.sqrt()),
        extra_noise_px: 0.5f64.sqrt(),
        max_speed_px_per_s: 2.0,
        gate_within_max_speed: false,
        confirmation: ConfirmationConfig::MOfN(MOfNConfig { hits: 3, scans: 5, ..MOfNConfig::default() }),
        coast_s: 5.0,
        coast_scans: 5,
        clutter_density_per_px2: 1e-4,
        detection_probability: 0.95,
        merged_measurements: MergedMeasurementsConfig::off(),
        ..TrackerConfig::default()
    };
    let with = |associator| TrackerConfig { associator, ..base.clone() };
    let max_secondary_s = 15.0;
    let merged_measurements = MergedMeasurementsConfig { max_secondary_s, ..MergedMeasurementsConfig::default() };
    let exists = ConfirmationConfig::Existence(ExistenceConfig {
        mean_target_lifetime_s: 100.0,
        confirm_probability: 0.9,
        ..ExistenceConfig::default()
    });
    let at_once = ConfirmationConfig::MOfN(MOfNConfig { hits: 2, scans: 2, ..MOfNConfig::default() });
    vec![
        ("nearest", with(AssociatorConfig::Nearest(Default::default()))),
        ("global nearest", base.clone()),
        ("PDA", with(AssociatorConfig::Pda(Default::default()))),
        ("JPDA*", with(AssociatorConfig::Jpda(JpdaConfig::default()))),
        ("JIPDA", TrackerConfig { confirmation: exists, ..with(AssociatorConfig::Jpda(JpdaConfig::default())) }),
        ("MHT", TrackerConfig { mht: Some(MhtConfig::default()), ..base.clone() }),
        ("shared blobs", TrackerConfig { merged_measurements: merged_measurements.clone(), ..base.clone() }),
        // Clusters of the wrong size are gone before: two points are enough, if the second may be 3 px off.
        (
            "shared blobs, 2 of 2",
            TrackerConfig { merged_measurements, max_speed_px_per_s: 3.0, confirmation: at_once, ..base },
        ),
    ]
}

/// Scans tracked, scans in all, switches, false tracks.
fn one(config: &TrackerConfig, seed: Seed) -> Result<[u64; 4]> {
    let mut source = named("ds3", seed)?.build(seed)?;
    let detector = DetectorConfig {
        threshold: ThresholdConfig::Band(BandConfig { low: 90.0, high: 110.0 }),
        cluster: ClusterConfig { min_area_px: Some(28), max_area_px: Some(200), ..ClusterConfig::default() },
        noise: NoiseConfig::Given(GivenNoise { read_counts: 0.0, ..Default::default() }),
        ..DetectorConfig::default()
    };
    let mut detector = vision::build(&detector, source.info())?;
    let mut tracker = track::build(config)?;
    let mut scan = Scan::default();
    let mut on = [None; 2];
    let mut out = [0u64; 4];
    let mut ever: std::collections::BTreeMap<u64, bool> = Default::default();
    while let Some(frame) = source.next_frame()? {
        detector.detect(&frame, &mut scan)?;
        let states = tracker.step(&scan)?;
        let confirmed: Vec<_> = states.iter().filter(|s| s.status != TrackStatus::Tentative).collect();
        for s in &confirmed {
            ever.entry(s.id.0).or_insert(false);
        }
        for (t, truth) in source.truth().iter().take(2).enumerate() {
            let off = |s: &boresight::TrackState| {
                (s.kinematics.mean[0] - truth.kinematics.mean[0]).hypot(s.kinematics.mean[2] - truth.kinematics.mean[2])
            };
            // The track that was on it stays on it while it is near.
            let near: Vec<_> = confirmed.iter().filter(|s| off(s) <= 3.0).collect();
            let kept = near.iter().find(|s| on[t] == Some(s.id.0));
            let best = kept.or_else(|| near.iter().min_by(|a, b| off(a).total_cmp(&off(b))));
            out[1] += 1;
            if let Some(s) = best {
                out[0] += 1;
                out[2] += u64::from(on[t].is_some_and(|id| id != s.id.0));
                on[t] = Some(s.id.0);
                ever.insert(s.id.0, true);
            }
        }
    }
    out[3] = ever.values().filter(|near| !**near).count() as u64;
    Ok(out)
}
