//! The configuration that `track` needs for a scene of the papers: their band, size limits and tracker.
//!
//! The automatic choice of `track` is for real sensors. In the papers' scenes the background's noise is as bright as the target, and
//! only a band of levels about the target's tells them apart, which must be known beforehand.

use boresight::Config;
use boresight::sim::SceneConfig;
use boresight::sim::scene::{Background, Shape};
use boresight::vision::threshold::{BandConfig, ThresholdConfig};
use boresight_reproduce::initiation::{paper_detector, paper_tracker};

/// The configuration for scenes of rectangles on white noise; none for others.
pub fn for_scene(name: &str, scene: &SceneConfig) -> Option<Config> {
    let (Background::White(_), Some(Shape::Rectangle(r))) =
        (&scene.background, scene.targets.first().map(|t| &t.shape))
    else {
        return None;
    };
    let mut config = Config::default();
    config.input.rate_hz = scene.rate_hz;
    config.detector = paper_detector(true);
    // The papers' band is the target's mean ± 10; montecarlo is segmented above the noise, after a mean filter.
    let (low, high) = if name == "montecarlo" { (115.0, 255.0) } else { (r.mean - 10.0, r.mean + 10.0) };
    config.detector.threshold = ThresholdConfig::Band(BandConfig { low, high });
    config.detector.cluster.target_size_px = Some(r.size_px.map(|n| n as f64));
    if name == "montecarlo" {
        use boresight::vision::spatial::{SpatialConfig, WindowConfig};
        config.detector.filter = SpatialConfig::Mean(WindowConfig::default());
    }
    config.tracker = paper_tracker();
    let rate = scene.rate_hz;
    config.tracker.acceleration_std_px_per_s2 = config.tracker.acceleration_std_px_per_s2.map(|std| std * rate * rate);
    config.tracker.max_speed_px_per_s *= rate;
    config.tracker.coast_s /= rate;
    Some(config)
}
