//! Data set II through the product's own detector, tracker and confirmation rule: from nothing, and from a known start.
//!
//! Source: `docs/theory/track-management.md` (M/N 3/5, P_G 0.99, vmax 2 px/scan, R 0.3-0.5, Q 1e-3, deletion after 5
//! misses, 29..=129 px for 9 x 9; known start with R = 0.5, Q = 1e-5, P0 = diag(0.5, 0.03, 0.5, 0.03): RMSPE 0.176
//! ± 0.037, no track lost). A confirmed track is false if it is never within 3 px of the target at a scan in which it
//! is confirmed.

use super::item::{Output, Row, Section};
use super::score::{MEASURES, four_numbers, spread};
use super::study::{LOST_PX, Options, monte_carlo};
use boresight::sim::{PAPER_START, paper_scene};
use boresight::sim::{SceneConfig, Seed};
use boresight::track::{
    ConfirmationConfig, InitialTrackConfig, MOfNConfig, MergedMeasurementsConfig, ReidentificationConfig, TrackerConfig,
};
use boresight::vision::{ClusterConfig, GivenNoise, NoiseConfig};
use boresight::vision::{DetectorConfig, threshold::BandConfig, threshold::ThresholdConfig};
use boresight::{FrameSource, Result, Scan, TrackId, TrackStatus};
use nalgebra::Vector4;
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
    /// PFE_x, PFE_y, RMSPE, RMSVE of the designated track, or of the nearest confirmed one where nothing is known, over the scans that have one.
    pub values: [f64; 4],
    /// The first target has no confirmed track within 5 px at the end.
    pub lost: bool,
}

/// The detector of the papers: band 90..=110, d_p = 2, size limits of a 9 x 9 target where wanted.
pub fn paper_detector(size_limits: bool) -> DetectorConfig {
    DetectorConfig {
        threshold: ThresholdConfig::Band(BandConfig { low: 90.0, high: 110.0 }),
        cluster: ClusterConfig { target_size_px: size_limits.then_some([9.0, 9.0]), ..ClusterConfig::default() },
        // Of no weight here: the tracker's extra noise is R.
        noise: NoiseConfig::Given(GivenNoise { read_counts: 0.0, ..Default::default() }),
        ..DetectorConfig::default()
    }
}

/// The tracker of `docs/theory/track-management.md` at one scan a second.
pub fn paper_tracker() -> TrackerConfig {
    TrackerConfig {
        acceleration_std_px_per_s2: Some(1e-3f64.sqrt()),
        extra_noise_px: 0.5f64.sqrt(),
        max_speed_px_per_s: 2.0,
        confirmation: ConfirmationConfig::MOfN(MOfNConfig { hits: 3, scans: 5, tentative_s: 1e9 }),
        coast_s: 5.0,
        coast_scans: 5,
        // The papers know none.
        reidentification: ReidentificationConfig { max_gap_s: 0.0 },
        ..TrackerConfig::default()
    }
}

/// The same with Q = 1e-5 and the papers' known start, one step before the first scan.
pub fn known_start_tracker() -> TrackerConfig {
    TrackerConfig {
        acceleration_std_px_per_s2: Some(1e-5f64.sqrt()),
        initial_tracks: vec![InitialTrackConfig {
            // The papers count pixels from 1.
            position_px: [PAPER_START[0] - 1.0, PAPER_START[2] - 1.0],
            velocity_px_per_s: [PAPER_START[1], PAPER_START[3]],
            position_std_px: 0.5f64.sqrt(),
            velocity_std_px_per_s: 0.03f64.sqrt(),
            age_s: 1.0,
            size_px: [9.0, 9.0],
        }],
        ..paper_tracker()
    }
}

/// Runs a scene through detector and tracker.
/// # Errors
/// A configuration that is refused.
pub fn initiate(
    scene: &SceneConfig,
    seed: Seed,
    detector: &DetectorConfig,
    tracker: &TrackerConfig,
) -> Result<Initiation> {
    let mut source = scene.build(seed)?;
    let designated = !tracker.initial_tracks.is_empty();
    let mut detector = boresight::vision::build(detector, source.info())?;
    let mut tracker = boresight::track::build(tracker)?;
    let mut scan = Scan::default();
    let mut ever_near: BTreeMap<TrackId, bool> = BTreeMap::new();
    let (mut out, mut held, mut n) = (Initiation { lost: true, ..Initiation::default() }, 0usize, 0usize);
    let (mut truths, mut estimates) = (Vec::new(), Vec::new());
    while let Some(frame) = source.next_frame()? {
        detector.detect(&frame, &mut scan)?;
        n += 1;
        let mut on_first = false;
        let first = source.truth().first().map_or(Vector4::zeros(), |t| t.kinematics.mean);
        let mut nearest: Option<(f64, Vector4<f64>)> = None;
        for track in tracker.step(&scan)?.iter().filter(|t| t.status != TrackStatus::Tentative) {
            let at = track.kinematics.mean;
            let near = |t: &boresight::TrackState| {
                (t.kinematics.mean[0] - at[0]).hypot(t.kinematics.mean[2] - at[2]) <= NEAR_PX
            };
            *ever_near.entry(track.id).or_default() |= source.truth().iter().any(near);
            on_first |= source.truth().first().is_some_and(near);
            let off = (at[0] - first[0]).hypot(at[2] - first[2]);
            // A designated track answers for itself; without one the nearest does.
            let counts = !designated || track.id == TrackId(1);
            if counts && nearest.is_none_or(|(least, _)| off < least) {
                nearest = Some((off, at));
            }
        }
        out.lost = nearest.is_none_or(|(off, _)| off > LOST_PX);
        if let Some((_, at)) = nearest {
            // Percentage errors are of the papers' world, which counts pixels from 1.
            let one = Vector4::new(1.0, 0.0, 1.0, 0.0);
            truths.push(first + one);
            estimates.push(at + one);
        }
        if on_first {
            held += 1;
            out.confirmed_at.get_or_insert(n);
        }
        source.recycle(frame);
    }
    out.false_tracks = ever_near.values().filter(|near| !**near).count();
    out.held = held as f64 / n.max(1) as f64;
    out.values = four_numbers(&truths, &estimates);
    Ok(out)
}

/// How data set II is run through the product's pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// From nothing, clusters of any size.
    AnySize,
    /// From nothing, size limits of a 9 x 9 target.
    SizeLimits,
    /// From the papers' known start, size limits.
    Known,
    /// From the papers' known start, clusters of any size: what the papers do.
    KnownAnySize,
}

/// Runs data set II `options.runs` times.
/// # Errors
/// As [`initiate`].
pub fn study_ds2(options: &Options<'_>, start: Start) -> Result<Vec<Initiation>> {
    let scene = paper_scene(&[PAPER_START], (100.0, 10.0), (50.0, 50.0));
    let detector = paper_detector(matches!(start, Start::SizeLimits | Start::Known));
    let tracker = match start {
        Start::AnySize | Start::SizeLimits => paper_tracker(),
        Start::Known => known_start_tracker(),
        // One target is known to be there: no other track is started that could take its clusters.
        Start::KnownAnySize => TrackerConfig {
            max_tracks: 1,
            merged_measurements: MergedMeasurementsConfig::off(),
            ..known_start_tracker()
        },
    };
    monte_carlo(options, |run| initiate(&scene, Seed::new(options.seed).of_run(run), &detector, &tracker))
}

/// Mean and deviation of PFE_x, PFE_y, RMSPE and RMSVE in the independent Monte Carlo (reading A, good tuning, 200
/// runs).
const REFERENCE: [(f64, f64); 4] = [(0.3122, 0.0891), (0.3255, 0.0921), (0.1758, 0.0371), (0.0192, 0.0049)];

/// Data set II through the product's own pipeline, from a known start and from nothing.
pub fn pipeline_ds2(options: &Options<'_>) -> Result<Output> {
    let mut sections = Vec::new();
    for (start, reading) in [
        (Start::KnownAnySize, "known start, clusters of any size, one track"),
        (Start::Known, "known start, size limits 29..=129 px"),
        (Start::SizeLimits, "from nothing, size limits 29..=129 px, 3 of 5 scans"),
    ] {
        let known = start != Start::SizeLimits;
        let runs = study_ds2(options, start)?;
        let lost = runs.iter().filter(|r| r.lost).count();
        let kept: Vec<_> = runs.iter().filter(|r| !r.lost).collect();
        let row = |measure: &str, values: Vec<f64>, reference| Row {
            case: "data set II".into(),
            measure: measure.into(),
            paper: None,
            ours: spread(&values, None),
            reference,
            lost,
        };
        let mut rows: Vec<Row> = (0..4)
            .map(|i| {
                let (mean, std) = REFERENCE[i];
                row(MEASURES[i], kept.iter().map(|r| r.values[i]).collect(), known.then_some((mean, std, 200)))
            })
            .collect();
        let n_false: usize = runs.iter().map(|r| r.false_tracks).sum();
        let rmspe = rows[2].ours.mean;
        let sentence = if known {
            format!(
                "Aim: mean RMSPE 0.176 ± 0.01 px and no track lost. Here {rmspe:.4} px, {lost} of {} lost: {}.",
                runs.len(),
                if (rmspe - 0.176).abs() <= 0.01 && lost == 0 { "met" } else { "missed" }
            )
        } else {
            rows.push(row("false tracks", runs.iter().map(|r| r.false_tracks as f64).collect(), None));
            let at = runs.iter().filter_map(|r| r.confirmed_at.map(|k| k as f64)).collect();
            rows.push(row("confirmed at", at, None));
            rows.push(row("share held", runs.iter().map(|r| r.held).collect(), None));
            format!(
                "Aim: no false confirmed track. Here {n_false} in {} runs: {}. (The reference's tracker confirms at scan 3.05 on average.)",
                runs.len(),
                if n_false == 0 { "met" } else { "missed" }
            )
        };
        sections.push(Section {
            item: "ds2-pipeline",
            title: "Data set II through the product's own detector, tracker and confirmation rule".into(),
            reading: format!(
                "{reading}; band 90..=110, d_p = 2, R = 0.5 px², q = {}",
                if known { "1e-5" } else { "1e-3" }
            ),
            rows,
            sentence,
        });
    }
    Ok(Output { sections, ..Output::default() })
}
