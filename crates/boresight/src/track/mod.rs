//! From detections to tracks; never sees pixels.
//!
//! [`build()`] turns a [`TrackerConfig`] into a [`Tracking`]; each scan goes in, the tracks come out. [`tracker`] is the order of a step,
//! `step/` its parts (predict, gate, associate, update, delete, initiate, report), `confirm/` the confirmation rules.

mod appearance;
pub mod association_cost;
mod build;
mod clock;
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
pub mod scan_table;
mod single_track;
pub mod smooth;
pub mod stabilised;
pub mod step;
pub mod stitch;
pub mod tracker;
mod tracking;

pub use appearance::Appearance;
pub use association_cost::{AssociationCostConfig, OverlapConfig, OverlapKind};
pub use build::build;
pub use clutter::{ClutterConfig, ClutterMapConfig, PerScanConfig};
pub use config::{TrackerConfig, TwoStageConfig};
pub use confirm::confirmation_gate::ConfirmationGateConfig;
pub use confirm::existence::ExistenceConfig;
pub use confirm::m_of_n::MOfNConfig;
pub use confirm::rule::ConfirmationConfig;
pub use confirm::sprt::SprtConfig;
pub use filter::{FilterConfig, FormConfig, InnovationConfig, ModelConfig, PRESETS, Preset, TrackFilter};
pub use initial_tracks::InitialTrackConfig;
pub use initiation::{InitiationConfig, OnePointConfig, TwoPointConfig, VelocityBoundsConfig};
pub use join::{Joined, join};
pub use merged_measurements::MergedMeasurementsConfig;
pub use mht::config::MhtConfig;
pub use mht::tracker::Mht;
pub use stitch::StitchConfig;
pub use tracker::Tracker;
pub use tracking::Tracking;
