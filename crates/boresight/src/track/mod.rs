//! From detections to tracks: filters, life cycle, birth; never sees pixels.
//!
//! [`build`] turns a [`TrackerConfig`] into a [`Tracking`]; each scan goes in, the living tracks come out.

pub mod birth;
pub mod clutter;
pub mod config;
mod correct;
pub mod cue;
pub mod filter;
pub mod gating;
pub mod join;
pub mod life;
pub mod life_config;
mod living;
pub mod mht;
mod pace;
mod proof;
pub mod sharing;
pub mod smooth;
pub mod stabilised;
mod stage;
mod starts;
pub mod stitch;
pub mod terms;
pub mod tracker;

pub use birth::{BirthConfig, OnePointConfig, TwoPointConfig, VelocityBoundsConfig};
pub use clutter::{ClutterConfig, ClutterMapConfig, PerScanConfig};
pub use config::{TrackerConfig, TwoStageConfig};
pub use cue::CueConfig;
pub use filter::{FilterConfig, FormConfig, InnovationConfig, ModelConfig, TrackFilter};
pub use join::{Joined, join};
pub use life_config::{ExistenceConfig, LifeConfig, MOfNConfig, ScoreConfig};
pub use mht::{Mht, MhtConfig};
pub use proof::ProofConfig;
pub use sharing::SharingConfig;
pub use stitch::StitchConfig;
pub use terms::{OverlapConfig, OverlapKind, TermsConfig};
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
