//! From detections to tracks: filters, life cycle, birth; never sees pixels.
//!
//! [`build`] turns a [`TrackerConfig`] into a [`Tracking`]; each scan goes in, the living tracks come out.

pub mod association_cost;
pub mod clutter;
pub mod config;
pub mod confirm;
pub mod filter;
pub mod initial_tracks;
pub mod initiation;
pub mod join;
pub mod merged_measurements;
pub mod mht;
mod scan_interval;
mod single_track;
pub mod smooth;
pub mod stabilised;
pub mod step;
pub mod stitch;
pub mod tracker;

pub use association_cost::{OverlapConfig, OverlapKind, TermsConfig};
pub use clutter::{ClutterConfig, ClutterMapConfig, PerScanConfig};
pub use config::{TrackerConfig, TwoStageConfig};
pub use confirm::config::{ExistenceConfig, LifeConfig, MOfNConfig, ScoreConfig};
pub use confirm::confirmation_gate::ProofConfig;
pub use filter::{FilterConfig, FormConfig, InnovationConfig, ModelConfig, PRESETS, Preset, TrackFilter};
pub use initial_tracks::CueConfig;
pub use initiation::{BirthConfig, OnePointConfig, TwoPointConfig, VelocityBoundsConfig};
pub use join::{Joined, join};
pub use merged_measurements::SharingConfig;
pub use mht::{Mht, MhtConfig};
pub use stitch::StitchConfig;
pub use tracker::Tracker;

use crate::{Result, Scan, TrackState};

/// Turns scans into tracks: the tracker, or the multiple-hypothesis tracker.
pub trait Tracking: Send {
    /// Takes the next scan and returns all living tracks after it.
    /// # Errors
    /// A scan that runs back in time or holds values that are not finite; the tracks are then unchanged.
    fn step(&mut self, scan: &Scan) -> Result<&[TrackState]>;
}

/// Builds the tracker that a configuration describes.
/// # Errors
/// A value of the configuration outside its range.
pub fn build(config: &TrackerConfig) -> Result<Box<dyn Tracking>> {
    let inner: Box<dyn Tracking> = match &config.mht {
        Some(mht) => Box::new(Mht::new(config, mht)?),
        None => Box::new(Tracker::new(config)?),
    };
    Ok(Box::new(stabilised::Stabilised::new(inner, config.field_px)))
}
