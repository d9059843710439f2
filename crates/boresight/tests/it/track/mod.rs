//! Robustness of association and tracking: random gates and scans, bad input, extremes.

mod associators;
mod blind;
mod extremes;
mod merged;
mod plot_times;
mod radar_update;
mod random_scans;
mod units;

use boresight::associate::{AssociatorConfig, Coalescence, JpdaConfig};
use boresight::track::{
    AssociationCostConfig, ClutterConfig, ConfirmationConfig, ExistenceConfig, InitiationConfig, MhtConfig,
    OverlapConfig, SprtConfig, TrackerConfig, TwoStageConfig,
};
use boresight::{Detection, Extent, FrameIndex, Scan, Timestamp};
use nalgebra::{Matrix2, Vector2};

/// A detection with a box of 8 px and a score that tells it from its neighbours.
pub fn detection(x: f64, y: f64) -> Detection {
    Detection::at(Vector2::new(x, y), Matrix2::identity() * 0.25)
        .with_extent(Extent { left_px: x - 4.0, top_px: y - 4.0, width_px: 8.0, height_px: 8.0 })
        .with_area_px(64)
        .with_peak(100.0)
        .with_sum(6400.0)
        .with_score(0.9)
}

/// A scan at 25 scans a second.
pub fn scan(k: u64, points: &[(f64, f64)]) -> Scan {
    Scan::at(FrameIndex(k), Timestamp::from_ns(k as i64 * 40_000_000))
        .with_detections(points.iter().map(|p| detection(p.0, p.1)).collect())
}

/// Every associator.
pub fn associators() -> Vec<AssociatorConfig> {
    use boresight::associate::{CostKind, GlobalNearestConfig};
    vec![
        AssociatorConfig::Nearest(Default::default()),
        AssociatorConfig::GlobalNearest(GlobalNearestConfig { cost: CostKind::Distance }),
        AssociatorConfig::GlobalNearest(GlobalNearestConfig { cost: CostKind::Likelihood }),
        AssociatorConfig::Pda(Default::default()),
        AssociatorConfig::Jpda(JpdaConfig::default()),
        AssociatorConfig::Jpda(JpdaConfig { coalescence: Coalescence::None, ..JpdaConfig::default() }),
        AssociatorConfig::Jpda(JpdaConfig { coalescence: Coalescence::None, max_states: 1 }),
    ]
}

/// Trackers that between them use every associator, confirmation rule, initiation, clutter estimate and association cost, and MHT.
pub fn trackers() -> Vec<TrackerConfig> {
    let base = TrackerConfig { max_speed_px_per_s: 300.0, ..TrackerConfig::default() };
    let mut out: Vec<TrackerConfig> =
        associators().into_iter().map(|associator| TrackerConfig { associator, ..base.clone() }).collect();
    for confirmation in
        [ConfirmationConfig::Sprt(SprtConfig::default()), ConfirmationConfig::Existence(ExistenceConfig::default())]
    {
        let associator = AssociatorConfig::Jpda(JpdaConfig::default());
        out.push(TrackerConfig { confirmation: confirmation.clone(), ..base.clone() });
        out.push(TrackerConfig { confirmation, associator, ..base.clone() });
    }
    for initiation in
        [InitiationConfig::OnePoint(Default::default()), InitiationConfig::VelocityBounds(Default::default())]
    {
        out.push(TrackerConfig { initiation, ..base.clone() });
    }
    for clutter in [ClutterConfig::PerScan(Default::default()), ClutterConfig::Map(Default::default())] {
        let associator = AssociatorConfig::Pda(Default::default());
        out.push(TrackerConfig { clutter, associator, ..base.clone() });
    }
    let association_cost = AssociationCostConfig {
        size_log_std: Some(0.3),
        intensity_log_std: Some(0.3),
        class_cost: Some(10.0),
        overlap: Some(OverlapConfig { buffer: 0.3, ..OverlapConfig::default() }),
        learn: true,
    };
    out.push(TrackerConfig { association_cost, two_stage: Some(TwoStageConfig::default()), ..base.clone() });
    out.push(TrackerConfig { mht: Some(MhtConfig::default()), ..base });
    out
}
