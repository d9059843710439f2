//! How the tracks of a table move, for `smooth` and `stitch`: as said on the command line, else as in the configuration beside the table, which it was made with.

use crate::console::say;
use boresight::Config;
use boresight::track::{AccelerationNoise, ModelConfig, OrnsteinUhlenbeckConfig, TrackerConfig};
use std::path::{Path, PathBuf};

/// The tracker that made a table, and where its configuration stands.
pub type Maker = (TrackerConfig, PathBuf);

/// The tracker that made a table of its `own` making, by the configuration beside it.
pub fn maker(table: &Path, own: bool) -> anyhow::Result<Option<Maker>> {
    let beside = table.with_file_name("config.toml");
    if !own || !beside.is_file() {
        return Ok(None);
    }
    Ok(Some((Config::from_file(&beside)?.tracker, beside)))
}

/// The white acceleration of boxes of that height, px, or velocities that are forgotten: as `asked`, else as the table was made; says which where nothing was asked.
pub fn of(
    asked: Option<AccelerationNoise>,
    maker: Option<&Maker>,
    height_px: f64,
) -> (AccelerationNoise, Option<OrnsteinUhlenbeckConfig>) {
    let (tracker, beside) = match (asked, maker) {
        (Some(acceleration), _) => return (acceleration, None),
        (None, None) => {
            let usual = AccelerationNoise::default();
            say!("{usual}, the tracker's default (--acceleration-density)");
            return (usual, None);
        }
        (None, Some((tracker, beside))) => (tracker, beside.display()),
    };
    let acceleration = tracker.acceleration_noise(height_px);
    if let ModelConfig::OrnsteinUhlenbeck(c) = &tracker.filter.model {
        say!("velocities of {} px/s forgotten in {} s, from {beside}", c.speed_std_px_per_s, c.memory_s);
        return (acceleration, Some(c.clone()));
    }
    say!("{acceleration}, from {beside}");
    if !tracker.filter.is_constant_velocity() {
        say!("note: these tracks are of another model than constant velocity; their covariances become approximate");
    }
    (acceleration, None)
}
