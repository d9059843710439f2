//! How the tracks of a table move, for `smooth` and `stitch`: as said on the command line, else as in the configuration beside the table, which it was made with.

use crate::console::say;
use boresight::track::{AccelerationNoise, ModelConfig, OrnsteinUhlenbeckConfig, TrackerConfig};
use boresight::{Config, TrackFrame};
use std::path::Path;

/// A white acceleration, with a part in squared box heights, or velocities that are forgotten.
pub struct TableMotion {
    pub acceleration: AccelerationNoise,
    pub density_per_height2_per_s3: f64,
    pub forgetting: Option<OrnsteinUhlenbeckConfig>,
    /// The tracker's configuration, if that said it.
    pub tracker: Option<TrackerConfig>,
}

impl TableMotion {
    /// Takes what was `asked` for, else what stands beside a table that is the tracker's `own`, and says which.
    pub fn of(asked: Option<AccelerationNoise>, table: &Path, own: bool) -> anyhow::Result<Self> {
        let plain =
            |acceleration| Self { acceleration, density_per_height2_per_s3: 0.0, forgetting: None, tracker: None };
        if let Some(acceleration) = asked {
            return Ok(plain(acceleration));
        }
        let beside = table.with_file_name("config.toml");
        if !own || !beside.is_file() {
            let usual = AccelerationNoise::default();
            say!("{usual}, the tracker's default (--acceleration-density)");
            return Ok(plain(usual));
        }
        let tracker = Config::from_file(&beside)?.tracker;
        let acceleration = tracker.acceleration_noise(0.0);
        let forgetting = match &tracker.filter.model {
            ModelConfig::OrnsteinUhlenbeck(c) if tracker.filter.form.takes_a_model() => Some(c.clone()),
            _ => None,
        };
        match &forgetting {
            Some(c) => say!(
                "velocities of {} px/s forgotten in {} s, from {}",
                c.speed_std_px_per_s,
                c.memory_s,
                beside.display()
            ),
            None => say!("{acceleration}, from {}", beside.display()),
        }
        if forgetting.is_none() && !tracker.filter.is_constant_velocity() {
            say!(
                "note: these tracks are of another model than constant velocity; their covariances become approximate"
            );
        }
        Ok(Self {
            acceleration,
            density_per_height2_per_s3: tracker.acceleration_density_per_height2_per_s3,
            forgetting,
            tracker: Some(tracker),
        })
    }

    /// The acceleration of boxes of the middle height in the table.
    pub fn of_middle_height(&self, frames: &[TrackFrame]) -> AccelerationNoise {
        let mut heights: Vec<f64> = frames.iter().flat_map(|f| &f.tracks).map(|t| t.extent.height_px).collect();
        heights.retain(|h| h.is_finite());
        heights.sort_by(f64::total_cmp);
        let height = heights.get(heights.len() / 2).copied().unwrap_or(0.0);
        self.tracker.as_ref().map_or(self.acceleration, |t| t.acceleration_noise(height))
    }
}
