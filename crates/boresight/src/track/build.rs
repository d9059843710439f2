//! From a configuration to the tracker that it describes.

use super::config::TrackerConfig;
use super::mht::tracker::Mht;
use super::stabilised::Stabilised;
use super::tracker::Tracker;
use super::tracking::Tracking;
use crate::Result;

/// Builds the tracker that a configuration describes.
/// # Errors
/// A value of the configuration outside its range.
pub fn build(config: &TrackerConfig) -> Result<Box<dyn Tracking>> {
    let inner: Box<dyn Tracking> = match &config.mht {
        Some(mht) => Box::new(Mht::new(config, mht)?),
        None => Box::new(Tracker::new(config)?),
    };
    Ok(Box::new(Stabilised::new(inner, config.field_px)))
}
