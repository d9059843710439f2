//! Tracks from nothing on data set II: how many false tracks are confirmed, when the target is, with size limits.
//!
//! Source: SPEC D.5 (M/N 3/5, P_G 0.99, vmax 2 px/scan, R 0.3-0.5, Q 1e-3, deletion after 5 misses), C.5 (29..=129 px for 9 x 9).
//! A confirmed track is false if it is never within 3 px of the target at a scan in which it is confirmed.
//! The product's own detector and tracker run here, nothing is known beforehand.

use super::study::{Options, monte_carlo};
use crate::sim::named::{PAPER_START, paper_scene};
use crate::sim::{SceneConfig, Seed};
use crate::track::{LifeConfig, MOfNConfig, TrackerConfig};
use crate::vision::config::{ClusterConfig, GivenNoise, NoiseConfig};
use crate::vision::{DetectorConfig, threshold::BandConfig, threshold::ThresholdConfig};
use crate::{FrameSource, Result, Scan, TrackId, TrackStatus};
use std::collections::BTreeMap;

/// A track is on the target when it is this near, px.
const NEAR_PX: f64 = 3.0;

/// What one run of initiation gave.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Initiation {
    /// Confirmed tracks that were never near a target.
    pub false_tracks: usize,
    /// First scan (from 1) at which a confirmed track is on the first target.
    pub confirmed_at: Option<usize>,
    /// Share of the scans with a confirmed track on the first target.
    pub held: f64,
}

/// The detector of the papers: band 90..=110, d_p = 2, size limits of a 9 x 9 target where wanted.
pub fn paper_detector(size_limits: bool) -> DetectorConfig {
    DetectorConfig {
        threshold: ThresholdConfig::Band(BandConfig { low: 90.0, high: 110.0 }),
        cluster: ClusterConfig { target_size_px: size_limits.then_some([9.0, 9.0]), ..ClusterConfig::default() },
        // Of no weight here: the tracker's extra noise is R.
        noise: NoiseConfig::Given(GivenNoise { read_counts: 0.0, gain: 0.0 }),
        ..DetectorConfig::default()
    }
}

/// The tracker of SPEC D.5 at one scan a second.
pub fn paper_tracker() -> TrackerConfig {
    TrackerConfig {
        acceleration_std_px_per_s2: 1e-3f64.sqrt(),
        extra_noise_px: 0.5f64.sqrt(),
        max_speed_px_per_s: 2.0,
        life: LifeConfig::MOfN(MOfNConfig { hits: 3, scans: 5, tentative_s: 1e9 }),
        coast_s: 5.0,
        coast_scans: 5,
        ..TrackerConfig::default()
    }
}

/// Runs a scene through detector and tracker from nothing.
/// # Errors
/// A configuration that is refused.
pub fn initiate(
    scene: &SceneConfig,
    seed: Seed,
    detector: &DetectorConfig,
    tracker: &TrackerConfig,
) -> Result<Initiation> {
    let mut source = scene.build(seed)?;
    let mut detector = crate::vision::build(detector, source.info())?;
    let mut tracker = crate::track::build(tracker)?;
    let mut scan = Scan::default();
    let mut ever_near: BTreeMap<TrackId, bool> = BTreeMap::new();
    let (mut out, mut held, mut n) = (Initiation::default(), 0usize, 0usize);
    while let Some(frame) = source.next_frame()? {
        detector.detect(&frame, &mut scan)?;
        n += 1;
        let mut on_first = false;
        for track in tracker.step(&scan)?.iter().filter(|t| t.status != TrackStatus::Tentative) {
            let at = track.kinematics.mean;
            let near =
                |t: &crate::TrackState| (t.kinematics.mean[0] - at[0]).hypot(t.kinematics.mean[2] - at[2]) <= NEAR_PX;
            *ever_near.entry(track.id).or_default() |= source.truth().iter().any(near);
            on_first |= source.truth().first().is_some_and(near);
        }
        if on_first {
            held += 1;
            out.confirmed_at.get_or_insert(n);
        }
        source.recycle(frame);
    }
    out.false_tracks = ever_near.values().filter(|near| !**near).count();
    out.held = held as f64 / n.max(1) as f64;
    Ok(out)
}

/// Runs data set II from nothing `options.runs` times.
/// # Errors
/// As [`initiate`].
pub fn study_ds2(options: &Options<'_>, size_limits: bool) -> Result<Vec<Initiation>> {
    let scene = paper_scene(&[PAPER_START], (100.0, 10.0), (50.0, 50.0));
    let (detector, tracker) = (paper_detector(size_limits), paper_tracker());
    monte_carlo(options, |run| initiate(&scene, Seed::new(options.seed).of_run(run), &detector, &tracker))
}
