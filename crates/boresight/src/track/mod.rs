//! From detections to tracks; never sees pixels.
//!
//! [`build()`] turns a [`TrackerConfig`] into a [`Tracking`]; each scan goes in, the tracks come out. `tracker` is the order of a step,
//! `step/` its parts (predict, gate, associate, update, delete, report, initiate), `confirm/` the confirmation rules.

mod appearance;
pub(crate) mod association_cost;
mod backward;
mod build;
mod clock;
pub(crate) mod clutter;
pub(crate) mod config;
pub(crate) mod confirm;
mod correlated_error;
pub mod filter;
pub(crate) mod gaps;
pub(crate) mod initial_tracks;
pub(crate) mod initiation;
pub(crate) mod join;
mod lasting;
pub(crate) mod merged_measurements;
pub(crate) mod mht;
mod out_of_order;
mod parameters;
mod radar_update;
pub(crate) mod reidentify;
mod scan_interval;
pub(crate) mod scan_table;
pub(crate) mod score_likelihood;
mod single_track;
pub mod smooth;
mod smooth_table;
pub(crate) mod stabilised;
pub(crate) mod step;
pub(crate) mod stitch;
pub(crate) mod tracker;
mod tracking;

pub use appearance::Appearance;
pub use association_cost::{AssociationCostConfig, OverlapConfig, OverlapKind};
pub use backward::Backward;
pub(crate) use backward::{Own, Past};
pub use build::build;
pub use clutter::{ClutterConfig, ClutterMapConfig, PerScanConfig};
pub use config::{TrackerConfig, TwoStageConfig};
pub use confirm::existence::ExistenceConfig;
pub use confirm::m_of_n::MOfNConfig;
pub use confirm::motion_test::{MotionTestConfig, Report};
pub use confirm::rule::ConfirmationConfig;
pub use confirm::sprt::SprtConfig;
pub use filter::{
    AccelerationNoise, FilterConfig, FormConfig, InnovationConfig, ModelConfig, OrnsteinUhlenbeckConfig, PRESETS,
    Preset, TrackFilter,
};
pub use gaps::with_empty_frames;
pub use initial_tracks::InitialTrackConfig;
pub use initiation::{InitiationConfig, OnePointConfig, TwoPointConfig, VelocityBoundsConfig};
pub use join::{Joined, join};
pub use merged_measurements::MergedMeasurementsConfig;
pub use mht::config::MhtConfig;
pub use mht::tracker::Mht;
pub use out_of_order::OutOfOrder;
pub use parameters::TrackerParameters;
pub use radar_update::RadarUpdate;
pub use reidentify::ReidentificationConfig;
pub use score_likelihood::ScoreLikelihoodConfig;
pub use smooth_table::{SmoothedTable, smooth_table};
pub use stitch::StitchConfig;
pub use tracker::Tracker;
pub use tracking::Tracking;
